"""Mutants one after the other: built, run, judged."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from psabench.conform.profile import variant
from psabench.conform.requirements import requirements

from tests.mutants.declared import ListError, Mutant, Target
from tests.mutants.folder_tests import FolderTests
from tests.mutants.suite import Run, Suite
from tests.mutants.tree import BuildError, Tree

# By a failed requirement; the emulator fell over; it rejects a bench that it takes unmutated; no one came to an end.
KILLED = ("killed", "crashed", "refused", "time-out")
SPARED = ("equivalent", "excused", "survived")  # no one can see it; the suite cannot, and says why; it should have
WRONG = ("bad list", "does not compile", "suite broken")  # nothing is known of the mutant
TIMEOUT_FACTOR, TIMEOUT_MIN_S = 6.0, 120.0  # of the unmutated run: a loaded machine is no verdict

Only = tuple[str, ...]  # requirements whose tests are run; empty: all


@dataclass(slots=True, kw_only=True)
class Result:
    """Of one mutant."""

    id: str
    kind: str
    file: str
    stamp: str
    result: str  # one of KILLED, SPARED, WRONG
    on: str = ""  # the target that told
    found: list[str] = field(default_factory=list)  # requirements that are worse than without it
    breaks: list[str] = field(default_factory=list)  # that the list says
    named: bool = False  # whether one of those was found
    failed: bool | None = None  # whether one of those found has failed; else they could no longer be carried out
    by: str = ""  # what has killed it, where that was not the conformance suite: C tests, Python tests
    reason: str = ""
    took_s: float = 0.0

    @classmethod
    def of(cls, row: dict[str, Any]) -> Result:
        """As in mutants.json."""
        return cls(**row)


class Judge:
    """The unmutated emulator on every target, and mutants beside it."""

    def __init__(
        self, tree: Tree, suite: Suite, *, compare: bool = False, quick: bool = False, tests: FolderTests | None = None
    ) -> None:
        """compare: mutants that `observe` does not tell from the unmutated one are equivalent.

        quick: the tests of the requirements that a mutant breaks are run first, all only where those find nothing.
        tests: judge those that the suite has not found.
        """
        self.tree, self.suite, self.compare, self.quick, self.tests = tree, suite, compare, quick, tests
        self._plain: dict[tuple[Target, Only], Run] = {}
        self._looks: dict[Target, str] = {}

    def beside(self, folder: Path) -> Judge:
        """Another one, for another thread, that knows of the unmutated emulator what this one knows."""
        tree = self.tree.beside(folder)
        tests = FolderTests(tree) if self.tests else None
        found = Judge(tree, self.suite.beside(folder), compare=self.compare, quick=self.quick, tests=tests)
        found._plain, found._looks = self._plain, self._looks
        return found

    def baseline(self, targets: Iterable[Target]) -> dict[Target, Run]:
        """Runs of the unmutated emulator, which is built at this moment."""
        return {t: self._baseline(t) for t in targets}

    def _baseline(self, target: Target, only: Only = ()) -> Run:
        if (target, only) not in self._plain:
            self._plain[target, only] = self.suite.run(self.tree.emulator, target, 10 * TIMEOUT_MIN_S, only)
        return self._plain[target, only]

    def judge(self, m: Mutant) -> Result:
        """Build it and run the suite, until one target finds it."""
        r = Result(id=m.id, kind=m.kind, file=m.file, stamp=m.stamp(), result="bad list", breaks=list(m.breaks))
        try:
            text = m.applied((self.tree.folder / m.file).read_text(encoding="utf-8"))
            runs = [(t, only, self._baseline(t, only)) for t, only in self._runs(m)]
            with self.tree.mutated(m.file, text) as emulator:
                if self.compare and self._alike(m, emulator):
                    r.result, r.reason = "equivalent", "nothing differs on any wire in the fixed runs"
                else:
                    self._run(m, emulator, runs, r)
            if r.result == "survived" and self.tests:
                self._run_tests(self.tests, m.file, text, r)
        except ListError as e:
            r.reason = str(e)
        except BuildError as e:
            r.result, r.reason = "does not compile", str(e)
        return r

    def _runs(self, m: Mutant) -> Iterator[tuple[Target, Only]]:
        """What is to be run, in this order, until the mutant is found."""
        if self.quick:
            for target in m.on:
                v = variant(target.board, target.profile)
                own = tuple(i for i in m.breaks if requirements().rows[i].applies(v.board, v.profile))
                yield from [(target, own)] if own else []
        yield from ((target, ()) for target in m.on)

    def _look(self, emulator: Path, target: Target) -> str:
        status, said = self.suite.python(emulator, ["-m", "tests.mutants.observe", str(target)], TIMEOUT_MIN_S)
        return said.splitlines()[-1] if status == 0 and said else f"status {status}"

    def look(self, targets: Iterable[Target]) -> None:
        """What is seen of the unmutated emulator; before the first mutant is built. Raises ListError."""
        for target in targets:
            found = self._look(self.tree.emulator, target)
            if not found.startswith("seen "):
                raise ListError(f"observe {target}: expected a sum of the unmutated emulator, got {found}")
            if found != self._look(self.tree.emulator, target):
                raise ListError(f"observe {target}: expected the same sum twice of the unmutated emulator")
            self._looks[target] = found

    def _alike(self, m: Mutant, emulator: Path) -> bool:
        return all(self._look(emulator, t) == self._looks[t] for t in m.on)

    def _run(self, m: Mutant, emulator: Path, runs: Iterable[tuple[Target, Only, Run]], r: Result) -> None:
        for target, only, plain in runs:
            run = self.suite.run(emulator, target, max(TIMEOUT_MIN_S, TIMEOUT_FACTOR * plain.took_s), only)
            r.on, r.took_s = str(target), round(r.took_s + run.took_s, 1)
            r.found = run.worse_than(plain)
            r.failed = any(run.verdicts[i] == "failed" for i in r.found)
            r.named = bool(set(m.breaks) & set(r.found))
            r.result, r.reason = _verdict(m, run, bool(r.found))
            if r.result not in SPARED:
                return

    def _run_tests(self, tests: FolderTests, file: str, text: str, r: Result) -> None:
        """The tests of the folder, on the unmutated sources first."""
        tests.prepare(file)
        with self.tree.mutated(file, text):
            r.by = tests.failing(file)
        r.result = "killed" if r.by else "survived"
        if not r.by and tests.unsound(file):
            r.reason = f"{' and '.join(tests.unsound(file))} of the folder fail without it, too"


def _verdict(m: Mutant, run: Run, found: bool) -> tuple[str, str]:
    if run.how == "broken":
        return "suite broken", run.said
    if run.how in KILLED:
        return run.how, run.said
    if found:
        return "killed", m.reason and f"the list says that nothing finds it: {m.reason}"
    if m.equivalent:
        return "equivalent", m.equivalent
    return ("excused", m.survives) if m.survives else ("survived", "")
