"""Do the unit tests find what is wrong? Random mutants of a folder, judged by the tests nearest to them."""

from __future__ import annotations

import argparse
import json
import os
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol

import between
from psabench.link.own import replace_file
from quick import PLACES, mentions, near_by_name, python_choice

from tests.mutants.declared import Mutant
from tests.mutants.folder_tests import TESTS, C, FolderTests
from tests.mutants.operators import places
from tests.mutants.python_operators import python_places
from tests.mutants.random_mutants import mutant_of
from tests.mutants.report import interval, percent
from tests.mutants.suite import end_group
from tests.mutants.tree import ROOT, BuildError, Tree

OUT = ROOT / "build" / "unit_mutants.json"
PAGE = ROOT / "docs/reference/mutants.md"
FILES_AT_MOST, TESTS_S = 5, 150.0  # of Python tests nearest to a file, and the time that they may take

EPILOG = """\
A mutant is killed when the tests nearest to its file fail, or do not end. C (emu/...): the C tests of its folder.
Python (scripts/psabench/...): five files of tests/py: named after it, then importing it, then of its folder. Nothing
tells which of
those that survive change nothing at all: the rate is the least that the tests find.

examples (in the root of a checkout; make mutate MUTATE='...'):
  python -m tests.mutants.unit_mutants emu/chip/ads1256 --sample 20
  python -m tests.mutants.unit_mutants scripts/psabench/estimate scripts/psabench/link --seconds 600

What has been judged is in build/unit_mutants.json and is not judged again as long as its file is the same.
"""


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Of one mutant. result: killed, survived, not judged (its tests fail without it, or it does not compile)."""

    id: str
    kind: str
    file: str
    stamp: str
    folder: str
    result: str
    was: str = ""  # the line before
    now: str = ""


class Tests(Protocol):
    """A private copy and its tests."""

    def judge(self, m: Mutant) -> str: ...


class CTests:
    """C tests of a file's folder."""

    def __init__(self, folder: Path) -> None:
        self._tree = Tree(folder / "c", tests=True)
        self._tests = FolderTests(self._tree)

    def judge(self, m: Mutant) -> str:
        """See Verdict.result."""
        self._tests.prepare(m.file, kinds=(C,))
        if self._tests.unsound(m.file):
            return "not judged"
        try:
            with self._tree.mutated(m.file, m.applied((self._tree.folder / m.file).read_text(encoding="utf-8"))):
                return "killed" if self._tests.failing(m.file) else "survived"
        except BuildError:
            return "not judged"


class PythonTests:
    """The Python tests nearest to a file, in a copy of what git has of this checkout; build and .venv are its own."""

    def __init__(self, folder: Path) -> None:
        self._root = folder / "python"
        listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, check=True, capture_output=True, text=True).stdout
        for name in filter(None, listed.split("\0")):
            if (ROOT / name).is_file():
                (self._root / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, self._root / name)
        for name in ("build", ".venv"):
            (self._root / name).symlink_to(ROOT / name)
        self._sound: dict[tuple[Path, ...], bool] = {}

    def judge(self, m: Mutant) -> str:
        """See Verdict.result."""
        tests = self._nearest(Path(m.file))
        if not tests:
            return "survived"
        if tests not in self._sound:
            self._sound[tests] = self._passes(tests)
        if not self._sound[tests]:
            return "not judged"
        path = self._root / m.file
        text = path.read_text(encoding="utf-8")
        try:
            path.write_text(m.applied(text), encoding="utf-8")
            return "survived" if self._passes(tests) else "killed"
        finally:
            path.write_text(text, encoding="utf-8")

    def _nearest(self, file: Path) -> tuple[Path, ...]:
        """Named after it, then those that import it, then those of its folder."""
        near, imports = python_choice([file], self._root, most=100).run, mentions(file)

        def distance(test: Path) -> tuple[bool, bool]:
            text = (self._root / test).read_text(encoding="utf-8")
            return (near_by_name(file, test) or 9) > 2, not imports.search(text)

        return tuple(sorted((t for t in near if t.parts[:2] == ("tests", "py")), key=distance)[:FILES_AT_MOST])

    def _passes(self, tests: Sequence[Path]) -> bool:
        path = os.pathsep.join(str(self._root / p) for p in ("scripts", "tools", "."))
        env = os.environ | {"PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
        words = ["-m", "pytest", "-q", "-x", "--tier", "test", "-m", PLACES, "-p", "no:cacheprovider", *map(str, tests)]
        null = subprocess.DEVNULL
        child = subprocess.Popen(
            [sys.executable, *words], cwd=self._root, env=env, stdout=null, stderr=null, start_new_session=True
        )
        try:
            return child.wait(TESTS_S) == 0
        except subprocess.TimeoutExpired:
            return False
        finally:
            end_group(child)


def draw_mutants(folder: str, count: int, seed: int, root: Path = ROOT) -> list[Mutant]:
    """So many of a folder and what is below it, the same for one seed and one state of it."""
    c = folder.startswith("emu/")
    found = []
    for file in sorted((root / folder).rglob("*.c" if c else "*.py")):
        path, text = file.relative_to(root).as_posix(), file.read_text(encoding="utf-8")
        if c and not path.startswith(tuple(TESTS)):
            continue
        found += [(path, text, place) for place in (places(text) if c else python_places(text))]
    rng = random.Random(f"{folder} {seed}")
    return [mutant_of(path, text, place, "") for path, text, place in rng.sample(found, min(count, len(found)))]


def changed_lines(m: Mutant) -> tuple[str, str]:
    """The first line that a mutant changes, before and after; its `old` ends where the place does."""
    old, new = m.old.splitlines(), m.new.splitlines()
    k = next((k for k, (a, b) in enumerate(zip(old, new, strict=False)) if a != b), min(len(old), len(new)) - 1)
    return old[k].strip(), new[k].strip()


def read_verdicts(path: Path) -> dict[str, Verdict]:
    """What is known, by stamp."""
    if not path.is_file():
        return {}
    return {row["stamp"]: Verdict(**row) for row in json.loads(path.read_text(encoding="utf-8"))}


def judge_all(
    mutants: Sequence[tuple[str, Mutant]], known: dict[str, Verdict], tests: Callable[[Mutant], Tests], end_s: float
) -> Iterator[Verdict]:
    """Each that is not known, until the time is over."""
    for folder, m in mutants:
        if m.stamp() in known:
            continue
        if time.monotonic() > end_s:
            return
        was, now = changed_lines(m)
        result = tests(m).judge(m)
        yield Verdict(
            id=m.id, kind=m.kind, file=m.file, stamp=m.stamp(), folder=folder, result=result, was=was, now=now
        )


def write_page(known: Mapping[str, Verdict]) -> None:
    """The table of docs/reference/mutants.md."""
    between.write(PAGE, between.MUTATED, "\n".join(["", *rate_table(list(known.values())), ""]))


def rate_table(verdicts: Sequence[Verdict]) -> Iterator[str]:
    """A row for each folder."""
    yield "| folder | killed | of | rate | 95 % |\n|---|---|---|---|---|"
    for folder in sorted({v.folder for v in verdicts}):
        rows = [v for v in verdicts if v.folder == folder and v.result != "not judged"]
        killed = sum(v.result == "killed" for v in rows)
        yield f"| {folder} | {killed} | {len(rows)} | {percent(killed, len(rows))} | {interval(killed, len(rows))} |"


def parser() -> argparse.ArgumentParser:
    """Options."""
    p = argparse.ArgumentParser(
        prog="unit_mutants", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("folders", nargs="+", metavar="FOLDER", help="below emu/ or scripts/psabench/")
    p.add_argument("--sample", type=int, default=10, metavar="N", help="mutants of each folder (%(default)s)")
    p.add_argument("--seed", type=int, default=1, help="of the sample (%(default)s)")
    p.add_argument("--seconds", type=float, default=1200.0, metavar="S", help="begin no more after it (%(default)g)")
    p.add_argument("--out", type=Path, default=OUT, metavar="FILE", help="results (build/unit_mutants.json)")
    p.add_argument("--docs", action="store_true", help="write the table of docs/reference/mutants.md")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = parser().parse_args(argv)
    end_s = time.monotonic() + args.seconds
    known = read_verdicts(args.out)
    of = {f.rstrip("/"): draw_mutants(f.rstrip("/"), args.sample, args.seed) for f in args.folders}
    mutants = [(f, row[k]) for k in range(args.sample) for f, row in of.items() if k < len(row)]  # of all folders alike
    made: dict[str, Tests] = {}
    with tempfile.TemporaryDirectory(prefix="unit-mutants-") as folder:

        def tests(m: Mutant) -> Tests:
            kind = "c" if m.file.startswith("emu/") else "python"
            if kind not in made:
                made[kind] = CTests(Path(folder)) if kind == "c" else PythonTests(Path(folder))
            return made[kind]

        for v in judge_all(mutants, known, tests, end_s):
            known[v.stamp] = v
            args.out.parent.mkdir(parents=True, exist_ok=True)
            replace_file(args.out, json.dumps([asdict(x) for x in known.values()], indent=1) + "\n")
            print(f"{v.result:10} {v.id:44} {v.was}  ->  {v.now}", flush=True)
    asked = {m.stamp() for _, m in mutants}
    print("\n".join(rate_table([v for v in known.values() if v.stamp in asked])))
    if args.docs:
        write_page(known)
    return 0


if __name__ == "__main__":
    sys.exit(main())
