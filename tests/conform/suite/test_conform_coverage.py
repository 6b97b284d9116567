"""How much a run judged decides what it may say: in words, colour, exit status, and the same in each form."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

import made_recordings as make
import pytest
from psabench.cli import main
from psabench.conform import report
from psabench.conform.coverage import Goal, Least, Result
from psabench.conform.profile import variant
from psabench.conform.selection import requirements_of
from psabench.conform.verdict import Outcome, Verdict
from psabench.report import provenance
from whole_runs import check_counts

ROWS = [r for r in requirements_of(variant("psa2", "article")) if not r.unobservable][:20]
HIDDEN = next(r for r in requirements_of(variant("psa2", "article")) if r.unobservable)
LETTERS = {"p": Verdict.PASSED, "f": Verdict.FAILED, "i": Verdict.INCONCLUSIVE, "n": Verdict.NOT_OBSERVABLE}


def run_of(verdicts: str, goal: Goal, *, interrupted: bool = False) -> report.Run:
    """Of twenty requirements that an interface shows and one that none does: a letter each, the rest not observable."""
    given = verdicts.ljust(len(ROWS), "n")
    outcomes: Sequence[Outcome] = [
        Outcome(test=f"t{n}", title="It.", requirements=(r.id,), verdict=LETTERS[v], reason="no probe", took_s=0.5)
        for n, (r, v) in enumerate(zip(ROWS, given, strict=True))
    ]
    return report.Run(
        suite="device",
        subject="it",
        facts={"date": "today"},
        outcomes=outcomes,
        rows=[*ROWS, HIDDEN],
        interrupted=interrupted,
        goal=goal,
    )


@pytest.mark.parametrize(
    ("verdicts", "goal", "result", "status"),
    [
        ("p" * 20, Goal(), Result.CONFORMS, 0),
        ("p" * 18, Goal(), Result.CONFORMS, 0),
        ("p" * 17, Goal(), Result.NO_VIOLATION, 4),
        ("pp", Goal(), Result.NO_VIOLATION, 4),
        ("pp", Goal(least=Least.parse("2")), Result.NO_VIOLATION, 0),
        ("pp", Goal(least=Least.parse("10%")), Result.NO_VIOLATION, 0),
        ("pp", Goal(least=Least.parse("11%")), Result.NO_VIOLATION, 4),
        ("", Goal(least=Least.parse("0")), Result.NO_VIOLATION, 4),
        ("p" * 19, Goal(least=Least.parse("100%")), Result.NO_VIOLATION, 4),
        ("p" * 19 + "i", Goal(), Result.NO_VIOLATION, 4),
        ("ppi", Goal(least=Least.parse("2")), Result.NO_VIOLATION, 4),
        ("p" * 19 + "f", Goal(), Result.VIOLATED, 1),
        ("f", Goal(least=Least.parse("0")), Result.VIOLATED, 1),
        ("p" * 19, Goal(require=(ROWS[18].id,)), Result.CONFORMS, 0),
        ("p" * 19, Goal(require=(ROWS[19].id,)), Result.NO_VIOLATION, 4),
    ],
)
def test_what_a_run_may_say(verdicts: str, goal: Goal, result: Result, status: int, tmp_path: Path) -> None:
    run = run_of(verdicts, goal)
    found = run.coverage()
    assert (found.result, found.status, run.conforms) == (result, status, result is Result.CONFORMS)
    report.write(tmp_path, run)
    check_counts(tmp_path, run)
    colour = {Result.CONFORMS: "good", Result.VIOLATED: "bad"}.get(result, "plain")
    assert f"<p class='verdict {colour}'>" in (tmp_path / "report.html").read_text()


def test_junit_says_who_computed_it_and_from_what(tmp_path: Path) -> None:
    with provenance.command_run(["conform", "device", "--out", "a b"]):
        provenance.note_bench("converters", 7)
        report.write(tmp_path, run_of("p" * 20, Goal()))
    check_counts(tmp_path, run_of("p" * 20, Goal()))
    found = {p.get("name"): p.get("value") for p in ET.parse(tmp_path / "junit.xml").getroot().iter("property")}
    assert (found["provenance.command"], found["provenance.seed"]) == ("conform device --out 'a b'", "7")
    assert {"provenance.begun", "provenance.duration_s", "provenance.python"} <= found.keys()


def test_an_interrupted_run_says_so_first() -> None:
    found = run_of("pf", Goal(), interrupted=True).coverage()
    assert (found.result, found.status) == (Result.INTERRUPTED, 130)


def test_the_summary_names_what_is_short_and_missing() -> None:
    goal = Goal(require=(ROWS[19].id,))
    assert report.summary(run_of("pp", goal)) == (
        f"it: no violation seen, 2 of 21 requirements judged (18 needed), 19 not observable, "
        f"required and not passed: {ROWS[19].id}"
    )
    assert report.summary(run_of("p" * 20, Goal())) == "it conforms: 20 of 21 requirements judged, 1 not observable"


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["--min-judged", "half"], "--min-judged: expected a number of requirements, or 0% to 100%, got half"),
        (["--min-judged", "101%"], "--min-judged: expected a number of requirements, or 0% to 100%, got 101%"),
        (["--min-judged", "9999"], "--min-judged: expected at most the"),
        (["--require", "PSA9"], "--require: expected ids or prefixes of the requirements that are checked, got PSA9"),
    ],
)
def test_a_goal_that_cannot_be_met_is_refused(
    words: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = tmp_path / "run.log"
    log.write_text("(1.0) can0 705#05\n")
    assert main(["conform", "recording", str(log), "--board", "psa2", *words]) == 2
    assert why in capsys.readouterr().err


def test_five_messages_conform_to_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The report that once was green."""
    made = make.record(tmp_path, "psa2")
    five = make.changed_log(made.log, "five", lambda lines: lines[:5])
    said = make.judge(tmp_path, five)
    shown = capsys.readouterr().out
    assert said.clean
    assert 0 < len(said.passed) < 20
    assert "psa2, profile article: no violation seen, " in shown
    assert f"{len(said.passed)} of {len(said.report['requirements'])} requirements judged" in shown
    out = tmp_path / "again"
    words = [str(five), "--board", "psa2", "--out", str(out), "--min-judged", str(len(said.passed))]
    assert main(["conform", "recording", *words]) == 0
    assert json.loads((out / "conform.json").read_text())["result"] == "no violation seen"
