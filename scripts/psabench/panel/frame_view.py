"""The frame of a PSA-2 as the page draws it: a torn one first, where a recording of the lines has one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from psabench.boards.psa2.device import Psa2
from psabench.boards.unit import Unit
from psabench.link.protocol_files import dbc_node, message
from psabench.link.signals import Ints
from psabench.link.vcd import Vcd
from psabench.report.drawing import Panel, Section, need, render
from psabench.report.waveform import frame_picture, frame_words
from psabench.shell.commands import Command

ROWS, WORDS, WORD_BITS = ("Int", "Data", "CLK"), 4, 32
PULSE = 40  # that a frame lacks, as in docs/first_fault.md: within the second word


@dataclass(frozen=True, slots=True)
class Seen:
    """A frame on the lines: Int low with bits pulses of CLK."""

    fall_ns: int
    rise_ns: int
    bits: int

    @property
    def is_torn(self) -> bool:
        return self.bits != WORDS * WORD_BITS


def frames_of(vcd: Vcd) -> list[Seen]:
    """All frames that begin and end in a recording."""
    clk, rises = vcd.wires["CLK"].edges_ns(1), vcd.wires["Int"].edges_ns(1)
    found = []
    for fall_ns in vcd.wires["Int"].edges_ns(0).tolist():
        for rise_ns in rises[rises > fall_ns].tolist()[:1]:
            found.append(Seen(fall_ns, rise_ns, int(np.count_nonzero((clk > fall_ns) & (clk < rise_ns)))))
    return found


def drawn_frame(vcd: Vcd) -> Mapping[str, Any]:
    """The picture of the first torn frame, else of the first whole one; how many there are. Raises ValueError."""
    need(vcd, set(ROWS))
    frames = frames_of(vcd)
    torn = [f for f in frames if f.is_torn]
    svg = _torn_picture(vcd, torn[0]) if torn else frame_picture(vcd)
    bits = torn[0].bits if torn else WORDS * WORD_BITS
    return {"svg": svg, "frames": len(frames), "torn": len(torn), "bits": bits}


def _torn_picture(vcd: Vcd, frame: Seen) -> str:
    """The frame as a receiver takes it, which counts pulses, and a closer look at where they are irregular."""
    clk = vcd.wires["CLK"].edges_ns(1)
    rises = clk[(clk > frame.fall_ns) & (clk < frame.rise_ns)]
    margin = (frame.rise_ns - frame.fall_ns) // 30
    whole = Section(frame.fall_ns - margin, frame.rise_ns + margin, frame.fall_ns)
    words = frame_words(vcd, frame.fall_ns, frame.rise_ns, WORD_BITS) if rises.size > 2 else []
    panels = [Panel(ROWS, (whole,), words)]
    if rises.size > 2:
        at_ns, period_ns = _irregular_rise(rises)
        near = Section(at_ns - 7 * period_ns, at_ns + 9 * period_ns, frame.fall_ns, "where the pulses are irregular")
        panels.append(Panel(ROWS, (near,)))
    title = f"Torn frame at t = {frame.fall_ns / 1e6:.3f} ms: {frame.bits} bits, not {WORDS * WORD_BITS}"
    return render(vcd, panels, title)


def _irregular_rise(rises: Ints) -> tuple[int, int]:
    """The first pulse that is neither a period nor the pause between words before the next, or the last; the period."""
    steps = np.diff(rises)
    period_ns = int(np.median(steps))
    pause = steps[steps > 3 * period_ns]  # the pause is 4 or 5 periods from pulse to pulse, a lost pulse leaves 2
    regular = np.abs(steps - period_ns) <= period_ns // 4
    regular |= np.isin(steps, pause)
    odd = np.flatnonzero(~regular)
    return int(rises[odd[0]] if odd.size else rises[-1]), period_ns


# ---- what tears one


def tears_of(add: Command | None, name: str, unit: Unit) -> list[dict[str, str]]:
    """Lines of the shell that tear frames of a unit until the fault is ended, where this bench has a point for them."""
    if add is None:
        return []
    found = []
    if isinstance(unit, Psa2) and f"{name}.line.CLK" in _points_of(add, "line.missing_pulse"):
        line = f"faults.add line.missing_pulse {name}.line.CLK pulse={PULSE}"
        found.append({"where": "on the lines", "line": line, "seen": "in the drawn frame: Draw the next frame"})
    halves = _message_names(unit)
    if len(halves) > 1 and f"{name}.can" in _points_of(add, "link.drop"):
        can_id = int(message(halves[-1]).frame_id) + unit.node.node_id - dbc_node(unit.board)
        line = f"faults.add link.drop {name}.can can_id={can_id}"
        found.append({"where": "on CAN", "line": line, "seen": "in the counters of the channels"})
    return found


def _points_of(add: Command, kind: str) -> tuple[str, ...]:
    variant = add.variants.get(kind)
    return tuple(variant.args[1].offers) if variant else ()


def _message_names(unit: Unit) -> tuple[str, ...]:
    """CAN messages that make a sample."""
    return ("PSA2_XY", "PSA2_ZT") if isinstance(unit, Psa2) else unit.layout.messages
