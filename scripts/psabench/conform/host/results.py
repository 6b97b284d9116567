"""The results channel: what a host tells, one JSON object a line (docs/conform_host.md). Any bytes give a `Told`.

A line that is none of the protocol's is a finding, never an exception, and memory stays bounded.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

MOST_LINES = 2_000_000
MOST_BYTES = 512  # of a line
MOST_BAD = 20  # that are kept; the others are counted


def _is_number(v: Any) -> bool:
    return type(v) is int and abs(v) < 1 << 63


def _is_count(v: Any) -> bool:
    return _is_number(v) and v > 0


def _is_axis(v: Any) -> bool:
    return v in ("x", "y", "z")


def _is_text(v: Any) -> bool:
    return isinstance(v, str) and v != ""


# What a host can tell beside frames; docs/conform_host.md has the same table.
EVENTS: Mapping[str, Callable[[Any], bool]] = {
    "lost": _is_count,
    "torn": _is_count,
    "overrun": _is_count,
    "late": _is_count,
    "mixed": _is_count,
    "over_range": _is_axis,
    "in_range": _is_axis,
    "restart": lambda v: v is True,
    "stale": lambda v: type(v) is bool,
    "frozen": lambda v: type(v) is bool,
    "gone": lambda v: v is True,
    "wrong_setup": _is_text,
    "emcy": lambda v: _is_number(v) and 0 <= v <= 0xFFFF,
    "rate_ppm": _is_number,
    "end": lambda v: v is True,
}
WORDS = ("x", "y", "z", "t")  # codes, or words of the line; signed


@dataclass(frozen=True, slots=True)
class Sample:
    """A frame as the host tells it. number: SEQ on CAN, its own count on the line."""

    number: int
    codes: tuple[int, int, int, int]  # x, y, z, t
    t_us: float
    channel: int = -1  # of the temperature; -1: not told
    status: int = -1
    volts: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Reading:
    """Of a board that is none of PSA-2's family, as the host tells it. number: CNT or SEQ of the board."""

    number: int
    values: tuple[float, float, float]  # words, pulses or volt seconds, docs/conform_host.md


@dataclass(frozen=True, slots=True)
class Event:
    """Anything else. at: number of samples and readings that were reported before it."""

    name: str
    value: Any
    at: int


@dataclass(slots=True)
class Told:
    """All that a host has told, in order."""

    samples: list[Sample] = field(default_factory=list)
    readings: list[Reading] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    bad: list[str] = field(default_factory=list)
    bad_lines: int = 0

    @property
    def count(self) -> int:
        """Samples and readings."""
        return len(self.samples) + len(self.readings)

    def of(self, name: str) -> list[Any]:
        """Values of the events of that name."""
        return [e.value for e in self.events if e.name == name]

    def places(self, name: str) -> list[int]:
        """How many samples had been told before each event of that name."""
        return [e.at for e in self.events if e.name == name]

    def sum(self, name: str) -> int:
        return sum(self.of(name))

    def by_place(self, name: str) -> dict[int, int]:
        """Sums by the number of samples that had been told before."""
        found: Counter[int] = Counter()
        for e in self.events:
            if e.name == name:
                found[e.at] += e.value
        return dict(found)

    def _refuse(self, line: bytes, why: str) -> None:
        self.bad_lines += 1
        if len(self.bad) < MOST_BAD:
            self.bad.append(f"{line[:60]!r}: {why}")


def read(lines: Iterable[bytes]) -> Told:
    """Everything that is there; the last line may be without its end."""
    told = Told()
    for count, line in enumerate(lines):
        if count >= MOST_LINES:
            told._refuse(b"", f"more than {MOST_LINES} lines")
            break
        text = line.strip()
        if text:
            _take(told, text)
    return told


def _take(told: Told, text: bytes) -> None:
    if len(text) > MOST_BYTES:
        told._refuse(text, f"longer than {MOST_BYTES} bytes")
        return
    try:
        raw = json.loads(text)
    except (ValueError, RecursionError):
        told._refuse(text, "no JSON")
        return
    if not isinstance(raw, dict) or not raw:
        told._refuse(text, "no object")
    elif "note" in raw:
        pass
    elif "frame" in raw:
        _take_sample(told, raw, text)
    elif "reading" in raw:
        _take_reading(told, raw, text)
    else:
        name, value = next(iter(raw.items()))
        if len(raw) != 1 or name not in EVENTS:
            told._refuse(text, "no such word; docs/conform_host.md has them")
        elif not EVENTS[name](value):
            told._refuse(text, f"not a value of {name}")
        else:
            told.events.append(Event(name, value, told.count))


def _take_sample(told: Told, raw: Mapping[str, Any], text: bytes) -> None:
    whole = [raw.get(k) for k in ("frame", *WORDS)]
    t_us, volts = raw.get("t_us"), raw.get("v")
    options = [raw.get(k, -1) for k in ("channel", "status")]
    if not all(map(_is_number, whole + options)):
        told._refuse(text, "frame, x, y, z, t are whole numbers, and so are channel and status")
    elif type(t_us) not in (int, float) or not abs(t_us) < 1e18:  # type: ignore[arg-type]
        told._refuse(text, "t_us is a number")
    elif volts is not None and not _are_volts(volts):
        told._refuse(text, "v is a list of three numbers")
    else:
        number, x, y, z, t = (int(v) for v in whole)  # type: ignore[arg-type]
        told.samples.append(
            Sample(
                number=number,
                codes=(x, y, z, t),
                t_us=float(t_us),  # type: ignore[arg-type]
                channel=options[0],
                status=options[1],
                volts=None if volts is None else (float(volts[0]), float(volts[1]), float(volts[2])),
            )
        )


def _take_reading(told: Told, raw: Mapping[str, Any], text: bytes) -> None:
    number, values = raw["reading"], [raw.get(axis) for axis in "xyz"]
    if not _is_number(number) or not all(isinstance(v, int | float) and abs(v) < 1e18 for v in values):
        told._refuse(text, "reading is a whole number, x, y and z are numbers")
    else:
        x, y, z = (float(v) for v in values)  # type: ignore[arg-type]
        told.readings.append(Reading(number, (x, y, z)))


def _are_volts(v: Any) -> bool:
    return isinstance(v, list) and len(v) == 3 and all(type(u) in (int, float) and abs(u) < 1e6 for u in v)
