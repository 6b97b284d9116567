"""LCM event logs: what lcm-logger writes and lcm-logplayer reads.

Format: https://lcm-proj.github.io/lcm/content/log-file-format.html. An event is a header of 28 bytes (sync word,
number, time in us since the UNIX epoch, length of channel and data; big-endian), its channel and its data.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import IO, Any

from psabench.errors import BadInput, expected, input_error
from psabench.lcm.types import LcmType, type_of

SYNC = 0xEDA1DA01
HEADER = struct.Struct(">IqqII")
CHANNEL_MAX = 63  # LCM_MAX_CHANNEL_NAME_LENGTH
DATA_MAX = 1 << 28  # LCM_MAX_MESSAGE_SIZE
ENDING = ".lcmlog"  # of file names


@dataclass(frozen=True, kw_only=True)
class Event:
    """One message of a log."""

    number: int
    t_us: int  # since the UNIX epoch; in logs of psa-emu: simulated time plus --epoch
    channel: str
    data: bytes

    @property
    def type(self) -> LcmType | None:
        """Its type; None: none of proto/lcm."""
        return type_of(self.data)

    @cached_property
    def values(self) -> dict[str, Any]:
        """Its fields by name. Raises ValueError for a message that is damaged or of a type that is not in proto/lcm."""
        kind = self.type
        if kind is None:
            raise ValueError(expected("a type of proto/lcm", self.data[:8].hex(), self.channel))
        return kind.decode(self.data)


def read_events(path: Path) -> Iterator[Event]:
    """All events of a log, in its order. Raises BadInput for a file that cannot be read and where it is damaged."""
    try:
        with path.open("rb") as file:
            yield from _all_events(file, path)
    except OSError as e:
        raise input_error(path, "an LCM log", e) from e


def _all_events(file: IO[bytes], path: Path) -> Iterator[Event]:
    count = 0
    while header := file.read(HEADER.size):
        event = _next_event(header, file)
        if event is None:
            got = f"damaged bytes; the {count} events before them are good" if count else "other bytes"
            raise BadInput(expected("an event of an LCM log", got, f"{path}: event {count + 1}"))
        count += 1
        yield event


def _next_event(header: bytes, file: IO[bytes]) -> Event | None:
    if len(header) < HEADER.size:
        return None
    sync, number, t_us, channel_size, size = HEADER.unpack(header)
    if sync != SYNC or not 0 < channel_size <= CHANNEL_MAX or size > DATA_MAX:
        return None
    channel, data = file.read(channel_size), file.read(size)
    if len(data) < size:
        return None
    return Event(number=number, t_us=t_us, channel=channel.decode("utf-8", "replace"), data=data)


def put_event(number: int, t_us: int, channel: str, data: bytes) -> bytes:
    """The bytes of an event. Raises ValueError for a channel name that LCM has no room for."""
    name = channel.encode("utf-8")
    if not 0 < len(name) <= CHANNEL_MAX:
        raise ValueError(expected(f"a channel name of 1 to {CHANNEL_MAX} bytes", repr(channel)))
    return HEADER.pack(SYNC, number, t_us, len(name), len(data)) + name + data
