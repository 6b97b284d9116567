"""Gyrocompassing on a platform in memory: exact without noise, honest with it, never silently wrong."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from fake_bench import seeded
from fake_platform import STEP_S, FakePlatform
from psabench.errors import BadInput, LinkError
from psabench.estimate.angles import wrapped_deg
from psabench.native import nav
from psabench.native.nav import DEGPH, EARTH_RADPS
from psabench.procedures import gyrocompass as g
from psabench.procedures.gyrocompass import GyrocompassResult
from psabench.procedures.gyrocompass_params import GyrocompassParams, params_of
from psabench.procedures.gyrocompass_windows import s_of
from psabench.procedures.head_bench import Silent
from psabench.procedures.platform_bench import Window
from scipy import stats

EARTH_DEG = 2e-5  # the fake's 15.041067 deg/h has 1e-8 less than the library's Earth; (14) leaves more
NO_CONSTANTS = {"angle_zero_arcmin": 0.0, "level_zero_arcmin": 0.0, "torquer_scale": 0.0}  # of a passport


def run(bench: FakePlatform, reading: str = "improved", **given: object) -> GyrocompassResult:
    p = params_of(reading, given)
    return g.estimate(g.measure(bench, p, Silent()), p)


def heading_error_deg(r: GyrocompassResult, bench: FakePlatform) -> float:
    return wrapped_deg(r.get("heading_deg").value - bench.heading_deg)


# ---- without noise


@pytest.mark.parametrize("latitude_deg", [-60.0, 0.0, 50.0, 80.0])
@pytest.mark.parametrize("positions", ["0,90,180", "10,130,250", "-20,40,75,200", "0,180,90,270", "180,0,300,60,120"])
@pytest.mark.parametrize("method", ["lsq", "constrained", "gls"])
def test_any_positions_in_any_order_give_heading_and_both_drifts(
    latitude_deg: float, positions: str, method: str
) -> None:
    bench = FakePlatform(latitude_deg=latitude_deg, heading_deg=217.0)
    r = run(bench, latitude_deg=latitude_deg, sequence=positions, method=method, repeat=1)
    assert abs(heading_error_deg(r, bench)) < EARTH_DEG
    assert r.get("drift1_degph").value == pytest.approx(25.0, abs=1e-6)
    assert r.get("drift2_degph").value == pytest.approx(-12.0, abs=1e-5)
    assert r.get("pitch_deg").value == pytest.approx(5.0, abs=1e-9)
    assert r.get("roll_deg").value == pytest.approx(-4.0, abs=1e-9)
    assert r.doubts == ()


@pytest.mark.parametrize("heading_deg", [0.0, 89.0, 135.0, 180.0, 275.0, 359.9])
def test_the_article_s_reading_at_any_heading(heading_deg: float) -> None:
    """(14) instead of (13) costs thousandths of a degree at 5 deg of tilt and some arc seconds of beta."""
    bench = FakePlatform(heading_deg=heading_deg)
    assert abs(heading_error_deg(run(bench, "article"), bench)) < 1e-3


def test_the_drift_of_three_positions_90_deg_apart_is_half_the_sum() -> None:
    """The article prints the sum itself, which gives 50 for 25."""
    bench = FakePlatform(pitch_deg=0.0, roll_deg=0.0)
    r = run(bench, "article")
    s = [row.position.s_radps / DEGPH for row in r.rows]
    assert (s[0] + s[2]) / 2.0 == pytest.approx(r.get("drift1_degph").value, abs=1e-9)
    assert s[0] + s[2] == pytest.approx(50.0, abs=1e-4)


def test_the_formulas_as_printed_are_wrong() -> None:
    """(18), (19) on the same windows: tens of degrees at most headings."""
    worst = 0.0
    for heading_deg in np.arange(5.0, 360.0, 30.0):
        bench = FakePlatform(heading_deg=float(heading_deg))
        r = run(bench, "article")
        printed, drift = nav.gyrocompass_printed([row.position for row in r.rows], r.params.latitude_rad)
        worst = max(worst, abs(math.remainder(printed - r.compass.alpha1_rad, 2 * math.pi)))
        assert drift / DEGPH == pytest.approx(50.0, abs=0.3)
    assert worst > math.radians(60.0)


def test_gimbal_angles_are_not_turns_about_the_vertical() -> None:
    """The cardan trap: 5 deg of pitch and roll, uncorrected, up to 26 arc minutes in a step of 90 deg."""
    worst = 0.0
    for heading_deg in np.arange(0.0, 360.0, 15.0):
        bench = FakePlatform(heading_deg=float(heading_deg), pitch_deg=5.0, roll_deg=5.0)
        assert abs(heading_error_deg(run(bench, "article"), bench)) < 1e-3
        bench = FakePlatform(heading_deg=float(heading_deg), pitch_deg=5.0, roll_deg=5.0)
        r = run(bench, "article", cardan=False)
        worst = max(worst, abs(heading_error_deg(r, bench)))
        assert r.compass.quality < 0.01, "the quality flag does not see it"
    assert worst > 0.2


def test_a_slope_is_as_right_as_a_mean() -> None:
    bench = FakePlatform()
    assert abs(heading_error_deg(run(bench, slope=True), bench)) < EARTH_DEG


def test_set_angles_err_by_what_was_not_set_and_the_encoder_knows() -> None:
    wrong, right = [], []
    for k in range(30):
        rng = np.random.default_rng(k)
        bench = FakePlatform(set_sd_arcmin=30.0, rng=rng)
        windows = g.measure(bench, params_of("improved"), Silent())
        right.append(heading_error_deg(g.estimate(windows, params_of("improved")), bench))
        wrong.append(heading_error_deg(g.estimate(windows, params_of("improved", {"angles": "set"})), bench))
    assert np.std(right) < 1e-6
    assert np.std(wrong) > 0.05


def limit_of(r: g.GyrocompassResult, name: str, component: str) -> float:
    """Of a constant error in an estimate's budget, in its unit."""
    return math.sqrt(3.0) * next(c.u for c in r.get(name).budget if c.name == component)


def test_level_errors_show_in_the_drift_not_in_the_heading() -> None:
    """10 arc minutes of beta and gamma: U sin(lat) 10' = 0.0335 deg/h of drift, thousandths of a degree of heading."""
    bench = FakePlatform(bias_beta_arcmin=10.0, bias_gamma_arcmin=10.0)
    r = run(bench, "article")
    assert abs(heading_error_deg(r, bench)) < 0.02
    assert r.get("drift1_degph").value - 25.0 == pytest.approx(0.0335, abs=0.002)
    assert limit_of(r, "drift1_degph", "level zero") == pytest.approx(0.0335, rel=0.01)


def test_a_torquer_s_scale_shows_in_the_drift_alone() -> None:
    bench = FakePlatform(scale1=1e-3)
    r = run(bench, method="lsq")
    assert abs(heading_error_deg(r, bench)) < 0.02  # of the compensation of gamma, at 5 deg of tilt
    assert r.get("drift1_degph").value - 25.0 == pytest.approx(-0.025, abs=0.001)
    assert limit_of(r, "drift1_degph", "torquer scale") == pytest.approx(0.025, rel=0.2)


# ---- with noise: intervals


@pytest.mark.parametrize(("reading", "runs"), [("article", 200), ("improved", 60)])
def test_intervals_of_pitch_and_roll_are_those_of_the_positions(reading: str, runs: int) -> None:
    """Errors over their standard deviations. A fixed one, that of a single reading, was 0.82 and 1.4 or 3.5 of them."""
    rng = seeded(f"gyrocompass attitude {reading}")
    p = params_of(reading, {"angle_zero_arcmin": 0.0})
    angle = {"article": "set_sd_arcmin", "improved": "read_sd_arcmin"}[reading]
    errors: dict[str, float] = {"level_sd_arcmin": p.level_sd_arcmin, angle: p.angle_sd_arcmin}
    z = []
    for _ in range(runs):
        tilt = dict(zip(("pitch_deg", "roll_deg"), rng.uniform(-5.0, 5.0, 2).tolist(), strict=True))
        bench = FakePlatform(heading_deg=float(rng.uniform(0, 360)), rng=rng, **tilt, **errors)  # type: ignore[arg-type]
        r = g.estimate(g.measure(bench, p, Silent()), p)
        z.append([(r.get(name).value - true) / r.get(name).sd for name, true in tilt.items()])
    least, most = np.sqrt(stats.chi2.ppf([1e-4, 1.0 - 1e-4], runs) / runs)  # of both rows: two in 2500
    found = np.sqrt(np.mean(np.square(z), axis=0))
    assert ((least < found) & (found < most)).all(), f"pitch and roll: z {found}, expected {least:.3f} to {most:.3f}"


@pytest.mark.parametrize("reading", ["article", "improved"])
def test_intervals_cover_what_they_say(reading: str) -> None:
    """200 instruments with a Gauss-Markov drift: 95 % of the errors lie within the interval, within sampling."""
    rng = seeded(f"gyrocompass {reading}")
    p = params_of(reading, {"level_sd_arcmin": 0.0, **NO_CONSTANTS})
    angle = p.angle_sd_arcmin
    inside, z = 0, []
    runs = 200
    for _ in range(runs):
        drift = _gauss_markov(rng, 0.2, 1000.0)
        sd = {"set_sd_arcmin": angle} if reading == "article" else {"read_sd_arcmin": angle}
        bench = FakePlatform(heading_deg=float(rng.uniform(0, 360)), drift1_degph=drift, rng=rng, **sd)  # type: ignore[arg-type]
        e = (r := g.estimate(g.measure(bench, p, Silent()), p)).get("heading_deg")
        error = heading_error_deg(r, bench)
        inside += abs(error) <= e.ci_half
        z.append(error / e.sd)
    assert 0.90 <= inside / runs <= 0.99
    assert 0.85 <= float(np.std(z)) <= 1.15


def _gauss_markov(rng: np.random.Generator, sigma: float, tau_s: float) -> object:
    """25 deg/h and a drift of that process, by steps of a second."""
    n = 2000
    keep = math.exp(-1.0 / tau_s)
    x = np.empty(n)
    x[0] = sigma * rng.standard_normal()
    kick = sigma * math.sqrt(1.0 - keep**2) * rng.standard_normal(n)
    for k in range(1, n):
        x[k] = keep * x[k - 1] + kick[k]
    return lambda t_s: 25.0 + float(np.interp(t_s, np.arange(n), x))


@pytest.mark.parametrize("heading_deg", [0.0, 37.0, 90.0, 200.0])
def test_white_noise_of_the_level_widens_the_interval(heading_deg: float) -> None:
    """n sqrt(m1 dt)/T in each S, sqrt(1/2) of it in half the difference of the outer positions, sqrt(3/2) in the middle
    one less their mean: so the heading, by where north is between them. Three windows tell n to 1.7 %."""
    none = {"gm_sigma_degph": 0.0, "angle_sd_arcmin": 0.0, "level_sd_arcmin": 0.0, "latitude_sd_arcmin": 0.0}
    none |= NO_CONSTANTS
    quiet, loud = (
        run(FakePlatform(noise_arcmin=n, heading_deg=heading_deg, pitch_deg=0.0, roll_deg=0.0), "article", **none)
        for n in (0.0, 0.05)
    )
    assert quiet.get("heading_deg").sd < 1e-6
    s_sd_radps = math.radians(0.05 / 60.0) * math.sqrt(1.0 * STEP_S) / 10.0
    north_radps = EARTH_RADPS * math.cos(math.radians(50.0))
    h = math.radians(heading_deg)
    share = math.hypot(math.sqrt(0.5) * math.cos(h), math.sqrt(1.5) * math.sin(h))
    want_deg = math.degrees(s_sd_radps / north_radps) * share
    assert loud.get("heading_deg").sd == pytest.approx(want_deg, rel=0.08)  # 4.8 sd


# ---- what is refused, and what is flagged


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"sequence": "0,90"}, "position"),
        ({"sequence": "0,0,0"}, "direction"),
        ({"sequence": "0,90,360", "method": "lsq"}, "direction"),
        ({"sequence": "0,90,180,270"}, "three"),
        ({"latitude_deg": 90.0}, "85 deg"),
        ({"latitude_deg": 89.0}, "85 deg"),
        ({"latitude_deg": 91.0}, "expected -90 to 90 deg"),
        ({"repeat": 33, "method": "gls"}, "64"),
        ({"sequence": "0,ninety,180"}, "angles in degrees"),
        ({"sequence": "0,90,400"}, "within \\+-360"),
        ({"method": "magic"}, "expected closed3"),
        ({"angles": "guess"}, "set, encoder"),
        ({"window_s": 0.0}, "window_s"),
        ({"settle_s": -1.0}, "expected 0 or more"),
        ({"gm_sigma_degph": math.nan}, "expected 0 or more"),
    ],
)
def test_what_cannot_work_is_refused_before_anything_moves(given: dict[str, object], why: str) -> None:
    with pytest.raises(BadInput, match=why):
        params_of("article", given)


def test_a_platform_that_never_settles_is_a_failure() -> None:
    with pytest.raises(LinkError, match="never settles"):
        run(FakePlatform(settles=False))


BROKEN = (
    ({"lost": 3}, "3 frames or readings were lost"),
    ({"level_lost": True}, "level sensors were silent"),
    ({"encoder_fault": True}, "stuck"),
    ({"not_settled": True}, "had not settled"),
    ({"saturated": True}, "at its limit"),
)


@pytest.mark.parametrize(("fault", "words"), BROKEN)
def test_three_positions_of_which_one_is_broken_give_no_heading(fault: dict[str, object], words: str) -> None:
    with pytest.raises(LinkError, match=rf"no heading from 2 of 3 windows: expected three \(position 2 .*{words}"):
        run(FakePlatform(broken={1: fault}), "article")


@pytest.mark.parametrize(("fault", "words"), BROKEN)
def test_of_many_positions_a_broken_one_is_left_out_and_told(fault: dict[str, object], words: str) -> None:
    bad = fault | {"beta_rad": np.full(500, 1e-3)}
    bench = FakePlatform(broken={0: bad, 7: bad})
    r = run(bench)
    assert len(r.rows) == 22
    assert [n for n in r.notes if words in n][1].startswith("position 8 (270 deg) does not count")
    assert abs(heading_error_deg(r, bench)) < EARTH_DEG


def test_a_stuck_encoder_is_found_even_if_the_unit_does_not_say_so() -> None:
    with pytest.raises(LinkError, match=r"the encoder shows 0.00 deg, not 90: it is stuck"):
        run(FakePlatform(stuck_deg=0.0), "article")


def test_a_wrong_latitude_shows_in_the_earth_s_rate_when_it_is_large() -> None:
    """Below half a degree it does not: tan(50 deg) d(lat) reaches the limit of 0.01 at 0.48 deg."""
    far, near = (run(FakePlatform(), latitude_deg=50.0 + off) for off in (1.0, 0.2))
    assert "horizontal Earth rate found is 1.02" in far.doubts[0]
    assert "right at latitude 50.0" in far.doubts[0]
    assert near.doubts == ()
    assert abs(near.get("heading_deg").value - 40.0) < 0.02, "and does not matter much either"


def test_a_drift_that_jumps_in_a_long_run_is_seen() -> None:
    r = run(FakePlatform(drift1_degph=lambda t_s: 25.0 + 5.0 * (t_s > 200.0)))
    assert "the drift jumped" in r.doubts[0]


def test_a_calibration_that_failed_is_told_and_not_used() -> None:
    p = params_of("improved")
    windows = list(g.measure(FakePlatform(), p, Silent()))
    windows[-1] = replace(windows[-1], level_lost=True, u2_radps=windows[-1].u2_radps + 1.0)
    r = g.estimate(windows, p)
    assert r.get("drift2_degph").value == pytest.approx(-12.0, abs=1e-5)
    assert "the calibration does not count" in r.notes[-1]


def test_the_azimuth_axis_has_a_drift_of_its_own() -> None:
    """The article calibrates the levelling axis and compensates the azimuth axis: these two are not the same number."""
    r = run(FakePlatform(drift1_degph=lambda t_s: 25.0, drift2_degph=lambda t_s: 3.0))
    assert r.get("drift1_degph").value == pytest.approx(25.0, abs=1e-6)
    assert r.get("drift2_degph").value == pytest.approx(3.0, abs=1e-5)


def test_a_window_with_the_servo_off_is_corrected_by_the_encoder() -> None:
    """Levelling takes a turn about the vertical for a rate: (3), - alpha' cos(beta) sin(gamma)."""
    gamma, rate = math.radians(5.0), 10.0 * DEGPH
    s = 20.0 * DEGPH
    n = 500
    w = Window(
        number=0,
        set_rad=0.0,
        t_mid_s=0.0,
        beta_rad=np.full(n, -(s - rate * math.sin(gamma))),
        gamma_rad=np.full(n, gamma),
        u1_radps=np.zeros(n),
        u2_radps=np.zeros(n),
        encoder_rad=np.asarray(rate * 0.01 * np.arange(n), dtype=np.float64),
        turned_rad=np.zeros(n),
        missed=0,
        step_s=0.01,
        m1_per_s=1.0,
        latitude_rad=0.87,
    )
    assert s_of(w, slope=False, frozen=True) == pytest.approx(s, rel=1e-9, abs=0.0)
    assert s_of(w, slope=False, frozen=False) == pytest.approx(s - rate * math.sin(gamma), rel=1e-9)


def test_a_window_needs_readings() -> None:
    none = np.zeros(0)
    with pytest.raises(ValueError, match="expected readings"):
        Window(
            number=0, set_rad=0.0, t_mid_s=0.0, beta_rad=none, gamma_rad=none, u1_radps=none, u2_radps=none,
            encoder_rad=none, turned_rad=none, missed=0, step_s=0.01, m1_per_s=1.0, latitude_rad=0.0,
        )  # fmt: skip


def test_readings_differ_in_what_they_say() -> None:
    article, improved = GyrocompassParams(), params_of("improved")
    assert (article.method, article.angles, article.simplified) == ("closed3", "set", True)
    assert (improved.angles, improved.simplified, improved.sequence) == ("encoder", False, "0,180,90,270")
    with pytest.raises(BadInput, match="expected article, improved"):
        params_of("best")
