"""How fast the clocks of a recording run against the board's: what the board does regularly, by each recorder's clock.

A ratio alone cannot say which of two clocks is off; with two recorders the one that differs from both others is.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from psabench.boards.board import Beat
from psabench.boards.psa2.conform.capture_line import transfers
from psabench.boards.registry import BOARDS
from psabench.conform.capture.log import CanLog, Capture, LineLog
from psabench.conform.profile import Variant
from psabench.conform.requirements import requirements
from psabench.conform.verdict import Inconclusive
from psabench.link import signals
from psabench.link.protocol_files import message
from psabench.link.signals import Floats, Ints

PPM = 1e-6
NS = 1e9
LEAST = 20  # beats, and pairs of them, that a ratio wants
MOST_PPM = 2000.0  # no crystal is farther off: the period itself is another
BLOCKS = 8
STEADY, OFF_BEAT = 4, 0.01  # so many beats in turn are the board's period, each so near to it
CODE_BITS = 24
CAN_RESOLUTION_S = 1e-6  # of stamps: candump's digits


BEATS: Mapping[str, Beat] = {name: board.beat for name, board in BOARDS.items() if board.beat}


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """By how much one clock runs fast against another, with an uncertainty of two standard deviations."""

    ppm: float
    within_ppm: float
    points: int
    span_s: float

    def __str__(self) -> str:
        return f"{self.ppm:+.3f} +- {self.within_ppm:.3f} ppm ({self.points} points in {self.span_s:.3f} s)"

    def beyond(self, limit_ppm: float) -> bool:
        """Certainly farther off than this."""
        return abs(self.ppm) - self.within_ppm > limit_ppm

    def inside(self, limit_ppm: float) -> bool:
        """Certainly not so far off."""
        return abs(self.ppm) + self.within_ppm <= limit_ppm

    @property
    def usable(self) -> bool:
        """A clock's error, and known well enough to correct with."""
        return abs(self.ppm) <= MOST_PPM and self.within_ppm <= 50.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Clocks:
    """Each recorder's clock against the board's beat; words: the log's clock against the lines', by the same words."""

    lines: Ratio | None = None
    can: Ratio | None = None
    stamps: Ratio | None = None  # the log's clock against the board's time stamps
    words: Ratio | None = None

    def facts(self) -> dict[str, str]:
        """For the report."""
        found = {
            "clock of the lines against the board's period": self.lines,
            "clock of the CAN log against the board's period": self.can,
            "clock of the CAN log against the board's time stamps": self.stamps,
            "clock of the CAN log against that of the lines, by the same words": self.words,
        }
        return {name: str(r) for name, r in found.items() if r is not None}


def estimate(e: Capture) -> Clocks:
    """Of all that the recording has; None where it has too little, or the board no regular period that is known."""
    beat = BEATS.get(e.variant.family)
    period_s = None if beat is None else _period_s(beat, e.variant)
    if beat is None or period_s is None:
        return Clocks()
    lines = None if e.lines is None else _of_lines(e.lines, beat, period_s)
    words = _of_words(e) if e.lines is not None and len(e.can) and e.variant.family == "psa2" else None
    return Clocks(lines=lines, can=_of_counter(e, beat, period_s), stamps=_of_stamps(e, beat), words=words)


def beat_row(variant: Variant) -> str:
    """The requirement that gives the period, "" where there is none."""
    beat = BEATS.get(variant.family)
    rows = requirements().rows
    return next((i for i in (beat.rows if beat else ()) if rows[i].applies(variant.board, variant.profile)), "")


def _period_s(beat: Beat, variant: Variant) -> float | None:
    row = beat_row(variant)
    return requirements().rows[row].limit(beat.rows[row]) * 1e-6 if row else None


def steady_from(variant: Variant, edges_ns: Ints) -> int:
    """The first of these edges of the beat's line from which on they come in the board's period; 0 where none do."""
    beat = BEATS.get(variant.family)
    period_s = None if beat is None else _period_s(beat, variant)
    if period_s is None:
        return 0
    steps = np.diff(edges_ns) / NS / period_s
    good = (np.abs(steps - np.rint(steps)) < OFF_BEAT) & (steps > 0.5)
    run = np.convolve(good, np.ones(STEADY)) if len(good) else np.empty(0)
    whole = np.flatnonzero(run == STEADY)
    return int(whole[0]) - STEADY + 1 if len(whole) else 0


def _of_lines(log: LineLog, beat: Beat, period_s: float) -> Ratio | None:
    if beat.line not in log.recording.wires:
        return None
    at_ns = log.recording.wires[beat.line].edges_ns(beat.level)
    parts = np.split(at_ns, np.searchsorted(at_ns, log.gaps_ns))  # no time is known across a gap
    at_s = max(parts, key=len) / NS
    steps = np.rint(np.diff(at_s) / period_s)
    keep = np.concatenate(([True], steps > 0))[: len(at_s)]  # an edge too many is no beat
    at_s = at_s[keep]
    beats = np.concatenate(([0.0], np.cumsum(np.rint(np.diff(at_s) / period_s))))[: len(at_s)]
    return ratio(beats * period_s, at_s, log.resolution_ns / NS)


def _of_counter(e: Capture, beat: Beat, period_s: float) -> Ratio | None:
    count, t_s, bits = _signal(e, beat.message, beat.counter)
    steps = np.diff(count) % (1 << bits)
    cuts = np.flatnonzero((steps == 0) | (steps > 1 << bits - 1)) + 1  # begun again
    k = max(range(len(cuts) + 1), key=lambda i: np.diff([0, *cuts, len(count)])[i])
    begin, end = [0, *cuts][k], [*cuts, len(count)][k]
    beats = np.concatenate(([0], np.cumsum(steps[begin : max(begin, end - 1)])))[: end - begin]
    return ratio(beats * period_s, t_s[begin:end], CAN_RESOLUTION_S)


def _of_stamps(e: Capture, beat: Beat) -> Ratio | None:
    name, signal = beat.stamp
    if not name:
        return None
    raw, t_s, bits = _signal(e, name, signal)
    unit_s = signals.layout(message(name))[signal].scale
    if not len(raw):
        return None
    turns = np.rint((np.diff(t_s) / unit_s - np.diff(raw)) / (1 << bits))  # of the stamp between two frames
    stamp_s = np.concatenate(([0.0], np.cumsum(np.diff(raw) + turns * (1 << bits)))) * unit_s
    return ratio(stamp_s, t_s, max(CAN_RESOLUTION_S, unit_s)) if (np.diff(stamp_s) > 0).all() else None


def _signal(e: Capture, name: str, signal: str) -> tuple[Ints, Floats, int]:
    """Raw values, time stamps and width of a signal of the frames that have their length."""
    length = int(message(name).length)
    log = CanLog(frames=tuple(f for f in e.frames_of(name).frames if len(f.data) == length and not f.remote))
    return log.raw(name)[signal], log.t_s, signals.layout(message(name))[signal].bits


def _of_words(e: Capture) -> Ratio | None:
    """The same words on the lines and on the bus; those that came once on each."""
    bits = int(e.variant["word_bits"])
    try:
        t = transfers(e.wires).of(4 * bits)
    except Inconclusive:
        return None
    x, t_xy, _ = _signal(e, "PSA2_XY", "X")
    y = _signal(e, "PSA2_XY", "Y")[0]
    order = list(e.variant["word"])
    cut = max(0, CODE_BITS - bits)
    words = t.words(bits)
    mask = (1 << min(bits, CODE_BITS)) - 1
    if not len(words) or not len(x) or not {"X", "Y"} <= set(order):
        return None
    on_lines = _keys(words[:, order.index("X")] & mask, words[:, order.index("Y")] & mask)
    on_can = _keys(x >> cut & mask, y >> cut & mask)
    line_once, can_once = _once(on_lines), _once(on_can)
    _, a, b = np.intersect1d(on_lines[line_once], on_can[can_once], assume_unique=True, return_indices=True)
    at = np.sort(line_once[a])
    x_s, y_s = t.rise_ns[at] / NS, t_xy[can_once[b][np.argsort(line_once[a])]]
    return ratio(x_s, y_s, max(CAN_RESOLUTION_S, e.wires.resolution_ns / NS))


def _keys(x: Ints, y: Ints) -> Ints:
    return (x & 0xFFFFFF) << CODE_BITS | y & 0xFFFFFF


def _once(keys: Ints) -> Ints:
    """Places of those that come once."""
    _, first, counts = np.unique(keys, return_index=True, return_counts=True)
    found: Ints = first[counts == 1]
    return found


def ratio(x_s: Floats, y_s: Floats, resolution_s: float) -> Ratio | None:
    """Slope of y over x less one: the median over pairs half a recording apart, which outliers do not move.

    Its uncertainty is the greatest of: scatter of the pairs, scatter of the medians of parts (slow wander), one
    resolution over the distance of a pair.
    """
    half = len(x_s) // 2
    if half < LEAST:
        return None
    dx_s, dy_s = x_s[half:] - x_s[:-half], y_s[half:] - y_s[:-half]
    if not (dx_s > 0).all():
        return None
    off = dy_s / dx_s - 1.0
    middle = float(np.median(off))
    scatter = 1.4826 * float(np.median(np.abs(off - middle))) / np.sqrt(len(off))
    medians = [float(np.median(part)) for part in np.array_split(off, BLOCKS)]
    wander = float(np.std(medians)) / np.sqrt(BLOCKS)
    within = 2.0 * max(scatter, wander, resolution_s / float(np.median(dx_s)) / 2.0)
    return Ratio(ppm=middle / PPM, within_ppm=within / PPM, points=len(x_s), span_s=float(y_s[-1] - y_s[0]))
