"""PSD-1's set-up after Res: control words, coefficients, the first cycle; limits of the converters' serial port."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psabench.boards.psd1.conform.capture_cycles import (
    ADDRESS,
    CONTROL_BITS,
    DATA,
    FRAMES,
    PINS,
    cycles,
    fl2_level,
    starts,
)
from psabench.boards.psd1.conform.host import period_s
from psabench.conform.capture.intervals import (
    after,
    before,
    bus_word,
    edges,
    fact,
    first_bad,
    interval,
    overlaps,
    together,
    wires_needed,
    within,
)
from psabench.conform.capture.log import Capture
from psabench.conform.capture.messages import booted, late_readings
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, conclusive, damaged_data_are, expect, known
from psabench.link.signals import Ints

WRITE = ("TFS", "A0", "SCLK", "SDAT", "CLK_1M25", "DR")
SETUP = ("TFS", "A0", "DR", "SCLK", *FRAMES)
MS = 1e6
COEFFICIENT_NAMES = tuple(f"{kind} of {axis}" for kind in ("zero", "full scale") for axis in "XYZ")  # as they are read
COEFFICIENTS = len(COEFFICIENT_NAMES)
CYCLE_BYTES, CNT_AT = 8, 6  # of PSD1_CYCLE
STATUS_LINES = ("FL2", "A0", "INT0", "FL1", "DR")


@dataclass(frozen=True, slots=True)
class Frame:
    """A low of TFS, RFX, RFY or RFZ with the pulses of SCLK in it."""

    line: str
    fall: int
    rise: int
    rises: Ints
    falls: Ints


def frames(e: Capture) -> list[Frame]:
    """From the first control word on, in their order: what is before are words of a board that was running.

    Raises Inconclusive where a line or a control word is missing.
    """
    wires_needed(e, *WRITE, *FRAMES)
    log = e.wires
    up, down = log.rises("SCLK"), log.falls("SCLK")
    found = []
    for name in ("TFS", *FRAMES):
        for a, b in zip(*log.pulses(name, 0), strict=True):
            found.append(Frame(name, int(a), int(b), within(up, a, b), within(down, a, b)))
    begin = known(min((f.fall for f in found if f.line == "TFS"), default=None), "no control word in the recording")
    return sorted((f for f in found if f.fall >= begin), key=lambda f: f.fall)


def controls(e: Capture) -> list[Frame]:
    """The control words."""
    return [f for f in frames(e) if f.line == "TFS"]


@check("power_on", "PSD1-SETUP-01", needs={"pins", "can"}, on_recording="")
def coefficients_are_those_of_their_converters(e: Capture) -> str:
    """Read the six coefficients off SDAT and compare each with its object, 2044h and 2045h."""
    read = [f for f in frames(e) if f.line != "TFS" and len(f.rises) == CONTROL_BITS][:COEFFICIENTS]
    conclusive(len(read) == COEFFICIENTS, f"{len(read)} coefficients were read in the recording")
    told, seen = fact(e, "coefficients"), [_word(e, f) for f in read]
    for name, here, there, f in zip(COEFFICIENT_NAMES, seen, told, read, strict=True):
        expect(here == there, f"{name} {there:06X}h", f"{here:06X}h as on SDAT", at_ns=f.fall, lines=SETUP)
    for part in (seen[:3], seen[3:]):
        conclusive(
            len(set(part)) == len(part), "two converters gave the same coefficient: no one can tell which is which"
        )
    return f"{', '.join(f'{w:06X}h' for w in seen)} on SDAT and in the objects"


@check("power_on", "PSD1-SETUP-02", needs={"pins"})
def the_set_up_goes_in_its_order(e: Capture) -> str:
    """Follow TFS, DR and the transfers of 24 bits from Res to the first word."""
    found = frames(e)
    first_word = next((k for k, f in enumerate(found) if f.line != "TFS" and len(f.rises) != CONTROL_BITS), len(found))
    setup = found[:first_word]
    sent = [f for f in setup if f.line == "TFS"]
    read = [f for f in setup if f.line != "TFS"]
    at = setup[0].fall
    saw, due = f"{setup[-1].line} last, {len(sent)} control words", "two control words or more, one of them last"
    expect(setup[-1].line == "TFS" and len(sent) >= 2, saw, due, at_ns=at, lines=SETUP)
    order = [f.line for f in read]
    in_turn = order == [*FRAMES] * (COEFFICIENTS // len(FRAMES))
    expect(in_turn, " ".join(order) or "no coefficient read", "X Y Z X Y Z", at_ns=at, lines=SETUP)
    low = [f for f in read if int(e.wires["A0"].at(f.fall)) != 1]
    if low:
        raise Failed("A0 low while a coefficient is read", "high", at_ns=low[0].fall, lines=SETUP)
    dr = after(e.wires.falls("DR"), np.array([sent[0].rise], np.int64))
    if not sent[0].rise < int(dr[0]) < setup[1].fall:
        raise Failed("the next transfer before DR falls", "DR first", at_ns=setup[1].fall, lines=SETUP)
    if first_word < len(found) and int(e.wires["DR"].at(found[first_word].fall - 1)) != 0:
        raise Failed("a word read with DR high", "DR awaited", at_ns=found[first_word].fall, lines=SETUP)
    return f"{len(sent)} control words, {len(read)} coefficients, DR after the first and before the first word"


@check("power_on", "PSD1-SETUP-03", needs={"pins"})
def the_first_cycle_comes_in_time(e: Capture, row: Requirement) -> str:
    """Measure from the first control word after Res to A0 of the first cycle."""
    due = _first_cycle_ms(e)
    found = frames(e)
    word = next((f for f in found if f.line == "RFX" and len(f.rises) != CONTROL_BITS), None)
    if word is None:
        raise Failed("no cycle in the recording", f"one {due:g} ms after Res", at_ns=found[0].fall, lines=SETUP)
    first, cycle = np.array([found[0].fall]), np.array([word.fall])
    return interval(
        e,
        first,
        cycle,
        due * MS,
        row.limit("tolerance_ms") * MS,
        "from the first control word to the first cycle",
        SETUP,
    )


@check("power_on", "PSD1-SETUP-03", needs={"stamps"})
def the_first_message_comes_in_time(e: Capture, row: Requirement) -> str:
    """Measure from the boot-up message to the first PSD1_CYCLE."""
    due_ms = _first_cycle_ms(e)
    boot = booted(e, "PSD1_HEARTBEAT")
    told = [f for f in e.frames_of("PSD1_CYCLE").frames if f.t_s > boot.t_s]
    conclusive(told and len(told[0].data) == CYCLE_BYTES, "no whole PSD1_CYCLE after the boot-up message")
    took_ms, period_ms = (told[0].t_s - boot.t_s) * 1e3, period_s(e.variant) * 1e3
    modulo = int(row_for(e, "PSD1-CAN-03").limit("modulo"))
    cnt = told[0].data[CNT_AT]  # one that is reported late, because the host was, counts those before it
    before = cnt + modulo * round(((took_ms - due_ms) / period_ms - cnt) / modulo)
    if abs(took_ms - due_ms - before * period_ms) > row.limit("tolerance_ms"):
        due = f"{due_ms + before * period_ms:g} +- {row.limit('tolerance_ms'):g} ms"
        raise Failed(f"{took_ms:.3f} ms, CNT {cnt}", due, frames=(boot, told[0]))
    return f"{took_ms:.3f} ms from boot-up to the first message, CNT {cnt}"


def _first_cycle_ms(e: Capture) -> float:
    row = requirements()["PSD1-SETUP-03"]
    return row.limit("quiet_first_cycle_ms" if e.variant.profile == "psd1_quiet" else "first_cycle_ms")


@check("power_on", "PSD1-UC-01", needs={"pins"})
def control_words_go_out_in_their_time(e: Capture, row: Requirement) -> str:
    """Measure TFS and the pulses of SCLK in it."""
    sent = controls(e)
    tolerance_ns, count = row.limit("tolerance_ns"), int(row.limit("pulses_count"))
    falls = np.array([f.fall for f in sent], np.int64)
    counts = np.array([len(f.rises) for f in sent])
    first_bad(counts != count, falls, [f"{n} pulses of SCLK under TFS" for n in counts], f"{count}", WRITE)
    together(e, falls, e.wires.falls("CLK_1M25"), tolerance_ns, "TFS and a fall of 1M25", WRITE)
    first = np.array([f.rises[0] for f in sent], np.int64)
    interval(e, falls, first, row.limit("first_rise_ns"), tolerance_ns, "from TFS to the first rise of SCLK", WRITE)
    rises = np.array([f.rise for f in sent], np.int64)
    return interval(e, falls, rises, row.limit("tfs_low_ns"), tolerance_ns, "of TFS low", WRITE)


@check("power_on", "PSD1-UC-02", needs={"pins"})
def the_control_words_are_those_of_the_page(e: Capture, row: Requirement) -> str:
    """Read the first and the last control word of the set-up off SDAT."""
    found = controls(e)
    words = [_word(e, f) for f in (found[0], found[-1])]
    due = [int(row.limit("uc1_code")), int(row.limit("uc2_code"))]
    if words != due:
        saw = " ".join(f"{w:06X}h" for w in words)
        raise Failed(saw, " ".join(f"{w:06X}h" for w in due), at_ns=found[0].fall, lines=WRITE)
    return f"{words[0]:06X}h first, {words[1]:06X}h last"


def _word(e: Capture, f: Frame) -> int:
    return int("".join(map(str, e.wires["SDAT"].at(f.rises).tolist())) or "0", 2)


@check("power_on", "PSD1-SER-12", needs={"pins"})
def the_register_has_its_four_modes(e: Capture, row: Requirement) -> str:
    """Count pulses of SCLK of control words, coefficients and words, and look for words on the bus."""
    found = frames(e)
    word, control = int(row.limit("word_bits")), int(row.limit("control_bits"))
    counts = {name: {len(f.rises) for f in found if (f.line == "TFS") == (name == "TFS")} for name in ("TFS", "RFx")}
    at = found[0].fall
    expect(counts["TFS"] == {control}, f"{sorted(counts['TFS'])} bits under TFS", f"{control}", at_ns=at, lines=SETUP)
    due = {word, control} if e.variant["host_strobe_ns"] else {control}
    expect(counts["RFx"] == due, f"{sorted(counts['RFx'])} bits under RFx", f"{sorted(due)}", at_ns=at, lines=SETUP)
    wires_needed(e, *DATA)
    strobes = e.wires.pulses("CS", 0)[0]
    if e.variant["host_strobe_ns"] and not bus_word(e, "D", len(DATA), strobes).any():
        raise Failed("no word on D0..D15", "the words", at_ns=at, lines=SETUP)
    return f"{control} bits out, {control} and {word} bits in, words out to the bus"


@check("power_on", "PSD1-CHIP-03", needs={"pins"})
def the_converters_limits_are_kept(e: Capture, row: Requirement) -> str:
    """Measure A0, RFS, TFS, SCLK and SDAT against the limits of the part."""
    found = frames(e)
    log = e.wires
    a0, data = edges(e, "A0"), edges(e, "SDAT")
    for f in found:
        widths = (
            ("sclk_period_min_ns", np.diff(f.rises)),
            ("sclk_width_min_ns", f.falls[: len(f.rises)] - f.rises[: len(f.falls)]),
            ("sclk_width_min_ns", f.rises[1:] - f.falls[: max(0, len(f.rises) - 1)]),
            ("to_sclk_min_ns", f.rises[:1] - f.fall),
            ("tfs_high_min_ns" if f.line == "TFS" else "rfs_high_min_ns", f.rise - f.falls[-1:]),
        )
        for name, took in widths:
            least = row.limit(name)
            if len(took) and took.min() < least - e.slack_ns(least):
                raise Failed(f"{int(took.min())} ns, {name}", f"{least:g} ns or more", at_ns=f.fall, lines=SETUP)
        if f.line == "TFS":
            held = row.limit("write_hold_min_ns") - e.slack_ns(0.0)
            after_rise = after(data, f.rises) - f.rises
            if (after_rise < held).any() or int(log["A0"].at(f.fall)) or ((a0 > f.fall) & (a0 < f.rise)).any():
                raise Failed("SDAT not held, or A0 not low", f"held {held:g} ns, A0 low", at_ns=f.fall, lines=WRITE)
            continue
        moved = a0[(a0 > f.fall - row.limit("a0_rfs_min_ns") + e.slack_ns(0.0)) & (a0 < f.rise - e.slack_ns(0.0))]
        due = f"{row.limit('a0_rfs_min_ns'):g} ns before it, not in it"
        expect(not len(moved), "A0 moves about RFx", due, at_ns=f.fall, lines=SETUP)
        free = round(row.limit("hiz_max_ns") + e.slack_ns(0.0))
        if int(log["SDAT"].at(f.rise + free)):
            raise Failed("SDAT driven after RFx", f"released within {free} ns", at_ns=f.rise, lines=SETUP)
    return f"{len(found)} transfers within the limits of the part"


@check("power_on", "PSD1-ERR-02", needs={"pins"})
def res_brings_lines_to_rest_and_the_set_up(e: Capture) -> str:
    """Look for the set-up after a Res while cycles run, and no word before it has ended."""
    found = frames(e)
    last = next((k for k in reversed(range(len(found))) if found[k].line == "TFS"), 0)
    stray = [f for f in found[:last] if f.line != "TFS" and len(f.rises) != CONTROL_BITS]
    begun = e.wires.start_ns + 1_000_000  # the pulse itself may cut a cycle
    stray = [f for f in stray if f.fall > begun]
    if stray:
        raise Failed("a word in the set-up", "none before its end", at_ns=stray[0].fall, lines=SETUP)
    return f"{last + 1} transfers of the set-up, then words"


@check("power_on", "PSD1-ERR-02", needs={"can"})
def cycles_are_counted_from_0_after_res(e: Capture) -> str:
    """Look at CNT of the first PSD1_CYCLE after Res."""
    boot = booted(e, "PSD1_HEARTBEAT")
    told = [f for f in e.frames_of("PSD1_CYCLE").frames if f.t_s > boot.t_s]
    if not told and not e.variant["host_strobe_ns"]:
        return "no cycle without a host"
    late = late_readings(e, "PSD1_HEARTBEAT", "PSD1_CYCLE", _first_cycle_ms(e) * 1e-3, period_s(e.variant))
    first = told[0].data
    if len(first) != CYCLE_BYTES or first[CNT_AT] > late:
        raise Failed(f"{first.hex(' ')} first", f"CNT {late} at most", frames=told[:3])
    return f"CNT {first[CNT_AT]} first"


@check("strobes", "PSD1-BUS-07", needs={"pins", "bus"}, wires=PINS)
def status_tells_the_lines(e: Capture, row: Requirement) -> str:
    """Compare what is read from STATUS with the lines as its strobe begins."""
    begin = _reads_of_status(e)
    word = bus_word(e, "D", len(DATA), begin + round(e.slack_ns(0.0)))
    just = begin - 1 - round(e.slack_ns(0.0))
    log = e.wires
    expected = {
        "int0_mask": log["INT0"].at(just) == 1,
        "fl1_mask": log["FL1"].at(just) == 0,
        "dr_mask": log["DR"].at(just) == 0,
        "set_up_mask": np.ones(len(begin), bool),
    }
    if e.variant["a0_release"] != "rfz":
        expected["cycle_mask"] = log["A0"].at(just) == 1
    for name, due in expected.items():
        saw = (word & int(row.limit(name))) != 0
        texts = [
            f"{name.removesuffix('_mask').upper()} {int(v)} in STATUS {w:04X}h" for v, w in zip(saw, word, strict=True)
        ]
        first_bad(saw != due, begin, texts, "as the lines are", (*STATUS_LINES, "CS"))
    seen = [f"{name.removesuffix('_mask').upper()} {int(due.sum())}" for name, due in expected.items()]
    return f"{len(begin)} reads of STATUS; active: {', '.join(seen)}"


@check("strobes", "PSD1-BUS-14", needs={"pins", "bus"}, wires=PINS)
def status_tells_the_word_that_waits(e: Capture, row: Requirement) -> str:
    """Compare bits 2..0 of STATUS with FL2 and the axis whose word waits."""
    mask = int(row.limit("axis_mask"))
    begin = _reads_of_status(e)
    ready = e.wires["FL2"].at(begin - 1) == fl2_level(e)
    saw = (bus_word(e, "D", len(DATA), begin + round(e.slack_ns(0.0))) & int(row.limit("fl2_mask"))) != 0
    first_bad(saw != ready, begin, [f"bit {int(v)}" for v in saw], "FL2 as the line is", ("FL2", "CS"))
    begin = begin[ready]
    conclusive(len(begin), "no read of STATUS while a word waited")
    latest = np.stack([before(e.wires.rises(n), begin) for n in FRAMES], axis=1)
    due = latest.argmax(axis=1)
    axis = (bus_word(e, "D", len(DATA), begin + round(e.slack_ns(0.0))) & mask) >> 1
    first_bad(axis != due, begin, [f"axis {a}" for a in axis], "that of the word that waits", (*FRAMES, "FL2", "CS"))
    return f"{len(begin)} reads of STATUS while X, Y or Z waited, {len(set(due.tolist()))} axes"


def _reads_of_status(e: Capture) -> Ints:
    """Begins of strobes that read STATUS, none at an edge of what it tells."""
    begin: Ints = e.wires.pulses("CS", 0)[0]
    at = begin + round(e.slack_ns(0.0))
    mine = (bus_word(e, "AB", len(ADDRESS), at) == 3) & (e.wires["RW"].at(at) == 1)
    begin = begin[mine]
    for name in (*STATUS_LINES, *FRAMES):
        moves = edges(e, name)
        begin = begin[after(moves, begin - 3 - round(2 * e.slack_ns(0.0))) > begin + 2 + round(2 * e.slack_ns(0.0))]
    conclusive(len(begin) >= 8, f"{len(begin)} reads of STATUS were recorded")
    return begin


@check("strobes", "PSD1-BUS-08", needs={"pins", "bus"}, wires=("CS", "RW", *ADDRESS, *DATA))
def the_bus_stands_in_a_strobe_and_rests_at_0(e: Capture) -> str:
    """Look for changes of address, data and R/W within strobes, and for their levels between them."""
    begin, end = e.wires.pulses("CS", 0)
    conclusive(len(begin) >= 8, f"{len(begin)} strobes were recorded")
    slack = round(e.slack_ns(0.0))
    free = end[e.wires["CS"].at(end + slack) == 1]  # another strobe may begin where one ends
    for name in ("RW", *ADDRESS, *DATA):
        moved = after(edges(e, name), begin + slack) < end - slack
        first_bad(moved, begin, f"{name} moves in a strobe", "it is", ("CS", name))
        rest = 1 if name == "RW" else 0
        high = e.wires[name].at(free + slack) != rest
        first_bad(high, free, f"{name} {1 - rest} with CS high", f"{rest}", ("CS", name))
    seen = sum(int(e.wires[name].at(begin + slack).any()) for name in DATA)
    expect(seen, "D0..D15 all 0 in every strobe", "data", at_ns=int(begin[0]), lines=("CS", *DATA))
    writes = int((e.wires["RW"].at(begin + slack) == 0).sum())
    expect(writes, "R/W high in every strobe", "low in writes", at_ns=int(begin[0]), lines=("CS", "RW"))
    return f"{len(begin)} strobes, {writes} of them writes"


@check("messages", "PSD1-CAN-06", needs={"pins", "can"}, wires=("DR",))
def psd1_time_tells_the_cycle(e: Capture, row: Requirement) -> str:
    """Compare TSTAMP, LENGTH and WAITED of PSD1_TIME with A0, FL2 and DR."""
    whole = cycles(e)
    log = e.frames_of("PSD1_TIME")
    conclusive(len(log) >= 4, f"{len(log)} messages PSD1_TIME came")
    with damaged_data_are(Failed, "8 bytes", frames=log.frames):
        raw = log.raw("PSD1_TIME")
    period_ns = row.limit("period_ns")
    begin, end = starts(e, whole), np.array([c[2].clear for c in whole], np.int64)
    falls = e.wires.falls("DR")
    k = np.searchsorted(falls, begin) - 1
    seen = np.stack(
        [begin, np.rint((end - begin) / period_ns), np.rint((begin - falls[np.maximum(k, 0)]) / period_ns)], axis=1
    )
    seen = seen[k >= 0]
    told = np.stack(
        [raw["TSTAMP"] * 1000 * row.limit("unit_us"), raw["LENGTH"], np.minimum(raw["WAITED"], 255)], axis=1
    )
    seen[:, 2] = np.minimum(seen[:, 2], 255)
    for here, there in overlaps(len(seen), len(told)):
        s, t = seen[here], told[there]
        if len(s) < 3:
            continue
        apart = (s[:, 0] - s[0, 0]) - (t[:, 0] - t[0, 0])
        if (
            np.abs(apart).max() <= 1000 * row.limit("unit_us") + e.slack_ns(float(s[-1, 0] - s[0, 0]))
            and (np.abs(s[:, 1:] - t[:, 1:]) <= 1).all()
        ):
            return f"{len(s)} messages, LENGTH {int(t[0, 1])}, WAITED {int(t[:, 2].min())} to {int(t[:, 2].max())}"
    saw = f"LENGTH {int(told[0, 1])}, WAITED {int(told[0, 2])}, {told[1, 0] - told[0, 0]:.0f} ns between TSTAMPs"
    due = (
        f"{int(seen[0, 1])}, {int(seen[0, 2])}, {seen[1, 0] - seen[0, 0]:.0f} ns"
        if len(seen) > 1
        else "those of the lines"
    )
    raise Failed(saw, due, at_ns=int(begin[0]), lines=("DR", "A0", "FL2"), frames=log.frames[:4])
