"""PMKA asked over its bus and over CAN: registers, rejections, its ROM, the computer's program of calibration."""

from __future__ import annotations

from itertools import pairwise

from psabench.boards.objects import PmkaObjects
from psabench.boards.pmka import estimate as est
from psabench.boards.pmka.conform.stimulus import START_S, ts_s
from psabench.conform.bus_host import burst, line, line_refused
from psabench.conform.capture.log import CanLog
from psabench.conform.dictionary import as_the_dictionary_says, identity
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.registers import names_and_rights, one_value
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.stimulus.streamed import while_streaming
from psabench.conform.verdict import Failed, Inconclusive, conclusive, damaged_data_are, expect
from psabench.link.busport import Cycle

STATUS, MODE, COMMAND, BEAT, ZERO = 8, 9, 10, 11, 12
LATEST = tuple(f"R {a}" for a in (6, 0, 1, 2, 3, 4, 5, 7, 6))
STROBE_NS = 20_000_000
ATTEMPTS = 20  # of cycles that must fit into a period, on a machine that has other things to do
HEAT_K, HEAT_K_PER_MIN, HEAT_S = 10.0, 5.0, 60.0
ROM_WORDS_AT, COUNTS_AT = 0x100, 0
SIGNS = {0: 0, 1: 1, 3: -1}  # two bits of RESETS
AUTONOMOUS = 1


def calm(s: Dut) -> None:
    """As after power-on, with its first readings."""
    s.reset()
    s.run_for(0.002 + START_S + 2 * ts_s())


@active("PMKA-SAMP-04", needs={"bus", "can"})
def codes_of_the_bus_are_those_on_can(s: Dut) -> str:
    """Read 00h to 03h within a period, and find these codes on CAN."""
    return _as_on_can(s, 0, 4)


@active("PMKA-BUS-02", needs={"bus", "can"})
def state_registers_are_the_messages(s: Dut) -> str:
    """Read 04h, 05h and 07h within a period, and find resets, rotation and temperature on CAN."""
    return _as_on_can(s, 4, 7)


def _as_on_can(s: Dut, first: int, end: int) -> str:
    """Words first to end of X, Y, Z, K, RESETS, ROTATION, TEMPERATURE."""
    calm(s)
    with s.take(lines=False) as take, while_streaming(s):
        seen = []
        for _ in range(60):
            words = [c.data for c in burst(s, *LATEST)]
            if words[0] == words[-1]:
                seen.append(words)
            s.run_for(0.3 * ts_s())
        s.run_for(3 * ts_s())
    e = s.capture("registers", take)
    told = {}
    codes, states = e.frames_of("PMKA_CODES"), e.frames_of("PMKA_STATE")
    for a, b in zip(codes.frames, states.frames, strict=False):
        told[int.from_bytes(b.data[:2], "little")] = (a.data, b.data)
    found = 0
    for seq, *words, _ in seen:
        if seq not in told:
            continue
        code, state = told[seq]
        due = [int.from_bytes(code[i : i + 2], "little") for i in (0, 2, 4, 6)]
        due += [
            state[2],
            state[3] | (state[4] & 7) << 8 | (state[4] >> 3 & 3) << 12,
            int.from_bytes(state[6:8], "little"),
        ]
        if words[first:end] != due[first:end]:
            raise Failed(f"{[f'{v:04X}' for v in words[first:end]]}", f"{[f'{v:04X}' for v in due[first:end]]}")
        found += 1
    conclusive(found >= 5, f"{found} readings were seen on the bus and on CAN")
    return f"{found} readings as on CAN"


@active("PMKA-BUS-02", needs={"bus"}, before=calm, after=calm)
def registers_have_their_names_and_rights(s: Dut) -> str:
    """Ask who is there, read and write every address."""
    line(s, "W 9 0")  # COMMAND is taken in mode program
    return names_and_rights(s, "pmka", never={}, writes={"COMMAND": 0, "BEAT": 200, "ZERO": 100, "INDEX": 1, "MODE": 0})


@active("BUS-PORT-11", needs={"bus", "can"}, before=calm, boards=("pmka",))
def registers_show_what_their_objects_show(s: Dut) -> str:
    """Read codes, resets, number and temperature beside the objects of the same reading."""
    return one_value(s, "pmka", lambda s: s.run_for(2 * ts_s()), PmkaObjects.STATE)


@active("PMKA-CAL-02", needs={"bus", "can"}, before=calm, after=calm)
def the_computer_turns_the_calibration(s: Dut) -> str:
    """Set mode program, command beats and calibrations, look at TAU, CAL and SERVES."""
    line(s, "W 9 0")
    for tau, cal in ((2, 1), (4, 2), (5, 0), (1, 1), (3, 2)):
        line(s, f"W A {tau | cal << 4:X}")
        s.run_for(4 * ts_s())
        rotation = line(s, "R 5").data
        saw = rotation >> 8 & 7, rotation >> 12 & 3
        serves = [rotation >> 2 * k & 3 for k in range(4)]
        resting = tau - 2 if 2 <= tau <= 4 else 3
        if saw != (tau, cal) or serves[resting] != 0:
            raise Failed(f"beat {saw[0]}, calibration {saw[1]}, serves {serves}", f"beat {tau}, calibration {cal}")
    return "five beats and calibrations as commanded"


@active("PMKA-ROM-01", needs={"bus"})
def the_rom_can_be_read(s: Dut) -> str:
    """Read all words of the ROM by INDEX and DATA."""
    rom = _rom(s)
    if rom.ts_s != ts_s() or len(rom.degc) < 2 or rom.serial != s.unit.serial() & 0xFFFF:
        raise Failed(f"Ts {rom.ts_s * 1e3:g} ms, {len(rom.degc)} points, serial {rom.serial}", "those of the board")
    return f"{len(rom.degc)} points from {rom.degc[0]:g} to {rom.degc[-1]:g} degC, serial number {rom.serial}"


@active("PMKA-ROM-02", needs={"bus"})
def the_sum_of_the_rom_is_0(s: Dut, row: Requirement) -> str:
    """Add all words."""
    words = _rom_words(s)
    total = sum(words) & 0xFFFF
    if total != row.limit("sum") or words[0] != row.limit("layout"):
        raise Failed(f"sum {total:04X}h, layout {words[0]}", f"{int(row.limit('sum')):04X}h, {row.limit('layout'):g}")
    return f"{len(words)} words, sum 0"


def _rom_words(s: Dut) -> list[int]:
    def word(w: int) -> int:
        line(s, f"W D {ROM_WORDS_AT + w:X}")
        return line(s, "R E").data

    head = [word(w) for w in range(est.ROM_HEAD)]
    rows = 4 * est.ROM_ROW * min(head[2], 32)
    return head + [word(est.ROM_HEAD + w) for w in range(rows + 1)]


def _rom(s: Dut) -> est.Rom:
    with damaged_data_are(Failed, "a ROM that is whole"):
        return est.rom_of(_rom_words(s))


@active("PMKA-ROM-03", needs={"bus"})
def the_temperature_stands_still(s: Dut, row: Requirement) -> str:
    """Read TEMPERATURE over a second: it stands still to its noise, within the range of the table of the ROM."""
    rom = _rom(s)
    calm(s)
    seen = []
    for _ in range(20):
        seen.append(_degc(s))
        s.run_for(0.05)
    if max(seen) - min(seen) > row.limit("offset_max_k") or not rom.degc[0] <= seen[0] <= rom.degc[-1]:
        raise Failed(f"{min(seen):.3f} to {max(seen):.3f} degC", "the temperature of the board, still")
    return f"{min(seen):.3f} to {max(seen):.3f} degC"


def _degc(s: Dut) -> float:
    code = line(s, "R 7").data
    return float((code - 0x10000 if code & 0x8000 else code) * requirements()["PMKA-ROM-03"].limit("code_degc"))


@active("PMKA-ROM-03", needs={"bus", "chamber"}, before=calm)
def the_temperature_is_that_of_the_chamber(s: Dut, row: Requirement) -> str:
    """Compare TEMPERATURE with the chamber at rest; heat the air for a minute, and see it follow."""
    chamber = s.bench.chamber
    air, first, ramp = chamber.temp_degc, _degc(s), chamber.ramp_k_per_min
    expect(abs(first - air) <= row.limit("offset_max_k"), f"{first:.3f} degC", f"{air:.3f} degC in the chamber")
    try:
        chamber.ramp(HEAT_K_PER_MIN)
        chamber.set(air + HEAT_K)
        s.run_for(HEAT_S)
        hot, later = chamber.temp_degc, _degc(s)
    finally:
        chamber.set(air)
        chamber.ramp(ramp)
    calm(s)
    if not first + row.limit("offset_max_k") < later < hot:
        raise Failed(f"{first:.3f}, later {later:.3f} degC", f"more, and less than the air's {hot:.3f} degC")
    return f"{first:.3f} degC at {air:.3f} degC; {later:.3f} degC while the air has {hot:.3f} degC"


@active("PMKA-BUS-03", needs={"bus"}, before=calm)
def a_reading_that_nobody_took_is_told(s: Dut, row: Requirement) -> str:
    """Read STATUS with and without a read of K in the period before."""
    waits, missed = int(row.limit("waits_mask")), int(row.limit("missed_mask"))
    for _ in range(ATTEMPTS):
        s.run_for(3 * ts_s())
        before, *found, after = (c.data for c in burst(s, "R 6", "R 8", "R 3", "R 8", "R 6"))
        if before == after:
            break
    else:
        raise Inconclusive("five cycles on the bus last longer than a period")
    first, _, taken = found
    if not first & waits or not first & missed or taken & (waits | missed):
        raise Failed(f"STATUS {first:04X}h before K was read, {taken:04X}h after", "it waits, one was missed; neither")
    pause = f"R 9 {round(0.6 * ts_s() * 1e9)}"  # a strobe so long: the bridge keeps time, whatever its host does
    for _ in range(ATTEMPTS):
        cycles = burst(s, "R 3", "R 8", *(pause, "R 3") * 4, "R 8")
        took_s = [b.t_s - a.t_s for a, b in pairwise([c for c in cycles if c.address == 3])]
        if max(took_s) < 0.9 * ts_s():
            break
    else:
        raise Inconclusive("cycles on the bus last longer than a period")
    if cycles[-1].data & missed:
        raise Failed(f"STATUS {cycles[-1].data:04X}h with K read in each period", "no reading missed")
    return "bit 0 until K is read, bit 1 where one was not taken"


def _periods(a: Cycle, b: Cycle) -> float:
    """From the end of one strobe to that of another, in periods, by the board's time."""
    return (b.t_s - a.t_s) / ts_s()


@active("PMKA-BUS-04", needs={"bus"}, before=calm)
def a_read_is_of_its_strobe_s_beginning(s: Dut) -> str:
    """Read SEQ with a strobe of 20 ms, and at once afterwards."""
    long, after = burst(s, f"R 6 {STROBE_NS}", "R 6")
    made = (after.data - long.data) & 0xFFFF
    whole = int(_periods(long, after) + STROBE_NS * 1e-9 / ts_s())
    saw = f"SEQ {long.data} with a strobe of 20 ms, {after.data} after it"
    return expect(made in (whole, whole + 1), saw, f"{whole} or {whole + 1} readings more, that of its beginning")


@active("PMKA-BUS-04", needs={"bus", "can"}, before=calm)
def a_write_acts_at_the_end_of_its_strobe(s: Dut) -> str:
    """Write MODE with a strobe of 20 ms and look from which reading on AUTONOMOUS has changed."""
    was = line(s, "R 9").data & AUTONOMOUS
    with s.take(lines=False) as take, while_streaming(s):
        s.run_for(3 * ts_s())
        first, written = burst(s, "R 6", f"W 9 {1 - was:X} {STROBE_NS}")
        s.run_for(3 * ts_s())
    calm(s)
    states: CanLog = s.capture("mode", take).frames_of("PMKA_STATE")
    changed = [int.from_bytes(f.data[:2], "little") for f in states.frames if (f.data[4] >> 5 & 1) != was]
    expect(changed, "AUTONOMOUS never changes", "after the strobe")
    readings, whole = (changed[0] - first.data) & 0xFFFF, int(_periods(first, written))
    saw = f"AUTONOMOUS changes {readings} readings after the beginning of a strobe of 20 ms"
    return expect(whole <= readings <= whole + 2, saw, f"{whole} to {whole + 2}: at its end")


@active("PMKA-BUS-05", needs={"bus"}, before=calm, after=calm)
def what_cannot_be_is_refused(s: Dut, row: Requirement) -> str:
    """Read an address that is none, command in mode autonomous, set a beat too short, read before the first reading."""
    line_refused(s, "R F", row.limit("no_address_code"))
    line(s, "W 9 1")
    line_refused(s, "W A 1", row.limit("value_code"))
    line(s, "W C 78")
    line_refused(s, "W B 7D", row.limit("value_code"))
    s.reset()
    s.run_for(0.003)
    line_refused(s, "R 0", row.limit("state_code"))
    return "four refusals with their codes"


@active("PMKA-BUS-06", needs={"bus", "can"})
def resets_are_counted(s: Dut) -> str:
    """Count resets in the readings of a second, and compare them with INDEX 0 to 7."""
    s.reset()
    s.run_for(0.002)
    with s.take(lines=False) as take, while_streaming(s):
        s.run_for(1.0)
    counted = []
    for index in range(8):
        line(s, f"W D {COUNTS_AT + index:X}")
        counted.append(line(s, "R E").data)
    log = s.capture("resets", take).frames_of("PMKA_STATE")
    made = [[SIGNS.get(f.data[2] >> 2 * k & 3, 0) for k in range(4)] for f in log.frames if len(f.data) == 8]
    told = [sum(row[k] == sign for row in made) for k in range(4) for sign in (1, -1)]
    if any(not 0 <= c - t <= 2 for c, t in zip(counted, told, strict=True)) or not any(told):
        raise Failed(f"{counted} counted", f"{told} told, and those since")
    return f"{counted} counted, {told} told"


@active("PMKA-CAN-05", needs={"can"})
def the_board_says_what_it_is(s: Dut) -> str:
    """Read 1008h and 1018h sub 2."""
    return identity(s, "PMKA-CAN-05", "PMKA")


@active("PMKA-CAN-06", needs={"can"}, before=calm)
def objects_are_as_the_dictionary_says(s: Dut) -> str:
    """Read every object of the EDS and write where nothing may be written."""
    return as_the_dictionary_says(s, "pmka")
