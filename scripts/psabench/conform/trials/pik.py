"""PIK, PIK-5 and PIK-6 asked over their bus and over CAN."""

from __future__ import annotations

from itertools import pairwise

from psabench.conform.bus_host import line, line_refused
from psabench.conform.dictionary import as_the_dictionary_says
from psabench.conform.outcome import Broken
from psabench.conform.plan import trial
from psabench.conform.proof import proves
from psabench.conform.registers import names_and_rights
from psabench.conform.requirements import requirements
from psabench.conform.subject import Subject
from psabench.signals import unwrap

WORD = 0xFFFF
START_S = 0.03
LATCH, PERIOD, CLEAR = "W B 0", "W C", "W D"


def calm(s: Subject) -> None:
    """As after power-on, with its first readings."""
    s.reset()
    s.run_for(0.002 + START_S)


def by_hand(s: Subject) -> None:
    """Latched by the register alone."""
    calm(s)
    line(s, f"{PERIOD} 0")


def counters(s: Subject) -> list[int]:
    """00h to 08h."""
    return [line(s, f"R {a:X}").data for a in range(9)]


@proves("PIK-CNT-02")
@trial(needs={"bus", "can"})
def the_period_can_be_set(s: Subject) -> str:
    """Set PERIOD 50, then 0 with three writes to LATCH; look at the stamps of the readings."""
    row = requirements()["PIK-CNT-02"]
    calm(s)
    with s.take(lines=False) as take:
        line(s, f"{PERIOD} 32")
        s.unit.start()
        s.run_for(0.1)
        s.unit.stop()
    log = s.evidence("period", take).frames_of("PIK_TOTAL_Z")
    stamps = unwrap(log.raw("PIK_TOTAL_Z")["TSTAMP"], 32).tolist() if len(log) else []
    due = 0x32 * row.limit("unit_us")
    steps = [int(b - a) for a, b in pairwise(stamps)][1:]
    if len(steps) < 5 or max(abs(v - due) for v in steps) > 2:
        raise Broken(f"{steps[:6]} us between readings with PERIOD 50", f"{due:g} us")
    by_hand(s)
    s.run_for(0.05)
    first = line(s, "R 9").data
    for _ in range(3):
        line(s, LATCH)
        s.run_for(0.02)
    made = (line(s, "R 9").data - first) & WORD
    calm(s)
    if made != 3:
        raise Broken(f"{made} readings with three writes to LATCH and PERIOD 0", "3")
    return f"{due:g} us with PERIOD 50, three readings by three writes"


@proves("PIK-CNT-04")
@trial(needs={"bus"})
def registers_hold_what_was_latched(s: Subject) -> str:
    """Latch by hand, read twice a while apart, latch again."""
    by_hand(s)
    line(s, LATCH)
    first = counters(s)
    s.run_for(0.2)
    again = counters(s)
    line(s, LATCH)
    later = counters(s)
    calm(s)
    if first != again:
        raise Broken(f"{first}, then {again}", "the same until the next latch")
    if later == first:
        raise Broken(f"{later} after another latch", "counts that went on")
    return f"{first} twice, then {later}"


@proves("PIK-CNT-05")
@trial(needs={"bus"})
def a_channel_is_up_minus_down(s: Subject) -> str:
    """Read the nine counters of one latch."""
    by_hand(s)
    s.run_for(0.3)
    line(s, LATCH)
    c = counters(s)
    calm(s)
    modulo = int(requirements()["PIK-CNT-05"].limit("modulo"))
    for k in range(3):
        if c[k] != (c[3 + 2 * k] - c[4 + 2 * k]) % modulo:
            raise Broken(f"{'XYZ'[k]} {c[k]}, up {c[3 + 2 * k]}, down {c[4 + 2 * k]}", "the difference")
    if not any(c[3:]):
        raise Broken("no pulse in any counter", "some")
    return f"{c[:3]} of {c[3:]}"


@proves("PIK-CNT-06")
@trial(needs={"bus"})
def counters_can_be_cleared(s: Subject) -> str:
    """Write CLEAR 1 and latch: X begins at 0, Y and Z go on."""
    by_hand(s)
    s.run_for(1.0)
    line(s, LATCH)
    before = counters(s)
    line(s, f"{CLEAR} 1")
    line(s, LATCH)
    after = counters(s)
    calm(s)
    small = min(after[0], (-after[0]) & WORD)
    gone = [(after[k] - before[k]) & WORD for k in (1, 2)]
    if small > 8 or after[3] > 8 or any(min(g, -g & WORD) > 16 for g in gone):
        raise Broken(f"{before[:3]}, after CLEAR 1 {after[:3]}", "X from 0, Y and Z as before")
    return f"{before[:3]}, after CLEAR 1 {after[:3]}"


@proves("PIK-CNT-07")
@trial(needs={"bus"})
def readings_are_numbered_and_status_tells_a_latch(s: Subject) -> str:
    """Latch twice by hand and read SEQ and STATUS."""
    row = requirements()["PIK-CNT-07"]
    latched, saturated = int(row.limit("latched_mask")), int(row.limit("saturated_mask"))
    by_hand(s)
    line(s, "R A")
    none, first = line(s, "R A").data, line(s, "R 9").data
    line(s, LATCH)
    one, again = line(s, "R A").data, line(s, "R A").data
    second = line(s, "R 9").data
    calm(s)
    if none & latched or not one & latched or again & latched:
        raise Broken(f"STATUS {none:04X}h, after a latch {one:04X}h, again {again:04X}h", "bit 3 once")
    if (second - first) & WORD != 1 or (none | one) & saturated:
        raise Broken(f"SEQ {first}, then {second}; STATUS {one:04X}h", "one more, no channel saturated")
    return f"SEQ {first}, then {second}; bit 3 of STATUS once"


@proves("PIK-CNT-08")
@trial(needs={"bus"})
def what_cannot_be_is_refused(s: Subject) -> str:
    """An address that is none, a write to what is read, a read of LATCH and CLEAR, X too early, a period of 0.1 ms."""
    row = requirements()["PIK-CNT-08"]
    calm(s)
    line_refused(s, "R E", row.limit("no_address_code"))
    line_refused(s, "W 0 0", row.limit("read_only_code"))
    line_refused(s, "R B", row.limit("write_only_code"))
    line_refused(s, "R D", row.limit("write_only_code"))
    line_refused(s, "W C 1", row.limit("value_code"))
    s.reset()
    s.run_for(0.003)
    line_refused(s, "R 0", row.limit("state_code"))
    line_refused(s, "R 9", row.limit("state_code"))
    calm(s)
    return "seven refusals with their codes"


@proves("PIK-CNT-09")
@trial(needs={"bus"})
def registers_have_their_names_and_rights(s: Subject) -> str:
    """Ask who is there, read and write every address."""
    calm(s)
    seen = names_and_rights(s, "pik", never={}, writes={"PERIOD": 100})
    calm(s)
    return seen


@proves("PIK-CAN-05")
@trial(needs={"can"})
def the_name_plate_is_right(s: Subject) -> str:
    """Read 2210h."""
    row = requirements()["PIK-CAN-05"]
    kind = "pik6" if s.variant.board == "pik6" else "pik"
    read = s.unit.node.read
    saw = read(0x2210, 1), int(read(0x2210, 2)), int(read(0x2210, 3)), int(read(0x2210, 4))
    due = s.variant.profile, row.limit(f"{kind}_k_mhz_per_v"), row.limit(f"{kind}_rate_hz"), row.limit(f"{kind}_error")
    part = row.limit("plate_tolerance_ppm") * 1e-6  # a plate made for a clock that is off says so
    if saw[0] != due[0] or any(abs(a - b) > b * part for a, b in zip(saw[1:], due[1:], strict=True)):
        raise Broken(f"{saw}", f"{due}")
    return f"{saw[0]}, {saw[1]} mHz/V, {saw[2]} Hz, {saw[3]} in 0.01 %"


@proves("PIK-CAN-06")
@trial(needs={"can"})
def the_board_says_what_it_is(s: Subject) -> str:
    """Read 1008h and 1018h sub 2."""
    name, code = s.unit.node.read(0x1008), int(s.unit.node.read(0x1018, 2))
    due = int(requirements()["PIK-CAN-06"].limit("product_code"))
    if (name, code) != ("PIK", due):
        raise Broken(f"{name}, {code:08X}h", f"PIK, {due:08X}h")
    return f"{name}, {code:08X}h"


@proves("PIK-CAN-07")
@trial(needs={"can"})
def objects_are_as_the_dictionary_says(s: Subject) -> str:
    """Read every object of the EDS and write where nothing may be written."""
    calm(s)
    return as_the_dictionary_says(s, "pik")
