"""PSD-1's control words, coefficients, late hosts and identity, over CAN."""

from __future__ import annotations

import numpy as np

from psabench.boards.objects import Psd1Objects as OD
from psabench.boards.psd1.conform.capture_cycles import LINES, of, transfers
from psabench.boards.psd1.conform.host import (
    BOTH,
    FLAGS,
    calm,
    drive,
    has_host,
    kept_coefficients,
    messages_on,
    period_s,
    run_cycles,
    while_turning,
    word,
)
from psabench.boards.readings import Readings
from psabench.conform.bus_host import line, line_refused, port, refused
from psabench.conform.capture.bus_cycles import TAIL_S
from psabench.conform.dictionary import as_the_dictionary_says, identity
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.stimulus.streamed import while_streaming
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect
from psabench.link.busport import Cycle
from psabench.link.can_host import QUANTUM_S

AXES = (1, 2, 3)
FS_MASK, GAIN_SHIFT, GAIN_MASK, MODE_MASK, WL, PD, CALIBRATE = 0xFFF, 18, 7 << 18, 7 << 21, 1 << 15, 1 << 16, 1 << 21
CLIP_GAIN = 4  # code of gain 16
STAYS = 24  # cycles through which control words stay
UNIPOLAR = 1 << 12  # B/U
LATE_CYCLES, LATE_STEPS, LATE_STEP_S, STROBE_S = 9, 7, 5e-6, 20e-6  # a word comes 15 us after the one before was taken
HELD = {OD.CODES: 3, OD.CYCLE: 5, OD.GYRO_LOW: 3, OD.RATE: 3}  # objects of the latest cycle, their sub-indices
# Signals of the messages and the objects that they map (docs/reference/protocol_psd1.md, Objects: 1A00h to 1A03h).
MAPPED = {
    "PSD1_CYCLE": {"X": (OD.CODES, 1), "Y": (OD.CODES, 2), "Z": (OD.CODES, 3), "CNT": (OD.CYCLE, 1)},
    "PSD1_TIME": {"TSTAMP": (OD.CYCLE, 3), "LENGTH": (OD.CYCLE, 4), "WAITED": (OD.CYCLE, 5), "CNT": (OD.CYCLE, 1)},
    "PSD1_GYRO": {"X": (OD.GYRO_LOW, 1), "Y": (OD.GYRO_LOW, 2), "Z": (OD.GYRO_LOW, 3), "CNT": (OD.CYCLE, 1)},
    "PSD1_RATE": {"X": (OD.RATE, 1), "Y": (OD.RATE, 2), "Z": (OD.RATE, 3), "CNT": (OD.CYCLE, 1)},
}


LATE_S = 0.5  # that the first frames may be late in real time


def _control(s: Dut) -> tuple[int, int]:
    """UC1 and UC2."""
    return int(s.unit.node.read(OD.UC1)), int(s.unit.node.read(OD.UC2))


def _cycles(s: Dut, count: int) -> Readings:
    """Words of the next cycles, as they are reported; of more in real time, where a busy machine is late."""
    s.unit.frames.forget()
    with while_streaming(s):
        run_cycles(s, count)
        if not s.lockstep:
            s.run_for(LATE_S)
    found = s.unit.frames.take()
    if not isinstance(found, Readings) or len(found["X"]) < 2:
        raise Failed("no PSD1_CYCLE", f"{count} cycles")
    return found


@active("PSD1-UC-02", needs={"can"}, before=calm)
def control_words_are_read_as_they_are(s: Dut, row: Requirement) -> str:
    """Read 2042h and 2043h after Res."""
    due = int(row.limit("uc1_code")), int(row.limit("uc2_code"))
    if _control(s) != due:
        raise Failed("{:06X}h, {:06X}h".format(*_control(s)), "{:06X}h, {:06X}h".format(*due))
    return "UC1 {:06X}h, UC2 {:06X}h".format(*due)


@active("PSD1-SETUP-01", needs={"can"}, before=calm)
def coefficients_are_kept(s: Dut) -> str:
    """Read 2044h and 2045h after the set-up, twice."""
    first, again = kept_coefficients(s), kept_coefficients(s)
    expect(all(first) and first == again, f"{first}, then {again}", "six that are not 0, and the same again")
    return f"zero {first[:3]}, full scale {first[3:]}"


@active("PSD1-SETUP-01", needs={"bus", "can"}, before=calm)
def coefficients_are_shown_on_the_bus(s: Dut) -> str:
    """Read the six by COMMAND, UC_HIGH and UC_LOW, and compare them with 2044h and 2045h."""
    for command, due in zip((0x10, 0x11, 0x12, 0x20, 0x21, 0x22), kept_coefficients(s), strict=True):
        line(s, f"W E {command:X}")
        got = line(s, "R C").data << 16 | line(s, "R D").data
        expect(got == due, f"{got:06X}h by COMMAND {command:02X}h", f"{due:06X}h as on CAN")
    return "six by COMMAND as on CAN"


@active("PSD1-SETUP-04", needs={"can"})
def converters_are_in_step_after_res(s: Dut) -> str:
    """Press Res at six instants of a period and look at what each converter lost in the cycles that follow."""
    seen = []
    for k in range(6):
        s.run_for(period_s(s.variant) * k / 7)
        calm(s)
        before = s.unit.counters()
        run_cycles(s, 6)
        now = s.unit.counters()
        lost = [now[f"Lost {a}"] - before[f"Lost {a}"] for a in "XYZ"]
        stretched = now["Stretched cycles"] - before["Stretched cycles"]
        # A host that is late in real time: a cycle in which a conversion ends loses it for the words still to come.
        if max(lost) - min(lost) > (0 if s.lockstep else stretched):
            raise Failed(f"lost X, Y, Z {lost}, {stretched} cycles stretched", "all alike but for those")
        if has_host(s.variant) and (lost[0] or stretched):
            raise Failed(f"lost X, Y, Z {lost}, or a conversion inside a cycle", "none")
        seen.append(lost[0])
    return f"six times, lost words of X: {seen}, as many of the others"


@active("PSD1-UC-03", needs={"can"}, before=calm, after=calm)
def uc1_calibrates_anew(s: Dut, row: Requirement) -> str:
    """Write 2042h and 2043h as they are, look at the coefficients and at the time that each answer takes."""
    before, (uc1, uc2) = kept_coefficients(s), _control(s)
    most_s = row.limit("answer_max_periods") * period_s(s.variant) + row.limit("transfers_ms") * 1e-3 + QUANTUM_S
    took = []
    for index, value in ((OD.UC1, uc1), (OD.UC2, uc2)):
        begun_s = s.bench.time_s
        s.unit.node.write(index, 0, value)
        took.append(s.bench.time_s - begun_s)
    after = kept_coefficients(s)
    expect(before != after, f"coefficients {before} before and after", "new ones")
    if s.lockstep and took[0] > most_s:
        raise Failed(f"an answer after {took[0] * 1e3:.1f} ms", f"{most_s * 1e3:.1f} ms at most")
    if s.lockstep and took[0] < row.limit("answer_min_periods") * period_s(s.variant):
        raise Failed(f"an answer after {took[0] * 1e3:.1f} ms", "when the calibration is done")
    return f"answers after {took[0] * 1e3:.1f} and {took[1] * 1e3:.1f} ms, six new coefficients"


@active("PSD1-UC-04", needs={"can"}, before=calm)
def control_words_that_cannot_be_are_refused(s: Dut, row: Requirement) -> str:
    """Write WL, PD, codes out of range, UC1 without and UC2 with a calibration."""
    code, low, high = int(row.limit("abort_code")), int(row.limit("code_min")), int(row.limit("code_max"))
    uc1, uc2 = _control(s)
    wrong = [
        (OD.UC2, uc2 | WL),
        (OD.UC2, uc2 | PD),
        (OD.UC2, uc2 & ~FS_MASK | low - 1),
        (OD.UC2, uc2 & ~FS_MASK | high + 1),
        (OD.UC1, uc1 | WL),
        (OD.UC1, uc1 | PD),
        (OD.UC1, uc1 & ~FS_MASK | low - 1),
        (OD.UC1, uc1 & ~FS_MASK | high + 1),
        (OD.UC1, uc1 & ~MODE_MASK),
        (OD.UC2, uc2 | CALIBRATE),
    ]
    for index, value in wrong:
        refused(lambda i=index, v=value: s.unit.node.write(i, 0, v), code, f"{value:06X}h to {index:04X}h")  # type: ignore[misc]
        expect(s.unit.refusal(), f"no reason in 2031h after {value:06X}h to {index:04X}h", "one in words")
    if _control(s) != (uc1, uc2):
        raise Failed("{:06X}h, {:06X}h".format(*_control(s)), "the control words as before")
    _cycles(s, 4)
    return f"{len(wrong)} control words refused, each with its reason"


@active("PSD1-UC-05", needs={"bus"}, before=calm, after=calm)
def commands_come_one_after_the_other(s: Dut, row: Requirement) -> str:
    """Write COMMAND 1 twice."""
    line(s, "W E 3")  # UC1 into UC_HIGH and UC_LOW
    code = row.limit("abort_code")
    if s.lockstep:
        line(s, "W E 1")
        line_refused(s, "W E 1", code)
        busy = line(s, "R E").data
    else:  # all at once: whoever waits for an answer may be too late for the next
        port(s).ask("W E 1\nW E 1\nR E")
        port(s).answer()
        refused(port(s).answer, code, "W E 1")
        told = port(s).answer()
        busy = told.data if isinstance(told, Cycle) else 0
    expect(busy & 0x8000, f"COMMAND {busy:04X}h", "bit 15, under way")
    return "the second is refused while the first is under way"


@active("PSD1-UC-06", needs={"bus", "can"}, before=calm, after=calm)
def a_command_cuts_a_cycle_that_waits(s: Dut, row: Requirement) -> str:
    """Write 2043h while X waits for a host, look at Cut cycles and at the time."""
    line(s, f"W F {BOTH:04X}")
    s.run_for(2 * period_s(s.variant))
    before = int(s.unit.node.read(OD.COUNTERS, 24))
    timeout_s = row.limit("timeout_ms") * 1e-3
    begun_s = s.bench.time_s
    s.unit.node.write(OD.UC2, 0, _control(s)[1])
    took_s = s.bench.time_s - begun_s
    cut = int(s.unit.node.read(OD.COUNTERS, 24)) - before
    expect(cut == 1, f"{cut} cycles cut", "1")
    if s.lockstep and took_s < timeout_s:
        raise Failed(f"an answer after {took_s * 1e3:.2f} ms", f"{timeout_s * 1e3:g} ms of timeout first")
    return f"one cycle cut, answer after {took_s * 1e3:.1f} ms"


@active("PSD1-UC-07", needs={"can"}, before=calm, after=calm)
def control_words_are_read_back(s: Dut) -> str:
    """Read 2046h and compare it with 2043h, some cycles after the set-up and with another code."""
    sent = _control(s)[1]
    run_cycles(s, STAYS)
    for value in (sent, sent + 1):
        if value != sent:
            s.unit.node.write(OD.UC2, 0, value)
        got = [int(s.unit.node.read(OD.CONTROL, k)) for k in AXES]
        if got != [value & ~MODE_MASK] * 3:
            raise Failed(f"{[f'{g:06X}h' for g in got]}", f"{value & ~MODE_MASK:06X}h three times")
    return f"as set up {STAYS} cycles later, another as written"


@active("PSD1-CHIP-01", needs={"can", "inputs"}, before=calm)
def the_gain_is_where_the_table_has_it(s: Dut, row: Requirement) -> str:
    """Set gain 2 by G2..0 in both control words and compare the words with those of gain 1."""
    zero = requirements()["PSD1-WORD-01"].limit("zero_code")
    one = _mean(_cycles(s, 40)) - zero
    _set(s, 1 << GAIN_SHIFT)
    two = _mean(_cycles(s, 40)) - zero
    calm(s)
    wide = [k for k in range(3) if abs(one[k]) > row.limit("input_min_codes")]
    conclusive(wide, f"expected inputs of {row.limit('input_min_codes'):g} codes and more")
    for k in wide:
        if abs(two[k] - 2 * one[k]) > row.limit("tolerance_codes"):
            raise Failed(f"{one[k]:.0f} codes on {'XYZ'[k]}, with gain 2 {two[k]:.0f}", "twice as many")
    return f"codes {', '.join(f'{v:.0f}' for v in one)}, with gain 2 {', '.join(f'{v:.0f}' for v in two)}"


def _mean(words: Readings) -> np.ndarray:
    return np.array([float(np.mean(words[a])) for a in "XYZ"])


def _set(s: Dut, bits: int) -> None:
    uc1, uc2 = _control(s)
    s.unit.node.write(OD.UC1, 0, uc1 & ~GAIN_MASK | bits)
    s.unit.node.write(OD.UC2, 0, uc2 & ~GAIN_MASK | bits)


@active("PSD1-CHIP-02", needs={"can", "pins"}, before=calm, after=calm)
def the_rate_is_that_of_the_code(s: Dut, row: Requirement) -> str:
    """Set codes 19, 100, 195 and 2000 and measure from fall to fall of DR."""
    uc2 = _control(s)[1]
    seen = []
    for code in (int(row.limit("code_min")), 100, 195, int(row.limit("code_max"))):
        s.unit.node.write(OD.UC2, 0, uc2 & ~FS_MASK | code)
        due_s = code * row.limit("divider") / row.limit("clkin_hz")
        with s.take() as take:
            s.run_for(3.3 * due_s)
        if take.lines is None or "DR" not in take.lines:
            raise Inconclusive("the recording has no line DR")
        took_ns = np.diff(take.lines.falls("DR"))
        slack_ns = due_s * 1e3 * row.limit("clock_error_ppm") + 2 * take.lines.resolution_ns
        if not len(took_ns) or np.abs(took_ns - due_s * 1e9).max() > slack_ns:
            raise Failed(f"{took_ns.tolist()} ns from DR to DR with code {code}", f"{due_s * 1e9:.0f} ns")
        seen.append(f"{code}: {took_ns.mean() * 1e-3:.1f} us")
    return ", ".join(seen)


@active("PSD1-WORD-03", needs={"can", "inputs"})
def words_beyond_full_scale_are_marked(s: Dut, row: Requirement) -> str:
    """Set gain 16, which makes the inputs larger than full scale, and look at words and CLIP."""
    full_v = requirements()["PSD1-WORD-01"].limit("full_scale_v") / (1 << CLIP_GAIN)
    beyond = {a: v for a, v in s.inputs_v.items() if abs(v) > (1 + row.limit("margin_pct") / 100) * full_v}
    if not any(v > 0 for v in beyond.values()) or not any(v < 0 for v in beyond.values()):
        raise Inconclusive(f"expected an input beyond {full_v:g} V and one below -{full_v:g} V")
    calm(s)
    plain = _cycles(s, 6)
    _set(s, CLIP_GAIN << GAIN_SHIFT)
    words = _cycles(s, 6)
    calm(s)
    expect(not np.any(plain["CLIP"]), "CLIP with words within full scale", "0")
    for axis, volts in beyond.items():
        due = int(row.limit("code_max" if volts > 0 else "code_min"))
        if np.any(words[axis.upper()][1:] != due):
            raise Failed(f"{int(words[axis.upper()][-1]):04X}h on {axis.upper()}", f"{due:04X}h")
    expect(np.all(words["CLIP"][1:]), "CLIP 0 with words at their limit", "1")
    return f"{', '.join(beyond)} at their limits, CLIP 1"


@active("PSD1-WORD-03", needs={"can", "inputs"})
def a_word_at_0_alone_is_marked(s: Dut, row: Requirement) -> str:
    """Make the converters unipolar: negative inputs give 0000h, positive ones lie within, and CLIP is."""
    zero = requirements()["PSD1-WORD-01"]
    least_v = row.limit("unipolar_min_v")
    below = [a for a, v in s.inputs_v.items() if v < -least_v]
    within = [a for a, v in s.inputs_v.items() if least_v < v < zero.limit("full_scale_v") - least_v]
    if not below or len(below) + len(within) != len("xyz"):
        raise Inconclusive(f"expected inputs of more than {least_v:g} V either way, one of them negative")
    calm(s)
    uc1, uc2 = _control(s)
    s.unit.node.write(OD.UC1, 0, uc1 | UNIPOLAR)
    s.unit.node.write(OD.UC2, 0, uc2 | UNIPOLAR)
    words = _cycles(s, 6)
    calm(s)
    low = [a for a in below if np.any(words[a.upper()][1:] != row.limit("code_min"))]
    if low or not all(0 < int(w) < row.limit("code_max") for a in within for w in words[a.upper()][1:]):
        raise Failed(f"{[f'{int(words[a][-1]):04X}h' for a in 'XYZ']}", f"0000h on {', '.join(below)} alone")
    expect(np.all(words["CLIP"][1:]), "CLIP 0 with a word at 0000h", "1")
    return f"0000h on {', '.join(below)} alone, CLIP 1"


@active("PSD1-LATE-01", needs={"bus", "can", "line", "lockstep"}, before=calm)
def late_begins_at_its_time(s: Dut, row: Requirement) -> str:
    """Read words sooner and later; count the strobes that the lines show to begin too long after FL2."""
    late_ns = row.limit("late_ns")
    before = int(s.unit.node.read(OD.COUNTERS, 16))
    with s.take() as take:
        line(s, f"W F {BOTH:04X}")
        for k in range(LATE_CYCLES):
            word(s, 0)
            for axis in (1, 2):
                _word_after(s, axis, LATE_STEP_S * ((2 * k + axis) % LATE_STEPS))
        line(s, "W F 0000")
        s.run_for(TAIL_S)
    told = int(s.unit.node.read(OD.COUNTERS, 16)) - before
    words = transfers(s.capture("late", take))
    waited = of(words, "cs_fall") - of(words, "fl2")
    slack_ns = 0.0 if take.lines is None else take.lines.resolution_ns
    sure, may = int((waited > late_ns + slack_ns).sum()), int((waited > late_ns - slack_ns).sum())
    near = np.abs(waited - late_ns) < late_ns / 2
    if not (near & (waited > late_ns)).any() or not (near & (waited < late_ns)).any():
        raise Inconclusive(f"strobes {waited.min()} to {waited.max()} ns after FL2; expected some about {late_ns:g} ns")
    calm(s)
    expect(sure <= told <= may, f"{told} late strobes counted", f"{sure}, those later than {late_ns:g} ns", lines=LINES)
    return f"{told} of {len(waited)} strobes late, {waited.min()} to {waited.max()} ns after FL2"


def _word_after(s: Dut, axis: int, wait_s: float) -> None:
    """Take a word, having waited; the line carries it out as time begins to pass."""
    s.run_for(wait_s)
    host = port(s)
    host.ask(f"R {axis:X}")
    s.run_for(STROBE_S)
    host.answer()


@active("PSD1-LATE-01", needs={"bus", "can"}, before=calm, after=calm)
def late_strobes_are_told(s: Dut, row: Requirement) -> str:
    """Read words as they come, then some 0.2 ms late; look at LATE and Late strobes."""
    late_s = row.limit("late_ns") * 1e-9
    before = int(s.unit.node.read(OD.COUNTERS, 16))
    s.unit.frames.forget()
    with while_streaming(s):
        strobes = len(drive(s, 3, slow_s=10 * late_s))
    cycles = s.unit.frames.take()
    told = int(s.unit.node.read(OD.COUNTERS, 16)) - before
    if not isinstance(cycles, Readings) or not np.all(cycles["LATE"]) or told != strobes:
        raise Failed(f"{told} late strobes counted", f"LATE in each cycle, {strobes} counted")
    status = line(s, "R 3").data
    expect(status & 1 << 11, f"STATUS {status:04X}h", "bit 11, late")
    return f"LATE in {len(cycles['LATE'])} cycles, {told} late strobes counted"


def _counted(s: Dut) -> dict[str, int]:
    """What a host that stays away costs; few objects, for reading one takes a period."""
    subs = {"Stretched cycles": 17, "Lost X": 18, "Lost Y": 19, "Lost Z": 20}
    return {name: int(s.unit.node.read(OD.COUNTERS, sub)) for name, sub in subs.items()}


def _stay_away(s: Dut) -> tuple[Readings, dict[str, int]]:
    """Two cycles in time, one whose X waits for five periods, one in time; what was counted meanwhile."""
    calm(s)
    s.unit.frames.forget()
    with while_streaming(s):
        line(s, f"W F {BOTH:04X}")
        for k in range(6):
            word(s, k % 3)
        s.run_for(0.5 * period_s(s.variant))
        before = _counted(s)
        s.run_for(5.5 * period_s(s.variant))
        for k in range(6):
            word(s, k % 3)
    cycles, after = s.unit.frames.take(), _counted(s)
    calm(s)
    if not isinstance(cycles, Readings) or len(cycles["MIXED"]) != 4:
        raise Failed("not four cycles on CAN", "four")
    return cycles, {k: after[k] - before[k] for k in after}


@active("PSD1-LATE-02", needs={"bus", "can"})
def a_stretched_cycle_is_told(s: Dut) -> str:
    """Leave X unread for five periods, look at MIXED and Stretched cycles."""
    cycles, counted = _stay_away(s)
    mixed = [int(v) for v in cycles["MIXED"]]
    hasty = any(mixed[:2]) if s.lockstep else False  # elsewhere no one knows how long our own reading takes
    if mixed[2] != 1 or hasty or counted["Stretched cycles"] < 1:
        raise Failed(f"MIXED {mixed}, {counted['Stretched cycles']} counted", "1 in the third, counted")
    return f"MIXED {mixed}, {counted['Stretched cycles']} counted"


@active("PSD1-LATE-03", needs={"bus", "can"})
def lost_conversions_are_told(s: Dut, row: Requirement) -> str:
    """Leave X unread for five periods, look at OVERRUN and Lost X, Y, Z."""
    cycles, counted = _stay_away(s)
    overrun = [int(v) for v in cycles["OVERRUN"]]
    lost = [counted[f"Lost {a}"] for a in "XYZ"]
    apart = max(lost) - min(lost)
    hasty = bool(overrun[1]) if s.lockstep else False
    if overrun[2] != 1 or hasty or min(lost) < row.limit("lost_min") or apart > row.limit("apart_max"):
        raise Failed(f"OVERRUN {overrun}, lost {lost}", "1 in the third, five or more lost of each")
    return f"OVERRUN {overrun}, lost {lost}"


@active("PSD1-CAN-02", needs={"can"}, before=calm)
def messages_tell_what_their_objects_hold(s: Dut) -> str:
    """Switch all messages on, let cycles end, and compare the last with 2200h, 2202h, 2203h and 2204h.

    Where there is a rate table it turns meanwhile, so that no two gyros and no two rate sensors say the same.
    """
    messages_on(s, True)
    node = s.unit.node
    with while_turning(s) as turns, s.take(lines=False) as take, while_streaming(s):
        run_cycles(s, 4)
        node.write_raw(OD.BUS, FLAGS + 1, bytes(2))  # no further cycle begins
        s.run_for(2 * period_s(s.variant))
    held = {index: [int(node.read(index, k)) for k in range(1, n + 1)] for index, n in HELD.items()}
    e = s.capture("messages", take)
    last = {}
    for name in MAPPED:
        log = e.frames_of(name)
        expect(len(log), f"no {name}", "one for each cycle")
        last[name] = {k: int(v[-1]) for k, v in log.raw(name).items()}
    calm(s)
    for name, objects in MAPPED.items():
        for signal, (index, sub) in objects.items():
            if last[name][signal] != held[index][sub - 1]:
                raise Failed(f"{signal} {last[name][signal]} in {name}", f"{held[index][sub - 1]}, {index:04X}h:{sub}")
    for index in (OD.GYRO_LOW, OD.RATE) if turns else ():
        conclusive(len(set(held[index])) == len(held[index]), f"{index:04X}h {held[index]}: two of them are alike")
    return f"{sum(map(len, MAPPED.values()))} signals as their objects hold them"


@active("PSD1-CAN-07", needs={"can"})
def the_board_says_what_it_is(s: Dut) -> str:
    """Read 1008h and 1018h sub 2."""
    return identity(s, "PSD1-CAN-07", "PSD-1")


@active("PSD1-CAN-08", needs={"can"}, before=calm)
def objects_are_as_the_dictionary_says(s: Dut) -> str:
    """Read every object of the EDS and write where nothing may be written."""
    return as_the_dictionary_says(s, "psd1", varies=(OD.UC1, OD.UC2) if s.variant.profile != "psd1" else ())
