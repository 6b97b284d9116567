"""pcap files of SocketCAN frames, for Wireshark: LINKTYPE_CAN_SOCKETCAN (227), nanosecond stamps.

A record's packet is the identifier with its flags (big-endian), the length, the FD flags, two reserved bytes and the
data, padded to 8 or 64 bytes as the kernel has it. Source: www.tcpdump.org/linktypes/LINKTYPE_CAN_SOCKETCAN.html.
The direction of a frame and its channel are not kept, nor stamps below 0 s or above 2^32 s.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import can

from psabench.errors import BadInput, expected
from psabench.link.log_file import Checked
from psabench.logs.records import stamp_ns
from psabench.logs.segments import SegmentFile

MAGIC_NS, MAGIC_US = 0xA1B23C4D, 0xA1B2C3D4
LINKTYPE = 227
MOST_PACKET = 72
HEADER = struct.pack("<IHHiIII", MAGIC_NS, 2, 4, 0, 0, MOST_PACKET, LINKTYPE)
EFF, RTR, ERR = 1 << 31, 1 << 30, 1 << 29
BRS, ESI, FDF = 1, 2, 4
BATCH = 1 << 16  # bytes of a segment
MOST_S = (1 << 32) - 1
DATA_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)


def packet(m: can.Message) -> bytes:
    """A frame as the kernel gives it to a capture."""
    flags = EFF * m.is_extended_id | RTR * m.is_remote_frame | ERR * m.is_error_frame
    fd = FDF * m.is_fd | BRS * (m.is_fd and m.bitrate_switch) | ESI * (m.is_fd and m.error_state_indicator)
    length = m.dlc if m.is_remote_frame else len(m.data)
    data = bytes(m.data).ljust(64 if m.is_fd else 8, b"\0")
    return struct.pack(">IBBxx", m.arbitration_id | flags, length, fd) + data


def record(m: can.Message) -> bytes:
    """A frame as a record of the file."""
    seconds, ns = divmod(stamp_ns(min(m.timestamp, MOST_S)), 1_000_000_000)
    body = packet(m)
    return struct.pack("<IIII", seconds, ns, len(body), len(body)) + body


def frame_of(body: bytes, t_s: float) -> can.Message:
    """The frame of a packet. Raises ValueError."""
    if len(body) < 8:
        raise ValueError(expected("a packet of 8 bytes or more", len(body)))
    word, length, fd = struct.unpack_from(">IBB", body)
    is_fd = bool(fd & FDF) or len(body) == MOST_PACKET
    remote = bool(word & RTR)
    if length not in DATA_LENGTHS or length > (64 if is_fd else 8) or (not remote and 8 + length > len(body)):
        raise ValueError(expected("the length of a CAN frame", length))
    return can.Message(
        timestamp=t_s,
        arbitration_id=word & (0x1FFFFFFF if word & (EFF | ERR) else 0x7FF),
        is_extended_id=bool(word & EFF),
        is_remote_frame=remote,
        is_error_frame=bool(word & ERR),
        is_fd=is_fd,
        bitrate_switch=bool(is_fd and fd & BRS),
        error_state_indicator=bool(is_fd and fd & ESI),
        dlc=length,
        data=b"" if remote else body[8 : 8 + length],
    )


class Pcap(Checked):
    """Whole records, some at a time. A pipe will do, too: `wireshark -k -i FIFO` shows the bus live."""

    def __init__(self, path: Path) -> None:
        self._file = SegmentFile(path)
        self._records = bytearray()
        self._held = self._stored = 0
        self._file.append(HEADER)

    def on_message_received(self, m: can.Message) -> None:
        self._records += record(m)
        self._held += 1
        if len(self._records) >= BATCH:
            self.check()

    def check(self) -> None:
        if self._held:
            held, data = self._held, bytes(self._records)
            self._held = 0
            self._records.clear()
            self._file.append(data)
            self._stored += held

    def stop(self) -> None:
        try:
            self.check()
        finally:
            self._file.close()

    def stored(self, written: int) -> int:
        return self._stored


def read_pcap(path: Path) -> Iterator[can.Message]:
    """Frames of a pcap file of either byte order and resolution. Raises BadInput."""
    with path.open("rb") as file:
        order, hz = _file_header(path, file)
        n = 0
        while head := file.read(16):
            n += 1
            try:
                yield _next_packet(file, head, order, hz)
            except ValueError as e:
                raise BadInput(f"{path}: frame {n}: {e}") from e


def _file_header(path: Path, file: BinaryIO) -> tuple[str, int]:
    head = file.read(24)
    for order in "<>":
        if len(head) == 24 and (magic := struct.unpack_from(f"{order}I", head)[0]) in (MAGIC_NS, MAGIC_US):
            linktype = struct.unpack_from(f"{order}I", head, 20)[0] & 0xFFFF
            if linktype != LINKTYPE:
                raise BadInput(expected(f"link type {LINKTYPE} (SocketCAN)", linktype, path))
            return order, 1_000_000_000 if magic == MAGIC_NS else 1_000_000
    raise BadInput(expected("a pcap file", "another file (pcapng: editcap -F pcap IN OUT)", path))


def _next_packet(file: BinaryIO, head: bytes, order: str, hz: int) -> can.Message:
    if len(head) < 16:
        raise ValueError(expected("a whole record", f"{len(head)} bytes"))
    seconds, parts, length, _ = struct.unpack(f"{order}IIII", head)
    if length > MOST_PACKET:
        raise ValueError(expected(f"a packet of {MOST_PACKET} bytes at most", length))
    body = file.read(length)
    if len(body) < length:
        raise ValueError(expected("a whole record", f"{len(body)} of {length} bytes"))
    return frame_of(body, (seconds * hz + parts) / hz)  # of integers: exact for the digits of the stamp
