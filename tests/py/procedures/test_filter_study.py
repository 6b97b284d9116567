"""The study of PSA-2's filter: its predictions against other ways to compute them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from psabench.boards.psa2 import converter_filter
from psabench.estimate import allan
from psabench.link.signals import Floats
from psabench.procedures import filter_study as fs

RATIOS = (8, 32, 128)


@pytest.mark.parametrize("phase", fs.PHASES)
@pytest.mark.parametrize("ratio", RATIOS)
def test_gain_at_the_modulators_rate_is_that_of_its_impulse_response(ratio: int, phase: str) -> None:
    """Below half the blocks' rate the chain of held blocks has the same response but for the hold."""
    for f in (0.0, 0.1, 0.375, 0.41, 0.45, 3.3, 15.9):
        want = abs(converter_filter.response(ratio, phase, f))
        if f:
            want /= converter_filter.hold(ratio, f)
        assert converter_filter.at_modulator(ratio, phase, f) == pytest.approx(want, abs=1e-12)


def test_gain_repeats_itself_at_each_multiple_of_the_modulators_clock() -> None:
    for setting in (fs.Setting(), fs.Setting(rate_hz=4000, phase="linear")):
        for k in (1, 2, 7):
            for f in (40.0, 0.413 * setting.rate_hz):
                want = pytest.approx(fs.converter_gain(setting, f), rel=1e-6)
                assert fs.converter_gain(setting, k * fs.MOD_HZ + f) == want
                assert fs.converter_gain(setting, k * fs.MOD_HZ - f) == want
        corner = {"linear": 0.4129, "minimum": 0.4136}[setting.phase]  # docs/chips/ads1282.md
        assert fs.converter_gain(setting, corner * setting.rate_hz) == pytest.approx(0.5**0.5, rel=3e-3)
        assert fs.converter_gain(setting, 32.3 * setting.rate_hz) < 1e-6


def test_folding() -> None:
    assert fs.folded_hz(50.0, 1000) == 50.0
    assert fs.folded_hz(950.0, 1000) == 50.0
    assert fs.folded_hz(1_023_960.0, 4000) == 40.0
    assert fs.folded_hz(2_048_050.0, 250) == 50.0


def test_settings_are_the_registers_of_the_datasheet() -> None:
    assert (fs.Setting().config0, fs.Setting().config1) == (0x56, 0x09)  # article: 56h
    assert (fs.Setting(rate_hz=4000, phase="linear").config0, fs.Setting(gain=64).config1) == (0x62, 0x0E)
    assert fs.Setting().noise_v == pytest.approx(4.5e-6, rel=0.01)  # docs/boards/psa2.md
    assert fs.Setting(rate_hz=250).density_v_rthz == pytest.approx(fs.Setting(rate_hz=4000).density_v_rthz, rel=0.01)


def test_allan_deviation_of_known_processes() -> None:
    rng = np.random.default_rng(1)
    dt_s, n = 0.01, 400_000
    white = np.asarray(rng.normal(0.0, 2.0, n), np.float64)
    density = 2.0 / math.sqrt(0.5 / dt_s)
    walk: Floats = np.cumsum(rng.normal(0.0, 0.3 * math.sqrt(dt_s), n))
    t_s = dt_s * np.arange(n, dtype=np.float64)
    sine = np.asarray(0.7 * np.sin(2.0 * np.pi * 0.31 * t_s), np.float64)
    for tau_s in (0.1, 1.0, 10.0):
        assert allan.allan_deviation(white, dt_s, tau_s) == pytest.approx(allan.of_white(density, tau_s), rel=0.1)
        assert allan.allan_deviation(walk, dt_s, tau_s) == pytest.approx(allan.of_walk(0.3, tau_s), rel=0.2)
        assert allan.allan_deviation(sine, dt_s, tau_s) == pytest.approx(allan.of_sine(0.7, 0.31, tau_s), rel=1e-2)
    ramp = np.asarray(3e-4 * t_s, np.float64)
    assert allan.allan_deviation(ramp, dt_s, 5.0) == pytest.approx(3e-4 * 5.0 / math.sqrt(2.0), rel=1e-6)
    with pytest.raises(ValueError, match=r"tau_s: expected 0\.01 to 0\.05 s, got 0\.06"):
        allan.allan_deviation(white[:10], dt_s, 0.06)


def test_amplitude_of_a_sine_beside_a_slope() -> None:
    t_s = np.arange(1000) / 1000.0
    u_v = 3.0 + 0.2 * t_s + 1e-3 * np.sin(2.0 * np.pi * 40.0 * t_s + 0.7)
    assert fs.amplitude_at(u_v, 40.0, 1000.0) == pytest.approx(1e-3, rel=1e-6)
