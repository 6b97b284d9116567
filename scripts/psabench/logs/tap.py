"""Bytes of a serial port as a pcap file: slcan, the bus port, the line port, for the dissectors of psabench_ports.lua.

Link type 252, "Wireshark Upper PDU": tags (type, length, value, big-endian, padded to four bytes), then the bytes. One
tag names the dissector, one the direction, so that no user's table of link types is needed. Source:
epan/exported_pdu.h of Wireshark; tshark 4.0 shows these tags.
"""

from __future__ import annotations

import os
import re
import select
import struct
import time
import tty
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from psabench.errors import input_error, link_error, output_error
from psabench.link.own import Owned, Unstored
from psabench.logs.pcap import MAGIC_NS
from psabench.logs.segments import SegmentFile

LINKTYPE = 252
TAG_END, TAG_DISSECTOR, TAG_DIRECTION = 0, 12, 35
TO_BOARD, FROM_BOARD = 0, 1
MOST_LINE = 512  # bytes of a line; a longer one is cut
MOST_FRAME = 1 << 16  # samples with INT low
BLOCK = 1 << 16  # bytes read together
MOST_HELD = 1 << 18  # bytes that wait for the other side, which then slows the first one
POLL_S = 0.2
INT_LOW = re.compile(b"[" + b"".join(re.escape(bytes([b])) for b in range(0, 256, 2)) + b"]+")
NS_PER_S = 10**9


class Cutter(Protocol):
    """A stream of bytes into packets."""

    cut: int  # packets that were too long

    def packets_of(self, data: bytes) -> Iterable[tuple[int, bytes]]:
        """Whole packets, each with the number of bytes before it in the stream."""


@dataclass(slots=True)
class LineCutter:
    """Lines of text with their ends."""

    ends: bytes
    cut: int = 0
    _rest: bytes = b""
    _at: int = 0  # of the rest

    def packets_of(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """As Cutter says."""
        self._rest += data
        end = re.compile(b"[%b]" % re.escape(self.ends))
        while self._rest:
            found = end.search(self._rest, 0, MOST_LINE)
            if not found and len(self._rest) < MOST_LINE:
                return
            size = found.end() if found else MOST_LINE
            self.cut += not found
            line, self._rest = self._rest[:size], self._rest[size:]
            yield self._at, line
            self._at += size


@dataclass(slots=True)
class FrameCutter:
    """Samples of a PSA-2's line port: from the last one before INT falls to the first after it has risen."""

    cut: int = 0
    _rest: bytes = b""
    _at: int = 0

    def packets_of(self, data: bytes) -> Iterator[tuple[int, bytes]]:
        """As Cutter says."""
        self._rest += data
        begin = 0
        for low in INT_LOW.finditer(self._rest):
            first, end = low.span()
            if end == len(self._rest) and end - first < MOST_FRAME:
                begin = max(first - 1, 0)
                break
            self.cut += end - first >= MOST_FRAME
            begin = max(first - 1, 0)
            yield self._at + begin, self._rest[begin : min(end, first + MOST_FRAME) + 1]
            begin = end
        else:
            begin = max(len(self._rest) - 1, 0)
        self._at += begin
        self._rest = self._rest[begin:]


def text_cutter(ends: bytes) -> Callable[[], Cutter]:
    """Makes one for each direction."""
    return lambda: LineCutter(ends)


KINDS: dict[str, tuple[str, Callable[[], Cutter]]] = {  # dissector, cutter
    "slcan": ("psabench_slcan", text_cutter(b"\r\a")),
    "bus": ("psabench_bus", text_cutter(b"\n")),
    "line": ("psabench_line", FrameCutter),
}


@dataclass(slots=True)
class Tap:
    """The pcap file of one port."""

    kind: str
    file: SegmentFile
    packets: list[int] = field(default_factory=lambda: [0, 0])  # by direction
    cutters: tuple[Cutter, Cutter] = field(init=False)
    dissector: bytes = field(init=False)

    def __post_init__(self) -> None:
        name, make = KINDS[self.kind]
        self.cutters, self.dissector = (make(), make()), name.encode()
        self.file.append(struct.pack("<IHHiIII", MAGIC_NS, 2, 4, 0, 0, MOST_FRAME + 1024, LINKTYPE))

    def take_bytes(self, direction: int, data: bytes, stamp_ns: Callable[[int], int]) -> None:
        """Bytes that went this way; stamp_ns: the time of a packet by the bytes before it. Raises OSError."""
        records = [
            self._record_of(direction, stamp_ns(at), packet) for at, packet in self.cutters[direction].packets_of(data)
        ]
        self.packets[direction] += len(records)
        if records:
            self.file.append(b"".join(records))

    @property
    def cut(self) -> int:
        """Packets that were too long."""
        return sum(cutter.cut for cutter in self.cutters)

    def _record_of(self, direction: int, t_ns: int, packet: bytes) -> bytes:
        tags = _tag_bytes(TAG_DISSECTOR, self.dissector) + _tag_bytes(TAG_DIRECTION, struct.pack(">I", direction))
        body = tags + _tag_bytes(TAG_END, b"") + packet
        seconds, ns = divmod(t_ns, NS_PER_S)
        return struct.pack("<IIII", seconds, ns, len(body), len(body)) + body


def _tag_bytes(kind: int, value: bytes) -> bytes:
    padded = value.ljust(-(-len(value) // 4) * 4, b"\0")
    return struct.pack(">HH", kind, len(padded)) + padded


@contextmanager
def tap_file(kind: str, path: Path) -> Iterator[Tap]:
    """The file, closed at the end. Raises BadInput, OutputError."""
    with ExitStack() as stack:
        owned = Owned(path)
        stack.callback(owned.release)
        try:
            file = SegmentFile(path)
        except OSError as e:
            raise output_error(path, e) from e
        stack.callback(file.close)
        try:
            yield Tap(kind, file)
        except Unstored as e:
            raise output_error(path, e) from e


def read_capture(tap: Tap, source: Path, rate_hz: float) -> None:
    """Bytes that were recorded from a board. Samples have their times, lines have none. Raises BadInput, Unstored."""
    ns_per_byte = NS_PER_S / rate_hz if tap.kind == "line" else 0.0
    for data in _blocks_of(source):
        tap.take_bytes(FROM_BOARD, data, lambda at: round(at * ns_per_byte))


def _blocks_of(source: Path) -> Iterator[bytes]:
    try:
        with source.open("rb", buffering=0) as stream:
            while data := stream.read(BLOCK):
                yield data
    except OSError as e:
        raise input_error(source, "a recording of a port", e) from e


class Relay:
    """Between a port and a pseudo-terminal of our own, whose name is `path`. Leaving its context closes both.

    one_way: the port only sends, and nothing is passed on.
    """

    def __init__(self, port: Path, one_way: bool = False) -> None:
        """Raises LinkError."""
        try:
            self._port = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        except OSError as e:
            raise link_error(port, "a serial port", e) from e
        self._ours, self._theirs = os.openpty()  # theirs stays open: programs may come and go
        for end in (self._port, self._theirs):
            if os.isatty(end):
                tty.setraw(end)
        os.set_blocking(self._ours, False)
        self.path = os.ttyname(self._theirs)
        self._held = {self._port: b"", self._ours: b""}  # by where it goes
        self._ways = {self._port: (self._ours, FROM_BOARD), self._ours: (self._port, TO_BOARD)}
        self._one_way = one_way
        if one_way:
            del self._ways[self._ours]

    def __enter__(self) -> Relay:
        return self

    def __exit__(self, *_: object) -> None:
        for end in (self._port, self._ours, self._theirs):
            os.close(end)

    def pass_on(self, took: Callable[[int, bytes], None], deadline_s: float | None = None) -> None:
        """Passes bytes on until the port ends, or until an instant of time.monotonic()."""
        while deadline_s is None or time.monotonic() < deadline_s:
            readable = [end for end, (to, _) in self._ways.items() if len(self._held[to]) < MOST_HELD]
            writable = [end for end, held in self._held.items() if held]
            come, go, _ = select.select(readable, writable, [], POLL_S)
            for end in come:
                to, direction = self._ways[end]
                data = self._read_from(end)
                if data == b"":
                    return
                took(direction, data or b"")
                self._held[to] += b"" if self._one_way else data or b""
            if not all(self._write_to(end) for end in go):
                return

    def _read_from(self, end: int) -> bytes | None:
        """b"" where the other side has gone, None where there is nothing after all."""
        try:
            return os.read(end, BLOCK)
        except BlockingIOError:
            return None
        except OSError:  # an adapter that was unplugged
            return b""

    def _write_to(self, end: int) -> bool:
        """False where the other side has gone, with what it had not read."""
        try:
            self._held[end] = self._held[end][os.write(end, self._held[end]) :]
        except BlockingIOError:
            pass
        except OSError:
            return False
        return True
