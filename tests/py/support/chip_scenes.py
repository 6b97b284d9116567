"""Scenes for the golden traces of single chips: what a driver does with one, recorded by libpsabench.

A scene gets the path of its recording, drives one part through it and returns; tests/golden/manifest.toml says what to
look at. Noise is off, the inputs are constant.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from chip_bench import Ads1256, Ads1282


def ads1282(path: Path, config0: int) -> Ads1282:
    """A part that has settled at a rate, with -1.18 V of 2.5 V at its input."""
    s = Ads1282(path, "ads1282", seed=1, noise_scale=0, power_up_tclk=0)
    s.adc.set_volts(0, -1.1844)
    s.write(1, config0)
    s.fall()
    return s


def ads1282_rdatac(path: Path) -> None:
    """Three words at 4000 SPS: read whole, read to 24 bits, not read."""
    with ads1282(path, 0x66) as s:
        s.fall()
        s.word()
        s.fall()
        s.adc.spi(bytes(3))
        s.fall()
        s.fall()


def ads1282_tear(path: Path) -> None:
    """The input changes sign; a read begins 24 bits before the new word."""
    with ads1282(path, 0x66) as s:
        s.words(70)
        s.adc.set_volts(0, 1.1844)
        s.words(8)
        s.fall()
        s.adc.spi_clock(s.SCLK_HZ)
        s.wait_ns(250_000 - 24_400)
        s.word()
        s.wait_ns(100_000)


def ads1282_continuous(path: Path) -> None:
    """Continuous synchronisation at 4000 SPS: SYNC after 8 data periods changes nothing, after 8.5 it restarts."""
    with ads1282(path, 0xE6) as s:
        s.pulse("SYNC", 1, 1_000)
        begin_ns = s.now_ns - 1_000
        for periods in (80, 88, 96.5, 104.5):
            s.bench.run_until_ns(begin_ns + round(periods * 250_000))
            s.pulse("SYNC", 1, 1_000)
        s.wait_ns(17_000_000)


def ads1282_rdata(path: Path) -> None:
    """SDATAC, RREG of CONFIG0 and CONFIG1, then one word by RDATA."""
    with ads1282(path, 0x66) as s:
        s.send(0x11)
        s.read(1, 2)
        s.fall()
        s.wait_ns(30_000)
        s.send(0x12)
        s.adc.run_until_level("DRDY", 0)
        s.word()
        s.wait_ns(300_000)


def ads1256(path: Path) -> Ads1256:
    """A part that has calibrated itself after power-up; AIN0 and AIN2 above AIN1."""
    s = Ads1256(path, "ads1256", seed=1, noise_scale=0, start="at_once")
    for ain, volts in enumerate((3.2111, 2.5, 1.7222, 2.5)):
        s.adc.set_volts(ain, volts)
    s.adc.run_until_level("DRDY", 0)
    return s


def ads1256_selfcal(path: Path) -> None:
    """DRATE to 1000 SPS, SELFCAL, OFC and FSC read back."""
    with ads1256(path) as s:
        s.write(3, 0xA1)
        s.send(0xF0)
        s.fall()
        s.read(5, 6)
        s.wait_ns(20_000)


def ads1256_cycle(path: Path) -> None:
    """The channel cycle: at each DRDY the next MUX, SYNC, WAKEUP, then RDATA of the word of the channel before."""
    with ads1256(path) as s:
        s.write(3, 0xD0)
        s.fall()
        for mux in (0x23, 0x01, 0x23):
            s.write(1, mux)
            s.send(0xFC)
            s.send(0x00)
            s.rdata()
            s.adc.run_until_level("DRDY", 0)


def ads1256_rdatac(path: Path) -> None:
    """RDATAC, three words without a command, SDATAC inside the last."""
    with ads1256(path) as s:
        s.write(3, 0xD0)
        s.fall()
        s.send(0x03)
        s.wait_ns(s.T6_NS)
        s.adc.spi(bytes(3))
        for data in (bytes(3), b"\0\x0f\0"):
            s.fall()
            s.adc.spi(data)
        s.fall()
        s.adc.spi(bytes(3))
        s.wait_ns(20_000)


def ads1256_pattern(path: Path) -> None:
    """DRATE to 500 SPS, then the reset pattern of SCLK: 307, 550, 1050 tau high."""
    with ads1256(path) as s:
        s.write(3, 0x92)
        s.wait_ns(100_000)
        for high_tau in (307, 550, 1050):
            s.pin("SCLK", 1)
            s.wait_ns(high_tau * 1_000_000 // 7680)
            s.pin("SCLK", 0)
            s.wait_ns(1_000)
        s.fall()
        s.read(3)
        s.wait_ns(20_000)


SCENES: dict[str, Callable[[Path], None]] = {
    scene.__name__: scene
    for scene in (
        ads1282_rdatac,
        ads1282_tear,
        ads1282_continuous,
        ads1282_rdata,
        ads1256_selfcal,
        ads1256_cycle,
        ads1256_rdatac,
        ads1256_pattern,
    )
}
