"""What MCAP and Foxglove carry: JSON records of frames and of decoded messages, with their JSON schemas. No I/O.

A raw record keeps the whole frame: `frame_of(raw_record(m))` equals `m`. A decoded record has the physical values of a
message of the DBC; each name ends with its unit: X_V, TSTAMP_s, U1_deg_per_h.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache
from typing import Any

import can

from psabench.errors import expected
from psabench.link.protocol_files import dbc_node, message, message_name

RAW_TOPIC = "/can_raw"
RAW_NAME = "can_frame"
MOST_DATA = 64  # bytes of a frame
MOST_S = 1.8e10  # of a time stamp: nanoseconds are unsigned, of 64 bits
BITS: Mapping[str, str] = {  # name in the record: name in python-can
    "extended": "is_extended_id",
    "remote": "is_remote_frame",
    "error": "is_error_frame",
    "fd": "is_fd",
    "brs": "bitrate_switch",
    "esi": "error_state_indicator",
    "rx": "is_rx",
}
RAW_SCHEMA: Mapping[str, Any] = {
    "title": RAW_NAME,
    "type": "object",
    "properties": {
        "timestamp_s": {"type": "number", "description": "time stamp of the link or of the log, in seconds"},
        "id": {"type": "integer", "description": "identifier, 11 or 29 bits"},
        "dlc": {"type": "integer", "description": "length in bytes; of a remote frame: the length asked for"},
        "data": {"type": "string", "description": "data bytes, hexadecimal, in the order of the bus"},
        **{name: {"type": "boolean"} for name in BITS},
        "channel": {"type": "string", "description": "channel, where it has a name"},
        "channel_index": {"type": "integer", "description": "channel, where it is a number"},
    },
    "required": ["timestamp_s", "id", "dlc", "data", *BITS],
}


def raw_record(m: can.Message) -> dict[str, Any]:
    """All that a frame has."""
    record: dict[str, Any] = {
        "timestamp_s": m.timestamp,
        "id": m.arbitration_id,
        "dlc": m.dlc,
        "data": m.data.hex(),
        **{name: bool(getattr(m, attribute)) for name, attribute in BITS.items()},
    }
    if m.channel is not None:
        record["channel_index" if isinstance(m.channel, int) else "channel"] = m.channel
    return record


def frame_of(record: object) -> can.Message:
    """The frame of a raw record. Raises ValueError for anything else."""
    if not isinstance(record, dict):
        raise ValueError(expected("a raw record", type(record).__name__))
    t_s: Any = record.get("timestamp_s")
    data: Any = record.get("data")
    if type(t_s) not in (float, int) or not math.isfinite(t_s) or abs(t_s) > MOST_S:
        raise ValueError(expected(f"timestamp_s, a number up to {MOST_S:g}", repr(t_s)[:40]))
    if not isinstance(data, str) or len(data) > 2 * MOST_DATA:
        raise ValueError(expected(f"data, up to {MOST_DATA} bytes in hexadecimal", repr(data)[:40]))
    numbers: list[Any] = [record.get(name) for name in ("id", "dlc")]
    if any(type(n) is not int for n in numbers):
        raise ValueError(expected("id and dlc, two integers", str(numbers)[:40]))
    bits: dict[str, Any] = {attribute: record.get(name) for name, attribute in BITS.items()}
    if any(type(b) is not bool for b in bits.values()):
        raise ValueError(expected(f"true or false for {', '.join(BITS)}", str(list(bits.values()))[:60]))
    channel: Any = record.get("channel_index", record.get("channel"))
    if channel is not None and type(channel) not in (int, str):
        raise ValueError(expected("a channel, a name or a number", repr(channel)[:40]))
    m = can.Message(
        arbitration_id=numbers[0],
        dlc=numbers[1],
        data=bytes.fromhex(data),
        channel=channel,
        check=True,
        **bits,
    )
    m.timestamp = float(t_s)  # which python-can's check would not let be negative
    return m


def stamp_ns(t_s: float) -> int:
    """Nanoseconds, as logs count them: unsigned; a stamp before zero counts as zero. Exact for the stamp's digits."""
    whole_s = math.floor(t_s)
    return max(0, min(whole_s, int(MOST_S)) * 1_000_000_000 + round((t_s - whole_s) * 1e9))


def default_boards() -> dict[int, str]:
    """Boards by node, as the DBC has them."""
    from psabench.boards.registry import BOARDS

    return {dbc_node(board): board for board in BOARDS}


class Decoder:
    """Frames to topics and decoded records. boards: by node, as they are on this bus."""

    def __init__(self, boards: Mapping[int, str] | None = None) -> None:
        self.boards = {**default_boards(), **(boards or {})}
        self._known: dict[int, tuple[str, str]] = {}  # topic and name by identifier

    def topic(self, m: can.Message) -> tuple[str, str]:
        """Topic and message name of a frame; ("", "") for one that the DBC does not have."""
        if m.is_extended_id or m.is_remote_frame or m.is_error_frame:
            return "", ""
        if m.arbitration_id not in self._known:
            name = message_name(m.arbitration_id, self.boards)
            node = m.arbitration_id & 0x7F
            broadcast = name in ("NMT", "SYNC")
            topic = f"/{name}" if broadcast else f"/node{node}/{name}"
            self._known[m.arbitration_id] = (topic, name) if name else ("", "")
        return self._known[m.arbitration_id]

    def decoded(self, m: can.Message) -> tuple[str, str, dict[str, Any]] | None:
        """Topic, name and physical values; None for what is not in the DBC, or shorter than it says."""
        topic, name = self.topic(m)
        if not name or len(m.data) < message(name).length:
            return None
        values = message(name).decode(bytes(m.data), decode_choices=False)
        names = columns(name)
        return topic, name, {names[signal]: value for signal, value in values.items()}


@cache
def columns(name: str) -> dict[str, str]:
    """Names of a message's values in its records, units included, by its signals' names."""
    return {str(s.name): "_".join(filter(None, (s.name, unit_word(s.unit)))) for s in message(name).signals}


def unit_word(unit: str | None) -> str:
    """A unit as part of a name: deg/h is deg_per_h."""
    return (unit or "").replace("/", "_per_")


@cache
def schema(name: str) -> dict[str, Any]:
    """JSON schema of a message's decoded records."""
    names = columns(name)
    return {
        "title": name,
        "type": "object",
        "description": message(name).comment or "",
        "properties": {names[s.name]: _schema_property(s) for s in message(name).signals},
        "required": list(names.values()),
    }


def _schema_property(s: Any) -> dict[str, Any]:
    texts = [s.comment or "", f"unit: {s.unit}" if s.unit else ""]
    choices = ", ".join(f"{k} {v}" for k, v in (s.choices or {}).items())
    return {
        "type": "integer" if s.scale == 1 and s.offset == 0 and not s.is_float else "number",
        "description": "; ".join(filter(None, (*texts, choices))),
    }


@cache
def units(name: str) -> dict[str, str]:
    """Units of a message's values, by their names in its records; "" for bare numbers."""
    names = columns(name)
    return {names[s.name]: s.unit or "" for s in message(name).signals}
