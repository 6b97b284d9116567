"""pymavlink as a ground station: the unmodified mavutil with our dialect; it waits for messages and never sleeps."""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from psabench.mavlink.dialect import mavlink
from pymavlink import mavutil

TIMEOUT_S = 60.0


@contextmanager
def station(address: str) -> Iterator[Any]:
    """A mavutil connection, "tcp:127.0.0.1:5760", after the first heartbeat; its losses are counted by mavutil."""
    mavlink()
    mavutil.set_dialect("psabench")
    connection = mavutil.mavlink_connection(address, autoreconnect=False, source_system=255)
    try:
        assert connection.wait_heartbeat(timeout=TIMEOUT_S) is not None
        yield connection
    finally:
        connection.close()


def receive(connection: Any, *kinds: str, where: Callable[[Any], bool] = lambda _: True) -> Any:
    """The next message of one of these kinds. Fails when it does not come."""
    deadline_s = time.monotonic() + TIMEOUT_S
    while time.monotonic() < deadline_s:
        m = connection.recv_match(type=list(kinds) or None, blocking=True, timeout=1.0)
        if m is not None and where(m):
            return m
    raise AssertionError(f"no {' or '.join(kinds)} within {TIMEOUT_S:g} s")


def number(m: Any) -> float:
    """Value of a PARAM_VALUE: 32-bit integers are encoded bytewise."""
    layout = {5: "<I", 6: "<i"}.get(m.param_type)
    return float(struct.unpack(layout, struct.pack("<f", m.param_value))[0]) if layout else float(m.param_value)


def parameters(connection: Any) -> dict[str, float]:
    """All of the system."""
    connection.mav.param_request_list_send(connection.target_system, connection.target_component)
    found: dict[str, float] = {}
    while True:
        m = receive(connection, "PARAM_VALUE")
        found[m.param_id] = number(m)
        if len(found) == m.param_count:
            return found


def set_parameter(connection: Any, name: str, value: float, kind: int = 9) -> tuple[float, list[str]]:
    """What it is afterwards, and what was said of it."""
    connection.mav.param_set_send(connection.target_system, connection.target_component, name.encode(), value, kind)
    said: list[str] = []
    while True:
        m = receive(connection, "PARAM_VALUE", "STATUSTEXT")
        if m.get_type() == "STATUSTEXT":
            said.append(m.text)
        elif m.param_id == name:
            return number(m), said


def command(connection: Any, number_: int, *p: float) -> int:
    """The result of its acknowledgement."""
    seven = [*p, *[0.0] * (7 - len(p))]
    connection.mav.command_long_send(connection.target_system, connection.target_component, number_, 0, *seven)
    return int(receive(connection, "COMMAND_ACK", where=lambda m: m.command == number_).result)


def free_port() -> int:
    """Of UDP on 127.0.0.1."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])
