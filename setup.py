"""Puts the compiled half into the wheel: what `make install` installs lies in psabench/bundle (docs/library.md).

An editable install compiles nothing: it finds the emulator and the library in build/ of its checkout.
"""

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from setuptools import Distribution, setup
from setuptools.command.bdist_wheel import bdist_wheel
from setuptools.command.build_py import build_py

ROOT = Path(__file__).resolve().parent
SCRATCH = ROOT / "build" / "wheel"  # build/ itself holds the emulator's objects
# For linking, with paths of this machine in them: who compiles against the library installs it with make.
NOT_IN_THE_WHEEL = ["lib/*.a", "lib/pkgconfig", "lib/*.so", "share/libsigrokdecode"]
# Manual pages and completion: beside the environment's bin, where man and the shells look.
OF_THE_PREFIX = ["share/man", "share/bash-completion", "share/zsh", "share/fish"]

SYSTEM = re.compile(r"linux-vdso|ld-linux|lib(c|m|dl|rt|pthread|gcc_s)\.so")  # each Linux has these


class BuildPy(build_py):
    """The Python files, and beside them the bundle."""

    def run(self) -> None:
        if not self.editable_mode:
            check_build_tools()
        super().run()
        if not self.editable_mode:
            bundle = Path(self.build_lib).resolve() / "psabench" / "bundle"
            install(bundle)
            self.distribution.data_files = list(moved_out(bundle, SCRATCH / "prefix"))


class BdistWheel(bdist_wheel):
    """Any Python 3 on this platform: the library is reached through ctypes."""

    def get_tag(self) -> tuple[str, str, str]:
        return "py3", "none", super().get_tag()[2]


class BinaryDistribution(Distribution):
    """Says that there are binaries, though setuptools compiles none of them."""

    def has_ext_modules(self) -> bool:
        return True


def check_build_tools() -> None:
    """Before anything is compiled: one line that names what is not there."""
    missing = subprocess.run(["tools/setup", "missing"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    if packages := missing.strip():
        sys.exit(f"psabench: build: expected {', '.join(packages.split())}, got none; apt-get install {packages}")


def install(bundle: Path) -> None:
    # A make that called us must not pass its flags on.
    env = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL", "DESTDIR")}
    env["PYTHONPATH"] = str(ROOT / "scripts")  # tools/gen_cli.py loads the parsers
    jobs = f"-j{os.cpu_count() or 1}"
    subprocess.run(
        [
            "make",
            "--no-print-directory",
            jobs,
            f"PY={sys.executable}",
            f"CLI={SCRATCH / 'cli'}",
            "DESTDIR=",
            f"PREFIX={bundle}",
            "install",
        ],
        cwd=ROOT,
        env=env,
        check=True,
    )
    for pattern in NOT_IN_THE_WHEEL:
        for path in bundle.glob(pattern):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    add_libraries(bundle)
    for binary in [*bundle.glob("bin/*"), *bundle.glob("lib/*.so.*")]:
        subprocess.run(["strip", "--strip-unneeded", binary], check=True)  # debug information names our folders


def moved_out(bundle: Path, prefix: Path) -> Iterator[tuple[str, list[str]]]:
    """What belongs beside bin, out of the bundle; folder and files each, as setuptools takes them."""
    for name in OF_THE_PREFIX:
        (prefix / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.move(bundle / name, prefix / name)
        for folder in sorted({path.parent for path in (prefix / name).rglob("*") if path.is_file()}):
            files = sorted(str(path.relative_to(ROOT)) for path in folder.iterdir() if path.is_file())
            yield str(folder.relative_to(prefix)), files


def add_libraries(bundle: Path) -> None:
    """What the emulator needs beside libc, so that a machine that installs the wheel needs no package of its system.

    The emulator looks in ../lib first (RPATH of the Makefile).
    """
    needed = subprocess.run(["ldd", bundle / "bin/psa-emu"], capture_output=True, text=True, check=True).stdout
    for name, path in re.findall(r"^\s*(\S+) => (/\S+)", needed, re.MULTILINE):
        if not SYSTEM.match(name):
            shutil.copyfile(path, bundle / "lib" / name)


if __name__ == "__main__":
    # A wheel is a zip: the same time for all files makes the same wheel of the same sources.
    os.environ.setdefault("SOURCE_DATE_EPOCH", "1577836800")
    shutil.rmtree(SCRATCH, ignore_errors=True)  # setuptools would pack what an earlier version left there
    setup(
        distclass=BinaryDistribution,
        cmdclass={"build_py": BuildPy, "bdist_wheel": BdistWheel},
        options={"build": {"build_base": str(SCRATCH)}},
    )
