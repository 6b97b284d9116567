"""A chip of libpsabench on a bench that records its pins, and the ruler for what the recording shows.

Drivers here know the parts' commands and pins, nothing of the model. Times are read from the VCD file and compared in
exact rational arithmetic: edge k of a clock lies at k / hz seconds, and a recorded instant is a whole nanosecond at or
up to one nanosecond before the true one.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray
from psabench.chips import Bench, Part
from psabench.link.vcd import Vcd, read_vcd
from scipy import stats

NS_PER_S = 10**9


@dataclass(frozen=True, slots=True)
class Clock:
    """The oscillator of a part: edge 0 at simulated time 0."""

    hz: int

    def edge_ns(self, count: int) -> Fraction:
        return Fraction(count * NS_PER_S, self.hz)

    def count_from(self, t_ns: int) -> int:
        """The first edge that does not come before t_ns."""
        return -(-t_ns * self.hz // NS_PER_S)

    def clocks(self, from_ns: int, to_ns: int) -> Fraction:
        """From the first edge at or after from_ns to an instant, in clock periods."""
        return (to_ns - self.edge_ns(self.count_from(from_ns))) * self.hz / NS_PER_S

    def complaint(self, what: str, from_ns: int, to_ns: int, clocks: int, within: int | Fraction = 0) -> str:
        """'' if to_ns is that many clocks after the first edge from from_ns on, to the nanosecond that the recording
        rounds off (`within`: clocks more either way, where the printed figure is rounded); else one line."""
        found = self.clocks(from_ns, to_ns)
        if abs(found - clocks) <= within + Fraction(self.hz, NS_PER_S):
            return ""
        return f"{what}: {float(found):.3f} clocks from {from_ns} ns to {to_ns} ns, the figure is {clocks}"


class Recording:
    """What the pins did."""

    def __init__(self, vcd: Vcd) -> None:
        self.vcd = vcd

    def edges_ns(self, pin: str, level: int) -> list[int]:
        """Instants at which a pin went to a level."""
        return [int(t) for t in self.vcd.wires[pin].edges_ns(level)]

    def nth_ns(self, pin: str, level: int, from_ns: int, n: int = 1) -> int:
        """The n-th change to a level at or after from_ns."""
        found = [t for t in self.edges_ns(pin, level) if t >= from_ns]
        assert len(found) >= n, f"{pin} goes to {level} {len(found)} times after {from_ns} ns, {n} wanted"
        return found[n - 1]

    def between_ns(self, pin: str, level: int, from_ns: int, to_ns: int) -> list[int]:
        """Changes to a level in from_ns < t < to_ns."""
        return [t for t in self.edges_ns(pin, level) if from_ns < t < to_ns]

    def level(self, pin: str, t_ns: int) -> int:
        """With an edge at that very instant included."""
        return int(self.vcd.wires[pin].at(t_ns))


class Session:
    """One part, all pins recorded from power-up on unless `path` is None; ends with `close()` or its `with`."""

    def __init__(self, part: str, path: Path | None, *, seed: int = 1, **options: float | str | bool) -> None:
        self.bench = Bench(seed=seed)
        self.adc: Part = self.bench.part(part, name="adc", **options)
        self.path = path
        if path:
            self.bench.vcd(path)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.bench.close()

    @property
    def now_ns(self) -> int:
        return self.bench.now_ns

    def wait_ns(self, dt_ns: int) -> None:
        self.bench.run_until_ns(self.bench.now_ns + dt_ns)

    def pin(self, name: str, level: int) -> int:
        """Sets a pin; when."""
        self.adc.pins[name].set(level)
        return self.bench.now_ns

    def pulse(self, name: str, level: int, width_ns: int) -> int:
        """Sets a pin, and back after width_ns; when it went back."""
        self.pin(name, level)
        self.wait_ns(width_ns)
        return self.pin(name, 1 - level)

    def fall(self, timeout_s: float = 10.0) -> int:
        """Waits for the next fall of DRDY; when."""
        self.adc.run_until_level("DRDY", 1, timeout_s)
        self.adc.run_until_level("DRDY", 0, timeout_s)
        return self.bench.now_ns

    def recording(self) -> Recording:
        """Ends the recording and reads it."""
        assert self.path
        self.bench.vcd_close()
        return Recording(read_vcd(self.path))


class Ads1282(Session):
    """ADS1281/ADS1282: mode 0, no chip select, 24 clocks between bytes."""

    SCLK_HZ = 1_000_000
    GAP_NS = 6_000  # 24 tCLK are 5.86 us at 4.096 MHz

    def __init__(
        self, path: Path | None = None, part: str = "ads1282", *, seed: int = 1, **options: float | str | bool
    ) -> None:
        super().__init__(part, path, seed=seed, **options)
        self.adc.spi_clock(self.SCLK_HZ, self.GAP_NS / NS_PER_S)

    @classmethod
    def ready(cls, path: Path, **options: float) -> Self:
        """A part that has been switched on and gives words, without noise."""
        s = cls(path, "ads1282", seed=1, noise_scale=0, **options)
        s.adc.run_until_level("DRDY", 0)
        return s

    def send(self, *data: int) -> tuple[int, bytes]:
        """A gap, then bytes; when the first began, and what came back."""
        self.wait_ns(self.GAP_NS)
        begin_ns = self.now_ns
        return begin_ns, self.adc.spi(bytes(data))

    def write(self, address: int, *values: int) -> int:
        return self.send(0x40 | address, len(values) - 1, *values)[0]

    def read(self, address: int, count: int = 1) -> bytes:
        """RREG; the part must be in SDATAC."""
        return self.send(0x20 | address, count - 1, *[0] * count)[1][2:]

    def word(self) -> int:
        """The 32 bits at DRDY, signed."""
        return int.from_bytes(self.adc.spi(bytes(4)), "big", signed=True)

    def words(self, count: int) -> list[int]:
        """The next ones."""
        found = []
        for _ in range(count):
            self.fall()
            found.append(self.word())
        return found


class Ads1256(Session):
    """ADS1255/ADS1256: mode 1, chip select, t6 and t11 kept with some room."""

    SCLK_HZ = 1_000_000
    T6_NS = 7_000  # 50 tau are 6.51 us at 7.68 MHz
    T11_NS = 4_000  # 24 tau are 3.13 us

    def __init__(
        self, path: Path | None = None, part: str = "ads1256", *, seed: int = 1, **options: float | str | bool
    ) -> None:
        super().__init__(part, path, seed=seed, **options)
        self.adc.spi_clock(self.SCLK_HZ)
        self.pin("CS", 0)

    def send(self, *data: int) -> int:
        """t11, then a command; when its first bit began."""
        self.wait_ns(self.T11_NS)
        begin_ns = self.now_ns
        self.adc.spi(bytes(data))
        return begin_ns

    def write(self, address: int, *values: int) -> int:
        return self.send(0x50 | address, len(values) - 1, *values)

    def read(self, address: int, count: int = 1) -> bytes:
        self.send(0x10 | address, count - 1)
        self.wait_ns(self.T6_NS)
        return self.adc.spi(bytes(count))

    def rdata(self) -> int:
        """A code with RDATA."""
        self.send(0x01)
        self.wait_ns(self.T6_NS)
        return int.from_bytes(self.adc.spi(bytes(3)), "big", signed=True)

    def codes(self, count: int) -> list[int]:
        """One at each of the next falls of DRDY."""
        found = []
        for _ in range(count):
            self.fall()
            found.append(self.rdata())
        return found


class Ad7712(Session):
    """AD7710 family: frames of RFS and TFS, bit by bit as the article's controller has them."""

    A0_NS = 400
    FIRST_NS = 700  # RFS to the first rise of SCLK
    HALF_NS = 400  # of SCLK
    LAST_NS = 500  # last fall to RFS or TFS high

    def __init__(
        self, path: Path | None = None, part: str = "ad7712", *, seed: int = 1, **options: float | str | bool
    ) -> None:
        super().__init__(part, path, seed=seed, **options)

    def begin(self, frame: str, a0: int, a0_ns: int | None = None) -> int:
        """A0, then RFS or TFS low; when."""
        self.pin("A0", a0)
        self.wait_ns(self.A0_NS if a0_ns is None else a0_ns)
        return self.pin(frame, 0)

    def end(self, frame: str) -> int:
        self.wait_ns(self.LAST_NS)
        at_ns = self.pin(frame, 1)
        self.wait_ns(self.LAST_NS)
        return at_ns

    def bits(self, count: int) -> int:
        """Pulses of SCLK; what SDATA says at their rises. Ends with the last fall."""
        value = 0
        for i in range(count):
            if i:
                self.wait_ns(self.HALF_NS)
            self.pin("SCLK", 1)
            value = value << 1 | self.adc.pins["SDATA"].level
            self.wait_ns(self.HALF_NS)
            self.pin("SCLK", 0)
        return value

    def read(self, a0: int = 1, count: int = 24) -> int:
        self.begin("RFS", a0)
        self.wait_ns(self.FIRST_NS)
        value = self.bits(count)
        self.end("RFS")
        return value

    def write(self, word: int, a0: int = 0) -> int:
        """24 bits, data with the falls of SCLK; when the last of them fell."""
        self.begin("TFS", a0)
        for i in range(24):
            self.pin("SDATA", word >> (23 - i) & 1)
            self.wait_ns(self.HALF_NS)
            self.pin("SCLK", 1)
            self.wait_ns(self.HALF_NS)
            self.pin("SCLK", 0)
        last_ns = self.now_ns
        self.end("TFS")
        self.pin("SDATA", 0)
        return last_ns


def no_complaints(lines: Iterable[str]) -> None:
    """Fails with the first complaints there are."""
    found = [line for line in lines if line]
    assert not found, "\n".join([f"{len(found)}:", *found[:12]])


def amplitude(words: NDArray[np.float64], f: float) -> complex:
    """Of a sine at f, in units of the word rate, by least squares."""
    k = np.arange(len(words))
    design = np.column_stack((np.cos(2 * np.pi * f * k), -np.sin(2 * np.pi * f * k)))
    (re, im), *_ = np.linalg.lstsq(design, words, rcond=None)
    return complex(re, im)


def chi_square_is_inside(sum_of_squares: float, freedom: float) -> bool:
    """Two-sided, one part in a thousand on either side. Seeds are fixed: what passes once passes always."""
    return bool(1e-3 < stats.chi2.cdf(sum_of_squares, freedom) < 1 - 1e-3)
