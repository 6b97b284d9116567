"""Objects of PSA-2 and PSA-1: who it is, mirrors of the sample, type, rights, default and limits of each."""

from __future__ import annotations

from collections.abc import Mapping

from psabench.boards.objects import Psa2Objects as OD
from psabench.boards.psa2.conform.capture_can import Pairs, pairs
from psabench.boards.psa2.conform.check_registers import READ_ONLY, WRITE_ONLY
from psabench.boards.psa2.conform.check_stream import number, unit_us
from psabench.boards.psa2.conform.stimulus_objects import Row
from psabench.conform.capture.intervals import fact
from psabench.conform.capture.log import Capture
from psabench.conform.dictionary import encoded
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive, expect


@check("objects", "PSA2-CAN-09")
def the_board_says_who_it_is(e: Capture, row: Requirement) -> str:
    """Read 1008h and 1018h."""
    read = fact(e, "read")
    name = read[OD.DEVICE_NAME, 0].value
    expect(name == "PSA-2", f"1008h {name!r}", "'PSA-2'")
    for sub, limit in ((2, "product_code"), (3, "revision_code")):
        saw, due = number(read[OD.IDENTITY, sub]), int(row.limit(limit))
        expect(saw == due, f"1018h:{sub} {saw:08X}h", f"{due:08X}h")
    return f"{name}, product {number(read[OD.IDENTITY, 2]):08X}h, revision {number(read[OD.IDENTITY, 3]):08X}h"


@check("objects", "PSA2-CAN-10")
def object_2021h_is_the_word_width(e: Capture) -> str:
    """Read 2021h."""
    saw = number(fact(e, "read")[OD.WORD_BITS, 0])
    due = int(row_for(e, "PSA2-FRAME-06", "PSA2-FRAME-07", "PSA2-FRAME-08").limit("word_bits"))
    return expect(saw == due, f"{saw} bits", f"{due} bits")


@check("objects", "PSA2-CAN-11")
def mirrors_show_the_sample(e: Capture, row: Requirement) -> str:
    """Compare the mirrors with the PDO of the same number, or of one of those that came while it was asked for."""
    p = pairs(e)
    at = {int(s): k for k, s in enumerate(p.seq)}
    rounding = {OD.ACCEL_G: row.limit("rounding_g"), OD.ACCEL_UG: row.limit("rounding_ug")}
    for index, sub, answer, *numbers in fact(e, "mirrors"):
        first, last = (at.get(number(numbers[k])) for k in (0, -1))
        if first is None or last is None:
            raise Inconclusive(f"the sample of {index:04X}h:{sub} is not in the log")
        saw = answer.value
        if not isinstance(saw, (int, float)):
            raise Failed(f"{index:04X}h:{sub} answered by abort {answer.abort:08X}h", "a value")
        if index == OD.RAW_WORDS:
            saw = int(saw) >> 8
        elif (index, sub) == (OD.FRAME_HEAD, 5):  # us, where TSTAMP has units
            saw = int(saw / unit_us(e)) & 0xFFFF
        due = [_mirrored(e, p, k, index, sub) for k in range(first, last + 1)]
        if not any(abs(saw - d) <= rounding.get(index, 0.0) for d in due):
            saw = f"{index:04X}h:{sub} {saw}"
            raise Failed(saw, f"{due} of SEQ {p.seq[first]} to {p.seq[last]}", frames=p.about(first))
    return f"{len(fact(e, 'mirrors'))} objects as in the PDO of their sample"


def _mirrored(e: Capture, p: Pairs, k: int, index: int, sub: int) -> float:
    """What an object shows of sample k."""
    status = int(p.settled[k]) | p.clip[k] << 1 | p.overrun[k] << 2 | p.new[k] << 3 | int(p.channel[k]) << 4
    axis, code_v = (sub - 1) % 3, row_for(e, "PSA2-ADC-01").limit("code_uv") * 1e-6
    due_g = (float(p.code[k, axis]) * code_v - axis) / 2.0  # u0 = 0, 1, 2 V, k = 2 V/g
    due: Mapping[int, float] = {
        OD.CODES: int(p.code[k, axis]) if sub < 4 else int(p.temp[k]),
        OD.RAW_WORDS: int(p.code[k, axis]),
        OD.FRAME_HEAD: {2: status, 4: int(p.temp[k])}.get(sub, int(p.stamp[k]) & 0xFFFF),
        OD.ACCEL_G: due_g,
        OD.ACCEL_UG: due_g * 1e6,
    }
    return due[index]


@check("dictionary", "PSA2-CAN-12")
def objects_have_type_rights_default_and_limits(e: Capture) -> str:
    """Read every object of the EDS, and write what it must reject."""
    rows: list[Row] = fact(e, "rows")
    beyond = int(row_for(e, "PSA2-FORM-07").limit("abort_code"))
    for r in rows:
        d, name = r.due, f"{r.due.index:04X}h:{r.due.sub} ({r.due.name})"
        if d.access == "wo":
            expect(r.abort == WRITE_ONLY, f"{name} read: abort {r.abort:08X}h", f"{WRITE_ONLY:08X}h")
            continue
        expect(not r.abort, f"{name} read: abort {r.abort:08X}h", "its value")
        expect(d.data_bytes is None or len(r.raw) == d.data_bytes, f"{name} of {len(r.raw)} bytes", f"{d.data_bytes}")
        if d.access in ("const", "rw") and d.default is not None and r.raw != encoded(d, d.default):
            raise Failed(f"{name} {r.raw[::-1].hex().upper()}h", f"{d.default}")
        if r.write is not None and r.write != (READ_ONLY if d.access in ("ro", "const") else beyond):
            due = READ_ONLY if d.access in ("ro", "const") else beyond
            raise Failed(f"a write to {name} answered by {r.write:08X}h", f"abort {due:08X}h")
    return f"{len(rows)} objects"
