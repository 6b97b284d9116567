"""The CAN bus as the page shows it: the latest frames, and one row for each identifier, decoded by the DBC."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from psabench.link.can_host import Message
from psabench.link.protocol_files import message, message_name

LATEST = 24  # frames that are shown as they came
IDS = 256  # identifiers that have a row


@dataclass(slots=True)
class Row:
    """What there was of one identifier."""

    count: int = 0
    shown: int = 0  # of count, when its rate was computed last
    last: Message | None = None


@dataclass(slots=True)
class CanTrace:
    """Listens to one bus. boards: those on it by node."""

    bus: str
    boards: Mapping[int, str]
    rows: dict[int, Row] = field(default_factory=dict)
    latest: deque[Message] = field(default_factory=lambda: deque(maxlen=LATEST))
    frames: int = 0
    errors: int = 0

    def on_message(self, m: Message) -> None:
        """A frame of the bus; called for each, so it only keeps."""
        self.frames += 1
        self.latest.append(m)
        if m.is_error_frame:
            self.errors += 1
            return
        row = self.rows.get(m.arbitration_id)
        if row is None:
            if len(self.rows) >= IDS:
                return
            row = self.rows[m.arbitration_id] = Row()
        row.count += 1
        row.last = m

    def view(self, span_s: float) -> dict[str, Any]:
        """For the page; span_s: of the bench's time since the last view."""
        ids = []
        made: dict[int, dict[str, Any]] = {}  # most of the latest frames are the last of their identifier, too
        for can_id in sorted(self.rows):
            row = self.rows[can_id]
            rate = (row.count - row.shown) / span_s if span_s > 0 else None
            row.shown = row.count
            assert row.last is not None
            made[id(row.last)] = plain = self._row(row.last)
            ids.append(plain | {"count": row.count, "per_s": rate})
        frames = [made.get(id(m)) or self._row(m) for m in self.latest]
        return {"bus": self.bus, "frames": self.frames, "errors": self.errors, "ids": ids, "latest": frames}

    def _row(self, m: Message) -> dict[str, Any]:
        name = "error frame" if m.is_error_frame else message_name(m.arbitration_id, self.boards)
        return {
            "t_s": round(m.timestamp, 6),
            "id": f"{m.arbitration_id:03X}",
            "data": bytes(m.data).hex(" ").upper(),
            "name": name,
            "text": "" if m.is_error_frame or not name else decoded_text(name, bytes(m.data)),
        }


def decoded_text(name: str, data: bytes) -> str:
    """`X 2.49036 V, Y -3.6e-06 V`; "" where the frame is not as long as the DBC has it."""
    form = message(name)
    try:
        values = form.decode(data, decode_choices=True, allow_truncated=False)
    except Exception:  # cantools and bitstruct raise kinds of their own for a frame that does not fit
        return ""
    units = {s.name: s.unit or "" for s in form.signals}
    return ", ".join(f"{k} {_value_text(v)} {units.get(k, '')}".rstrip() for k, v in values.items())


def _value_text(v: object) -> str:
    return f"{v:.6g}" if isinstance(v, float) else str(v)
