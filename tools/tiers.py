"""Which tests `make test` runs: the table tests/tiers.toml, for pytest, the C tests and `make quick`.

`make test` runs the tests of tier `test`, `make test-all` every test; `rest` is what `make test` leaves out.
"""

from __future__ import annotations

import sys
import tomllib
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "tests/tiers.toml"
TIERS = ("test", "all")
CHOICES = ("test", "rest", "all")
SECTIONS = {"c": "tests/unit", "python": "tests"}  # where their files are, at any depth
KEYS = {"c": {"tier", "long"}, "python": {"tier", "sample", "all"}}


@dataclass(frozen=True, slots=True)
class Row:
    """What the table says about a file."""

    tier: str = "test"
    sample: int = 1
    """Of a parametrized test function, make test runs the first case and every so many-th after it."""
    all: tuple[str, ...] = ()
    """Test functions, or cases as globs, that only make test-all runs."""
    long: bool = False
    """Of a C test program: takes seconds, a minute under sanitizers."""


@dataclass(frozen=True, slots=True)
class Table:
    """Rows by file name, or by the end of the path where two files have the same name."""

    c: Mapping[str, Row]
    python: Mapping[str, Row]

    def row(self, path: Path) -> Row | None:
        """Row of a test file; the longest name that fits. None without one."""
        rows = self.c if path.suffix == ".c" else self.python
        names = [name for name in rows if path.match(name)]
        return rows[max(names, key=len)] if names else None


def load(path: Path = TABLE) -> Table:
    """The table. Raises ValueError with the row that is wrong."""
    text = tomllib.loads(path.read_text(encoding="utf-8"))
    if set(text) != set(SECTIONS):
        raise ValueError(f"{path.name}: expected the tables {', '.join(SECTIONS)}, got {', '.join(text)}")
    return Table(
        **{s: {name: _row(f"{path.name}: {name}", s, value) for name, value in text[s].items()} for s in SECTIONS}
    )


def _row(where: str, section: str, value: Any) -> Row:
    fields = {"tier": value} if isinstance(value, str) else value
    if not isinstance(fields, dict) or not fields.keys() <= KEYS[section]:
        raise ValueError(f"{where}: expected a tier or a table of {', '.join(sorted(KEYS[section]))}, got {value!r}")
    if fields.get("tier", "test") not in TIERS:
        raise ValueError(f"{where}: tier: expected {' or '.join(TIERS)}, got {fields['tier']!r}")
    sample = fields.get("sample", 1)
    if not isinstance(sample, int) or sample < 1:
        raise ValueError(f"{where}: sample: expected a number of 1 or more, got {sample!r}")
    return Row(**fields | {"all": tuple(fields.get("all", ()))})


def files_of_tests(root: Path = ROOT) -> list[Path]:
    """Every test file: C test programs and what pytest collects."""
    found = [(root / "tests/unit").rglob("test_*.c"), (root / "tests").rglob("test_*.py")]
    return sorted(path.relative_to(root) for some in found for path in some)


def unmatched(table: Table, files: Iterable[Path]) -> list[str]:
    """Files without a row and rows without a file, one message each."""
    files = list(files)
    said = [f"{path}: expected a row in tests/tiers.toml" for path in files if table.row(path) is None]
    for section, rows in (("c", table.c), ("python", table.python)):
        for name in rows:
            if not any(path.match(name) and (path.suffix == ".c") == (section == "c") for path in files):
                said.append(f"tests/tiers.toml: [{section}] {name}: expected a file of this name")
    return said


def _named(some: str, function: str, name: str) -> bool:
    """Whether an entry of `all` has a test. Brackets are literal here: names of cases are full of them."""
    return any(fnmatchcase(n, some.replace("[", "[[]")) for n in (function, name))


def unused(table: Table, tests: Iterable[tuple[Path, str, str, Hashable]]) -> list[str]:
    """Entries of `all` that fit no test, one message each; the tests are all of their files."""
    names: dict[Path, set[tuple[str, str]]] = {}
    for path, function, case, _ in tests:
        names.setdefault(path, set()).add((function, f"{function}[{case}]"))
    return [
        f"tests/tiers.toml: {path.name}: expected a test named {some}"
        for path, tests_of in names.items()
        for some in (table.row(path) or Row()).all
        if not any(_named(some, *test) for test in tests_of)
    ]


def in_test(table: Table, tests: Sequence[tuple[Path, str, str, Hashable]]) -> list[bool]:
    """Of each test (file, function, case, group), whether make test runs it.

    Cases of one function and group are counted as they come: the sample is the same each time and on each machine.
    """
    seen: Counter[Hashable] = Counter()
    chosen = []
    rows = {path: table.row(path) or Row() for path in {test[0] for test in tests}}  # once a file, not once a test
    for path, function, case, group in tests:
        row = rows[path]
        name = f"{function}[{case}]" if case else function
        out = row.tier == "all" or any(_named(some, function, name) for some in row.all)
        key = (path, function, group)
        chosen.append(not out and seen[key] % row.sample == 0)
        seen[key] += not out
    return chosen


def has_none(row: Row | None, tier: str) -> bool:
    """Whether a Python file has no test of a choice of tiers, as far as its row alone says."""
    if row is None or tier == "all":
        return False
    return row.tier == "all" if tier == "test" else row == Row()


def c_tests(table: Table, tier: str, root: Path = ROOT) -> list[Path]:
    """C test programs of a choice of tiers, those that take long first: no core waits for the last one."""
    rows = {path: table.row(path) or Row() for path in files_of_tests(root) if path.suffix == ".c"}
    files = sorted(rows, key=lambda path: rows[path].tier == "test" and not rows[path].long)
    return [path for path in files if tier == "all" or (rows[path].tier == "test") == (tier == "test")]


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1] not in CHOICES:
        sys.exit("usage: tiers.py test|rest|all: names of the C tests")
    print(*(path.stem for path in c_tests(load(), sys.argv[1])))
