"""Recordings of real parts: where they are, and how they are read.

They are no part of the project: the environment variable PSABENCH_RECORDINGS alone says where they are here,
docs/evidence.md where they are public. A test that needs them is skipped without it, with a reason that
tools/evidence.py knows.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

import pytest

VARIABLE = "PSABENCH_RECORDINGS"


def recorded_file(name: str, sha256: str) -> Path:
    """A file of the recordings, which is the one that a claim rests on. Skips the test where there are none."""
    folder = os.environ.get(VARIABLE)
    if not folder:
        pytest.skip(f"no recordings: {VARIABLE} is not set")
    path = Path(folder) / name
    found = hashlib.sha256(path.read_bytes()).hexdigest()
    assert found == sha256, f"{path}: expected the SHA-256 {sha256}, got {found}"
    return path
