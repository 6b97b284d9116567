"""The other end of a cannelloni tunnel, written from its format alone: it shares no code with psabench."""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from types import TracebackType
from typing import NamedTuple

EFF, RTR, ERR = 0x80000000, 0x40000000, 0x20000000  # flags of can_id
BRS, ESI = 0x01, 0x02  # flags of an FD frame
FD = 0x80  # of len
HOST = "127.0.0.1"
TIMEOUT_S = 60.0


class Frame(NamedTuple):
    can_id: int
    data: bytes = b""
    fd_flags: int | None = None  # None: a classic frame
    dlc: int = 0  # of a remote frame

    def pack(self) -> bytes:
        length = (self.dlc if self.can_id & RTR else len(self.data)) | (0 if self.fd_flags is None else FD)
        flags = b"" if self.fd_flags is None else bytes([self.fd_flags])
        return struct.pack(">IB", self.can_id, length) + flags + self.data


class Datagram(NamedTuple):
    seq_no: int
    frames: list[Frame]
    size: int


def pack(frames: Sequence[Frame], seq_no: int) -> bytes:
    return struct.pack(">BBBH", 2, 0, seq_no, len(frames)) + b"".join(f.pack() for f in frames)


def unpack(data: bytes) -> Datagram:
    version, op_code, seq_no, count = struct.unpack_from(">BBBH", data)
    assert (version, op_code) == (2, 0)
    at, frames = 5, []
    for _ in range(count):
        can_id, length = struct.unpack_from(">IB", data, at)
        at += 5
        fd_flags = None
        if length & FD:
            (fd_flags,) = struct.unpack_from(">B", data, at)
            at += 1
        size = length & ~FD
        remote = bool(can_id & RTR)
        frames.append(Frame(can_id, b"" if remote else data[at : at + size], fd_flags, size if remote else 0))
        at += 0 if remote else size
    assert at == len(data), "the frames fill the datagram exactly"
    return Datagram(seq_no, frames, len(data))


@dataclass
class Peer:
    """`with Peer() as peer:`, then an emulator with `--can cannelloni:0:{peer.port}`, then `peer.to = its port`."""

    address: str = HOST
    to: int = 0
    seq_no: int = 0
    sent: int = 0
    received: list[Datagram] = field(default_factory=list)

    def __enter__(self) -> Peer:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind((self.address, 0))
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4 << 20)
        self.port = int(self.socket.getsockname()[1])
        return self

    def __exit__(self, _: type[BaseException] | None, __: BaseException | None, ___: TracebackType | None) -> None:
        self.socket.close()

    def raw(self, data: bytes) -> None:
        self.socket.sendto(data, (HOST, self.to))

    def send(self, *frames: Frame) -> None:
        """All of them in one datagram."""
        self.raw(pack(frames, self.seq_no))
        self.seq_no = self.seq_no + 1 & 0xFF
        self.sent += len(frames)

    def take(self) -> list[Frame]:
        """What the kernel has for us now, without waiting."""
        frames: list[Frame] = []
        while True:
            try:
                data, source = self.socket.recvfrom(65536, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return frames
            assert source == (HOST, self.to), "cannelloni sends from the port that it listens on"
            self.received.append(unpack(data))
            frames += self.received[-1].frames
