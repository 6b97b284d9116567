"""A log of a real ADS1256 board beside the model: what self-calibrations left in OFC and FSC (E5; docs/evidence.md).

Each line of the log has the registers after a SELFCAL, by rate, gain 1 .. 8 and buffer, about forty calibrations each.
Its codes scatter 70 times as much as the chip: they say nothing about it.
"""

from __future__ import annotations

import lzma
import re
from collections import defaultdict
from collections.abc import Mapping
from itertools import pairwise

import numpy as np
import pytest
from chip_bench import Ads1256
from numpy.typing import NDArray
from recordings import recorded_file

LOG_SHA256 = "110e685728658c48d4549f76d6aabf71bdcdd1b30dee565b63320575ddd90c41"
LINE = re.compile(rb"=\(\w\w \w\w (\w\w) (\w\w) \w\w +(-?\d+) +(\d+)\) - count=.*, buff=(\w)")
IDEAL_FSC = {
    0xF0: 0x44AC08, 0xE0: 0x44AC08, 0xD0: 0x44AC08, 0xC0: 0x44AC08, 0xB0: 0x494008, 0xA1: 0x494008, 0x92: 0x494008,
    0x82: 0x3A99A0, 0x72: 0x4651F3, 0x63: 0x3A99A0, 0x53: 0x4651F3, 0x43: 0x3A99A0,
}  # fmt: skip
# Here FSC jumps between two values 100 to 300 counts apart: a part of this board's signal path that the model has not.
FSC_JUMPS = {(0xA1, 4), (0xA1, 8), (0x92, 8), (0x82, 8), (0x72, 8)}
ADCON, DRATE, OFC = 2, 3, 5
SELFCAL = 0xF0
CALIBRATIONS = 40

Setting = tuple[int, int, bool]  # DRATE, gain, buffer
Words = NDArray[np.float64]  # OFC, FSC by row


@pytest.fixture(scope="module")
def log() -> Mapping[Setting, Words]:
    """OFC and FSC of each calibration: the log's lines where they change."""
    rows = []
    with lzma.open(recorded_file("ads1256/ads1256-lib-test-100.log.xz", LOG_SHA256)) as lines:
        for line in lines:
            if m := LINE.search(line):
                rows.append(((int(m[2], 16), 1 << int(m[1], 16), m[5] == b"y"), (int(m[3]), int(m[4]))))
    found: dict[Setting, list[tuple[int, int]]] = defaultdict(list)
    for (was, before), (setting, words) in pairwise(rows):
        if words != before and setting == was:  # the first of a setting is of the calibration before
            found[setting].append(words)
    return {setting: np.array(words, float) for setting, words in found.items() if len(words) >= 20}


def spread(x: Words) -> Words:
    """Standard deviation, of the differences of neighbours: a slow drift does not count."""
    deviation: Words = np.diff(x, axis=0).std(axis=0) / np.sqrt(2)
    return deviation


def calibrated(drate: int, gain: int, offset_v: float = 0.0) -> Words:
    """The same of the model."""
    found = []
    with Ads1256(seed=7, cells_max=1, offset_v=offset_v) as chip:
        chip.adc.run_until_level("DRDY", 0)
        chip.write(ADCON, 0x20 | gain.bit_length() - 1)
        chip.write(DRATE, drate)
        for _ in range(4 * CALIBRATIONS):
            chip.fall()
            chip.send(SELFCAL)
            chip.adc.run_until_level("DRDY", 0)
            word = chip.read(OFC, 6)
            found.append((int.from_bytes(word[:3], "little", signed=True), int.from_bytes(word[3:], "little")))
    return np.array(found, float)


def test_fsc_follows_the_table_of_rates(log: Mapping[Setting, Words]) -> None:
    """FSC of twelve rates is the table's times one gain error, of this chip at gain 1: 3 ppm, 14 counts."""
    for buffer in (False, True):
        found = np.array([np.median(log[drate, 1, buffer][:, 1]) / ideal for drate, ideal in IDEAL_FSC.items()])
        assert np.ptp(found) < 6e-6
        assert abs(found.mean() - 1.0) < 0.01


def test_the_models_fsc_is_the_same_table() -> None:
    """With the log's gain error the model has the log's words."""
    for drate, ideal in IDEAL_FSC.items():
        with Ads1256(noise_scale=0, cells_max=1, gain_error=-0.005551) as chip:
            chip.adc.run_until_level("DRDY", 0)
            chip.write(DRATE, drate)
            chip.fall()
            chip.send(SELFCAL)
            chip.adc.run_until_level("DRDY", 0)
            assert int.from_bytes(chip.read(OFC + 3, 3), "little") == pytest.approx(ideal * 1.005582, abs=2)


@pytest.mark.parametrize("drate", IDEAL_FSC)
def test_self_calibration_scatters_as_recorded(log: Mapping[Setting, Words], drate: int) -> None:
    """OFC and FSC, thirty calibrations a setting: within a factor of 2.2 each, of 1.6 in the mean of a rate."""
    logs = []
    for gain in (1, 2, 4, 8):
        model = calibrated(drate, gain).std(axis=0)
        ratio = np.array([spread(log[drate, gain, buffer]) / model for buffer in (False, True)])
        if (drate, gain) in FSC_JUMPS:
            ratio[:, 1] = np.nan
        logs.append(np.log(ratio))
    assert np.nanmax(np.abs(logs)) < np.log(2.25)
    assert np.abs(np.nanmean(logs, axis=(0, 1))).max() < np.log(1.6)


def test_a_high_ofc_comes_with_a_high_fsc(log: Mapping[Setting, Words]) -> None:
    """Both measure zero: their errors are correlated, in the recording as in the model."""
    for gain in (1, 2, 4, 8):
        for words in (log[0xD0, gain, True], calibrated(0xD0, gain)):
            ofc, fsc = np.diff(words, axis=0).T
            assert 0.4 < float(np.mean(ofc * fsc) / (ofc.std() * fsc.std())) < 0.98


def test_the_mean_of_ofc_moves_with_gain(log: Mapping[Setting, Words]) -> None:
    """By 60 counts from gain 1 to 8: an offset at the input and one behind it; the model has the first, `offset_v`."""
    recorded = [float(np.median(log[0xA1, gain, False][:, 0])) for gain in (1, 8)]
    assert 45 < recorded[1] - recorded[0] < 75
    model = [float(np.median(calibrated(0xA1, gain, offset_v=10.9e-6)[:, 0])) for gain in (1, 8)]
    assert model[1] - model[0] == pytest.approx(recorded[1] - recorded[0], abs=5)
