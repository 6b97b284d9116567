"""PSD-1's parallel bus through the bus port: registers, rejections, channels, what is latched."""

from __future__ import annotations

import math

from psabench.boards.objects import Psd1Objects as OD
from psabench.boards.psd1.conform.host import (
    BOTH,
    TURN_DPS,
    calm,
    drive,
    has_host,
    period_s,
    run_cycles,
    status,
    while_turning,
    word,
)
from psabench.conform.bus_host import SHORT_S, burst, line, line_refused
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.registers import names_and_rights, one_value
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, expect
from psabench.errors import CycleRefused

CYCLE = 0x08  # of STATUS
OTHERS = tuple(f"R {a:X}" for a in range(4, 10))  # gyros and rate sensors
GYROS = OD.GYRO
ATTEMPTS = 40  # to read twice within a millisecond
ANGLE_DEG = 10.0  # more than half of what 16 bits of arc seconds hold
ASKEW = 0.01  # what a gyro square to the axis may see of a turn
HALF_S = 100e-6  # from one word to the next, and some more
CYCLE_S = 40e-6  # less than a cycle takes
SCAN_S = 120e-6  # of two cycles and more
SCAN_STEP_S = 0.8e-6  # less than a word waits for the built-in host


def _waiting(s: Dut, axis: int = 0) -> None:
    """Let a cycle run until the word of an axis waits."""
    calm(s)
    line(s, f"W F {BOTH:04X}")
    s.run_for(2 * period_s(s.variant))
    for k in range(axis):
        word(s, k)
        s.run_for(HALF_S)


@active("PSD1-CYC-02", needs={"bus"}, before=calm)
def no_cycle_without_int0_and_fl1(s: Dut) -> str:
    """Write FLAGS 0, 1 and 2, look for a running cycle after each, then write 3."""
    if has_host(s.variant):
        return _without_flags(s)
    for flags in (0, 1, 2):
        line(s, f"W F {flags:04X}")
        s.run_for(3 * period_s(s.variant))
        expect(not status(s) & CYCLE, f"a cycle with FLAGS {flags}", "none without both INT0 and FL1")
    _waiting(s)
    expect(status(s) & CYCLE, "no cycle with FLAGS 3", "one")
    calm(s)
    return "no cycle with FLAGS 0, 1 and 2, one with 3"


def _without_flags(s: Dut) -> str:
    """Where the board reads its words itself it counts them."""
    found = {}
    for flags in (0, 1, 2, BOTH):
        line(s, f"W F {flags:04X}")
        s.run_for(period_s(s.variant))
        before = int(s.unit.node.read(OD.COUNTERS, 12))
        s.run_for(3 * period_s(s.variant))
        found[flags] = int(s.unit.node.read(OD.COUNTERS, 12)) - before
    calm(s)
    if any(found[k] for k in (0, 1, 2)) or not found[BOTH]:
        raise Failed(f"cycles with FLAGS 0 to 3: {list(found.values())}", "none but with 3")
    return f"no cycle with FLAGS 0, 1 and 2, {found[BOTH]} with 3"


@active("PSD1-CYC-05", needs={"bus"}, after=calm)
def a_cycle_goes_on_without_its_conditions(s: Dut) -> str:
    """Write FLAGS 0 while X waits, read the three words, look for another cycle."""
    _waiting(s)
    line(s, "W F 0000")
    words = [word(s, axis).data for axis in range(3)]
    s.run_for(4 * period_s(s.variant))
    expect(not status(s) & CYCLE, "another cycle", "none with INT0 and FL1 away")
    return f"words {' '.join(f'{w:04X}h' for w in words)}, then no cycle"


@active("PSD1-FL2-06", needs={"bus"}, after=calm)
def a_word_waits_for_its_strobe(s: Dut) -> str:
    """Leave X unread for a second, then read X, Y and Z."""
    _waiting(s)
    before = line(s, "R 3").data & 0x07
    s.run_for(1.0)
    after = line(s, "R 3").data & 0x07
    if (before, after) != (1, 1):
        raise Failed(f"bits 2..0 of STATUS {before:03b} and, a second later, {after:03b}", "X waits: 001")
    words = [word(s, axis).data for axis in range(3)]
    return f"X waited for a second, then {' '.join(f'{w:04X}h' for w in words)}"


@active("PSD1-BUS-02", needs={"bus", "can"}, before=calm, after=calm)
def words_are_answered_at_their_addresses(s: Dut) -> str:
    """Read X, Y and Z at 00h, 01h and 02h, and compare them with what the board tells of that cycle."""
    for _ in range(4):
        words = [c.data for c in drive(s, 1)]
        told = [int(s.unit.node.read(OD.CODES, k)) for k in (1, 2, 3)]
        if words != told:
            raise Failed(f"{[f'{w:04X}h' for w in words]} on the bus", f"{[f'{w:04X}h' for w in told]} as 2200h tells")
    return "four cycles, the words at 00h, 01h and 02h"


@active("PSD1-BUS-03", needs={"bus"}, before=calm, after=calm)
def a_strobe_for_another_word_is_refused(s: Dut, row: Requirement) -> str:
    """Read Y and Z while X waits, then X; read X before there is a cycle."""
    code = row.limit("abort_code")
    line_refused(s, "R 0", code)
    _waiting(s)
    line_refused(s, "R 2", code)
    line_refused(s, "R 1", code)
    first = line(s, "R 0").data
    expect(first != 0, "0000h from X after refusals", "its word")
    return f"refused, and X gave {first:04X}h afterwards"


@active("PSD1-BUS-04", needs={"bus"}, after=calm)
def a_word_is_taken_once(s: Dut, row: Requirement) -> str:
    """Read X twice."""
    code = row.limit("abort_code")
    _waiting(s)
    line(s, "R 0")
    line_refused(s, "R 0", code)
    return "the second strobe is refused"


@active("PSD1-BUS-05", needs={"bus"}, before=calm)
def words_of_the_built_in_host_are_refused(s: Dut, row: Requirement) -> str:
    """Read X, Y and Z while the board reads them itself, each time a little earlier in the cycle."""
    code = row.limit("abort_code")
    strobes = round(SCAN_S / SCAN_STEP_S)
    for axis in range(3):
        _into_a_cycle(s)
        s.run_for(period_s(s.variant) + SCAN_S / 2)
        for _ in range(strobes):
            line_refused(s, f"R {axis:X}", code)
            _a_period_later(s, SCAN_STEP_S)
    return f"{3 * strobes} strobes refused"


def _into_a_cycle(s: Dut) -> None:
    """Look for a running cycle, in one period after the other."""
    for _ in range(math.ceil(period_s(s.variant) / CYCLE_S)):
        if status(s) & CYCLE:
            return
        _a_period_later(s, CYCLE_S)


def _a_period_later(s: Dut, less_s: float) -> None:
    """From the answer to a line to when it was sent, a period later and so much less."""
    s.run_for(period_s(s.variant) - SHORT_S - less_s)


@active("PSD1-BUS-06", needs={"bus"}, before=calm, after=calm)
def registers_have_their_names_and_rights(s: Dut) -> str:
    """Ask who is there, read and write every address."""
    words = {"X": 0x08000022, "Y": 0x08000022, "Z": 0x08000022}
    return names_and_rights(s, "psd1", never=words, writes={"COMMAND": 3, "TEMP": 1, "SERVICE": 2, "FLAGS": 0})


@active("BUS-PORT-11", needs={"bus", "can"}, before=calm, after=calm, boards=("psd1",))
def registers_show_what_their_objects_show(s: Dut) -> str:
    """Read gyros and rate sensors beside the objects of the same cycle, on a table that turns."""

    def next_reading(s: Dut) -> None:
        line(s, f"W F {BOTH:04X}")
        run_cycles(s, 2)
        line(s, "W F 0000")
        s.run_for(period_s(s.variant))

    with while_turning(s) as turns:
        return one_value(s, "psd1", next_reading, OD.CYCLE, told_apart=turns)


@active("PSD1-BUS-10", needs={"bus"}, before=calm)
def channels_come_back_with_their_codes(s: Dut, row: Requirement) -> str:
    """Write each channel to TEMP and SERVICE and read it back."""
    bits = int(row.limit("code_bits"))
    seen = []
    for address in ("A", "B"):
        for channel in range(int(row.limit("channels_count"))):
            line(s, f"W {address} {channel:04X}")
            got = line(s, f"R {address}").data
            expect(got >> bits == channel, f"{got:04X}h at 0{address}h", f"channel {channel} above {bits} bits")
            seen.append(f"{got & (1 << bits) - 1:03X}h")
    return f"codes {' '.join(seen)}"


@active("PSD1-BUS-11", needs={"bus"}, before=calm)
def the_other_signals_are_there(s: Dut) -> str:
    """Read gyros, rate sensors, temperatures and service signals."""
    run_cycles(s, 3)
    gyros = [line(s, f"R {a:X}").data for a in range(4, 7)]
    rates = [line(s, f"R {a:X}").data for a in range(7, 10)]
    service = []
    for channel in range(4):
        line(s, f"W B {channel:04X}")
        service.append(line(s, "R B").data & 0xFFF)
    expect(service[0] and service[1], f"codes of supply and reference {service[0]}, {service[1]}", "neither is 0 V")
    self_test = service[3]
    if self_test & 0x1F != 0x1F:
        raise Failed(f"self-test {self_test:03X}h", "converters 0..2, coefficients and set-up: bits 0 to 4")
    return f"gyros {gyros}, rates {rates}, service {service}"


@active("PSD1-BUS-11", needs={"bus", "supply"}, before=calm)
def the_service_signal_follows_the_supply(s: Dut, row: Requirement) -> str:
    """Lower the supply by a twentieth and read its code before and after."""
    line(s, "W B 0000")
    supply = s.bench.supply
    volts = supply.volt_v
    s.run_for(0.2)
    before = line(s, "R B").data & 0xFFF
    try:
        supply.set(volts * row.limit("lowered_part"))
        s.run_for(0.2)
        after = line(s, "R B").data & 0xFFF
    finally:
        supply.set(volts)
        s.run_for(0.2)
    if abs(after / max(before, 1) - row.limit("lowered_part")) > row.limit("tolerance_pct") / 100:
        raise Failed(f"code {before}, at 95 % of the supply {after}", "95 % of it")
    return f"code {before}, at 95 % of the supply {after}"


@active("PSD1-BUS-12", needs={"bus"})
def gyros_are_latched_with_the_cycle(s: Dut) -> str:
    """Read the registers of gyros and rate sensors twice in a cycle; where there is a rate table it turns meanwhile."""
    with while_turning(s) as turns:
        first, later = _latched(s), _latched(s)
    calm(s)
    if turns and first[:3] == later[:3]:
        raise Failed(f"gyros {first[:3]} in two cycles of a board that turns", "counts that go on")
    return f"{first} twice in a cycle" + (f", then {later}" if turns else "")


def _latched(s: Dut) -> list[int]:
    """04h to 09h, each as it was read twice in one cycle. Raises Failed for one that no cycle shows twice alike."""
    calm(s)
    if not has_host(s.variant):
        _waiting(s)  # for its host: this cycle lasts
    found = []
    for text in OTHERS:
        for attempt in range(1 if not has_host(s.variant) else ATTEMPTS):
            first, again = _twice(s, text)
            if first == again:
                break
            s.run_for(period_s(s.variant) * (0.1 + 0.07 * attempt))  # a cycle may have passed between
        else:
            raise Failed(f"{first}, then {again} from {text}", "the same in one cycle")
        found.append(first)
    return found


def _twice(s: Dut, text: str) -> tuple[int, int]:
    if has_host(s.variant):
        first, again = burst(s, text, text)
        return first.data, again.data
    first = line(s, text)
    s.run_for(0.02)
    return first.data, line(s, text).data


@active("PSD1-BUS-13", needs={"bus", "can", "table"})
def gyros_count_arc_seconds(s: Dut, row: Requirement) -> str:
    """Turn a rate table by ten degrees and back; compare counts with its readout, and 04h to 06h with the counts."""
    modulo, table = 1 << int(row.limit("code_bits")), s.bench.table
    calm(s)
    at_deg, counts, seen = table.angle_deg(), _gyros(s), []
    for to_deg in (at_deg + ANGLE_DEG, at_deg):
        before_deg, before = table.angle_deg(), counts
        table.position(to_deg, TURN_DPS)
        counts = _gyros(s)
        turned_arcsec = (table.angle_deg() - before_deg) * 3600
        moved = [b - a for a, b in zip(before, counts, strict=True)]
        due = turned_arcsec / row.limit("count_arcsec")
        most = row.limit("tolerance_counts") + abs(due) * row.limit("scale_error_ppm") * 1e-6
        mine = max(range(3), key=lambda k: abs(moved[k]))
        others = [abs(m) for k, m in enumerate(moved) if k != mine]
        if abs(abs(moved[mine]) - abs(due)) > most or max(others) > ASKEW * abs(due):
            raise Failed(f"{moved} counts", f"{abs(due):.1f} +- {most:.1f} of one of them")
        seen.append((mine, moved[mine]))
        words = [c.data for c in burst(s, *OTHERS[:3])]
        off = [(c - w + modulo // 2) % modulo - modulo // 2 for c, w in zip(counts, words, strict=True)]
        if max(map(abs, off)) > row.limit("tolerance_counts"):
            raise Failed(f"{words} at 04h to 06h", f"{counts} modulo {modulo}")
    table.stop()
    calm(s)
    if seen[0][0] != seen[1][0] or seen[0][1] * seen[1][1] > 0:
        raise Failed(f"{seen[0][1]} counts one way, {seen[1][1]} the other", "signs that differ")
    return f"{seen[0][1]} and {seen[1][1]} counts of gyro {'XYZ'[seen[0][0]]} for {ANGLE_DEG:g} deg and back"


def _gyros(s: Dut) -> list[int]:
    """2047h as of a cycle that begins now."""
    run_cycles(s, 2)
    return [int(s.unit.node.read(GYROS, k)) for k in (1, 2, 3)]


@active("PSD1-LATE-04", needs={"bus", "can"}, before=calm)
def refusals_are_counted(s: Dut) -> str:
    """Strobe what is rejected, and words that seldom wait; look at the counters."""
    counters = s.unit.counters()
    refused = sum(_is_refused(s, text) for text in ("R 0", "R 1", "R 2", "W 3 0", "R 3 100", "R 4 150"))
    now = s.unit.counters()
    told = now["Refused strobes"] - counters["Refused strobes"], now["Short strobes"] - counters["Short strobes"]
    if told != (refused, 2) or refused < 3:  # a word may just wait, one write and two short strobes are always rejected
        raise Failed(f"{refused} refused; counted {told[0]}, too short {told[1]}", "3 to 6, as many, 2")
    return f"{refused} refusals counted, two of them too short"


def _is_refused(s: Dut, text: str) -> bool:
    try:
        line(s, text)
    except CycleRefused:
        return True
    return False
