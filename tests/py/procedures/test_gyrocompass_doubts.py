"""What must not pass in silence: loops that had not settled, a vehicle that moved, latitudes that do not show.

And how often the doubts speak where nothing is wrong.
"""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fake_bench import seeded
from fake_platform import FakePlatform
from gyro_instruments import NOISE_ARCMIN, article_s_instrument, run
from psabench.errors import BadInput
from psabench.procedures import gyrocompass as g
from psabench.procedures.gyrocompass import GyrocompassResult
from psabench.procedures.gyrocompass_params import params_of
from psabench.procedures.head_bench import Silent

HEADINGS_DEG = range(0, 360, 30)


def error_deg(r: GyrocompassResult, heading_deg: float) -> float:
    return math.degrees(math.remainder(r.heading_rad - math.radians(heading_deg), math.tau))


# ---- where nothing is wrong


@pytest.mark.parametrize(("reading", "runs", "most"), [("article", 2000, 9), ("improved", 100, 1)])
def test_a_good_run_is_hardly_ever_in_doubt(reading: str, runs: int, most: int) -> None:
    """Less than 0.5 % of runs; of the 100 only what that allows with probability 0.91."""
    rng = seeded(f"good runs {reading}")
    doubts = Counter(d[:40] for _ in range(runs) for d in run(article_s_instrument(rng), reading).doubts)
    assert doubts.total() <= most, doubts


@pytest.mark.parametrize(("latitude_deg", "runs"), [(0.0, 8), (-10.0, 15), (20.0, 30), (-80.0, 10)])
def test_a_good_run_is_not_in_doubt_at_any_latitude(latitude_deg: float, runs: int) -> None:
    """The whole table is in docs/procedures/gyrocompass.md; the tilts are what made doubts near the equator."""
    rng = seeded(f"good runs at {latitude_deg}")
    for _ in range(runs):
        bench = replace(article_s_instrument(rng), latitude_deg=latitude_deg)
        assert run(bench, latitude_deg=latitude_deg).doubts == ()


# ---- not settled


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"settle_s": 3.0}, r"settle_s: expected at least 7 with m1_per_s 1 .7/m1_per_s., or --slope yes, got 3"),
        ({"m1_per_s": 0.4}, r"at least 17.5 with m1_per_s 0.4"),
        ({"m2_per_s": 0.1}, r"at least 70 with m2_per_s 0.1"),
        ({"m2_per_s": 0.1, "slope": True}, r"at least 70 with m2_per_s 0.1"),
        ({"m1_per_s": 0.0}, r"expected a loop with m1_per_s 0"),
    ],
)
def test_loops_without_the_time_to_settle_are_refused(given: dict[str, Any], why: str) -> None:
    with pytest.raises(BadInput, match=why):
        params_of("article", given)
    assert params_of("article", {"settle_s": 4.0, "slope": True}).slope, "a slope does not mind what is left of beta"


@pytest.mark.parametrize("left_arcmin", [-60.0, 60.0])
@pytest.mark.parametrize("noise_arcmin", [0.0, NOISE_ARCMIN])
def test_levelling_that_still_runs_is_a_doubt_or_does_no_harm(left_arcmin: float, noise_arcmin: float) -> None:
    """Left over in the second position alone, where it moves a heading by up to 0.8 deg."""
    seen = 0
    for heading_deg in HEADINGS_DEG:
        p = params_of("article")
        bench = FakePlatform(heading_deg=heading_deg, noise_arcmin=noise_arcmin)
        windows = list(g.measure(bench, p, Silent()))
        after_s = windows[1].step_s * np.arange(len(windows[1].beta_rad))
        left = math.radians(left_arcmin / 60.0) * np.exp(-windows[1].m1_per_s * (4.5 + after_s))
        windows[1] = replace(windows[1], beta_rad=windows[1].beta_rad + left)
        r = g.estimate(windows, p)
        told = [d for d in r.doubts if "S still runs" in d]
        assert told or abs(error_deg(r, heading_deg)) < 0.3
        assert all("most in position 2 (90 deg)" in d for d in told)
        seen += bool(told)
    assert seen >= len(HEADINGS_DEG) / 2


def test_a_gimbal_that_still_turns_is_a_doubt() -> None:
    """Levelling takes its turn for a rate; the encoder shows it. 20' left with m2 = 0.7, settled as the rule wants."""
    r = run(FakePlatform(left_gimbal_arcmin=1000.0), "article", m2_per_s=0.7)
    assert any("S still runs" in d for d in r.doubts)
    assert abs(error_deg(r, 40.0)) > 0.1
    assert run(FakePlatform(left_gimbal_arcmin=1000.0), "article", m2_per_s=2.0).doubts == ()


# ---- the vehicle moved


@pytest.mark.parametrize(("sequence", "method"), [("0,90,180", "closed3"), ("0,180,90,270", "gls")])
@pytest.mark.parametrize("turn_deg", [3.0, -0.6])
def test_a_vehicle_that_turned_between_positions_is_always_a_doubt(sequence: str, method: str, turn_deg: float) -> None:
    for heading_deg in HEADINGS_DEG:
        bench = FakePlatform(heading_deg=heading_deg, vehicle_turns_deg={2: turn_deg}, noise_arcmin=NOISE_ARCMIN)
        r = run(bench, "article", sequence=sequence, method=method)
        told = [d for d in r.doubts if "the vehicle turned by" in d]
        assert f"between positions 2 and 3 the vehicle turned by {turn_deg:.1f}" in told[0]


def test_a_turn_within_a_window_is_seen_as_well() -> None:
    p = params_of("article")
    windows = list(g.measure(FakePlatform(), p, Silent()))
    n = len(windows[2].turned_rad)
    late = np.where(np.arange(n) < 0.9 * n, 0.0, math.radians(1.0))
    windows[2] = replace(windows[2], turned_rad=windows[2].turned_rad - late)
    assert "in position 3 the vehicle turned by 1.00 deg" in g.estimate(windows, p).doubts[0]


def test_torquers_may_be_off_by_what_the_passport_says() -> None:
    assert run(FakePlatform(scale2=9e-4), "improved").doubts == ()
    assert "the vehicle turned" in run(FakePlatform(scale2=5e-3), "improved").doubts[0]


def test_readings_lost_in_a_turn_leave_the_vehicle_s_turn_unknown() -> None:
    p = params_of("article")
    windows = list(g.measure(FakePlatform(vehicle_turns_deg={1: 3.0}), p, Silent()))
    windows[1:3] = [replace(w, missed=7) for w in windows[1:3]]
    r = g.estimate(windows, p)
    assert not any("the vehicle turned by" in d for d in r.doubts)
    assert "lost between positions 1 and 2: whether the vehicle turned is not known" in r.notes[0]


def test_a_vehicle_that_tilts_is_no_one_attitude() -> None:
    r = run(FakePlatform(vehicle_tilts_deg={3: 0.5}), "article", sequence="0,180,90,270", method="lsq")
    assert any("no one attitude explains the level angles" in d for d in r.doubts)


@pytest.mark.parametrize("reading", ["article", "improved"])
def test_a_level_sensor_that_is_stuck_is_a_doubt(reading: str) -> None:
    """gamma stays what it was; the rates alone do not tell, whatever the number of positions."""
    p = params_of(reading)
    windows = g.measure(FakePlatform(heading_deg=50.0, pitch_deg=2.0, roll_deg=-1.5), p, Silent())
    stuck = [replace(w, gamma_rad=np.full_like(w.gamma_rad, windows[0].gamma_rad.mean())) for w in windows]
    assert g.estimate(windows, p).doubts == ()
    assert any("the level sensor along x is stuck" in d for d in g.estimate(stuck, p).doubts)


def test_a_zero_of_the_level_sensors_beyond_the_passport_is_a_doubt() -> None:
    assert run(FakePlatform(bias_gamma_arcmin=10.0), "article").doubts == ()
    assert any("gamma is off by 20'" in d for d in run(FakePlatform(bias_gamma_arcmin=20.0), "article").doubts)


def test_windows_that_hardly_any_count_are_a_doubt() -> None:
    silent: dict[int, dict[str, object]] = {k: {"level_lost": True} for k in range(24) if k > 10}
    assert run(FakePlatform(broken=silent)).doubts == ("only 11 of 24 windows count",)
    del silent[11]
    assert run(FakePlatform(broken=silent)).doubts == ()


def test_a_calibration_at_another_angle_does_not_count() -> None:
    p = params_of("improved")
    windows = list(g.measure(FakePlatform(), p, Silent()))
    windows[-1] = replace(windows[-1], encoder_rad=windows[-1].encoder_rad + 0.1, u2_radps=windows[-1].u2_radps + 1.0)
    r = g.estimate(windows, p)
    assert r.get("drift2_degph").value == pytest.approx(-12.0, abs=1e-5)
    assert "the calibration does not count: the encoder shows" in r.notes[-1]


# ---- latitude


@pytest.mark.parametrize("reading", ["article", "improved"])
@pytest.mark.parametrize(("true_deg", "given_deg"), [(0.0, 8.0), (5.0, 9.0), (-6.0, 0.0), (50.0, 50.4), (70.0, 70.15)])
def test_a_latitude_that_does_not_show_is_within_what_is_told(reading: str, true_deg: float, given_deg: float) -> None:
    """The wrong heading is within its limits, or in doubt, or a note tells how far; the effect told is that it has."""
    for heading_deg in (0.0, 45.0, 200.0):
        r = run(FakePlatform(latitude_deg=true_deg, heading_deg=heading_deg), reading, latitude_deg=given_deg)
        limit = 2.0 * r.get("heading_deg").ci_half
        error = abs(error_deg(r, heading_deg))
        assert error <= limit or r.doubts or any("deg cannot be told from" in n for n in r.notes)
        assert r.latitude.low_deg <= true_deg <= r.latitude.high_deg
        assert error <= r.latitude.unseen_deg + 0.02


def test_near_the_equator_a_tilt_calls_for_a_note_and_level_for_none() -> None:
    tilted = run(FakePlatform(latitude_deg=0.0), latitude_deg=0.0)
    level = run(FakePlatform(latitude_deg=0.0, pitch_deg=0.1, roll_deg=0.1), latitude_deg=0.0)
    assert "latitudes from -8.10 to 8.10 deg cannot be told from 0 deg here" in tilted.notes[0]
    assert "the interval holds for a latitude known to 0.1'" in tilted.notes[0]
    assert (*tilted.doubts, *level.doubts, *level.notes) == ()


@pytest.mark.parametrize("true_deg", [-51.0, 51.0])
def test_a_latitude_that_is_off_by_what_the_operator_admits_is_no_doubt(true_deg: float) -> None:
    """1 deg makes 2 % of the Earth's horizontal rate, twice the limit of a latitude that is known."""
    given: dict[str, Any] = {"latitude_deg": math.copysign(50.0, true_deg)}
    assert "it would be right at latitude 5" in run(FakePlatform(latitude_deg=true_deg), **given).doubts[0]
    assert run(FakePlatform(latitude_deg=true_deg), **given, latitude_sd_arcmin=60.0).doubts == ()
    far = FakePlatform(latitude_deg=math.copysign(55.0, true_deg))
    assert "it would be right at latitude 5" in run(far, **given, latitude_sd_arcmin=60.0).doubts[0]


def test_the_other_hemisphere_shows_in_the_passport_s_drift_alone() -> None:
    """2 U sin(50 deg) = 23 deg/h of azimuth drift; the Earth's horizontal rate is the same."""
    bench = {"heading_deg": 135.0, "pitch_deg": 1.0, "roll_deg": 1.0}
    blind = run(FakePlatform(**bench), latitude_deg=-50.0)  # type: ignore[arg-type]
    right = run(FakePlatform(**bench))  # type: ignore[arg-type]
    assert abs(error_deg(blind, 135.0)) == pytest.approx(3.37, abs=0.1)
    assert blind.doubts == ()
    assert blind.latitude.sign_deg == pytest.approx(abs(error_deg(blind, 135.0)), abs=0.1)
    assert right.latitude.sign_deg == pytest.approx(blind.latitude.sign_deg, abs=0.1)
    assert (
        "do not tell the hemisphere, a latitude of the wrong sign would turn this heading by 3.3"
        in right.latitude.words
    )
    passport = {"drift2_degph": -12.0, "drift2_limit_degph": 5.0}
    told = run(FakePlatform(**bench), latitude_deg=-50.0, **passport)  # type: ignore[arg-type]
    assert "drifts by 11.05 deg/h where its passport says -12 +- 5" in told.doubts[0]
    assert "right at latitude 50.0 deg" in told.doubts[0]
    known = run(FakePlatform(**bench), **passport)  # type: ignore[arg-type]
    assert known.doubts == ()
    assert known.latitude.sign_deg is None


def test_a_passport_narrows_what_does_not_show_at_the_equator() -> None:
    passport: dict[str, Any] = {"drift2_degph": -12.0, "drift2_limit_degph": 0.2, "gm_sigma_degph": 0.02}
    r = run(FakePlatform(latitude_deg=0.0), latitude_deg=0.0, **passport)
    assert -1.5 < r.latitude.low_deg < 0.0 < r.latitude.high_deg < 1.5


def test_the_latitude_s_error_widens_the_interval_on_a_tilt() -> None:
    """1 deg of latitude times the tilt, 6.4 deg, in another direction for each heading."""
    sds = [
        [
            run(FakePlatform(heading_deg=h), method="gls", latitude_sd_arcmin=x).get("heading_deg").sd
            for x in (0.0, 60.0)
        ]
        for h in (0.0, 90.0)
    ]
    more = [math.sqrt(wide**2 - narrow**2) for narrow, wide in sds]
    turns = [abs(run(FakePlatform(heading_deg=h), method="gls").latitude.heading_per_latitude) for h in (0.0, 90.0)]
    assert more == pytest.approx(turns, rel=0.03)
    assert math.hypot(*turns) == pytest.approx(math.radians(math.hypot(5.0, 4.0)), rel=0.05)


@pytest.mark.parametrize(("gm_sigma_degph", "half_deg"), [(1e15, 180.0), (400.0, None)])
def test_an_interval_is_a_whole_turn_at_most_and_a_heading_that_is_open_is_in_doubt(
    gm_sigma_degph: float, half_deg: float | None
) -> None:
    """400 deg/h of random drift leave more than half a turn, 1e15 nothing at all."""
    r = run(FakePlatform(), gm_sigma_degph=gm_sigma_degph)
    heading = r.get("heading_deg")
    assert 90.0 < heading.ci_half <= 180.0
    assert half_deg is None or heading.ci_half == half_deg
    positions_deg = min(1.96 * heading.budget[0].u, 180.0)  # without the constant errors
    assert f"+- {positions_deg:.0f} deg at 95 %: with the errors given these positions leave" in r.doubts[-1]
    assert -85.0 <= r.latitude.low_deg < r.latitude.high_deg <= 85.0


def test_the_level_zero_of_the_heading_is_of_the_tilt_there_is() -> None:
    level, steep = (run(FakePlatform(pitch_deg=p, roll_deg=0.0)).get("alpha1_deg").budget[1].u for p in (0.0, 10.0))
    assert level == pytest.approx(0.0, abs=1e-9)
    assert math.sqrt(3.0) * steep == pytest.approx(10.0 / 60.0 * math.tan(math.radians(10.0)), rel=1e-3)
