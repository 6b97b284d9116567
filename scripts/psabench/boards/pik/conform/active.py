"""PIK, PIK-5 and PIK-6 asked over their bus and over CAN."""

from __future__ import annotations

from itertools import pairwise

from psabench.boards.objects import PikObjects as OD
from psabench.conform.bus_host import burst, line, line_refused
from psabench.conform.dictionary import as_the_dictionary_says, identity
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.registers import names_and_rights, one_value
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.stimulus.streamed import while_streaming
from psabench.conform.verdict import Failed, conclusive, expect
from psabench.link.signals import unwrap

WORD = 0xFFFF
START_S = 0.03
LATCH, PERIOD, CLEAR = "W B 0", "W C", "W D"
COUNTERS = tuple(f"R {a:X}" for a in range(9))
HALF = 0.5  # a step of the name plate
SEQ_MODULO = 256  # of PIK_COUNTS


def calm(s: Dut) -> None:
    """As after power-on, with its first readings."""
    s.reset()
    s.run_for(0.002 + START_S)


def by_hand(s: Dut) -> None:
    """Latched by the register alone."""
    calm(s)
    line(s, f"{PERIOD} 0")


def counters(s: Dut) -> list[int]:
    """00h to 08h."""
    return [c.data for c in burst(s, *COUNTERS)]


def signed(word: int, bits: int = 16) -> int:
    """Two's complement."""
    return (word + (1 << bits - 1)) % (1 << bits) - (1 << bits - 1)


@active("PIK-CNT-02", needs={"bus", "can"}, before=calm)
def the_period_can_be_set(s: Dut, row: Requirement) -> str:
    """Set PERIOD 50, then 0 with three writes to LATCH; look at the stamps of the readings."""
    with s.take(lines=False) as take:
        line(s, f"{PERIOD} 32")
        with while_streaming(s):
            s.run_for(0.1)
    log = s.capture("period", take).frames_of("PIK_TOTAL_Z")
    stamps = unwrap(log.raw("PIK_TOTAL_Z")["TSTAMP"], 32).tolist() if len(log) else []
    due = 0x32 * row.limit("unit_us")
    steps = [int(b - a) for a, b in pairwise(stamps)][1:]
    rounded_us = 2 * requirements()["PIK-CAN-03"].limit("unit_us")  # two stamps
    if len(steps) < 5 or max(abs(v - due) for v in steps) > rounded_us:
        raise Failed(f"{steps[:6]} us between readings with PERIOD 50", f"{due:g} us")
    by_hand(s)
    s.run_for(0.05)
    first = line(s, "R 9").data
    for _ in range(3):
        line(s, LATCH)
        s.run_for(0.02)
    made = (line(s, "R 9").data - first) & WORD
    calm(s)
    expect(made == 3, f"{made} readings with three writes to LATCH and PERIOD 0", "3")
    return f"{due:g} us with PERIOD 50, three readings by three writes"


@active("PIK-CNT-04", needs={"bus"}, before=by_hand)
def registers_hold_what_was_latched(s: Dut) -> str:
    """Latch by hand, read twice a while apart, latch again."""
    line(s, LATCH)
    first = counters(s)
    s.run_for(0.2)
    again = counters(s)
    line(s, LATCH)
    later = counters(s)
    calm(s)
    expect(first == again, f"{first}, then {again}", "the same until the next latch")
    expect(later != first, f"{later} after another latch", "counts that went on")
    return f"{first} twice, then {later}"


@active("PIK-CNT-05", needs={"bus"}, before=by_hand)
def a_channel_is_up_minus_down(s: Dut, row: Requirement) -> str:
    """Read the nine counters of one latch."""
    s.run_for(0.3)
    line(s, LATCH)
    c = counters(s)
    calm(s)
    modulo = int(row.limit("modulo"))
    for k in range(3):
        if c[k] != (c[3 + 2 * k] - c[4 + 2 * k]) % modulo:
            raise Failed(f"{'XYZ'[k]} {c[k]}, up {c[3 + 2 * k]}, down {c[4 + 2 * k]}", "the difference")
    expect(any(c[3:]), "no pulse in any counter", "some")
    return f"{c[:3]} of {c[3:]}"


@active("PIK-CNT-06", needs={"bus"}, before=by_hand)
def counters_can_be_cleared(s: Dut, row: Requirement) -> str:
    """Measure rates with two latches, write CLEAR 1 and latch: X has counted since, Y and Z all the time."""
    most = row.limit("error_max_pulses")
    first = burst(s, LATCH, *COUNTERS)
    s.run_for(1.0)
    cycles = burst(s, LATCH, *COUNTERS, f"{CLEAR} 1", LATCH, *COUNTERS)
    calm(s)
    cleared, latched = cycles[10], cycles[11]
    zero, before, after = ([c.data for c in part[1:10]] for part in (first, cycles[:10], cycles[11:]))
    took_s = cycles[0].t_s - first[0].t_s
    rate_hz = [signed(b - a) / took_s for a, b in zip(zero[:3], before[:3], strict=True)]
    since_s = [latched.t_s - cleared.t_s] + [latched.t_s - cycles[0].t_s] * 2
    made = [signed(after[0])] + [signed(after[k] - before[k]) for k in (1, 2)]
    off = [abs(m - r * t) for m, r, t in zip(made, rate_hz, since_s, strict=True)]
    conclusive(abs(signed(before[0])) >= 8 * most, f"{signed(before[0])} pulses of X before CLEAR")
    if max(off) > most or abs(after[3] + after[4] - abs(made[0])) > most:
        raise Failed(f"{before}, after CLEAR 1 {after}", "X, XP and XN from 0, Y and Z as before")
    return f"{before[:3]}, after CLEAR 1 {after[:3]}"


@active("PIK-RES-01", needs={"bus", "can"}, before=calm)
def registers_begin_with_res(s: Dut) -> str:
    """Let it count for a second, press Res, and compare the registers of a reading with its totals on CAN."""
    s.run_for(1.0)
    s.reset()
    with s.take(lines=False) as take:
        s.run_for(0.002 + START_S)
        with while_streaming(s):
            seen = []
            for _ in range(8):
                cycles = burst(s, "R 9", *COUNTERS, "R 9")
                if cycles[0].data == cycles[-1].data:
                    seen.append((cycles[0].data, [c.data for c in cycles[1:-1]]))
                s.run_for(0.01)
    e = s.capture("registers", take)
    counts, xy, z = (e.frames_of(name) for name in ("PIK_COUNTS", "PIK_TOTALS", "PIK_TOTAL_Z"))
    n = min(len(counts), len(xy), len(z))
    conclusive(n, "no reading came")
    seq, xy_raw, z_raw = counts.raw("PIK_COUNTS")["SEQ"][:n], xy.raw("PIK_TOTALS"), z.raw("PIK_TOTAL_Z")["Z"][:n]
    told = {
        int(k): (int(a), int(b), int(c))
        for k, a, b, c in zip(seq, xy_raw["X"][:n], xy_raw["Y"][:n], z_raw, strict=True)
    }
    found = 0
    for number, words in seen:
        if number >= SEQ_MODULO or number not in told:
            continue
        due = told[number]
        if [signed(w) for w in words[:3]] != [signed(t & WORD) for t in due] or sum(words[3:]) > 2 * sum(map(abs, due)):
            raise Failed(f"{words} in reading {number}", f"{list(due)} since Res")
        found += 1
    conclusive(found, "no reading was seen on the bus and on CAN")
    return f"{found} readings with the same counts since Res in registers and totals"


@active("PIK-CNT-07", needs={"bus"}, before=by_hand)
def readings_are_numbered_and_status_tells_a_latch(s: Dut, row: Requirement) -> str:
    """Latch twice by hand and read SEQ and STATUS."""
    latched, saturated = int(row.limit("latched_mask")), int(row.limit("saturated_mask"))
    none, first, _, one, again, second = (c.data for c in burst(s, "R A", "R A", "R 9", LATCH, "R A", "R A", "R 9")[1:])
    calm(s)
    if none & latched or not one & latched or again & latched:
        raise Failed(f"STATUS {none:04X}h, after a latch {one:04X}h, again {again:04X}h", "bit 3 once")
    if (second - first) & WORD != 1 or (none | one) & saturated:
        raise Failed(f"SEQ {first}, then {second}; STATUS {one:04X}h", "one more, no channel saturated")
    return f"SEQ {first}, then {second}; bit 3 of STATUS once"


@active("PIK-CNT-08", needs={"bus"}, before=calm, after=calm)
def what_cannot_be_is_refused(s: Dut, row: Requirement) -> str:
    """An address that is none, a write to what is read, a read of LATCH and CLEAR, X too early, a period of 0.1 ms."""
    line_refused(s, "R E", row.limit("no_address_code"))
    line_refused(s, "W 0 0", row.limit("read_only_code"))
    line_refused(s, "R B", row.limit("write_only_code"))
    line_refused(s, "R D", row.limit("write_only_code"))
    line_refused(s, "W C 1", row.limit("value_code"))
    s.reset()
    s.run_for(0.003)
    line_refused(s, "R 0", row.limit("state_code"))
    line_refused(s, "R 9", row.limit("state_code"))
    return "seven refusals with their codes"


@active("PIK-CNT-09", needs={"bus"}, before=calm, after=calm)
def registers_have_their_names_and_rights(s: Dut) -> str:
    """Ask who is there, read and write every address."""
    return names_and_rights(s, "pik", never={}, writes={"PERIOD": 100})


@active("BUS-PORT-11", needs={"bus", "can"}, before=by_hand, after=calm, boards=("pik",))
def registers_show_what_their_objects_show(s: Dut) -> str:
    """Latch by hand, read X, Y, Z and SEQ beside the objects of the same reading."""

    def next_reading(s: Dut) -> None:
        s.run_for(0.05)
        line(s, LATCH)

    return one_value(s, "pik", next_reading, OD.READING)


@active("PIK-CAN-05", needs={"can"})
def the_name_plate_is_right(s: Dut, row: Requirement) -> str:
    """Read 2210h."""
    kind = "pik6" if s.variant.board == "pik6" else "pik"
    read = s.unit.node.read
    saw = read(OD.PLATE, 1), int(read(OD.PLATE, 2)), int(read(OD.PLATE, 3)), int(read(OD.PLATE, 4))
    due = s.variant.profile, row.limit(f"{kind}_k_mhz_per_v"), row.limit(f"{kind}_rate_hz"), row.limit(f"{kind}_error")
    part = row.limit("plate_tolerance_ppm") * 1e-6  # a plate made for a clock that is off says so
    if saw[0] != due[0] or any(abs(a - b) > b * part + HALF for a, b in zip(saw[1:], due[1:], strict=True)):
        raise Failed(f"{saw}", f"{due}")
    return f"{saw[0]}, {saw[1]} mHz/V, {saw[2]} Hz, {saw[3]} in 0.01 %"


@active("PIK-CAN-06", needs={"can"})
def the_board_says_what_it_is(s: Dut) -> str:
    """Read 1008h and 1018h sub 2."""
    return identity(s, "PIK-CAN-06", "PIK")


@active("PIK-CAN-07", needs={"can"}, before=calm)
def objects_are_as_the_dictionary_says(s: Dut) -> str:
    """Read every object of the EDS and write where nothing may be written."""
    return as_the_dictionary_says(s, "pik")
