"""Campaigns: the same numbers whoever computes them and however often interrupted; chains agree; limits bite."""

from __future__ import annotations

import hashlib
import json
import os
import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench import cli
from psabench.campaign import builds, chains, claims, command, emulated, page, report, runner, workers
from psabench.campaign.cases import STUDIES, Case
from psabench.campaign.chains import CHAINS, Wanted
from psabench.campaign.claims import Figures, HoldFigures
from psabench.campaign.command import Options
from psabench.campaign.runner import Plan
from psabench.campaign.setup import Hold, Setup, changed
from psabench.campaign.workers import Dask, ThisProcess, spread
from psabench.errors import BadInput, BenchError, LinkError
from psabench.navlib import NAME, library
from psabench.progress import Bar
from psabench.store import CELL, Rows, Store

QUIET = Bar(Path(os.devnull).open("w"))  # noqa: SIM115  # for as long as the tests run
READINGS = {c.name: c for c in STUDIES["readings"].cases(Setup())}
TWO = [READINGS["R0"], READINGS["R5n"]]


def plan(cases: Sequence[Case] = TWO, chain: str = "samples", runs: int = 3 * 8192 + 5, seed: int = 3) -> Plan:
    return Plan(cases=cases, chain=chain, runs=runs, seed=seed)


def computed(p: Plan, store: Store, at_work: Any = None) -> list[Rows]:
    """All rows of a plan, by these workers."""
    runner.run(runner.missing(p, store), store, at_work or ThisProcess(), QUIET)
    return [p.rows(store, c) for c in p.cases]


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    """A Dask cluster that somebody else runs: its address."""
    from distributed import LocalCluster

    with LocalCluster(  # type: ignore[no-untyped-call]
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as there:
        yield there.scheduler_address


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


def test_processes_and_a_cluster_at_an_address_give_the_same_bytes(tmp_path: Path, cluster: str) -> None:
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
        found[name] = ((out / "result.json").read_bytes(), (out / "report.html").read_bytes(), rows)
    assert len(found["one"][2]) == 2 * 3  # the closed form stands beside
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


@pytest.mark.parametrize("count", ["1", "2"])
def test_ctrl_c_ends_it_at_once_and_keeps_what_was_done(tmp_path: Path, count: str) -> None:
    """As a terminal does it: the signal goes to the whole group, workers included."""
    argv = [sys.executable, "-m", "psabench.cli", *ENDLESS.split(), count, "--out", str(tmp_path)]
    wanted = Wanted(chain="samples", setup=TWO[0].setup, hold=None, seed=1, first_run=0, runs=8192)
    with subprocess.Popen(argv, stderr=subprocess.PIPE, text=True, start_new_session=True) as process:
        deadline_s = time.monotonic() + 120
        done: dict[int, int] = {}
        while len(done) < 3:
            assert time.monotonic() < deadline_s
            assert process.poll() is None
            if (tmp_path / "store.sqlite").exists():
                with Store(tmp_path / "store.sqlite") as store:
                    done = store.runs(wanted.origin)
            time.sleep(0.05)
        os.killpg(process.pid, signal.SIGINT)
        _, err = process.communicate(timeout=60)
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


def test_a_cluster_with_another_psabench_is_refused(
    cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = workers.own_build("closed")
    monkeypatch.setattr(chains, "versions", lambda: "psabench 8")  # here, and not in the workers
    with pytest.raises(BadInput, match=rf"its workers have {re.escape(mine)}. This is psabench 8, build "):
        command.campaign(Options(case="R0", dask=cluster, out=tmp_path), QUIET)


def test_a_cluster_with_another_build_is_refused(cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mine = builds.algebra()
    another_build(monkeypatch)
    with pytest.raises(BadInput, match=rf"build {mine[:12]}. This is .*, build 0123456789ab$"):
        command.campaign(Options(case="R0", dask=cluster, out=tmp_path), QUIET)


def _broken(_: object) -> None:
    raise RuntimeError("the disk of the worker is full")


def _refusing(_: object) -> None:
    raise BadInput("two positions")


def test_what_goes_wrong_in_a_worker_is_told(cluster: str) -> None:
    with workers.workers(address=cluster) as there:
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
    assert [s.split(" ")[0] for s in says] == ["error", "calibration", "90°", "averaging", "≤", "0.5°"]
    verdicts = " ".join(c.verdict for c in whole.claims)
    assert verdicts.count("not reproduced") == 1  # 90 deg is not the best step
    assert "in 240 s with turns at 30" in whole.claims[0].improved
    assert "105 to 120° are better" in verdicts


def test_the_report_is_whole_and_the_same_each_time(whole: page.Campaign, tmp_path: Path) -> None:
    first = page.write(tmp_path / "a", whole).read_text(encoding="utf-8")
    second = page.write(tmp_path / "b", whole).read_text(encoding="utf-8")
    assert first == second
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
    none = Figures.of(np.full((2, 4), nan, CELL))
    assert (none.refused, none.within_claim) == (2, 0.0)
    assert np.isnan(none.heading.p95)


def test_a_run_through_the_wire_without_a_heading_is_counted_as_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def never_settles(*_: object) -> None:
        raise LinkError("the platform was not level after 60 s: it never settles")

    monkeypatch.setattr("psabench.bench.Bench.start", lambda *_, **__: nullcontext())
    monkeypatch.setattr(emulated, "WirePlatform", lambda _: None)
    monkeypatch.setattr("psabench.procedures.gyrocompass.measure", never_settles)
    found = command.campaign(Options(case="article", chain="emulated", runs=3, workers=1, out=tmp_path), QUIET)
    (f,) = found.found.values()
    assert isinstance(f, Figures)
    assert (f.runs, f.refused) == (3, 3)
    assert not found.within  # nothing came that could be compared
    page.write(tmp_path, found)
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["agreements"][0]["p"] is None


# ---- settings and options


def test_settings_change_the_instrument_of_every_study() -> None:
    base = changed(Setup(), ["latitude_deg=60", "angles_deg=0,120,240", "gm_from_zero=yes", "alpha1_deg=12"])
    assert (base.latitude_deg, base.angles_deg, base.gm_from_zero) == (60.0, (0.0, 120.0, 240.0), True)
    assert base.alpha1_deg == 12.0
    assert changed(base, ["alpha1_deg=any"]).alpha1_deg is None
    (own,) = STUDIES["own"].cases(base)
    assert own.setup == base
    r5 = next(c for c in STUDIES["readings"].cases(base) if c.name == "R5")
    assert (r5.setup.gm_sigma_degph, r5.setup.latitude_deg) == (0.02, 60.0)  # a study's own settings win
    p = Plan(cases=[own], chain="closed", runs=10, seed=1)
    assert not report._plain(p)
    assert report._plain(replace(p, cases=TWO))


MISTAKES = [
    ("--study stars", "--study stars: no such study; readings, sources, step"),
    ("--case R99", "--case R99: no such case; R0, R1"),
    ("--runs 0", "--runs 0: expected 1 to 100000000"),
    ("--seed 99999999999999999999", "expected 0 to"),
    ("--workers 0", "--workers 0: expected 1 to 1024"),
    ("--workers 2 --dask tcp://127.0.0.1:9", "--workers: the cluster at --dask has its own number"),
    ("--set latitude_deg", "--set latitude_deg: expected NAME=VALUE with a name of latitude_deg, "),
    ("--set latitude=3", "--set latitude=3: expected NAME=VALUE"),
    ("--set latitude_deg=x", "--set latitude_deg=x: "),
    ("--set latitude_deg=nan", "is not a number of this world"),
    ("--set method=guess", "method is 'guess'; it must be closed3, lsq"),
    ("--set gm_from_zero=maybe", "expected yes or no"),
    ("--study own --set latitude_deg=90", "latitude beyond 85 degrees"),
    ("--study own --set angles_deg=0,90", "too few positions"),
    ("--study own --set angles_deg=0,0,0", "positions coincide"),
    ("--study own --set window_s=-1", "out of range: a negative noise or window"),
    (
        "--study hold --chain emulated",
        "--chain emulated: 0.1 deg and 0.05 deg/h, nothing else: the hold is computed by",
    ),
    ("--case R5n --chain emulated", "--chain emulated: its turns take time: slew_dps is wanted"),
    ("--store README.md", "README.md: not a store of results"),
]


@pytest.mark.parametrize(("line", "words"), MISTAKES, ids=[m[0] for m in MISTAKES])
def test_a_mistake_gets_one_line_and_status_2(
    line: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "README.md").write_text("no store, and longer than the hundred bytes of a header would be " * 3)
    monkeypatch.chdir(tmp_path)
    assert cli.main(["campaign", "gyrocompass", *line.split()]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert words in err
    assert err.splitlines()[-1].startswith("psabench: ")


def test_the_command_prints_computes_once_and_is_quiet_the_second_time(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = ["campaign", "gyrocompass", "--study", "hold", "--runs", "3000", "--out", str(tmp_path)]
    assert cli.main(argv) == 0
    first = capsys.readouterr()
    assert "closed form, 1 at once: 12/12 in" in first.err
    assert "0.1 deg and 0.05 deg/h, nothing else" in first.out
    assert "4 of 4 figures lie within their limits." in first.out
    assert cli.main(argv) == 0
    second = capsys.readouterr()
    assert (second.out, second.err) == (first.out, "")
    assert cli.main([*argv, "--fresh"]) == 0
    third = capsys.readouterr()
    assert third.out == first.out
    assert "12/12" in third.err


def another_build(monkeypatch: pytest.MonkeyPatch, build: str = "0123456789abcdef") -> None:
    """As if the library had been built anew."""
    monkeypatch.setattr(chains, "CHAINS", {n: replace(c, build=lambda: build) for n, c in CHAINS.items()})


def test_results_of_another_build_are_told_kept_and_never_mixed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    few, more = (Options(case="R0", chain="samples", runs=n, workers=1, out=tmp_path) for n in (8192, 9000))
    mine = builds.algebra()[:12]
    command.campaign(few, QUIET)
    assert capsys.readouterr().err == ""
    another_build(monkeypatch)
    command.campaign(more, QUIET)
    err = capsys.readouterr().err
    told = f"psabench: {tmp_path}/store.sqlite: runs of other builds than 0123456789ab"
    assert f"{told} (8192 by {mine}) are kept, not used; --forget-others removes them\n" in err
    p = Plan(cases=TWO[:1], chain="samples", runs=9000, seed=1)
    with Store(tmp_path / "store.sqlite") as store:
        assert store.runs(p.origin(TWO[0])) == {0: 8192, 8192: 808}  # all of them, not the rest alone
        assert store.others(p.origin(TWO[0])) == {builds.algebra(): 8192}
    command.campaign(replace(more, forget_others=True), QUIET)
    assert f"{told} (8192 by {mine}) are removed\n" in capsys.readouterr().err
    command.campaign(more, QUIET)
    assert capsys.readouterr().err == ""
    monkeypatch.undo()  # the first build is back: it finds nothing of its own
    command.campaign(few, QUIET)
    assert "(9000 by 0123456789ab) are kept" in capsys.readouterr().err


class Elsewhere:
    """A worker whose library was built anew after the campaign had started."""

    count = 1

    def map(self, compute: Callable[[Any], Any], tasks: Iterable[Any]) -> Iterator[Any]:
        for task in tasks:
            yield [replace(p, origin=replace(p.origin, build="0123456789abcdef")) for p in compute(task)]


def test_a_worker_whose_build_changed_on_the_way_ends_it(tmp_path: Path) -> None:
    with Store(tmp_path / "s") as store:
        with pytest.raises(BenchError, match="a worker computes with another build than this"):
            computed(plan(runs=10), store, Elsewhere())
        assert store.origins() == []


def test_a_build_is_what_its_files_hold(tmp_path: Path) -> None:
    a, b = tmp_path / "a", tmp_path / "b"
    a.write_bytes(b"one")
    b.write_bytes(b"two")
    first = builds.digest([a, b])
    assert builds.digest([b, a]) != first
    assert builds.digest([a]) != first
    assert builds.algebra() == hashlib.sha256(Path(library().path).read_bytes()).hexdigest()
    assert builds.wire() not in ("", builds.algebra())
    a.rename(tmp_path / "c")
    assert builds.digest([tmp_path / "c", b]) == first
    b.write_bytes(b"twO")
    assert builds.digest([tmp_path / "c", b]) != first


def test_a_library_that_the_loader_found_is_found_again(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """Its path is a bare name then; the kernel knows the file."""
    file = Path(library().path).resolve()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(library(), "path", NAME)
    assert builds._loaded().resolve() == file


def test_the_list_names_all(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["campaign", "gyrocompass", "--list"]) == 0
    out = capsys.readouterr().out
    assert all(f"{s.name}: {s.title}\n" in out for s in STUDIES.values())
    assert "  gm_sigma_degph=0.2\n" in out
    assert "  method=closed3 (closed3, lsq, constrained, gls, gls_constrained)\n" in out


def test_a_hold_is_for_chains_that_have_it() -> None:
    w = Wanted(chain="emulated", setup=Setup(), hold=Hold(), seed=1, first_run=0, runs=1)
    with pytest.raises(BadInput, match="--chain emulated: the hold is not computed by it; closed, samples does"):
        chains.compute([w])
    assert CHAINS["closed"].holds
