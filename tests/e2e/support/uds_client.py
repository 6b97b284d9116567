"""A strangers' UDS client in simulated time: udsoncan over can-isotp, each frame of it through our host of the bus."""

from __future__ import annotations

from collections import deque

import isotp
from psabench.link.can_host import CanHost, Message
from udsoncan import DidCodec
from udsoncan.client import Client
from udsoncan.connections import BaseConnection

REQUEST, RESPONSE, FUNCTIONAL = 0x7E0, 0x7E8, 0x7DF
STEP_S = 0.001  # of simulated time, while a response is awaited


class StepConnection(BaseConnection):
    """The transport runs where the caller waits, and time moves there alone."""

    def __init__(self, host: CanHost, **params: object) -> None:
        super().__init__()
        self.host = host
        self.frames: list[bytes] = []  # of the server, all
        self.sent: list[bytes] = []  # of the client
        self.errors: list[Exception] = []
        self._waiting: deque[bytes] = deque()
        host.listeners.append(self._heard)
        address = isotp.Address(isotp.AddressingMode.Normal_11bits, txid=REQUEST, rxid=RESPONSE)
        standard = {"tx_padding": 0xCC, "stmin": 0, "blocksize": 0, "logger_name": "uds_client"}
        self.transport = isotp.TransportLayerLogic(
            lambda _timeout: self._next(), self._put, address, self.errors.append, {**standard, **params}
        )

    def _heard(self, m: Message) -> None:
        if m.arbitration_id == RESPONSE:
            self.frames.append(bytes(m.data))
            self._waiting.append(bytes(m.data))

    def _next(self) -> isotp.CanMessage | None:
        return isotp.CanMessage(arbitration_id=RESPONSE, data=self._waiting.popleft()) if self._waiting else None

    def _put(self, m: isotp.CanMessage) -> None:
        self.sent.append(bytes(m.data))
        self.host.send(m.arbitration_id, bytes(m.data))

    def pump(self, span_s: float) -> None:
        """Let time pass; the transport goes on meanwhile."""
        for _ in range(max(1, round(span_s / STEP_S))):
            self.transport.process()
            self.host.advance(STEP_S)
        self.transport.process()

    def specific_send(self, payload: bytes, timeout: float | None = None) -> None:
        self.transport.send(payload)

    def specific_wait_frame(self, timeout: float | None = None) -> bytes | None:
        deadline_s = self.host.clock.now_s() + (timeout or 0.0)
        while not self.transport.available():
            if self.host.clock.now_s() >= deadline_s:
                raise TimeoutError(f"no response within {timeout} s of simulated time")
            self.pump(STEP_S)
        return bytes(self.transport.recv() or b"")

    def empty_rxqueue(self) -> None:
        while self.transport.available():
            self.transport.recv()

    def open(self) -> StepConnection:
        return self

    def close(self) -> None:
        self.host.listeners.remove(self._heard)

    def is_open(self) -> bool:
        return True


def uds_client(host: CanHost, codecs: dict[int | str, str | DidCodec | type[DidCodec]], **params: object) -> Client:
    """udsoncan on our host's bus; params: of can-isotp."""
    client = Client(StepConnection(host, **params))
    client.set_configs({"data_identifiers": codecs, "request_timeout": 3, "p2_timeout": 1, "p2_star_timeout": 5})
    return client
