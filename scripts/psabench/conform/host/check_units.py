"""What a host of a PSD-1, a PMKA or a PIK must have told of each case."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

from psabench.conform.host.capture import SDO_RX, SDO_TX, number
from psabench.conform.host.capture_units import Cycle, Pulses, State, cycles, pulses, states
from psabench.conform.host.cases_units import INPUT_V
from psabench.conform.host.check import HostEvidence, enough, judges, limits, proves
from psabench.conform.host.results import Reading
from psabench.conform.profile import variant
from psabench.conform.verdict import Broken

INDEX, DATA = (0x2002, 14), (0x2002, 15)  # of PMKA: what its ROM is read by
ROM_WORDS = 6 + 1  # head and sum, at least
SUM_WRAP = 1 << 32  # of PIK's totals


def _told(e: HostEvidence) -> list[Reading]:
    if not e.streamed:
        raise Broken(f"no stream was started{e.last_words()}", "NMT start")
    if not e.told.readings:
        raise Broken(f"no reading was reported{e.last_words()}", '{"reading": ...}')
    return e.told.readings


def _same(told: Sequence[Reading], due: Sequence[Cycle]) -> None:
    """Raises Broken where a reading is not the cycle that was played, or not once, or one is missing."""
    for k, (r, c) in enumerate(itertools.zip_longest(told, due)):
        if r is None or c is None or (r.number, r.values) != (c.cnt, c.words):
            raise Broken(
                "nothing more" if r is None else f"reading {r.number} with {r.values}, the {k + 1}th",
                "nothing more" if c is None else f"{c.cnt} with {c.words}",
            )


# ---- PSD-1


@proves("HOST-PSD1-04")
@judges("psd1_good")
def each_cycle_is_told_once(e: HostEvidence) -> str:
    """Words and CNT of a second of cycles."""
    played = cycles(e.bus)
    _same(_told(e), [c for c in played if not c.mixed])
    e.count("lost", 0)
    return f"{len(e.told.readings)} cycles"


@proves("HOST-PSD1-05")
@judges("psd1_lost")
def cycles_that_do_not_come_are_counted(e: HostEvidence) -> str:
    """1, 2 and 100 of them: the numbers told, each before the cycle that follows the gap."""
    played = [c for c in cycles(e.bus) if not c.mixed]
    _same(_told(e), played)
    gaps = {
        i: (b.cnt - a.cnt - 1) % 256
        for i, (a, b) in enumerate(itertools.pairwise(played), 1)
        if b.cnt != (a.cnt + 1) % 256
    }
    enough(len(gaps) == 3, "three gaps")
    told = {x.at: x.value for x in e.told.events if x.name == "lost"}
    if told != gaps:
        raise Broken(f"lost {told} (readings before: cycles)", f"{gaps}")
    return ", ".join(map(str, gaps.values()))


@proves("HOST-PSD1-03")
@judges("psd1_flags")
def flags_of_cycles_are_told(e: HostEvidence) -> str:
    """Words were read late, after the next conversion, and not at all for a while."""
    played = cycles(e.bus)
    due = {name: sum(getattr(c, name) for c in played) for name in ("overrun", "late", "mixed")}
    enough(all(due.values()), "each of the flags")
    _same(_told(e), [c for c in played if not c.mixed])
    for name, n in due.items():
        e.count(name, n)
    return ", ".join(f"{name} {n}" for name, n in due.items())


@proves("HOST-PSD1-01")
@judges("psd1_bus")
def each_word_is_read_at_its_address(e: HostEvidence) -> str:
    """The host's cycles on the bus: each word once, X, Y, Z in order, and nothing refused but for no word yet."""
    odd = [c for c in e.cycles if c.code not in ("", "not-ready")]
    if odd:
        raise Broken(f"address {odd[0].address:02X}h was refused: {odd[0].code}", "none but not-ready")
    order = [c.address for c in e.cycles if c.address <= 2 and not c.code and not c.write]
    enough(cycles(e.bus) or not order, "a cycle")
    if wrong := [k for k, a in enumerate(order) if a != k % 3]:
        raise Broken(f"address {order[wrong[0]]} as word {wrong[0] + 1}", f"{wrong[0] % 3}")
    played = [c.words for c in cycles(e.bus)]
    told = [r.values for r in _told(e)]
    if told != played[: len(told)] or len(told) < len(played) - 1:
        k = next((k for k, (t, p) in enumerate(zip(told, played, strict=False)) if t != p), len(told))
        raise Broken(f"{told[k : k + 1]} as cycle {k + 1}", f"{played[k : k + 1]}, of {len(played)}")
    return f"{len(told)} cycles, {len(order)} words"


@proves("HOST-PSD1-02")
@judges("psd1_bus")
def strobes_are_in_time(e: HostEvidence) -> str:
    """LATE and MIXED of the cycles that the host made."""
    played = cycles(e.bus)
    enough(len(played) > 10, "ten cycles")
    late, mixed = sum(c.late for c in played), sum(c.mixed for c in played[1:])  # the first may have waited
    if late or mixed:
        raise Broken(
            f"{late} late and {mixed} mixed of {len(played)} cycles",
            f"none: the strobe within {limits('HOST-PSD1-02').limit('late_us')} us of FL2",
        )
    return f"{len(played)} cycles, none late"


# ---- PMKA


@proves("HOST-PMKA-01")
@judges("pmka_warm")
def a_minute_of_rotation_is_right(e: HostEvidence) -> str:
    """Integrals of steady inputs over a minute in which integrators are calibrated in turn."""
    return _integrals(e, 1.0)


@proves("HOST-PMKA-02")
@judges("pmka_cold")
def corrections_of_the_rom_are_used(e: HostEvidence) -> str:
    """The ROM is read, and a minute at -10 °C with inputs of the other sign is right."""
    asked = [f for f in e.bus.of(SDO_TX) if f.data[0] & 0xE0 == 0x40 and (number(f.data[1:3]), f.data[3]) == DATA]
    chosen = [f for f in e.bus.of(SDO_RX) if f.data[0] & 0xE0 == 0x20 and (number(f.data[1:3]), f.data[3]) == INDEX]
    if min(len(asked), len(chosen)) < ROM_WORDS:
        raise Broken(f"{len(asked)} words of the ROM were read{e.last_words()}", "all of them, by INDEX and DATA")
    return f"{len(asked)} words of the ROM; {_integrals(e, -1.0)}"


def _integrals(e: HostEvidence, sign: float) -> str:
    """Raises Broken when the volt seconds told, between readings with all axes at home, are not the inputs'."""
    row = limits("HOST-PMKA-01")
    ts_s = float(variant("pmka", e.profile)["ts_ns"]) * 1e-9
    numbered = _numbered(_told(e), states(e.bus))
    home = [(r, k) for (r, k, s), (_, _, t) in itertools.pairwise(numbered) if s.home and t.home]
    enough(len(home) > 1, "readings with every axis on its own integrator")
    (first, at), (last, end) = home[0], home[-1]
    span_s = (end - at) * ts_s
    if span_s < float(row.limit("duration_s")):
        raise Broken(f"integrals over {span_s:.1f} s", f"{row.limit('duration_s')} s")
    worst_mmps = 0.0
    for axis, volts in enumerate(INPUT_V):
        off_vs = last.values[axis] - first.values[axis] - sign * volts * span_s
        off_mmps = off_vs * float(row.limit("g_mps2")) / float(row.limit("ma_v_per_g")) * 1e3
        worst_mmps = max(worst_mmps, abs(off_mmps))
        if worst_mmps > float(row.limit("velocity_error_max_mmps")):
            raise Broken(f"{off_mmps:.2f} mm/s wrong on {'xyz'[axis]}", f"{row.limit('velocity_error_max_mmps')} mm/s")
    return f"{span_s:.1f} s, right to {worst_mmps:.2f} mm/s"


def _numbered(told: Sequence[Reading], played: Sequence[State]) -> list[tuple[Reading, int, State]]:
    """Each reading told with the one that was played, and its place. Raises Broken for one that was not."""
    found = []
    place = {s.seq: k for k, s in enumerate(played)}  # none is played for so long that SEQ wraps
    for r in told:
        if r.number not in place:
            raise Broken(f"reading {r.number}, which was not played", "none")
        found.append((r, place[r.number], played[place[r.number]]))
    return found


@proves("HOST-PMKA-03")
@judges("pmka_lost")
def what_is_lost_is_told_and_not_made_up(e: HostEvidence) -> str:
    """One reading is lost, then three; input X is beyond the range for half a second."""
    if not e.streamed:
        raise Broken(f"no stream was started{e.last_words()}", "NMT start")
    played = states(e.bus)
    gaps = [(b.seq - a.seq - 1) % 65536 for a, b in itertools.pairwise(played) if b.seq != (a.seq + 1) % 65536]
    enough(len(gaps) == 2, "two gaps")
    if e.told.of("lost") != gaps:
        raise Broken(f"lost {e.told.of('lost')}", f"{gaps}")
    enough(any(s.over for s in played), "an integrator at its limit")
    if e.told.of("over_range")[:1] != ["x"] or e.told.of("in_range")[-1:] != ["x"]:
        raise Broken(f"over-range {e.told.of('over_range')}, in range {e.told.of('in_range')}", "x, and its end")
    if made := [r for r, _, s in _numbered(e.told.readings, played) if s.over]:
        raise Broken(f"an integral of reading {made[0].number}, which was at its limit", "none")
    if whole := [(a, b) for a, b in itertools.pairwise(e.told.readings) if _over_a_gap(a, b, played)]:
        (a, b) = whole[0]
        raise Broken(f"integrals of readings {a.number} and {b.number}, with lost ones between", "sums from 0")
    return f"lost {gaps}, over-range told, nothing made up"


def _over_a_gap(a: Reading, b: Reading, played: Sequence[State]) -> bool:
    """Whether a sum went on from one to the other although what lies between them is not known."""
    if not any(b.values):  # it has begun again
        return False
    between = [s for s in played if a.number < s.seq <= b.number]
    return len(between) != b.number - a.number or any(s.over for s in between)


# ---- PIK


@proves("HOST-PIK-01")
@judges("pik_lost")
def increments_that_are_lost_come_back(e: HostEvidence) -> str:
    """PIK_COUNTS of 1, 2 and 30 readings do not come: sums of pulses against the totals."""
    played = pulses(e.bus)
    enough(sum(not p.told for p in played) == 33, "33 increments that were lost")
    return _sums(e, played)


@proves("HOST-PIK-02")
@judges("pik_bus")
def counters_are_taken_over_their_wraps(e: HostEvidence) -> str:
    """A minute at 9 V and -9 V by the registers of 16 bits: sums of pulses against the totals on CAN."""
    played = pulses(e.bus)
    modulo = int(limits("HOST-PIK-02").limit("modulo"))
    turns = [abs(played[-1].totals[k] - played[0].totals[k]) // modulo for k in range(2)] if played else [0]
    enough(min(turns) >= 1, "a wrap in both directions")
    return f"{_sums(e, played)}, {turns[0]} and {turns[1]} wraps"


def _sums(e: HostEvidence, played: Sequence[Pulses]) -> str:
    """Raises Broken when a sum told does not differ from the first as the totals of the same reading do."""
    told = _told(e)
    at, first = -1, None
    for r in told:
        at = next((k for k in range(at + 1, len(played)) if played[k].seq == r.number % 256), -1)
        if at < 0:
            raise Broken(f"reading {r.number}, which was not played, or not then", "each once, in order")
        first = (r, played[at]) if first is None else first
        for k, axis in enumerate("xyz"):
            saw = round(r.values[k] - first[0].values[k])
            due = played[at].totals[k] - first[1].totals[k]
            if (saw - due) % SUM_WRAP:
                raise Broken(f"{saw} pulses of {axis} up to reading {r.number}", f"{due}")
    if at < len(played) - 10:
        raise Broken(f"nothing after reading {told[-1].number}{e.last_words()}", f"{len(played) - 1 - at} more came")
    return f"{len(told)} readings, {round(told[-1].values[0] - told[0].values[0])} pulses of x"


@proves("HOST-PIK-03")
@judges("pik_over")
def a_channel_that_cannot_keep_up_is_told(e: HostEvidence) -> str:
    """Each channel beyond its range, up and down: what is reported against SAT."""
    _told(e)
    due: list[tuple[str, str]] = []
    before: frozenset[str] = frozenset()
    for p in pulses(e.bus):
        due += [("over_range", a) for a in sorted(p.over - before)] + [("in_range", a) for a in sorted(before - p.over)]
        before = p.over
    enough(len(due) >= 12, "each channel beyond its range twice")
    told = [(x.name, x.value) for x in e.told.events if x.name in ("over_range", "in_range")]
    if told != due:
        raise Broken(f"{told}", f"{due}")
    return f"{len(due) // 2} times over the range and back"
