"""Pictures of PSD-1's cycle of reading, every interval dimensioned as the recording has it (sources 4.5)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psabench.errors import expected
from psabench.link.vcd import Vcd
from psabench.report.drawing import Dim, Panel, Section, Tag, need, render

ROWS = ("CLK_1M25", "DR", "A0", "RFX", "RFY", "RFZ", "SCLK", "SDAT", "FL2", "CS")


@dataclass(frozen=True, slots=True)
class _Transfer:
    """Instants of one word, ns."""

    rf: str
    rf_fall: int
    rf_rise: int
    rises: list[int]  # of SCLK
    falls: list[int]
    fl2_fall: int
    cs_fall: int
    cs_rise: int
    word: int


def _next(vcd: Vcd, line: str, level: int, t_ns: int) -> int:
    """The first change to a level at or after an instant. Raises ValueError."""
    edges = vcd.wires[line].edges_ns(level)
    later = edges[edges >= t_ns]
    if later.size == 0:
        raise ValueError(expected(f"a whole cycle: a change to {level} after {t_ns} ns", "none", line))
    return int(later[0])


def _transfer(vcd: Vcd, rf: str, from_ns: int) -> _Transfer:
    fall = _next(vcd, rf, 0, from_ns)
    rise = _next(vcd, rf, 1, fall)
    sclk = vcd.wires["SCLK"]
    rises, falls = (t[(t > fall) & (t < rise)].tolist() for t in (sclk.edges_ns(1), sclk.edges_ns(0)))
    if len(rises) != 16:
        raise ValueError(expected("16 pulses of SCLK in a low", len(rises), rf))
    bits = vcd.wires["SDAT"].at(np.array(rises)).tolist()
    cs = _next(vcd, "CS", 0, rise)
    word = int("".join(map(str, bits)), 2)
    return _Transfer(rf, fall, rise, rises, falls, _next(vcd, "FL2", 0, cs), cs, _next(vcd, "CS", 1, cs), word)


def _cycle(vcd: Vcd) -> tuple[int, list[_Transfer]]:
    """The first whole cycle: rise of A0, its transfers. Raises ValueError."""
    need(vcd, set(ROWS))
    a0 = _next(vcd, "A0", 1, vcd.start_ns + 1)
    ready = _next(vcd, "FL2", 1, a0)  # in the set-up coefficients are read with A0 high, but offered to no one
    a0 = int([t for t in vcd.wires["A0"].edges_ns(1).tolist() if t < ready][-1])
    transfers, at = [], a0
    for rf in ("RFX", "RFY", "RFZ"):
        transfers.append(_transfer(vcd, rf, at))
        at = transfers[-1].fl2_fall
    return a0, transfers


def _words(transfers: list[_Transfer]) -> list[Tag]:
    half = 400
    return [
        Tag("SDAT", t.rises[0] - half, t.rises[-1] + half, f"{t.rf[2]} = {t.word - 0x8000} ({t.word:04X}h)")
        for t in transfers
    ]


def cycle_picture(vcd: Vcd) -> str:
    """The first whole cycle, and its beginning nearer. Raises ValueError."""
    a0, transfers = _cycle(vcd)
    x = transfers[0]
    end = _next(vcd, "A0", 0, a0)
    whole = Section(a0 - 1500, end + 1500, a0)
    dims = [Dim(t.rf, t.rf_fall, t.rf, t.rf_rise, " = 17 periods", 0) for t in transfers]
    dims += [Dim("FL2", t.rf_rise, "FL2", t.fl2_fall, "", 1) for t in transfers]
    dims.append(Dim("A0", a0, "A0", end, " in all; as short as 43 600 ns with a host that reads at once", 2))
    dr = int(vcd.wires["DR"].edges_ns(0)[vcd.wires["DR"].edges_ns(0) <= a0][-1])
    msb, fall = x.rf_fall + 400, x.falls[0]
    sdat = vcd.wires["SDAT"].t_ns
    first = sdat[(sdat > x.rf_fall) & (sdat <= msb)]
    bits = sdat[(sdat > fall) & (sdat <= fall + 220)]
    near = Section(
        dr - 400, x.falls[2] + 1000, a0, "A0 with a rise of 1M25, RFX with its fall, SCLK 3/8 of a period later"
    )
    begin = [
        Dim("A0", a0, "RFX", x.rf_fall, "", 0),
        Dim("RFX", x.rf_fall, "SCLK", x.rises[0], "", 1),
        Dim("SCLK", x.rises[0], "SCLK", x.falls[0], "", 1),
        Dim("SCLK", x.rises[1], "SCLK", x.rises[2], "", 0),
    ]
    clock = vcd.wires["CLK_1M25"].edges_ns(1)
    begin.append(Dim("CLK_1M25", int(clock[clock <= x.rises[1]][-1]), "SCLK", x.rises[1], " = 3/8 of a period", 2))
    if a0 - dr <= 800:
        begin.append(Dim("DR", dr, "A0", a0, " to a rise", 0))
    if first.size:
        begin.append(Dim("RFX", x.rf_fall, "SDAT", int(first[-1]), " to the first bit, at most 400", 3))
    if bits.size:
        begin.append(Dim("SCLK", fall, "SDAT", int(bits[-1]), " to the next bit, at most 220", 4))
    title = f"PSD-1 cycle at t = {a0 / 1e6:.4f} ms: X, Y, Z one after the other, most significant bit first"
    panels = (Panel(ROWS[1:], (whole,), _words(transfers), dims=dims), Panel(ROWS[:8], (near,), dims=begin))
    return render(vcd, panels, title)


def handover_picture(vcd: Vcd) -> str:
    """From the last bits of X over the host's strobe to the first of Y. Raises ValueError."""
    a0, (x, y, _) = _cycle(vcd)
    section = Section(x.rises[-2] - 300, y.falls[0] + 500, a0)
    dr = _next(vcd, "DR", 1, x.falls[-1])
    clear = y.rf_fall
    dims = [
        Dim("SCLK", x.falls[-1], "DR", dr, " to DR, at most 110", 0),
        Dim("SCLK", x.falls[-1], "RFX", x.rf_rise, " to the next fall of 1M25", 1),
        Dim("FL2", x.rf_rise, "CS", x.cs_fall, " the host's", 2),
        Dim("CS", x.cs_fall, "CS", x.cs_rise, "", 2),
        Dim("CS", x.cs_rise, "RFY", clear, " to the next fall", 1),
        Dim("FL2", x.rf_rise, "FL2", x.fl2_fall, "", 3),
        Dim("RFY", clear, "SCLK", y.rises[0], "", 0),
    ]
    rows = ("CLK_1M25", "DR", "RFX", "SCLK", "SDAT", "FL2", "CS", "RFY")
    title = "PSD-1, from X to Y: FL2 falls and RFY begins with the first fall of 1M25 after the host's strobe"
    return render(vcd, (Panel(rows, (section,), dims=dims),), title)
