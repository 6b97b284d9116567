"""What becomes of a mutant, from runs of the suite made by hand: each verdict, the order of runs, several at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Barrier
from typing import cast

import pytest

from tests.mutants.declared import Mutant, Target
from tests.mutants.run import judged
from tests.mutants.suite import Run, Suite
from tests.mutants.tree import BuildError, Tree
from tests.mutants.verdict import Judge, Result

GOOD = Run(how="judged", verdicts={"PSA2-FRAME-03": "passed", "PSA2-INT-09": "passed"}, conforms=True)
BAD = replace(GOOD, verdicts={"PSA2-FRAME-03": "failed", "PSA2-INT-09": "passed"})
OPEN = replace(GOOD, verdicts={"PSA2-FRAME-03": "passed", "PSA2-INT-09": "inconclusive"})
MUTANT = Mutant(
    id="a", kind="value", file="a.c", old="good", new="bad", on=(Target.of("psa2"),), breaks=("PSA2-FRAME-03",)
)


class FakeTree:
    """Sources of one file; the emulator's path tells whether it has been mutated."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.emulator = folder, Path("plain")
        (folder / "a.c").write_text("good")

    @contextmanager
    def mutated(self, _: str, text: str) -> Iterator[Path]:
        if "does not compile" in text:
            raise BuildError("error: expected ';'")
        yield Path("mutant")


class FakeSuite:
    """Gives the same run for each mutant, and remembers what it was asked for."""

    def __init__(self, whole: Run, only: Run | None = None) -> None:
        self.whole, self.only = whole, only or whole
        self.asked: list[tuple[str, Sequence[str]]] = []

    def run(self, emulator: Path, _: Target, __: float, only: Sequence[str] = ()) -> Run:
        self.asked.append((emulator.name, only))
        return GOOD if emulator.name == "plain" else self.only if only else self.whole

    def stop(self) -> None:
        self.asked.append(("stop", ()))


def judge(tmp_path: Path, suite: FakeSuite, *, quick: bool = False) -> Judge:
    return Judge(cast(Tree, FakeTree(tmp_path)), cast(Suite, suite), quick=quick)


@pytest.mark.parametrize(
    ("run", "mutant", "result"),
    [
        (BAD, MUTANT, "killed"),
        (OPEN, MUTANT, "killed"),
        (Run(how="crashed"), MUTANT, "crashed"),
        (Run(how="time-out"), MUTANT, "time-out"),
        (Run(how="broken"), MUTANT, "suite broken"),
        (GOOD, MUTANT, "survived"),
        (GOOD, replace(MUTANT, survives="one unit"), "excused"),
        (GOOD, replace(MUTANT, equivalent="the same"), "equivalent"),
        (GOOD, replace(MUTANT, old="no such text"), "bad list"),
        (GOOD, replace(MUTANT, new="does not compile"), "does not compile"),
    ],
)
def test_every_verdict(tmp_path: Path, run: Run, mutant: Mutant, result: str) -> None:
    assert judge(tmp_path, FakeSuite(run)).judge(mutant).result == result


def test_a_requirement_that_failed_is_told_from_one_that_could_not_be_carried_out(tmp_path: Path) -> None:
    found = [judge(tmp_path, FakeSuite(run)).judge(MUTANT) for run in (BAD, OPEN)]
    assert [(r.found, r.failed, r.named) for r in found] == [
        (["PSA2-FRAME-03"], True, True),
        (["PSA2-INT-09"], False, False),
    ]


def test_quick_looks_at_the_own_requirements_first_and_at_all_only_where_those_find_nothing(tmp_path: Path) -> None:
    own = ("PSA2-FRAME-03",)
    found, missed = FakeSuite(GOOD, only=BAD), FakeSuite(BAD, only=GOOD)
    for suite in (found, missed):
        assert judge(tmp_path, suite, quick=True).judge(MUTANT).result == "killed"
    assert [only for emulator, only in found.asked if emulator == "mutant"] == [own]
    assert [only for emulator, only in missed.asked if emulator == "mutant"] == [own, ()]
    assert ("plain", own) in found.asked  # it is compared with the same tests of the unmutated emulator


def test_several_are_judged_at_once_and_each_is_told(tmp_path: Path) -> None:
    both = Barrier(2, timeout=60)

    class Waits(FakeSuite):
        def run(self, emulator: Path, target: Target, timeout_s: float, only: Sequence[str] = ()) -> Run:
            if emulator.name == "mutant":
                both.wait()
            return super().run(emulator, target, timeout_s, only)

    told: list[Result] = []
    judged([judge(tmp_path, Waits(BAD)) for _ in range(2)], [replace(MUTANT, id=i) for i in "abcd"], told.append)
    assert sorted(r.id for r in told) == list("abcd")
    assert {r.result for r in told} == {"killed"}


def test_an_interruption_ends_what_runs_and_begins_no_more(tmp_path: Path) -> None:
    suite, told = FakeSuite(BAD), []

    def keep(r: Result) -> None:
        told.append(r)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        judged([judge(tmp_path, suite)], [replace(MUTANT, id=str(k)) for k in range(50)], keep)
    assert len(told) == 1
    assert ("stop", ()) in suite.asked
