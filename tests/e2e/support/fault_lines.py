"""What a recording of a board's lines breaks of the rules on its page (docs/boards/psa2.md), by line."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from psabench.link.vcd import Vcd

REST = {
    "SYNC_A": 0,
    "SClk": 0,
    "DRD_A": 1,
    "DIn": 0,
    "SYNC_T": 1,
    "CST": 1,
    "DRD_T": 1,
    "DInT": 0,
    "DOutT": 0,
    "Res": 1,
    "Data": 0,
    "CLK": 0,
    "Int": 1,
}  # DOutX, DOutY and DOutZ rest at the last bit
PORTS = {"DOutX": 0, "DOutY": 1, "DOutZ": 2}  # line: word of the frame
NARROW_NS = 200  # half a period of CLK is 250, the shortest there is
LOOK_NS = 20_000_000  # at the end of the recording, when frames flow
BEGUN_NS = 1_000_000  # after its start, when what was wrong before it has reached the recording
READ_BITS, WORD_BITS, WORDS = 24, 32, 4

Ints = NDArray[np.int64]


def still(v: Vcd) -> set[str]:
    return {name for name, wire in v.wires.items() if not (wire.t_ns > v.start_ns + BEGUN_NS).any()}


def narrow(v: Vcd) -> set[str]:
    """Pulses that are too short. CST between two bursts in a row is high for no time at all."""
    flowing = {name: wire.t_ns[wire.t_ns > v.end_ns - LOOK_NS] for name, wire in v.wires.items()}
    return {n for n, t_ns in flowing.items() if ((np.diff(t_ns) > 0) & (np.diff(t_ns) < NARROW_NS)).any()}


def restless(v: Vcd) -> set[str]:
    """Lines that are away from their level at rest most of the time."""
    at_ns = np.arange(v.end_ns - LOOK_NS, v.end_ns, 997)
    return {name for name, level in REST.items() if (v.wires[name].at(at_ns) == level).mean() < 0.5}


def frames(v: Vcd) -> list[tuple[int, int]]:
    """Fall and rise of Int, for frames that are whole."""
    rises = v.wires["Int"].edges_ns(1)
    spans = []
    for fall in v.wires["Int"].edges_ns(0):
        after = rises[rises > fall]
        if len(after) and fall > v.end_ns - LOOK_NS:
            spans.append((int(fall), int(after[0])))
    return spans


def clocked(v: Vcd, clock: str, line: str, start_ns: int, end_ns: int) -> Ints:
    """Levels of a line where a clock rises."""
    up = v.wires[clock].edges_ns(1)
    return v.wires[line].at(up[(up > start_ns) & (up < end_ns)] - 1).astype(np.int64)


def miscounted(v: Vcd) -> set[str]:
    spans = frames(v)
    wrong = any(len(clocked(v, "CLK", "Data", *span)) != WORDS * WORD_BITS for span in spans)
    return {"CLK"} if wrong or not spans else set()


def number(bits: Ints) -> int:
    """Most significant bit first, two's complement."""
    value = int("".join(map(str, bits)), 2)
    return value - (1 << len(bits)) if bits[0] else value


def misread(v: Vcd) -> set[str]:
    """Converters whose words are not those of the frame that follows."""
    wrong = set()
    ready = v.wires["DRD_A"].edges_ns(0)
    for fall, rise in frames(v):
        before = ready[ready < fall]
        sent = clocked(v, "CLK", "Data", fall, rise)
        if not len(before) or len(sent) != WORDS * WORD_BITS:
            continue
        for line, word in PORTS.items():
            read = clocked(v, "SClk", line, int(before[-1]), fall)[:READ_BITS]
            code = sent[word * WORD_BITS : (word + 1) * WORD_BITS][::-1]
            if len(read) != READ_BITS or number(read) != number(code):
                wrong.add(line)
    return wrong


RULES = {"still": still, "narrow": narrow, "restless": restless, "miscounted": miscounted, "misread": misread}


def breaches(v: Vcd) -> dict[str, set[str]]:
    """Names of the rules that each line breaks."""
    found: dict[str, set[str]] = {}
    for rule, check in RULES.items():
        for line in check(v):
            found.setdefault(line, set()).add(rule)
    return found
