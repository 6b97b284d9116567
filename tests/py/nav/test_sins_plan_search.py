"""Search for a plan of rotations: limits, determinism over processes, never worse, the file, Ctrl-C."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench.campaign.workers import ThisProcess
from psabench.cli import main
from psabench.native.sins import SinsConfig
from psabench.sins.covariance import READINGS, predict_accuracy, read_as
from psabench.sins.plan import plan_of_dict, read_plan
from psabench.sins.planner.draft import (
    Draft,
    Leg,
    Limits,
    article_draft,
    changed_draft,
    plan_dict,
    plan_of,
    plan_text,
    random_draft,
    time_of,
)
from psabench.sins.planner.search import CHILDREN, LINES, Search, score_of, sigmas, whole_plans
from psabench.sins.table import moves_of

CFG = read_as(READINGS["B"], SinsConfig())
SHORT = Limits(max_rate_degps=40.0, azimuths_deg=(0.0, 30.0), budget_s=300.0, remount_s=20.0)
PLANS = 4 * LINES * CHILDREN


def nothing() -> None:
    """No progress bar."""


class Backwards(ThisProcess):
    """Results in the reverse order, as a cluster may give them."""

    def map(self, compute: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        return map(compute, reversed(list(tasks)))


def searched(workers: ThisProcess, seed: int = 1, plans: int = PLANS) -> Search:
    search = Search(limits=SHORT, cfg=CFG, seed=seed)
    search.run(plans, workers, nothing)
    return search


@pytest.fixture(scope="module")
def found() -> Search:
    return searched(ThisProcess())


def test_the_articles_plan_is_a_draft() -> None:
    plan = plan_of(article_draft(Limits()), Limits())
    assert plan is not None
    assert plan.turns == read_plan("article").turns


@pytest.mark.parametrize("axes", [1, 2, 3])
def test_every_draft_is_within_the_limits(axes: int) -> None:
    """Of hundreds of drafts: rate, time, azimuth; axes of the table that can make each turn (sins.table)."""
    limits = Limits(axes=axes, max_rate_degps=25.0, azimuths_deg=(10.0, 70.0), budget_s=2000.0, remount_s=60.0)
    rng, seen, draft = np.random.default_rng(axes), 0, article_draft(limits)
    for k in range(600):
        new = random_draft(rng, limits) if k % 20 == 0 else changed_draft(draft, rng, limits)
        plan = plan_of(new, limits)
        if plan is None:
            continue
        draft, seen = new, seen + 1
        assert limits.budget_s - 10.0 < time_of(plan, limits) <= limits.budget_s + 1e-6
        assert plan.axis_azimuth_deg in (10.0, 70.0)
        assert all(abs(t.rate_radps) <= np.radians(25.0) * (1 + 1e-12) for t in plan.turns)
        at_table = [t for t in plan.turns if not t.remount]
        if axes == 3:
            assert len(list(moves_of(at_table, 3))) == len(plan.turns)
        used = {leg.axis for leg in new.legs}
        assert any(t.remount for t in plan.turns) == bool(used & set(range(axes + 1, 4)))
    assert seen > 200


def test_a_plan_that_does_not_fit_the_time_is_none() -> None:
    assert plan_dict(article_draft(Limits(budget_s=30.0)), Limits(budget_s=30.0)) is None
    assert plan_dict(Draft(azimuth_deg=0.0, legs=(Leg(axis=2, rate=1.0),)), Limits()) is None
    by_hand = Limits(axes=1, budget_s=600.0, remount_s=300.0)
    assert plan_dict(article_draft(by_hand), by_hand) is None


def test_the_search_finds_a_better_plan_and_never_a_worse_one(found: Search) -> None:
    plan = plan_of(found.best, SHORT)
    assert plan is not None
    assert found.score == score_of(sigmas(plan, CFG), found.reference)
    assert found.score < -0.1  # a rate of 40 in place of 10 deg/s is worth that and more
    scores = [score for _, score in found.history]
    assert scores[0] == 0.0
    assert all(b < a for a, b in pairwise(scores))
    start = plan_of(article_draft(SHORT), SHORT)
    assert start is not None
    assert np.array_equal(found.reference, sigmas(start, CFG))


@pytest.mark.parametrize("in_long_steps", [1.0, 1e-12])
def test_where_nothing_is_better_the_articles_plan_stays(monkeypatch: pytest.MonkeyPatch, in_long_steps: float) -> None:
    """Not even if it seems so in the long steps of the screening."""

    def worse(task: Any) -> tuple[int, Any]:
        return task.number, np.full(21, in_long_steps if task.cfg.step_s > CFG.step_s else 1.0)

    monkeypatch.setattr("psabench.sins.planner.search.compute", worse)
    search = searched(ThisProcess())
    assert (search.score, search.best) == (0.0, article_draft(SHORT))


def test_the_order_of_results_changes_nothing(found: Search) -> None:
    other = searched(Backwards())
    assert (other.best, other.score, other.history) == (found.best, found.score, found.history)
    assert searched(ThisProcess(), 1, 1).best != searched(ThisProcess(), 2, 1).best


def test_the_file_is_read_as_the_same_plan(found: Search, tmp_path: Path) -> None:
    for limits, draft in ((SHORT, found.best), (by_hand := Limits(axes=1), article_draft(by_hand))):
        written = plan_dict(draft, limits)
        assert written is not None
        file = tmp_path / "plan.yaml"
        file.write_text(plan_text(written, ["a comment"]))
        plan = read_plan(str(file))
        assert plan.turns == plan_of_dict(written, "").turns
        assert plan.axis_azimuth_deg == written["axis_azimuth_deg"]
        direct = plan_of(draft, limits)
        assert direct is not None
        assert np.array_equal(predict_accuracy(plan, CFG).covariance, predict_accuracy(direct, CFG).covariance)


# ---- the command

COMMAND = ["campaign", "sins-plan", "--minutes", "4", "--max-rate-degps", "40", "--plans", "40"]


def test_two_processes_find_the_plan_of_one(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for n in ("1", "2"):
        assert main([*COMMAND, "--workers", n, "--out", str(tmp_path / n)]) == 0
        assert "times better than the article's plan in the same time" in capsys.readouterr().out
    one, two = (json.loads((tmp_path / n / "result.json").read_text()) for n in "12")
    assert (tmp_path / "1/plan.yaml").read_bytes() == (tmp_path / "2/plan.yaml").read_bytes()
    del one["provenance"], two["provenance"]
    assert one == two
    assert one["plans"] == whole_plans(40)
    assert one["score"] == one["readings"]["B"]["score"] == one["history"][-1]["score"]
    assert one["duration_s"] <= 240.0
    page = (tmp_path / "1/report.html").read_text()
    assert "What the article&#x27;s plan leaves on the table" in page
    assert main(["run", "sins-covariance", "--plan", str(tmp_path / "1/plan.yaml"), "--out", str(tmp_path / "c")]) == 0
    covariance = json.loads((tmp_path / "c/result.json").read_text())["readings"]["B"]["columns"]
    assert covariance == one["readings"]["B"]["best"]


def test_ctrl_c_keeps_the_best_plan_so_far(tmp_path: Path) -> None:
    """A search without end on a terminal: the bar shows that plans have been computed."""
    program = """if True:
        import sys
        from psabench import cli, progress
        sys.stderr.isatty = lambda: True
        progress.REDRAW_S = 0.0
        sys.exit(cli.main(sys.argv[1:]))
    """
    words = [*COMMAND[:-1], "1000000", "--workers", "1", "--out", str(tmp_path)]
    run = subprocess.Popen(
        [sys.executable, "-c", program, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert run.stderr is not None
    said = ""
    while not re.search(r" (2[5-9]|[3-9]\d)/\d+, ", said):
        piece = run.stderr.read(1)
        assert piece, said
        said += piece
    run.send_signal(signal.SIGINT)
    out, rest = run.communicate(timeout=60)
    assert run.returncode == 130
    assert "psabench: interrupted; the best plan so far is kept" in rest
    assert f"plan: {tmp_path / 'plan.yaml'}" in out
    result = json.loads((tmp_path / "result.json").read_text())
    assert result["interrupted"]
    assert result["score"] < 0.0
    assert read_plan(str(tmp_path / "plan.yaml")).duration_s == result["duration_s"]


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--axes", "4"], "--axes: expected 1 to 3, got 4"),
        (["--max-rate-degps", "2000"], "--max-rate-degps: expected 0.5 to 1000, got 2000"),
        (["--azimuths", "north"], "--azimuths: expected -360 to 360, separated by commas, got 'north'"),
        (["--azimuths", "nan"], "--azimuths: expected -360 to 360, separated by commas, got 'nan'"),
        (
            ["--minutes", "1", "--max-rate-degps", "1"],
            "--minutes: expected time for the article's three cycles, got 1 m",
        ),
        (["--reading", "C"], "--reading: expected A or B or A,S1 or B,S1 or B,S50, got C"),
        (["--lever", "4"], "sins-plan: "),
        (["--latitude-deg", "89"], "sins-plan: "),
        (["--plans", "0"], "--plans: expected 1 to 1e+07, got 0"),
        (["--workers", "2", "--dask", "tcp://192.0.2.7:8786"], "--workers: expected none with --dask"),
    ],
)
def test_the_command_names_what_it_rejects(options: list[str], says: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["campaign", "sins-plan", *options]) == 2
    assert says in capsys.readouterr().err
