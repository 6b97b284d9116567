"""Bits of another modulator as the input of an ADS1281/ADS1282, and the data sheet's figure for full scale."""

from __future__ import annotations

import pytest
from chip_bench import Ads1282
from psabench.chips import Bench
from psabench.errors import BadInput

FULL_SCALE = 2**31


def word_of(m0: list[int] | None, m1: list[int] | None = None) -> int:
    """The first settled word of 2000 words/s for a pattern, repeated."""
    with Ads1282(noise_scale=0, power_up_tclk=0) as chip:
        chip.write(1, 0x5A)
        chip.adc.set_volts(0, -1.0)
        chip.adc.play_bits(m0 * 4000 if m0 else None, m1 * 4000 if m1 else None)
        chip.adc.run_until_edge("DRDY")
        assert chip.adc.counters["bits_missing"] == 0
        return chip.word()


def test_full_scale_is_nine_ones_of_ten() -> None:
    """The density of ones at full scale is 90 % (ADS1282-SP, modulator), at the other end 10 %."""
    nine_of_ten = [1] * 9 + [0]
    assert word_of(nine_of_ten) == pytest.approx(FULL_SCALE, rel=1e-4)
    assert word_of([1 - level for level in nine_of_ten]) == pytest.approx(-FULL_SCALE, rel=1e-4)
    assert word_of(nine_of_ten, [0, 1] * 5) == pytest.approx(FULL_SCALE, rel=1e-4)
    assert word_of([0, 1] * 5, nine_of_ten) == pytest.approx(0, abs=FULL_SCALE * 1e-6)  # M1 has no part in the mean


def test_the_models_own_bits_have_the_density_of_full_scale() -> None:
    ones: list[int] = []
    with Ads1282(noise_scale=0, power_up_tclk=0) as chip:
        pins = chip.adc.pins
        chip.adc.set_volts(0, 2.5)
        chip.write(1, 0x50)
        pins["MCLK"].watch(lambda level, _t_ns: None if level else ones.append(pins["M0"].level))
        chip.wait_ns(5_000_000)
    assert len(ones) > 5000
    assert sum(ones) / len(ones) == pytest.approx(0.9, abs=2e-3)


def test_none_is_the_model_again() -> None:
    assert word_of(None) == pytest.approx(-0.4 * FULL_SCALE, rel=1e-4)


@pytest.mark.parametrize(
    ("m0", "m1", "reason"),
    [
        ([0, 2], None, "M0: expected levels 0 and 1, got others"),
        ([0, 1], [1, -1], "M1: expected levels 0 and 1, got others"),
        ([0, 1], [1], "M1: expected 2 levels, as of M0, got 1"),
    ],
)
def test_what_is_no_level_is_refused(m0: list[int], m1: list[int] | None, reason: str) -> None:
    with Bench() as bench, pytest.raises(BadInput) as e:
        bench.part("ads1281").play_bits(m0, m1)
    assert str(e.value) == reason


def test_other_parts_have_no_modulator_to_replace() -> None:
    with Bench() as bench, pytest.raises(BadInput, match="expected an ads1281 or ads1282, got ads1256"):
        bench.part("ads1256").play_bits([0, 1])
