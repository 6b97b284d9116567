"""The panel's end of a WebSocket without a process: which frames end it, with which code, and what is taken before."""

from __future__ import annotations

import asyncio
from typing import Any
from unittest.mock import Mock

import pytest
import uvicorn
from panel_frames import FIN, PING, PONG, TEXT, frame, handshake
from psabench.panel.frames import FRAGMENTS, BoundedSocket
from psabench.panel.guard import Allowance
from psabench.panel.server import WRONG_FRAMES
from uvicorn.server import ServerState

BURST = int(Allowance().burst)
LINE = frame(FIN | TEXT, b"{}")
WRONG = frame(FIN | 3)  # an opcode that RFC 6455 reserves


def taken(*chunks: bytes, accept: bool = True) -> tuple[list[dict[str, Any]], Mock]:
    """What the application gets after the handshake, and the transport at the end."""
    got: list[dict[str, Any]] = []
    transport = Mock(spec=asyncio.Transport)
    transport.is_closing.return_value = False
    transport.get_extra_info.return_value = None

    async def app(_: Any, receive: Any, send: Any) -> None:
        await receive()
        if accept:
            await send({"type": "websocket.accept"})
        while not got or got[-1]["type"] != "websocket.disconnect":
            got.append(await receive())

    async def run() -> None:
        config = uvicorn.Config(app, log_config=None, ws_max_size=64, ws_per_message_deflate=False)
        config.load()
        state = ServerState()
        end = BoundedSocket(config, state, {})
        end.connection_made(transport)
        end.data_received(handshake("127.0.0.1:1", ""))
        for chunk in chunks:
            if accept:
                await asyncio.sleep(0)  # the application takes what has come
            end.data_received(chunk)
        if transport.abort.called:
            end.connection_lost(None)
        await asyncio.wait_for(asyncio.gather(*state.tasks), 10)

    asyncio.run(run())
    return got, transport


@pytest.mark.parametrize(
    ("data", "code"),
    [
        (WRONG, 1002),
        (frame(FIN | TEXT, b"\xff"), 1007),
        (LINE * (BURST + 1), 1008),
        (frame(FIN | PING) * (BURST + 1), 1008),
        (frame(FIN | PONG) * (BURST + 1), 1008),
        (frame(TEXT) + frame(0) * FRAGMENTS, 1009),
        (frame(FIN | TEXT, bytes(65)), 1009),
    ],
)
def test_wrong_frames_end_it_and_what_came_with_them_is_dropped(data: bytes, code: int) -> None:
    got, transport = taken(LINE, data)
    assert [m.get("text", m.get("code")) for m in got] == ["{}", code]
    assert code in WRONG_FRAMES
    transport.close.assert_called()
    assert taken(LINE + data)[0][-1]["code"] == code
    assert len(taken(LINE + data)[0]) == 1


def test_a_burst_and_a_message_in_fragments_are_taken() -> None:
    whole = frame(TEXT, b"{") + frame(0) * (FRAGMENTS - 2) + frame(FIN, b"}")
    got, _ = taken(LINE * (BURST - FRAGMENTS), whole, frame(FIN | 8, b"\x03\xe8"))
    assert len(got) == BURST - FRAGMENTS + 2
    assert got[-2]["text"] == "{}"
    assert got[-1]["code"] == 1000


def test_a_wrong_frame_before_the_handshake_has_its_answer_cuts_it_off() -> None:
    got, transport = taken(WRONG, accept=False)
    assert [m["type"] for m in got] == ["websocket.disconnect"]
    transport.abort.assert_called_once()
