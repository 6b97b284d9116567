"""Which build computes: digests of the files that numbers come from, in the key of what they give.

Two builds of one version may differ in the last digit (another compiler, other flags) or, while the code is being
changed, in every one. Each has its own series in the store.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path

from psabench.native.navlib import NAME, library
from psabench.places import PACKAGE, find_emulator, proto_file

SHOWN = 12  # digits that people see
WIRE_MODULE = "psabench.campaign.chains"  # what a worker calls
WIRE_PROTO = ("scenarios/gyrocompass.yaml", "psabench.dbc", "gyro.eds", "psa2.eds")  # profiles are in psa-emu


def short(build: str) -> str:
    """As people see it."""
    return build[:SHOWN]


@cache
def algebra() -> str:
    """SHA-256 of the libpsabench-nav that this process has loaded."""
    return hashlib.sha256(_loaded().read_bytes()).hexdigest()


@cache
def wire() -> str:
    """Of all that a run through the wire depends on: psa-emu, the library, the protocol's files, and the host's end in
    Python as far as it takes part."""
    return digest([find_emulator(), _loaded(), *map(proto_file, WIRE_PROTO), *sources(WIRE_MODULE)])


def digest(files: Iterable[Path]) -> str:
    """SHA-256 of contents in this order; where the files lie does not matter."""
    whole = hashlib.sha256()
    for path in files:
        whole.update(hashlib.sha256(path.read_bytes()).digest())
    return whole.hexdigest()


# ---- what a module of psabench imports


def sources(module: str) -> list[Path]:
    """Files of a module and of all of this package that it imports, at any depth and in functions, too; sorted."""
    found: set[Path] = set()
    todo = [module]
    while todo:
        for path in _files(todo.pop()):
            if path not in found:
                found.add(path)
                todo += _imports(path)
    return sorted(found)


def _files(name: str) -> Iterator[Path]:
    """Of a dotted name: of its packages, and its own; a name in a module has none."""
    package, *inner = name.split(".")
    if package != PACKAGE.name:
        return
    for depth in range(len(inner) + 1):
        at = PACKAGE.joinpath(*inner[:depth])
        yield from (path for path in (at / "__init__.py", at.with_suffix(".py")) if path.is_file())


def _imports(path: Path) -> Iterator[str]:
    """Dotted names that a file imports by absolute imports; the package has no others."""
    for node in ast.walk(ast.parse(path.read_bytes())):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module is not None:
            yield from (f"{node.module}.{a.name}" for a in node.names)


def _loaded() -> Path:
    """The library's file. One that the system's loader found by its name is reported by the kernel."""
    path = Path(library().path)
    if path.is_file():
        return path
    maps = Path("/proc/self/maps").read_text(encoding="utf-8").splitlines()
    return next(Path(words[5]) for line in maps if len(words := line.split(maxsplit=5)) == 6 and NAME in words[5])
