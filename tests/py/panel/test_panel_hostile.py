"""A hostile page that has the token: floods, and frames that no browser sends. Another page is served meanwhile."""

from __future__ import annotations

import json
import os
import socket
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import panel_run as run
from panel_frames import CLOSE, FIN, PING, PONG, RSV1, TEXT, frame, handshake

FLOOD = json.dumps({"do": "line", "line": "wait 1ms"}).encode()
PER_S, PIECE = 10_000, 1_000
BURST = 60  # messages, docs/tools/panel.md
GREW_KB = 8_000  # of the panel's memory; what it would hold of each flood below is more


MALFORMED = "expected frames of RFC 6455, got others"
TOO_LONG = "expected messages of up to 4096 bytes in up to 16 frames, got more"
TOO_MANY = "expected up to 20 messages a second, got more"
NOT_UTF8 = "expected UTF-8, got other bytes"

# what comes after the handshake | why it is closed
FRAMES = {
    "opcode 3": (frame(FIN | 3), MALFORMED),
    "opcode 11": (frame(FIN | 11), MALFORMED),
    "no mask": (b"\x81\x02{}", MALFORMED),
    "compressed, which was not agreed": (frame(FIN | RSV1 | TEXT, zlib.compress(bytes(2_000_000))), MALFORMED),
    "a continuation of nothing": (frame(FIN), MALFORMED),
    "a text within another": (frame(TEXT, b"{") + frame(FIN | TEXT, b"}"), MALFORMED),
    "a ping in fragments": (frame(PING), MALFORMED),
    "a ping of 126 bytes": (frame(FIN | PING, bytes(126)), MALFORMED),
    "a close of one byte": (frame(FIN | CLOSE, b"\x03"), MALFORMED),
    "a line, and then opcode 3": (frame(FIN | TEXT, FLOOD) + frame(FIN | 3), MALFORMED),
    "bytes that are no UTF-8": (frame(FIN | TEXT, b'{"do": "\xff\xfe"}'), NOT_UTF8),
    "half a character": (frame(TEXT, b"\xd0") + frame(FIN, b""), NOT_UTF8),
    "a length of 4 EB": (frame(FIN | TEXT, length=1 << 62), TOO_LONG),
    "5000 bytes": (frame(FIN | TEXT, bytes(5000)), TOO_LONG),
    "5000 bytes in two fragments": (frame(TEXT, bytes(4000)) + frame(FIN, bytes(1000)), TOO_LONG),
    "20 fragments": (frame(TEXT) + frame(0) * 19, TOO_LONG),
    "fragments without end": (frame(TEXT) + frame(0) * 300_000, TOO_LONG),
    "pings whose answers are not read": (frame(FIN | PING, bytes(125)) * 100_000, TOO_MANY),
    "pongs": (frame(FIN | PONG) * 300_000, TOO_MANY),
}  # fmt: skip


@contextmanager
def raw(panel: run.Running) -> Iterator[socket.socket]:
    """A TCP connection with a good handshake."""
    with socket.create_connection(("127.0.0.1", panel.port), timeout=run.WAIT_S) as connection:
        connection.sendall(handshake(f"127.0.0.1:{panel.port}", panel.cookie))
        yield connection


def opened(connection: socket.socket) -> str:
    """The head of the answer to a handshake."""
    head = b""
    while not head.endswith(b"\r\n\r\n"):
        byte = connection.recv(1)
        assert byte, head
        head += byte
    return head.decode()


def sent_until_closed(connection: socket.socket, data: bytes) -> None:
    """Returns when the panel has closed: what is not read until then is refused."""
    try:
        connection.sendall(data)
        while connection.recv(1 << 16):
            pass
    except ConnectionError:  # closed with bytes of ours unread
        pass


def memory_kb(panel: run.Running) -> int:
    pages = int(Path(f"/proc/{panel.process.pid}/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") // 1024


def is_served(panel: run.Running) -> float:
    """The time of the bench, asked for by another page."""
    with panel.socket() as other:
        answer = run.said(other, 1, "time")
        while "at most a few requests" in answer.get("error", ""):  # those of the pages that are gone
            answer = run.said(other, 1, "time")
        return float(answer["result"]["t_s"])


def test_malformed_frames_close_the_page_with_one_line_each_and_do_nothing() -> None:
    with run.running("quiet", "--paused") as panel:
        for _ in range(2):
            before_kb = memory_kb(panel)
            for name, (data, _) in FRAMES.items():
                with raw(panel) as connection:
                    assert "permessage-deflate" not in opened(connection)
                    sent_until_closed(connection, data)
                assert is_served(panel) == 0.0, name
                assert memory_kb(panel) < before_kb + GREW_KB, name
        lines = panel.end().splitlines()
    assert sorted(lines) == sorted(f"panel: closed a page: page: {why}" for why in {w for _, w in FRAMES.values()})


def test_10_000_messages_a_second_close_the_page_while_another_is_served() -> None:
    """It opens a new one each time, for a second, and reads nothing."""
    pages = []
    with run.running("quiet", "--paused") as panel, panel.socket() as other:
        run.received(other, "hello")
        before_kb, begun_s = memory_kb(panel), time.monotonic()
        for k in range(PER_S // PIECE):
            with raw(panel) as connection:
                pages.append(opened(connection))
                sent_until_closed(connection, frame(FIN | TEXT, FLOOD) * PIECE)
            run.received(other, "update")
            time.sleep(max(0.0, begun_s + (k + 1) * PIECE / PER_S - time.monotonic()))
        assert len(pages) == PER_S // PIECE
        assert is_served(panel) <= BURST * len(pages) * 1e-3  # 10,000 lines would have made it 10 s
        assert memory_kb(panel) < before_kb + GREW_KB
        assert panel.end().splitlines() == [f"panel: closed a page: page: {TOO_MANY}"]
