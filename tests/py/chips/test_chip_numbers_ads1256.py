"""What the ADS1255/ADS1256 makes of voltages: codes, filter, noise (sources 2.2, 2.7, 2.8), through libpsabench.

The expectation is computed here from the formulas and tables as typed below.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from chip_bench import Ads1256, amplitude, chi_square_is_inside


class Rate(NamedTuple):
    """One row of sources 2.2 and 2.8."""

    navg: int
    corner_hz: float
    alpha: int
    fsc: int  # ideal
    noise_uv: tuple[float, ...]  # gains 1 .. 64


RATES = {  # by DRATE
    0xF0: Rate(1, 6116, 0x400000, 0x44AC08, (10.73, 6.71, 4.45, 3.28, 2.42, 1.79, 1.74)),
    0xE0: Rate(2, 4815, 0x400000, 0x44AC08, (9.07, 5.92, 3.96, 2.98, 2.13, 1.52, 1.52)),
    0xD0: Rate(4, 3008, 0x400000, 0x44AC08, (7.25, 4.59, 3.15, 2.44, 1.69, 1.23, 1.19)),
    0xC0: Rate(8, 1618, 0x400000, 0x44AC08, (5.39, 3.46, 2.38, 1.87, 1.22, 0.91, 0.91)),
    0xB0: Rate(15, 879, 0x3C0000, 0x494008, (4.17, 2.59, 1.83, 1.49, 0.94, 0.69, 0.65)),
    0xA1: Rate(30, 442, 0x3C0000, 0x494008, (2.93, 1.89, 1.33, 1.07, 0.69, 0.51, 0.49)),
    0x92: Rate(60, 221, 0x3C0000, 0x494008, (1.95, 1.25, 0.63, 0.65, 0.50, 0.39, 0.37)),
    0x82: Rate(300, 44.3, 0x4B0000, 0x3A99A0, (0.875, 0.589, 0.409, 0.305, 0.229, 0.170, 0.169)),
    0x72: Rate(500, 26.6, 0x3E8000, 0x4651F3, (0.692, 0.438, 0.321, 0.233, 0.184, 0.146, 0.131)),
    0x63: Rate(600, 22.1, 0x4B0000, 0x3A99A0, (0.629, 0.393, 0.292, 0.216, 0.168, 0.136, 0.122)),
    0x53: Rate(1000, 13.3, 0x3E8000, 0x4651F3, (0.533, 0.335, 0.245, 0.176, 0.138, 0.104, 0.106)),
    0x43: Rate(1200, 11.1, 0x4B0000, 0x3A99A0, (0.494, 0.305, 0.224, 0.149, 0.134, 0.102, 0.093)),
    0x33: Rate(2000, 6.64, 0x3E8000, 0x4651F3, (0.401, 0.264, 0.169, 0.126, 0.107, 0.085, 0.073)),
    0x23: Rate(3000, 4.43, 0x5DC000, 0x2EE14C, (0.339, 0.214, 0.138, 0.106, 0.082, 0.061, 0.061)),
    0x13: Rate(6000, 2.22, 0x5DC000, 0x2EE14C, (0.301, 0.175, 0.102, 0.076, 0.061, 0.045, 0.044)),
    0x03: Rate(12000, 1.11, 0x5DC000, 0x2EE14C, (0.247, 0.156, 0.080, 0.056, 0.043, 0.037, 0.033)),
}
K = 0x400000 * 0x44AC08 / 2**23


@pytest.mark.parametrize("gain_code", range(7))
@pytest.mark.parametrize("drate", RATES)
def test_codes_follow_the_formula(drate: int, gain_code: int) -> None:
    full_v = 5.0 / 2**gain_code
    alpha, fsc = RATES[drate].alpha, RATES[drate].fsc
    with Ads1256(noise_scale=0, cells_max=1) as s:
        s.adc.run_until_level("DRDY", 0)
        s.write(2, 0x20 | gain_code)
        s.write(3, drate)
        s.adc.set_volts(1, 2.5)
        s.send(0xF0)
        s.fall()
        assert s.read(5, 6) == bytes(3) + fsc.to_bytes(3, "little")
        s.wait_ns(10_000)
        for part in (0.0, 0.3, -0.3, 0.499, -0.499):
            s.adc.set_volts(0, 2.5 + part * full_v)
            s.pulse("SYNC", 0, 1_000)
            code = s.codes(1)[0]
            want = part * alpha * fsc / K
            assert abs(code - want) <= 1 + abs(want) * 3e-7, f"{part} of full scale"


@pytest.mark.parametrize(("part", "code"), [(1.02, 0x7FFFFF), (-1.02, -0x800000)])
def test_clips_at_both_ends(part: float, code: int) -> None:
    with Ads1256(noise_scale=0) as s:
        s.adc.run_until_level("DRDY", 0)
        s.write(2, 0x21)
        s.adc.set_volts(0, 2.5 + part * 1.25)
        s.adc.set_volts(1, 2.5 - part * 1.25)
        s.send(0xF0)
        s.fall()
        assert s.codes(7)[-1] == code


def test_fsc_of_another_rate_gives_a_gross_gain_error() -> None:
    with Ads1256(noise_scale=0) as s:
        s.adc.run_until_level("DRDY", 0)
        s.adc.set_volts(0, 3.5)
        s.adc.set_volts(1, 2.5)
        s.write(3, 0x82)
        s.pulse("SYNC", 0, 1_000)
        code = s.codes(1)[0]
    assert code / (2**23 / 5) == pytest.approx(1.172, abs=5e-4)


def sine(hz: float, volts: float) -> Callable[[int, int], float]:
    """AIN0 around the 2.5 V of the other inputs."""
    return lambda ain, t_ns: 2.5 + (ain == 0) * volts * math.sin(2e-9 * math.pi * hz * t_ns)


def test_rejects_the_mains() -> None:
    for drate, hz in ((0x63, 50.0), (0x72, 60.0), (0x23, 50.0), (0x23, 60.0)):
        with Ads1256(noise_scale=0) as s:
            s.adc.run_until_level("DRDY", 0)
            s.write(3, drate)
            s.adc.set_input(sine(hz, 0.5))
            codes = s.codes(6)[2:]
        assert max(abs(c) for c in codes) < 2**23 * 1e-6, f"{drate:02X}h, {hz} Hz"


def test_a_look_a_word_rejects_what_fewer_looks_fold() -> None:
    """1 kHz at 100 SPS is a notch of the chip; with a look a millisecond it is the input at rest."""
    found = {}
    for every_word in (0, 1):
        with Ads1256(noise_scale=0, every_word=every_word) as s:
            s.adc.run_until_level("DRDY", 0)
            s.write(3, 0x82)
            s.adc.set_input(sine(1000.0, 0.5))
            found[every_word] = max(abs(c) for c in s.codes(4)[2:])
    assert found[1] < 2**23 * 1e-6 < 2**23 * 0.01 < found[0]


@pytest.mark.parametrize("drate", RATES)
def test_is_3_db_down_where_printed(drate: int) -> None:
    hz, navg = RATES[drate].corner_hz, RATES[drate].navg
    with Ads1256(noise_scale=0) as s:
        s.adc.spi_clock(1_900_000)
        s.adc.run_until_level("DRDY", 0)
        s.write(3, drate)
        s.send(0xF0)
        s.fall()
        s.adc.set_input(sine(hz, 2.0))
        codes = np.array(s.codes(90)[10:]) * 5.0 / 2**23
    gain = abs(amplitude(codes, hz * 256 * navg / 7.68e6)) / 2.0
    assert 20 * math.log10(gain) == pytest.approx(-3.01, abs=0.05)


# ---- noise ----

SEEDS = 30
LOUD = 1000  # times the published noise: even the quietest cell's draw is hundreds of codes
HALF_CLOCK_NS = 65  # the synchronisation ends between two edges of CLKIN
AT_NS = 3_000_000_000  # a word is ready then, whatever the rate; the draw of a word is that of its instant


def loud_word(drate: int, gain_code: int, begin_ns: int) -> tuple[int, int]:
    """The first word after a synchronisation that ends at begin_ns, with zero at the inputs and the ideal coefficients:
    when it was ready, and its code."""
    with Ads1256(seed=11, noise_scale=LOUD, cells_max=1) as s:
        s.adc.set_volts(0, 2.5)
        s.adc.set_volts(1, 2.5)
        s.adc.run_until_level("DRDY", 0)
        s.write(2, 0x20 | gain_code)
        s.write(3, drate)
        s.write(5, 0, 0, 0, *RATES[drate].fsc.to_bytes(3, "little"))
        s.adc.spi_clock(1_900_000)  # a word is read within a period
        s.pin("SYNC", 0)
        s.bench.run_until_ns(begin_ns)
        s.pin("SYNC", 1)
        ready_ns = s.fall()
        return ready_ns, s.rdata()


def test_every_cell_of_the_noise_table_scales_the_same_draw() -> None:
    """All 112 cells: the word of one instant is one draw times the printed figure, to a code. How large such draws
    are is for the next test."""
    draw, least, off = math.nan, math.inf, []
    for drate, rate in RATES.items():
        settled_ns = loud_word(drate, 0, AT_NS)[0] - AT_NS
        for gain_code in reversed(range(7)):  # the first has the most codes
            ready_ns, code = loud_word(drate, gain_code, AT_NS - settled_ns - HALF_CLOCK_NS)
            assert ready_ns == AT_NS
            rms = rate.noise_uv[gain_code] * 1e-6 * LOUD / (5.0 / 2**gain_code / 2**23)
            draw = code / rms if math.isnan(draw) else draw
            least = min(least, abs(draw * rms))
            if abs(code - draw * rms) > 1:
                off.append(f"{drate:02X}h gain {2**gain_code}: {code} codes, {draw * rms:.1f} by the table")
    assert least > 500, "one code is 0.2 % of any figure"
    assert not off


@pytest.mark.parametrize(("drate", "gain_code"), [(0xF0, 0), (0xF0, 6), (0xA1, 3), (0x82, 0), (0x03, 6)])
def test_noise_is_the_published_one(drate: int, gain_code: int) -> None:
    """Chi-square of 30 seeds in five cells; the others have the same draws, by the test before."""
    count, total = 60, 0.0
    want_v = RATES[drate].noise_uv[gain_code] * 1e-6
    lsb_v = 5.0 / 2**gain_code / 2**23
    for seed in range(SEEDS):
        with Ads1256(seed=100 * drate + seed, cells_max=1) as s:
            s.adc.set_volts(0, 2.5)
            s.adc.set_volts(1, 2.5)
            s.adc.run_until_level("DRDY", 0)
            s.write(2, 0x20 | gain_code)
            s.write(3, drate)
            s.send(0xF0)
            s.fall()
            s.adc.spi_clock(1_900_000)
            v = np.array(s.codes(count)) * lsb_v
        total += float(np.sum((v - v.mean()) ** 2)) / (want_v**2 + lsb_v**2 / 12)
    assert chi_square_is_inside(total, SEEDS * (count - 1))
