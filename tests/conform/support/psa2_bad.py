"""Good capture made bad on purpose: edges moved, frames dropped, bytes changed, answers exchanged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from psabench.boards.psa2.conform.capture_line import transfers
from psabench.boards.psa2.conform.check_setup import port_traffic
from psabench.boards.psa2.conform.check_words import beside
from psabench.boards.psa2.conform.stimulus_can import Answer
from psabench.conform.capture.log import CanFrame, CanLog, Capture
from psabench.link.protocol_files import message
from psabench.link.signals import Ints, layout
from psabench.link.vcd import Vcd, Wire

REFUSED, BUSY, NOTHING = Answer(abort=0x06090030), Answer(abort=0x08000022), Answer()

Bad = Callable[[Capture], Capture]


# ---- lines


def rewired(e: Capture, name: str, t_ns: Ints, level: Any) -> Capture:
    """With another course of one line."""
    old = e.wires.recording
    order = np.argsort(t_ns, kind="stable")
    wires = dict(old.wires) | {name: Wire(np.asarray(t_ns, np.int64)[order], np.asarray(level, np.uint8)[order])}
    return e.with_lines(replace(e.wires, recording=Vcd(old.unit_ns, old.start_ns, old.end_ns, wires)))


def without(name: str) -> Bad:
    """A line is not in the recording."""

    def bad(e: Capture) -> Capture:
        old = e.wires.recording
        wires = {n: w for n, w in old.wires.items() if n != name}
        return e.with_lines(replace(e.wires, recording=Vcd(old.unit_ns, old.start_ns, old.end_ns, wires)))

    return bad


def inverted(name: str) -> Bad:
    """A line has the other level all the time."""
    return lambda e: rewired(e, name, e.wires[name].t_ns, 1 - e.wires[name].level)


def still(name: str, level: int) -> Bad:
    """A line never moves."""
    return lambda e: rewired(e, name, e.wires[name].t_ns[:1], np.array([level]))


def moved(name: str, by_ns: int, level: int | None = None, nth: int | None = None) -> Bad:
    """Edges of a line come so much later: all, those to a level, the nth of them (after the start)."""

    def bad(e: Capture) -> Capture:
        w = e.wires[name]
        which = np.arange(len(w.t_ns)) > 0
        if level is not None:
            which &= w.level == level
        if nth is not None:
            which &= np.cumsum(which) == nth % int(which.sum()) + 1
        return rewired(e, name, w.t_ns + np.where(which, by_ns, 0), w.level)

    return bad


def pulse(name: str, where: Callable[[Capture], int], long_ns: int = 1000) -> Bad:
    """A pulse more on a line that stands still there."""

    def bad(e: Capture) -> Capture:
        w, at = e.wires[name], where(e)
        level = int(w.at(at))
        t = np.concatenate((w.t_ns, [at, at + long_ns]))
        return rewired(e, name, t, np.concatenate((w.level, [1 - level, level])))

    return bad


def less(name: str, nth: int, level: int) -> Bad:
    """The nth pulse to a level is missing."""

    def bad(e: Capture) -> Capture:
        w = e.wires[name]
        k = np.flatnonzero((w.level == level) & (np.arange(len(w.t_ns)) > 0))[nth]
        keep = np.ones(len(w.t_ns), bool)
        keep[k : k + 2] = False
        return rewired(e, name, w.t_ns[keep], w.level[keep])

    return bad


def swapped(a: str, b: str) -> Bad:
    """Two lines are exchanged."""

    def bad(e: Capture) -> Capture:
        one = rewired(e, a, e.wires[b].t_ns, e.wires[b].level)
        return rewired(one, b, e.wires[a].t_ns, e.wires[a].level)

    return bad


def slower(ppm: float) -> Bad:
    """All lines run slower."""

    def bad(e: Capture) -> Capture:
        for name, w in e.wires.recording.wires.items():
            e = rewired(e, name, np.rint(w.t_ns * (1 + ppm * 1e-6)).astype(np.int64), w.level)
        return e

    return bad


def after_res(e: Capture) -> int:
    """1 ms after the end of Res."""
    return int(e.wires.rises("Res")[-1]) + 1_000_000


def flip(line: str, clock: str, nth: int, *, level: int = 1) -> Bad:
    """Data have the other level at the nth edge of a clock, from half a period before it to half a period after."""

    def bad(e: Capture) -> Capture:
        edges = e.wires[clock].edges_ns(level)
        k = nth % len(edges)
        half = int(edges[k + 1] - edges[k]) // 2 if k + 1 < len(edges) else 100
        half = min(half, 488)
        w = e.wires[line]
        begin, end = int(edges[k]) - half, int(edges[k]) + half
        inside = (w.t_ns >= begin) & (w.t_ns <= end)
        t = np.concatenate((w.t_ns[~inside], [begin, end]))
        levels = np.concatenate((w.level[~inside], [1 - int(w.at(int(edges[k]))), int(w.at(end))]))
        return rewired(e, line, t, levels)

    return bad


# ---- CAN


def frames(change: Callable[[list[CanFrame]], list[CanFrame]]) -> Bad:
    """Another log of the bus; cuts stay where they are, so that a log keeps its length where it has some."""
    return lambda e: e.with_can(CanLog(frames=tuple(change(list(e.can.frames)))))


def each(name: str, change: Callable[[CanFrame], CanFrame], nth: int | None = None) -> Bad:
    """The frames of a message are changed: all, or the nth."""

    def bad(e: Capture) -> Capture:
        ids = {f.can_id for f in e.frames_of(name).frames}
        found = list(e.can.frames)
        at = [k for k, f in enumerate(found) if f.can_id in ids]
        for k in at if nth is None else [at[nth]]:
            found[k] = change(found[k])
        return e.with_can(CanLog(frames=tuple(found)))

    return bad


def gone(name: str, nth: int | None = None) -> Bad:
    """Frames of a message never came."""
    return each(name, lambda f: f._replace(can_id=0x7FF), nth)


def short(name: str, nth: int = 0) -> Bad:
    """A frame lacks its last byte."""
    return each(name, lambda f: f._replace(data=f.data[:-1]), nth)


def signal(name: str, s: str, change: Callable[[int], int], nth: int | None = None) -> Bad:
    """A signal of a message has another value."""
    at = layout(message(name))[s]

    def edit(f: CanFrame) -> CanFrame:
        word = int.from_bytes(f.data, "little")
        mask = (1 << at.bits) - 1
        raw = word >> at.start_bit & mask
        value = raw - (1 << at.bits) if at.signed and raw >> (at.bits - 1) else raw
        word = word & ~(mask << at.start_bit) | (change(value) & mask) << at.start_bit
        return f._replace(data=word.to_bytes(len(f.data), "little"))

    return each(name, edit, nth)


# ---- answers


def told(name: str, change: Callable[[Any], Any]) -> Bad:
    """A fact of the stimulus is another."""
    return lambda e: replace(e, facts=dict(e.facts) | {name: change(e.facts[name])})


def answered(name: str, key: Any, answer: Answer) -> Bad:
    """One answer among several is another."""
    return told(name, lambda old: dict(old) | {key: answer})


# ---- the board in whole


def three_words(e: Capture) -> Capture:
    """CLK stands still while the last word is due."""
    w, ends = e.wires["CLK"], e.wires.rises("Int")
    ahead = ends[np.minimum(np.searchsorted(ends, w.t_ns), len(ends) - 1)] - w.t_ns
    keep = (ahead < 0) | (ahead > 17_000)
    return rewired(e, "CLK", w.t_ns[keep], w.level[keep])


def channel_on_the_line_flipped(e: Capture) -> Capture:
    """The lowest bit of the channel in word T is another in a frame with a new temperature."""
    b = beside(e)
    fall_ns = b.fall_ns[np.flatnonzero(b.samples.new)[3]]
    bits = int(e.variant["word_bits"])
    return flip("Data", "CLK", int(np.searchsorted(e.wires.rises("CLK"), fall_ns)) + 3 * bits + 16)(e)


def without_sdatac(e: Capture) -> Capture:
    """The first SDATAC is another byte."""
    m = next(m for m in port_traffic(e).of(temp=False) if m.sent == b"\x11")
    return flip("DIn", "SClk", int(np.searchsorted(e.wires.rises("SClk"), m.begin_ns)) + 3)(e)


def drd_a_after_cst(e: Capture) -> Capture:
    """A conversion ends 3 us after a burst for the other port."""
    return pulse("DRD_A", lambda x: int(x.wires.rises("CST")[4]) + 3000)(e)


def dropped(e: Capture) -> Capture:
    """One sample is missing, with both halves."""
    return gone("PSA2_ZT", 50)(gone("PSA2_XY", 50)(e))


def marked(sub: int, value: int) -> Bad:
    """A register of converter Y reads otherwise."""
    return answered("read", (0x2003, sub), Answer(value))


def temp_register(sub: int, value: int) -> Bad:
    return answered("read", (0x2001, sub), Answer(value))


def counted(sub: int, more: int) -> Bad:
    return told("after", lambda old: dict(old) | {sub: Answer(old[sub].value + more)})


def of_rows(change: Callable[[tuple[Any, ...]], tuple[Any, ...]]) -> Callable[[list[Any]], list[Any]]:
    return lambda rows: [change(rows[0]), *rows[1:]]


def mirror(nth: int) -> Bad:
    """The nth mirror shows another value."""

    def change(rows: list[Any]) -> list[Any]:
        index, sub, answer, *numbers = rows[nth]
        return [*rows[:nth], (index, sub, Answer(answer.value + 3), *numbers), *rows[nth + 1 :]]

    return told("mirrors", change)


def last_abort(row: tuple[Any, ...]) -> tuple[Any, ...]:
    return (*row[:-1], NOTHING)


def no_emcy(e: Capture) -> Capture:
    return gone("EMCY")(e)


def same_gain(e: Capture) -> Capture:
    """Codes that no write changes."""
    early = e.can.frames[: e.facts["cut"]["gain"]]  # type: ignore[index]
    return e.with_can(CanLog(frames=early * 4))


def late_half(e: Capture) -> Capture:
    """The step is in Z one frame later."""
    found = list(e.frames_of("PSA2_ZT").frames)
    shifted = [found[0], *found[:-1]]
    it = iter(shifted)
    return each("PSA2_ZT", lambda f: f._replace(data=next(it).data[:3] + f.data[3:]))(e)


def boxcar(e: Capture) -> Capture:
    """A step in the codes without a filter: the first sample until the gain changes, the last one from then on."""
    begin = e.facts["cut"]["gain"]  # type: ignore[index]
    found = list(e.can.frames)
    for name, size in (("PSA2_XY", 6), ("PSA2_ZT", 3)):
        mine = e.frames_of(name).frames
        for k, f in enumerate(found):
            if f.can_id == mine[0].can_id:
                found[k] = f._replace(data=(mine[0] if k < begin else mine[-1]).data[:size] + f.data[size:])
    return e.with_can(CanLog(frames=tuple(found)))


def twice_the_pulses(e: Capture) -> Capture:
    return pulse("SYNC_A", lambda x: int(x.wires.rises("SYNC_A")[0]) + 5_000_000)(e)


def slower_clk(e: Capture) -> Capture:
    """CLK runs slower by a twentieth than its frame allows, from its first rise on."""
    w = e.wires["CLK"]
    t0_ns = w.t_ns[1]
    return rewired(e, "CLK", np.rint(t0_ns + (w.t_ns - t0_ns) * 1.05).astype(np.int64), w.level)


def mirrored(e: Capture) -> Capture:
    """Every word is sent most significant bit first."""
    t = transfers(e.wires)
    bits = int(e.variant["word_bits"])
    rises, levels = t.grid_ns(bits).astype(np.int64), t.bits(bits)
    levels = levels.reshape(-1, 4, bits)[:, :, ::-1].reshape(-1)
    at = rises.reshape(-1)
    edges = np.stack((at - 200, at + 200), axis=1).reshape(-1)
    course = np.stack((levels, np.zeros_like(levels)), axis=1).reshape(-1)
    return rewired(e, "Data", np.concatenate(([e.wires.start_ns], edges)), np.concatenate(([0], course)))


def swap_axes(e: Capture) -> Capture:
    """X and Y are exchanged on CAN."""
    return each("PSA2_XY", lambda f: f._replace(data=f.data[3:6] + f.data[:3] + f.data[6:]))(e)


def same_numbers(e: Capture) -> Capture:
    """Codes that no register corrects."""
    x = iter([f.data for f in e.frames_of("PSA2_XY").frames[:50]] * 20)
    return each("PSA2_XY", lambda f: f._replace(data=next(x)[:6] + f.data[6:]))(e)


def noisier(e: Capture) -> Capture:
    """Twice the noise."""
    middle = int.from_bytes(e.frames_of("PSA2_XY").frames[0].data[:3], "little")
    return signal("PSA2_XY", "X", lambda v: middle + 2 * (v - middle))(e)


def steady(e: Capture) -> Capture:
    """The codes of all samples are those of the first."""
    x, z = e.frames_of("PSA2_XY").frames[0], e.frames_of("PSA2_ZT").frames[0]
    made = each("PSA2_XY", lambda f: f._replace(data=x.data[:6] + f.data[6:]))(e)
    return each("PSA2_ZT", lambda f: f._replace(data=z.data[:3] + f.data[3:]))(made)
