"""CAN frames as LCM messages: the channels PSABENCH_CAN_<bus>, type can_frame_t."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import can

from psabench.errors import BadInput, expected
from psabench.lcm.event_log import read_events
from psabench.lcm.types import lcm_type

FRAMES = "PSABENCH_CAN_"  # channels; the name of the bus follows
TYPE = "can_frame_t"
BYTES = 64  # of an FD frame


def read_frames(path: Path, bus: str | None = None) -> Iterator[can.Message]:
    """CAN frames of an LCM log in its order; stamps: seconds since the UNIX epoch, channel: the bus.

    bus: of this one alone. Events of other types are passed over. Raises BadInput for a log that cannot be read or is
    damaged, after the frames before the damage.
    """
    kind = lcm_type(TYPE)
    for count, e in enumerate(read_events(path), start=1):
        if not e.data.startswith(kind.fingerprint):
            continue
        try:
            message = to_message(e.values)
        except ValueError as error:
            raise BadInput(expected("a CAN frame", f"damaged bytes ({error})", f"{path}: event {count}")) from error
        if bus is None or message.channel == bus:
            yield message


def to_message(v: Mapping[str, Any]) -> can.Message:
    """A can_frame_t as a message of python-can. Raises ValueError for a frame that no bus can carry."""
    if not 0 <= v["length"] <= BYTES or v["size"] != (0 if v["remote"] else v["length"]):
        raise ValueError(expected(f"0 to {BYTES} bytes of data", f"{v['length']} and {v['size']}", TYPE))
    return can.Message(
        timestamp=(v["t_ns"] + v["epoch_ns"]) / 1e9,
        arbitration_id=v["id"],
        is_extended_id=v["extended"],
        is_remote_frame=v["remote"],
        is_error_frame=v["error"],
        is_fd=v["fd"],
        bitrate_switch=v["brs"],
        dlc=v["length"],
        data=None if v["remote"] else v["data"],
        channel=v["bus"],
        check=not v["error"],
    )


def to_values(m: can.Message, bus: str) -> dict[str, Any]:
    """A message of python-can as the fields of a can_frame_t; t_ns is its stamp, epoch_ns 0."""
    data = b"" if m.is_remote_frame else bytes(m.data)
    return {
        "t_ns": round(m.timestamp * 1e9),
        "epoch_ns": 0,
        "bus": bus,
        "id": m.arbitration_id,
        "extended": m.is_extended_id,
        "remote": m.is_remote_frame,
        "fd": m.is_fd,
        "brs": m.bitrate_switch,
        "error": m.is_error_frame,
        "length": m.dlc if m.is_remote_frame else len(data),
        "size": len(data),
        "data": data,
    }
