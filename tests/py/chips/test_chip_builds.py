"""Compilers and optimisation change nothing: libraries built differently answer a long random session alike.

The session (random_session.py) asks every part under random options by pins, bytes, registers and frames. Its seed is
printed and taken back from TEST_SEED.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
SESSION = ROOT / "tests/py/support/random_session.py"
SEED = os.environ.get("TEST_SEED", "20250214")

# As `make builds` makes them; built here when somebody runs this test alone.
BUILDS = {
    "build": ["CC=gcc"],
    "build-O0": ["CC=gcc", "CFLAGS=-O0 -g", "BUILD=build-O0"],
    "build-O3": ["CC=gcc", "CFLAGS=-O3 -g", "BUILD=build-O3"],
    "build-clang": ["CC=clang"],
    "build-clang-O0": ["CC=clang", "CFLAGS=-O0 -g", "BUILD=build-clang-O0"],
}


def library(build: str) -> Path:
    """The library of a build, up to date."""
    env = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "CC", "CFLAGS", "SAN")}
    done = subprocess.run(
        ["make", "-s", f"-j{os.cpu_count() or 1}", *BUILDS[build], f"{build}/libpsabench.so"],
        cwd=ROOT,
        env=env,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, f"{build}: {done.stderr}"
    return next((ROOT / build).glob("libpsabench.so.[0-9]*"))


def answers(so: Path) -> str:
    """What a library says: hash, calls, edges."""
    env = os.environ | {"PSABENCH_LIB": str(so), "PYTHONPATH": str(ROOT / "scripts")}
    done = subprocess.run(
        [sys.executable, str(SESSION), SEED], env=env, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, f"{so}: {done.stderr}"
    return done.stdout.strip()


@pytest.mark.timeout(900)  # five libraries to compile, when nothing is built yet
def test_compilers_and_optimisation_change_no_answer() -> None:
    print(f"TEST_SEED={SEED}")
    found = {build: answers(library(build)) for build in BUILDS}
    print("\n".join(f"{build}: {line}" for build, line in found.items()))
    assert len(set(found.values())) == 1, found
    calls, edges = (int(x) for x in found["build"].split()[1:])
    assert calls > 5000
    assert edges > 50_000
