#!/usr/bin/env python3
"""The shape of the project: import circles, sizes of folders, what is named where, lines and files.

Usage:
    check_shape.py              print each metric with its limit; exit 1 if one is above its limit
    check_shape.py --list NAME  what the metric counts
    check_shape.py --root DIR   of another checkout

A limit above its goal is what there was when it was set: it may fall, never rise.
"""

from __future__ import annotations

import argparse
import ast
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = "scripts/psabench"
FOLDER_FILES = 30
ROOMS = ("emu", "scripts", "tests", "docs")
NOT_ROOMS = ("tests/fuzz/corpus", "docs/img")  # recorded data and pictures
# Numbers of objects of CANopen: the communication area, the boards' own, the profile area of PSA-2.
OBJECT = re.compile(r"\b0x(?:1[0-9A-Fa-f]{3}|2[0-3][0-9A-Fa-f]{2}|6[01][0-9A-Fa-f]{2}|91[0-9A-Fa-f]{2})\b")
GENERATED = (f"{PACKAGE}/boards/objects.py", f"{PACKAGE}/boards/parameters.py")  # by tools/gen_proto.py
BOARD = "pmka"  # the board by which it is measured how far a board's name spreads
BOARD_PLACES = (f"{PACKAGE}/boards/{BOARD}/", f"{PACKAGE}/boards/registry.py", *GENERATED)
SOURCES = (".c", ".h", ".cpp", ".hpp")


@dataclass(frozen=True, slots=True)
class Metric:
    """What was counted: one row of `found` for each; size where rows weigh more than one."""

    name: str
    found: tuple[str, ...]
    limit: int
    goal: int
    size: int | None = None

    @property
    def value(self) -> int:
        return len(self.found) if self.size is None else self.size


def tracked(root: Path) -> list[str]:
    """Files of the checkout that git knows or would add; a folder that is no checkout counts with all its files."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True)
    if done.returncode == 0:
        return sorted(f for f in set(done.stdout.splitlines()) if (root / f).is_file())
    return sorted(p.relative_to(root).as_posix() for p in root.rglob("*") if p.is_file())


def modules(root: Path) -> dict[str, ast.Module]:
    """Modules of the package by dotted name."""
    found = {}
    for path in sorted((root / PACKAGE).rglob("*.py")):
        parts = path.relative_to(root / "scripts").with_suffix("").parts
        found[".".join(parts).removesuffix(".__init__")] = ast.parse(path.read_text(encoding="utf-8"))
    return found


def imported(tree: ast.Module, known: Iterable[str]) -> Iterator[str]:
    """Modules of the package that a module imports: at its head, in functions, under TYPE_CHECKING."""
    names = set(known)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (a.name for a in node.names if a.name in names)
        elif isinstance(node, ast.ImportFrom) and node.module in names:
            inner = [f"{node.module}.{a.name}" for a in node.names]
            yield from (name if name in names else str(node.module) for name in inner)


def circles(graph: Mapping[str, set[str]]) -> list[list[str]]:
    """Groups of modules that reach each other, the largest first."""
    reach: dict[str, set[str]] = {}
    for start in graph:
        seen: set[str] = set()
        todo = [start]
        while todo:
            for there in graph.get(todo.pop(), set()) - seen:
                seen.add(there)
                todo.append(there)
        reach[start] = seen
    groups = {tuple(sorted(n for n in reach[m] if m in reach[n])) for m in graph if m in reach[m]}
    return sorted((list(g) for g in groups), key=lambda g: (-len(g), g))


def import_circles(root: Path) -> list[str]:
    trees = modules(root)
    graph = {name: set(imported(tree, trees)) - {name} for name, tree in trees.items()}
    return [" <-> ".join(group) for group in circles(graph)]


def large_folders(root: Path) -> list[str]:
    """Folders of the rooms with too many files of their own."""
    count = Counter(f.rpartition("/")[0] for f in tracked(root) if f.startswith(tuple(f"{r}/" for r in ROOMS)))
    return [f"{d}: {n} files" for d, n in sorted(count.items()) if n > FOLDER_FILES and d not in NOT_ROOMS]


def object_numbers(root: Path) -> list[str]:
    """Numbers of CANopen objects written by hand, by the tokens of the code: comments and texts are free."""
    found = []
    for path in sorted(set((root / PACKAGE).rglob("*.py")) - {root / g for g in GENERATED}):
        text = path.read_text(encoding="utf-8")
        lines = text.splitlines()
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Constant) and type(node.value) is int and node.end_col_offset is not None:
                written = lines[node.lineno - 1].encode()[node.col_offset : node.end_col_offset].decode()
                if OBJECT.fullmatch(written):
                    found.append(f"{path.relative_to(root).as_posix()}:{node.lineno}: {written}")
    return found


def places_of_board(root: Path) -> list[str]:
    paths = [p.relative_to(root).as_posix() for p in sorted((root / PACKAGE).rglob("*.py"))]
    outside = [p for p in paths if not p.startswith(BOARD_PLACES)]
    return [p for p in outside if BOARD in (root / p).read_text(encoding="utf-8").lower()]


def one_word_functions(root: Path) -> list[str]:
    """Functions, not methods, that are called by one word: neither grep nor a trace finds them."""
    found = []
    for name, tree in modules(root).items():
        for node in tree.body:
            if isinstance(node, ast.FunctionDef) and "_" not in node.name.strip("_") and node.name != "main":
                found.append(f"{name}.{node.name}")
    return found


def loose_modules(root: Path) -> list[str]:
    return [p.name for p in sorted((root / PACKAGE).glob("*.py")) if not p.name.startswith("__")]


def lines_of(root: Path, room: str, endings: tuple[str, ...]) -> int:
    chosen = [f for f in tracked(root) if f.startswith(f"{room}/") and f.endswith(endings) and f not in GENERATED]
    return sum(len((root / f).read_text(encoding="utf-8").splitlines()) for f in chosen)


@dataclass(frozen=True, slots=True)
class Rule:
    """How a metric is counted: rows, or one number for rows that weigh more than one."""

    count: Callable[[Path], Iterable[str] | int]
    limit: int
    goal: int


RULES = {
    "import-circles": Rule(import_circles, 0, 0),
    "folders-over-30-files": Rule(large_folders, 0, 0),
    "loose-modules": Rule(loose_modules, 14, 14),
    "object-numbers": Rule(object_numbers, 0, 0),
    f"modules-that-name-{BOARD}": Rule(places_of_board, 3, 3),
    "one-word-functions-python": Rule(one_word_functions, 982, 982),
    # 47,300, 38,500 and 1,400 before LCM, MAVLink, the logic analyser, UDS, cannelloni, more logs and recorded units;
    # 56,900 of the emulator before fleets and temperature conversions that are skipped.
    # 59,500, 60,700 and 1,980 before the aircraft, the unit's own navigation, the methods beside the filter.
    # 61,700, 62,300 and 2,050 before the satellite receiver, the filter with it and faults of gyros.
    # 63,900, 63,500 and 2,130 before flights over the wire, seasons, fleets and the articles' index.
    # 64,140, 68,580 and 2,211 before the articles' last devices: modes of heading, MEMS gyros, pairs, climates.
    # 65,350, 72,772 and 2,302 before the panel, viewers, packages, notebooks, site and reports in Russian.
    # 65,414, 74,878 and 2,392 before JSON of every command, the panel's forks, scenarios, recordings and drawn views.
    # 65,738, 76,853 and 2,451 before recorded lines in the panel, decoded rows in GTKWave and one form for bad paths.
    "lines-emu": Rule(lambda root: lines_of(root, "emu", SOURCES), 65_803, 65_803),
    "lines-scripts": Rule(lambda root: lines_of(root, "scripts", (".py",)), 78_564, 78_564),
    "tracked-files": Rule(lambda root: len(tracked(root)), 2_486, 2_486),
}


def metrics(root: Path, names: Iterable[str] = RULES) -> Iterator[Metric]:
    """The metrics of these names, counted one after the other."""
    for name in names:
        rule = RULES[name]
        found = rule.count(root)
        rows, size = ((), found) if isinstance(found, int) else (tuple(found), None)
        yield Metric(name, rows, rule.limit, rule.goal, size)


def main(argv: list[str] | None = None) -> int:
    """Command line; returns the exit status."""
    p = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    p.add_argument("--list", metavar="NAME", help="what this metric counts")
    p.add_argument("--root", type=Path, default=ROOT, metavar="DIR", help="of another checkout")
    args = p.parse_args(argv)
    if args.list is not None:
        if args.list not in RULES:
            print(f"--list: expected {', '.join(RULES)}, got {args.list}", file=sys.stderr)
            return 2
        print("\n".join(next(metrics(args.root, [args.list])).found))
        return 0
    found = list(metrics(args.root))
    above = [m for m in found if m.value > m.limit]
    for m in found:
        goal = "" if m.limit == m.goal else f", goal {m.goal}"
        print(f"shape: {m.name} {m.value} (limit {m.limit}{goal})")
    for m in above:
        rows = "".join(f"\n  {row}" for row in m.found[:20])
        print(f"shape: {m.name}: expected at most {m.limit}, got {m.value}{rows}", file=sys.stderr)
    return int(bool(above))


if __name__ == "__main__":
    sys.exit(main())
