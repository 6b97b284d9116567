"""The other end of a cannelloni tunnel over UDP on this machine: a program in the place of cannelloni itself.

Format version 2. Source: cannelloni 2.1.1, doc/udp_format.md, parser.cpp. It sends one frame a datagram and takes any
number.
"""

from __future__ import annotations

import re
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Iterator
from typing import Any

import can

from psabench.errors import BadInput, expected
from psabench.link.udp_bus import RCVBUF

HOST, OWN_PORT = "127.0.0.1", 20001
FORM = "cannelloni:PORT or cannelloni:PORT:OWN_PORT, ports from 1 to 65535"
HEADER, FRAME = struct.Struct(">BBBH"), struct.Struct(">IB")
VERSION, DATA, FD, BRS, ESI = 2, 0, 0x80, 1, 2
EXTENDED, REMOTE, ERROR, ID = 1 << 31, 1 << 30, 1 << 29, (1 << 29) - 1  # linux/can.h
DATAGRAM_MAX = 1 << 16


def ports_of(text: str) -> tuple[int, int]:
    """The emulator's port and ours of "PORT" or "PORT:OWN_PORT". Raises BadInput."""
    found = re.fullmatch(r"(\d{1,5})(?::(\d{1,5}))?", text)
    ports = (int(found[1]), int(found[2] or OWN_PORT)) if found else (0, 0)
    if not all(0 < p < 1 << 16 for p in ports) or ports[0] == ports[1]:
        raise BadInput(expected(FORM, repr(text), "--can cannelloni"))
    return ports


def pack_frame(m: can.Message) -> bytes:
    flags = EXTENDED * m.is_extended_id | REMOTE * m.is_remote_frame | ERROR * m.is_error_frame
    fd = bytes([BRS * m.bitrate_switch | ESI * m.error_state_indicator]) if m.is_fd else b""
    return FRAME.pack(m.arbitration_id | flags, m.dlc | FD * m.is_fd) + fd + (b"" if m.is_remote_frame else m.data)


def unpack_frames(data: bytes, timestamp_s: float) -> Iterator[can.Message]:
    """The frames of a datagram. Raises ValueError, struct.error."""
    version, op_code, _, count = HEADER.unpack_from(data)
    if (version, op_code) != (VERSION, DATA):
        raise ValueError(expected(f"version {VERSION}, op_code {DATA}", f"{version}, {op_code}"))
    at = HEADER.size
    for _ in range(count):
        number, length = FRAME.unpack_from(data, at)
        is_fd, remote = bool(length & FD), bool(number & REMOTE)
        begin = at + FRAME.size + is_fd
        at = begin if remote else begin + (length & ~FD)
        yield can.Message(
            timestamp=timestamp_s,
            arbitration_id=number & ID,
            is_extended_id=bool(number & EXTENDED),
            is_remote_frame=remote,
            is_error_frame=bool(number & ERROR),
            is_fd=is_fd,
            bitrate_switch=is_fd and bool(data[begin - 1] & BRS),
            error_state_indicator=is_fd and bool(data[begin - 1] & ESI),
            dlc=length & ~FD,
            data=data[begin:at],
            check=True,
        )
    if at != len(data):
        raise ValueError(expected(f"{at} bytes", len(data)))


class CannelloniBus(can.BusABC):
    """channel: PORT of the emulator, or PORT:OWN_PORT. Raises BadInput, OSError."""

    def __init__(self, channel: str, **options: Any) -> None:
        port, own = ports_of(channel)
        self.channel_info = f"cannelloni:{channel}"
        self._waiting: deque[can.Message] = deque()
        self._seq = 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RCVBUF)
            self._socket.bind((HOST, own))
            self._socket.connect((HOST, port))  # from nowhere else, and an emulator that has gone is an error
            super().__init__(channel, **options)
        except BaseException:
            self._socket.close()
            raise

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send one frame; timeout is python-can's, a datagram does not wait."""
        self._socket.send(HEADER.pack(VERSION, DATA, self._seq, 1) + pack_frame(msg))
        self._seq = self._seq + 1 & 0xFF

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._waiting and select.select([self._socket], [], [], timeout)[0]:
            data = self._socket.recv(DATAGRAM_MAX)
            try:
                self._waiting.extend(unpack_frames(data, time.time()))
            except (ValueError, struct.error, IndexError) as e:
                raise can.CanOperationError(f"a datagram that is not cannelloni's: {e}") from e
        return self._waiting.popleft() if self._waiting else None, False

    def fileno(self) -> int:
        return self._socket.fileno()

    def shutdown(self) -> None:
        super().shutdown()
        self._socket.close()
