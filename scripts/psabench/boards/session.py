"""What a viewer shows of the lines of a board at first: the types of a row of its record (logs/sessions.py)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

GREEN, PURPLE, ORANGE = 0xFF32AA32, 0xFF8232AA, 0xFF8F5202  # alpha, red, green, blue


@dataclass(frozen=True, slots=True)
class Decoder:
    """A decoder of sigrok with what differs from its defaults; hidden: rows that are not shown."""

    id: str
    options: Mapping[str, str | int] = field(default_factory=dict)
    hidden: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Stack:
    """Decoders on top of each other, and the lines of the lowest one's channels, by their names."""

    name: str
    color: int
    decoders: tuple[Decoder, ...]
    channels: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """What the viewers of a board's recording show at first."""

    stacks: tuple[Stack, ...]
    from_ns: int  # where PulseView's window begins: a multiple of 10 ns
    scale: str  # seconds a pixel of it
    trace_height: int = 9
    comment: str  # of GTKWave, in two lines
    gtk_from_ns: int
    gtk_cursor_ns: int
    gtk_height: int = 760
    groups: Mapping[str, str]  # lines under a heading; "*": those of the parallel bus


def period_stack(name: str, color: int, line: str) -> Stack:
    """The time from each rise of a line to the next."""
    return Stack(name, color, (Decoder("timing", {"edge": "rising"}, hidden=(1, 2)),), {"Data": line})


def bus_stack(lines: Sequence[str]) -> Stack:
    """Cycles on a parallel bus."""
    return Stack("Bus", PURPLE, (Decoder("psabus"),), {line: line for line in lines})
