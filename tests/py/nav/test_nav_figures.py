"""The figures of gyrocompassing and hold (sources instruments 1.5 to 1.8), by both Monte-Carlo models, fixed seeds."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from psabench.native import nav_mc
from psabench.native.nav import ARCMIN, DEGPH, Method, Noise
from psabench.native.nav_mc import AngleSys, Axis2, Cardan, Errors, HoldConfig, McConfig, Tilt

Floats = npt.NDArray[np.float64]
Model = Callable[..., Errors]
CLOSED, SAMPLES = (nav_mc.closed, 100_000), (nav_mc.samples, 6_000)
BOTH = pytest.mark.parametrize(("model", "runs"), [CLOSED, SAMPLES], ids=["closed", "samples"])

HONEST = McConfig()  # the article's errors as printed, with the Gauss-Markov drift that it writes down
ARTICLE = replace(HONEST, gm_sigma_radps=0.02 * DEGPH, gm_from_zero=True, angle_sys=AngleSys.NONE)
AVERAGED = replace(ARTICLE, per_sample=True)
ENCODER = replace(HONEST, angle_sys=AngleSys.NONE, angle_random_rad=0.5 * ARCMIN, simplified=False)
BELIEF = Noise(gm_sigma_radps=0.2 * DEGPH, angle_sd_rad=0.5 * ARCMIN, level_sd_rad=1.0 * ARCMIN)


def p95(x: Floats) -> float:
    return float(np.quantile(np.abs(x), 0.95))


def rms(x: Floats) -> float:
    return float(np.sqrt(np.mean(np.square(x))))


def heading(e: Errors) -> Floats:
    return np.degrees(e.heading_rad)


def of_platform(e: Errors) -> Floats:
    return np.degrees(e.platform_rad)


def drift(e: Errors) -> Floats:
    return e.drift_radps / DEGPH


def turns(*degrees: float, times: int = 1) -> tuple[float, ...]:
    return tuple(np.radians(degrees * times))


# ---- the readings of the article's errors ----


@BOTH
def test_article_mode_holds_what_the_article_says(model: Model, runs: int) -> None:
    e = model(ARTICLE, 2, runs=runs)
    assert p95(heading(e)) <= 0.10
    assert np.mean(np.abs(heading(e)) <= 0.1) >= 0.945
    assert p95(drift(e)) <= 0.05


@BOTH
def test_errors_that_average_are_far_below_a_tenth(model: Model, runs: int) -> None:
    e = model(AVERAGED, 3, runs=runs)
    assert p95(of_platform(e)) <= 0.04
    assert np.abs(of_platform(e)).max() <= 0.11
    counted = model(replace(AVERAGED, angle_sys=AngleSys.COMMON, random_sign=False), 3, runs=runs)
    assert np.mean(heading(counted)) == pytest.approx(0.100, abs=0.002)
    assert p95(of_platform(counted)) <= 0.04


@BOTH
def test_honest_mode_is_a_sixth_of_a_degree(model: Model, runs: int) -> None:
    e = model(HONEST, 4, runs=runs)
    assert np.std(of_platform(e)) == pytest.approx(0.163, abs=0.008)
    assert p95(of_platform(e)) == pytest.approx(0.32, abs=0.02)
    assert rms(drift(e)) == pytest.approx(0.20, abs=0.01)
    assert np.mean(np.abs(heading(e)) <= 0.1) == pytest.approx(0.40, abs=0.03)


# sd of the platform, sd of the heading about 0, rms of drift; a random sign makes 6' part of the second
READINGS: dict[str, tuple[McConfig, float, float, float]] = {
    "literal": (HONEST, 0.163, 0.188, 0.202),
    "6' not counted": (replace(HONEST, angle_sys=AngleSys.NONE), 0.163, 0.159, 0.202),
    "6' on increments": (replace(HONEST, angle_sys=AngleSys.INCREMENT), 0.181, 0.177, 0.202),
    "6' accumulating": (replace(HONEST, angle_sys=AngleSys.ACCUMULATES), 0.194, 0.191, 0.202),
    "no random drift": (replace(HONEST, gm_sigma_radps=0.0), 0.057, 0.109, 0.034),
    "drift of 0.02": (replace(HONEST, gm_sigma_radps=0.02 * DEGPH, gm_from_zero=True), 0.059, 0.111, 0.034),
    "from zero": (replace(HONEST, gm_from_zero=True), 0.161, 0.187, 0.047),
    "back to back": (replace(HONEST, gap_s=0.0), 0.113, 0.146, 0.203),
    "gimbal steps": (replace(ARTICLE, cardan=Cardan.UNCORRECTED), 0.095, 0.088, 0.034),
}


@pytest.mark.parametrize("name", READINGS)
def test_each_reading_has_its_figures(name: str) -> None:
    cfg, platform_deg, heading_deg, drift_degph = READINGS[name]
    e = nav_mc.closed(cfg, 5, runs=100_000)
    assert np.std(of_platform(e)) == pytest.approx(platform_deg, rel=0.03)
    assert rms(heading(e)) == pytest.approx(heading_deg, rel=0.03)
    assert rms(drift(e)) == pytest.approx(drift_degph, rel=0.04)


NOTHING = replace(
    HONEST,
    gm_sigma_radps=0.0,
    latitude_error_rad=0.0,
    beta_sys_rad=0.0,
    gamma_sys_rad=0.0,
    beta_random_rad=0.0,
    gamma_random_rad=0.0,
    angle_sys=AngleSys.NONE,
    angle_random_rad=0.0,
    simplified=False,
)
SOURCES: dict[str, tuple[McConfig, float]] = {  # one at a time, standard deviation of the platform
    "drift": (replace(NOTHING, gm_sigma_radps=0.2 * DEGPH), 0.153),
    "drift, back to back": (replace(NOTHING, gm_sigma_radps=0.2 * DEGPH, gap_s=0.0), 0.097),
    "gimbals": (replace(NOTHING, cardan=Cardan.UNCORRECTED), 0.074),
    "angle, random 3'": (replace(NOTHING, angle_random_rad=3 * ARCMIN), 0.053),
    "6' on increments": (replace(NOTHING, angle_sys=AngleSys.INCREMENT), 0.079),
    "6' a step": (replace(NOTHING, angle_sys=AngleSys.ACCUMULATES), 0.107),
    "6' common": (replace(NOTHING, angle_sys=AngleSys.COMMON), 0.0),
    "gamma and beta, random 1'": (replace(NOTHING, gamma_random_rad=ARCMIN, beta_random_rad=ARCMIN), 0.020),
    "gamma, 10'": (replace(NOTHING, gamma_sys_rad=10 * ARCMIN), 0.006),
    "beta, 10'": (replace(NOTHING, beta_sys_rad=10 * ARCMIN), 0.006),
    "latitude, 0.1'": (replace(NOTHING, latitude_error_rad=0.1 * ARCMIN), 0.0001),
    "nothing": (NOTHING, 0.0),
}


@BOTH
@pytest.mark.parametrize("name", SOURCES)
def test_each_source_alone_has_its_share(name: str, model: Model, runs: int) -> None:
    cfg, want = SOURCES[name]
    sd = float(np.std(of_platform(model(cfg, 15, runs=runs))))
    assert sd == pytest.approx(want, rel=0.04, abs=0.0005 if want < 0.01 else 0.0)


def test_a_single_run_from_zero_proves_little() -> None:
    """The article shows one run: both of its figures come out together in a third of all runs with a proper drift."""
    e = nav_mc.closed(replace(HONEST, gm_from_zero=True, angle_sys=AngleSys.NONE), 6, runs=100_000)
    both = np.mean((np.abs(heading(e)) <= 0.1) & (np.abs(drift(e)) <= 0.05))
    assert both == pytest.approx(0.34, abs=0.05)


def test_a_scale_error_of_the_torquer_is_an_error_of_the_drift_alone() -> None:
    quiet = replace(
        ARTICLE,
        gm_sigma_radps=0.0,
        gamma_sys_rad=0.0,
        beta_sys_rad=0.0,
        gamma_random_rad=0.0,
        beta_random_rad=0.0,
        angle_random_rad=0.0,
        torquer_scale=1e-3,
        tilt_rad=0.0,
    )
    for model, runs in (CLOSED, SAMPLES):
        e = model(quiet, 7, runs=runs)
        assert np.abs(heading(e)).max() < 1e-3
        assert np.mean(drift(e)) == pytest.approx(-0.025, abs=0.001)


# ---- step, latitude, tilt, dwell, order ----

STEPS_DEG = (30, 45, 60, 75, 90, 105, 120, 135, 150)
EXACT = (0.857, 0.411, 0.259, 0.194, 0.163, 0.152, 0.156, 0.178, 0.237)
SMALL = (0.323, 0.153, 0.096, 0.071, 0.059, 0.053, 0.051, 0.052, 0.058)
WHITE = (1.960, 0.911, 0.547, 0.382, 0.298, 0.256, 0.242, 0.257, 0.325)
WHITE_ON_CIRCLE = (1.088, 0.609, 0.425, 0.329, 0.278, 0.251, 0.242, None, None)

ONLY_WHITE = replace(
    ARTICLE,
    gm_sigma_radps=0.0,
    gamma_sys_rad=0.0,
    beta_sys_rad=0.0,
    gamma_random_rad=0.0,
    beta_random_rad=0.0,
    angle_random_rad=0.0,
    white_radps_rts=0.05 * DEGPH * math.sqrt(10),
)


def spread_by_step(cfg: McConfig) -> list[float]:
    sd = []
    for step in STEPS_DEG:
        e = nav_mc.closed(replace(cfg, angles_rad=turns(0, step, 2 * step)), 8, runs=100_000)
        sd.append(float(np.std(of_platform(e))))
    return sd


@pytest.mark.parametrize(
    ("cfg", "want"),
    [
        (HONEST, EXACT),
        (replace(HONEST, gm_sigma_radps=0.02 * DEGPH), SMALL),
        (ONLY_WHITE, WHITE),
        (replace(ONLY_WHITE, method=Method.CONSTRAINED), WHITE_ON_CIRCLE),
    ],
    ids=["exact drift", "drift of 0.02", "white", "white, on the circle"],
)
def test_the_best_step_is_beyond_ninety_degrees(cfg: McConfig, want: tuple[float | None, ...]) -> None:
    sd = spread_by_step(cfg)
    for step, got, told in zip(STEPS_DEG, sd, want, strict=True):
        if told is not None:
            assert got == pytest.approx(told, rel=0.04), step
    assert sd[0] > sd[1] > sd[2] > sd[3] > sd[4]  # 30 > 45 > 60 > 75 > 90
    assert STEPS_DEG[int(np.argmin(sd))] in (105, 120)
    if cfg.method is not Method.CONSTRAINED:
        assert sd[0] > 5 * sd[4]


@pytest.mark.parametrize(
    ("latitude_deg", "exact", "small"),
    [
        (0, 0.112, 0.055),
        (30, 0.126, 0.056),
        (45, 0.150, 0.058),
        (50, 0.163, 0.059),
        (60, 0.206, 0.064),
        (70, 0.296, 0.076),
        (80, 0.576, 0.122),
    ],
)
def test_errors_grow_with_latitude(latitude_deg: float, exact: float, small: float) -> None:
    there = replace(HONEST, latitude_rad=math.radians(latitude_deg))
    for cfg, want in ((there, exact), (replace(there, gm_sigma_radps=0.02 * DEGPH), small)):
        assert np.std(of_platform(nav_mc.closed(cfg, 9, runs=100_000))) == pytest.approx(want, rel=0.03)
    few = nav_mc.samples(there, 9, runs=3000)
    assert np.std(of_platform(few)) == pytest.approx(exact, rel=0.06)


@pytest.mark.parametrize(
    ("tilt_deg", "cardan", "want"),
    [
        (0, Cardan.ALPHA, 0.0586),
        (5, Cardan.ALPHA, 0.0606),
        (2, Cardan.UNCORRECTED, 0.066),
        (5, Cardan.UNCORRECTED, 0.197),
        (10, Cardan.UNCORRECTED, 0.756),
        (5, Cardan.CORRECTED, 0.0604),
    ],
)
def test_tilts_hurt_through_the_gimbals_unless_corrected(tilt_deg: float, cardan: Cardan, want: float) -> None:
    cfg = replace(
        HONEST, gm_sigma_radps=0.02 * DEGPH, tilt=Tilt.CORNERS, tilt_rad=math.radians(tilt_deg), cardan=cardan
    )
    few = nav_mc.samples(cfg, 10, runs=6000)
    assert np.std(of_platform(few)) == pytest.approx(want, rel=0.05)
    if cardan is not Cardan.CORRECTED:
        assert np.std(of_platform(nav_mc.closed(cfg, 10, runs=100_000))) == pytest.approx(want, rel=0.03)


def test_longer_windows_make_a_wandering_drift_worse() -> None:
    """10 s between windows; those below 10 s are reported with gaps that no one noted, so only their order is held."""
    sd = {}
    for seconds in (2, 5, 10, 30, 60, 120):
        e = nav_mc.closed(replace(ENCODER, window_s=float(seconds)), 11, runs=100_000)
        sd[seconds] = float(np.std(of_platform(e)))
    assert list(sd.values()) == sorted(sd.values())
    for seconds, want in {10: 0.154, 30: 0.204, 60: 0.259, 120: 0.340}.items():
        assert sd[seconds] == pytest.approx(want, rel=0.03), seconds


ORDERS: dict[str, tuple[tuple[float, ...], float]] = {
    "turning on": (turns(0, 90, 180, 270), 0.159),
    "back and forth": (turns(0, 180, 90, 270), 0.108),
    "back and forth, four times": (turns(0, 180, 90, 270, times=4), 0.055),
    "palindrome": (turns(0, 180, 180, 0, 90, 270, 270, 90), 0.079),
    "six, turning on": (turns(*range(0, 360, 60)), 0.188),
    "eight, turning on": (turns(*range(0, 360, 45)), 0.212),
}


@pytest.mark.parametrize("name", ORDERS)
def test_the_order_matters_more_than_the_number(name: str) -> None:
    angles, want = ORDERS[name]
    e = nav_mc.closed(replace(ENCODER, angles_rad=angles, method=Method.LSQ), 12, runs=100_000)
    assert np.std(of_platform(e)) == pytest.approx(want, rel=0.03)


@BOTH
def test_improved_mode_reaches_a_tenth_in_four_minutes(model: Model, runs: int) -> None:
    six = replace(
        ENCODER, angles_rad=turns(0, 180, 90, 270, times=6), window_s=5.0, gap_s=5.0, method=Method.LSQ, sample_s=0.02
    )
    e = model(six, 13, runs=min(runs, 20_000))
    assert p95(of_platform(e)) <= 0.07
    slow = replace(
        ENCODER,
        angles_rad=turns(0, 120, 240, 120, times=4),
        window_s=5.0,
        slew_radps=math.radians(30.0),
        settle_s=7.0,
        method=Method.GLS_CONSTRAINED,
        noise=BELIEF,
        sample_s=0.02,
    )
    e = model(slow, 13, runs=min(runs, 20_000))
    assert p95(of_platform(e)) <= 0.10


# ---- hold, four hours ----

SUM = HoldConfig(
    start=replace(HONEST, gm_sigma_radps=0.0),
    axis2=Axis2.FIXED,
    heading_rad=math.radians(0.1),
    drift_error_radps=0.05 * DEGPH,
)
IN_FLIGHT = HoldConfig(start=AVERAGED)


def held(cfg: HoldConfig) -> tuple[Floats, Floats]:
    e = nav_mc.hold(cfg, 14, runs=20_000)
    return np.degrees(e.end_rad), np.degrees(e.max_rad)


def test_the_printed_three_tenths_are_a_sum() -> None:
    end, most = held(SUM)
    assert np.abs(end).max() == pytest.approx(0.300, abs=0.001)
    assert np.abs(end).min() == pytest.approx(0.300, abs=0.001)
    assert most.max() == pytest.approx(0.300, abs=0.001)


def test_article_mode_holds_three_tenths() -> None:
    _, most = held(HoldConfig(start=ARTICLE))
    assert np.mean(most <= 0.3) >= 0.99


def test_honest_mode_does_not() -> None:
    """The second with the systematic 6' left out, as the heading's; with them 0.38."""
    end, most = held(HoldConfig(start=HONEST))
    assert np.std(end) == pytest.approx(0.81, abs=0.04)
    assert np.mean(most <= 0.5) == pytest.approx(0.43, abs=0.03)
    end, _ = held(HoldConfig(start=replace(HONEST, gm_from_zero=True, angle_sys=AngleSys.NONE)))
    assert np.std(end) == pytest.approx(0.36, abs=0.02)


@pytest.mark.parametrize(
    ("cfg", "end_p95", "p03"),
    [
        (replace(SUM, start=replace(HONEST, gm_from_zero=True)), 0.749, 0.38),
        (HoldConfig(start=replace(ARTICLE, angle_sys=AngleSys.COMMON)), 0.308, 0.938),
        (replace(IN_FLIGHT, latitude_error_rad=10 * ARCMIN), 0.288, 0.970),
        (replace(IN_FLIGHT, v_east_mps=500 / 3.6, speed_error=0.01), 0.389, 0.54),
        (replace(IN_FLIGHT, axis2=Axis2.DIFFERS, axis2_sd_radps=1.0 * DEGPH), 7.8, 0.06),
    ],
    ids=["sum and drift", "6' counted", "latitude", "ground speed", "other axis"],
)
def test_what_a_hold_suffers_from(cfg: HoldConfig, end_p95: float, p03: float) -> None:
    end, most = held(cfg)
    assert p95(end) == pytest.approx(end_p95, rel=0.03)
    assert np.mean(most <= 0.3) == pytest.approx(p03, abs=0.02)


def test_the_azimuth_axis_wants_its_own_calibration() -> None:
    """Measured on its torquer it holds; the level sensors' 10' leave We 10' (|cos|, |sin| of alpha) of drift."""
    same = held(IN_FLIGHT)[1]
    differs = held(replace(IN_FLIGHT, axis2=Axis2.DIFFERS, axis2_sd_radps=0.1 * DEGPH))[1]
    measured = held(replace(IN_FLIGHT, axis2=Axis2.MEASURED))[1]
    assert np.mean(same <= 0.3) > 0.99
    assert np.mean(differs <= 0.3) < 0.6
    assert np.mean(measured <= 0.3) > 0.99
