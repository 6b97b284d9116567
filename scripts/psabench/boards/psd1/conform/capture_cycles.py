"""PSD-1's cycles of reading as a recording shows them: what lies within each low of RFX, RFY and RFZ, and after it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psabench.conform.capture.intervals import wires_needed, within
from psabench.conform.capture.log import Capture, LineLog
from psabench.conform.verdict import Failed, Inconclusive, conclusive
from psabench.link.signals import Ints

FRAMES = ("RFX", "RFY", "RFZ")
LINES = (*FRAMES, "SCLK", "SDAT", "FL2", "CS")  # those of the line port, too
ADDRESS, DATA = tuple(f"AB{k}" for k in range(4)), tuple(f"D{k}" for k in range(16))
PINS = ("A0", "INT0", "FL1", "DR", "TFS", "CLK_1M25", "RW", *LINES, *ADDRESS, *DATA)
BITS, CONTROL_BITS = 16, 24  # a word; a control word or a coefficient, which end in no FL2
LEAST = 8  # cycles that a judgement needs


@dataclass(frozen=True, slots=True, kw_only=True)
class Transfer:
    """A word's way from its converter to the host, ns. -1: that did not come."""

    axis: int
    fall: int  # of RFX, RFY or RFZ
    rise: int
    rises: Ints  # of SCLK
    falls: Ints
    fl2: int  # FL2 is set
    clear: int  # and cleared
    cs_fall: int  # the last strobe that ended while FL2 stood
    cs_rise: int


def fl2_level(e: Capture) -> int:
    """The level that says "a word waits" in this profile."""
    return 0 if e.variant["fl2"] == "low" else 1


def transfers(e: Capture) -> list[Transfer]:
    """All words in their order, whole ones. Raises Inconclusive where a line or words are missing."""
    wires_needed(e, *LINES)
    found = words_of(e.wires.unbroken(), fl2_level(e))
    conclusive(len(found) >= 3 * LEAST, f"{len(found)} words were read in the recording; expected {3 * LEAST}")
    return found


def words_of(log: LineLog, active: int) -> list[Transfer]:
    """All whole words of lines that are there; active: the level of FL2 that says "a word waits"."""
    sets, clears = log["FL2"].edges_ns(active), log["FL2"].edges_ns(1 - active)
    up, down = log.rises("SCLK"), log.falls("SCLK")
    lows, highs = log.pulses("CS", 0)
    lows_of = sorted(
        (int(a), int(b), k) for k, name in enumerate(FRAMES) for a, b in zip(*log.pulses(name, 0), strict=True)
    )
    found = []
    for n, (fall, rise, axis) in enumerate(lows_of):
        rises, falls = within(up, fall, rise), within(down, fall, rise)
        if len(rises) == CONTROL_BITS:
            continue
        limit = lows_of[n + 1][0] if n + 1 < len(lows_of) else log.end_ns + 1
        slack = round(log.resolution_ns)
        fl2 = _first(sets, rise - slack, limit)
        clear = _first(clears, max(fl2, rise - slack) + 1, limit + slack + 1)
        k = int(np.searchsorted(highs, clear if clear >= 0 else limit, "right")) - 1
        strobed = k >= 0 and highs[k] >= rise
        found.append(
            Transfer(
                axis=axis,
                fall=fall,
                rise=rise,
                rises=rises,
                falls=falls,
                fl2=fl2,
                clear=clear,
                cs_fall=int(lows[k]) if strobed else -1,
                cs_rise=int(highs[k]) if strobed else -1,
            )
        )
    if found and found[-1].clear < 0:
        found.pop()  # the recording ends in it
    return found


def trouble(words: Sequence[Transfer]) -> Failed | None:
    """What keeps words from being cycles X, Y, Z of 16 bits with an FL2 each; None: nothing."""
    for k, t in enumerate(words):
        if t.axis != k % 3:
            return Failed(f"{FRAMES[t.axis]} low", f"{FRAMES[k % 3]}: X, Y, Z in turn", at_ns=t.fall, lines=LINES)
        if t.clear < 0 or t.fl2 < 0:
            saw = "no FL2 after a word" if t.fl2 < 0 else "an FL2 that is not cleared"
            return Failed(saw, "FL2 set, read and cleared", at_ns=t.rise, lines=LINES)
        if len(t.rises) != BITS or len(t.falls) != BITS:
            return Failed(f"{len(t.rises)} pulses of SCLK", f"{BITS}", at_ns=t.fall, lines=LINES)
    return None


def from_x(words: list[Transfer]) -> list[Transfer]:
    """From the first word of X on."""
    return words[next((k for k, t in enumerate(words) if t.axis == 0), 0) :]


def cycles(e: Capture) -> list[tuple[Transfer, Transfer, Transfer]]:
    """Whole cycles X, Y, Z. Raises Inconclusive where words make none, which the tests of that requirement tell."""
    words = from_x(transfers(e))
    if found := trouble(words):
        raise Inconclusive(f"no whole cycles to measure: {found.saw}")
    whole = [(words[k], words[k + 1], words[k + 2]) for k in range(0, len(words) - 2, 3)]
    conclusive(len(whole) >= LEAST, f"{len(whole)} whole cycles were recorded; expected {LEAST}")
    return whole


def of(words: Sequence[Transfer], name: str) -> Ints:
    """(n,) an instant of each."""
    return np.array([getattr(t, name) for t in words], np.int64)


def serial_words(log: LineLog, words: Sequence[Transfer]) -> Ints:
    """(n,) what stood on SDAT at the rises of SCLK, most significant bit first."""
    at_ns = np.array([t.rises for t in words], np.int64).reshape(-1, BITS)
    levels = log["SDAT"].at(at_ns).astype(np.int64)
    made: Ints = levels @ (np.int64(1) << np.arange(BITS - 1, -1, -1, dtype=np.int64))
    return made


def starts(e: Capture, whole: Sequence[tuple[Transfer, Transfer, Transfer]]) -> Ints:
    """(n,) the rise of A0 of each cycle: the last before RFX falls. Raises Failed where there is none."""
    wires_needed(e, "A0", "CLK_1M25")
    rises = e.wires.rises("A0")
    falls = np.array([c[0].fall for c in whole], np.int64)
    k = np.searchsorted(rises, falls, "right") - 1
    if not len(rises) or (k < 0).any():
        raise Failed("RFX low without a rise of A0 before it", "A0 = 1", at_ns=int(falls[0]), lines=("A0", "RFX", "DR"))
    found: Ints = rises[k]
    return found


def _first(edges: Ints, from_ns: int, until_ns: int) -> int:
    """The first edge in [from_ns, until_ns); -1: none."""
    k = int(np.searchsorted(edges, from_ns, "left"))
    return int(edges[k]) if k < len(edges) and edges[k] < until_ns else -1
