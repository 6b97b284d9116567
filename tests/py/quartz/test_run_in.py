"""Run-in of a batch: the model through libpsabench, estimates from readings, figures, the command."""

from __future__ import annotations

import ctypes
import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from command_line import QUIET, mistake_line
from psabench import cli
from psabench.campaign.store import Store
from psabench.campaign.workers import ThisProcess
from psabench.errors import BadInput
from psabench.native import clib, quartz_model
from psabench.native.quartz_model import Schedule
from psabench.quartz import limits, run_in, run_in_command, run_in_figures, run_in_page, run_in_wire
from psabench.quartz.batch import draw_instability, load_batch
from psabench.quartz.run_in import RunIn
from psabench.quartz.run_in_command import Options
from psabench.quartz.run_in_page import Report
from psabench.report.page import page_without_foot

ROOT = Path(__file__).resolve().parents[3]
BATCH = load_batch()
QUIET_BATCH = {**BATCH, "start_ug": 0.0, "start_ppm": 0.0, "start_arcsec": 0.0, "glue_keep_spread": 0.0}
SILENT = Schedule(noise_a_rthz=0.0)


def values_of(s: Schedule, b: Mapping[str, float], units: int, seed: int = 1) -> np.ndarray:
    return run_in.estimate_units(quartz_model.read_units(s, b, seed, 1, units))[0]


# ---- the model


def test_a_unit_is_the_same_in_every_range_and_another_for_another_seed() -> None:
    whole = quartz_model.read_units(Schedule(), BATCH, 3, 1, 12)
    first, rest = (quartz_model.read_units(Schedule(), BATCH, 3, k, n) for k, n in ((1, 5), (6, 7)))
    np.testing.assert_array_equal(whole.mean_a, np.concatenate([first.mean_a, rest.mean_a]))
    np.testing.assert_array_equal(whole.sd_a, np.concatenate([first.sd_a, rest.sd_a]))
    assert not np.any(whole.mean_a == quartz_model.read_units(Schedule(), BATCH, 4, 1, 12).mean_a)
    fewer = quartz_model.read_units(Schedule(cycles=2), BATCH, 3, 1, 12)
    np.testing.assert_array_equal(fewer.mean_a, whole.mean_a[:, :3])  # one cycle more shifts nothing


def test_the_librarys_own_batch_is_serial() -> None:
    """A number that is not in its place of the struct gives other units."""
    job = clib.QuartzJobStruct(
        size=ctypes.sizeof(clib.QuartzJobStruct), cycles=1, seed=9, first_serial=1, units=20, g_mps2=9.8094,
        cold_degc=-60.0, hot_degc=85.0, read_degc=30.0, ramp_k_per_min=1.0, soak_min=60.0, rest_min=120.0,
        reading_s=1.0, play_k=0.3,
    )  # fmt: skip
    found = []
    numbers = (ctypes.c_double * len(BATCH))(*BATCH.values())
    for batch, count in ((None, 0), (numbers, len(BATCH))):
        mean_a, sd_a = ((ctypes.c_double * (20 * 2 * 4))() for _ in range(2))
        assert clib.library().quartz_run_in(ctypes.byref(job), batch, count, mean_a, sd_a, None) == 0
        found.append(list(mean_a))
    assert found[0] == found[1]
    assert clib.library().quartz_run_in(ctypes.byref(job), numbers, len(BATCH) - 1, mean_a, sd_a, None) == -1
    job.size -= 8
    assert clib.library().quartz_run_in(ctypes.byref(job), None, 0, mean_a, sd_a, None) == -1


def test_without_scatter_and_noise_the_stress_decays_by_half_each_cycle() -> None:
    change = np.diff(values_of(SILENT, QUIET_BATCH, 40), axis=1)
    # The play of the first cycle is over with the second.
    for k in range(3):
        ratio = change[:, 2:, k] / change[:, 1:-1, k]
        np.testing.assert_allclose(ratio, BATCH["glue_keep"], rtol=0.02)


def test_a_course_that_elements_cannot_follow_relaxes_nothing() -> None:
    fast = replace(SILENT, soak_min=0.0, ramp_k_per_min=5.0)
    change = np.abs(np.diff(values_of(fast, QUIET_BATCH, 10), axis=1))
    slow = np.abs(np.diff(values_of(SILENT, QUIET_BATCH, 10), axis=1))
    assert change[:, 1:].max() < 0.05 * slow[:, 1].min()


def test_a_schedule_that_the_chamber_cannot_do_is_rejected() -> None:
    with pytest.raises(BadInput, match="expected a schedule and a batch that the model takes"):
        quartz_model.read_units(Schedule(cold_degc=-80.0), BATCH, 1, 1, 1)


# ---- estimates


def test_estimates_are_from_readings_and_within_their_uncertainty_of_the_truth() -> None:
    what = RunIn(schedule=Schedule(), batch=BATCH, seed=5)
    r = quartz_model.read_units(what.schedule, BATCH, 5, 1, 400)
    values, uncertain = run_in.estimate_units(r)
    grades = run_in_figures.grade_values(values, uncertain, run_in.true_values(what, 400))
    for g in grades:
        assert g.covered == pytest.approx(0.95, abs=0.02)
        assert g.z_rms == pytest.approx(1.01, abs=0.06)
    noisy = run_in.estimate_units(quartz_model.read_units(replace(Schedule(), noise_a_rthz=4e-9), BATCH, 5, 1, 50))[1]
    np.testing.assert_allclose(noisy / uncertain[:50], 10.0, rtol=1e-3)  # the same draws, ten times


def test_the_emulators_generator_and_the_law_written_in_numpy_agree() -> None:
    """Of independent draws: means of the change at cycles 1 ... 5, all three quantities."""
    values = values_of(Schedule(), BATCH, 4000, seed=11)
    found = np.abs(np.diff(values, axis=1))
    laws = draw_instability(BATCH, 11, 100_000, 5)
    for k, q in enumerate(("zero", "scale", "base")):
        sd = found[..., k].std(axis=0) / np.sqrt(4000)
        off = (found[..., k].mean(axis=0) - laws[q].mean(axis=0)) / sd
        assert np.abs(off).max() < 4.5, (q, off)


# ---- figures


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Report:
    return run_in_command.run_campaign(Options(out=tmp_path_factory.mktemp("run-in")), QUIET)


def test_the_campaign_finds_what_the_batch_was_made_for(report: Report) -> None:
    assert report.within
    assert len(report.checks) == 11
    gains = {q: f.gain for q, f in report.figures.items()}
    for q, (middle, by) in limits.LAW_GAINS.items():
        assert gains[q].value == pytest.approx(middle, abs=by)
        assert 0.02 < gains[q].sd / middle < 0.06
    assert report.figures["zero"].stop == 4
    assert 0.55 < report.figures["zero"].small.share < 0.8


@pytest.mark.parametrize("key", ["glue_ug", "glue_ppm", "glue_arcsec"])
def test_a_batch_with_another_stress_is_out_of_limits(key: str) -> None:
    b = {**BATCH, key: 1.6 * BATCH[key]}
    values = values_of(Schedule(), b, 1000)
    checks = run_in_figures.limit_checks(run_in_figures.find_figures(values, BATCH, 1), _grades(), 1000)
    quantity = {"glue_ug": "zero", "glue_ppm": "scale", "glue_arcsec": "base"}[key]
    outside = [c.what for c in checks if not c.within]
    assert f"{quantity}: gain by run-in" in outside
    assert all(what.startswith(quantity) for what in outside)


def _grades(covered: float = 0.95) -> list[run_in_figures.Grade]:
    return [run_in_figures.Grade(quantity="zero", count=1000, u=0.1, z_rms=1.0, covered=covered)]


def test_uncertainties_that_are_too_small_are_out_of_limits(report: Report) -> None:
    checks = run_in_figures.limit_checks(report.figures, _grades(0.90), 1000)
    assert [c.what for c in checks if not c.within] == ["share of 95 % intervals that contain the truth"]


def test_the_interval_of_a_ratio_covers() -> None:
    rng = np.random.default_rng(2)
    hits = 0
    for _ in range(400):
        x = rng.lognormal(0.0, 0.8, 300)
        found = run_in_figures.ratio_of(2.0 * x * rng.lognormal(0.0, 0.3, 300), x)
        hits += abs(found.value - 2.0 * np.exp(0.045)) <= found.half95
    assert 0.90 < hits / 400 < 0.98


# ---- store and command


def test_parts_in_any_cut_and_order_are_the_same_bytes(tmp_path: Path) -> None:
    what = RunIn(schedule=Schedule(), batch=BATCH, seed=2)
    found = []
    for name, order in (("a", 1), ("b", -1)):
        with Store(tmp_path / name) as store:
            run_in.fill_store(run_in.list_missing(what, run_in.MODEL, 700, store)[:1], store, ThisProcess(), QUIET)
            missing = run_in.list_missing(what, run_in.MODEL, 1200, store)
            assert [w.first for w in missing] == [500, 1000]
            run_in.fill_store(missing[::order], store, ThisProcess(), QUIET)
            found.append(store.rows(run_in.make_origin(what, run_in.MODEL), 1200).tobytes())
    assert found[0] == found[1]


def test_two_processes_give_the_bytes_of_one(tmp_path: Path) -> None:
    found = []
    for count in (1, 2):
        o = Options(units=1500, out=tmp_path / str(count), workers=count)
        run_in_command.run_campaign(o, QUIET)
        with Store(o.out / "store.sqlite") as store:
            found.append(store.rows(store.origins()[0], 1500).tobytes())
    assert found[0] == found[1]


def test_a_cluster_at_an_address_gives_the_bytes_of_one_process(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed")
    found = []
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as cluster:
        for name, how in (("here", {"workers": 1}), ("there", {"dask": cluster.scheduler_address})):
            o = replace(Options(units=1500, out=tmp_path / name), **how)
            run_in_command.run_campaign(o, QUIET)
            with Store(o.out / "store.sqlite") as store:
                found.append(store.rows(store.origins()[0], 1500).tobytes())
    assert found[0] == found[1]


def test_the_report_is_the_same_each_time_and_whole(report: Report, tmp_path: Path) -> None:
    assert cli.main(["campaign", "run-in", "--out", str(tmp_path)]) == 0
    text = page_without_foot((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert text.rstrip() == run_in_page.html_page(report).rstrip()
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["within_limits"]
    assert result["provenance"]["scenarios"][0]["name"] == "run-in"
    assert set(result["quantities"]) == {"zero", "scale", "base"}
    assert "They prove nothing about accelerometers" in text


def test_a_batch_of_another_order_is_read_in_that_of_serial(tmp_path: Path) -> None:
    path = tmp_path / "mine.yaml"
    text = yaml.safe_load((ROOT / "proto/batches/serial.yaml").read_text(encoding="utf-8"))
    path.write_text(yaml.safe_dump(dict(sorted(text.items(), reverse=True)), sort_keys=False))
    assert list(load_batch(str(path)).items()) == list(BATCH.items())


MISTAKES = [
    ("--units 1", "--units: expected 2 to 1000000, got 1"),
    ("--cycles 4", "--cycles: expected 5 to 50, got 4"),
    ("--seed 99999999999999999999", "--seed: expected 0 to "),
    ("--workers 0", "--workers: expected 1 to 1024, got 0"),
    ("--workers 2 --dask tcp://127.0.0.1:9", "--workers: expected none with --dask"),
    ("--set soak=1", "--set: expected NAME=VALUE with a name of cold_degc, "),
    ("--set soak_min=x", "--set soak_min=x: expected a number, got 'x'"),
    ("--set cold_degc=-80", "--set cold_degc=-80: expected -60 to 20 °C, got -80"),
    ("--set soak_min=nan", "--set soak_min=nan: expected 0 to 1000 min, got nan"),
    ("--batch stars", "batches/stars.yaml: expected a file in "),
    ("--store README.md", "README.md: expected a store of results"),
]


@pytest.mark.parametrize(("line", "words"), MISTAKES, ids=[m[0] for m in MISTAKES])
def test_a_mistake_gets_one_line(
    line: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "README.md").write_text("no store, and longer than the hundred bytes of a header would be " * 3)
    monkeypatch.chdir(tmp_path)
    assert words in mistake_line(["campaign", "run-in", *line.split()], capsys)


def test_the_help_names_every_setting_with_its_default() -> None:
    usual = Schedule()
    for name, (default, *_) in run_in_command.SETTINGS.items():
        assert getattr(usual, name) == default


# ---- through the wire


def test_the_scenario_of_a_unit_is_the_shipped_one_with_its_number_and_course() -> None:
    what = RunIn(schedule=Schedule(ramp_k_per_min=2.0), batch=BATCH, seed=1)
    found = run_in_wire.make_scenario(what, 7)
    unit = found["units"][0]
    assert (unit["serial"], unit["axes"]["x"]["quartz"]["play_k"]) == (7, 0.3)
    assert found["chamber"] == {"start_degc": 30.0, "ramp_k_per_min": 2.0}
    assert found["spread"] == {"quartz": BATCH}
    assert unit["axes"]["x"]["afe"]["load_ohm"] == 937.5


def test_changes_that_differ_by_more_than_their_uncertainty_are_out_of_limits() -> None:
    rng = np.random.default_rng(4)
    model, u = rng.standard_normal((10, 6, 3)), np.full((10, 6, 3), 0.5)
    offset = np.array([200.0, 9000.0, 30.0])  # of the converter: no change from start to start
    for size, good in ((0.5, True), (1.5, False)):
        wire = model + offset + size * rng.standard_normal(model.shape)
        found = run_in_wire.compare_changes((wire, np.full_like(u, size if good else 0.5)), (model, 0.0 * u))
        assert [a.count for a in found] == [50, 50, 50]
        assert all(c.within == good for c in run_in_figures.wire_checks(found)), found
    assert run_in_figures.wire_checks(found[:1]) == []  # too few to tell


def test_a_unit_through_the_wire_is_the_same_whichever_came_before_it() -> None:
    what = RunIn(schedule=Schedule(cycles=1, reading_s=0.04), batch=BATCH, seed=3)
    three, third = run_in_wire.measure_wire(what, 1, 3), run_in_wire.measure_wire(what, 3, 1)
    for whole, alone in zip(three, third, strict=True):
        np.testing.assert_array_equal(whole[2:], alone)


def test_a_unit_through_the_wire_changes_as_the_model_does(tmp_path: Path) -> None:
    """One unit, two starts with a cycle between: PSA-2 over CAN; chamber, head and supply over SCPI."""
    what = RunIn(schedule=Schedule(cycles=1), batch=BATCH, seed=3)
    found = {}
    for chain in (run_in.MODEL, run_in_wire.WIRE):
        with Store(tmp_path / "store") as store:
            run_in.fill_store(run_in.list_missing(what, chain, 1, store), store, ThisProcess(), QUIET)
            found[chain.name] = run_in.load_rows(what, chain, store, 1)
    wire, model = found["through the wire"], found["sensor model"]
    off = np.diff(wire[0], axis=1) - np.diff(model[0], axis=1)
    u = np.sqrt(np.sum(wire[1] ** 2 + model[1] ** 2, axis=1))
    assert np.all(np.abs(off[:, 0]) < 4.0 * u), (off, u)
    assert np.all(np.abs(np.diff(model[0], axis=1)[0, 0]) > u[0])  # there is a change to be seen
