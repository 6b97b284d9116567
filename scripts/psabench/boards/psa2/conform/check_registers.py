"""Registers, opcodes, rejections, objects and trouble of PSA-2 and PSA-1, as SDO answers tell them."""

from __future__ import annotations

from functools import cache

import numpy as np

from psabench.boards.psa2.conform.capture_can import pairs
from psabench.boards.psa2.conform.check_serial import LEAST
from psabench.boards.psa2.conform.check_setup import ACCEL as ACCEL_LINES
from psabench.boards.psa2.conform.check_setup import TEMP as TEMP_LINES
from psabench.boards.psa2.conform.check_setup import port_traffic
from psabench.boards.psa2.conform.check_stream import number
from psabench.boards.psa2.conform.stimulus_can import (
    ACCEL,
    CONFIG0,
    CONFIG1,
    DRATE,
    FSC0,
    OFC0,
    OVERRUNS,
    REGISTERS,
    SYNCS_MISSED,
    TEMP,
    Answer,
)
from psabench.conform.capture.intervals import fact
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.profile import proto_yaml
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, damaged_data_are, expect, none_of

READ_ONLY, WRITE_ONLY = 0x06010002, 0x06010001
STATUS = 1
SCANNED = (STATUS, 2)  # of the temperature converter: DRDY is a level, MUX is the scan's


def register(e: Capture, index: int, sub: int) -> int:
    """A register as the stimulus read it. Raises Failed for a rejection."""
    return number(fact(e, "read")[index, sub])


@cache
def table(part: str) -> tuple[tuple[str, int], ...]:
    """Name and reset value of each register of a part, by the table that the row names."""
    doc = proto_yaml("psabench.yaml")
    return tuple((r["name"], int(r["reset"])) for r in doc["registers"][part])


def _all(e: Capture, sub: int, due: int, what: str, mask: int = 0xFF) -> str:
    """A register of all three accelerometer converters. Raises Failed."""
    for index in ACCEL:
        saw = register(e, index, sub) & mask
        expect(saw == due, f"{what} {saw:02X}h at {index:04X}h", f"{due:02X}h")
    return f"{what} {due:02X}h on three converters"


def _number24(e: Capture, sub: int, due: int, what: str) -> str:
    for k in range(3):
        _all(e, sub + k, due >> 8 * k & 0xFF, f"{what}{k}")
    return f"{what} {due:06X}h on three converters"


@check("registers", "PSA2-RES-01")
def ofc_is_zero(e: Capture, row: Requirement) -> str:
    """Read the offset registers after the set-up."""
    return _number24(e, OFC0, int(row.limit("ofc_code")), "OFC")


@check("registers", "PSA2-RES-02")
def fsc_is_one(e: Capture, row: Requirement) -> str:
    """Read the full-scale registers after the set-up."""
    return _number24(e, FSC0, int(row.limit("fsc_code")), "FSC")


@check("registers", "PSA2-REG-01")
def config0_is_the_articles(e: Capture, row: Requirement) -> str:
    """Read CONFIG0 after the set-up."""
    return _all(e, CONFIG0, int(row.limit("config0_code")), "CONFIG0")


@check("registers", "PSA2-REG-02", "PSA2-REG-03")
def status_is_what_its_writes_left(e: Capture, row: Requirement) -> str:
    """Read STATUS of the temperature converter after the set-up."""
    mask, due = int(row.limit("mask_bits")), int(row.limit("value_bits"))
    saw = register(e, TEMP, STATUS) & mask
    return expect(saw == due, f"ACAL and BUFEN {saw:02X}h", f"{due:02X}h")


@check("registers", "PSA2-REG-04")
def drate_is_100_a_second(e: Capture, row: Requirement) -> str:
    """Read DRATE of the temperature converter after the set-up."""
    saw, due = register(e, TEMP, DRATE), int(row.limit("drate_code"))
    return expect(saw == due, f"DRATE {saw:02X}h", f"{due:02X}h")


@check("registers", "PSA2-REG-05", "PSA1-REG-01")
def config1_is_the_boards(e: Capture, row: Requirement) -> str:
    """Read CONFIG1 after the set-up."""
    return _all(e, CONFIG1, int(row.limit("config1_code")), "CONFIG1")


# ---- rights, fields and reset values


@check("opcodes", "PSA2-REG-06", "PSA2-CHIP-01")
def accelerometer_converters_have_their_reset_values(e: Capture) -> str:
    """RESET by opcode, then every register beside the table."""
    for k, (name, due) in enumerate(table("ads1282")):
        _all(e, k + 1, due, name, 0x0F if name == "ID" else 0xFF)
    return f"{len(table('ads1282'))} registers of three converters"


@check("opcodes", "PSA2-REG-07")
def the_temperature_converter_has_its_reset_values(e: Capture) -> str:
    """RESET by opcode, then every register beside the table (OFC and FSC are what the calibration leaves)."""
    own = [(k + 1, n, v) for k, (n, v) in enumerate(table("ads1256")) if n[:3] not in ("OFC", "FSC")]
    for sub, name, due in own:
        mask = 0xFE if sub == STATUS else 0x00 if sub == 2 else 0xF0 if name == "IO" else 0xFF
        saw = register(e, TEMP, sub)
        expect(saw & mask == due & mask, f"{name} {saw:02X}h", f"{due:02X}h")
    return f"{len(own)} registers"


def _written(e: Capture, *, temp: bool) -> list[tuple[int, int, int, Answer, list[Answer]]]:
    return [w for w in fact(e, "written") if (w[0] == TEMP) == temp]


def _keeps(e: Capture, *, temp: bool, part: str) -> str:
    found = _written(e, temp=temp)
    for index, sub, value, answer, read in found:
        name = table(part)[sub - 1][0]
        if answer != Answer():
            raise Failed(f"{name} = {value:02X}h at {index:04X}h answered by abort {answer.abort:08X}h", "it is taken")
        for a in read:
            expect(number(a) == value, f"{name} {number(a):02X}h after a write of {value:02X}h", f"{value:02X}h")
    return f"{len(found)} registers read as they were written"


@check("writes", "PSA2-REG-06")
def accelerometer_converters_keep_what_is_written(e: Capture) -> str:
    """Write every writable register and read it on all three converters."""
    return _keeps(e, temp=False, part="ads1282")


@check("writes", "PSA2-REG-07")
def the_temperature_converter_keeps_what_is_written(e: Capture) -> str:
    """Write the registers that no scan touches and read them."""
    return _keeps(e, temp=True, part="ads1256")


@check("writes", "PSA2-REG-07")
def the_part_of_the_temperature_converter_cannot_be_written(e: Capture, row: Requirement) -> str:
    """Write every bit of STATUS: those that name the part stay."""
    mask = int(row.limit("status_id_mask"))
    before, *after = (number(a) for a in fact(e, "status"))
    for saw in after:
        expect(not (saw ^ before) & mask, f"STATUS {saw:02X}h, {before:02X}h before", f"bits {mask:02X}h as they were")
    return f"STATUS {', '.join(f'{v:02X}h' for v in (before, *after))}"


@check("writes", "PSA2-SIG-03", "PSA2-ACC-10")
def one_write_reaches_three_converters(e: Capture) -> str:
    """Write through 2000h and read 2000h, 2003h and 2004h."""
    found = _written(e, temp=False)
    conclusive(found, "nothing was written")
    for _, sub, value, answer, read in found:
        saw = [number(a) for a in read]
        words = f"register {sub - 1:02X}h is {', '.join(f'{v:02X}h' for v in saw)} on X, Y, Z"
        expect(answer != Answer() or len(set(saw)) == 1, words, f"{value:02X}h on each")
    return f"{len(found)} writes, each the same on three converters"


@check("registers", "PSA2-ACC-01", needs={"pins"})
def a_register_read_is_what_the_converter_says(e: Capture) -> str:
    """Compare SDO answers with the bytes on DOutX, DOutY, DOutZ and DOutT."""
    found = port_traffic(e).messages
    read = fact(e, "read")
    seen = 0
    _between_its_opcodes(e)
    for m in found:
        code = m.sent[0]
        if m.temp and code & 0xF0 == 0x10 and len(m.sent) == 3:
            pairs_ = [(TEMP, m.got[0][2])]
        elif not m.temp and code & 0xF0 == 0x20 and len(m.sent) == 3:
            pairs_ = [(index, got[2]) for index, got in zip(ACCEL, m.got, strict=True)]
        else:
            continue
        sub = (code & 0x0F) + 1
        told = [number(read[index, sub]) for index, _ in pairs_ if (index, sub) in read]
        saw = [v for _, v in pairs_]
        if (m.temp and sub in SCANNED) or told == saw:
            seen += 1
            continue
        lines = TEMP_LINES if m.temp else (*ACCEL_LINES, "DOutX", "DOutY", "DOutZ")
        raise Failed(f"{m.name} gave {saw}, the SDO {told}", "the same", at_ns=m.begin_ns, lines=lines)
    due = len(ACCEL) * len(REGISTERS) + len(REGISTERS)
    words = f"{seen} reads of registers on the ports for {due} SDO uploads"
    expect(seen >= due, words, "one for each", at_ns=e.wires.end_ns, lines=ACCEL_LINES)
    return f"{seen} reads, each told as the converter said"


def _between_its_opcodes(e: Capture) -> None:
    """A converter that reads continuously answers to RREG after SDATAC alone, and goes on after RDATAC."""
    row, found = row_for(e, "PSA2-ACC-01"), port_traffic(e).of(temp=False)
    stop, go = (bytes([int(row.limit(name))]) for name in ("sdatac_code", "rdatac_code"))
    for before, m, after in zip(found, found[1:], found[2:], strict=False):
        if m.sent[0] & 0xF0 == 0x20 and (before.sent, after.sent) != (stop, go):
            saw = f"{m.name} between {before.name} and {after.name}"
            due = f"between {stop.hex().upper()} and {go.hex().upper()}"
            raise Failed(saw, due, at_ns=m.begin_ns, lines=ACCEL_LINES)


def _no_overrun(e: Capture) -> None:
    lost = number(fact(e, "after")[OVERRUNS]) - number(fact(e, "before")[OVERRUNS])
    expect(not lost, f"{lost} overruns counted", "none")


@check("registers", "PSA2-ACC-02")
def register_reads_cost_no_conversion(e: Capture) -> str:
    """Read all registers while frames flow: SEQ and the counter of overruns."""
    p = pairs(e)
    p.unbroken()
    _no_overrun(e)
    return f"{len(p)} frames without a gap beside {len(fact(e, 'read'))} reads"


@check("busy", "PSA2-ACC-02")
def register_reads_cost_no_conversion_at_the_highest_rate(e: Capture) -> str:
    """Read registers again and again while 4000 frames a second flow: TOG, and the counter of overruns."""
    refused = [a for a in fact(e, "answers") if a != Answer()]
    none_of(refused, lambda a: f"4000 SPS in the fast form answered by {a.abort:08X}h", "it is taken")
    log = e.frames_of("PSA2_FAST")
    conclusive(len(log) >= LEAST, f"{len(log)} frames PSA2_FAST came")
    with damaged_data_are(Failed, "messages of their length", frames=log.frames[:4]):
        twice = np.flatnonzero(np.diff(log.raw("PSA2_FAST")["TOG"]) == 0)
    if len(twice):
        raise Failed("TOG twice the same", "0 and 1 in turn", frames=log.frames[twice[0] : twice[0] + 3])
    _no_overrun(e)
    return f"{len(log)} frames without a gap"


# ---- rejections


def _refused(answer: Answer, due: int, what: str) -> None:
    """Raises Failed for another answer than this abort."""
    if answer.abort != due:
        saw = "taken" if answer == Answer() else f"answered by {answer.abort:08X}h {answer.value or ''}".rstrip()
        raise Failed(f"{what} {saw}", f"abort {due:08X}h")


@check("refusals", "PSA2-ACC-03")
def a_read_only_register_is_not_written(e: Capture, row: Requirement) -> str:
    """Write to ID."""
    due = int(row.limit("abort_code"))
    for index, sub, _, answer in fact(e, "read-only"):
        _refused(answer, due, f"a write to {index:04X}h:{sub}")
    return f"abort {due:08X}h"


@check("refusals", "PSA2-ACC-04")
def reserved_values_are_refused(e: Capture, row: Requirement) -> str:
    """Write values that the parts reserve, and read the registers again."""
    due = int(row.limit("abort_code"))
    found = fact(e, "reserved")
    for index, sub, value, before, answer, after in found:
        _refused(answer, due, f"{value:02X}h to {index:04X}h:{sub}")
        if before != after:
            raise Failed(f"{index:04X}h:{sub} is {number(after):02X}h after a refusal", f"{number(before):02X}h")
    return f"{len(found)} values refused and not stored"


@check("refusals", "PSA2-ACC-08")
def opcodes_that_want_more_are_refused(e: Capture, row: Requirement) -> str:
    """Write them to 2010h."""
    due = int(row.limit("abort_code"))
    found = fact(e, "opcodes")
    for _, sub, value, answer in found:
        _refused(answer, due, f"opcode {value:02X}h to 2010h:{sub}")
    return f"{len(found)} opcodes refused"


@check("refusals", "PSA2-ACC-08", needs={"pins"})
def refused_opcodes_never_reach_a_converter(e: Capture) -> str:
    """Look for them on DIn and DInT."""
    sent = {1: {m.sent for m in port_traffic(e).of(temp=False)}, 2: {m.sent for m in port_traffic(e).of(temp=True)}}
    for _, sub, value, _ in fact(e, "opcodes"):
        saw = f"opcode {value:02X}h on {'DIn' if sub == 1 else 'DInT'}"
        expect(bytes([value]) not in sent[sub], saw, "nothing", at_ns=e.wires.start_ns, lines=ACCEL_LINES)
    return f"none of {len(fact(e, 'opcodes'))} opcodes on DIn or DInT"


@check("refusals", "PSA2-FORM-07")
def an_unknown_form_is_refused(e: Capture, row: Requirement) -> str:
    """Write 4 to 2020h."""
    due, answer = int(row.limit("abort_code")), fact(e, "form")
    _refused(answer, due, "form 4")
    return f"abort {due:08X}h"


@check("early", "PSA2-ACC-05")
def no_access_before_the_set_up_is_over(e: Capture, row: Requirement) -> str:
    """Read registers right after a reset."""
    due = int(row.limit("abort_code"))
    for a in fact(e, "early"):
        _refused(a, due, "a read before the end of the set-up")
    return f"abort {due:08X}h for {len(fact(e, 'early'))} reads"


@check("early", "PSA2-ACC-05")
def one_access_at_a_time(e: Capture, row: Requirement) -> str:
    """Read a register while a read that its client gave up is under way."""
    due, saw = int(row.limit("abort_code")), fact(e, "busy")
    expect(due in saw, f"aborts {', '.join(f'{a:08X}h' for a in saw) or 'none'}", f"{due:08X}h at least once")
    return f"abort {due:08X}h {saw.count(due)} times"


@check("early", "PSA2-SAMP-05")
def a_sync_that_could_not_pulse_is_counted(e: Capture) -> str:
    """SYNC with 2024h = 1 while the set-up runs."""
    before, after = (number(a) for a in fact(e, "missed"))
    return expect(after == before + 1, f"2030h:{SYNCS_MISSED} {before}, then {after}", "one more")


# ---- opcodes


@check("opcodes", "PSA2-ACC-07")
def opcodes_are_taken(e: Capture) -> str:
    """RESET to both groups: answered, and CONFIG0 and DRATE are those of the parts afterwards."""
    for group, answer in zip(("accelerometer", "temperature"), fact(e, "answers"), strict=True):
        expect(answer == Answer(), f"RESET to the {group} converters answered by {answer.abort:08X}h", "it is taken")
    code = dict(table("ads1256"))["DRATE"]
    expect(register(e, TEMP, DRATE) == code, f"DRATE {register(e, TEMP, DRATE):02X}h after RESET", f"{code:02X}h")
    return _all(e, CONFIG0, dict(table("ads1282"))["CONFIG0"], "CONFIG0")


@check("opcodes", "PSA2-ACC-07", needs={"pins"})
def opcodes_are_sent_to_their_group(e: Capture) -> str:
    """Look for RESET on DIn and DInT."""
    for code, temp in ((0x06, False), (0xFE, True)):
        n = sum(m.sent == bytes([code]) for m in port_traffic(e).of(temp=temp))
        line = "DInT" if temp else "DIn"
        saw, lines = f"{code:02X}h {n} times on {line}", ("SClk", line, "CST")
        expect(n == 1, saw, "once", at_ns=e.wires.start_ns, lines=lines)
    return "06h on DIn, FEh on DInT"


@check("opcodes", "PSA2-ACC-09")
def a_reset_opcode_is_followed_by_no_set_up(e: Capture, row: Requirement) -> str:
    """CONFIG0 and CONFIG1 after RESET by opcode."""
    _all(e, CONFIG0, int(row.limit("config0_code")), "CONFIG0")
    return _all(e, CONFIG1, int(row.limit("config1_code")), "CONFIG1")
