"""Client of the emulator's control socket: one JSON object a line, one reply each."""

from __future__ import annotations

import json
import socket
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any

from psabench.errors import ControlError, LinkError

REPLY_S = 600.0  # a long `run` in step pace answers when it is done


@dataclass(frozen=True, slots=True, kw_only=True)
class Reply:
    """What a command answered."""

    t_ns: int  # simulated time
    can_rx: int  # CAN frames handed to this host's kind of client since the start: the barrier of step pace
    result: dict[str, Any]


class Control:
    """`with Control(path) as ctl: ctl.call("run", for_s=0.1)`.

    Raises LinkError when the emulator is not there or goes away, ControlError when it refuses a command.
    """

    def __init__(self, path: Path) -> None:
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.settimeout(REPLY_S)
        try:
            self._socket.connect(str(path))
        except OSError as e:
            self._socket.close()
            raise LinkError(f"control socket {path}: {e.strerror}; is psa-emu running with --control?") from e
        self._lines = self._socket.makefile("rb")
        self._id = 0

    def __enter__(self) -> Control:
        return self

    def __exit__(self, kind: type[BaseException] | None, e: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        self._lines.close()
        self._socket.close()

    def call(self, command: str, /, **args: object) -> Reply:
        """Send one command and wait for its reply."""
        self._id += 1
        request = {"id": self._id, "cmd": command, "args": args}
        try:
            self._socket.sendall(json.dumps(request).encode() + b"\n")
            line = self._lines.readline()
        except OSError as e:
            raise LinkError(f"control socket: {command}: {e}") from e
        if not line:
            raise LinkError(f"control socket: the emulator closed it during {command}")
        try:
            return self._parse(command, json.loads(line))
        except (ValueError, KeyError, TypeError, AttributeError) as e:
            raise LinkError(f"control socket: {command}: what came back is no reply: {line[:80]!r}") from e

    def _parse(self, command: str, reply: dict[str, Any]) -> Reply:
        if reply.get("id") != self._id:
            raise LinkError(f"control socket: {command}: reply to request {reply.get('id')}, expected {self._id}")
        if not reply["ok"]:
            raise ControlError(command, reply["error"]["code"], reply["error"]["text"])
        return Reply(t_ns=reply["t_ns"], can_rx=reply.get("can_rx", 0), result=reply.get("result") or {})


def read_truth(path: Path) -> dict[str, Any]:
    """Hidden parameters of the bench, from the truth port. For graders only, after the estimate is made."""
    with Control(path) as port:
        return port.call("truth").result
