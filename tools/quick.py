#!/usr/bin/env python3
"""Build, and run the tests nearest to what changed since the last commit, within a minute: `make quick`.

Changed are the files that differ from HEAD, and untracked ones. Nearest first: changed tests, tests named after a
changed file, tests in the folder of the same name, tests that include, import or name it. Of a Python test file only
the tests of `make test` run. What does not fit into the time is left out, and said.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
OBJECTS = Path("build/obj")
C_SOURCES = (".c", ".h", ".cpp", ".hpp")
MAKE = ["make", "--no-print-directory", f"-j{os.cpu_count() or 1}"]
C_AT_MOST = 12  # test programs; each links the whole emulator
FILES_AT_MOST = 12  # of Python tests
BUDGET_S = 45.0  # no test begins after it
PYTHON_S = 10.0  # at the least, for Python tests, however long the build took
SHOWN = 6
PLACES = "not soak and not vcan and not slc0"
TOTAL = re.compile(r"check: (\d+) passed, (\d+) failed, (\d+) skipped")
COUNT = re.compile(r"(\d+) (passed|failed|errors?|skipped|xfailed|xpassed)\b")
LEFT = re.compile(r"left out: (\d+) tests?, .*")


def changed_files(root: Path) -> list[Path]:
    """Files that differ from the last commit; a deleted one counts. Raises CalledProcessError outside a checkout."""
    commands = (["git", "diff", "--name-only", "HEAD"], ["git", "ls-files", "--others", "--exclude-standard"])
    said = "".join(subprocess.run(c, cwd=root, check=True, capture_output=True, text=True).stdout for c in commands)
    return sorted({Path(line) for line in said.splitlines()})


def name_of(path: Path) -> str:
    """What a test of a file is called after; of __init__.py, main.c and board.c: the folder."""
    folder = path.parent.name
    shared = {"__init__", "main", "internal", "board", "can", "bus", "lines", "profile", "controller"}
    return folder if path.stem in shared | {"regs", "port", "pins", "conv", "filter", "fault"} else path.stem


def near_by_name(path: Path, test: Path) -> int | None:
    """Distance of a test from a changed file by their names; None when they have nothing in common."""
    if path == test:
        return 0
    name, stem = name_of(path), test.stem.removeprefix("test_")
    if stem in (name, f"{path.parent.name}_{path.stem}"):
        return 1
    if stem.startswith(f"{name}_") or stem.endswith(f"_{name}"):
        return 2
    folder = path.parts[1:-1] if path.parts[0] in ("emu", "nav", "tests") else path.parts[2:-1]
    if folder and test.parts[2:-1] == folder:
        return 3
    if len(folder) > 1 and (test.parent.name == folder[-1] or folder[-1] in stem.split("_")):
        return 4
    return None


def includes(dependencies: str, path: Path) -> bool:
    """Whether a .d file of the compiler has the file among its headers."""
    return f" {path} " in dependencies.replace("\\\n", " ").replace("\n", " ") + " "


@dataclass
class Choice:
    """Tests by how near they are, the nearest first."""

    run: list[Path] = field(default_factory=list)
    left: list[Path] = field(default_factory=list)

    @staticmethod
    def of(distances: dict[Path, int], most: int) -> Choice:
        order = sorted(distances, key=lambda test: (distances[test], str(test)))
        return Choice(order[:most], order[most:])


def c_choice(changed: Sequence[Path], root: Path, most: int = C_AT_MOST) -> Choice:
    """C test programs: by name, then those that include a changed header or the header of a changed source."""
    found: dict[Path, int] = {}
    sources = [p for p in changed if p.suffix in C_SOURCES]
    headers = [p.with_suffix(".h") if p.suffix == ".c" else p for p in sources]
    for test in sorted(p.relative_to(root) for p in (root / "tests/unit").rglob("test_*.c")):
        near = [d for path in sources if (d := near_by_name(path, test)) is not None]
        depends = root / OBJECTS / test.with_suffix(".d")
        if depends.exists():
            text = depends.read_text(encoding="utf-8")
            near += [5 for path in headers if path.parts[0] in ("emu", "nav", "tests") and includes(text, path)]
        if near:
            found[test] = min(near)
    return Choice.of(found, most)


def mentions(path: Path) -> re.Pattern[str]:
    """How a Python test names a file: its module, imported, or its path."""
    words = [re.escape(str(path)), rf"[\"'/]{re.escape(path.name)}[\"']"]
    if path.suffix == ".py":
        parts = path.with_suffix("").parts
        parts = parts[1:] if parts[0] in ("scripts", "tools") else parts[-1:]
        module = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        parent, _, name = module.rpartition(".")
        words.append(rf"\bimport {re.escape(module)}\b|\bfrom {re.escape(module)} import")
        if parent:
            words.append(rf"\bfrom {re.escape(parent)} import [^\n]*\b{re.escape(name)}\b")
    return re.compile("|".join(words))


def python_choice(changed: Sequence[Path], root: Path, most: int = FILES_AT_MOST) -> Choice:
    """Files of Python tests: by name, then those that import or name a changed file."""
    found: dict[Path, int] = {}
    patterns = {path: mentions(path) for path in changed}
    for test in sorted(p.relative_to(root) for p in (root / "tests").rglob("test_*.py")):
        text = (root / test).read_text(encoding="utf-8")
        near = [d for path in changed if (d := near_by_name(path, test)) is not None]
        near += [5 for path, pattern in patterns.items() if pattern.search(text)]
        if near:
            found[test] = min(near)
    return Choice.of(found, most)


def names(paths: Iterable[Path]) -> str:
    """Some of them, and how many more."""
    stems = [p.stem for p in paths]
    more = f" and {len(stems) - SHOWN} more" if len(stems) > SHOWN else ""
    return ", ".join(stems[:SHOWN]) + more


@dataclass
class Total:
    """What ran so far."""

    passed: int = 0
    failed: int = 0
    skipped: int = 0
    left: list[str] = field(default_factory=list)

    def step(self, title: str, command: Sequence[str]) -> bool:
        """Run a command, its output shown; counts its tests. Whether it ended well."""
        print(f"quick: {title}", flush=True)
        env = {k: v for k, v in os.environ.items() if k not in ("MAKEFLAGS", "MFLAGS", "MAKELEVEL")}
        failed = self.failed
        with subprocess.Popen(
            command, cwd=ROOT, env=env, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, errors="replace"
        ) as process:
            assert process.stdout is not None
            for line in process.stdout:
                print(line, end="", flush=True)
                self.count(line.rstrip("\n"))
        if process.returncode and self.failed == failed:
            self.failed += 1  # a compiler, a crash
        return process.returncode == 0

    def count(self, line: str) -> None:
        """A closing line of tools/run_c_tests.py or pytest."""
        if m := TOTAL.fullmatch(line):
            passed, failed, skipped = map(int, m.groups())
        elif m := LEFT.fullmatch(line):
            self.left.append(line.removeprefix("left out: "))
            return
        elif re.search(r" in [\d.]+s\b", line) and (found := COUNT.findall(line)):
            kinds = {kind.rstrip("s"): int(n) for n, kind in found}
            passed, skipped = kinds.get("passed", 0), kinds.get("skipped", 0) + kinds.get("xfailed", 0)
            failed = kinds.get("failed", 0) + kinds.get("error", 0) + kinds.get("xpassed", 0)
        else:
            return
        self.passed, self.failed, self.skipped = self.passed + passed, self.failed + failed, self.skipped + skipped


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point: 0 nothing failed, 1 something failed, 2 no checkout."""
    p = argparse.ArgumentParser(prog="quick.py", description=(__doc__ or "").split("\n")[0])
    p.add_argument("--seconds", type=float, default=BUDGET_S, metavar="S", help=f"time in all ({BUDGET_S:g})")
    p.add_argument("--list", action="store_true", help="print what would run, and run nothing")
    args = p.parse_args(argv)
    began_s = time.monotonic()
    try:
        changed = changed_files(ROOT)
    except (OSError, subprocess.CalledProcessError) as error:
        print(f"quick: expected a git checkout: {error}", file=sys.stderr)
        return 2
    c, python = c_choice(changed, ROOT), python_choice(changed, ROOT)
    print(f"quick: {len(changed)} changed: {names(changed) or 'nothing since the last commit'}")
    if args.list:
        print(f"C tests: {' '.join(map(str, c.run))}\nPython tests: {' '.join(map(str, python.run))}")
        return 0
    total = Total()
    if total.step("build", [*MAKE, "all"]):
        if c.run:
            total.step(f"C tests: {names(c.run)}", [*MAKE, "check", f"T={' '.join(t.stem for t in c.run)}"])
        if python.run:
            left_s = max(PYTHON_S, args.seconds - (time.monotonic() - began_s))
            run = [".venv/bin/python", "-m", "pytest", "-q", "--tier", "test", "-m", PLACES, f"--budget={left_s:.0f}"]
            total.step(f"Python tests: {names(python.run)}", [*run, *map(str, python.run)])
    else:
        total.left.append("all tests: the build failed")
    total.left += [f"{names(some.left)} ({kind})" for kind, some in (("C", c), ("Python", python)) if some.left]
    print(f"quick: left out: {'; '.join(total.left) or 'no test that is near'}; make test runs more")
    duration_s = time.monotonic() - began_s
    print(f"quick: {total.passed} passed, {total.failed} failed, {total.skipped} skipped in {duration_s:.0f} s")
    return 1 if total.failed else 0


if __name__ == "__main__":
    sys.exit(main())
