"""Stimuli of PSA-2 and PSA-1 that ask for something over CAN: objects, registers, forms, modes, settings.

What was answered is in `facts`: "cut" has the number of CAN frames at named moments, the rest is said at each stimulus.
Settings are put back by a reset.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from psabench.boards.objects import Psa2Objects as OD
from psabench.boards.psa2.conform.capture_can import CODE_MAX, pairs, segment
from psabench.boards.psa2.conform.stimulus import PERIOD_S
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut, Take
from psabench.conform.stimulus.streamed import recorded, while_streaming
from psabench.conform.verdict import Failed, Inconclusive
from psabench.errors import DeviceError
from psabench.link.protocol_files import dbc_node, message

ACCEL, TEMP = (OD.REG_X, OD.REG_Y, OD.REG_Z), OD.REG_T  # objects of registers; sub-index = address + 1
CONFIG0, CONFIG1, OFC0, FSC0 = 2, 3, 6, 9  # sub-indices
DRATE = 4
REGISTERS = range(1, 12)
COUNTERS, OPCODE, FORM = OD.COUNTERS, OD.OPCODE, OD.FRAME_FORM
MODE, NTH, PULSES = OD.SAMPLE_MODE, OD.SAMPLE_NTH, OD.SYNC_PIN
FRAMES, OVERRUNS, TIMEOUTS, SYNCS_MISSED = 1, 2, 9, 12
SYNC = 0x80
RATES_HZ = (250, 500, 1000, 2000, 4000)  # by DR
SETTLE_PERIODS = 64
BUSY_ROUNDS = 3
AGAIN = 6
BLOCKS, MOST_LOOKS = 4, 200  # after which the latest sample is looked at; data periods until one comes
FORM_S = (0.25, 0.25, 0.06, 0.06)  # the codes of forms 0 and 1 are compared in the mean


@dataclass(frozen=True, slots=True)
class Answer:
    """Of an SDO: the value read (None after a write), or the abort code."""

    value: object = None
    abort: int = 0

    def __str__(self) -> str:
        return f"abort {self.abort:08X}h" if self.abort else str(self.value)


def answer_of(access: Callable[[], object]) -> Answer:
    """What comes of an access by SDO. Raises LinkError where no one answers."""
    try:
        return Answer(access())
    except DeviceError as e:
        return Answer(abort=e.abort_code)


def ask(s: Dut, index: int, sub: int = 0) -> Answer:
    """Read an object."""
    return answer_of(lambda: s.unit.node.read(index, sub))


def tell(s: Dut, index: int, sub: int, value: int) -> Answer:
    """Write an object."""
    return answer_of(lambda: s.unit.node.write(index, sub, value))


def tell_raw(s: Dut, index: int, sub: int, value: int) -> Answer:
    """Write one byte, whatever the EDS says of the object."""
    return answer_of(lambda: s.unit.node.write_raw(index, sub, bytes([value])))


def cut(take: Take, name: str) -> None:
    """Note how many frames had come."""
    cuts = take.facts.setdefault("cut", {})
    assert isinstance(cuts, dict)
    cuts[name] = len(take.frames)


def counters(s: Dut, *, after: bool = False) -> dict[int, Answer]:
    """Of object 2030h by sub-index; the frames last before a stream, first after it."""
    subs = (SYNCS_MISSED, TIMEOUTS, OVERRUNS, FRAMES)
    return {sub: ask(s, COUNTERS, sub) for sub in (subs[::-1] if after else subs)}


@contextmanager
def changed(s: Dut) -> Iterator[None]:
    """Settings may be changed within; a reset puts them back."""
    s.wait_ready()
    try:
        yield
    finally:
        s.reset()
        s.run_for(PERIOD_S)


def streamed(s: Dut, take: Take, name: str, dwell_s: float) -> None:
    """Frames for so long, between the cuts `name` and `name end`."""
    cut(take, name)
    with while_streaming(s):
        s.run_for(dwell_s)
    cut(take, f"{name} end")


def split(index: int, sub: int, value: int) -> list[tuple[int, int, int]]:
    """Writes of the three bytes of OFC or FSC, low byte first."""
    return [(index, sub + k, value >> 8 * k & 0xFF) for k in range(3)]


@recorded("quiet", boards=("psa2",), before=Dut.wait_ready, lines=False, streaming=True)
def quiet(s: Dut, take: Take) -> None:
    """Frames for two and a half seconds, on CAN alone; counters meanwhile: the log has them among the frames."""
    s.run_for(10 * PERIOD_S)
    take.facts["before"] = counters(s)
    s.run_for(2.5)
    take.facts["after"] = counters(s, after=True)
    s.run_for(10 * PERIOD_S)


@recorded("registers", boards=("psa2",), before=Dut.wait_ready)
def registers(s: Dut, take: Take) -> None:
    """All registers read while frames flow. facts: read, by index and sub-index; counters before and after."""
    take.facts["before"] = counters(s)
    with while_streaming(s):
        s.run_for(10 * PERIOD_S)
        take.facts["read"] = {(i, sub): ask(s, i, sub) for i in (*ACCEL, TEMP) for sub in REGISTERS}
        s.run_for(10 * PERIOD_S)
    take.facts["after"] = counters(s, after=True)


@recorded("busy", boards=("psa2",), around=changed)
def busy(s: Dut, take: Take) -> None:
    """All registers read again and again at 4000 SPS in the fast form. facts: answers; counters before and after."""
    take.facts["answers"] = [tell(s, FORM, 0, 1), tell(s, ACCEL[0], CONFIG0, 0x46 | 4 << 3)]
    s.run_for(SETTLE_PERIODS / RATES_HZ[4])
    take.facts["before"] = counters(s)
    with while_streaming(s):
        for k in range(BUSY_ROUNDS):
            s.run_for((1 + k / BUSY_ROUNDS) * PERIOD_S)  # at another phase of a conversion each
            for index, sub in itertools.product((*ACCEL, TEMP), REGISTERS):
                ask(s, index, sub)
        s.run_for(10 * PERIOD_S)
    take.facts["after"] = counters(s, after=True)


PATTERNS: Sequence[tuple[int, int, int]] = (  # object, sub-index, value that the part takes
    *((ACCEL[0], sub, value) for sub in range(4, 12) for value in (0xA5, 0x5A)),
    (ACCEL[0], CONFIG0, 0x52),
    (TEMP, 3, 0x21),
    (TEMP, 4, 0x72),
    *((TEMP, sub, value) for sub in range(6, 12) for value in (0xA5, 0x5A)),
)
STATUS_WRITES = (0xF6, 0x04)  # all but ORDER, which turns the bits of an answer; what the set-up writes


@recorded("writes", boards=("psa2",), around=changed, lines=False)
def writes(s: Dut, take: Take) -> None:
    """Registers written and read again. facts: written, list of object, sub-index, value, answer, what reads then.

    status: of the temperature converter, before and after each of STATUS_WRITES.
    """
    found = []
    for index, sub, value in PATTERNS:
        answer = tell(s, index, sub, value)
        found.append((index, sub, value, answer, [ask(s, i, sub) for i in (ACCEL if index != TEMP else (TEMP,))]))
    take.facts["written"] = found
    status = [ask(s, TEMP, 1)]
    for value in STATUS_WRITES:
        tell(s, TEMP, 1, value)
        status.append(ask(s, TEMP, 1))
    take.facts["status"] = status


@recorded("opcodes", boards=("psa2",), around=changed)
def opcodes(s: Dut, take: Take) -> None:
    """RESET as an opcode to both groups, then all registers. facts: answers, read; cuts around the opcode."""
    s.run_for(5 * PERIOD_S)
    take.facts["answers"] = [tell(s, OPCODE, 1, 0x06), tell(s, OPCODE, 2, 0xFE)]
    s.run_for(0.1)
    take.facts["read"] = {(i, sub): ask(s, i, sub) for i in (*ACCEL, TEMP) for sub in REGISTERS}


# What is rejected: object, sub-index, value.
RESERVED: Sequence[tuple[int, int, int]] = (
    *((ACCEL[0], CONFIG0, v) for v in (0x6E, 0x76, 0x7E)),  # DR 101..111
    (ACCEL[0], CONFIG0, 0x55),  # sinc alone
    (ACCEL[0], CONFIG0, 0x57),  # high-pass
    (ACCEL[0], CONFIG0, 0xD6),  # continuous synchronisation
    (TEMP, DRATE, 0x81),
    (TEMP, DRATE, 0x00),
)
RESERVED_GAIN = (ACCEL[0], CONFIG1, 0x0F)  # of the ADS1282
OPCODES_REFUSED: Sequence[tuple[int, int, int]] = (
    *((OPCODE, 1, v) for v in (0x12, 0x20, 0x2A, 0x40, 0x4A, 0x02, 0x03, 0x60, 0x61)),
    *((OPCODE, 2, v) for v in (0x01, 0x03, 0x10, 0x50, 0xFD, 0xF3, 0xF4)),
)


@recorded("refusals", boards=("psa2",), around=changed)
def refusals(s: Dut, take: Take) -> None:
    """Values that the board rejects. facts: reserved, (object, sub, value, answer, before, after); opcodes; others."""
    reserved = [*RESERVED, *([RESERVED_GAIN] if s.variant.board == "psa2" else [])]
    take.facts["reserved"] = [(i, sub, v, ask(s, i, sub), tell(s, i, sub, v), ask(s, i, sub)) for i, sub, v in reserved]
    take.facts["opcodes"] = [(i, sub, v, tell(s, i, sub, v)) for i, sub, v in OPCODES_REFUSED]
    take.facts["read-only"] = [(i, 1, 0x55, tell_raw(s, i, 1, 0x55)) for i in ACCEL]
    take.facts["form"] = tell_raw(s, FORM, 0, 4)


@recorded("early", boards=("psa2",), before=Dut.wait_ready, lines=False)
def early(s: Dut, take: Take) -> None:
    """Asked before the set-up is over, and while another request is under way. facts: early, busy, missed."""
    s.reset()
    s.run_for(20 * PERIOD_S)
    take.facts["early"] = [ask(s, i, CONFIG0) for i in (*ACCEL, TEMP)]
    tell(s, PULSES, 0, 1)
    before = ask(s, COUNTERS, SYNCS_MISSED)
    s.host.send(SYNC, b"")
    s.run_for(2 * PERIOD_S)
    take.facts["missed"] = (before, ask(s, COUNTERS, SYNCS_MISSED))
    tell(s, PULSES, 0, 0)
    s.wait_ready()
    take.facts["busy"] = _busy(s, take)
    s.reset()
    s.run_for(PERIOD_S)


def _busy(s: Dut, take: Take) -> list[int]:
    """Abort codes of a request sent while one that its client gave up is under way: one to the temperature
    converter waits for the end of its conversion, 10 ms.
    """
    tx, rx = 0x580 + s.node, 0x600 + s.node
    upload = bytes([0x40, TEMP & 0xFF, TEMP >> 8, DRATE, 0, 0, 0, 0])
    found = []
    for _ in range(8):
        since = len(take.frames)
        for data in (upload, b"\x80" + upload[1:], upload):
            s.host.send(rx, data)
        s.run_for(20 * PERIOD_S)
        got = [f.data for f in take.frames[since:] if f.can_id == tx and len(f.data) == 8]
        found += [int.from_bytes(d[4:8], "little") for d in got if d[0] == 0x80]
        s.run_for(1.3 * PERIOD_S)
    return found


@recorded("rates", boards=("psa2",), around=changed)
def rates(s: Dut, take: Take) -> None:
    """Each data rate: frames (every fourth as a PDO), then a pulse on SYNC_A by SYNC. Cuts "DR 0" ... "DR 4"."""
    tell(s, NTH, 0, 4)
    take.facts["mode"] = tell(s, MODE, 0, 2)
    for dr, rate_hz in enumerate(RATES_HZ):
        take.facts[f"answer {dr}"] = tell(s, ACCEL[0], CONFIG0, 0x46 | dr << 3)
        s.run_for(SETTLE_PERIODS / rate_hz)
        streamed(s, take, f"DR {dr}", 24 / rate_hz + 0.01)
        tell(s, PULSES, 0, 1)
        s.host.send(SYNC, b"")
        s.run_for(SETTLE_PERIODS / rate_hz + 0.005)
        tell(s, PULSES, 0, 0)


@recorded("sync", boards=("psa2",), around=changed)
def sync(s: Dut, take: Take) -> None:
    """SYNC in sample mode 1, then with 2024h = 1. Cuts "SYNC 0" ... before each, "pulse" before the last.

    facts: paced, False where no one knows how long after one another they were sent.
    """
    tell(s, MODE, 0, 1)
    with while_streaming(s):
        s.run_for(5 * PERIOD_S)
        for k in range(10):
            cut(take, f"SYNC {k}")
            take.marks[f"SYNC {k}"] = s.bench.time_s
            s.host.send(SYNC, b"")
            s.run_for((4 + 0.3 * k) * PERIOD_S)
            _wait_for_a_sample(s, take, f"SYNC {k}")
        cut(take, "SYNC end")
        tell(s, MODE, 0, 0)
        s.run_for(20 * PERIOD_S)
        tell(s, PULSES, 0, 1)
        take.facts["before"] = ask(s, COUNTERS, SYNCS_MISSED)
        cut(take, "pulse")
        s.host.send(SYNC, b"")
        s.run_for(0.1)
    cut(take, "pulse end")
    take.facts["after"] = ask(s, COUNTERS, SYNCS_MISSED)


LATE_S = 2.0  # real time that a busy machine may be late


def _wait_for_a_sample(s: Dut, take: Take, since: str) -> None:
    """In real time until one has come since the cut: a busy machine is late. In lockstep it has, or never will."""

    def came() -> bool:
        return len(segment(s.capture("sync", take), since).frames_of("PSA2_ZT")) > 0

    if not s.lockstep:
        take.facts["paced"] = False
        s.host.pump_until(came, LATE_S)


@recorded("gain", boards=("psa2",), around=changed, lines=False)
def gain(s: Dut, take: Take) -> None:
    """CONFIG1 written while frames flow: gain 4 for 2. Cuts "before", "gain"; facts: answer, read on all three."""
    cut(take, "before")
    with while_streaming(s):
        s.run_for(0.1)
        cut(take, "gain")
        take.facts["answer"] = tell(s, ACCEL[0], CONFIG1, 0x0A)
        s.run_for(0.2)
    take.facts["read"] = [ask(s, i, CONFIG1) for i in ACCEL]


OFFSET = 0x012345  # codes; positive
FACTOR = 0x500000  # 1.25
APART_CODES = 2000  # of two axes, so that one can be beyond its limit alone, whatever the noise


@recorded("numbers", boards=("psa2",), around=changed)
def numbers(s: Dut, take: Take) -> None:
    """OFC and FSC written through 2000h: as they were, an offset, a factor, both limits. Cuts by these names.

    At last one axis alone is driven beyond either limit. facts: alone, its number by "one high" and "one low", where
    the inputs are far enough apart for it.
    """
    steps = {
        "as it was": [],
        "offset": split(ACCEL[0], OFC0, OFFSET),
        "factor": split(ACCEL[0], FSC0, FACTOR),
        "high": [*split(ACCEL[0], OFC0, 0x800000), *split(ACCEL[0], FSC0, 0x7FFFFF)],
        "low": split(ACCEL[0], OFC0, 0x7FFFFF),
    }
    for name, told in steps.items():
        take.facts[name] = [tell(s, *x) for x in told]
        s.run_for(3 * PERIOD_S)
        streamed(s, take, name, 0.06)
    alone: dict[str, int] = {}
    take.facts["alone"] = alone
    for name, (axis, ofc) in _alone(s.capture("numbers", take)).items():
        alone[name] = axis
        take.facts[name] = [tell(s, *x) for x in split(ACCEL[0], OFC0, ofc & 0xFFFFFF)]
        s.run_for(3 * PERIOD_S)
        streamed(s, take, name, 0.06)


def _alone(e: Capture) -> dict[str, tuple[int, int]]:
    """The axis and the OFC that drives it beyond a limit while the others stay below, FSC being at its highest."""
    try:
        codes = np.median(pairs(segment(e, "as it was", "as it was end"), 3).code, axis=0)
    except (Failed, Inconclusive):
        return {}
    lowest, middle, highest = np.sort(codes)
    order = np.argsort(codes)
    limit = (CODE_MAX + 1) * 0x400000 // 0x7FFFFF
    found = {}
    if highest - middle > APART_CODES:
        found["one high"] = int(order[2]), round((highest + middle) / 2) - limit
    if middle - lowest > APART_CODES:
        found["one low"] = int(order[0]), round((lowest + middle) / 2) + limit
    return found


@recorded("forms", boards=("psa2",), around=changed, lines=False)
def forms(s: Dut, take: Take) -> None:
    """Every frame form for a while, the last one several times. Cuts "form 0" ..., "again 0" ...

    facts: answer of each, bit 31 of the TPDOs, stamps before each time; latest, the stamp of the latest sample after a
    block, and how many frames had come with it.
    """
    for form in (0, 1, 2, 3):
        take.facts[f"answer {form}"] = tell(s, FORM, 0, form)
        take.facts[f"off {form}"] = [ask(s, OD.TPDO + k, 1) for k in range(5)]
        streamed(s, take, f"form {form}", FORM_S[form])
    take.facts["latest"] = _after_blocks(s, take)
    stamps = []
    for k in range(AGAIN):  # stopped with another number of samples in the block each
        s.run_for(2 * PERIOD_S)
        stamps.append(ask(s, OD.FRAME_HEAD, 5))  # of the latest sample, us, before the start
        streamed(s, take, f"again {k}", (20 + k) * PERIOD_S)
    take.facts["stamps"] = stamps


def _after_blocks(s: Dut, take: Take) -> list[tuple[Answer, int]]:
    """2202h:5 as soon as a block has come, and the number of frames with it."""
    block = int(message("PSA2_BLOCK").frame_id) - dbc_node("psa2") + s.node
    found = []
    with while_streaming(s):
        for _ in range(BLOCKS):
            at = len(take.frames)
            for _ in range(MOST_LOOKS):
                s.run_for(PERIOD_S)
                came = [k for k, f in enumerate(take.frames[at:], at + 1) if f.can_id == block and not f.error]
                if came:
                    found.append((ask(s, OD.FRAME_HEAD, 5), came[-1]))
                    break
    return found


@recorded("fit", boards=("psa2",), around=changed)
def fit(s: Dut, take: Take) -> None:
    """What the bus cannot carry. facts: words of 2031h, answers, CONFIG0 after; cuts "form", "rate"."""
    cut(take, "rate")
    take.facts["rate"] = tell(s, ACCEL[0], CONFIG0, 0x66)  # 4000 SPS in pairs
    s.run_for(5 * PERIOD_S)
    take.facts["rate text"], take.facts["config0"] = ask(s, OD.REFUSAL), ask(s, ACCEL[0], CONFIG0)
    tell(s, FORM, 0, 1)
    take.facts["fast"] = tell(s, ACCEL[0], CONFIG0, 0x66)
    s.run_for(30 * PERIOD_S)
    cut(take, "form")
    take.facts["form"] = tell(s, FORM, 0, 0)
    s.run_for(5 * PERIOD_S)
    take.facts["form text"], take.facts["form read"] = ask(s, OD.REFUSAL), ask(s, FORM)
    cut(take, "form end")


@recorded("starts", boards=("psa2",), before=Dut.wait_ready, lines=False)
def starts(s: Dut, take: Take) -> None:
    """The stream started and stopped many times, at all phases of a sample."""
    for k in range(24):
        with while_streaming(s):
            s.run_for((4 + 0.13 * k) * PERIOD_S)
