"""Transfers of PSA-2 and PSA-1 against the limits of its converters; the scan of the temperatures."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from psabench.boards.psa2.conform.capture_spi import Burst, Message
from psabench.boards.psa2.conform.check_serial import (
    RDATA,
    least,
    port_bursts,
    rdata_gaps,
    tau_ns,
    tclk_ns,
    temp_messages,
)
from psabench.boards.psa2.conform.check_setup import ACCEL, TEMP, port_traffic
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import conclusive, expect
from psabench.link.signals import Floats, Ints

# ---- limits of the parts


def _known(
    e: Capture,
    found: Sequence[Message],
    known: Sequence[int],
    register: tuple[int, ...],
    lines: Sequence[str],
    last: int,
) -> str:
    """Every message is a command of the table, with its bytes. Raises Failed, Inconclusive: none."""
    conclusive(found, "no command was recorded")
    for m in found:
        saw = f"{sum(b.bits for b in m.bursts)} clocks of {m.name}"
        expect(not any(b.bits % 8 for b in m.bursts), saw, "whole bytes", at_ns=m.begin_ns, lines=lines)
        code = m.sent[0]
        if code & 0xF0 in register:
            good = len(m.sent) > 2 and code & 0x0F <= last and len(m.sent) == 3 + m.sent[1]
        else:
            good = code in known
        expect(good, m.name, "a command of the table with its bytes", at_ns=m.begin_ns, lines=lines)
    kinds = sorted({m.sent[0] for m in found})
    return f"{len(found)} commands: {', '.join(f'{k:02X}h' for k in kinds)}"


@check("registers", "PSA2-CHIP-02", needs={"pins"}, on_recording="all")
def accelerometer_converters_get_commands_that_they_have(e: Capture, row: Requirement) -> str:
    """Decode every burst on DIn."""
    found = port_traffic(e).of(temp=False)
    for b in port_traffic(e).reads:
        expect("1" not in b.sent, "DIn high in a read", "low", at_ns=int(b.rise_ns[0]), lines=ACCEL)
    known = (0x00, 0x01, 0x04, 0x05, 0x06, 0x07, 0x10, 0x11)  # sources 1.3, those that a read survives
    return _known(e, found[:-1], known, (0x20, 0x40), ACCEL, int(row.limit("last_register")))


@check("registers", "PSA2-CHIP-08", needs={"pins"}, on_recording="all")
def the_temperature_converter_gets_commands_that_it_has(e: Capture, row: Requirement) -> str:
    """Decode every burst on DInT."""
    found = temp_messages(e)[:-1]
    plain = [m for m in found if m.sent[:1] != bytes([RDATA])]
    return _known(
        e, plain, (0x00, 0x0F, 0xF0, 0xF1, 0xF2, 0xFC, 0xFE, 0xFF), (0x10, 0x50), TEMP, int(row.limit("last_register"))
    )


def _setup_hold(e: Capture, found: Sequence[Burst], line: str, *, falls: bool, due_ns: float) -> str:
    """A data line stands still around the edges that take it. Raises Failed."""
    edges = np.sort(np.concatenate([b.fall_ns if falls else b.rise_ns for b in found]))
    t = e.wires[line].t_ns[1:]
    conclusive(len(t), f"{line} never changes")
    after = np.searchsorted(edges, t)
    ahead = np.where(after < len(edges), edges[np.minimum(after, len(edges) - 1)] - t, 1 << 60)
    since = np.where(after > 0, t - edges[np.maximum(after - 1, 0)], 1 << 60)
    near_ns = np.minimum(ahead, since).astype(np.float64)
    edge = "fall" if falls else "rise"
    return least(e, near_ns, t, due_ns, f"between a change of {line} and a {edge} of SClk", ("SClk", line, "CST"))


def _widths(e: Capture, found: Sequence[Burst], lo_ns: float, hi_ns: float) -> None:
    for b in found:
        for w in (b.fall_ns - b.rise_ns, b.rise_ns[1:] - b.fall_ns[:-1]):
            if len(w):
                _within(e, w, lo_ns, hi_ns, "SClk high or low for", b)


def _within(e: Capture, took_ns: Ints | Floats, lo_ns: float, hi_ns: float, what: str, begin: Burst) -> None:
    """Raises Failed for an interval of SClk that is shorter or longer, showing the burst."""
    shortest, longest = took_ns.min(), took_ns.max()
    good = shortest >= lo_ns - e.slack_ns(lo_ns) and longest <= hi_ns + e.slack_ns(hi_ns)
    saw, due = f"{what} {shortest:.0f} to {longest:.0f} ns", f"{lo_ns:.0f} to {hi_ns:.0f} ns"
    expect(good, saw, due, at_ns=int(begin.rise_ns[0]), lines=("SClk",))


@check("registers", "PSA2-CHIP-03", needs={"pins"}, on_recording="all")
def transfers_keep_the_limits_of_the_accelerometer_converters(e: Capture, row: Requirement) -> str:
    """Measure SClk and DIn against the limits of the part."""
    found = port_bursts(e, temp=False)
    _widths(e, found, tclk_ns(e, row.limit("width_min_tclk")), tclk_ns(e, row.limit("width_max_tclk")))
    period = np.concatenate([np.diff(b.rise_ns) for b in found]).astype(np.float64)
    lo, hi = tclk_ns(e, row.limit("period_min_tclk")), tclk_ns(e, row.limit("period_max_tclk"))
    _within(e, period, lo, hi, "periods of SClk of", found[0])
    said = _setup_hold(e, found, "DIn", falls=False, due_ns=row.limit("setup_min_ns"))
    return f"periods of {period.min():.0f} to {period.max():.0f} ns, {said}"


@check("registers", "PSA2-CHIP-09", needs={"pins"}, on_recording="all")
def transfers_keep_the_limits_of_the_temperature_converter(e: Capture, row: Requirement) -> str:
    """Measure SClk, DInT and CST against the limits t1, t4, t5, t6, t10 and t11 of the part."""
    found, told = port_bursts(e, temp=True), temp_messages(e)
    period = np.concatenate([np.diff(b.rise_ns) for b in found]).astype(np.float64)
    at = np.concatenate([b.rise_ns[1:] for b in found])
    least(e, period, at, tau_ns(e, row.limit("t1_min_tau")), "a period of SClk", TEMP)
    _setup_hold(e, found, "DInT", falls=True, due_ns=row.limit("setup_min_ns"))
    gated = e.variant["gate_sclk"]  # without gates no client waits for anything (docs/boards/psa2.md, profile ungated)
    said = (
        least(e, *rdata_gaps(e), tau_ns(e, row.limit("t6_min_tau")), "from RDATA to its data", TEMP)
        if gated
        else "no gates"
    )
    rises = e.wires.rises("CST")
    ends = np.array([m.end_ns for m in told if m.end_ns < (rises[-1] if len(rises) else 0)], np.int64)
    after = (rises[np.searchsorted(rises, ends)] - ends).astype(np.float64) if len(ends) else np.empty(0)
    least(e, after, ends, tau_ns(e, row.limit("t10_min_tau")), "of CST low after SClk", TEMP)
    gap = np.array([b.begin_ns - a.end_ns for a, b in itertools.pairwise(told)], np.float64)
    least(
        e,
        gap,
        ends[: len(gap)] if len(ends) >= len(gap) else np.zeros(len(gap), np.int64),
        tau_ns(e, row.limit("t11_min_tau")),
        "between commands",
        TEMP,
    )
    return f"periods from {period.min():.0f} ns on, {said}"
