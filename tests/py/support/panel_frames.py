"""What a page sends on its WebSocket, byte by byte: the handshake, and frames that no browser makes."""

from __future__ import annotations

FIN, TEXT, PING, PONG, CLOSE, RSV1, MASKED = 0x80, 1, 9, 10, 8, 0x40, 0x80


def frame(first: int, payload: bytes = b"", length: int | None = None) -> bytes:
    """RFC 6455, 5.2, with a mask of zeros. length: another than the payload's."""
    n = len(payload) if length is None else length
    size = bytes([MASKED | n]) if n < 126 else bytes([MASKED | 127]) + n.to_bytes(8, "big")
    return bytes([first]) + size + bytes(4) + payload


def handshake(host: str, cookie: str) -> bytes:
    """RFC 6455, 4.1. It asks for compression."""
    lines = [
        "GET /ws HTTP/1.1", f"Host: {host}", f"Origin: http://{host}", f"Cookie: {cookie}", "Upgrade: websocket",
        "Connection: Upgrade", "Sec-WebSocket-Version: 13", "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        "Sec-WebSocket-Extensions: permessage-deflate", "", "",
    ]  # fmt: skip
    return "\r\n".join(lines).encode()
