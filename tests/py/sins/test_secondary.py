"""Calibration from the outputs of a navigating unit: drawn units that integrate their own raw data, the article's two
experiments."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench.campaign import sins_pairs, sins_unit
from psabench.campaign.sins_unit import Experiment, UnitErrors, draw_pair, read_experiment, run_unit
from psabench.errors import BadInput
from psabench.native import nav_errors
from psabench.native.kalman import Kalman
from psabench.native.nav_errors import ErrorsConfig
from psabench.native.sins import Turn
from psabench.progress import Bar
from psabench.quartz.draws import draw_source
from psabench.sins.alignment import aligned_state
from psabench.sins.plan import read_plan
from psabench.sins.secondary import estimate as secondary
from psabench.sins.secondary import page as secondary_page
from psabench.sins.secondary.estimate import Secondary, calibrate_outputs, compensate_outputs, errors_of
from psabench.sins.secondary.outputs import Outputs, read_outputs, write_outputs
from psabench.sins.secondary.run import SecondaryOptions, SecondaryParams, run_secondary

Floats = np.ndarray
# Eight minutes, for what needs no accuracy.
SHORT = [
    Turn(axis_b=(1.0, 0.0, 0.0), rate_radps=math.radians(5.0), duration_s=240.0),
    Turn(axis_b=(0.0, 0.0, 1.0), rate_radps=math.radians(-5.0), duration_s=18.0),
    Turn(axis_b=(0.0, 1.0, 0.0), rate_radps=math.radians(-2.0), duration_s=240.0),
]


@cache
def article() -> Experiment:
    return read_experiment("article")


@cache
def ran() -> tuple[Outputs, Outputs, UnitErrors]:
    """The article's two experiments."""
    return sins_pairs.run_pair(article(), 0)


@cache
def calibrated() -> Secondary:
    return calibrate_outputs(ran()[0], article().point, sins_pairs.params_of(article()).config())


def short(e: Experiment, monkeypatch: pytest.MonkeyPatch, scale: float = 1.0) -> Outputs:
    """A short run of a unit with errors of `scale` of the experiment's."""
    plan = read_plan("secondary")
    monkeypatch.setattr(sins_unit, "read_plan", lambda _: replace(plan, turns=tuple(SHORT)))
    first, _ = draw_pair(replace(e, theta_scale_ppm=10.0 * scale), 0)
    return run_unit(e, first, np.random.default_rng(1))


def test_the_articles_two_experiments() -> None:
    """About 15 and 12 km; at least three times less after the compensation of the second."""
    done = compensate_outputs(calibrated(), ran()[1])
    assert calibrated().errors.radial_m == pytest.approx(15000.0, rel=0.05)
    assert done.before.radial_m == pytest.approx(12000.0, rel=0.05)
    assert done.factor > 3.0
    for axis in (0, 1):
        assert np.abs(done.after.place_m[:, axis]).max() < np.abs(done.before.place_m[:, axis]).max() / 3.0


def test_the_estimates_are_those_of_the_unit() -> None:
    """Within four standard deviations each, which are those of an independent simulation of the same method."""
    s, truth = calibrated(), ran()[2]
    off = s.x[7:] - truth.constants()
    assert np.abs(off / np.sqrt(np.diag(s.covariance)[7:])).max() < 4.0
    assert np.degrees(s.sd("nu")) * 3600.0 == pytest.approx(np.full(3, 0.0022), rel=0.15)
    assert s.sd("theta")[[0, 4, 8]] == pytest.approx(np.full(3, 1.7e-7), rel=0.2)
    assert s.sd("gamma")[[0, 2, 5]] == pytest.approx(
        np.full(3, 2.9e-4), rel=0.02
    )  # differences alone: sqrt(1/3) of 5e-4


def test_a_unit_that_has_not_changed_is_compensated_to_its_noise() -> None:
    """The same errors again, other noise: what is left is what the equations of the first order and the noise
    leave."""
    e = replace(article(), repeatability=0.0)
    _, second = draw_pair(e, 0)
    done = compensate_outputs(calibrated(), run_unit(e, second, np.random.default_rng(5)))
    assert done.factor > 10.0
    left = np.hypot(*done.after.place_m.T)
    assert left[-1] < 4.0 * np.hypot(*done.predicted_sd_m[-1])


def test_raw_data_that_are_corrected_navigate_as_the_outputs_that_are_compensated() -> None:
    """A unit with the correction ends where the equations say, within 5 % of the errors before."""
    e, c = article(), calibrated().correction()
    second = draw_pair(e, 0)[1]
    corrected = UnitErrors(
        nu_radps=c.gyro_matrix @ (second.nu_radps - c.nu_radps),
        theta=c.gyro_matrix @ (np.eye(3) + second.theta) - np.eye(3),
        df_mps2=c.accel_matrix @ (second.df_mps2 - c.df_mps2),
        gamma=c.accel_matrix @ (np.eye(3) + second.gamma) - np.eye(3),
    )
    again = run_unit(e, corrected, draw_source(e.seed, "noise 0 2"))
    done = compensate_outputs(calibrated(), ran()[1])
    kept = errors_of(again, e.point).place_m[:: round(secondary.SHOWN_S / e.output_s)]
    apart = np.hypot(*(kept - done.after.place_m).T).max()
    assert apart < 0.05 * done.before.radial_m


def test_the_alignment_of_the_second_run_is_compensated_too(monkeypatch: pytest.MonkeyPatch) -> None:
    """Otherwise the heading by the east drift stays."""
    full = compensate_outputs(calibrated(), ran()[1]).after.radial_m
    real = aligned_state

    def without(*a: Any) -> tuple[Floats, Floats]:
        x, p = real(*a)
        x[:7] = 0.0
        return x, p

    monkeypatch.setattr(secondary, "aligned_state", without)
    assert compensate_outputs(calibrated(), ran()[1]).after.radial_m > 2.0 * full


def test_an_ideal_unit_stays_at_its_place() -> None:
    zero = UnitErrors(nu_radps=np.zeros(3), theta=np.zeros((3, 3)), df_mps2=np.zeros(3), gamma=np.zeros((3, 3)))
    quiet = replace(article(), gyro_noise_degph_rts=0.0, accel_noise_mps2_rts=0.0)
    outputs = run_unit(quiet, zero, np.random.default_rng(0))
    assert errors_of(outputs, quiet.point).radial_m < 20.0


def test_errors_beyond_the_linear_range_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """The method presupposes a coarse calibration; the line says so."""
    outputs = short(article(), monkeypatch, 10_000.0)
    with pytest.raises(BadInput, match=r"60 km.*calibrate the unit coarsely first"):
        calibrate_outputs(outputs, article().point, where="first.csv")
    with pytest.raises(BadInput, match=r"second.csv: .*60 km"):
        compensate_outputs(calibrated(), outputs, where="second.csv")


@pytest.mark.parametrize(
    ("spoil", "says"),
    [
        (lambda o: replace(o, lat_rad=o.lat_rad + np.where(o.t_s > 300.0, 1e-3, 0.0)), "innovations"),  # a jump of 6 km
        (lambda o: replace(o, c_nb=o.c_nb[:, :, [1, 0, 2]] * np.array([1.0, 1.0, -1.0])), "axes in another order"),
        (lambda o: replace(o, c_nb=np.swapaxes(o.c_nb, 1, 2)), "from n to b"),
        (lambda o: replace(o, w_b_radps=-o.w_b_radps), "rates that turn"),
    ],
    ids=["jump", "axes", "inverse", "signs"],
)
def test_outputs_that_do_not_follow_the_equations_are_refused(
    spoil: Callable[[Outputs], Outputs], says: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    good = short(article(), monkeypatch)
    calibrate_outputs(good, article().point)
    with pytest.raises(BadInput, match=says):
        calibrate_outputs(spoil(good), article().point)
    if says != "innovations":  # a second run has no fit to judge
        with pytest.raises(BadInput, match=says):
            compensate_outputs(calibrated(), spoil(good))


def test_a_short_run_says_what_it_does_not_determine(monkeypatch: pytest.MonkeyPatch) -> None:
    assert any("theta keeps" in w for w in calibrate_outputs(short(article(), monkeypatch), article().point).warnings)


# ---- files


def put(lines: list[str], column: int, text: str) -> list[str]:
    """These values in every row from a column on."""
    new, rows = text.split(","), [x.split(",") for x in lines[1:]]
    return [lines[0], *(",".join([*r[:column], *new, *r[column + len(new) :]]) for r in rows)]


@pytest.fixture
def recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    path = tmp_path / "first.csv"
    write_outputs(path, short(article(), monkeypatch))
    return path


def test_a_recording_comes_back(recording: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given, got = short(article(), monkeypatch), read_outputs(recording)
    assert got.dt_s == pytest.approx(given.dt_s)
    assert np.abs(got.c_nb - given.c_nb).max() < 1e-8
    assert np.abs(got.lat_rad - given.lat_rad).max() * 6.4e6 < 1e-3
    assert np.abs(got.w_b_radps - given.w_b_radps).max() < 1e-9


def test_heading_pitch_and_roll_are_an_attitude_too(recording: Path) -> None:
    from scipy.spatial.transform import Rotation

    rows = np.loadtxt(recording, delimiter=",", skiprows=1)[:500]
    c = Rotation.from_quat(rows[:, [6, 7, 8, 5]]).as_matrix()
    angles = np.degrees(
        [np.arctan2(c[:, 0, 1], c[:, 1, 1]), np.arcsin(c[:, 2, 1]), np.arctan2(-c[:, 2, 0], c[:, 2, 2])]
    ).T
    head = "t_s,lat_deg,lon_deg,ve_mps,vn_mps,heading_deg,pitch_deg,roll_deg,wx_degps,wy_degps,wz_degps"
    other = recording.with_name("angles.csv")
    np.savetxt(
        other, np.hstack([rows[:, :5], angles, rows[:, 9:]]), delimiter=",", header=head, comments="", fmt="%.10f"
    )
    assert np.abs(read_outputs(other).c_nb - c).max() < 1e-8


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda lines: [lines[0].replace("q3", "q4"), *lines[1:]], "no heading_deg"),
        (lambda lines: [lines[0].replace("wx_degps", "wx"), *lines[1:]], "no wx_degps"),
        (lambda lines: lines[:50] + lines[80:], "intervals of"),
        (lambda lines: [*lines[:50], lines[40], *lines[50:]], "goes back"),
        (lambda lines: [*lines[:50], lines[50], *lines[50:]], "a repeated row"),
        (lambda lines: lines[:1], "2 rows or more"),
        (lambda lines: [lines[0], "a,b"], "rows of numbers"),
        (lambda lines: put(lines, 2, "nan"), "others in column lon_deg"),
        (lambda lines: put(lines, 5, "0,0,0,0"), "length 1"),
        (lambda lines: put(lines, 9, "0,0,0"), "a unit that turns"),
        (lambda lines: put(lines, 9, "0,0,200"), "of a turn apart"),
    ],
    ids="attitude rates gap back twice empty words number quaternion still fast".split(),
)
def test_a_recording_that_is_none_is_refused(
    recording: Path, change: Callable[[list[str]], list[str]], says: str
) -> None:
    lines = recording.read_text(encoding="utf-8").splitlines()[:500]
    recording.write_text("\n".join(change(lines)) + "\n", encoding="utf-8")
    with pytest.raises(BadInput, match=says) as e:
        read_outputs(recording)
    assert str(recording) in str(e.value)


def test_the_procedure_takes_recordings_and_reports(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The same run calibrates and is compensated: it becomes better by as much as the short run tells."""
    result = run_secondary(
        SecondaryParams(height_m=150.0, least_factor=2.0), SecondaryOptions(first=recording, second=recording), Bar()
    )
    outputs = short(article(), monkeypatch)
    direct = compensate_outputs(calibrate_outputs(outputs, article().point), outputs)
    assert result.compensated is not None
    assert result.compensated.factor == pytest.approx(direct.factor, rel=0.02)
    assert result.within
    page = secondary_page.write_page(tmp_path, result).read_text(encoding="utf-8")
    for word in ("dLat_bins", "dLong_res", "times less"):
        assert word in page
    assert replace(result, least_factor=1e6).within is False
    alone = replace(result, compensated=None)
    assert alone.within is None
    assert "no second run" in secondary_page.verdict_words(alone)
    with pytest.raises(BadInput, match="--first"):
        run_secondary(SecondaryParams(), SecondaryOptions(), Bar())


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("seed: 1.5", "seed"),
        ("repeatability: -1", "repeatability"),
        ("nu: 3", "nu_degph"),
        ("[1]", "plan"),
        ("7", "plan"),
    ],
)
def test_an_experiment_that_is_none_is_refused(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "e.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadInput, match=says):
        read_experiment(str(path))


# ---- many


def test_what_is_left_is_what_has_changed_between_the_experiments() -> None:
    """Five units, each calibrated once and compensated twice: with twice the change, twice as much is left; the
    covariance of the estimates is honest."""
    e = replace(article(), seed=1, sample_s=0.05)
    params = sins_pairs.params_of(e)
    left, factors, nees = [], [], []
    for k in range(5):
        first, second, truth = sins_pairs.run_pair(e, k)
        found = calibrate_outputs(first, e.point, params.config())
        nees.append(sins_pairs.nees_of(found, truth))
        twice = sins_pairs.run_pair(replace(e, repeatability=0.2), k)[1]
        done, more = compensate_outputs(found, second), compensate_outputs(found, twice)
        left.append((done.after.radial_m, more.after.radial_m))
        factors.append(done.factor)
    once, more_left = np.sqrt(np.mean(np.array(left) ** 2, axis=0))
    assert more_left / once == pytest.approx(2.0, rel=0.15)
    assert 3.0 < np.median(factors) < 14.0
    assert 0.3 < np.mean(nees) < 1.3


# What each kind of error makes of the place, km: the largest standard deviation of the radial error in two hours.
KM = {
    "theta_scale_ppm": {"secondary": 12.6, "secondary_reversing": 4.4},
    "nu_degph": {"secondary": 4.8, "secondary_reversing": 4.7},
    "theta_angle_arcsec": {"secondary": 1.6, "secondary_reversing": 1.5},
    "df_mps2": {"secondary": 2.2, "secondary_reversing": 2.1},
}


@pytest.mark.parametrize("name", list(KM))
@pytest.mark.parametrize("plan", ["secondary", "secondary_reversing"])
def test_a_dozen_kilometres_are_an_error_of_the_gyros_scale(name: str, plan: str) -> None:
    """With the article.yaml deviations one kind at a time, alignment included: figures of the page."""
    e = replace(article(), plan=plan)
    still = dict.fromkeys(("nu_degph", "theta_scale_ppm", "theta_angle_arcsec", "df_mps2"), 0.0)
    alone = replace(e, gamma_scale_ppm=0.0, gamma_angle_arcsec=0.0, **{**still, name: getattr(e, name)})
    sd = np.abs(sins_unit.scaled_errors(alone, np.ones((4, 3, 3))).constants())
    way = ideal_way(plan)
    model = ErrorsConfig()
    kf = Kalman(*aligned_state(model, way.states[0], np.zeros(21), np.diag(sd**2), 600.0), 7)
    most = 0.0
    for first in range(0, len(way), 150):
        nav_errors.predict_errors(model, kf, way.part(first, first + 150))
        most = max(most, float(np.sqrt(np.trace(kf.p[:2, :2]))))
    assert most / 1000.0 == pytest.approx(KM[name][plan], rel=0.03)


@cache
def ideal_way(plan: str) -> nav_errors.Way:
    """Of a unit without errors."""
    zero = UnitErrors(nu_radps=np.zeros(3), theta=np.zeros((3, 3)), df_mps2=np.zeros(3), gamma=np.zeros((3, 3)))
    e = replace(article(), plan=plan, gyro_noise_degph_rts=0.0, accel_noise_mps2_rts=0.0)
    return secondary.way_of(run_unit(e, zero, np.random.default_rng(0)), e.point)


@pytest.mark.parametrize(("times", "km", "percent"), [(1.0, 15.6, 0.4), (4.0, 62.6, 1.7)])
def test_the_equations_miss_this_much_of_large_errors(times: float, km: float, percent: float) -> None:
    """Figures of the page: unit 0 of seed 1 without noise, its true constants through the equations."""
    e = replace(article(), seed=1, gyro_noise_degph_rts=0.0, accel_noise_mps2_rts=0.0)
    e = replace(e, **{name: getattr(e, name) * times for name in (*KM, "gamma_scale_ppm", "gamma_angle_arcsec")})
    unit, way, model = draw_pair(e, 0)[0], ideal_way("secondary"), ErrorsConfig()
    errors = errors_of(run_unit(e, unit, np.random.default_rng(0)), e.point)
    kf = Kalman(*aligned_state(model, way.states[0], unit.constants(), np.zeros((21, 21)), 600.0), 7)
    off = []
    for first in range(0, len(way) - 149, 150):
        nav_errors.predict_errors(model, kf, way.part(first, first + 150))
        off.append(np.hypot(*(errors.place_m[first + 150] - kf.x[:2])))
    assert errors.radial_m / 1000.0 == pytest.approx(km, rel=0.01)
    assert 100.0 * max(off) / errors.radial_m == pytest.approx(percent, abs=0.1)
