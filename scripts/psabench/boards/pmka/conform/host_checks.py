"""What a host of PMKA must have told of each case.

What the unit sent is read from the emulator's log by rules of its protocol page alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

from psabench.boards.objects import PmkaObjects as OD
from psabench.conform.host.capture import SDO_RX, SDO_TX, Bus, number
from psabench.conform.host.cases_units import INPUT_V
from psabench.conform.host.check import HostCapture, checks, enough, limits
from psabench.conform.host.results import Reading
from psabench.conform.host.units import SECOND, frames_of, readings_told
from psabench.conform.profile import variant
from psabench.conform.verdict import Failed, expect, none_of


@dataclass(frozen=True, slots=True, kw_only=True)
class State:
    """PMKA_STATE. serves: axis 1..3 of each integrator, 0: none; bad: integrators that were saturated or clipped."""

    seq: int
    serves: tuple[int, int, int, int]
    bad: int

    @property
    def home(self) -> bool:
        """Each axis is on its own integrator, and was so for the whole period."""
        return self.serves == (1, 2, 3, 0)

    @property
    def over(self) -> frozenset[str]:
        """Axes whose integrator was at a limit."""
        return frozenset("xyz"[a - 1] for i, a in enumerate(self.serves) if a and self.bad >> i & 1)


def states(bus: Bus) -> list[State]:
    """Of PMKA, from the first NMT start on."""
    found = []
    for f in frames_of(bus, SECOND):
        bits = number(f.data)
        serves = tuple(bits >> (24 + 2 * i) & 3 for i in range(4))
        found.append(
            State(
                seq=bits & 0xFFFF,
                serves=(serves[0], serves[1], serves[2], serves[3]),
                bad=(bits >> 40 | bits >> 44) & 0x0F,
            )
        )
    return found


INDEX, DATA = (OD.BUS, 14), (OD.BUS, 15)  # what its ROM is read by
ROM_WORDS = 6 + 1  # head and sum, at least


@checks("HOST-PMKA-01", "pmka_warm")
def a_minute_of_rotation_is_right(e: HostCapture) -> str:
    """Integrals of steady inputs over a minute in which integrators are calibrated in turn."""
    return _integrals(e, 1.0)


@checks("HOST-PMKA-02", "pmka_cold")
def corrections_of_the_rom_are_used(e: HostCapture) -> str:
    """The ROM is read, and a minute at -10 °C with inputs of the other sign is right."""
    asked = [f for f in e.bus.of(SDO_TX) if f.data[0] & 0xE0 == 0x40 and (number(f.data[1:3]), f.data[3]) == DATA]
    chosen = [f for f in e.bus.of(SDO_RX) if f.data[0] & 0xE0 == 0x20 and (number(f.data[1:3]), f.data[3]) == INDEX]
    if min(len(asked), len(chosen)) < ROM_WORDS:
        raise Failed(f"{len(asked)} words of the ROM were read{e.last_words()}", "all of them, by INDEX and DATA")
    return f"{len(asked)} words of the ROM; {_integrals(e, -1.0)}"


def _integrals(e: HostCapture, sign: float) -> str:
    """Raises Failed when the volt seconds told, between readings with all axes at home, are not the inputs'."""
    row = limits("HOST-PMKA-01")
    ts_s = float(variant("pmka", e.profile)["ts_ns"]) * 1e-9
    numbered = _numbered(readings_told(e), states(e.bus))
    home = [(r, k) for (r, k, s), (_, _, t) in itertools.pairwise(numbered) if s.home and t.home]
    enough(len(home) > 1, "readings with every axis on its own integrator")
    (first, at), (last, end) = home[0], home[-1]
    span_s = (end - at) * ts_s
    expect(span_s >= float(row.limit("duration_s")), f"integrals over {span_s:.1f} s", f"{row.limit('duration_s')} s")
    worst_mmps = 0.0
    for axis, volts in enumerate(INPUT_V):
        off_vs = last.values[axis] - first.values[axis] - sign * volts * span_s
        off_mmps = off_vs * float(row.limit("g_mps2")) / float(row.limit("ma_v_per_g")) * 1e3
        worst_mmps = max(worst_mmps, abs(off_mmps))
        if worst_mmps > float(row.limit("velocity_error_max_mmps")):
            raise Failed(f"{off_mmps:.2f} mm/s wrong on {'xyz'[axis]}", f"{row.limit('velocity_error_max_mmps')} mm/s")
    return f"{span_s:.1f} s, right to {worst_mmps:.2f} mm/s"


def _numbered(told: Sequence[Reading], sent: Sequence[State]) -> list[tuple[Reading, int, State]]:
    """Each reading told with the one that was sent, and its place. Raises Failed for one that was not."""
    found = []
    place = {s.seq: k for k, s in enumerate(sent)}  # none is sent for so long that SEQ wraps
    for r in told:
        expect(r.number in place, f"reading {r.number}, which was not played", "none")
        found.append((r, place[r.number], sent[place[r.number]]))
    return found


@checks("HOST-PMKA-03", "pmka_lost")
def what_is_lost_is_told_and_not_made_up(e: HostCapture) -> str:
    """One reading is lost, then three; input X is beyond the range for half a second."""
    expect(e.streamed, f"no stream was started{e.last_words()}", "NMT start")
    sent = states(e.bus)
    gaps = [(b.seq - a.seq - 1) % 65536 for a, b in itertools.pairwise(sent) if b.seq != (a.seq + 1) % 65536]
    enough(len(gaps) == 2, "two gaps")
    expect(e.told.of("lost") == gaps, f"lost {e.told.of('lost')}", f"{gaps}")
    enough(any(s.over for s in sent), "an integrator at its limit")
    if e.told.of("over_range")[:1] != ["x"] or e.told.of("in_range")[-1:] != ["x"]:
        raise Failed(f"over-range {e.told.of('over_range')}, in range {e.told.of('in_range')}", "x, and its end")
    made = [r.number for r, _, s in _numbered(e.told.readings, sent) if s.over]
    none_of(made, lambda n: f"an integral of reading {n}, which was at its limit", "none")
    whole = [f"{a.number} and {b.number}" for a, b in itertools.pairwise(e.told.readings) if _over_a_gap(a, b, sent)]
    none_of(whole, lambda two: f"integrals of readings {two}, with lost ones between", "sums from 0")
    return f"lost {gaps}, over-range told, nothing made up"


def _over_a_gap(a: Reading, b: Reading, sent: Sequence[State]) -> bool:
    """Whether a sum went on from one to the other although what lies between them is not known."""
    if not any(b.values):  # it has begun again
        return False
    between = [s for s in sent if a.number < s.seq <= b.number]
    return len(between) != b.number - a.number or any(s.over for s in between)
