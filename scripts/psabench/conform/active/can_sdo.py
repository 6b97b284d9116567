"""SDO of every board: transfers, aborts, what is no request (CiA 301, 7.2.4)."""

from __future__ import annotations

import random
import struct

from psabench.boards.objects import Absent, Area, BusObjects, Common, Psa2Objects
from psabench.conform.raw_can import ABORT, FINE, UPLOAD, Talk, dialogue, long_write, read, segment, words, write
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, expect, none_of
from psabench.link.canopen_host import Described

NOWHERE = Area.PROFILE - 1
SIZES = {1: 0x4F, 2: 0x4B, 3: 0x47, 4: 0x43}  # commands of expedited answers by their bytes
SEED = 7  # of the random frames
HUNDRED = 100


def put(t: Talk, index: int, text: bytes) -> None:
    """A segmented download. Raises Failed when it is not taken."""
    answer = t.ask(long_write(index, 0, len(text)))
    if answer[:4] != bytes([FINE]) + index.to_bytes(2, "little") + b"\0":
        raise Failed(f"{words(answer)} to a download of {len(text)} bytes", "60h")
    toggle, parts = 0, [text[k : k + 7] for k in range(0, len(text), 7)] or [b""]
    for k, part in enumerate(parts):
        answer = t.ask(segment(toggle, part, last=k == len(parts) - 1))
        if answer[0] != 0x20 | toggle:
            raise Failed(f"{words(answer)} to segment {k} of {len(text)} bytes", f"{0x20 | toggle:02X}h")
        toggle ^= 0x10


@dialogue("BUS-SDO-01")
def short_values_come_expedited(t: Talk) -> str:
    """Upload an object of each length of 1 to 4 bytes."""
    seen = {}
    for o in t.s.unit.node.objects():
        size = o.data_bytes
        if (
            size in SIZES
            and size not in seen
            and o.access != "wo"
            and (o.index < Area.MANUFACTURER or o.index >= Area.BOARD_OWN)
        ):
            data = t.ask(read(o.index, o.sub))
            if data[:4] != bytes([SIZES[size]]) + read(o.index, o.sub)[1:4]:
                raise Failed(f"{words(data)} for {o.index:04X}h:{o.sub} of {size} bytes", f"command {SIZES[size]:02X}h")
            seen[size] = o.index
    return ", ".join(f"{index:04X}h: {size} bytes" for size, index in sorted(seen.items()))


@dialogue("BUS-SDO-02")
def a_write_is_confirmed(t: Talk, row: Requirement) -> str:
    """Write 1017h."""
    code = int(row.limit("answer_code"))
    request = write(Common.HEARTBEAT_MS, 0, t.upload(Common.HEARTBEAT_MS)[:2].ljust(2, b"\0"))
    answer = t.ask(request)
    due = bytes([code]) + request[1:4]
    return expect(answer[:4] == due, words(answer), words(due))


@dialogue("BUS-SDO-03")
def long_values_come_in_segments(t: Talk, row: Requirement) -> str:
    """Upload 1008h, and remarks of 64 characters and of nine full segments, segment by segment."""
    most = int(row.limit("segment_bytes"))
    text = bytes(range(0x30, 0x30 + 64))
    _upload_in_segments(t, Common.DEVICE_NAME, t.s.unit.title.encode(), most)
    for remark in (text, text[: 9 * most]):
        put(t, Common.REMARK, remark)
        _upload_in_segments(t, Common.REMARK, remark, most)
    put(t, Common.REMARK, b"")
    return f"the name, {len(text)} and {9 * most} characters in segments of {most}"


def _upload_in_segments(t: Talk, index: int, due: bytes, most: int) -> None:
    """Raises Failed for another announcement, another segment. Up to four bytes come expedited, which others judge."""
    first = t.ask(read(index))
    if len(due) <= 4:
        return
    if first != bytes([0x41]) + read(index)[1:4] + len(due).to_bytes(4, "little"):
        raise Failed(f"{words(first)} to an upload of {index:04X}h", f"41h and a length of {len(due)}")
    _take_segments(t, due, most)


def _take_segments(t: Talk, due: bytes, most: int) -> None:
    toggle = 0
    for k in range(0, len(due), most):
        part = due[k : k + most]
        command = toggle | (7 - len(part)) << 1 | (k + most >= len(due))
        data = t.ask(segment(toggle))
        if data[0] != command or data[1 : 1 + len(part)] != part:
            raise Failed(f"segment {words(data)}", words(bytes([command]) + part))
        toggle ^= 0x10


@dialogue("BUS-SDO-04")
def strings_go_down_and_up(t: Talk, row: Requirement) -> str:
    """Write remarks of several lengths and read them back."""
    longest = int(row.limit("remark_chars"))
    sizes = (1, 7, 8, longest - 1, longest)
    for n in sizes:
        text = bytes(0x21 + (n + 3 * k) % 90 for k in range(n))
        put(t, Common.REMARK, text)
        if t.upload(Common.REMARK) != text:
            raise Failed(f"a remark of {n} characters reads otherwise than written", text.decode())
    put(t, Common.REMARK, b"")
    return f"{', '.join(map(str, sizes))} characters"


@dialogue("BUS-SDO-05")
def a_wrong_toggle_bit_is_refused(t: Talk, row: Requirement) -> str:
    """Begin with toggle 1; take a segment, and ask for it again; the same of a download."""
    code = row.limit("abort_code")
    begin = read(Common.REMARK)
    put(t, Common.REMARK, b"0123456789")
    for toggles in ((0x10,), (0, 0)):
        t.ask(begin)
        for toggle in toggles[:-1]:
            t.ask(segment(toggle))
        _aborted(t, segment(toggles[-1]), code, "a segment with the wrong toggle bit", Common.REMARK)
    t.ask(long_write(Common.REMARK, 0, 10))
    _aborted(t, segment(0x10, b"01234567"[:7]), code, "a segment with the wrong toggle bit", Common.REMARK)
    put(t, Common.REMARK, b"")
    return f"abort {int(code):08X}h, up and down"


def _aborted(t: Talk, request: bytes, code: float, what: str, index: int) -> None:
    """As Talk.refused, of a segment, which does not name its object."""
    answer = t.answer_to(request)
    due = bytes([ABORT]) + index.to_bytes(2, "little") + b"\0" + int(code).to_bytes(4, "little")
    expect(answer.data == due, f"{what} was answered by {words(answer.data)}", words(due), frames=[answer])


@dialogue("BUS-SDO-06", needs={"can", "stamps"})
def a_silent_client_is_given_up(t: Talk, row: Requirement) -> str:
    """Begin an upload and a download in segments and ask nothing more."""
    due_s, late_s = row.limit("timeout_s"), row.limit("jitter_max_ms") * 1e-3
    waited = []
    put(t, Common.REMARK, b"0123456789")
    for request in (read(Common.REMARK), long_write(Common.REMARK, 0, 20)):
        begun = t.answer_to(request)
        frame = t.next(t.sdo_tx, 2 * due_s + t.timeout_s)
        abort = bytes([ABORT]) + request[1:4] + int(row.limit("abort_code")).to_bytes(4, "little")
        if frame is None or frame.data != abort:
            raise Failed(words(frame.data) if frame else "nothing", words(abort), frames=[frame] if frame else [])
        waited.append(frame.t_s - begun.t_s)
        if abs(waited[-1] - due_s) > late_s + t.s.slack_s(due_s):
            raise Failed(
                f"given up after {waited[-1]:.6f} s", f"{due_s:g} s +- {late_s * 1e3:g} ms", frames=[begun, frame]
            )
    put(t, Common.REMARK, b"")
    return f"given up after {', '.join(f'{w:.6f}' for w in waited)} s"


@dialogue("BUS-SDO-07")
def unknown_commands_are_refused(t: Talk, row: Requirement) -> str:
    """Block transfers, a command that no one has defined, a segment of no transfer."""
    code = row.limit("abort_code")
    commands = (0xA0, 0xC0, 0xE0, 0x60, 0x00)
    for command in commands:
        t.upload(Common.DEVICE_TYPE)  # nothing is under way
        request = bytes([command]) + read(Common.DEVICE_NAME)[1:]
        found = t.abort_of(request)
        saw = f"{'no refusal' if found is None else f'{found:08X}h'} of command {command:02X}h"
        expect(found == code, saw, f"{int(code):08X}h")
    return f"abort {int(code):08X}h to {', '.join(f'{c:02X}h' for c in commands)}"


@dialogue("BUS-SDO-08")
def no_such_object(t: Talk, row: Requirement) -> str:
    """Upload and write objects that there are not."""
    code = row.limit("abort_code")
    known = {o.index for o in t.s.unit.node.objects()}
    strangers = [
        i
        for i in (0x0001, Absent.MANUFACTURER_STATUS, Absent.CONSUMER_HEARTBEAT, 0x2FFF, NOWHERE, 0xFFFF)
        if i not in known
    ]
    for index in strangers:
        t.refused(read(index), code, f"an upload of {index:04X}h")
        t.refused(write(index, 0, b"\1"), code, f"a write to {index:04X}h")
    return f"abort {int(code):08X}h for {', '.join(f'{i:04X}h' for i in strangers)}"


@dialogue("BUS-SDO-09")
def no_such_sub_index(t: Talk, row: Requirement) -> str:
    """Upload sub-indices that objects have not: one more than the last, FFh, 1 of a variable."""
    code = row.limit("abort_code")
    asked = [
        (Common.IDENTITY, 5),
        (Common.IDENTITY, 0xFF),
        (Common.ERROR_HISTORY, 9),
        (Common.SDO_SERVER_PARAMETER, 3),
        (Common.TPDO, 4),
        (Common.DEVICE_TYPE, 1),
        (Common.HEARTBEAT_MS, 1),
    ]
    for index, sub in asked:
        t.refused(read(index, sub), code, f"an upload of {index:04X}h:{sub}")
    return f"abort {int(code):08X}h for {len(asked)} sub-indices"


@dialogue("BUS-SDO-10")
def rights_are_kept(t: Talk, row: Requirement) -> str:
    """Write everything that is read-only or constant, read everything that is write-only."""
    locked = [o for o in t.s.unit.node.objects() if o.access in ("const", "ro") and o.index not in REGISTERS]
    hidden = [o for o in t.s.unit.node.objects() if o.access == "wo" and o.index not in REGISTERS]
    for o in locked:
        data = bytes(min(o.data_bytes or 4, 4))
        t.refused(write(o.index, o.sub, data), row.limit("read_only_code"), f"a write to {o.index:04X}h:{o.sub}")
    for o in hidden:
        t.refused(read(o.index, o.sub), row.limit("write_only_code"), f"an upload of {o.index:04X}h:{o.sub}")
    return f"{len(locked)} objects are not written, {len(hidden)} are not read"


REGISTERS = (
    Psa2Objects.REG_X,
    Psa2Objects.REG_T,
    BusObjects.BUS,
    Psa2Objects.REG_Y,
    Psa2Objects.REG_Z,
)  # of chips and buses: their own rows


@dialogue("BUS-SDO-11")
def the_wrong_length_is_refused(t: Talk, row: Requirement) -> str:
    """Write 4, 3 and 1 bytes to 1017h, and 4 to 1800h sub 2."""
    before = t.upload(Common.HEARTBEAT_MS)
    for index, sub, n, code in (
        (Common.HEARTBEAT_MS, 0, 4, "long_code"),
        (Common.HEARTBEAT_MS, 0, 3, "long_code"),
        (Common.TPDO, 2, 4, "long_code"),
        (Common.HEARTBEAT_MS, 0, 1, "short_code"),
        (Common.TPDO, 3, 1, "short_code"),
    ):
        t.refused(write(index, sub, bytes([1] * n)), row.limit(code), f"{n} bytes to {index:04X}h:{sub}")
    expect(t.upload(Common.HEARTBEAT_MS) == before, "1017h has changed", "what it was")
    return "too long and too short are distinguished"


@dialogue("BUS-SDO-12")
def other_than_announced_is_refused(t: Talk, row: Requirement) -> str:
    """Announce 10 bytes for 2040h and send 8, and announce 8 and send 10."""
    code = row.limit("abort_code")
    put(t, Common.REMARK, b"kept")
    for announced, sent in ((10, 8), (8, 10)):
        t.ask(long_write(Common.REMARK, 0, announced))
        t.ask(segment(0, bytes(range(0x41, 0x48))))
        _aborted(t, segment(0x10, b"HIJ"[: sent - 7], last=True), code, f"{sent} of {announced} bytes", Common.REMARK)
    if t.upload(Common.REMARK) != b"kept":
        raise Failed(f"2040h is {t.upload(Common.REMARK)!r} after a download that was refused", "what it was")
    put(t, Common.REMARK, b"")
    return f"abort {int(code):08X}h"


@dialogue("BUS-SDO-13")
def limits_are_kept(t: Talk, row: Requirement) -> str:
    """Write to each object with limits one less than the lowest and one more than the highest."""
    code = row.limit("abort_code")
    tried = 0
    for o in t.s.unit.node.objects():
        for beyond in (o.low - 1 if o.low is not None else None, o.high + 1 if o.high is not None else None):
            if o.access != "rw" or beyond is None or not _fits(beyond, o):
                continue
            data = struct.pack("<f", beyond) if o.real else int(beyond).to_bytes(o.data_bytes or 1, "little")
            t.refused(write(o.index, o.sub, data), code, f"{beyond:g} to {o.index:04X}h:{o.sub}")
            tried += 1
    expect(tried, "no object with limits", "1003h at least")
    return f"abort {int(code):08X}h to {tried} values outside"


def _fits(value: float, o: Described) -> bool:
    """Whether its type can hold the value at all; whole numbers of these boards with limits are unsigned."""
    return o.data_bytes in (1, 2, 4) and (o.real or 0 <= value < 1 << 8 * o.data_bytes)


@dialogue("BUS-SDO-14")
def requests_of_the_wrong_length_are_counted(t: Talk, row: Requirement) -> str:
    """Requests of 0 to 7 bytes."""
    size = int(row.limit("request_bytes"))
    before = t.counter("Malformed requests")
    came = [
        f for f in t.after(*((t.sdo_rx, read(Common.DEVICE_TYPE)[:n]) for n in range(size))) if f.can_id == t.sdo_tx
    ]
    counted = t.counter("Malformed requests") - before
    if came or counted != size:
        raise Failed(f"{len(came)} answers, {counted} counted", f"none, {size} counted", frames=came)
    return f"{size} requests, no answer, all counted"


@dialogue("BUS-SDO-15")
def each_request_has_one_answer(t: Talk) -> str:
    """A hundred requests of several kinds, good and bad, one after the other and all at once."""
    kinds = [
        read(Common.HEARTBEAT_MS),
        read(NOWHERE),
        read(Common.IDENTITY, 2),
        write(Common.DEVICE_TYPE, 0, bytes(4)),
        read(Common.IDENTITY, 9),
    ]
    asked = [kinds[k % len(kinds)] for k in range(HUNDRED)]
    answers = []
    for k in range(0, HUNDRED, 20):
        came = t.after(*((t.sdo_rx, request) for request in asked[k : k + 20]))
        answers += [f for f in came if f.can_id == t.sdo_tx]
    expect(len(answers) == HUNDRED, f"{len(answers)} answers to {HUNDRED} requests", f"{HUNDRED}", frames=answers)
    for request, answer in zip(asked, answers, strict=True):
        if len(answer.data) != 8 or answer.data[1:4] != request[1:4]:
            raise Failed(f"{words(answer.data)} to {words(request)}", "its index and sub-index", frames=[answer])
    return f"{HUNDRED} requests, {HUNDRED} answers in their order"


@dialogue("BUS-SDO-16")
def a_refusal_changes_nothing(t: Talk) -> str:
    """Refused writes to 1017h and 1800h: their values before and after."""
    for index, sub, data in (
        (Common.HEARTBEAT_MS, 0, bytes(4)),
        (Common.HEARTBEAT_MS, 0, b"\1"),
        (Common.TPDO, 2, bytes([250])),
        (Common.TPDO, 1, bytes(4)),
        (Common.ERROR_HISTORY, 0, b"\1"),
    ):
        before = t.upload(index, sub)
        if t.abort_of(write(index, sub, data)) is None:
            raise Failed(f"{words(data)} to {index:04X}h:{sub} is taken", "a refusal")
        expect(t.upload(index, sub) == before, f"{index:04X}h:{sub} has changed with a refused write", words(before))
    return "values stay, and the next request is served"


@dialogue("BUS-SDO-17")
def refusals_are_counted(t: Talk) -> str:
    """Refusals of each kind, and the counter before and after."""
    bad = [
        read(NOWHERE),
        read(Common.IDENTITY, 9),
        write(Common.DEVICE_TYPE, 0, bytes(4)),
        write(Common.HEARTBEAT_MS, 0, b"\1"),
        write(Common.HEARTBEAT_MS, 0, bytes(4)),
        write(Common.TPDO, 2, bytes([250])),
        bytes([0xE0]) + read(Common.DEVICE_NAME)[1:],
        segment(0),
    ]
    before = t.counter("Requests refused")
    for k, request in enumerate(bad, 1):
        expect(t.abort_of(request) is not None, f"{words(request)} is not refused", "an abort")
        counted = t.counter("Requests refused") - before
        expect(counted == k, f"{counted} refusals counted after {k}, the last of {words(request)}", f"{k}")
    return f"{len(bad)} refusals, {len(bad)} counted"


@dialogue("BUS-SDO-18")
def an_abort_of_the_client_ends_it(t: Talk) -> str:
    """Abort an upload of a long value, then ask for its next segment."""
    put(t, Common.REMARK, b"0123456789")
    t.ask(read(Common.REMARK))
    came = [f for f in t.after((t.sdo_rx, bytes([ABORT]) + read(Common.REMARK)[1:])) if f.can_id == t.sdo_tx]
    none_of(came, lambda f: f"{words(f.data)} to an abort", "silence", frames=came)
    t.ask(read(Common.REMARK))
    t.send(t.sdo_rx, bytes([ABORT]) + read(Common.REMARK)[1:])
    expect(t.abort_of(segment(0)) is not None, "the transfer goes on after an abort", "a refusal of its next segment")
    put(t, Common.REMARK, b"")
    return "silence; the next segment is refused"


@dialogue("BUS-SDO-19", reset=True)
def garbage_does_not_stop_it(t: Talk, row: Requirement) -> str:
    """A thousand random requests, then good ones."""
    count = int(row.limit("frames_count"))
    rng = random.Random(SEED)
    for _ in range(count // 50):
        t.drain()
        for _ in range(50):
            t.send(t.sdo_rx, _harmless(rng.randbytes(rng.randrange(9))))
        t.s.run_for(0.02)
    t.fence()
    expect(t.ask(read(Common.DEVICE_TYPE))[0] & 0xE0 == UPLOAD, "no good answer after random frames", "one")
    return f"{count} random frames; answers go on"


def _harmless(data: bytes) -> bytes:
    """Not a value that a board may keep: an expedited write to it becomes one to nowhere."""
    if len(data) == 8 and data[0] & 0xE0 == 0x20:
        return data[:1] + NOWHERE.to_bytes(2, "little") + data[3:]
    return data
