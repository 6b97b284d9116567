"""Frames of a page's WebSocket before they are messages: how many, and what is sent after a wrong one.

uvicorn bounds the bytes of a message. Pings, and fragments without bytes, reach no application: unbounded they would
keep the server busy, and fill the memory with fragments, or with answers that the page does not read.
RFC 6455, 5.4 and 5.5.
"""

from __future__ import annotations

from typing import Any

from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.frames import CloseCode, Frame

from psabench.panel.guard import Allowance

FRAGMENTS = 16  # of a message; browsers send one of our length in one frame
LINGER_S = 1.0  # until a page that does not read its close is cut off


class BoundedSocket(WebSocketsSansIOProtocol):
    """uvicorn's, ended by what our page never sends. What came with it, and was not taken yet, is dropped."""

    def __init__(self, *args: Any, **how: Any) -> None:
        super().__init__(*args, **how)
        self._allowance = Allowance()

    def handle_text(self, event: Frame) -> None:
        if self._is_allowed():
            super().handle_text(event)

    def handle_bytes(self, event: Frame) -> None:
        if self._is_allowed():
            super().handle_bytes(event)

    def handle_cont(self, event: Frame) -> None:
        if len(self.frames) >= FRAGMENTS:
            self._fail(CloseCode.MESSAGE_TOO_BIG)
        elif self._is_allowed():
            super().handle_cont(event)

    def handle_ping(self) -> None:
        if self._is_allowed():
            super().handle_ping()

    def handle_pong(self, event: Frame) -> None:
        if self._is_allowed():
            super().handle_pong(event)

    def handle_parser_exception(self) -> None:
        if self.conn.close_sent is None:  # it came with the handshake, which has no answer yet
            self.transport.abort()
            return
        while not self.queue.empty():
            self.queue.get_nowait()
        super().handle_parser_exception()
        self.loop.call_later(LINGER_S, self.transport.abort)

    def _is_allowed(self) -> bool:
        if self.close_sent:
            return False
        if self._allowance.take():
            return True
        self._fail(CloseCode.POLICY_VIOLATION)
        return False

    def _fail(self, code: CloseCode) -> None:
        self.conn.fail(code)
        self.handle_parser_exception()
