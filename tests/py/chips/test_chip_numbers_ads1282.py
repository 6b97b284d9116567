"""What the ADS1281/ADS1282 makes of voltages: filter, codes, corrections, noise (sources 1.7 to 1.9), by libpsabench.

The expectation is computed here: the decimation chain in exact integers from the published coefficients
(psabench.boards.psa2.converter_filter), everything else from the formulas and tables as typed below.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from fractions import Fraction

import numpy as np
import pytest
from chip_bench import Ads1282, amplitude, chi_square_is_inside
from numpy.typing import NDArray
from psabench.boards.psa2 import converter_filter as reference
from psabench.boards.psa2.converter_filter import BLOCKS

FULL_SCALE = 2**30  # of a word of the FIR modes, in LSB of its 31 bits
VREF_V = 5.0
FULL_SCALE_V = VREF_V / 2
SETTLED = 63  # words after a restart
DC_GAIN = float(sum(reference.weights(32, "linear")))
PHASES = {"linear": 0, "minimum": 1}
RATIO = {0: 128, 1: 64, 2: 32, 3: 16, 4: 8}  # sinc ratio by DR


def config0(dr: int, phase: str = "linear", filtr: int = 2) -> int:
    return 0x40 | dr << 3 | PHASES[phase] << 2 | filtr


class Source:
    """An input that is asked once a sinc block: block n gets value(n) of full scale."""

    def __init__(self) -> None:
        self.value: Callable[[int], float] = lambda _n: 0.0
        self.asked = 0

    def volts(self, _input: int, _t_ns: int) -> float:
        self.asked += 1
        return self.value(self.asked - 1) * FULL_SCALE_V


def awake(seed: int = 1, noise_scale: float = 0.0) -> Ads1282:
    """A part behind the reset of its power-up: it takes commands."""
    return Ads1282(seed=seed, noise_scale=noise_scale, power_up_tclk=0)


@contextmanager
def quiet_chip(dr: int, phase: str = "linear", filtr: int = 2) -> Iterator[tuple[Ads1282, Source]]:
    """A noiseless ADS1282 that reads its input from a Source; the next fall of DRDY is its first."""
    with awake() as s:
        source = Source()
        s.adc.set_input(source.volts)
        s.adc.run_until_level("DRDY", 0)
        s.write(1, config0(dr, phase, filtr))
        if config0(dr, phase, filtr) == 0x52:
            s.send(0x04)
        yield s, source


def results(s: Ads1282, count: int) -> NDArray[np.float64]:
    """The next words as fractions of full scale."""
    return np.array([w >> 1 for w in s.words(count)]) / FULL_SCALE


# ---- the decimation chain ----


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("dr", [0, 2, 4])
def test_words_are_those_of_the_exact_cascade(dr: int, phase: str) -> None:
    """Random blocks of either full scale, the hardest input: each word within one LSB of exact rational arithmetic."""
    rng = np.random.default_rng(20_000 + dr)
    signs = [int(x) for x in rng.choice((-1, 1), BLOCKS * 200)]
    h = np.array(reference.impulse(RATIO[dr], phase), object)
    with quiet_chip(dr, phase) as (s, source):
        source.value = lambda n: 0.9 * signs[n]
        s.fall()
        s.word()
        lead = source.asked
        s.words(1)
        assert source.asked - lead == BLOCKS
        got = [w >> 1 for w in s.words(8)]
    scale = RATIO[dr] ** 5 * reference.SCALE
    nine_tenths = round(Fraction(0.9) * 2**34)  # the ideal modulator's own resolution

    def word(newest: int) -> Fraction:
        total = sum(int(h[k]) * signs[newest - k] for k in range(len(h)))
        return Fraction(total * nine_tenths, scale * 2**4)

    # Which block is the newest of a word is the model's choice: one place must fit all words.
    fits = [
        n
        for n in range(lead, lead + 2 * BLOCKS + 4)
        if all(abs(g - word(n - 1 + BLOCKS * i)) <= 1 for i, g in enumerate(got))
    ]
    assert len(fits) == 1


@pytest.mark.parametrize("phase", PHASES)
def test_impulse_response_is_that_of_the_coefficients(phase: str) -> None:
    """One block of full scale now and then, at each of its 32 places in a data period: within one LSB everywhere."""
    spacing = (SETTLED + 1) * BLOCKS + 1
    pulses = BLOCKS + 1
    with quiet_chip(4, phase) as (s, source):
        source.value = lambda n: float(n % spacing == 0 and n > 0)
        s.fall()
        s.word()
        asked = source.asked
        got = results(s, pulses * (SETTLED + 1))
    h = reference.weights(8, phase)
    best = min(
        max(abs(got[i] - response_at(h, newest + BLOCKS * (i + 1), spacing)) for i in range(len(got)))
        for newest in range(asked - BLOCKS, asked + 4)
    )
    assert best <= 1.0 / FULL_SCALE


def response_at(h: NDArray[np.float64], n: int, spacing: int) -> float:
    """Sum of the impulses at spacing, 2 spacing, ... as seen by the word whose newest block is n."""
    k = n % spacing
    return float(h[k]) if k < len(h) and n >= spacing else 0.0


SWEEP = (0.0131, 0.07, 0.19, 0.31, 0.3749, 0.4, 0.413, 0.43, 0.47, 0.4876, 0.513, 0.55, 0.83, 1.27, 3.61, 7.77, 15.87)
COUNT = 96


@pytest.mark.parametrize("phase", PHASES)
@pytest.mark.parametrize("dr", [1, 2, 3])
def test_frequency_response_is_the_coefficients_own_to_1e_9(dr: int, phase: str) -> None:
    """A sine of 0.9 full scale: magnitude, and phase up to one delay of whole blocks, to 1e-9 of full scale."""
    ratio, worst, delays = RATIO[dr], 0.0, set()
    with quiet_chip(dr, phase) as (s, source):
        for f in SWEEP:
            begin = source.asked
            source.value = lambda n, f=f: 0.9 * math.cos(2 * math.pi * f / BLOCKS * n)  # type: ignore[misc]
            s.words(SETTLED + 2)
            last = source.asked
            got = amplitude(results(s, COUNT), f) / 0.9
            want = reference.response(ratio, phase, f)
            worst = max(worst, abs(abs(got) - abs(want)))
            if abs(want) > 1e-3:
                turn = np.exp(2j * np.pi * f / BLOCKS * np.arange(last, last + 2 * BLOCKS))
                errors = np.abs(got - want * turn)
                delays.add(int(np.argmin(errors)))
                worst = max(worst, float(errors.min()))
            assert source.asked > begin
    assert worst < 1e-9
    assert len(delays) == 1


def gain_at(f: float, phase: str, dr: int = 2) -> float:
    """Measured, as a fraction."""
    with quiet_chip(dr, phase) as (s, source):
        source.value = lambda n: 0.9 * math.sin(2 * math.pi * f / BLOCKS * n)
        s.words(SETTLED + 1)
        return abs(amplitude(results(s, COUNT), f)) / 0.9


@pytest.mark.parametrize("phase", PHASES)
def test_minus_3_db_is_at_0_413_of_the_data_rate(phase: str) -> None:
    f = np.linspace(0.4125, 0.4139, 8)
    db = np.array([20 * math.log10(gain_at(x, phase)) for x in f])
    corner = float(np.interp(20 * math.log10(math.sqrt(2)), -db, f))
    assert abs(corner - 0.413) < 0.0006
    assert corner == pytest.approx(reference.corner(32, phase), abs=1e-6)


@pytest.mark.parametrize("phase", PHASES)
def test_pass_band_is_flat_to_3_thousandths_of_a_decibel(phase: str) -> None:
    """Relative to DC, and to the hold of the input over a block, which is the model's own."""
    dc = sum(reference.weights(32, phase))
    for f in (0.0131, 0.06, 0.11, 0.17, 0.23, 0.29, 0.33, 0.36, 0.3749):
        db = 20 * math.log10(gain_at(f, phase) / reference.hold(32, f) / dc)
        assert -0.0032 < db < 0.0022, f"{f}"


@pytest.mark.parametrize(
    ("f", "least_db"), [(0.503, 128), (0.52, 135), (0.61, 135), (0.97, 135), (1.37, 135), (6.2, 135)]
)
@pytest.mark.parametrize("phase", PHASES)
def test_stop_band_attenuates(phase: str, f: float, least_db: float) -> None:
    assert gain_at(f, phase) < 10 ** (-least_db / 20)


@pytest.mark.parametrize(("phase", "gain"), [("linear", 1.0000287), ("minimum", 1.0001690)])
def test_gain_at_dc_is_what_the_taps_give(phase: str, gain: float) -> None:
    with quiet_chip(2, phase) as (s, source):
        source.value = lambda _n: 0.5
        s.words(SETTLED)
        assert results(s, 1)[0] * 2 == pytest.approx(gain, abs=6e-8)


@pytest.mark.parametrize(("phase", "delay"), [("linear", 30.80), ("minimum", 5.000)])
def test_group_delay_at_dc(phase: str, delay: float) -> None:
    """A ramp: the word at DRDY is the input of 30.80 or 5.00 periods and 468 tCLK before."""
    slope = 1e-3  # of full scale a data period of 1 ms
    with awake() as s:
        s.adc.set_input(lambda _input, t_ns: (slope * t_ns * 1e-6 - 0.5) * FULL_SCALE_V)
        s.adc.run_until_level("DRDY", 0)
        s.write(1, config0(2, phase))
        for _ in range(SETTLED + 1):
            s.fall()
        t_ns = s.now_ns
        got = (s.word() >> 1) / FULL_SCALE
    gain = float(sum(reference.weights(32, phase)))
    found = t_ns * 1e-6 - (got / gain + 0.5) / slope - 468 / 4096
    assert found == pytest.approx(delay, abs=0.006)


@pytest.mark.parametrize(("phase", "periods"), [("linear", (38.0, 55.1, 57.4)), ("minimum", (26.3, 42.7, 51.8))])
def test_a_step_settles_as_tabulated(phase: str, periods: tuple[float, ...]) -> None:
    """To 1 %, 1e-4 and 1e-6 of its height; steps at all 32 places in a data period fill in between the words."""
    count, level = 66, 0.5  # of full scale
    answers = []  # for each step: how many blocks had been asked for since, before the first word; the words
    with quiet_chip(2, phase) as (s, source):
        source.value = lambda _n: -level
        s.words(SETTLED + 2)
        for i in range(BLOCKS):
            step = source.asked + BLOCKS + i
            source.value = lambda n, step=step, v=level: v if n >= step else -v  # type: ignore[misc]
            asked = source.asked
            answers.append((asked - step, results(s, count) * np.sign(level)))
            level = -level
    h = reference.weights(32, phase)
    rise = np.concatenate((np.zeros(BLOCKS * count), np.cumsum(h), np.full(BLOCKS * count, sum(h))))

    def expected(since: int) -> NDArray[np.float64]:
        """Words whose newest block is that many after the step, and every data period from there."""
        return rise[BLOCKS * count + since + BLOCKS * np.arange(count)] - sum(h) / 2

    # Which of the blocks is the newest of a word is the model's choice: one place must fit all words.
    fits = [
        place
        for place in range(2 * BLOCKS)
        if all(np.max(np.abs(got - expected(asked + place))) < 2 / FULL_SCALE for asked, got in answers)
    ]
    assert len(fits) == 1
    times = np.concatenate([(asked + fits[0]) / BLOCKS + np.arange(count) for asked, _ in answers])
    errors = np.abs(np.concatenate([got for _, got in answers]) - sum(h) / 2)
    for limit, wanted in zip((1e-2, 1e-4, 1e-6), periods, strict=True):
        settled = float(times[errors > limit].max()) + 1 / BLOCKS
        assert settled == pytest.approx(wanted, abs=0.15), f"to {limit}"


# ---- codes ----

CLIP_CODES = [  # input in full scales, word; sources 1.7, at a DC gain of exactly 1
    (1.05, 0x7FFFFFFF),
    (1.001, 0x7FFFFFFF),
    (-1.001, 0x80000000),
    (-1.05, 0x80000000),
]


@pytest.mark.parametrize(("volts", "word"), CLIP_CODES)
@pytest.mark.parametrize("gain_code", [0, 1, 6])
def test_over_range_shows_in_bit_0(volts: float, word: int, gain_code: int) -> None:
    with awake() as s:
        s.write(2, 0x08 | gain_code)
        s.adc.set_volts(0, volts * FULL_SCALE_V / 2**gain_code)
        got = s.words(SETTLED + 1)[-1]
    assert got & 0xFFFFFFFF == word


def test_words_inside_repeat_the_sign_in_bit_0() -> None:
    with awake() as s:
        for volts in (2.4, 1e-6, 0.0, -1e-6, -2.4):
            s.adc.set_volts(0, volts)
            got = s.words(SETTLED + 1)[-1]
            assert got & 1 == (got < 0)
            assert (got >> 1) / FULL_SCALE * FULL_SCALE_V == pytest.approx(volts * DC_GAIN, abs=6e-9)


CORRECTIONS = [  # OFC, FSC, input in full scales
    (0x000001, 0x400000, 0.0),
    (0xFFFFFF, 0x400000, 0.0),
    (0x7FFFFF, 0x400000, 0.0),
    (0x800000, 0x400000, 0.0),
    (0x123456, 0x400000, 0.25),
    (0x000000, 0x800000, 0.25),
    (0x000000, 0xFFFFFF, 0.2),
    (0xFEDCBA, 0x3FEDCB, -0.4),
    (0x000000, 0x000000, 0.5),
]


@pytest.mark.parametrize(("ofc", "fsc", "part"), CORRECTIONS)
def test_offset_and_gain_registers_act_as_equation_7(ofc: int, fsc: int, part: float) -> None:
    """out = clip((x - 256 OFC) FSC / 400000h): the plain word, corrected here, against the corrected one."""
    with awake() as s:
        s.adc.set_volts(0, part * FULL_SCALE_V)
        plain = s.words(SETTLED + 1)[-1] >> 1
        s.send(0x11)
        s.write(5, *ofc.to_bytes(3, "little"), *fsc.to_bytes(3, "little"))
        assert s.read(5, 6) == ofc.to_bytes(3, "little") + fsc.to_bytes(3, "little")
        s.send(0x10)
        got = s.words(2)[-1]
    signed = ofc - (ofc >> 23 << 24)
    exact = (Fraction(plain) - 128 * signed) * fsc / 0x400000
    if -FULL_SCALE <= exact < FULL_SCALE:
        assert abs((got >> 1) - exact) <= 1
    else:
        assert got & 0xFFFFFFFF == (0x7FFFFFFF if exact > 0 else 0x80000000)


def test_sinc_words_are_half_the_scale_and_do_not_clip() -> None:
    """Sources 1.7: +full scale is 3FFFFFFFh or one more, -full scale C0000000h, and it goes on beyond."""
    for part, word in (
        (1.0, 2**30),
        (-1.0, -(2**30)),
        (0.5, 2**29),
        (1.04, 1.04 * 2**30),
        (-1.04, -1.04 * 2**30),
        (0.0, 0),
    ):
        with quiet_chip(2, filtr=1) as (s, source):
            source.value = lambda _n, part=part: part  # type: ignore[misc]
            s.wait_ns(2_000_000)
            s.adc.spi_clock(2_000_000)
            got = s.words(2)[-1]
        assert abs(got - word) <= 1, f"{part} of full scale"


# ---- calibration, chains ----


def test_offset_calibration_takes_the_mean_of_the_input_away() -> None:
    """OFSCAL, then the same input reads zero: OFC is the input in units of 256 counts of the word."""
    with awake() as s:
        s.adc.set_volts(0, 0.1)
        s.words(SETTLED + 1)
        s.send(0x11)
        s.fall()
        s.send(0x60)
        s.fall()
        ofc = int.from_bytes(s.read(5, 3), "little", signed=True)
        s.send(0x10)
        after = s.words(2)[-1] >> 1
    assert ofc == round(0.1 / FULL_SCALE_V * DC_GAIN * 2**23)
    assert abs(after) <= 64  # half a count of OFC


def test_gain_calibration_makes_the_input_full_scale() -> None:
    with awake() as s:
        s.adc.set_volts(0, 2.0)
        s.words(SETTLED + 1)
        s.send(0x11)
        s.fall()
        s.send(0x61)
        s.fall()
        fsc = int.from_bytes(s.read(8, 3), "little")
        s.adc.set_volts(0, 1.0)
        s.send(0x10)
        after = (s.words(SETTLED + 1)[-1] >> 1) / FULL_SCALE
    assert fsc == round(0x400000 / (0.8 * DC_GAIN))
    assert after == pytest.approx(0.5, abs=2e-7)


@pytest.mark.parametrize(("chain", "within"), [("modulator", 2e-7), ("direct", 2e-8)])
@pytest.mark.parametrize("phase", PHASES)
def test_other_chains_give_the_same_settled_value(chain: str, within: float, phase: str) -> None:
    """The modulator's own shaped error stays below a tenth of the published noise, 6e-7 of full scale."""
    gain = float(sum(reference.weights(32, phase)))
    with Ads1282(noise_scale=0, chain=chain, power_up_tclk=0) as s:
        s.write(1, config0(2, phase))
        for part in (0.123, -0.77):
            s.adc.set_volts(0, part * FULL_SCALE_V)
            got = np.array(s.words(SETTLED + 8)[-8:]) / 2 / FULL_SCALE
            assert np.abs(got - part * gain).max() < within


# ---- high-pass ----


@pytest.mark.parametrize("hpf", [0x0332, 0x0337, 0x019A, 0x2000])
def test_high_pass_is_the_printed_one_pole(hpf: int) -> None:
    """H(z) = (2-a)/2 (1 - 1/z)/(1 - b/z), a = HPF/65536, b = (1 + (1-a)^2)/2, behind the FIR stages."""
    a = hpf / 65536
    b = (1 + (1 - a) ** 2) / 2
    for f in (0.00199, 0.013, 0.11, 0.37):
        with quiet_chip(2, filtr=3) as (s, source):
            s.write(3, hpf & 0xFF, hpf >> 8)
            source.value = lambda n, f=f: 0.8 * math.sin(2 * math.pi * f / BLOCKS * n)  # type: ignore[misc]
            s.words(SETTLED + round(25 / (1 - b)))
            got = abs(amplitude(results(s, 500), f)) / 0.8
        z = np.exp(2j * np.pi * f)
        want = abs(reference.response(32, "linear", f)) * abs((2 - a) / 2 * (1 - 1 / z) / (1 - b / z))
        assert got == pytest.approx(want, abs=2e-7), f"HPF {hpf:04X}h at {f}"


def test_high_pass_forgets_as_silicon_does() -> None:
    """CONFIG0 = 53h, HPF at reset: words seen on a chip were 147410, 145582, 143770, 141990; ratio 0.98759."""
    with quiet_chip(2, filtr=3) as (s, source):
        source.value = lambda _n: 0.8
        got = results(s, SETTLED + 40)[-30:]
    ratios = got[1:] / got[:-1]
    assert ratios == pytest.approx(0.987596, abs=2e-6)
    assert pytest.approx(float(ratios.mean()), abs=1e-4) == (141990 / 147410) ** (1 / 3)


@pytest.mark.parametrize(("hz", "rate", "hpf"), [(0.5, 250, 0x0337), (1, 500, 0x0337), (1, 1000, 0x019A)])
def test_corner_of_the_high_pass_is_where_the_table_says(hz: float, rate: int, hpf: int) -> None:
    f = hz / rate
    with quiet_chip(2, filtr=3) as (s, source):  # by the rate's fraction: the filter knows no other frequency
        s.write(3, hpf & 0xFF, hpf >> 8)
        source.value = lambda n: 0.8 * math.sin(2 * math.pi * f / BLOCKS * n)
        s.words(SETTLED + 3000)
        got = abs(amplitude(results(s, 1500), f)) / 0.8
    assert 20 * math.log10(got) == pytest.approx(-3.01, abs=0.02)


# ---- noise ----

SEEDS = 30
SNR_DB = {  # by DR, gains 1 .. 64; sources 1.9
    0: (130, 130, 129, 128, 125, 119, 114),
    1: (127, 127, 126, 125, 122, 116, 111),
    2: (124, 124, 123, 122, 119, 113, 108),
    3: (121, 121, 120, 119, 116, 110, 105),
    4: (118, 118, 117, 115, 112, 107, 101),
}


def published_v(dr: int, gain_code: int) -> float:
    """Noise at the input, V rms: the SNR is that of a full-scale sine."""
    return float(FULL_SCALE_V / math.sqrt(2) / 10 ** (SNR_DB[dr][gain_code] / 20) / 2**gain_code)


@pytest.mark.parametrize("dr", SNR_DB)
def test_noise_is_the_published_one_at_every_rate(dr: int) -> None:
    """Gain 1; the other gains have the same draws, by the next test. Chi-square of 30 seeds of 200 words: 3 % of the
    figure, 0.27 dB. The filter leaves neighbours correlated: fewer degrees of freedom than words."""
    count = 200
    h = reference.weights(RATIO[dr], "minimum")
    lags = len(h) // BLOCKS
    rho = np.array([np.dot(h[BLOCKS * k :], h[: len(h) - BLOCKS * k]) for k in range(lags)]) / np.dot(h, h)
    shared = 1 + 2 * sum((1 - k / count) * rho[k] ** 2 for k in range(1, lags))
    want_v, total, means = published_v(dr, 0), 0.0, []
    for seed in range(1, SEEDS + 1):
        with awake(seed=seed, noise_scale=1) as s:
            s.write(2, 0x08)
            s.write(1, config0(dr, "minimum"))
            s.adc.set_volts(0, 0.0)
            v = results_v(s.words(count), 0)
        total += float(np.sum(v**2)) / want_v**2
        means.append(float(np.mean(v)))
    assert chi_square_is_inside(total / shared, SEEDS * count / shared)
    assert abs(np.mean(means)) < 5 * want_v / math.sqrt(SEEDS * count)
    assert len(set(means)) == SEEDS


@pytest.mark.parametrize("dr", SNR_DB)
def test_noise_of_every_gain_scales_the_same_draws_by_the_published_figures(dr: int) -> None:
    """The same seed draws the same numbers: words at a gain are those at gain 64 times the cells' ratio, to an LSB."""
    words = []
    for gain_code in range(7):
        with awake(seed=5, noise_scale=1000) as s:
            s.write(2, 0x08 | gain_code)
            s.write(1, config0(dr, "minimum"))
            s.adc.set_volts(0, 0.0)
            words.append(results_v(s.words(20), gain_code)[2:])
    for gain_code, v in enumerate(words):
        want_v = words[6] * published_v(dr, gain_code) / published_v(dr, 6)
        lsb_v = FULL_SCALE_V / FULL_SCALE / 2**gain_code
        assert np.sqrt(np.mean(want_v**2)) > 1e5 * lsb_v, "an LSB is nothing beside the figure"
        assert np.abs(v - want_v).max() <= lsb_v, f"gain {2**gain_code}"


def results_v(words: list[int], gain_code: int) -> NDArray[np.float64]:
    v: NDArray[np.float64] = np.array([w >> 1 for w in words]) / FULL_SCALE * FULL_SCALE_V / 2**gain_code
    return v
