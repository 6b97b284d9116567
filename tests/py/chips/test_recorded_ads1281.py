"""Bits of a real ADS1281's modulator through the model's filters, and beside the model's own (E5; docs/evidence.md).

Thirteen captures of M0 and M1, both inverted, at +-10 V and less of that board's front end, one after the other. They
are short: 5001 clocks settle the sinc, not the FIR filter behind it, so that the FIR is judged on the joined captures
by exact arithmetic, everything else capture by capture.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from chip_bench import Ads1282
from numpy.typing import NDArray
from psabench.boards.psa2 import converter_filter as reference
from recordings import recorded_file
from scipy.signal import fftconvolve

Floats = NDArray[np.float64]
Levels = NDArray[np.uint8]  # M0, M1 by row

BITS_SHA256 = "e298d66e180694668def9dcc4b6831dc52d6997823f9a78fbd3c860e031b32ff"
WORDS_SHA256 = "23d42ab90c73190761def2873576337e48f9558fba026025a91197cdcd499d02"
CAPTURES_V = (10, 9, 7, 5, 2, 1, 0, -1, -2, -5, -7, -9, -10)  # nominal
CLOCKS = [4001 if v == 0 else 5001 for v in CAPTURES_V]
OTHER_SOURCE_V = (9, 1, -1, -9)  # 1.3 % high and quieter: another source
FULL_SCALE_OF_BITS = 0.8  # 90 % ones
RATIO = {0: 128, 1: 64, 2: 32, 3: 16, 4: 8}  # sinc ratio by DR


@pytest.fixture(scope="module")
def bits() -> Levels:
    """All captures, as the chip's pins had them."""
    text = recorded_file("ads1281/testbench_input.csv", BITS_SHA256)
    levels = 1 - np.loadtxt(text, delimiter=",", dtype=np.uint8)
    assert len(levels) == sum(CLOCKS)
    return levels


def captures(bits: Levels) -> Iterator[tuple[int, Levels]]:
    """Nominal volts and bits of each."""
    yield from zip(CAPTURES_V, np.split(bits, np.cumsum(CLOCKS)[:-1]), strict=True)


def decoded(levels: Levels) -> Floats:
    """y[n], n = 4 ..., by the formula of the data sheet."""
    m0, m1 = 2.0 * levels.T - 1.0
    n = np.arange(4, len(m0))
    y: Floats = 3 * m0[n - 2] - 6 * m0[n - 3] + 4 * m0[n - 4] + 9 * (m1[n] - 2 * m1[n - 1] + m1[n - 2])
    return y


def played(levels: Levels, config0: int) -> Floats:
    """Words that the chip makes of them, as fractions of full scale. Those of the sinc are right-justified, those of
    the FIR have a last bit that only repeats the sign."""
    found = []
    with Ads1282(noise_scale=0, power_up_tclk=0) as chip:
        chip.write(1, config0)
        chip.adc.spi_clock(8_000_000)
        chip.adc.play_bits(levels[:, 0], levels[:, 1])
        while not chip.adc.counters["bits_missing"]:
            chip.adc.run_until_edge("DRDY")
            found.append(chip.word() >> (config0 & 3 == 2))
    return np.array(found[:-1]) / 2**30  # the last knows clocks that are missing


def boxcars(*lengths: int) -> Floats:
    h = np.ones(1)
    for n in lengths:
        h = np.convolve(h, np.ones(n))
    return h


def test_the_decoder_gives_the_words_of_the_recorders_own_filter(bits: Levels) -> None:
    """Words that the recording's authors published of these bits: they are read as they were meant, polarity too."""
    want = np.loadtxt(recorded_file("ads1281/testbench_output.csv", WORDS_SHA256))
    got = fftconvolve(decoded(bits), boxcars(1000, 736, 128, 129), "valid")
    found = max(int(np.sum(np.abs(np.subtract.outer(got[k::1000], want)).min(axis=1) < 4)) for k in range(1000))
    assert found >= 40


def cascade(ratio: int, phase: str | None) -> Floats:
    """Response of the sinc, and of the FIR stages behind it, in clocks of the modulator."""
    h = boxcars(*[ratio] * 5) / ratio**5
    for taps, stride in zip(reference.STAGES[phase] if phase else (), reference.STRIDE, strict=False):
        spread = np.zeros(stride * ratio * (len(taps) - 1) + 1)
        spread[:: stride * ratio] = taps
        h = fftconvolve(h, spread)
    return h / h.sum() if phase is None else h / reference.SCALE


@pytest.mark.parametrize("phase", [None, "linear", "minimum"])
@pytest.mark.parametrize("dr", [0, 2, 4])
def test_words_are_those_of_the_cascade(bits: Levels, dr: int, phase: str | None) -> None:
    """Each word of the joined captures within 0.6 LSB of the decoded bits' convolution with the coefficients."""
    levels = bits if dr > 2 else np.concatenate([bits] * 5)  # 77 data periods at the slowest
    got = played(levels, 0x40 | dr << 3 | {None: 1, "linear": 2, "minimum": 6}[phase]) * 2**30
    exact = fftconvolve(decoded(levels), cascade(RATIO[dr], phase)) / FULL_SCALE_OF_BITS * 2**30
    want = exact.clip(-(2**30), 2**30 - 1)  # where two captures meet, the minimum phase swings over
    step = RATIO[dr] * (1 if phase is None else 32)
    span = step * (len(got) - 1) + 1
    first = np.flatnonzero(np.abs(want[: len(want) - span] - got[0]) < 0.6)  # which clock is its newest
    worst = min(float(np.abs(want[k : k + span : step] - got).max()) for k in first)
    assert len(got) > 10
    assert worst < 0.6


def test_the_captures_lie_on_a_line(bits: Levels) -> None:
    """Means of settled sinc words of nine captures with one source: to 4 ppm of full scale, offset 20 ppm at most."""
    found = [(v, float(played(levels, 0x41).mean())) for v, levels in captures(bits) if v not in OTHER_SOURCE_V]
    volts, mean = np.array(found).T
    slope, zero = np.polyfit(volts, mean, 1)
    assert np.abs(mean - slope * volts - zero).max() < 4e-6
    assert abs(zero) < 20e-6
    assert abs(slope * 10) == pytest.approx(0.7894, abs=1e-4)


def density_db(y: Floats, low: float, high: float) -> float:
    """Mean power of a bin between two frequencies, in units of half the sampling rate."""
    window = np.hanning(len(y))
    power = np.abs(np.fft.rfft((y - y.mean()) * window)) ** 2 / np.sum(window**2)
    return float(10 * np.log10(power[int(low * len(power)) : int(high * len(power))].mean()))


BANDS = ((0.02, 0.05), (0.05, 0.1), (0.1, 0.2), (0.2, 0.5), (0.5, 1.0))  # of half the modulator's clock


def own_bits(of_full_scale: float) -> Levels:
    """M0 and M1 of the model's modulator for an input at rest."""
    found: list[tuple[int, int]] = []
    with Ads1282(noise_scale=0, power_up_tclk=0) as chip:
        pins = chip.adc.pins
        chip.adc.set_volts(0, 2.5 * of_full_scale)
        chip.write(1, 0x50)
        pins["MCLK"].watch(lambda level, _t_ns: None if level else found.append((pins["M0"].level, pins["M1"].level)))
        chip.wait_ns(5_000_000)
    return np.array(found[50:], np.uint8)


def test_the_models_bits_have_the_recorded_noise_in_every_band(bits: Levels) -> None:
    """Decoded, captures of one source: the fourth-order shaping of the second loop's error from 10 kHz up, to 3 dB."""
    for volts, levels in captures(bits):
        if volts in OTHER_SOURCE_V:
            continue
        y = decoded(levels)
        own = decoded(own_bits(y.mean() / FULL_SCALE_OF_BITS))
        for band in BANDS[1:]:
            assert density_db(own, *band) == pytest.approx(density_db(y, *band), abs=3.0), (volts, band)
        assert density_db(own, *BANDS[0]) == pytest.approx(density_db(y, *BANDS[0]), abs=6.0), volts


def test_streams_that_do_not_belong_together_are_noise(bits: Levels) -> None:
    """M1 inverted, or taken for M0: the error of the first loop is no longer cancelled, 10 dB and more."""
    for _, levels in captures(bits):
        good = density_db(decoded(levels), *BANDS[0])
        m0, m1 = levels.T
        for wrong in ((m0, 1 - m1), (1 - m0, m1), (m1, m0)):
            assert density_db(decoded(np.stack(wrong, axis=1)), *BANDS[0]) > good + 10.0
