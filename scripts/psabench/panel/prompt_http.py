"""HTTP connections that end: one that asks for nothing must not keep the page out (uvicorn's limit_concurrency)."""

from __future__ import annotations

import asyncio

from uvicorn.protocols.http.h11_impl import H11Protocol

LIFE_S = 10.0  # of a connection that is not a WebSocket; a browser opens the next one by itself


class PromptHttp(H11Protocol):
    """uvicorn's, which waits for a first request, and for the rest of one, as long as it takes."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        self.loop.call_later(LIFE_S, self._end)

    def _end(self) -> None:
        if self in self.connections:  # a WebSocket has another protocol there
            self.transport.close()
