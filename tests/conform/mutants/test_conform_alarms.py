"""False alarms: the design of `make false-positives`, what it does with what it finds, and a few of its runs each time.

Which profiles and seeds are run follows from the sources: others after each change, the same again for the same state.
"""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest
from psabench.conform import runner, suite
from psabench.conform.dut import Addresses, Dut
from psabench.conform.profile import variant
from psabench.conform.verdict import Outcome
from psabench.procedures.head_bench import Silent

from tests.false_positives import design, report, run
from tests.false_positives import verdict as judge
from tests.false_positives.design import ERRORS_PPM, SEEDS, Case
from tests.false_positives.verdict import Alarm, Result
from tests.mutants.run import state

RUNS = 4
CASE = Case(board="psa2", profile="w24", seed=7, board_ppm=100.0)
GOOD = Result(case=CASE, state="now", passed=3, tests=4, took_s=1.0)
ALARM = Alarm(requirements=("PSA2-INT-02",), verdict="failed", words="int_is_low: 73 us; due 74 us")
BAD = replace(GOOD, alarms=(ALARM,))


def declared() -> list[Case]:
    rng = Random(state())
    cases = list(design.lockstep())
    names = rng.sample(sorted(design.profiles()), RUNS)
    return [rng.choice([c for c in cases if c.profile == name]) for name in names]


# ---- no false alarm, and that it would be told


@pytest.mark.parametrize("case", declared(), ids=lambda c: c.key.replace(" ", "-"))
def test_a_board_that_conforms_raises_no_alarm(case: Case) -> None:
    found = judge.result(case, "now")
    assert not found.alarms, f"{case.command}\n{judge.worst(found.alarms)}"
    assert found.passed > 80


def another_than_is_said(case: Case) -> list[Outcome]:
    """The board is of this profile, the user says another."""
    with Dut.open(variant(case.board, case.profile), Addresses(), seed=case.seed) as dut:
        dut.variant = variant("psa2", "article")
        return runner.run(dut, Silent(), only=["PSA2-FRAME", "PSA2-INT"])


def test_an_alarm_is_told() -> None:
    found = judge.result(CASE, "now", another_than_is_said)
    assert "PSA2-FRAME-06" in {i for a in found.alarms for i in a.requirements}
    assert "ALARM" in report.line(found)


def hangs(_: Case) -> list[Outcome]:
    while True:
        pass


def dies(_: Case) -> list[Outcome]:
    os._exit(9)


def stumbles(_: Case) -> list[Outcome]:
    raise ValueError("of the suite's own")


def sees_nothing(_: Case) -> list[Outcome]:
    return []


@pytest.mark.parametrize(
    ("judged", "says"),
    [(hangs, "no end"), (dies, "without a word"), (stumbles, "ValueError"), (sees_nothing, "nothing passed")],
)
def test_a_run_without_a_verdict_is_an_alarm(judged: judge.Judged, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(judge, "LIMIT_S", 1.0 if judged is hangs else 60.0)
    found = judge.result(CASE, "now", judged)
    assert [a.verdict for a in found.alarms] == ["no verdict"]
    assert says in found.alarms[0].words


# ---- the design


def test_each_seed_meets_each_profile_once_and_each_profile_each_error() -> None:
    cases = list(design.lockstep())
    assert len(cases) == len({(c.profile, c.seed) for c in cases}) == len(SEEDS) * len(design.profiles()) >= 4400
    errors = Counter((c.profile, c.error_ppm) for c in cases)
    assert {e for _, e in errors} == set(ERRORS_PPM) == {-100.0, 0.0, 100.0}
    assert min(errors.values()) >= 60
    assert len({c.key for c in cases}) == len(cases)


def test_an_error_is_the_boards_or_the_probes() -> None:
    cases = [c for c in design.lockstep() if c.error_ppm]
    assert all((c.board_ppm == 0.0) != (c.probes_ppm == 0.0) for c in cases)
    own = Counter(c.profile for c in cases if c.board_ppm)
    assert own["article"] > 40
    assert own["pmka"] > 40
    assert own["gyro"] == own["pik"] == 0  # profiles that cannot say it
    assert all(c.board_ppm <= 0 for c in cases if c.board == "psd1")


def test_full_is_every_error_with_every_seed() -> None:
    full = {(c.profile, c.seed, c.error_ppm) for c in design.lockstep(full=True)}
    assert len(full) == len(SEEDS) * len(design.profiles()) * len(ERRORS_PPM)
    assert {(c.profile, c.seed, c.error_ppm) for c in design.lockstep()} < full


def test_under_load_each_profile_is_run() -> None:
    assert {c.profile for c in design.under_load()} == set(design.profiles())
    assert all(c.load and not c.probes_ppm for c in design.under_load())


def test_errors_are_exact() -> None:
    """By no more than 100 ppm, and by as much as a whole number of Hz allows."""
    from psabench.conform.dut import scenario

    for ppm in (-100.0, 100.0):
        v = variant("psa2", "w24")
        clocks = scenario(v, {}, ppm)["units"][0]["profile_set"]
        for key, hz in clocks.items():
            off = (hz / v[key] - 1.0) * 1e6
            assert abs(off) <= 100.0
            assert off == pytest.approx(ppm, abs=1e6 / v[key])


# ---- going on


def test_what_was_run_is_not_run_again(tmp_path: Path) -> None:
    out = tmp_path / "alarms.json"
    report.write(out, {GOOD.case.key: GOOD, "other": replace(BAD, case=replace(CASE, seed=8))})
    known = report.read(out)
    assert known[CASE.key] == GOOD
    wanted = [CASE, replace(CASE, seed=8), replace(CASE, seed=9)]

    def left(now: str, *words: str) -> list[int]:
        return [c.seed for c in run.to_do(wanted, known, now, run.parser().parse_args(list(words)))]

    assert left("now") == [9]
    assert left("later") == [8, 9]  # an alarm may have been mended
    assert left("later", "--stale") == left("now", "--anew") == [7, 8, 9]


@pytest.mark.parametrize(("found", "status"), [(GOOD, 0), (BAD, 1)])
def test_the_exit_status_says_whether_there_was_one(
    found: Result, status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "result", lambda case, now, judged: replace(found, case=case, state=now))
    monkeypatch.setattr(run, "own_copy", lambda folder: None)
    out = tmp_path / "alarms.json"
    assert run.main(["w24", "--seeds", "3-4", "--out", str(out)]) == status
    said = capsys.readouterr().out
    assert "2 runs, 8 tests" in said
    assert ("psabench conform device --board psa2 --profile w24 --seed 3" in said) == bool(status)
    assert len(report.read(out)) == 2
    assert run.main(["w24", "--seeds", "3-4", "--out", str(out)]) == status  # nothing is run, the verdict stays
    assert "w24            seed" not in capsys.readouterr().out


def test_of_a_part_of_the_suite_nothing_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(run, "own_copy", lambda folder: None)
    out = tmp_path / "alarms.json"
    assert run.main(["w24", "--seeds", "3-3", "--out", str(out), "--only", "PSA2-FRAME-06", "PSA2-INT-01"]) == 0
    assert "2 of 2 passed" in capsys.readouterr().out
    assert not out.exists()


@pytest.mark.parametrize("words", [["nosuch"], ["w24", "--seeds", "0-4"], ["w24", "--seeds", "4-3"]])
def test_what_there_is_not_is_refused(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    try:
        status = run.main(words)
    except SystemExit as e:
        status = int(str(e.code))
    assert status == 2
    assert capsys.readouterr().err


def test_the_page_has_a_row_for_each_profile_and_each_alarm(tmp_path: Path) -> None:
    page = tmp_path / "alarms.md"
    page.write_text("before\n{}\nold\n{}\nafter\n".format(*report.MARKS), encoding="utf-8")
    report.page(page, [GOOD, replace(BAD, case=replace(CASE, seed=9, load=True))], "now")
    text = page.read_text(encoding="utf-8")
    assert text.startswith("before\n")
    assert text.endswith("after\n")
    assert "old" not in text
    assert "| w24 | 1 | 0 | 0 | 1 | 4 | 0 | 1 | 1 |" in text
    assert "| PSA2-INT-02 | 1 | failed: int_is_low: 73 us; due 74 us |" in text


suite.load()
