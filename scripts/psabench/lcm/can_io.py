"""LCM event logs as python-can reads and writes logs: `can_logconvert run.lcmlog run.blf`.

pyproject.toml registers both with python-can, so that its own tools (can_logconvert, can_player, can_logger) know the
ending .lcmlog where psabench is installed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import can
from can.io.generic import MessageReader, MessageWriter

from psabench.lcm.event_log import put_event
from psabench.lcm.frames import FRAMES, TYPE, read_frames, to_values
from psabench.lcm.types import lcm_type

BUS_MAX = 15  # characters of a bus's name
DEFAULT_BUS = "can0"


class LcmReader(MessageReader):
    """CAN frames of an event log; other events are passed over. Raises BadInput where the log is damaged."""

    def __init__(self, file: Any, **_: Any) -> None:
        self._path = Path(file)

    def __iter__(self) -> Iterator[can.Message]:
        return read_frames(self._path)

    def stop(self) -> None:
        """Nothing is open between two messages."""


class LcmWriter(MessageWriter):
    """Frames as events on the channels PSABENCH_CAN_<bus>; bus: the message's channel."""

    def __init__(self, file: Any, **_: Any) -> None:
        self.file: BinaryIO = file if hasattr(file, "write") else Path(file).open("wb")  # noqa: SIM115 (until stop)
        self.count = self.size = 0  # events, and their bytes

    def on_message_received(self, msg: can.Message) -> None:
        bus = bus_name(msg.channel)
        data = lcm_type(TYPE).encode(to_values(msg, bus))
        event = put_event(self.count, round(msg.timestamp * 1e6), FRAMES + bus, data)
        self.file.write(event)
        self.count += 1
        self.size += len(event)

    def stop(self) -> None:
        self.file.close()


def bus_name(channel: object) -> str:
    """A name of a bus that fits into one of a channel."""
    return re.sub(r"\W", "_", str(channel or DEFAULT_BUS))[-BUS_MAX:]
