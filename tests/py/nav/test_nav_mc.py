"""The Monte-Carlo models of the gyrocompass library: one beside the other, beside NumPy, and from Python."""

from __future__ import annotations

import ctypes as c
import math
from dataclasses import replace

import numpy as np
import pytest
from psabench.native import nav, nav_mc
from psabench.native.nav import ARCMIN, DEGPH, Method, Noise
from psabench.native.nav_mc import McConfig
from psabench.native.navlib import McHoldStruct, McStruct, library
from scipy import stats

from tests.bench import numpy_gyrocompass


def same_struct(a: c.Structure, b: c.Structure) -> None:
    for name, *_ in a._fields_:
        x, y = getattr(a, name), getattr(b, name)
        if isinstance(x, c.Structure):
            same_struct(x, y)
        elif isinstance(x, c.Array):
            assert list(x) == pytest.approx(list(y), abs=1e-15), name
        else:
            assert x == pytest.approx(y, rel=1e-14, abs=0.0, nan_ok=True), name


def test_the_defaults_of_python_are_those_of_the_library() -> None:
    default = McStruct()
    library().mc_default(c.byref(default))
    same_struct(nav_mc.config_struct(McConfig()), default)
    hold = McHoldStruct()
    library().mc_hold_default(c.byref(hold))
    same_struct(nav_mc.hold_struct(nav_mc.HoldConfig()), hold)


@pytest.mark.parametrize("model", [nav_mc.closed, nav_mc.samples])
def test_threads_and_batches_change_no_number(model: object) -> None:
    assert callable(model)
    whole = model(McConfig(), 3, runs=1001)
    split = model(McConfig(), 3, runs=1001, threads=3)
    tail = model(McConfig(), 3, first_run=777, runs=224)
    assert np.array_equal(whole.heading_rad, split.heading_rad)
    assert np.array_equal(whole.drift_radps[777:], tail.drift_radps)


def test_results_go_into_arrays_that_exist() -> None:
    first = nav_mc.closed(McConfig(), 3, runs=100)
    heading = first.heading_rad.copy()
    again = nav_mc.closed(McConfig(), 3, first_run=100, runs=100, into=first)
    assert again.heading_rad is first.heading_rad
    assert not np.array_equal(heading, again.heading_rad)
    with pytest.raises(ValueError, match="expected arrays of 50"):
        nav_mc.closed(McConfig(), 3, runs=50, into=first)


R0 = McConfig()
TURNED = tuple(np.radians([0.0, 180.0, 90.0, 270.0] * 2))
BELIEF = Noise(gm_sigma_radps=0.2 * DEGPH, angle_sd_rad=0.5 * ARCMIN)
AGREE = {
    "article": R0,
    "no drift": replace(R0, gm_sigma_radps=0.0, simplified=False),
    "from zero, no sign": replace(R0, gm_from_zero=True, random_sign=False),
    "zero 300 s before": replace(R0, gm_from_zero=True, gm_before_s=300.0),
    "increments": replace(R0, angle_sys=nav_mc.AngleSys.INCREMENT),
    "accumulating": replace(R0, angle_sys=nav_mc.AngleSys.ACCUMULATES),
    "per sample": replace(R0, gm_sigma_radps=0.02 * DEGPH, per_sample=True),
    "gimbal uncorrected": replace(R0, gm_sigma_radps=0.02 * DEGPH, cardan=nav_mc.Cardan.UNCORRECTED),
    "gimbal corrected": replace(R0, gm_sigma_radps=0.02 * DEGPH, cardan=nav_mc.Cardan.CORRECTED),
    "corners, scale": replace(R0, tilt=nav_mc.Tilt.CORNERS, torquer_scale=1e-3),
    "level sensors alone": replace(
        R0, gm_sigma_radps=0.0, angle_sys=nav_mc.AngleSys.NONE, angle_random_rad=0.0, gamma_random_rad=0.0,
        beta_random_rad=0.0, gamma_sys_rad=5 * ARCMIN, angles_rad=tuple(np.radians([0.0, 50.0, 130.0])),
    ),
    "fast drift": replace(R0, gm_tau_s=25.0, gap_s=7.0, window_s=3.33),
    "latitude off 60'": replace(R0, gm_sigma_radps=0.02 * DEGPH, latitude_error_rad=60 * ARCMIN),
    "latitude off 600'": replace(R0, gm_sigma_radps=0.02 * DEGPH, latitude_error_rad=600 * ARCMIN),
    "latitude off -600', no sign": replace(R0, latitude_error_rad=-600 * ARCMIN, random_sign=False),
    "torquer 0.2, level sensors 300'": replace(
        R0, torquer_scale=0.2, gamma_sys_rad=300 * ARCMIN, beta_sys_rad=300 * ARCMIN
    ),
    "torquer -0.2, white": replace(R0, torquer_scale=-0.2, white_radps_rts=0.15 * DEGPH, gamma_random_rad=20 * ARCMIN),
    "constrained, latitude off 60', torquer 0.02": replace(
        R0, method=Method.CONSTRAINED, latitude_error_rad=60 * ARCMIN, torquer_scale=0.02
    ),
    "drift shorter than a sample of ours, from zero": replace(
        R0, gm_sigma_radps=5 * DEGPH, gm_tau_s=0.005, gm_from_zero=True, sample_s=0.001
    ),
    "white, constrained": replace(
        R0, white_radps_rts=0.15 * DEGPH, method=Method.CONSTRAINED, latitude_error_rad=10 * ARCMIN
    ),
    "eight, weighted": replace(
        R0, angles_rad=TURNED, method=Method.GLS, noise=BELIEF, angle_random_rad=0.5 * ARCMIN, simplified=False
    ),
    "eight, weighted, circle, ramp": replace(
        R0, angles_rad=TURNED, method=Method.GLS_CONSTRAINED, noise=BELIEF, ramp=True, slew_radps=0.5, settle_s=7.0
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", AGREE)
def test_the_closed_form_and_the_samples_agree(name: str) -> None:
    """Kolmogorov and Smirnov on headings, platform errors, drifts and quality, fixed seeds."""
    many = nav_mc.closed(AGREE[name], 11, runs=200_000)
    few = nav_mc.samples(AGREE[name], 12, runs=3000)
    for field in ("heading_rad", "platform_rad", "drift_radps", "quality", "alpha1_rad"):
        p = stats.ks_2samp(getattr(few, field), getattr(many, field)).pvalue
        assert p > 0.001, f"{field}: p = {p:.2g}"


@pytest.mark.parametrize("name", [n for n in AGREE if n not in ("gimbal corrected", "from zero, no sign")])
def test_a_hold_begins_with_the_errors_of_the_closed_form(name: str) -> None:
    """Of its own draws; the heading after a moment is that of the gyrocompassing, with all its errors."""
    many = nav_mc.closed(AGREE[name], 11, runs=200_000)
    begun = nav_mc.hold(nav_mc.HoldConfig(start=AGREE[name], hours=1e-9, wait_s=0.0), 13, runs=3000)
    assert stats.ks_2samp(begun.end_rad, many.heading_rad).pvalue > 0.001


def test_numpys_version_of_the_model_has_the_same_distribution() -> None:
    """tests/bench/numpy_gyrocompass.py, written from the equations: what the library is timed beside."""
    rng = np.random.default_rng(1)
    batches = [numpy_gyrocompass.batch(R0, 1000, rng) for _ in range(4)]
    for model, runs in ((nav_mc.closed, 200_000), (nav_mc.samples, 8000)):
        ours = model(R0, 13, runs=runs)
        for field in ("heading_rad", "platform_rad", "drift_radps"):
            theirs = np.concatenate([getattr(b, field) for b in batches])
            assert stats.ks_2samp(theirs, getattr(ours, field)).pvalue > 0.001, field


def test_random_numbers_are_gaussian_far_into_the_tails() -> None:
    """White noise alone makes the drift's error a sum of Gaussian numbers."""
    cfg = replace(R0, gm_sigma_radps=0.0, gamma_sys_rad=0.0, beta_sys_rad=0.0, gamma_random_rad=0.0,
                  angle_random_rad=0.0, angle_sys=nav_mc.AngleSys.NONE, simplified=False,
                  white_radps_rts=1e-6, latitude_error_rad=0.0, tilt_rad=0.0)  # fmt: skip
    drift = nav_mc.closed(cfg, 1, runs=4_000_000).drift_radps
    z = drift / (1e-6 / math.sqrt(10) / math.sqrt(2))
    assert np.mean(z) == pytest.approx(0.0, abs=0.003)
    assert np.std(z) == pytest.approx(1.0, abs=0.002)
    for limit in (1, 2, 3, 4, 5):
        want = 2 * stats.norm.sf(limit) * len(z)
        assert abs(np.sum(np.abs(z) > limit) - want) < 5 * math.sqrt(want) + 3
    assert abs(np.corrcoef(z[:-1], z[1:])[0, 1]) < 0.003


BAD: dict[str, tuple[McConfig, str, nav.Status]] = {
    "window_s is 0; want a length above 0 s": (replace(R0, window_s=0.0), "window_s", nav.Status.RANGE),
    "window_s is -1": (replace(R0, window_s=-1.0), "window_s", nav.Status.RANGE),
    "gm_tau_s is 0": (replace(R0, gm_tau_s=0.0), "gm_tau_s", nav.Status.RANGE),
    "gm_sigma_radps is -1": (replace(R0, gm_sigma_radps=-1.0), "gm_sigma_radps", nav.Status.RANGE),
    "white_radps_rts is nan": (replace(R0, white_radps_rts=math.nan), "white_radps_rts", nav.Status.NOT_FINITE),
    "angle_rad of position 3 is inf": (
        replace(R0, angles_rad=(0.0, 1.0, math.inf)),
        "angle_rad",
        nav.Status.NOT_FINITE,
    ),
    "alpha1_rad is inf": (replace(R0, alpha1_rad=math.inf), "alpha1_rad", nav.Status.NOT_FINITE),
    "sample_s is 20; want 1 to 1e7 samples": (replace(R0, sample_s=20.0), "sample_s", nav.Status.RANGE),
    "count is 2; want 3 positions": (replace(R0, angles_rad=(0.0, 1.0)), "count", nav.Status.TOO_FEW),
    "latitude_rad is 1.5.* want at most 85 deg": (replace(R0, latitude_rad=1.5), "latitude_rad", nav.Status.LATITUDE),
    "noise.angle_sd_rad is -1": (replace(R0, noise=Noise(angle_sd_rad=-1.0)), "noise.angle_sd_rad", nav.Status.RANGE),
}


@pytest.mark.parametrize("words", BAD)
def test_a_refusal_names_the_field_its_value_and_what_would_be_right(words: str) -> None:
    cfg, field, status = BAD[words]
    for model in (nav_mc.closed, nav_mc.samples):
        with pytest.raises(nav.Refused, match=words) as refused:
            model(cfg, 1, runs=1)
        assert (refused.value.field, refused.value.status) == (field, status)
    with pytest.raises(nav.Refused, match=words):
        nav_mc.hold(nav_mc.HoldConfig(start=cfg), 1, runs=1)


LIMITS: dict[str, McConfig] = {
    "latitude_error_rad": replace(R0, latitude_error_rad=math.radians(10.1)),
    "torquer_scale": replace(R0, torquer_scale=0.21),
    "gamma_sys_rad": replace(R0, gamma_sys_rad=math.radians(5.1)),
    "beta_sys_rad": replace(R0, beta_sys_rad=math.radians(-5.1)),
}
ON_CIRCLE: dict[str, McConfig] = {
    "latitude_error_rad": replace(R0, method=Method.CONSTRAINED, latitude_error_rad=math.radians(3)),
    "torquer_scale": replace(R0, method=Method.GLS_CONSTRAINED, torquer_scale=-0.06),
}


@pytest.mark.parametrize(("field", "cfg"), [*LIMITS.items(), *ON_CIRCLE.items()])
def test_what_is_beyond_first_order_is_refused_by_the_closed_form_alone(field: str, cfg: McConfig) -> None:
    nav_mc.samples(cfg, 1, runs=1)
    with pytest.raises(nav.Refused, match=f"{field} is .*in first order"):
        nav_mc.hold(nav_mc.HoldConfig(start=cfg), 1, runs=1)
    with pytest.raises(nav.Refused, match=f"{field} is .*in first order") as refused:
        nav_mc.closed(cfg, 1, runs=1)
    assert (refused.value.field, refused.value.status) == (field, nav.Status.RANGE)


def test_either_sign_of_the_latitudes_error_stays_below_85_degrees() -> None:
    high = replace(R0, latitude_rad=math.radians(-80), latitude_error_rad=math.radians(6))
    for model in (nav_mc.closed, nav_mc.samples):
        with pytest.raises(nav.Refused, match=r"latitude_rad is -1\.5.* want at most 85 deg"):
            model(high, 1, runs=1)
        model(replace(high, random_sign=False), 1, runs=1)


def test_a_hold_names_its_fields_too() -> None:
    for bad, field in ((nav_mc.HoldConfig(step_s=0.0), "step_s"), (nav_mc.HoldConfig(hours=-1.0), "hours"),
                       (nav_mc.HoldConfig(v_east_mps=math.nan), "v_east_mps")):  # fmt: skip
        with pytest.raises(nav.Refused, match=f"{field} is") as refused:
            nav_mc.hold(bad, 1, runs=1)
        assert refused.value.field == field


def test_monte_carlo_refuses_in_words() -> None:
    with pytest.raises(nav.Refused, match="too few"):
        nav_mc.closed(replace(R0, angles_rad=(0.0, 1.0)), 1, runs=1)
    with pytest.raises(nav.Refused, match="coincide"):
        nav_mc.samples(replace(R0, angles_rad=(0.0, math.pi, 0.0)), 1, runs=1)
    with pytest.raises(ValueError, match="64 positions at most"):
        nav_mc.closed(replace(R0, angles_rad=tuple(range(65))), 1, runs=1)
    with pytest.raises(ValueError, match="expected 0 or more, got -1"):
        nav_mc.closed(R0, -1, runs=1)
