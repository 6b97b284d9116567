"""What a host may send, well and badly behaved: a few frames at a time, drawn at random. Pure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from random import Random

SDO_RX, SYNC, NODES = 0x600, 0x080, 127
READ, WRITE, SEGMENTED, ABORT = 0x40, 0x23, 0x21, 0x80
NMT = (0x01, 0x02, 0x80, 0x81, 0x82)
BURST = 40  # frames of a burst; an emulator takes 128 while its time stands still
EDGES = (0, 1, 2, 3, 0x7F, 0x80, 0xFF, 0x7FFF, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFF)


@dataclass(frozen=True, slots=True)
class Entry:
    """An object of the dictionary; bytes 0: characters."""

    index: int
    sub: int
    bytes: int
    access: str  # const, ro, wo, rw


Frames = Callable[[Random, int, Sequence[Entry]], list[str]]


def frame_text(can_id: int, data: bytes) -> str:
    """As can-utils write a frame."""
    return f"{can_id:03X}#{data.hex().upper()}"


def drawn_frames(rng: Random, node: int, entries: Sequence[Entry]) -> list[str]:
    """One thing that a host does: the frames of it, in order."""
    return rng.choices(list(KINDS), list(KINDS.values()))[0](rng, node, entries)


def _draw_nmt(rng: Random, node: int, _: Sequence[Entry]) -> list[str]:
    whom = rng.choice((node, node, 0, rng.randint(1, NODES)))
    command = rng.choice(NMT) if rng.random() < 0.9 else rng.randrange(256)
    return [frame_text(0, bytes([command, whom]))]


def _draw_syncs(rng: Random, _: int, __: Sequence[Entry]) -> list[str]:
    return [frame_text(SYNC, bytes([rng.randrange(256)] if rng.random() < 0.2 else []))] * rng.choice((1, 1, 2, 5))


def _sdo_frame(node: int, data: bytes) -> str:
    return frame_text(SDO_RX + node, data)


def _object_bytes(entry: Entry) -> bytes:
    return entry.index.to_bytes(2, "little") + bytes([entry.sub])


def _draw_read(rng: Random, node: int, entries: Sequence[Entry]) -> list[str]:
    return [_sdo_frame(node, bytes([READ]) + _object_bytes(rng.choice(entries)) + bytes(4))]


def _draw_write(rng: Random, node: int, entries: Sequence[Entry]) -> list[str]:
    """A value at an edge or a small one, mostly of the right size."""
    entry = rng.choice([e for e in entries if "w" in e.access and e.bytes])
    size = entry.bytes if entry.bytes <= 4 and rng.random() < 0.9 else rng.randint(1, 4)
    value = (rng.choice(EDGES) if rng.random() < 0.6 else rng.getrandbits(32)) & ((1 << 8 * size) - 1)
    data = value.to_bytes(size, "little").ljust(4, b"\0")
    return [_sdo_frame(node, bytes([WRITE | (4 - size) << 2]) + _object_bytes(entry) + data)]


def _draw_segments(rng: Random, node: int, entries: Sequence[Entry]) -> list[str]:
    """A transfer in segments: of an object that need not have any, with toggle bits that need not be right."""
    long = [e for e in entries if not e.bytes or e.bytes > 4] or list(entries)
    command = rng.choice((READ, READ, SEGMENTED))
    begin = bytes([command]) + _object_bytes(rng.choice(long)) + bytes([rng.randrange(64), 0, 0, 0])
    toggles = [0x60, 0x70, 0x60, 0x70] if command == READ else [0x00, 0x10, 0x00, 0x11]
    if rng.random() < 0.3:
        rng.shuffle(toggles)
    segments = [bytes([t]).ljust(8, b"A") for t in toggles[: rng.randint(0, 4)]]
    return [_sdo_frame(node, data) for data in (begin, *segments)]


def _draw_abort(rng: Random, node: int, entries: Sequence[Entry]) -> list[str]:
    return [_sdo_frame(node, bytes([ABORT]) + _object_bytes(rng.choice(entries)) + bytes([0, 0, 0, 8]))]


def _draw_malformed(rng: Random, node: int, _: Sequence[Entry]) -> list[str]:
    return [_sdo_frame(node, rng.randbytes(rng.choice((0, 1, 4, 7, 8, 8, 8))))]


def _draw_garbage(rng: Random, _: int, __: Sequence[Entry]) -> list[str]:
    return [frame_text(rng.randrange(0x800), rng.randbytes(rng.randrange(9)))]


def _draw_burst(rng: Random, node: int, entries: Sequence[Entry]) -> list[str]:
    frame = rng.choice((_draw_read, _draw_write, _draw_syncs, _draw_garbage))(rng, node, entries)[:1]
    return frame * rng.randint(2, BURST)


KINDS: Mapping[Frames, float] = {
    _draw_nmt: 3,
    _draw_syncs: 2,
    _draw_read: 3,
    _draw_write: 5,
    _draw_segments: 2,
    _draw_abort: 1,
    _draw_malformed: 1,
    _draw_garbage: 1,
    _draw_burst: 1,
}
