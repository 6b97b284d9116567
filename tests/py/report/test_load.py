"""Runs read back from disk: arrays with units, results, provenance; errors with file and line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import psabench
import pytest
from fake_bench import FakeBench
from fake_platform import FakePlatform
from psabench.errors import BadInput
from psabench.procedures import gyrocompass, heading_hold
from psabench.procedures.gyrocompass_params import params_of
from psabench.procedures.head_bench import Silent, Watch
from psabench.procedures.heading_hold import HoldParams
from psabench.procedures.recording import STEP_ARRAYS, CsvRecorder, PlatformRecorder
from psabench.procedures.turns import TurnsParams, turns
from psabench.report import provenance
from psabench.report.load import unit_of_column
from psabench.report.page import whole_page, write_report


def test_a_calibration_is_read_back_to_the_bit(tmp_path: Path) -> None:
    with CsvRecorder(tmp_path / "turns-quiet.csv") as recorder:
        result = turns(FakeBench(noise_v=1e-3), TurnsParams(readings=2), Watch(record=recorder))
    with provenance.command_run(["psabench", "run", "turns"]):
        provenance.note_digest("x", 6, {})
        write_report(tmp_path, {"format": 1, "facts": {}}, whole_page("p", {}, []))
    (tmp_path / "run.log.calls.csv").write_text("not,a\nseries\n")
    run = psabench.load(tmp_path)
    assert list(run.series) == ["turns-quiet"]
    series = run["turns-quiet"]
    assert series["u_v"].tolist() == [r.u_v for r in result.readings]
    assert series["t_s"].tolist() == [r.t_s for r in result.readings]
    assert series["face"].tolist() == [r.face.value for r in result.readings]
    assert series["realisation"].dtype == np.int64
    assert (series.units["u_v"], series.units["alpha_deg"], series.units["face"]) == ("V", "deg", "")
    assert len(series) == len(result.readings)
    assert (run.result["format"], run.provenance["seed"]) == (1, 6)
    assert psabench.load(str(tmp_path / "turns-quiet.csv"))["turns-quiet"]["u_v"].tolist() == series["u_v"].tolist()


def test_a_platforms_windows_and_looks_are_kept(tmp_path: Path) -> None:
    p = params_of("improved")
    seen: list[int] = []
    with PlatformRecorder(FakePlatform(), tmp_path, "improved", holds=True) as platform:
        windows = gyrocompass.measure(platform, p, Silent(), seen=lambda: seen.append(windows_so_far(tmp_path)))
        start = gyrocompass.estimate(windows, p)
        hold = heading_hold.hold(platform, start, HoldParams(hours=1.0, look_s=1200.0), Silent())
    assert seen == sorted(set(seen))
    assert seen[0] > 0  # a window is on the disk before the next one begins
    run = psabench.load(tmp_path)
    series = run["gyrocompass-improved"]
    for name in STEP_ARRAYS:
        assert series[name].tolist() == [x for w in windows for x in getattr(w, name).tolist()], name
    assert set(series["part"]) == {"position", "calibration"}
    w = windows[1]
    inside = (series["position"] == 2) & (series["part"] == "position")
    assert series["t_s"][inside].mean() == pytest.approx(w.t_mid_s, abs=1e-6)
    assert np.diff(series["t_s"][inside]) == pytest.approx(w.step_s, abs=1e-6)
    assert {series.units[n] for n in STEP_ARRAYS} == {"rad", "rad/s"}
    looks = run["heading-hold-improved"]
    assert len(looks) == len(hold.held) + 1  # one before navigation
    assert looks["t_s"][1:] - looks["t_s"][1] == pytest.approx([h.t_s for h in hold.held])
    assert (looks.units["heading_rad"], run.result, run.provenance) == ("rad", {}, {})


def windows_so_far(folder: Path) -> int:
    return len(psabench.load(folder)["gyrocompass-improved"])


def test_what_is_wrong_with_a_window_is_kept_with_it(tmp_path: Path) -> None:
    with PlatformRecorder(
        FakePlatform(broken={1: {"lost": 3, "saturated": True}}), tmp_path, "a", holds=False
    ) as bench:
        gyrocompass.measure(bench, params_of("article"), Silent())
    series = psabench.load(tmp_path)["gyrocompass-a"]
    bad = series["position"] == 2
    assert set(series["lost"][bad]) == {3}
    assert set(series["lost"][~bad]) == {0}
    assert set(series["faults"][bad]) == {"3 frames or readings were lost in it; a torquer was at its limit"}
    assert not (tmp_path / "heading-hold-a.csv").exists()


def test_a_row_that_a_crash_cut_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t_s,u_v\n0.5,1.25\n1.0,2.")
    assert psabench.load(tmp_path)["a"]["u_v"].tolist() == [1.25]
    (tmp_path / "a.csv").write_text("t_s,u_v\n")
    assert len(psabench.load(tmp_path)["a"]) == 0


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", r"a\.csv:1: expected names of columns, got none"),
        ("1.0,2.0\n3.0,4.0\n", r"a\.csv:1: expected names of columns, got 1\.0,2\.0"),
        ("t_s,t_s\n1,2\n", r"a\.csv:1: expected names of columns"),
        ("t_s,u_v\n1,2\n3\n4,5\n", r"a\.csv:3: expected 2 columns, got 1"),
    ],
)
def test_a_file_that_is_no_series_is_bad_input(text: str, expected: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(BadInput, match=expected):
        psabench.load(tmp_path)


def test_names_that_are_not_there_are_answered_with_those_that_are(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t_s,u_v\n1,2\n")
    run = psabench.load(tmp_path)
    calls: tuple[tuple[Callable[[], object], type[Exception], str], ...] = (
        (lambda: run["b"], KeyError, "expected a, got b"),
        (lambda: run["a"]["w"], KeyError, "expected t_s, u_v, got w"),
        (lambda: psabench.load(tmp_path / "none"), BadInput, "no such file"),
        (lambda: psabench.load(tmp_path.parent / "empty"), BadInput, "expected result.json or conform.json or series"),
    )
    (tmp_path.parent / "empty").mkdir(exist_ok=True)
    for call, kind, words in calls:
        with pytest.raises(kind, match=words):
            call()


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        ("t_s", "s"),
        ("t_sample_s", "s"),
        ("u_v", "V"),
        ("x_vs", "V s"),
        ("kx_v_per_g", "V/g"),
        ("kxy_v_per_g2", "V/g²"),
        ("u1_radps", "rad/s"),
        ("temp_degc", "°C"),
        ("T_degC", "°C"),
        ("X_LSB", "LSB"),
        ("temp_code", ""),
        ("s", ""),
        ("faults", ""),
    ],
)
def test_the_unit_is_the_end_of_a_name(name: str, unit: str) -> None:
    assert unit_of_column(name) == unit
