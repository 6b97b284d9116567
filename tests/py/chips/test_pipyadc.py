"""A stranger's driver on our chip: pipyadc 2.1 from PyPI, unmodified, through examples/pigpio_shim.py.

Expected codes, registers and durations are computed here from the published formulas and tables
(docs/chips/ads1256.md); noise is on, from a fixed seed, and the bands are those of the published figures. The chip is
in its strict moods: a read that comes too early is garbled, and every breach of a gap is counted and has its effect.
"""

from __future__ import annotations

import base64
import hashlib
import math
import statistics
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import distribution
from types import SimpleNamespace
from typing import Any

import pigpio_shim
import pytest
from psabench.chips import Bench, Part, ads1256_volts

SEED = 2022
VREF_V = 2.5
LSB_V = 2 * VREF_V / 2**23
OFFSET_V, GAIN_ERROR = 2e-3, 0.01  # of the uncalibrated chip
AINCOM = 8
BYTES_MS = 0.015  # a command, its pauses and the polling, on top of what it starts
WIRING = {17: "DRDY", 18: "RESET", 22: "CS", 27: "SYNC"}  # the Waveshare board, the driver's default
BUFEN, ACAL = 0x02, 0x04
# Counters of breaches. Not ro_write: STATUS is written as a whole byte, its ID too, and all drivers do it.
BREACHES = set(
    "torn_reads window_reads bad_mux cal_clamped bad_opcodes refused bad_drate gap_violations sclk_violations "
    "din_violations dropped bad_access unimp_access".split()
)


@dataclass(frozen=True, slots=True)
class Rate:
    """A row of the published tables, gain 1."""

    drate: int
    noise_v: float  # rms, input-referred
    alpha: int
    ideal_fsc: int
    self_offset_ms: float  # system offset as well
    self_gain_ms: float  # system gain as well
    self_ms: float


SPS_30000 = Rate(0xF0, 10.73e-6, 0x400000, 0x44AC08, 0.387, 0.417, 0.596)
SPS_1000 = Rate(0xA1, 2.93e-6, 0x3C0000, 0x494008, 2.3, 2.4, 3.6)
SPS_100 = Rate(0x82, 0.875e-6, 0x4B0000, 0x3A99A0, 20.3, 21.0, 31.2)
RATES = [SPS_30000, SPS_1000, SPS_100]
each_rate = pytest.mark.parametrize("rate", RATES, ids=["30000 SPS", "1000 SPS", "100 SPS"])


@dataclass(frozen=True, slots=True)
class Rig:
    """The driver, the chip it drives, and the bench that both are on."""

    bench: Bench
    chip: Part
    ads: Any

    def set_volts(self, **volts: float) -> None:
        """set_volts(ain0=1.0, aincom=0.5)."""
        for name, value in volts.items():
            self.chip.set_volts(AINCOM if name == "aincom" else int(name.removeprefix("ain")), value)

    def duration_ms(self, command: Callable[[], object]) -> float:
        """Simulated time that a call of the driver takes."""
        began_ns = self.bench.now_ns
        command()
        return (self.bench.now_ns - began_ns) / 1e6


@contextmanager
def driver(
    rate: Rate = SPS_1000, *, strict_bus: bool = True, breaches: Sequence[str] = (), **conf: Any
) -> Iterator[Rig]:
    """pipyadc with its own configuration but for the rate and what is named, on an ADS1256 with errors to calibrate.

    Counters of breaches that are not named must be zero in the end, and those that are must not."""
    with Bench(SEED) as bench:
        chip = bench.part(
            "ads1256",
            name="adc",
            vref_v=VREF_V,
            offset_v=OFFSET_V,
            gain_error=GAIN_ERROR,
            strict_timing=True,
            strict_bus=strict_bus,
        )
        package = pigpio_shim.load("pipyadc", pigpio_shim.Pi(chip, WIRING))
        polling = {"DRDY_DELAY": 20e-6} if rate is SPS_100 else {}  # its microsecond costs us some in real time
        settings = {**vars(package.pipyadc.ADS1256_default_config), "drate": rate.drate, **polling, **conf}
        with package.ADS1256(SimpleNamespace(**settings)) as ads:
            yield Rig(bench, chip, ads)
        counters = chip.counters
        assert counters.keys() >= BREACHES
        assert {k: n for k, n in counters.items() if k in BREACHES and (n > 0) != (k in breaches)} == {}


def in_band(codes: list[int], volts: float, rate: Rate, extra_v: float = 0.0) -> None:
    """Each code within 6 sigma of the voltage: the word's own noise and that of the word a calibration took away."""
    limit_v = 6 * math.sqrt(2) * rate.noise_v + LSB_V + 1e-6 * abs(volts) + extra_v
    for code in codes:
        error_v = ads1256_volts(code, vref_v=VREF_V) - volts
        assert abs(error_v) < limit_v, f"{error_v:g} V off {volts} V, limit {limit_v:g} V, seed {SEED}"


# ---- what runs


def test_it_is_the_package_from_pypi_and_nothing_of_it_is_changed() -> None:
    package = distribution("pipyadc")
    assert package.version == "2.1"
    checked = 0
    for file in package.files or []:
        if file.hash is not None:
            digest = hashlib.new(file.hash.mode, file.read_binary()).digest()
            assert base64.urlsafe_b64encode(digest).rstrip(b"=").decode() == file.hash.value, file
            checked += 1
    assert checked >= 7
    with driver() as rig:
        assert not hasattr(sys.modules["pigpio"], "__file__")  # the real one has a file
        assert isinstance(rig.ads.pi, pigpio_shim.Pi)


def test_reset_identity_and_the_first_registers() -> None:
    with driver(drate=0x23) as rig:  # the driver's own default, 10 SPS
        assert rig.ads.chip_ID == 3
        assert [rig.chip.peek(a) for a in (1, 2, 3, 4)] == [AINCOM, 0x00, 0x23, 0x00]
        assert rig.chip.peek(0) & (BUFEN | ACAL) == BUFEN
        assert (rig.ads.mux, rig.ads.adcon, rig.ads.drate) == (AINCOM, 0, 0x23)
        assert rig.ads.status & ~1 == 0x30 | BUFEN
        rig.ads.reset()
        assert [rig.chip.peek(a) for a in (1, 2, 3, 4)] == [0x01, 0x00, 0xF0, 0xE0]  # CLK1..0 survive the command
        rig.ads.drate = 0xA1
        rig.ads.hard_reset()
        assert [rig.chip.peek(a) for a in (1, 2, 3, 4)] == [0x01, 0x20, 0xF0, 0xE0]  # and not the pin


def test_the_reset_pin_at_start() -> None:
    with driver(CHIP_HARD_RESET_ON_START=True) as rig:
        assert rig.ads.chip_ID == 3
        assert rig.ads.drate == SPS_1000.drate


# ---- the five calibrations


@each_rate
def test_self_calibrations(rate: Rate) -> None:
    offset_lsb = rate.alpha * OFFSET_V / (2 * VREF_V)
    noise_lsb = rate.alpha * rate.noise_v / (2 * VREF_V)
    with driver(rate) as rig:
        rig.ads.mux = AINCOM << 4 | AINCOM  # a shorted input
        assert rig.duration_ms(rig.ads.cal_self_offset) == pytest.approx(rate.self_offset_ms, rel=0.02, abs=BYTES_MS)
        assert rig.ads.ofc == pytest.approx(offset_lsb, rel=2 * GAIN_ERROR, abs=6 * noise_lsb + 1)
        assert rig.duration_ms(rig.ads.cal_self_gain) == pytest.approx(rate.self_gain_ms, rel=0.02, abs=BYTES_MS)
        assert rig.ads.fsc == pytest.approx(rate.ideal_fsc / (1 + GAIN_ERROR), rel=1e-5)
        assert rig.duration_ms(rig.ads.cal_self) == pytest.approx(rate.self_ms, rel=0.02, abs=BYTES_MS)
        assert rig.ads.ofc == pytest.approx(offset_lsb, rel=2 * GAIN_ERROR, abs=6 * noise_lsb + 1)
        assert rig.ads.fsc == pytest.approx(rate.ideal_fsc / (1 + GAIN_ERROR), rel=1e-5)
        in_band(rig.ads.read_sequence([AINCOM << 4 | AINCOM] * 20), 0.0, rate)


@each_rate
def test_system_offset_calibration_makes_the_voltage_at_the_pins_zero(rate: Rate) -> None:
    with driver(rate) as rig:
        rig.ads.cal_self()
        rig.set_volts(ain0=0.010)
        rig.ads.sync()
        assert rig.duration_ms(rig.ads.cal_system_offset) == pytest.approx(rate.self_offset_ms, rel=0.02, abs=BYTES_MS)
        in_band(rig.ads.read_sequence([AINCOM] * 20), 0.0, rate)
        rig.set_volts(ain0=1.010)
        in_band(rig.ads.read_sequence([AINCOM] * 20), 1.0, rate)


@each_rate
def test_system_gain_calibration_makes_the_voltage_at_the_pins_full_scale(rate: Rate) -> None:
    with driver(rate, status=0) as rig:  # without the buffer, which ends 2 V below the supply
        rig.ads.cal_self()
        rig.set_volts(ain0=4.8)
        rig.ads.sync()
        assert rig.duration_ms(rig.ads.cal_system_gain) == pytest.approx(rate.self_gain_ms, rel=0.02, abs=BYTES_MS)
        assert rig.ads.fsc == pytest.approx(rate.ideal_fsc / (1 + GAIN_ERROR) * 5 / 4.8, rel=2e-5)
        rig.set_volts(ain0=2.4)
        in_band(rig.ads.read_sequence([AINCOM] * 20), 2.5, rate, extra_v=6 * rate.noise_v)


# ---- the reads


def test_every_read_returns_the_voltage() -> None:
    with driver() as rig:
        rig.ads.cal_self()
        rig.set_volts(ain0=1.25, ain3=-0.5, aincom=0.25)
        differential = 0 << 4 | 3
        single = 0 << 4 | AINCOM
        reads = {
            "oneshot": [rig.ads.read_oneshot(single)],
            "async": [rig.ads.read_async() for _ in range(5)],  # the channel is still selected
            "sequence": rig.ads.read_sequence([single, single]),
            "continue": rig.ads.read_continue([single]),
            "and_next_is": [rig.ads.read_and_next_is(single)],
        }
        for codes in reads.values():
            in_band(codes, 1.0, SPS_1000)
        # AIN3 below ground is outside the buffer's range, which ends there.
        in_band([rig.ads.read_oneshot(differential)], 1.25, SPS_1000)


@each_rate
def test_noise_is_the_published_one(rate: Rate) -> None:
    """Mean and deviation of N words: five standard errors either way."""
    count = 60 if rate is SPS_100 else 200
    with driver(rate) as rig:
        rig.ads.cal_self()
        rig.set_volts(ain0=1.0)
        volts = [ads1256_volts(code, vref_v=VREF_V) for code in rig.ads.read_sequence([AINCOM] * count)]
    deviation_v = statistics.stdev(volts)
    assert deviation_v == pytest.approx(rate.noise_v, rel=5 / math.sqrt(2 * count)), f"seed {SEED}"
    assert statistics.fmean(volts) == pytest.approx(1.0, abs=6 * rate.noise_v + LSB_V), f"seed {SEED}"


@each_rate
def test_the_channel_cycle_keeps_the_channels_apart(rate: Rate) -> None:
    volts = [2.5, 0.1, 2.4, 0.2, 2.3, 0.3, 2.2, 0.4]
    channels = [n << 4 | AINCOM for n in range(8)]
    with driver(rate) as rig:
        rig.ads.cal_self()
        rig.set_volts(**{f"ain{n}": v for n, v in enumerate(volts)})
        first = rig.ads.read_sequence(channels)
        cycles = [first, *(list(rig.ads.read_continue(channels)) for _ in range(2))]
        took_ms = rig.duration_ms(lambda: rig.ads.read_continue(channels)) / len(channels)
        for codes in cycles:
            for code, expected in zip(codes, volts, strict=True):
                in_band([code], expected, rate)
        sps = {SPS_30000: 30000, SPS_1000: 1000, SPS_100: 100}[rate]
        t18_ms = 0.18 + 1e3 / sps
        assert t18_ms < took_ms < t18_ms + 0.2  # settling, and the driver's bytes and pauses at 976 kHz


def test_gain_and_its_scale() -> None:
    with driver() as rig:
        rig.set_volts(ain0=0.030)
        for gain in (1, 2, 8, 64):
            rig.ads.pga_gain = gain
            assert rig.ads.pga_gain == gain
            rig.ads.cal_self()
            code = rig.ads.read_oneshot(AINCOM)
            assert code * rig.ads.v_per_digit == pytest.approx(0.030, abs=6 * SPS_1000.noise_v)


def test_auto_calibration_follows_the_changes_that_the_driver_makes() -> None:
    with driver() as rig:
        rig.ads.status = BUFEN | ACAL
        before = rig.chip.counters["calibrations"]
        rig.ads.drate = SPS_100.drate
        rig.ads.pga_gain = 4
        assert rig.chip.counters["calibrations"] == before + 2
        rig.set_volts(ain0=0.5)
        in_band([rig.ads.read_oneshot(AINCOM) // 4], 0.5, SPS_100)


# ---- what the driver does wrong


def test_it_reads_after_wakeup_without_the_wait_that_the_data_sheet_asks_for() -> None:
    """Nothing is to be sent after STANDBY and WAKEUP until DRDY falls; read_oneshot() sends WREG and SYNC at once, and
    the driver's own help says that it may. A lenient chip takes them."""
    with driver(strict_bus=False, breaches=["gap_violations"]) as rig:
        rig.set_volts(ain0=1.0)
        rig.ads.cal_self()
        rig.ads.standby()
        rig.bench.run_for(0.01)
        asleep = rig.chip.counters["conversions"]
        rig.bench.run_for(0.1)
        assert rig.chip.counters["conversions"] == asleep
        rig.ads.wakeup()
        assert rig.chip.counters["gap_violations"] == 0
        in_band([rig.ads.read_oneshot(AINCOM)], 1.0, SPS_1000)


def test_without_a_pis_pause_between_bytes_its_sync_follows_wreg_too_soon() -> None:
    """t11 is 4 clocks, 521 ns; half a period of the driver's 976563 Hz is 512 ns. A Pi's SPI waits a period more."""
    with driver(strict_bus=False, breaches=["gap_violations"]) as rig:
        rig.ads.read_oneshot(AINCOM)
        assert rig.chip.counters["gap_violations"] == 0
        rig.chip.spi_clock(976_563, gap_s=0.0)
        rig.ads.read_oneshot(AINCOM)
        assert rig.chip.counters["gap_violations"] == 1


def test_at_30000_a_second_its_clock_is_too_slow_for_words_that_nobody_holds() -> None:
    """RDATA, t6 and three bytes at 976563 Hz take 44 us, a conversion 33 us. In the channel cycle SYNC holds it."""
    with driver(SPS_30000, breaches=["torn_reads"]) as rig:
        rig.ads.sync()
        for _ in range(10):
            rig.ads.read_async()
        assert rig.chip.counters["torn_reads"] == 10


def test_its_calibration_registers_cannot_be_written_as_pigpio_takes_no_numbers_above_255() -> None:
    with driver() as rig, pytest.raises(ValueError, match=r"byte must be in range\(0, 256\)|bytes must be in range"):
        rig.ads.ofc = 1000
