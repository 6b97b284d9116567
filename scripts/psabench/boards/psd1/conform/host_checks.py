"""What a host of PSD-1 must have told of each case.

What the unit sent is read from the emulator's log by rules of its protocol page alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from psabench.conform.host.capture import Bus, number
from psabench.conform.host.check import HostCapture, checks, enough, limits
from psabench.conform.host.results import Reading
from psabench.conform.host.units import FIRST, frames_of, readings_told
from psabench.conform.verdict import Failed, expect, none_of


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """PSD1_CYCLE."""

    cnt: int
    words: tuple[int, int, int]
    read: bool  # all three by a strobe
    overrun: bool
    late: bool
    mixed: bool


def cycles(bus: Bus) -> list[Cycle]:
    """Of PSD-1, from the first NMT start on."""
    return [
        Cycle(
            cnt=f.data[6],
            words=(number(f.data[0:2]), number(f.data[2:4]), number(f.data[4:6])),
            read=f.data[7] & 0x07 == 0x07,
            overrun=bool(f.data[7] & 0x08),
            late=bool(f.data[7] & 0x10),
            mixed=bool(f.data[7] & 0x20),
        )
        for f in frames_of(bus, FIRST)
    ]


def _same(told: Sequence[Reading], due: Sequence[Cycle]) -> None:
    """Raises Failed where a reading is not the cycle that was sent, or not once, or one is missing."""
    for k, (r, c) in enumerate(itertools.zip_longest(told, due)):
        if r is None or c is None or (r.number, r.values) != (c.cnt, c.words):
            raise Failed(
                "nothing more" if r is None else f"reading {r.number} with {r.values}, the {k + 1}th",
                "nothing more" if c is None else f"{c.cnt} with {c.words}",
            )


@checks("HOST-PSD1-04", "psd1_good")
def each_cycle_is_told_once(e: HostCapture) -> str:
    """Words and CNT of a second of cycles."""
    sent = cycles(e.bus)
    _same(readings_told(e), [c for c in sent if not c.mixed])
    e.count("lost", 0)
    return f"{len(e.told.readings)} cycles"


@checks("HOST-PSD1-05", "psd1_lost")
def cycles_that_do_not_come_are_counted(e: HostCapture) -> str:
    """1, 2 and 100 of them: the numbers told, each before the cycle that follows the gap."""
    sent = [c for c in cycles(e.bus) if not c.mixed]
    _same(readings_told(e), sent)
    gaps = {
        i: (b.cnt - a.cnt - 1) % 256
        for i, (a, b) in enumerate(itertools.pairwise(sent), 1)
        if b.cnt != (a.cnt + 1) % 256
    }
    enough(len(gaps) == 3, "three gaps")
    told = {x.at: x.value for x in e.told.events if x.name == "lost"}
    expect(told == gaps, f"lost {told} (readings before: cycles)", f"{gaps}")
    return ", ".join(map(str, gaps.values()))


@checks("HOST-PSD1-03", "psd1_flags")
def flags_of_cycles_are_told(e: HostCapture) -> str:
    """Words were read late, after the next conversion, and not at all for a while."""
    sent = cycles(e.bus)
    due = {name: sum(getattr(c, name) for c in sent) for name in ("overrun", "late", "mixed")}
    enough(all(due.values()), "each of the flags")
    _same(readings_told(e), [c for c in sent if not c.mixed])
    for name, n in due.items():
        e.count(name, n)
    return ", ".join(f"{name} {n}" for name, n in due.items())


@checks("HOST-PSD1-01", "psd1_bus")
def each_word_is_read_at_its_address(e: HostCapture) -> str:
    """The host's cycles on the bus: each word once, X, Y, Z in order, and nothing rejected but for no word yet."""
    odd = [c for c in e.cycles if c.code not in ("", "not-ready")]
    none_of(odd, lambda c: f"address {c.address:02X}h was refused: {c.code}", "none but not-ready")
    order = [c.address for c in e.cycles if c.address <= 2 and not c.code and not c.write]
    enough(cycles(e.bus) or not order, "a cycle")
    if wrong := [k for k, a in enumerate(order) if a != k % 3]:
        raise Failed(f"address {order[wrong[0]]} as word {wrong[0] + 1}", f"{wrong[0] % 3}")
    sent = [c.words for c in cycles(e.bus)]
    told = [r.values for r in readings_told(e)]
    if told != sent[: len(told)] or len(told) < len(sent) - 1:
        k = next((k for k, (t, p) in enumerate(zip(told, sent, strict=False)) if t != p), len(told))
        raise Failed(f"{told[k : k + 1]} as cycle {k + 1}", f"{sent[k : k + 1]}, of {len(sent)}")
    return f"{len(told)} cycles, {len(order)} words"


@checks("HOST-PSD1-02", "psd1_bus")
def strobes_are_in_time(e: HostCapture) -> str:
    """LATE and MIXED of the cycles that the host made."""
    sent = cycles(e.bus)
    enough(len(sent) > 10, "ten cycles")
    late, mixed = sum(c.late for c in sent), sum(c.mixed for c in sent[1:])  # the first may have waited
    due = f"none: the strobe within {limits('HOST-PSD1-02').limit('late_us')} us of FL2"
    expect(not late and not mixed, f"{late} late and {mixed} mixed of {len(sent)} cycles", due)
    return f"{len(sent)} cycles, none late"
