"""What the ADS1255/ADS1256 makes of voltages: codes, filter, noise (sources 2.2, 2.7, 2.8), through libpsabench.

The expectation is computed here from the formulas and tables as typed below.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from chip_bench import Ads1256, amplitude, chi_square_is_inside

# DRATE: alpha, ideal FSC; sources 2.2
ALPHA = {0xF0: (0x400000, 0x44AC08), 0xB0: (0x3C0000, 0x494008), 0x82: (0x4B0000, 0x3A99A0), 0x23: (0x5DC000, 0x2EE14C)}
K = 0x400000 * 0x44AC08 / 2**23


@pytest.mark.parametrize("gain_code", range(7))
@pytest.mark.parametrize("drate", [0xF0, 0x82])
def test_codes_follow_the_formula(drate: int, gain_code: int) -> None:
    full_v = 5.0 / 2**gain_code
    alpha, fsc = ALPHA[drate]
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


# DRATE: -3 dB, Hz; sources 2.2
CORNER_HZ = {0xF0: 6116, 0xE0: 4815, 0xD0: 3008, 0xC0: 1618, 0xB0: 879, 0xA1: 442, 0x92: 221, 0x82: 44.3}


@pytest.mark.parametrize("drate", CORNER_HZ)
def test_is_3_db_down_where_printed(drate: int) -> None:
    hz = CORNER_HZ[drate]
    navg = {0xF0: 1, 0xE0: 2, 0xD0: 4, 0xC0: 8, 0xB0: 15, 0xA1: 30, 0x92: 60, 0x82: 300}[drate]
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
NOISE_UV = {  # DRATE: gains 1 .. 64; sources 2.8
    0xF0: (10.73, 6.71, 4.45, 3.28, 2.42, 1.79, 1.74),
    0xA1: (2.93, 1.89, 1.33, 1.07, 0.69, 0.51, 0.49),
    0x82: (0.875, 0.589, 0.409, 0.305, 0.229, 0.170, 0.169),
    0x03: (0.247, 0.156, 0.080, 0.056, 0.043, 0.037, 0.033),
}


@pytest.mark.parametrize(("drate", "gain_code"), [(0xF0, 0), (0xF0, 6), (0xA1, 3), (0x82, 0), (0x03, 6)])
def test_noise_is_the_published_one(drate: int, gain_code: int) -> None:
    count, total = 60, 0.0
    want_v = NOISE_UV[drate][gain_code] * 1e-6
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
