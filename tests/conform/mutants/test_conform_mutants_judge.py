"""What becomes of a mutant, from runs of the suite made by hand: each verdict, the order of runs, several at once."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from threading import Barrier
from typing import cast

import pytest

from tests.mutants.declared import ListError, Mutant, Target
from tests.mutants.folder_tests import FolderTests
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


class FakeTests:
    """Tests of a folder that find what the test says."""

    def __init__(self, by: str) -> None:
        self.by, self.asked = by, 0

    def prepare(self, _: str) -> None:
        self.asked += 1

    def failing(self, _: str) -> str:
        return self.by

    def unsound(self, _: str) -> list[str]:
        return ["Python tests"]


def judge(tmp_path: Path, suite: FakeSuite, *, quick: bool = False, tests: FakeTests | None = None) -> Judge:
    return Judge(cast(Tree, FakeTree(tmp_path)), cast(Suite, suite), quick=quick, tests=cast(FolderTests | None, tests))


@pytest.mark.parametrize(
    ("run", "by", "result", "asked"),
    [(BAD, "C tests", "killed", 0), (GOOD, "C tests", "killed", 1), (GOOD, "", "survived", 1)],
)
def test_the_tests_of_the_folder_judge_what_the_suite_has_not_found(
    tmp_path: Path, run: Run, by: str, result: str, asked: int
) -> None:
    tests = FakeTests(by)
    r = judge(tmp_path, FakeSuite(run), tests=tests).judge(MUTANT)
    assert (r.result, r.by, tests.asked) == (result, by if asked else "", asked)
    assert bool(r.reason) == (result == "survived"), "tests that fail without it are named"


class Seeing(FakeSuite):
    """What `observe` prints, one after the other."""

    def __init__(self, *said: tuple[int, str]) -> None:
        super().__init__(GOOD)
        self.said = list(said)

    def python(self, *_: object) -> tuple[int, str]:
        return self.said.pop(0)


@pytest.mark.parametrize("said", [[(1, "ModuleNotFoundError")], [(0, "seen psa2 1"), (0, "seen psa2 2")]])
def test_nothing_is_equivalent_to_what_cannot_be_seen(tmp_path: Path, said: list[tuple[int, str]]) -> None:
    """An `observe` that does not run, or never gives the same, would call every mutant equivalent, or none."""
    with pytest.raises(ListError, match="observe psa2: expected"):
        judge(tmp_path, Seeing(*said)).look([Target.of("psa2")])


@pytest.mark.parametrize(
    ("run", "mutant", "result"),
    [
        (BAD, MUTANT, "killed"),
        (OPEN, MUTANT, "killed"),
        (Run(how="crashed"), MUTANT, "crashed"),
        (Run(how="refused"), MUTANT, "refused"),
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


@pytest.mark.parametrize(
    ("status", "said", "how"),
    [
        (2, "psabench: psa-emu: bench.yaml:1:9: units.a.noise_v: expected 0 to 1, got 0.0", "refused"),
        (2, "psabench: --only: expected a requirement, got 'X'", "broken"),
        (3, "psabench: emulator ended", "crashed"),
        (1, "ModuleNotFoundError", "broken"),
        (None, "", "time-out"),
    ],
)
def test_runs_without_a_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, status: int | None, said: str, how: str
) -> None:
    monkeypatch.setattr(Suite, "_bounded", lambda *_: (status, said))
    assert Suite(tmp_path).run(tmp_path / "psa-emu", Target.of("psa2"), 1.0).how == how
