"""Client of the control socket: one JSON object a line, one reply each, and what was subscribed between them."""

from __future__ import annotations

import json
import socket
from collections import deque
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from psabench.errors import ControlError, LinkError, expected, link_error

REPLY_S = 600.0  # a long `run` in step pace answers when it is done
EVENTS_KEPT = 100_000  # of subscriptions, until somebody takes them; older ones go first


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """What a command answered."""

    t_ns: int  # simulated time
    can_rx: int  # CAN frames handed to the client that has been on the bus longest: the barrier of step pace
    rx: dict[int, int]  # the same for each client, by its number in the order of coming
    result: dict[str, Any]


class Control(AbstractContextManager["Control"]):
    """`with Control(path) as ctl: ctl.call("run", for_s=0.1)`.

    Raises LinkError when the emulator is not there or goes away, ControlError when it rejects a command. A call that
    Ctrl-C has interrupted leaves the connection usable: its reply is passed over when it comes.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.events: deque[dict[str, Any]] = deque(maxlen=EVENTS_KEPT)  # of `subscribe`, as they came
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(REPLY_S)
        try:
            self._socket.connect(str(path))
        except OSError as e:
            self._socket.close()
            raise link_error(path, "the control socket of psa-emu", e, "is psa-emu running with --control?") from e
        self._bytes = bytearray()  # of a line that is not all there yet
        self._id = 0

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._socket.close()

    def call(self, command: str, /, **args: object) -> Reply:
        """Send one command and wait for its reply."""
        self.send(command, **args)
        return self.wait_reply(command)

    def send(self, command: str, /, **args: object) -> None:
        """Send one command; `wait_reply` has what it answers."""
        self._id += 1
        request = {"id": self._id, "cmd": command, "args": args}
        try:
            self._socket.sendall(json.dumps(request).encode() + b"\n")
        except OSError as e:
            raise LinkError(f"control socket: {command}: connection lost ({e.strerror or e})") from e

    def wait_reply(self, command: str) -> Reply:
        """Of the command that was sent last."""
        while True:
            line = self._line(command, REPLY_S)
            try:
                answer = json.loads(line)
                if "event" in answer:
                    self.events.append(answer)
                elif not self._is_of_old(answer):
                    return self._parse(command, answer)
            except (ValueError, KeyError, TypeError, AttributeError) as e:
                raise LinkError(expected("a reply", repr(line[:80]), f"control socket: {command}")) from e

    def next_event(self, timeout_s: float) -> dict[str, Any] | None:
        """The next line of a subscription; None when none comes within timeout_s of real time."""
        if not self.events:
            try:
                self.events.append(json.loads(self._line("subscription", timeout_s)))
            except TimeoutError:
                return None
        return self.events.popleft()

    def _line(self, command: str, timeout_s: float) -> bytes:
        """Raises TimeoutError, only for a subscription."""
        self._socket.settimeout(timeout_s)
        while b"\n" not in self._bytes:
            try:
                more = self._socket.recv(65536)
            except TimeoutError:
                if timeout_s < REPLY_S:
                    raise
                raise LinkError(f"control socket: {command}: no reply within {REPLY_S:g} s") from None
            except OSError as e:
                raise LinkError(f"control socket: {command}: connection lost ({e.strerror})") from e
            if not more:
                raise LinkError(f"control socket: {command}: connection closed by the emulator")
            self._bytes += more
        line, _, rest = bytes(self._bytes).partition(b"\n")
        self._bytes = bytearray(rest)
        return line

    def _is_of_old(self, answer: dict[str, Any]) -> bool:
        """Whether it answers a call before this one, which Ctrl-C has interrupted."""
        number = answer.get("id")
        return isinstance(number, int) and number < self._id

    def _parse(self, command: str, reply: dict[str, Any]) -> Reply:
        if reply.get("id") != self._id:
            raise LinkError(expected(f"the reply to request {self._id}", reply.get("id"), f"control socket: {command}"))
        if not reply["ok"]:
            raise ControlError(command, reply["error"]["code"], reply["error"]["text"])
        return Reply(
            t_ns=reply["t_ns"],
            can_rx=reply.get("can_rx", 0),
            rx={int(client): int(frames) for client, frames in reply.get("rx", {}).items()},
            result=reply.get("result") or {},
        )


class HasControl(Protocol):
    """A bench with a control socket."""

    @property
    def control(self) -> Control:
        """Raises BenchError on a real bench."""
        ...
