"""The line port: what its bytes mean, how often samples are taken, and when (docs/lineport.md)."""

from __future__ import annotations

from typing import Any

import numpy as np

from psabench.conform.capture.intervals import fact
from psabench.conform.capture.log import Capture, LineLog
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.sources.samples import PORT_LINES
from psabench.conform.verdict import Failed, conclusive, expect, none_of
from psabench.link.signals import Ints

NS = 1e9
WORDS = 4
NO_SAMPLES = "no samples of the line port"


def _bytes(e: Capture) -> Any:
    """The bytes (n,). Raises Inconclusive for less than a millisecond of them."""
    found = fact(e, "bytes", NO_SAMPLES)
    conclusive(len(found) >= row_for(e, "LINE-RATE-01").limit("sample_hz") * 1e-3, NO_SAMPLES)
    return found


def _port(e: Capture) -> LineLog:
    found: LineLog = fact(e, "port", NO_SAMPLES)
    return found


@check("line_port", "LINE-BYTE-01", needs={"port"})
def bits_of_a_psa2(e: Capture, row: Requirement) -> str:
    """Look for frames in bits 0 and 2 of the bytes, for data in bit 1, for nothing in bits 3 to 6."""
    x = _bytes(e)
    stray = x[(x & int(row.limit("zero_mask"))) != 0].tolist()
    none_of(stray, lambda byte: f"byte {byte:02X}h", "bits 3 to 6 zero")
    low = (x & int(row.limit("int_mask"))) == 0
    begin, end = _edges(low, 1), _edges(low, 0)
    end = end[np.searchsorted(end, begin[0], "right") :] if len(begin) else end
    bits = WORDS * int(e.variant["word_bits"])
    clk, data = (x & int(row.limit("clk_mask"))) != 0, (x & int(row.limit("data_mask"))) != 0
    rises = _edges(clk, 1)
    for a, b in zip(begin, end, strict=False):
        count = int(np.searchsorted(rises, b) - np.searchsorted(rises, a))
        expect(count == bits, f"{count} rises of bit 2 while bit 0 is low", f"{bits}")
    expect(min(len(begin), len(end)) >= 2, f"{len(begin)} falls of bit 0", "frames")
    expect(0 < data.sum() < len(x), "bit 1 never changes", "data")
    return f"{min(len(begin), len(end))} frames of {bits} bits"


def _edges(x: Any, level: int) -> Ints:
    """Samples (n,) at which a line has become `level`."""
    found: Ints = np.flatnonzero((x[1:] != x[:-1]) & (x[1:] == bool(level))) + 1
    return found


def _t0_ns(e: Capture) -> float:
    """Instant of sample 0 in the recording of the pins: a grid point of the sample clock by which all edges agree.

    Raises Inconclusive where the board's lines did not move, Failed where none fits.
    """
    port, pins = _port(e), e.wires
    step_ns = NS / row_for(e, "LINE-RATE-01").limit("sample_hz")
    names = [n for n in PORT_LINES[e.variant.family] if n in pins]
    busy = max(names, key=lambda n: len(port[n].t_ns), default="")
    conclusive(busy and len(port[busy].t_ns) >= 3, "no line of the port moved")
    seen, there = port[busy].t_ns[1:], pins[busy].t_ns[1:]
    for first in there[: max(1, len(there) - len(seen) + 1)]:
        t0_ns = np.ceil((first - seen[0]) / step_ns) * step_ns
        if all(_agrees(port, pins, n, t0_ns, step_ns) for n in names):
            return float(t0_ns)
    raise Failed(f"{busy} moves otherwise than at its pin", "samples of the lines of the table", lines=[busy])


def _agrees(port: LineLog, pins: LineLog, name: str, t0_ns: float, step_ns: float) -> bool:
    """Whether the port shows the pin's level at each of its own samples next to an edge."""
    at = port[name].t_ns[1:] + t0_ns
    if not len(at):
        at = np.array([t0_ns + port.end_ns / 2])
    here = np.concatenate((at, at - step_ns))
    here = here[(here >= pins.start_ns) & (here < pins.end_ns)]
    level = port[name].at(np.rint(here - t0_ns).astype(np.int64))
    return bool(np.array_equal(pins[name].at(np.floor(here).astype(np.int64)), level))


@check("line_port", "LINE-BYTE-02", needs={"port", "pins", "stream", "exact"})
def bits_of_the_other_boards(e: Capture) -> str:
    """Lay each bit beside the line of the table as the pins show it."""
    _t0_ns(e)
    names = PORT_LINES[e.variant.family]
    moved = [n for n in names if len(_port(e)[n].t_ns) > 1]
    return f"{', '.join(names)} as at the pins; {', '.join(moved)} moved"


@check("line_port", "LINE-RATE-01", needs={"port", "pins", "stream", "exact"})
def samples_come_at_their_rate(e: Capture, row: Requirement) -> str:
    """Compare the samples between the first and the last edge of the port with their time at the pins."""
    rate_hz, t0_ns = row.limit("sample_hz"), _t0_ns(e)
    name = max(PORT_LINES[e.variant.family], key=lambda n: len(_port(e)[n].t_ns))
    port, pin = _port(e)[name].t_ns[1:], e.wires[name].t_ns[1:]
    at = np.searchsorted(pin, port[[0, -1]] + t0_ns, "right") - 1 if len(port) > 1 else np.array([-1])
    conclusive(not (at < 0).any(), "fewer than two edges")
    samples = (port[-1] - port[0]) * rate_hz / NS
    took_s = (pin[at[1]] - pin[at[0]]) / NS
    if abs(samples - took_s * rate_hz) > row.limit("tolerance_samples"):
        raise Failed(f"{samples:.0f} samples in {took_s:.9f} s", f"{took_s * rate_hz:.1f}", lines=[name])
    return f"{samples:.0f} samples in {took_s:.9f} s"


@check("line_port", "LINE-RATE-02", needs={"port", "pins", "stream", "exact"})
def samples_are_the_levels_of_their_instants(e: Capture, row: Requirement) -> str:
    """Look up the level of the pin at each sample before and at an edge of the port."""
    t0_ns, port = _t0_ns(e), _port(e)
    edges = sum(len(port[n].t_ns) - 1 for n in PORT_LINES[e.variant.family])
    step_ns = NS / row_for(e, "LINE-RATE-01").limit("sample_hz")
    off = t0_ns % step_ns
    if min(off, step_ns - off) > row.limit("tolerance_ns"):
        raise Failed(f"sample 0 {off:.0f} ns after an edge of the sample clock", "at an edge")
    return f"{edges} edges, each between the sample before and its own; sample 0 at {t0_ns:.0f} ns"
