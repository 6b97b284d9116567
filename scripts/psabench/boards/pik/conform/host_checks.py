"""What a host of PIK, PIK-5 and PIK-6 must have told of each case.

What the unit sent is read from the emulator's log by rules of its protocol page alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from psabench.conform.host.capture import Bus, Frame, signed
from psabench.conform.host.check import HostCapture, checks, enough, limits
from psabench.conform.host.units import FIRST, SECOND, THIRD, after_start, readings_told
from psabench.conform.verdict import Failed, expect


@dataclass(frozen=True, slots=True, kw_only=True)
class Pulses:
    """A reading of PIK. totals: since power-up, 32 bits; over: channels that cannot keep up; told: PIK_COUNTS came."""

    seq: int
    totals: tuple[int, int, int]
    over: frozenset[str]
    told: bool


def pulses(bus: Bus) -> list[Pulses]:
    """Of PIK, from the first NMT start on; one whose PIK_COUNTS was lost is numbered after the one before."""
    found: list[Pulses] = []
    counts: Frame | None = None
    xy = (0, 0)
    for f in after_start(bus):
        if len(f.data) != 8:
            continue
        if f.can_id == FIRST + bus.node:
            counts = f
        elif f.can_id == SECOND + bus.node:
            xy = signed(f.data[0:4]), signed(f.data[4:8])
        elif f.can_id == THIRD + bus.node:
            seq = counts.data[6] if counts else (found[-1].seq + 1) % 256 if found else 0
            over = frozenset(a for i, a in enumerate("xyz") if counts and counts.data[7] >> i & 1)
            found.append(Pulses(seq=seq, totals=(*xy, signed(f.data[0:4])), over=over, told=counts is not None))
            counts = None
    return found


SUM_WRAP = 1 << 32  # of PIK's totals


@checks("HOST-PIK-01", "pik_lost")
def increments_that_are_lost_come_back(e: HostCapture) -> str:
    """PIK_COUNTS of 1, 2 and 30 readings do not come: sums of pulses against the totals."""
    sent = pulses(e.bus)
    enough(sum(not p.told for p in sent) == 33, "33 increments that were lost")
    return _sums(e, sent)


@checks("HOST-PIK-02", "pik_bus")
def counters_are_taken_over_their_wraps(e: HostCapture) -> str:
    """A minute at 9 V and -9 V by the registers of 16 bits: sums of pulses against the totals on CAN."""
    sent = pulses(e.bus)
    modulo = int(limits("HOST-PIK-02").limit("modulo"))
    turns = [abs(sent[-1].totals[k] - sent[0].totals[k]) // modulo for k in range(2)] if sent else [0]
    enough(min(turns) >= 1, "a wrap in both directions")
    return f"{_sums(e, sent)}, {turns[0]} and {turns[1]} wraps"


def _sums(e: HostCapture, sent: Sequence[Pulses]) -> str:
    """Raises Failed when a sum told does not differ from the first as the totals of the same reading do."""
    told = readings_told(e)
    at, first = -1, None
    for r in told:
        at = next((k for k in range(at + 1, len(sent)) if sent[k].seq == r.number % 256), -1)
        expect(at >= 0, f"reading {r.number}, which was not played, or not then", "each once, in order")
        first = (r, sent[at]) if first is None else first
        for k, axis in enumerate("xyz"):
            saw = round(r.values[k] - first[0].values[k])
            due = sent[at].totals[k] - first[1].totals[k]
            expect(not (saw - due) % SUM_WRAP, f"{saw} pulses of {axis} up to reading {r.number}", f"{due}")
    if at < len(sent) - 10:
        raise Failed(f"nothing after reading {told[-1].number}{e.last_words()}", f"{len(sent) - 1 - at} more came")
    return f"{len(told)} readings, {round(told[-1].values[0] - told[0].values[0])} pulses of x"


@checks("HOST-PIK-03", "pik_over")
def a_channel_that_cannot_keep_up_is_told(e: HostCapture) -> str:
    """Each channel beyond its range, up and down: what is reported against SAT."""
    readings_told(e)
    due: list[tuple[str, str]] = []
    before: frozenset[str] = frozenset()
    for p in pulses(e.bus):
        due += [("over_range", a) for a in sorted(p.over - before)] + [("in_range", a) for a in sorted(before - p.over)]
        before = p.over
    enough(len(due) >= 12, "each channel beyond its range twice")
    told = [(x.name, x.value) for x in e.told.events if x.name in ("over_range", "in_range")]
    expect(told == due, f"{told}", f"{due}")
    return f"{len(due) // 2} times over the range and back"
