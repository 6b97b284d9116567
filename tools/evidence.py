#!/usr/bin/env python3
"""Evidence of the models: what is proved by what (docs/evidence.yaml), and at which source it was (docs/evidence.lock).

Usage:
    evidence.py --check            exit 1 if a model file is not the one that was proved, or is in no group
    evidence.py --prove [GROUP...] run the tests of these groups (of those that are stale; "all") and, where every one
                                   of them passed and none was skipped, write their files into the lock
    evidence.py --root DIR         of another checkout

Tests of recordings of silicon (a group's `recordings`) are proved and locked apart: without the recordings, which are
not in the repository, what they last said is kept, and --check notes that it was of other sources.

A file's digest is that of its tokens: comments, blank space and lines do not count (docs/evidence.md).
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml
from find_tests import collected_in_python, registered_in_c
from protogen.source import parse_yaml

ROOT = Path(__file__).resolve().parents[1]
LEDGER, LOCK = "docs/evidence.yaml", "docs/evidence.lock"
MODELS = (
    *(f"emu/{folder}" for folder in ("base", "board", "canopen", "chip", "phys", "trace", "unit")),
    "nav",
)  # folders whose files must be in a group
SOURCES = (".c", ".h", ".cpp", ".hpp")
NO_RECORDINGS = "no recordings"  # how a test of recordings is skipped without them: tests/py/support/recordings.py
RUNGS = ("E2", "E3", "E4", "E5", "E6")  # that a test can be on; what is our own test of our own code is on none
LOCK_HEAD = (
    "# Written by `make prove`: group, file, SHA-256 of its tokens when the group's tests last passed. Not by hand.\n"
)
TOKEN = re.compile(
    r"""(?P<comment>//(?:\\\n|[^\n])*|/\*.*?\*/)
      | (?P<directive>^[ \t]*\#[ \t]*\w*)
      | (?P<text>"(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*')
      | (?P<splice>\\\n)
      | (?P<newline>\n)
      | (?P<space>[ \t\r\f\v]+)
      | (?P<word>\.?\d(?:[eEpP][+-]|[\w.])*|\w+)
      | (?P<sign>\.\.\.|<<=|>>=|->|\+\+|--|<<|>>|&&|\|\||\#\#|::|[-+*/%&|^<>=!]=|.)""",
    re.VERBOSE | re.DOTALL | re.MULTILINE,
)


class EvidenceError(Exception):
    """One line: what is wrong with the ledger or the lock."""


def tokens(source: str) -> Iterator[str]:
    """The tokens of C or C++; a directive ends with its line, and blanks in it count: `#define F (x)` is not `F(x)`."""
    directive = False
    blank = False
    for m in TOKEN.finditer(source):
        kind = m.lastgroup
        if kind == "newline":
            if directive:
                yield "\n"
            directive = blank = False
        elif kind in ("comment", "space", "splice"):
            blank = True
        else:
            if directive and blank:
                yield " "
            blank = False
            if kind == "directive":
                directive = True
                yield "#" + m[0].strip(" \t#")
            else:
                yield m[0]


def normalised(name: str, text: str) -> str:
    """What of a file has a meaning: tokens of C, values of YAML."""
    if name.endswith((".yaml", ".yml")):
        return json.dumps(parse_yaml(text), sort_keys=True, default=str)
    return "\0".join(tokens(text))


def digest(path: Path) -> str:
    return hashlib.sha256(normalised(path.name, path.read_text(encoding="utf-8")).encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Group:
    """Files of one model and the runs that prove them: test files, or "conform BOARD PROFILE"; and tests that compare
    it with recordings of silicon."""

    name: str
    title: str
    files: tuple[str, ...]
    tests: tuple[str, ...]
    recordings: tuple[str, ...] = ()

    @property
    def recorded(self) -> Group:
        """The same files as the recordings judge them."""
        return Group(f"{self.name}+E5", self.title, self.files, self.recordings)


@dataclass(frozen=True, slots=True)
class Claim:
    """What is claimed of a subject, the rung it is on, and the tests that carry it, "file" or "file:name"."""

    subject: str
    claim: str
    rung: str
    tests: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Ledger:
    """docs/evidence.yaml. `rungs`: test file or file:name to its rung and why it is of that rung."""

    ladder: Mapping[str, str]
    groups: tuple[Group, ...]
    rungs: Mapping[str, tuple[str, str]]
    claims: tuple[Claim, ...]

    def rung_of(self, test: str) -> str:
        """E3 or E4 of a test "path:name", "" for one of our own making."""
        found = self.rungs.get(test) or self.rungs.get(test.split(":")[0])
        return found[0] if found else ""


def load(root: Path = ROOT) -> Ledger:
    """The ledger, with the files of each group as they are now. Raises EvidenceError."""
    try:
        data: dict[str, Any] = parse_yaml((root / LEDGER).read_text(encoding="utf-8"))
        groups = tuple(
            Group(
                name,
                g["title"],
                tuple(expand(root, g["files"])),
                tuple(expand_tests(root, g["tests"])),
                tuple(expand(root, g.get("recordings", []))),
            )
            for name, g in data["groups"].items()
        )
        groups += tuple(board_group(root, b) for b in board_folders(root) if b not in data["groups"])
        rungs = {test: (rung, why) for rung, rows in data["rungs"].items() for test, why in rows.items()}
        claims = tuple(Claim(c["subject"], c["claim"], c["rung"], tuple(c["tests"])) for c in data["claims"])
        return Ledger(data["ladder"], groups, rungs, claims)
    except (OSError, yaml.YAMLError, KeyError, TypeError, AttributeError) as e:
        raise EvidenceError(f"{LEDGER}: {' '.join(str(e).split())}") from e


def board_folders(root: Path) -> list[str]:
    return sorted(folder.name for folder in (root / "emu/board").glob("*/"))


def board_group(root: Path, board: str) -> Group:
    """Of a board that the ledger does not name."""
    patterns = (f"emu/board/{board}/*.[ch]", f"proto/{board}.yaml", f"proto/profiles/{board}*.yaml")
    files = [p.relative_to(root).as_posix() for pattern in patterns for p in sorted(root.glob(pattern))]
    tests = [p.relative_to(root).as_posix() for p in sorted(root.glob(f"tests/unit/board/{board}/test_*.c"))]
    return Group(board, board.upper(), tuple(files), (*tests, f"conform {board} {board}"))


def expand(root: Path, patterns: Iterable[str]) -> Iterator[str]:
    """Files of the patterns, in order; "!pattern" takes away again."""
    found: dict[str, None] = {}
    for pattern in patterns:
        names = sorted(p.relative_to(root).as_posix() for p in root.glob(pattern.removeprefix("!")))
        if not names:
            raise EvidenceError(f"{LEDGER}: no file is like {pattern}")
        for name in names:
            if pattern.startswith("!"):
                found.pop(name, None)
            else:
                found[name] = None
    return iter(found)


def expand_tests(root: Path, patterns: Iterable[str]) -> Iterator[str]:
    for pattern in patterns:
        yield from [pattern] if pattern.startswith("conform ") else expand(root, [pattern])


def read_lock(root: Path) -> dict[tuple[str, str], str]:
    """(group, file): digest. Empty when there is none."""
    path = root / LOCK
    rows = [line.split() for line in path.read_text().splitlines() if line[:1] != "#"] if path.is_file() else []
    if any(len(row) != 3 for row in rows):
        raise EvidenceError(f"{LOCK}: a line is group, file, digest; `make prove GROUP=all` writes it again")
    return {(group, file): value for group, file, value in rows}


def now(root: Path, group: Group) -> dict[tuple[str, str], str]:
    return {(group.name, file): digest(root / file) for file in group.files}


def changes(root: Path, group: Group, lock: Mapping[tuple[str, str], str]) -> list[str]:
    """What differs from the sources at which the group was proved; empty if nothing does."""
    mine = {key: value for key, value in lock.items() if key[0] == group.name}
    if not mine:
        return ["no evidence has been recorded"]
    have = now(root, group)
    found = [f"{file} changed" for (_, file), value in have.items() if mine.get((group.name, file), value) != value]
    found += [f"{file} is new" for _, file in have if (group.name, file) not in mine]
    return found + [f"{file} is gone" for _, file in mine if (group.name, file) not in have]


def stale(root: Path, ledger: Ledger) -> dict[str, list[str]]:
    """Groups whose evidence is older than their files, each with what changed."""
    lock = read_lock(root)
    found = {g.name: changes(root, g, lock) for g in ledger.groups}
    return {name: what for name, what in found.items() if what}


def not_judged_again(root: Path, ledger: Ledger) -> dict[str, list[str]]:
    """Groups whose recordings were last compared with other sources, each with what changed."""
    lock = read_lock(root)
    found = {g.name: changes(root, g.recorded, lock) for g in ledger.groups if g.recordings}
    return {name: what for name, what in found.items() if what}


def faults(root: Path, ledger: Ledger) -> Iterator[str]:
    """What is wrong with the ledger itself."""
    owner: dict[str, str] = {}
    for group in ledger.groups:
        for file in group.files:
            if file in owner:
                yield f"{file} is in two groups, {owner[file]} and {group.name}"
            owner[file] = group.name
    for folder in MODELS:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in SOURCES and path.relative_to(root).as_posix() not in owner:
                yield f"{path.relative_to(root)} is in no group of {LEDGER}: nothing says what proves it"
    subjects = {g.name for g in ledger.groups}
    for claim in ledger.claims:
        if claim.subject not in subjects:
            yield f'claim "{claim.claim}": {claim.subject} is no group'
        if claim.rung not in RUNGS or claim.rung not in {ledger.rung_of(t) for t in claim.tests}:
            yield f'claim "{claim.claim}": none of its tests is on rung {claim.rung}'
    for test in {t for c in ledger.claims for t in c.tests} | set(ledger.rungs):
        if not exists(root, test):
            yield f"{LEDGER}: {test} is no test that is run"


def exists(root: Path, test: str) -> bool:
    file, _, name = test.partition(":")
    path = root / file
    if not path.is_file():
        return False
    names = (registered_in_c if path.suffix == ".c" else collected_in_python)(path.read_text(encoding="utf-8"))
    return name in names if name else bool(names)


# ---- proving


def command_of(root: Path, tests: list[str], junit: Path) -> list[str]:
    """How tests of one kind are run."""
    if tests[0].startswith("conform "):
        _, board, profile = tests[0].split()
        program = [str(root / ".venv/bin/psabench"), "conform", "device"]
        return [*program, "--board", board, "--profile", profile]
    if tests[0].endswith(".c"):
        return ["make", "--no-print-directory", "check", "TESTS=" + " ".join(Path(t).stem for t in tests)]
    marks = "not vcan and not slc0 and not soak"
    return [str(root / ".venv/bin/python"), "-m", "pytest", "-q", "-m", marks, f"--junitxml={junit}", *tests]


def kinds(tests: Iterable[str]) -> list[list[str]]:
    """Tests that one command runs together: all C tests, all of pytest, each run of the suite."""
    tests = list(tests)
    c = [t for t in tests if t.endswith(".c")]
    py = [t for t in tests if t.endswith(".py")]
    return [run for run in [c, py, *([t] for t in tests if t.startswith("conform "))] if run]


def run_tests(root: Path, tests: list[str]) -> str:
    """Runs tests of one kind; "" if all passed and none was skipped, else the reason."""
    with tempfile.TemporaryDirectory() as folder:
        junit = Path(folder) / "junit.xml"
        argv = command_of(root, tests, junit)
        print("$ " + " ".join(a for a in argv if not a.startswith("--junitxml")), flush=True)
        status = subprocess.run(argv, cwd=root, check=False, env={**os.environ, "PYTHONUNBUFFERED": "1"}).returncode
        if status:
            return f"status {status}"
        if not tests[0].endswith(".py"):
            return ""
        skipped = [s.get("message", "") for s in ElementTree.parse(junit).iter("skipped")]
        return f"{len(skipped)} skipped: {skipped[0]}" if skipped else ""


def prove(
    root: Path, ledger: Ledger, names: Iterable[str], run: Callable[[Path, list[str]], str] = run_tests
) -> dict[str, str]:
    """Runs what the groups rest on, each test once, and locks those that passed. Group: why it is not proved."""
    named = [g for g in ledger.groups if g.name in set(names)]
    wanted = named + [g.recorded for g in named if g.recordings]
    before = {g.name: now(root, g) for g in wanted}
    results: dict[tuple[str, ...], str] = {}
    for tests in kinds(dict.fromkeys(t for g in wanted for t in g.tests)):
        failed = run(root, tests)
        if failed and len(tests) > 1:  # which of them
            for test in tests:
                results[(test,)] = run(root, [test])
        else:
            results |= dict.fromkeys([(t,) for t in tests], failed)
    lock = read_lock(root)
    reasons: dict[str, str] = {}
    for group in wanted:
        bad = [f"{t}: {results[(t,)]}" for t in group.tests if results[(t,)]]
        if not bad and now(root, group) != before[group.name]:
            bad = ["its files changed while the tests ran"]
        if bad:
            if any(NO_RECORDINGS not in b for b in bad):
                reasons[group.name] = "; ".join(bad)
            continue
        lock = {key: value for key, value in lock.items() if key[0] != group.name} | before[group.name]
    names_in_order = [name for g in ledger.groups for name in (g.name, g.recorded.name)]
    order = {name: i for i, name in enumerate(names_in_order)}
    rows = sorted(((order[g], f, v) for (g, f), v in lock.items() if g in order))
    (root / LOCK).write_text(LOCK_HEAD + "".join(f"{names_in_order[i]} {f} {v}\n" for i, f, v in rows))
    return reasons


def recordings_are_here() -> bool:
    return bool(os.environ.get("PSABENCH_RECORDINGS"))


def runs(tests: Iterable[str]) -> str:
    """What proves a group, in a line: C tests by their number."""
    tests = list(tests)
    c = sum(t.endswith(".c") for t in tests)
    return ", ".join([f"{c} files of C tests", *(Path(t).name for t in tests if not t.endswith(".c"))])


def report(root: Path, ledger: Ledger) -> list[str]:
    """The lines of --check."""
    lines = list(faults(root, ledger))
    tests = {g.name: g.tests for g in ledger.groups}
    for name, what in stale(root, ledger).items():
        lines.append(
            f"{name} is stale, its evidence is of other sources: {', '.join(what)}. "
            f"`make prove GROUP={name}` proves it again by {runs(tests[name])}"
        )
    return lines


def main(argv: list[str] | None = None) -> int:
    """Command line; see the module's text. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--check", action="store_true", help="exit 1 if evidence is older than the models")
    what.add_argument("--prove", nargs="*", metavar="GROUP", help="run tests of stale groups, of these, or of all")
    parser.add_argument("--root", type=Path, default=ROOT, metavar="DIR", help="of another checkout")
    args = parser.parse_args(argv)
    root: Path = args.root
    try:
        ledger = load(root)
        if args.check:
            lines = report(root, ledger)
            for name, why in not_judged_again(root, ledger).items():
                print(f"evidence: {name}: E5 not judged again, its recordings: {', '.join(why)}")
        else:
            known = [g.name for g in ledger.groups]
            if unknown := set(args.prove) - {*known, "all"}:
                raise EvidenceError(f"no group {', '.join(sorted(unknown))}; there are {', '.join(known)}")
            unproved = {**stale(root, ledger), **(not_judged_again(root, ledger) if recordings_are_here() else {})}
            names = known if "all" in args.prove else args.prove or list(unproved)
            reasons = prove(root, ledger, names)
            print(f"evidence: {len(set(names) - set(reasons))} of {len(names)} groups proved")
            lines = [f"{name} is not proved: {why}" for name, why in reasons.items()]
    except EvidenceError as e:
        lines = [str(e)]
    for line in lines:
        print(f"evidence: {line}", file=sys.stderr)
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
