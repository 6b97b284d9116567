"""Campaigns: the same numbers whoever computes them and however often interrupted; chains agree; limits bite."""

from __future__ import annotations

import json
import math
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from html import escape
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_line import QUIET
from psabench.campaign import chains, claims, command, emulated, page, report, runner, workers
from psabench.campaign.cases import STUDIES, Case
from psabench.campaign.chains import CHAINS, Wanted
from psabench.campaign.claims import Figures, HoldFigures
from psabench.campaign.command import Options
from psabench.campaign.runner import Plan
from psabench.campaign.setup import Hold, Setup
from psabench.campaign.store import CELL, Rows, Store
from psabench.campaign.workers import Dask, ThisProcess, spread
from psabench.errors import BadInput, BenchError, LinkError
from psabench.report.diff import report_without_provenance

READINGS = {c.name: c for c in STUDIES["readings"].cases(Setup())}
TWO = [READINGS["R0"], READINGS["R5n"]]


def plan(cases: Sequence[Case] = TWO, chain: str = "samples", runs: int = 3 * 8192 + 5, seed: int = 3) -> Plan:
    return Plan(cases=cases, chain=chain, runs=runs, seed=seed)


def computed(p: Plan, store: Store, at_work: Any = None) -> list[Rows]:
    """All rows of a plan, by these workers."""
    runner.run(runner.missing(p, store), store, at_work or ThisProcess(), QUIET)
    return [p.rows(store, c) for c in p.cases]


@contextmanager
def local_cluster(count: int) -> Iterator[str]:
    """A Dask cluster that somebody else runs, with so many workers: its address."""
    from distributed import LocalCluster

    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=count, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as there:
        yield there.scheduler_address


@pytest.fixture(scope="module")
def worker() -> Iterator[str]:
    """A cluster of one: each worker takes seconds to start."""
    with local_cluster(1) as address:
        yield address


# ---- cutting the work


@pytest.mark.parametrize(
    ("weights_s", "slices"),
    [
        ([], []),
        ([1.0], [slice(0, 1)]),
        ([0.3, 0.3, 0.3], [slice(0, 2), slice(2, 3)]),
        ([0.1] * 9, [slice(0, 5), slice(5, 9)]),
        ([9.0, 0.1, 9.0], [slice(0, 1), slice(1, 3)]),
    ],
)
def test_parts_become_tasks_of_some_length(weights_s: list[float], slices: list[slice]) -> None:
    assert spread(weights_s, 0.5) == slices


def test_only_what_is_missing_is_wanted_and_each_case_once(tmp_path: Path) -> None:
    same = replace(TWO[0], study="own", name="twin")  # the same set-up under another name
    p = plan([*TWO, same])
    with Store(tmp_path / "s") as store:
        first = runner.missing(p, store)
        assert [(w.setup, w.first_run, w.runs) for w in first] == [
            (c.setup, k * 8192, n) for c in TWO for k, n in ((0, 8192), (1, 8192), (2, 8192), (3, 5))
        ]
        store.put(chains.compute(first[:3]))
        assert runner.missing(p, store) == first[3:]
        computed(p, store)
        assert runner.missing(p, store) == []
        more = runner.missing(replace(p, runs=3 * 8192 + 6), store)
        assert [(w.first_run, w.runs) for w in more] == [(3 * 8192, 6)] * 2
        assert len(runner.missing(replace(p, seed=4), store)) == len(first)


# ---- the same numbers


def test_a_run_is_the_same_in_every_part() -> None:
    for chain, hold in (("closed", None), ("samples", None), ("closed", Hold())):
        wanted = Wanted(chain=chain, setup=TWO[0].setup, hold=hold, seed=3, first_run=0, runs=100)
        (whole,) = chains.compute([wanted])
        pieces = chains.compute([replace(wanted, first_run=k, runs=25) for k in (0, 25, 50, 75)])
        assert np.array_equal(whole.rows, np.concatenate([x.rows for x in pieces]))
        (other,) = chains.compute([replace(wanted, seed=4)])
        assert not np.array_equal(whole.rows, other.rows)


def test_processes_and_a_cluster_at_an_address_give_the_same_bytes(tmp_path: Path) -> None:
    with local_cluster(2) as cluster:
        compare_workers(tmp_path, cluster)


def compare_workers(tmp_path: Path, cluster: str) -> None:
    found = {}
    for name, options in {
        "one": Options(workers=1),
        "two": Options(workers=2),
        "dask": Options(dask=cluster),
    }.items():
        out = tmp_path / name
        o = replace(options, studies=["wire"], chain="samples", runs=9000, seed=5, out=out)
        c = command.campaign(o, QUIET)
        page.write(out, c)
        with Store(out / "store.sqlite") as store:
            rows = [store.rows(x, 9000).tobytes() for x in sorted(store.origins(), key=lambda x: x.key)]
        found[name] = (*report_without_provenance(out), rows)
    assert len(found["one"][2]) == 2 * 3  # the closed form is beside
    assert found["two"] == found["one"]
    assert found["dask"] == found["one"]


class Interrupted:
    """Workers whose user presses Ctrl-C after so many results."""

    count = 1

    def __init__(self, after: int) -> None:
        self._left = after

    def map(self, compute: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        for task in tasks:
            if self._left == 0:
                raise KeyboardInterrupt
            self._left -= 1
            yield compute(task)


def test_an_interrupted_campaign_goes_on_where_it_was(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runner, "TASK_S", 0.0)  # a part a task
    p = plan()
    with Store(tmp_path / "whole") as store:
        whole = computed(p, store)
    with Store(tmp_path / "s") as store:
        for parts in (3, 1):
            with pytest.raises(KeyboardInterrupt):
                computed(p, store, Interrupted(parts))
        assert len(runner.missing(p, store)) == 4
    with Store(tmp_path / "s") as store:
        assert all(np.array_equal(a, b) for a, b in zip(computed(p, store), whole, strict=True))


ENDLESS = "campaign gyrocompass --case R0 --chain samples --runs 100000000 --workers"


@pytest.mark.timeout(900)
@pytest.mark.parametrize("count", ["1", "2"])
def test_ctrl_c_ends_it_at_once_and_keeps_what_was_done(tmp_path: Path, count: str) -> None:
    """As a terminal does it: the signal goes to the whole group, workers included."""
    argv = [sys.executable, "-m", "psabench.cli", *ENDLESS.split(), count, "--out", str(tmp_path)]
    wanted = Wanted(chain="samples", setup=TWO[0].setup, hold=None, seed=1, first_run=0, runs=8192)
    with subprocess.Popen(argv, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        deadline_s = time.monotonic() + 500  # a loaded machine starts a cluster slowly
        done: dict[int, int] = {}
        while len(done) < 3:
            assert time.monotonic() < deadline_s
            assert process.poll() is None
            if (tmp_path / "store.sqlite").exists():
                with Store(tmp_path / "store.sqlite") as store:
                    done = store.runs(wanted.origin)
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=300)
    assert process.returncode == 130, err
    assert err.endswith("psabench: interrupted; what was measured is kept\n"), err
    assert "Traceback" not in err
    with sqlite3.connect(tmp_path / "store.sqlite") as db:
        kept = db.execute("SELECT first_run, data FROM part WHERE runs = 8192 LIMIT 3").fetchall()
    assert len(kept) == 3
    for first, data in kept:  # each whole, and what it would be without the interrupt
        (again,) = chains.compute([replace(wanted, first_run=first)])
        assert again.rows.tobytes() == data


# ---- workers that are not there, or cannot


def test_a_cluster_that_is_not_there_is_told_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "CONNECT_S", 0.5)
    with pytest.raises(LinkError, match=r"--dask tcp://127.0.0.1:9: no Dask scheduler answers there"):
        command.campaign(Options(case="R0", dask="tcp://127.0.0.1:9", out=tmp_path), QUIET)
    with pytest.raises(LinkError, match=r"--dask nonsense://: no Dask scheduler answers there"):
        command.campaign(Options(case="R0", dask="nonsense://", out=tmp_path), QUIET)
    assert not list(tmp_path.iterdir())


def test_a_wrong_address_is_told_where_nothing_is_missing_and_nothing_is_forgotten(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(workers, "CONNECT_S", 0.5)
    done = Options(case="R0", runs=100, workers=1, out=tmp_path)
    command.campaign(done, QUIET)
    for fresh in (False, True):
        with pytest.raises(LinkError, match=r"--dask tcp://127.0.0.1:9: no Dask scheduler answers there"):
            command.campaign(replace(done, workers=None, dask="tcp://127.0.0.1:9", fresh=fresh), QUIET)
        with Store(tmp_path / "store.sqlite") as store:
            assert [store.runs(o) for o in store.origins()] == [{0: 100}]


def test_a_cluster_with_another_psabench_is_refused(
    worker: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = workers.own_build("closed")
    monkeypatch.setattr(chains, "versions", lambda: "psabench 8")  # here, and not in the workers
    with pytest.raises(BadInput, match=rf"expected workers with psabench 8, build .*, got {re.escape(mine)}$"):
        command.campaign(Options(case="R0", dask=worker, out=tmp_path), QUIET)


def _broken(_: object) -> None:
    raise RuntimeError("the disk of the worker is full")


def _refusing(_: object) -> None:
    raise BadInput("two positions")


def test_what_goes_wrong_in_a_worker_is_told(worker: str) -> None:
    with workers.workers(address=worker) as there:
        assert isinstance(there, Dask)
        with pytest.raises(BenchError, match="a worker failed: RuntimeError: the disk of the worker is full"):
            list(there.map(_broken, [1]))
        with pytest.raises(BadInput, match="two positions"):
            list(there.map(_refusing, [1]))
        assert sorted(there.map(abs, range(-50, 0))) == list(range(1, 51))


# ---- what is computed


def test_every_case_of_every_study_is_one_that_the_library_takes() -> None:
    for study in STUDIES.values():
        cases = list(study.cases(Setup()))
        assert len({c.name for c in cases}) == len(cases)
        for c in cases:
            assert c.study == study.name
            wanted = Wanted(chain="closed", setup=c.setup, hold=c.hold, seed=1, first_run=0, runs=20)
            (part,) = chains.compute([wanted])
            assert np.all(np.isfinite(part.rows)), (study.name, c.name)


def both_chains(case: Case, runs: int = 4000) -> tuple[Rows, Rows]:
    """Sample by sample, closed form."""
    w = Wanted(chain="samples", setup=case.setup, hold=None, seed=11, first_run=0, runs=runs)
    return chains.compute([w])[0].rows, chains.compute([replace(w, chain="closed")])[0].rows


@pytest.mark.parametrize("name", ["R0", "R2", "R5n", "R6", "R11", "R11+", "cardan", "cardan fixed", "improved"])
def test_closed_and_sample_by_sample_agree(name: str) -> None:
    case = READINGS[name]
    samples, closed = both_chains(case)
    assert page.agree(case, "samples", samples, closed).p > chains.KS_P
    # Two chains that do not agree: the comparison can fail.
    other = page.agree(case, "samples", samples * np.float32(1.3), closed)
    assert other.p < chains.KS_P
    assert not other.same(1)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> page.Campaign:
    """All studies, as without options but with fewer runs."""
    out = tmp_path_factory.mktemp("whole")
    return command.campaign(Options(runs=4000, workers=1, out=out), QUIET)


def test_the_figures_lie_within_their_limits(whole: page.Campaign) -> None:
    assert [c for c in whole.checks if not c.within] == []
    assert len(whole.checks) > 30
    assert whole.within


def test_each_claim_has_its_row(whole: page.Campaign) -> None:
    says = [c.says for c in whole.claims]
    assert [s.split(" ")[0] for s in says] == ["error", "calibration", "both", "90°", "averaging", "≤", "0.5°"]
    verdicts = " ".join(c.verdict for c in whole.claims)
    assert verdicts.count("not reproduced") == 1  # 90 deg is not the best step
    assert "as the unit runs it" in whole.claims[0].improved
    assert re.search(r"3[3-7]%: R6n", whole.claims[2].honest)
    assert "105 to 120° are better" in verdicts


def test_the_report_is_whole_and_the_same_each_time(whole: page.Campaign, tmp_path: Path) -> None:
    for name in ("a", "b"):
        page.write(tmp_path / name, whole)
    _, first = report_without_provenance(tmp_path / "a")
    assert report_without_provenance(tmp_path / "a") == report_without_provenance(tmp_path / "b")
    assert "<script" not in first
    assert "src=" not in first
    for study in {c.study for c in whole.cases}:
        assert escape(STUDIES[study].title) in first
    assert first.count("<figure>") == first.count("</svg>") == 1 + len({c.study for c in whole.cases})
    result = json.loads((tmp_path / "a" / "result.json").read_text(encoding="utf-8"))
    assert result["within_limits"] is True
    assert len(result["cases"]) == len(whole.cases)
    lines = list(page.console(whole))
    assert any(line.lstrip().startswith("R5n: ") for line in lines)


def test_a_figure_out_of_its_limits_is_seen(whole: page.Campaign, tmp_path: Path) -> None:
    bad = dict(whole.found)
    f = bad["readings", "R5n"]
    assert isinstance(f, Figures)
    bad["readings", "R5n"] = replace(f, within_claim=0.9)
    out = [c for c in claims.checks(bad) if not c.within]
    assert [c.what for c in out] == ["R5n: share within 0.1 deg"]
    wrong = replace(whole, checks=claims.checks(bad))
    assert not wrong.within
    assert "out of limits: R5n: share within 0.1 deg: 0.9, wanted 0.945 to 1" in list(page.console(wrong))
    assert "1 of" not in page.verdict(whole)
    few = {k: replace(v, runs=1999) for k, v in whole.found.items()}
    assert claims.checks(few) == []


def test_figures_of_a_table_worked_by_hand() -> None:
    nan = np.float32(np.nan)
    rows = np.array([[0.3, -0.1, 1, 0.01], [-0.4, 0.2, -1, 0.02], [nan, nan, nan, nan], [0, 0, 1, 0]], CELL)
    f = Figures.of(rows)
    assert (f.runs, f.refused) == (4, 1)
    assert f.platform.rms == pytest.approx(np.sqrt(0.25 / 3), rel=1e-6)
    assert f.platform.mean == pytest.approx(-0.1 / 3, rel=1e-6)
    assert f.platform.largest == pytest.approx(0.4, rel=1e-6)
    assert f.within_claim == 0.5  # of all runs: one that gave no heading did not keep the claim
    assert f.drift.rms == pytest.approx(1.0)
    h = HoldFigures.of(np.array([[0.1, 0.3], [-0.2, 0.31], [0.0, 0.6]], CELL))
    assert list(h.within.values()) == pytest.approx([1 / 3, 2 / 3])
    assert f.doubted is None
    doubts = np.array([[0, 0, 1, 0, 2], [0, 0, 1, 0, 0], [nan] * 5, [0, 0, 1, 0, 1]], CELL)
    assert (Figures.of(doubts).refused, Figures.of(doubts).doubted) == (1, 2)
    none = Figures.of(np.full((2, 4), nan, CELL))
    assert (none.refused, none.within_claim) == (2, 0.0)
    assert np.isnan(none.heading.p95)


def test_a_run_through_the_wire_without_a_heading_is_counted_as_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never_settles(*_: object) -> None:
        raise LinkError("the platform was not level after 60 s: it never settles")

    monkeypatch.setattr(emulated, "RecordedPlatform", lambda *_, **__: None)
    monkeypatch.setattr("psabench.procedures.gyrocompass.measure", never_settles)
    found = command.campaign(Options(case="article", chain="emulated", runs=3, workers=1, out=tmp_path), QUIET)
    (f,) = found.found.values()
    assert isinstance(f, Figures)
    assert (f.runs, f.refused) == (3, 3)
    assert found.refusals == {"the platform was not level after 60 s: it never settles": 3}
    assert not found.within  # nothing came that could be compared
    text = page.write(tmp_path, found).read_text(encoding="utf-8")
    assert "<p>article: of 3 runs 3 without a heading, 0 in doubt.</p>" in text
    assert "<th>no heading, 3 runs</th><td>the platform was not level after 60 s: it never settles</td>" in text
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["agreements"][0]["p"] is None
    assert list(result["no_heading"].values()) == [3]


def test_doubts_of_the_procedure_are_counted_and_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every other instrument, by its heading, is in doubt; of two reasons each counts by itself."""

    def result(_: object, __: object, ___: object, at: emulated.Instrument) -> SimpleNamespace:
        doubts = ("S still runs", "the vehicle turned") if at.heading_deg > 0.0 else ()
        compass = SimpleNamespace(drift1_radps=1e-4, quality=0.001)
        return SimpleNamespace(heading_rad=math.radians(at.heading_deg), compass=compass, doubts=doubts)

    monkeypatch.setattr(emulated, "_result", result)
    found = command.campaign(Options(case="article", chain="emulated", runs=30, workers=1, out=tmp_path), QUIET)
    (case,) = found.cases
    seed = chains._seed(Wanted(chain="emulated", setup=case.setup, hold=None, seed=1, first_run=0, runs=1))
    east = sum(emulated.instrument(case.setup, seed, k).heading_deg > 0.0 for k in range(30))
    (f,) = found.found.values()
    assert isinstance(f, Figures)
    assert (f.refused, f.doubted) == (0, east)
    assert found.doubts == dict.fromkeys(("S still runs", "the vehicle turned"), min(east, report.REASONS_TOLD))
    text = "\n".join(page.console(found))
    assert f"article: of 30 runs 0 without a heading, {east} in doubt\n" in text
    assert f"in doubt, {east} runs: the vehicle turned" in text
    assert f"<th>in doubt, {east} runs</th><td>S still runs</td>" in page.html_page(found)


def test_the_algebra_has_no_doubts_to_count(tmp_path: Path) -> None:
    found = command.campaign(Options(case="R0", runs=100, out=tmp_path), QUIET)
    assert "in doubt" not in "\n".join(page.console(found))
    assert "in doubt" not in page.html_page(found)


def test_a_hold_is_for_chains_that_have_it() -> None:
    w = Wanted(chain="emulated", setup=Setup(), hold=Hold(), seed=1, first_run=0, runs=1)
    with pytest.raises(BadInput, match="--chain: expected closed or samples for a hold, got emulated"):
        chains.compute([w])
    assert CHAINS["closed"].holds
