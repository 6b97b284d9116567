"""Stimuli of PSA-2 and PSA-1 that read objects: identity, mirrors of a sample, the whole dictionary."""

from __future__ import annotations

from dataclasses import dataclass

from psabench.boards.objects import Psa2Objects as OD
from psabench.boards.psa2.conform.stimulus_can import ACCEL, CONFIG0, TEMP, Answer, answer_of, ask, changed, tell
from psabench.conform.dut import Dut, Take
from psabench.conform.stimulus.streamed import recorded, while_streaming
from psabench.errors import DeviceError
from psabench.link.canopen_host import Described

TEMP_PERIOD_S, CHANNEL_LOOKS = 10.25e-3, 4
TRIES = 6  # in real time, on a busy machine, three answers may not come within one sample of 4 ms


@recorded("objects", boards=("psa2",), around=changed, lines=False)
def objects(s: Dut, take: Take) -> None:
    """Identity, width and mirrors. facts: read; mirrors, those of one sample, with its PDO in the log."""
    wanted = (
        *((OD.CODES, k) for k in (1, 2, 3, 4)),
        *((OD.FRAME_HEAD, k) for k in (2, 3, 4, 5)),
        *((i, k) for i in (OD.RAW_WORDS, OD.ACCEL_G, OD.ACCEL_UG) for k in (1, 2, 3)),
    )
    take.facts["read"] = {
        (i, sub): ask(s, i, sub)
        for i, sub in ((OD.DEVICE_NAME, 0), (OD.IDENTITY, 2), (OD.IDENTITY, 3), (OD.WORD_BITS, 0))
    }
    for axis in (1, 2, 3):
        tell(s, OD.ZERO_V, axis, axis - 1)
        tell(s, OD.SCALE_V_PER_G, axis, 2)
    tell(s, ACCEL[0], CONFIG0, 0x46)  # 250 SPS: a sample lasts 4 ms
    s.run_for(0.4)
    with while_streaming(s):
        s.run_for(0.02)
        found = [_of_one_sample(s, index, sub) for index, sub in wanted]
        for _ in range(CHANNEL_LOOKS):  # every temperature channel is in one of them
            s.run_for(TEMP_PERIOD_S)
            found.append(_of_one_sample(s, OD.FRAME_HEAD, 2))
        s.run_for(0.02)
    take.facts["mirrors"] = found


def _of_one_sample(s: Dut, index: int, sub: int) -> tuple[int, int, Answer, Answer, Answer]:
    """Object, sub-index, its value and the numbers of the samples that stood there before and after."""
    for _ in range(TRIES):
        before = ask(s, OD.FRAME_HEAD, 1)
        value = ask(s, index, sub)
        after = ask(s, OD.FRAME_HEAD, 1)
        if before == after:
            break
    return index, sub, value, before, after


@recorded("dictionary", boards=("psa2",), around=changed, lines=False)
def dictionary(s: Dut, take: Take) -> None:
    """Every object of the EDS but the registers read, and written where a write is rejected. facts: rows."""
    take.facts["rows"] = [_row(s, d) for d in s.unit.node.objects() if not (d.index in (*ACCEL, TEMP) and d.sub)]


@dataclass(frozen=True, slots=True)
class Row:
    """An object as the EDS has it, and as the board answers."""

    due: Described
    raw: bytes  # what was read
    abort: int  # of the read
    write: int | None  # abort code of a write of the same (read-only) or of one too many; None: none was tried


def _row(s: Dut, d: Described) -> Row:
    raw, abort, write = b"", 0, None
    try:
        raw = s.unit.node.read_raw(d.index, d.sub)
    except DeviceError as e:
        abort = e.abort_code
    if d.access in ("ro", "const"):
        write = _abort_of_write(s, d, raw or bytes(d.data_bytes or 1))
    elif isinstance(d.high, int) and d.data_bytes in (1, 2) and d.high + 1 < 1 << 8 * d.data_bytes:
        write = _abort_of_write(s, d, (d.high + 1).to_bytes(d.data_bytes, "little"))
    return Row(d, raw, abort, write)


def _abort_of_write(s: Dut, d: Described, data: bytes) -> int:
    return answer_of(lambda: s.unit.node.write_raw(d.index, d.sub, data)).abort
