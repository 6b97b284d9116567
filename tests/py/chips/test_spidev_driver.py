"""A second stranger's driver on our chip: ads1256 0.2.0 from PyPI, unmodified, through examples/spidev_shim.py.

It was written by other people than pipyadc, for Linux's spidev and gpiod, and leaves the chip's gaps to the time that
system calls take. The chip is in its strict moods: what comes too early is garbled or lost, and counted.
"""

from __future__ import annotations

import base64
import hashlib
import statistics
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import distribution
from typing import Any

import pytest
import spidev_shim
from psabench.chips import Bench, Part

SEED = 2026
VREF_V = 2.5
LSB_V = 2 * VREF_V / (2**23 - 1)
WIRING = {22: "DRDY", 27: "SYNC", 21: "CS"}  # the driver's defaults
BREACHES = ("bad_opcodes", "gap_violations", "sclk_violations", "din_violations", "dropped", "bad_access", "refused")
# Published: DRATE, samples a second, rms noise at gain 1 in volts, self-calibration in ms (sources 2.2, 2.7, 2.8).
RATES = [
    ("DRATE_30000", 30000, 10.73e-6, 0.596),
    ("DRATE_1000", 1000, 2.93e-6, 3.6),
    ("DRATE_100", 100, 0.875e-6, 31.2),
]
each_rate = pytest.mark.parametrize(("name", "sps", "noise_v", "self_ms"), RATES, ids=["30000", "1000", "100"])


@dataclass(frozen=True, slots=True)
class Rig:
    """The driver, its constants, the chip and the bench."""

    bench: Bench
    chip: Part
    adc: Any
    names: Any


@contextmanager
def driver(*, call_s: float = 10e-6, breaches: Sequence[str] = (), strict_bus: bool = True) -> Iterator[Rig]:
    """The driver on a chip with errors to calibrate. Counters of breaches that are not named must stay zero."""
    with Bench(SEED) as bench:
        chip = bench.part(
            "ads1256",
            name="adc",
            vref_v=VREF_V,
            offset_v=2e-3,
            gain_error=0.01,
            strict_timing=True,
            strict_bus=strict_bus,
        )
        module = spidev_shim.load("ads1256.ads1256", spidev_shim.Machine(chip, WIRING, call_s))
        yield Rig(bench, chip, module.ADS1256(), module.ADSC)
        counted = {k: n for k, n in chip.counters.items() if k in BREACHES and (n > 0) != (k in breaches)}
        assert counted == {}


def test_it_is_the_package_from_pypi_and_nothing_of_it_is_changed() -> None:
    package = distribution("ads1256")
    assert package.version == "0.2.0"
    checked = 0
    for file in package.files or []:
        if file.hash and file.suffix == ".py":
            digest = hashlib.new(file.hash.mode, file.read_binary()).digest()
            assert base64.urlsafe_b64encode(digest).rstrip(b"=").decode() == file.hash.value, file
            checked += 1
    assert checked == 3


def test_identity_and_every_register() -> None:
    """Written and read back through the driver, beside what the chip has; bits that are read-only keep their level."""
    with driver() as rig:
        assert rig.adc.read_chip_id() == 3
        assert [rig.adc.read_register(a) for a in range(1, 5)] == [0x01, 0x00, 0xF0, 0xE0]  # ADCON: set_gain(1)
        written = {0: 0x02, 1: 0x38, 2: 0x45, 3: 0xA1, 4: 0xF0} | dict.fromkeys(range(5, 11), 0x5A)
        for address, value in written.items():
            rig.adc.write_register(address, value)
            found = rig.adc.read_register(address)
            assert found == rig.chip.peek(address)
            assert found & (0x0E if address == 0 else 0xF0 if address == 4 else 0xFF) == value


@each_rate
def test_every_rate_reads_the_voltage_with_the_published_noise(
    name: str, sps: int, noise_v: float, self_ms: float
) -> None:
    with driver() as rig:
        rig.adc.set_data_rate(getattr(rig.names, name))
        began_ns = rig.bench.now_ns
        rig.adc.self_calibration()
        assert (rig.bench.now_ns - began_ns) / 1e6 == pytest.approx(self_ms, rel=0.02, abs=0.06)
        rig.chip.set_volts(0, 1.0)
        rig.adc.set_input(rig.names.POS_AIN0, rig.names.NEG_AINCOM)
        volts = []
        for _ in range(60):
            rig.adc.sync()
            began_ns = rig.bench.now_ns
            volts.append(rig.adc.read_voltage())
            assert 0.18 + 1e3 / sps < (rig.bench.now_ns - began_ns) / 1e6 < 0.28 + 1e3 / sps
        assert statistics.fmean(volts) == pytest.approx(1.0, abs=6 * noise_v + 2e-6)
        assert statistics.stdev(volts) == pytest.approx(noise_v, rel=5 / (2 * 60) ** 0.5)


def test_gains_and_inputs() -> None:
    with driver() as rig:
        rig.adc.set_data_rate(rig.names.DRATE_1000)
        for n, volts in enumerate((0.030, 0.010)):
            rig.chip.set_volts(n, volts)
        for gain in (1, 2, 4, 8, 16, 32, 64):
            rig.adc.set_gain(gain)
            rig.adc.self_calibration()
            for inputs, due_v in (
                ((rig.names.POS_AIN0, rig.names.NEG_AINCOM), 0.030),
                ((rig.names.POS_AIN0, rig.names.NEG_AIN1), 0.020),
                ((rig.names.POS_AIN1, rig.names.NEG_AIN0), -0.020),
            ):
                rig.adc.set_input(*inputs)
                rig.adc.sync()
                assert rig.adc.read_voltage() == pytest.approx(due_v, abs=6 * 1.5 * 2.93e-6 + LSB_V)


# ---- what the driver leaves to luck


def test_without_sync_the_first_word_is_of_the_old_channel_as_its_help_says() -> None:
    with driver() as rig:
        rig.adc.set_data_rate(rig.names.DRATE_1000)
        rig.adc.self_calibration()
        rig.chip.set_volts(0, 1.0)
        rig.chip.set_volts(1, 2.0)
        rig.adc.set_input(rig.names.POS_AIN0, rig.names.NEG_AINCOM)
        rig.adc.sync()
        rig.adc.read_value()
        rig.bench.run_for(1.05e-3)  # the next word waits
        rig.adc.set_input(rig.names.POS_AIN1, rig.names.NEG_AINCOM)
        assert rig.adc.read_voltage() == pytest.approx(1.0, abs=1e-4)
        rig.adc.sync()
        assert rig.adc.read_voltage() == pytest.approx(2.0, abs=1e-4)


def test_t6_is_left_to_the_time_that_a_system_call_takes() -> None:
    """50 clocks are 6.51 us between RREG and its byte: with calls of 3 us a strict chip answers FFh, and the driver
    takes the chip for another part and ends the program."""
    with pytest.raises(SystemExit), driver(call_s=3e-6):
        pass
    with driver(call_s=7e-6) as rig:
        assert rig.adc.read_chip_id() == 3


def test_a_write_that_starts_a_calibration_is_not_waited_for() -> None:
    """With ACAL on, a change of the buffer calibrates: what the driver asks next is lost on a strict chip."""
    with driver(breaches=["gap_violations", "dropped"]) as rig:
        rig.adc.write_register(rig.names.REG_STATUS, rig.names.AUTOCAL_ENABLE | rig.names.BUFFER_ENABLE)
        assert rig.adc.read_chip_id() != 3
        rig.adc.wait_for_data_ready_low()
        assert rig.adc.read_chip_id() == 3


def test_setting_the_gain_switches_the_clock_output_off() -> None:
    """ADCON is written as a whole: CLK1..0, 01 after a reset, become 00."""
    with driver() as rig:
        rig.adc.write_register(rig.names.REG_ADCON, rig.names.CLKOUT_EQUAL)
        rig.adc.set_gain(4)
        assert rig.chip.peek(rig.names.REG_ADCON) == 0x02
