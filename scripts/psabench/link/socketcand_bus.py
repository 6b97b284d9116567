"""A client of socketcand that takes what has come in one go.

python-can's reads 1 KiB at a time and copies what is left of it for each frame.
"""

from __future__ import annotations

import select
import socket
from collections import deque
from typing import Any

import can
from can.interfaces.socketcand import SocketCanDaemonBus
from can.interfaces.socketcand.socketcand import convert_ascii_message_to_can_message

PIECE = 1 << 16  # bytes asked of the kernel at once
FRAME = ["<", "frame"]
LONGEST = 200  # characters of a line, as python-can's: what goes on without an end is dropped


class SocketcandBus(SocketCanDaemonBus):
    """python-can's socketcand bus, its greeting and its sending; `taken` has the frames that are here already."""

    def __init__(self, **options: Any) -> None:
        self._came: deque[can.Message] = deque()
        self._rest = ""  # of a line that is not all there yet
        super().__init__(**options)  # type: ignore[no-untyped-call]

    def taken(self, most: int | None = None) -> list[can.Message]:
        """The frames that the last look at the socket has brought and no one has received, so many at most."""
        if most is not None and most < len(self._came):
            return [self._came.popleft() for _ in range(most)]
        came = list(self._came)
        self._came.clear()
        return came

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if not self._came:
            self._read(timeout)
        return (self._came.popleft() if self._came else None), False

    def _read(self, timeout: float | None) -> None:
        link: socket.socket = self._SocketCanDaemonBus__socket  # type: ignore[attr-defined]
        try:
            if not select.select([link], [], [], timeout)[0]:
                return
            *lines, rest = (self._rest + link.recv(PIECE).decode("ascii")).split(">")
            self._rest = rest if len(rest) <= LONGEST else ""
            self._came.extend(m for line in lines if (m := self._frame(line)) is not None)
        except (OSError, ValueError) as e:
            raise can.CanOperationError(f"socketcand: {e}") from e

    def _frame(self, line: str) -> can.Message | None:
        """A line without its end. None, with a warning, for what is no frame."""
        words = line.split()
        if words[:2] != FRAME and "<" in line:
            line = line[line.find("<") :]
            words = line.split()
        if words[:2] == FRAME and 4 <= len(words) <= 5:
            data = bytearray.fromhex(words[4]) if len(words) == 5 else bytearray()
            return can.Message(
                timestamp=float(words[3]),
                arbitration_id=int(words[2], 16),
                data=data,
                dlc=len(data),
                is_extended_id=len(words[2]) != 3,
                channel=self.channel,
            )
        message = convert_ascii_message_to_can_message(line.strip() + " >")
        if message is not None:
            message.channel = self.channel
        return message
