"""A bare converter on a bench of its own, read by a host that takes its time: in time, or across the next word.

The library moves the pins (`psabench.chips`); the page shows their edges, what was read, and what the chip has counted.
A word that is replaced while it is read is torn: the host has bits of two words.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psabench.chips import Bench, Part
from psabench.errors import BenchError, expected
from psabench.link.vcd import Vcd, read_vcd
from psabench.report.drawing import Panel, Section, Tag, render

SETTLED = 80  # words before, so that the filters are; the ADS128x needs 62
PAUSE_S = 1e-5  # between the bytes of a host that reads them one by one, E0
PERIODS = 6.0  # of the output in one of the input's sine: neighbouring words differ in many bits
SCLK_HZ = (1e3, 2e6)  # the slowest and fastest that is offered
LATE_US = 1e6
MARGIN, MARGIN_S = 30, 1e-5  # part of the picture before and behind; recorded behind


@dataclass(frozen=True, slots=True, kw_only=True)
class Converter:
    """A part as a host reads it. take: reads one word with this frequency of SCLK."""

    bits: int
    input: int
    amplitude_v: float
    sclk_hz: float  # offered at first
    rows: tuple[str, ...]
    edge: int  # of SCLK at which a host takes a bit
    take: Callable[[Part, float], int]
    begin: Callable[[Part], None] = lambda _: None
    tear: Callable[[float, float], float] = lambda took_s, _: took_s / 2  # when its word is best replaced, s
    whole_bits: int = 8  # so many go on being of the old word when it is replaced: the byte that is under way
    hint: str = ""

    @property
    def data(self) -> str:
        return self.rows[-1]


def _spi_read(count: int) -> Callable[[Part, float], int]:
    def take(adc: Part, sclk_hz: float) -> int:
        adc.spi_clock(round(sclk_hz))
        return int.from_bytes(adc.spi(bytes(count)), "big")

    return take


def _read_continuously(adc: Part) -> None:
    """RDATAC, 03h: words follow without a command."""
    adc.pins["CS"].set(0)
    adc.run_until_level("DRDY", 0)
    adc.spi(b"\x03")


def _serial_frame(adc: Part, select: str, sclk_hz: float, out: list[int]) -> int:
    """Pulses of SCLK in a frame of RFS or TFS; returns what SDATA said at the rises."""
    half_s, word = 0.5 / sclk_hz, 0
    adc.pins[select].set(0)
    for bit in out:
        if select == "TFS":
            adc.pins["SDATA"].set(bit)
        adc.bench.run_for(half_s)
        adc.pins["SCLK"].set(1)
        word = word << 1 | adc.pins["SDATA"].level
        adc.bench.run_for(half_s)
        adc.pins["SCLK"].set(0)
    adc.bench.run_for(half_s)
    adc.pins[select].set(1)
    return word


def _calibrate_ad7712(adc: Part) -> None:
    """Control 228146h as in examples/ad7712_read.c: self-calibration, AIN2, 24 bits, 60 Hz."""
    adc.pins["A0"].set(0)
    _serial_frame(adc, "TFS", 1e6, [0x228146 >> k & 1 for k in range(23, -1, -1)])
    adc.run_until_level("DRDY", 1)
    adc.run_until_level("DRDY", 0)
    adc.pins["A0"].set(1)


def _byte_by_byte(adc: Part, sclk_hz: float) -> int:
    """Three frames of RFS: within one the chip holds its word (AD7712 data sheet, rev. F), between them it does not."""
    word = 0
    for k in range(3):
        adc.bench.run_for(PAUSE_S if k else 0.0)
        word = word << 8 | _serial_frame(adc, "RFS", sclk_hz, [0] * 8)
    return word


def _in_first_pause(_: float, sclk_hz: float) -> float:
    return 8.5 / sclk_hz + PAUSE_S / 2


_ADS128X = Converter(
    bits=32, input=0, amplitude_v=1.0, sclk_hz=1e6, rows=("DRDY", "SCLK", "DOUT"), edge=0, take=_spi_read(4),
    whole_bits=1, hint="reads on in the word that replaces its own",
)  # fmt: skip
CONVERTERS: Mapping[str, Converter] = {
    "ads1281": _ADS128X,
    "ads1282": _ADS128X,
    "ads1256": Converter(
        bits=24, input=0, amplitude_v=1.0, sclk_hz=1.92e6, rows=("DRDY", "SCLK", "DOUT"), edge=0, take=_spi_read(3),
        begin=_read_continuously, hint="RDATAC: the bytes that are left are those of the next word",
    ),
    "ad7712": Converter(
        bits=24, input=2, amplitude_v=4.0, sclk_hz=1e6, rows=("DRDY", "RFS", "SCLK", "SDATA"), edge=1,
        take=_byte_by_byte, begin=_calibrate_ad7712, tear=_in_first_pause,
        hint="read byte by byte: a word is held within a frame of RFS only",
    ),
}  # fmt: skip


def describe_converters() -> dict[str, Any]:
    """What the page offers."""
    return {name: {"sclk_hz": c.sclk_hz, "hint": c.hint} for name, c in CONVERTERS.items()}


@dataclass(frozen=True, slots=True)
class _Read:
    """One read: the word, when the one it began with came, how long it took."""

    word: int
    ready_ns: int
    took_ns: int


def read_converter(request: Mapping[str, Any]) -> dict[str, Any]:
    """The answer to a page: a word read late_us after DRDY, or across the next one. Raises BenchError."""
    name = str(request.get("part"))
    if name not in CONVERTERS:
        raise BenchError(expected(", ".join(CONVERTERS), repr(name[:40]), "part"))
    c = CONVERTERS[name]
    sclk_hz = _number_within(request, "sclk_hz", *SCLK_HZ)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "read.vcd"
        in_time, _ = _read_words(name, c, sclk_hz, 0, 2)
        period_ns = in_time[1].ready_ns - in_time[0].ready_ns
        late_ns = round(1e3 * _number_within(request, "late_us", 0.0, LATE_US))
        if request.get("across") is True:
            late_ns = max(0, period_ns - round(1e9 * c.tear(in_time[0].took_ns / 1e9, sclk_hz)))
        (late,), counted = _read_words(name, c, sclk_hz, late_ns, 1, path)
        torn = counted.get("torn_reads", 0)
        svg = _read_picture(name, c, read_vcd(path), late.ready_ns + period_ns, torn)
    words = {"read": late.word, "in_time": in_time[0].word, "next": in_time[1].word}
    shown = {key: f"{word:0{c.bits // 4}X}h" for key, word in words.items()}
    return {"svg": svg, **shown, "torn": torn, "counters": counted, "late_us": late_ns / 1e3,
            "period_us": period_ns / 1e3, "took_us": in_time[0].took_ns / 1e3}  # fmt: skip


def _number_within(request: Mapping[str, Any], key: str, low: float, high: float) -> float:
    value = request.get(key, low)
    if isinstance(value, bool) or not isinstance(value, int | float) or not low <= value <= high:
        raise BenchError(expected(f"{low:g} to {high:g}", repr(value)[:40], key))
    return float(value)


def _read_words(
    name: str, c: Converter, sclk_hz: float, late_ns: int, count: int, path: Path | None = None
) -> tuple[list[_Read], dict[str, int]]:
    """Words, each begun so late, and what the chip has counted of violations meanwhile. The same bench each time."""
    with Bench(seed=1) as bench:
        adc = bench.part(name)
        c.begin(adc)
        period_ns = _period_ns(adc, c, sclk_hz)
        adc.set_input(
            lambda n, t_ns: (
                c.amplitude_v * math.sin(2 * math.pi * t_ns / (PERIODS * period_ns)) if n == c.input else 0.0
            )
        )
        for _ in range(SETTLED):
            _next_word(adc)
            c.take(adc, sclk_hz)
        before, found = adc.violations, []
        for _ in range(count):
            ready_ns = _next_word(adc)
            if path is not None:
                bench.vcd(path)
            bench.run_for(late_ns / 1e9)
            begun_ns = bench.now_ns
            found.append(_Read(c.take(adc, sclk_hz), ready_ns, bench.now_ns - begun_ns))
        bench.run_for(MARGIN_S)
        if path is not None:
            bench.vcd_close()
        return found, {k: v - before[k] for k, v in adc.violations.items() if v > before[k]}


def _next_word(adc: Part) -> int:
    adc.run_until_edge("DRDY", "falling")
    return adc.bench.now_ns


def _period_ns(adc: Part, c: Converter, sclk_hz: float) -> int:
    first = _next_word(adc)
    c.take(adc, sclk_hz)
    return _next_word(adc) - first


def _read_picture(name: str, c: Converter, vcd: Vcd, next_ns: int, torn: int) -> str:
    """The edges of the late read; where the next word comes its bits are another word's."""
    at = vcd.wires["SCLK"].edges_ns(c.edge)
    half = int(np.median(np.diff(at))) // 2
    kept = -(-np.count_nonzero(at <= next_ns) // c.whole_bits) * c.whole_bits
    own = at[:kept] if torn else at
    tags = [
        Tag(c.data, int(part[0]) - half, int(part[-1]) + half, f"{part.size} bits of {words}")
        for part, words in ((own, "the word"), (at[own.size :], "the next word"))
        if part.size
    ]
    margin = int(at[-1] - at[0]) // MARGIN + half
    section = Section(int(at[0]) - margin, int(at[-1]) + margin, int(at[0]))
    title = f"{name.upper()}: {'torn, bits of two words' if torn else 'a whole word'}"
    return render(vcd, (Panel(c.rows, (section,), tags),), title)
