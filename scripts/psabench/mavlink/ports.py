"""Where MAVLink peers are, on 127.0.0.1 alone: UDP to a port, UDP at a port, a TCP server.

A port never blocks. A peer that reads too slowly loses whole messages, and is counted. One thread polls, any may send.
"""

from __future__ import annotations

import selectors
import socket
import threading
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from psabench.errors import expected, listen_error

HOST = "127.0.0.1"
DEFAULT_PORTS = {"udp": 14550, "udpin": 14550, "tcp": 5760}
FORM = "udp[:PORT], udpin[:PORT] or tcp[:PORT]"
PEERS_MAX = 8
OUT_MAX = 1 << 20  # bytes kept for a slow TCP peer
DATAGRAM = 2048
Parser = Callable[[bytes], list[Any]]  # bytes of one peer to the messages that are complete


@dataclass(frozen=True, slots=True)
class PortSpec:
    """A port that was asked for."""

    kind: str
    port: int  # 0: any free one (not of udp)


def port_spec(text: str) -> PortSpec:
    """`KIND[:PORT]`. Raises ValueError."""
    kind, colon, number = text.partition(":")
    if kind not in DEFAULT_PORTS or (colon and not (number.isdecimal() and int(number) < 65536)):
        raise ValueError(expected(FORM, repr(text)))
    port = int(number) if colon else DEFAULT_PORTS[kind]
    if kind == "udp" and port == 0:
        raise ValueError(expected("a port from 1 to 65535", repr(text)))
    return PortSpec(kind, port)


@dataclass(slots=True)
class Peer:
    """Who gets the messages of a port."""

    parse: Parser
    address: tuple[str, int] | None = None  # of UDP
    connection: socket.socket | None = None  # of TCP
    out: bytearray = field(default_factory=bytearray)
    heard: int = 0


class Port:
    """One port and its peers. Raises LinkError where the port is in use."""

    def __init__(self, spec: PortSpec, new_parser: Callable[[], Parser]) -> None:
        self.host, self.lost = HOST, 0
        self.peers: list[Peer] = []
        self._lock = threading.RLock()  # of the peers and what waits for them
        self._new_parser = new_parser
        self._kind = spec.kind
        self._heard = 0
        self._selector = selectors.DefaultSelector()
        self._socket = self._open(spec)
        self._socket.setblocking(False)
        self._selector.register(self._socket, selectors.EVENT_READ, None)
        self.port = spec.port if spec.kind == "udp" else int(self._socket.getsockname()[1])
        if spec.kind == "udp":
            self.peers.append(Peer(new_parser(), address=(HOST, spec.port)))

    def _open(self, spec: PortSpec) -> socket.socket:
        kind = socket.SOCK_STREAM if spec.kind == "tcp" else socket.SOCK_DGRAM
        s = socket.socket(socket.AF_INET, kind)
        try:
            if spec.kind == "tcp":
                s.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            s.bind((HOST, 0 if spec.kind == "udp" else spec.port))
            if spec.kind == "tcp":
                s.listen(PEERS_MAX)
        except OSError as e:
            s.close()
            raise listen_error("--mavlink", spec.port, e) from e
        return s

    def close(self) -> None:
        for peer in list(self.peers):
            self._drop(peer)
        self._selector.close()
        self._socket.close()

    # ---- out

    def send(self, frame: bytes) -> None:
        """To every peer."""
        with self._lock:
            for peer in list(self.peers):
                if peer.address is not None:
                    self._send_datagram(peer.address, frame)
                elif len(peer.out) + len(frame) > OUT_MAX:
                    self.lost += 1
                else:
                    peer.out += frame
                    self._flush(peer)

    def _send_datagram(self, address: tuple[str, int], frame: bytes) -> None:
        try:
            self._socket.sendto(frame, address)
        except ConnectionRefusedError:
            pass  # no one listens there yet
        except OSError:
            self.lost += 1

    def _flush(self, peer: Peer) -> None:
        assert peer.connection is not None
        try:
            while peer.out:
                sent = peer.connection.send(peer.out)
                del peer.out[:sent]
        except BlockingIOError:
            pass
        except OSError:
            self._drop(peer)

    # ---- in

    def poll(self, timeout_s: float) -> list[Any]:
        """Messages that have come within the time."""
        messages: list[Any] = []
        ready = self._selector.select(timeout_s)
        with self._lock:
            for key, _ in ready:
                if key.data is not None:
                    messages += self._read_stream(key.data)
                elif self._kind == "tcp":
                    self._accept()
                else:
                    messages += self._read_datagrams()
            for peer in list(self.peers):
                if peer.out:
                    self._flush(peer)
        return messages

    def _accept(self) -> None:
        with suppress(OSError):
            connection, _ = self._socket.accept()
            if len(self.peers) >= PEERS_MAX:
                connection.close()
                return
            connection.setblocking(False)
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            peer = Peer(self._new_parser(), connection=connection)
            self.peers.append(peer)
            self._selector.register(connection, selectors.EVENT_READ, peer)

    def _read_stream(self, peer: Peer) -> list[Any]:
        assert peer.connection is not None
        try:
            data = peer.connection.recv(1 << 16)
        except BlockingIOError:
            return []
        except OSError:
            data = b""
        if not data:
            self._drop(peer)
            return []
        return peer.parse(data)

    def _read_datagrams(self) -> list[Any]:
        messages: list[Any] = []
        for _ in range(32):
            try:
                data, address = self._socket.recvfrom(DATAGRAM)
            except OSError:
                break
            peer = next((p for p in self.peers if p.address == address), None)
            if peer is None and self._kind == "udpin":
                peer = self._admit(address)
            if peer is not None:
                self._heard += 1
                peer.heard = self._heard
                messages += peer.parse(data)
        return messages

    def _admit(self, address: tuple[str, int]) -> Peer:
        """The peer that was silent longest makes room."""
        if len(self.peers) >= PEERS_MAX:
            self.peers.remove(min(self.peers, key=lambda p: p.heard))
        self.peers.append(Peer(self._new_parser(), address=address))
        return self.peers[-1]

    def _drop(self, peer: Peer) -> None:
        if peer in self.peers:
            self.peers.remove(peer)
        if peer.connection is not None:
            with suppress(KeyError, ValueError):
                self._selector.unregister(peer.connection)
            peer.connection.close()
