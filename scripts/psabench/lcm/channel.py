"""LCM on the network, by the `lcm` package: messages go out with hop limit 0 and stay on this machine.

Without a route for multicast (a machine without a network): `ip route add 224.0.0.0/4 dev lo` as root.
"""

from __future__ import annotations

import re
import select
import socket
import time
from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol

import can

from psabench.errors import BadInput, LinkError, expected, link_error, output_error
from psabench.lcm.event_log import put_event
from psabench.lcm.frames import FRAMES, TYPE, to_message
from psabench.lcm.types import lcm_type
from psabench.link.own import OutputFile, Owned, Unstored

FILE, MEMORY, NETWORK = "file://", "memq://", "udpm://"
EXAMPLE = "udpm://239.255.76.67:7667"
RECEIVE_BYTES = 2_000_000  # of the kernel's buffer: its usual one loses frames at 10 kHz
QUEUE = 100_000  # messages that wait in the library
_ADDRESS = re.compile(r"udpm://(?:([\d.]+))?(?::(\d+))?(?:\?(ttl=0)?)?")


def open_lcm(url: str) -> Any:
    """An `lcm.LCM` of udpm:// or memq://. Raises BadInput for another URL, LinkError without a route for multicast."""
    import lcm

    if url == MEMORY:
        return lcm.LCM(url)
    group, port = _udpm_address(url)
    _check_route(url, group, port)
    try:
        return lcm.LCM(f"udpm://{group}:{port}?ttl=0&recv_buf_size={RECEIVE_BYTES}")
    except RuntimeError as e:
        raise LinkError(f"{url}: {e}") from e


def _udpm_address(url: str) -> tuple[str, int]:
    match = _ADDRESS.fullmatch(url)
    if "ttl=" in url and not url.endswith("ttl=0"):
        raise BadInput(expected("ttl=0, so that messages stay on this machine", repr(url), "--lcm"))
    group, port = (match[1] or "239.255.76.67", int(match[2] or 7667)) if match else ("", 0)
    if not _is_multicast(group) or not 0 < port < 65536:
        raise BadInput(expected(f"udpm://GROUP:PORT as {EXAMPLE}", repr(url), "--lcm"))
    return group, port


def _is_multicast(group: str) -> bool:
    try:
        return 224 <= socket.inet_aton(group)[0] <= 239 and group.count(".") == 3
    except OSError:
        return False


def _check_route(url: str, group: str, port: int) -> None:
    """liblcm explains a missing route in six lines on stderr: look first."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
        try:
            s.connect((group, port))
        except OSError as e:
            what = "a route for multicast (as root: ip route add 224.0.0.0/4 dev lo)"
            raise link_error(url, what, e) from e


class LcmBus(can.BusABC):
    """The frames on PSABENCH_CAN_<bus> as a bus of python-can that only receives. bad: messages that were no frame."""

    def __init__(self, url: str, bus: str | None = None) -> None:
        super().__init__(channel=url)
        self.channel_info = url
        self.bad = 0
        self._frames: deque[can.Message] = deque()
        self._lcm = open_lcm(url)
        subscription = self._lcm.subscribe(f"{FRAMES}{re.escape(bus) if bus else '.*'}", self._on_message)
        subscription.set_queue_capacity(QUEUE)

    def _on_message(self, _: str, data: bytes) -> None:
        try:
            self._frames.append(to_message(lcm_type(TYPE).decode(data)))
        except ValueError:
            self.bad += 1

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        deadline_s = None if timeout is None else time.monotonic() + timeout
        while not self._frames:
            left_s = None if deadline_s is None else max(0.0, deadline_s - time.monotonic())
            # not handle_timeout(): it reports a signal as an error
            if select.select([self._lcm.fileno()], [], [], left_s)[0]:
                self._lcm.handle()
            elif left_s is not None:
                return None, False
        return self._frames.popleft(), False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Raises CanOperationError: nothing takes frames from LCM."""
        raise can.CanOperationError("LCM: expected a bus that frames can be sent on; use --can")


class Channel(Protocol):
    """Where messages go."""

    def publish(self, channel: str, data: bytes) -> None: ...


class LogChannel:
    """An event log of its own. Raises BadInput and OutputError as `own.Owned` does."""

    def __init__(self, path: Path) -> None:
        self._owned = Owned(path)
        self._count = self._size = 0
        try:
            self._file = OutputFile(path, "w")
        except OSError as e:
            self._owned.release()
            raise output_error(path, e) from e

    def publish(self, channel: str, data: bytes) -> None:
        event = put_event(self._count, time.time_ns() // 1000, channel, data)
        try:
            self._file.write(event)
        except Unstored as e:
            with suppress(OSError):  # a device or a pipe
                self._file.truncate(self._size)
            raise output_error(self._owned.path, e, f"stored {self._count} messages") from e
        self._count += 1
        self._size += len(event)

    def close(self) -> None:
        self._file.close()
        self._owned.release()


class Publisher:
    """Messages of the types of proto/lcm on a channel."""

    def __init__(self, channel: Channel) -> None:
        self._channel = channel

    def publish(self, channel: str, kind: str, values: Mapping[str, Any]) -> None:
        """Raises ValueError for values that the type does not take, OutputError when a log cannot take the message."""
        self._channel.publish(channel, lcm_type(kind).encode(values))


@contextmanager
def publisher(url: str) -> Iterator[Publisher]:
    """A publisher to udpm://, file://PATH or memq://. Raises BadInput, LinkError, OutputError."""
    if not url.startswith(FILE):
        yield Publisher(open_lcm(url))
        return
    log = LogChannel(Path(url.removeprefix(FILE)))
    try:
        yield Publisher(log)
    finally:
        log.close()
