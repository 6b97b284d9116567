"""Messages of a reading: order, length, bits without a signal; the first messages after Res."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise

from psabench.conform.capture.log import CanFrame, CanLog, Capture
from psabench.conform.verdict import Failed, Inconclusive, conclusive, damaged_data_are, expect
from psabench.link.protocol_files import message
from psabench.link.signals import Ints

EMCY_BYTES = 8


def in_turn(e: Capture, names: Sequence[str]) -> str:
    """The messages of each reading follow one another in this order. Returns what was seen."""
    ids = {e.frames_of(n).frames[0].can_id: k for k, n in enumerate(names) if len(e.frames_of(n))}
    conclusive(ids, f"none of the messages {', '.join(names)} came")
    expect(len(ids) >= len(names), f"{len(ids)} of the messages {', '.join(names)}", f"all {len(names)}")
    order = [(ids[f.can_id], f) for f in e.can.frames if f.can_id in ids and not f.sent]
    for (a, _), (b, f) in pairwise(order):
        if b != (a + 1) % len(names):
            raise Failed(f"{names[b]} after {names[a]}", f"{', '.join(names)} in turn", frames=(f,))
    return f"{len(order)} messages in turn"


def as_laid_out(e: Capture, names: Sequence[str]) -> str:
    """Each message has its length, and 0 in the bits that no signal has. Returns what was seen."""
    for name in names:
        log, due, used = e.frames_of(name), int(message(name).length), 0
        conclusive(len(log), f"no {name} came")
        for s in message(name).signals:
            used |= ((1 << s.length) - 1) << s.start
        bad = [f for f in log.frames if len(f.data) != due or int.from_bytes(f.data, "little") & ~used]
        if bad:
            raise Failed(f"{name} {bad[0].data.hex(' ')}", f"{due} bytes, 0 in bits without a signal", frames=bad)
    return f"{', '.join(names)} as in the table"


def emergencies(e: Capture, name: str) -> list[tuple[int, float]]:
    """Codes, and the board's own instants, s, of the EMCY of this name."""
    whole = [f for f in e.frames_of(name).frames if len(f.data) == EMCY_BYTES]
    return [(int.from_bytes(f.data[:2], "little"), int.from_bytes(f.data[4:], "little") * 1e-6) for f in whole]


def booted(e: Capture, heartbeat: str) -> CanFrame:
    """The latest boot-up message. Raises Inconclusive where none came."""
    log = [f for f in e.frames_of(heartbeat).frames if f.data == b"\0"]
    conclusive(log, "no boot-up message came after Res")
    return log[-1]


def late_readings(e: Capture, heartbeat: str, name: str, first_s: float, period_s: float) -> int:
    """How many readings may have passed before the first that was reported, a host that starts it late being no fault.

    first_s: from Res to the first reading. The fact "prompt": the host was in time for it. Raises Inconclusive.
    """
    boot = booted(e, heartbeat)
    told = [f for f in e.frames_of(name).frames if f.t_s > boot.t_s]
    conclusive(told, f"no {name} came after the boot-up message")
    return 0 if e.facts.get("prompt") else max(0, round((told[0].t_s - boot.t_s - first_s) / period_s))


def reading_columns(e: Capture, messages: Sequence[str], least: int) -> Mapping[str, Ints]:
    """Raw signals of the whole readings of these messages. Raises Inconclusive where there are fewer than `least`."""
    logs = [e.frames_of(name) for name in messages]
    n = min(len(log) for log in logs)
    conclusive(n >= least, ", ".join(f"{len(log)} {name}" for log, name in zip(logs, messages, strict=True)))
    found: dict[str, Ints] = {}
    with damaged_data_are(Inconclusive):
        for name, log in zip(messages, logs, strict=True):
            found |= CanLog(frames=log.frames[:n]).raw(name)
    return found
