"""The tests of a mutated file's folder: what judges a random mutant that the conformance suite has not found.

C test programs are built and run in the private copy, Python tests run there with the mutant's emulator and library.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from tests.mutants.suite import end_group
from tests.mutants.tree import Tree

C_S, PYTHON_S = 300.0, 420.0  # of one folder
C, PYTHON = "C tests", "Python tests"

CHIPS = "tests/py/chips"
# By the beginning of a file's name, the first row that fits: patterns of C tests, Python tests.
TESTS: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "emu/chip/ads1282/": (("chip/ads1282/test_*.c",), (f"{CHIPS}/test_*ads1282.py", f"{CHIPS}/test_register_facts.py")),
    "emu/chip/ads1256/": (("chip/ads1256/test_*.c",), (f"{CHIPS}/test_*ads1256.py", f"{CHIPS}/test_register_facts.py")),
    "emu/chip/ad7712/": (("chip/ad7712/test_*.c",), (f"{CHIPS}/test_*ad7712.py", f"{CHIPS}/test_register_facts.py")),
    "emu/board/psa2/": (
        ("board/psa2/test_*.c",),
        (f"{CHIPS}/test_chip_timing_board.py", "tests/e2e/boards/test_unit.py"),
    ),
    "emu/board/psd1/": (("board/psd1/test_*.c",), ("tests/py/boards/test_psd1_timing.py",)),
    "emu/board/pmka/": (("board/pmka/test_*.c",), ("tests/e2e/boards/test_pmka.py",)),
    "emu/board/pik/": (("board/pik/test_*.c",), ("tests/e2e/boards/test_bus_cycles.py",)),
    "emu/board/gyro/": (("board/gyro/test_*.c",), ("tests/e2e/boards/test_gyro.py",)),
    "emu/board/receiver/": (("board/receiver/test_*.c",), ("tests/e2e/boards/test_receiver.py",)),
    "emu/board/": (("board/test_*.c", "unit/test_*.c"), ("tests/e2e/boards/test_bus_cycles.py",)),
    "emu/canopen/": (("canopen/test_*.c", "board/test_node*.c"), ("tests/e2e/boards/test_canopen.py",)),
    "emu/link/": (("link/test_*.c",), ("tests/e2e/faults/test_bad_lines.py", "tests/e2e/boards/test_cycles.py")),
}


def folder_of(file: str) -> str:
    """The row of TESTS that a file belongs to. Raises KeyError."""
    for prefix in TESTS:
        if file.startswith(prefix):
            return prefix
    raise KeyError(file)


def find_files(root: Path, patterns: Iterable[str]) -> list[Path]:
    """Files that there are."""
    return sorted(path for p in patterns for path in root.glob(p))


class FolderTests:
    """The tests in one private copy."""

    def __init__(self, tree: Tree) -> None:
        self._tree = tree
        self._sound: dict[tuple[str, str], bool] = {}

    def prepare(self, file: str, kinds: Sequence[str] = (C, PYTHON)) -> None:
        """Runs them once on the unmutated sources, which are built at this moment: what fails there tells nothing."""
        folder = folder_of(file)
        for kind in kinds:
            if (folder, kind) not in self._sound:
                self._sound[folder, kind] = self._passes(folder, kind)

    def failing(self, file: str) -> str:
        """C tests, Python tests: the first kind that finds what is built at this moment; "": none."""
        folder = folder_of(file)
        return next((k for k in (C, PYTHON) if self._sound.get((folder, k)) and not self._passes(folder, k)), "")

    def unsound(self, file: str) -> list[str]:
        """Kinds that fail without a mutant, too."""
        return [k for (folder, k), sound in self._sound.items() if folder == folder_of(file) and not sound]

    def _passes(self, folder: str, kind: str) -> bool:
        c, python = TESTS[folder]
        root = self._tree.folder
        if kind == C:
            names = " ".join(path.stem for path in find_files(root / "tests/unit", c))
            return self._ran(self._tree.make("check", f"T={names}"), C_S)
        tests = [str(path.relative_to(root)) for path in find_files(root, python)]
        words = ["-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-m", "not vcan and not slc0", *tests]
        return self._ran(self._tree.make("lib"), C_S) and self._ran([sys.executable, *words], PYTHON_S)

    def _ran(self, command: list[str], timeout_s: float) -> bool:
        """Whether it ended, in time, with 0 or, where every Python test is for another bench, with pytest's 5."""
        build = self._tree.emulator.parent
        env = self._tree.env() | {
            "PSA_EMU": str(self._tree.emulator),
            "PSABENCH_LIB": str(build / "libpsabench.so"),
            "PSABENCH_NAV_LIB": str(build / "libpsabench-nav.so"),
            "PYTHONPATH": os.pathsep.join(str(self._tree.folder / p) for p in ("scripts", "tools", ".")),
        }
        child = subprocess.Popen(
            command,
            cwd=self._tree.folder,
            env=env,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        try:
            return child.wait(timeout_s) in (0, 5)
        except subprocess.TimeoutExpired:
            return False
        finally:
            end_group(child)
