"""Which build computes: digests of the files that numbers come from, in the key of what they give.

Two builds of one version may differ in the last digit (another compiler, other flags) or, while the code is being
changed, in every one. Each has its own series in the store.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from functools import cache
from pathlib import Path

from psabench.navlib import NAME, library
from psabench.places import PACKAGE, find_emulator

SHOWN = 12  # digits that people see


def short(build: str) -> str:
    """As people see it."""
    return build[:SHOWN]


@cache
def algebra() -> str:
    """SHA-256 of the libpsabench-nav that this process has loaded."""
    return hashlib.sha256(_loaded().read_bytes()).hexdigest()


@cache
def wire() -> str:
    """Of all that a run through the wire depends on: psa-emu, the library, and the host's end in Python."""
    return digest([find_emulator(), _loaded(), *sorted(PACKAGE.rglob("*.py"))])


def digest(files: Iterable[Path]) -> str:
    """SHA-256 of contents in this order; where the files lie does not matter."""
    whole = hashlib.sha256()
    for path in files:
        whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()


def _loaded() -> Path:
    """The library's file. One that the system's loader found by its name is told by the kernel."""
    path = Path(library().path)
    if path.is_file():
        return path
    maps = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    return next(Path(words[5]) for line in maps if len(words := line.split(maxsplit=5)) == 6 and NAME in words[5])
