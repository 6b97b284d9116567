"""Raw frames to a unit and what it says back: requests that python-canopen would not send, answers as they stand.

What a board should answer and does not is `Failed`; nothing here trusts a length or a number that came from it. An
answer that should not come is waited for with a fence: a good request sent after it, which is answered later, so that
no clock of ours decides what silence is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import wraps

from psabench.boards.objects import Common
from psabench.boards.unit import tpdo_numbers
from psabench.conform.capture.canbits import frame_bits
from psabench.conform.capture.log import CanFrame
from psabench.conform.dut import Dut, Take
from psabench.conform.plan import active
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, Inconclusive, expect
from psabench.link.can_host import Message

UPLOAD, EXPEDITED, ABORT, FINE = 0x40, 0x23, 0x80, 0x60
OFF = 0x80000000  # bit 31 of 18xxh sub 1
LOCKSTEP_S, REAL_S = 1.0, 5.0  # timeout for an answer, bench time; in real time the machine may be busy
FIRST_S, LONGEST_S = 0.0005, 0.05  # steps of the board's time while waiting
# An emulator takes no more than 128 frames while its time stands still: so many, then so long for them to pass.
BURST, BURST_S = 50, 0.02
LEAST = 5  # readings that a judgement needs
# A flood: frames of the highest priority, so many that nothing else goes out meanwhile.
FLOOD_ID, FLOOD_DATA = 0x001, bytes(range(0x55, 0x5D))
BIT_S, SPACE_BITS = 1e-6, 3  # of a bus of 1 Mbit/s; on a slower one they take longer
AHEAD, STEP_S = 60, 0.004  # frames that wait always; an emulator takes no more than 128 while its time stands still


class Nmt:
    """Commands (CiA 301, 7.2.8.3.1)."""

    START, STOP, PREOP, RESET, RESET_COMMUNICATION = 0x01, 0x02, 0x80, 0x81, 0x82


class State:
    """Of a node, as its heartbeat tells (CiA 301, 7.2.8.3.2)."""

    BOOT_UP, STOPPED, OPERATIONAL, PRE_OPERATIONAL = 0x00, 0x04, 0x05, 0x7F


class Talk:
    """A conversation. `heard` has what was received since it began, in order."""

    def __init__(self, s: Dut, take: Take | None = None) -> None:
        self.s, self.host, self.node, self.take = s, s.host, s.node, take
        self.heard: list[CanFrame] = []
        r = requirements().rows
        self.sdo_rx = int(r["BUS-ID-02"].limit("sdo_rx_id")) + s.node
        self.nmt_id, self.sync_id = int(r["BUS-ID-02"].limit("nmt_id")), int(r["BUS-ID-02"].limit("sync_id"))
        self.sdo_tx = int(r["BUS-ID-01"].limit("sdo_tx_id")) + s.node
        self.emcy = int(r["BUS-ID-01"].limit("emcy_id")) + s.node
        self.heartbeat = int(r["BUS-ID-01"].limit("heartbeat_id")) + s.node
        self.timeout_s = LOCKSTEP_S if s.lockstep else REAL_S
        self._taken = Take(rate=s.recorder_rate)
        self._burst = 0

    def on_message(self, m: Message) -> None:
        """Listener of a CanHost."""
        self._taken.on_message(m)
        self.heard.append(self._taken.frames.pop())

    # ---- frames

    def send(self, can_id: int, data: bytes, *, fd: bool = False, remote: bool = False) -> None:
        """A frame as it is; it is in the log of the take, too."""
        if self.take is not None:
            t_s = self.take.frames[-1].t_s if self.take.frames else 0.0
            self.take.frames.append(CanFrame(t_s=t_s, can_id=can_id, data=data, fd=fd, sent=True, remote=remote))
        self.host.send(can_id, data, fd=fd, remote=remote)
        self._burst += 1
        if self.s.lockstep and self._burst % BURST == 0:
            self.s.run_for(BURST_S)

    def nmt(self, command: int, node: int | None = None) -> None:
        """To this node, or to another (0: all)."""
        self.send(self.nmt_id, bytes([command, self.node if node is None else node]))

    def drain(self) -> None:
        """Take what has come already."""
        while self.host.receive(0.0):
            pass

    def until(self, done: Callable[[], bool], timeout_s: float | None = None) -> bool:
        """Let time pass until something is so; False when it is not within the timeout."""
        left_s, step_s = self.timeout_s if timeout_s is None else timeout_s, FIRST_S
        if not self.s.lockstep:
            return self.host.pump_until(done, left_s)
        while not done() and left_s > 0.0:
            self.s.run_for(min(step_s, left_s))
            left_s -= step_s
            step_s = min(2.0 * step_s, LONGEST_S)
        return done()

    def during(self, dwell_s: float) -> list[CanFrame]:
        """What comes within this time."""
        self.drain()
        at = len(self.heard)
        self.s.run_for(dwell_s)
        return [f for f in self.heard[at:] if not f.error]

    def next(self, can_id: int, timeout_s: float | None = None) -> CanFrame | None:
        """The next frame of an identifier that comes from now on."""
        self.drain()
        return self._after(len(self.heard), can_id, timeout_s)

    def _after(self, at: int, can_id: int, timeout_s: float | None = None) -> CanFrame | None:
        def found() -> CanFrame | None:
            return next((f for f in self.heard[at:] if f.can_id == can_id and not f.error), None)

        self.until(lambda: found() is not None, timeout_s)
        return found()

    # ---- SDO

    def answer_to(self, request: bytes, timeout_s: float | None = None) -> CanFrame:
        """The answer to a request. Raises Failed when none comes, or one of other than 8 bytes."""
        self.drain()
        at = len(self.heard)
        self.send(self.sdo_rx, request)
        answer = self._after(at, self.sdo_tx, timeout_s)
        if answer is None:
            raise Failed(f"no answer to the SDO request {words(request)}", "an answer")
        expect(len(answer.data) == 8, f"an SDO answer of {len(answer.data)} bytes", "8 bytes", frames=[answer])
        return answer

    def ask(self, request: bytes) -> bytes:
        """The bytes of the answer."""
        return self.answer_to(request).data

    def abort_of(self, request: bytes) -> int | None:
        """The code with which it is rejected; None: it is not."""
        data = self.ask(request)
        return int.from_bytes(data[4:], "little") if data[0] == ABORT else None

    def refused(self, request: bytes, code: float, what: str) -> None:
        """Raises Failed unless it is rejected with this code, in an answer that names its object."""
        answer = self.answer_to(request)
        due = bytes([ABORT]) + request[1:4] + int(code).to_bytes(4, "little")
        expect(answer.data == due, f"{what} was answered by {words(answer.data)}", words(due), frames=[answer])

    def upload(self, index: int, sub: int = 0) -> bytes:
        """Value of an object, expedited or in segments. Raises Failed."""
        data = self.ask(read(index, sub))
        expect(data[0] != ABORT, f"{index:04X}h:{sub} is refused with {data[7:3:-1].hex().upper()}h", "its value")
        if data[0] & 0xE0 != UPLOAD or data[1:4] != read(index, sub)[1:4]:
            raise Failed(f"{words(data)} as the answer to an upload of {index:04X}h:{sub}", "its value")
        if data[0] & 2:
            return data[4 : 8 - (data[0] >> 2 & 3)]
        return self._segments(int.from_bytes(data[4:], "little"))

    def _segments(self, size: int) -> bytes:
        value, toggle = b"", 0
        while True:
            data = self.ask(segment(toggle))
            if data[0] & 0xF0 != toggle:
                raise Failed(f"{words(data)} as a segment", f"command {toggle:02X}h to {toggle | 0xF:02X}h")
            value += data[1 : 8 - (data[0] >> 1 & 7)]
            if data[0] & 1:
                return value
            if data[0] & 0xE or len(value) > size:
                raise Failed(f"segment {words(data)} of a value of {size} bytes", "whole segments up to the last one")
            toggle ^= 0x10

    def number(self, index: int, sub: int = 0) -> int:
        """Value of an object, unsigned."""
        return int.from_bytes(self.upload(index, sub), "little")

    def look(self, index: int, sub: int) -> tuple[int, int]:
        """A value of up to 4 bytes, and the place of its answer in what was heard."""
        answer = self.answer_to(read(index, sub))
        if answer.data[0] & 0xE3 != 0x43 or answer.data[1:4] != read(index, sub)[1:4]:
            raise Failed(f"{words(answer.data)} to an upload of {index:04X}h:{sub}", "its value", frames=[answer])
        value = int.from_bytes(answer.data[4 : 8 - (answer.data[0] >> 2 & 3)], "little")
        return value, next(k for k in reversed(range(len(self.heard))) if self.heard[k] is answer)

    def download(self, index: int, sub: int, data: bytes) -> None:
        """Write up to 4 bytes. Raises Failed when it is not taken."""
        answer = self.answer_to(write(index, sub, data))
        due = bytes([FINE]) + write(index, sub, data)[1:4]
        if answer.data[:4] != due:
            raise Failed(f"{index:04X}h:{sub} = {data[::-1].hex().upper()}h answered by {words(answer.data)}", "60h")

    def counter(self, name: str) -> int:
        """One of 2030h by its name. Raises Inconclusive where the board has none of that name."""
        for sub, title in self.s.unit.node.names(Common.COUNTERS).items():
            if title == name:
                return self.number(Common.COUNTERS, sub)
        raise Inconclusive(f"this board has no counter {name}")

    def fence(self) -> list[CanFrame]:
        """What comes before the answer to a good request: all that was caused by what was sent earlier."""
        self.drain()
        return self._fenced(len(self.heard))

    def after(self, *sent: tuple[int, bytes], remote: bool = False) -> list[CanFrame]:
        """Send these; what comes because of them."""
        self.drain()
        at = len(self.heard)
        for can_id, data in sent:
            self.send(can_id, data, remote=remote)
        return self._fenced(at)

    def _fenced(self, at: int) -> list[CanFrame]:
        request = read(Common.DEVICE_TYPE, 0)
        due = bytes([0x43]) + request[1:4]
        self.send(self.sdo_rx, request)

        def place() -> int | None:
            mine = (k for k, f in enumerate(self.heard[at:], at) if f.can_id == self.sdo_tx and f.data[:4] == due)
            return next(mine, None)

        self.until(lambda: place() is not None)
        end = place()
        if end is None:
            raise Failed("no answer to an upload of 1000h", "an answer", frames=self.heard[at:])
        return [f for f in self.heard[at:end] if not f.error]

    # ---- states

    def beat(self, period_ms: int) -> None:
        """Set 1017h."""
        self.download(Common.HEARTBEAT_MS, 0, period_ms.to_bytes(2, "little"))

    def state(self) -> int:
        """Of the next heartbeat. Raises Failed when none comes."""
        frame = self.next(self.heartbeat)
        if frame is None or len(frame.data) != 1:
            raise Failed("no heartbeat of one byte", "its state by heartbeat", frames=[frame] if frame else [])
        return frame.data[0]

    def becomes(self, state: int) -> bool:
        """Whether a heartbeat says so within the timeout."""
        at = len(self.heard)

        def said() -> bool:
            return any(f.can_id == self.heartbeat and f.data == bytes([state]) for f in self.heard[at:])

        return self.until(said)

    def reset(self, command: int = Nmt.RESET) -> list[CanFrame]:
        """NMT 81h or 82h; the frames from there to the answer of a first request. Raises Failed without a boot-up."""
        self.drain()
        at = len(self.heard)
        self.nmt(command)
        if not self.until(lambda: any(f.can_id == self.heartbeat and f.data == b"\0" for f in self.heard[at:])):
            raise Failed(f"no boot-up message after NMT {command:02X}h", "one", frames=self.heard[at:])
        self._fenced(at)
        return [f for f in self.heard[at:] if not f.error]

    # ---- PDOs

    @property
    def pdos(self) -> dict[int, int]:
        """Identifiers of the messages that the board sends as it comes, by number of the TPDO (from 1)."""
        found = {}
        node = self.s.unit.node
        for k in tpdo_numbers(node):
            default = node.default(Common.TPDO + k, 1)
            if isinstance(default, int) and not default & OFF:
                found[k + 1] = default & 0x7FF
        return found

    def stream(self, count: int = LEAST, can_id: int | None = None) -> list[CanFrame]:
        """NMT start, and `count` frames of a PDO (the first). Raises Failed when they do not come."""
        can_id = next(iter(self.pdos.values())) if can_id is None else can_id
        self.drain()
        at = len(self.heard)
        self.nmt(Nmt.START)
        return self.readings(count, can_id, at=at)

    def readings(self, count: int, can_id: int, at: int | None = None) -> list[CanFrame]:
        """The next `count` frames of an identifier. Raises Failed when they do not come."""
        start = len(self.heard) if at is None else at

        def came() -> list[CanFrame]:
            return [f for f in self.heard[start:] if f.can_id == can_id and not f.error]

        if not self.until(lambda: len(came()) >= count, self.timeout_s + count * self.s.unit.reading_s):
            raise Failed(f"{len(came())} frames {can_id:03X}h after NMT start", f"{count} and more")
        return came()

    def tells(self, code: int, timeout_s: float | None = None) -> CanFrame:
        """The first emergency with this code in what was heard or comes. Raises Failed when none does."""

        def found() -> CanFrame | None:
            mine = (f for f in self.heard if f.can_id == self.emcy and not f.error)
            return next((f for f in mine if f.data[:2] == code.to_bytes(2, "little")), None)

        self.until(lambda: found() is not None, timeout_s)
        frame = found()
        if frame is None:
            raise Failed(f"no emergency {code:04X}h", "one", frames=[f for f in self.heard if f.can_id == self.emcy])
        return frame

    def hush(self) -> list[CanFrame]:
        """NMT pre-operational; what came before it was obeyed."""
        self.nmt(Nmt.PREOP)
        return self.fence()


Dialogue = Callable[..., str]  # of a Talk, and of the row that it proves where it takes a second argument


@contextmanager
def talk(s: Dut, *, reset: bool = False, take: Take | None = None) -> Iterator[Talk]:
    """A conversation that begins pre-operational; reset: settings are to be the defaults again when it ends."""
    t = Talk(s, take)
    s.host.listeners.append(t.on_message)
    try:
        t.nmt(Nmt.PREOP)
        if s.lockstep:
            s.run_for(BURST_S)  # what others left in the queues
        yield t
    finally:
        s.host.listeners.remove(t.on_message)
        if reset:
            s.reset()
            s.run_for(0.01)  # the boot-up message, and what waited in the queues
        else:
            s.host.send(t.nmt_id, bytes([Nmt.PREOP, t.node]))


def dialogue(
    *ids: str, needs: Iterable[str] = ("can",), reset: bool = False
) -> Callable[[Dialogue], Callable[[Dut], str]]:
    """An active test that is a conversation: it gets a Talk, which ends with it as `talk` says."""

    def register(test: Dialogue) -> Callable[[Dut], str]:
        @wraps(test)
        def converse(s: Dut, *row: Requirement) -> str:
            with talk(s, reset=reset) as t:
                return test(t, *row)

        return active(*ids, needs=needs)(converse)

    return register


def read(index: int, sub: int = 0) -> bytes:
    """Request of an upload."""
    return bytes([UPLOAD]) + index.to_bytes(2, "little") + bytes([sub, 0, 0, 0, 0])


def write(index: int, sub: int, data: bytes) -> bytes:
    """Request of an expedited download of 1 to 4 bytes."""
    head = EXPEDITED | (4 - len(data)) << 2
    return bytes([head]) + index.to_bytes(2, "little") + bytes([sub]) + data.ljust(4, b"\0")


def long_write(index: int, sub: int, size: int) -> bytes:
    """Request that begins a segmented download."""
    return bytes([0x21]) + index.to_bytes(2, "little") + bytes([sub]) + size.to_bytes(4, "little")


def segment(toggle: int, data: bytes | None = None, *, last: bool = False) -> bytes:
    """A segment: of an upload (60h) where there are no data, else of a download. toggle: 0 or 10h."""
    if data is None:
        return bytes([0x60 | toggle]).ljust(8, b"\0")
    return bytes([toggle | (7 - len(data)) << 1 | last]) + data.ljust(7, b"\0")


def words(data: bytes) -> str:
    """Bytes as a page writes them."""
    return data.hex(" ").upper() or "no bytes"


def ids(frames: Sequence[CanFrame]) -> str:
    """Identifiers of frames, each once, for a failure's words."""
    return ", ".join(dict.fromkeys(f"{f.can_id:03X}h" for f in frames)) or "none"


def flood(t: Talk, dwell_s: float) -> None:
    """Fill the bus for this long, in real time for at least so long; the board's time passes."""
    frame_s = (frame_bits(FLOOD_ID, FLOOD_DATA) + SPACE_BITS) * BIT_S
    if not t.s.lockstep:
        for _ in range(round(dwell_s / frame_s)):
            t.host.send(FLOOD_ID, FLOOD_DATA)
        t.s.run_for(dwell_s)
        return
    sent, passed_s = 0, 0.0
    while passed_s < dwell_s:
        while sent < AHEAD + passed_s / frame_s:
            t.host.send(FLOOD_ID, FLOOD_DATA)
            sent += 1
        t.s.run_for(STEP_S)
        passed_s += STEP_S
    t.s.run_for(AHEAD * frame_s)
