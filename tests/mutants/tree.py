"""A private copy of the sources, in which one mutant at a time is built. The checkout is never touched."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DEVICE = ("Makefile", "pyproject.toml", "emu", "proto", "tools", "scripts")  # what an emulator is built from
TESTS = ("tests", "setup.py", "share", "examples")  # and what its tests are run from
SUITE = ("pyproject.toml", "scripts", "proto")  # what judges it
OWN, CHECKOUT_S = "build-mutants", "build"
BUILD_S = 600.0
# Of our own build: -O1 is half the time of the compiler; two arguments that change places must fit each other.
CFLAGS = "-O1 -Werror=int-conversion -Werror=incompatible-pointer-types -Werror=implicit-function-declaration"


class BuildError(Exception):
    """It does not compile; the words are the compiler's."""


def copy(parts: tuple[str, ...], root: Path, to: Path) -> None:
    """Parts of the repository, with their times, by which Python's compiled files still hold."""
    to.mkdir(parents=True)
    leave_out = shutil.ignore_patterns("*.pyc.*", "bundle")
    for part in parts:
        if (root / part).is_dir():
            shutil.copytree(root / part, to / part, ignore=leave_out)
        else:
            shutil.copy2(root / part, to / part)


class Tree:
    """An emulator's sources and what they are built into."""

    def __init__(self, folder: Path, root: Path = ROOT, *, borrow: bool = False, tests: bool = False) -> None:
        """Copies and builds the unmutated one. Raises BuildError.

        borrow: begin with what the checkout has built; tests: copy the tests, too.
        """
        self._borrow, self._tests = borrow, tests
        self.folder = folder / "device"
        self._name = CHECKOUT_S if borrow else OWN
        if not self.folder.is_dir():
            self._fetch(root)
        self.build()
        self._kept = folder / "kept"
        for name in {CHECKOUT_S, self._name}:
            shutil.copytree(self.folder / name, self._kept / name)

    def beside(self, folder: Path) -> Tree:
        """The same tree once more, for another thread; nothing is compiled. Raises BuildError."""
        shutil.copytree(self.folder, folder / "device")
        return Tree(folder, borrow=self._borrow, tests=self._tests)

    @property
    def emulator(self) -> Path:
        return self.folder / self._name / "psa-emu"

    def _fetch(self, root: Path) -> None:
        copy(DEVICE + (TESTS if self._tests else ()), root, self.folder)
        if self._borrow and (root / CHECKOUT_S / "obj").is_dir():
            for part in ("obj", "gen"):
                shutil.copytree(root / CHECKOUT_S / part, self.folder / CHECKOUT_S / part)

    def make(self, *goals: str) -> list[str]:
        """A command for these goals and settings, in `folder`."""
        words = ["make", "-j2", "--no-print-directory", f"PY={sys.executable}", f"BUILD={self._name}"]
        return [*words, *([f"CFLAGS={CFLAGS}"] if self._name == OWN else []), *goals]

    def env(self) -> dict[str, str]:
        """Of such a command: no jobs of a make around us."""
        env = {k: v for k, v in os.environ.items() if not k.startswith("MAKE") and k != "MFLAGS"}
        return env | {"PYTHONPATH": str(self.folder / "scripts")}

    def build(self) -> None:
        """Raises BuildError."""
        done = subprocess.run(
            self.make(f"{self._name}/psa-emu"),
            cwd=self.folder,
            env=self.env(),
            capture_output=True,
            text=True,
            timeout=BUILD_S,
            start_new_session=True,  # Ctrl-C is ours: half a build is no verdict
        )
        if done.returncode != 0:
            raise BuildError("\n".join(done.stderr.strip().splitlines()[-8:]))

    @contextmanager
    def mutated(self, file: str, text: str) -> Iterator[Path]:
        """The emulator with `text` as that file; afterwards all is as it was. Raises BuildError."""
        path = self.folder / file
        before, times = path.read_bytes(), path.stat()
        try:
            path.write_text(text, encoding="utf-8")
            self.build()
            yield self.emulator
        finally:
            path.write_bytes(before)
            os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
            self._restore()

    def _restore(self) -> None:
        """Files of the build that the mutant has made, as they were before: nothing is compiled twice."""
        for kept in self._kept.rglob("*"):
            path = self.folder / kept.relative_to(self._kept)
            if kept.is_file() and (not path.exists() or path.stat().st_mtime_ns != kept.stat().st_mtime_ns):
                path.unlink(missing_ok=True)  # a mutant that still runs keeps its file busy
                shutil.copy2(kept, path)
