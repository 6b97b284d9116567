"""What may be said: the commands, from the bench's own table and from the shell's, with their arguments."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Any


class Kind(Enum):
    """What an argument is."""

    REAL = "number"
    COUNT = "integer"
    BOOL = "on or off"
    TEXT = "text"
    CHOICE = "choice"
    REALS = "numbers"
    REST = "the rest of the line"


@dataclass(frozen=True, slots=True, kw_only=True)
class Arg:
    """One argument; low and high, both included, are of numbers."""

    name: str
    kind: Kind = Kind.TEXT
    unit: str = ""
    optional: bool = False
    low: float = -math.inf
    high: float = math.inf
    least: float = 0.0  # magnitude of what is not 0 and changes anything
    choices: tuple[str, ...] = ()
    strict: bool = True  # nothing but one of the choices; False: they are offered, the bench decides
    offered: tuple[str, ...] | None = None  # of the choices, what is reported and completed now; None: all of them
    what: str = ""

    @property
    def offers(self) -> tuple[str, ...]:
        """Choices that are of use now."""
        return self.choices if self.offered is None else self.offered

    @property
    def range(self) -> str:
        """ "deg/s, -100 to 100": unit and range, or the choices; "" if there is nothing to say."""
        if self.choices:
            return ", ".join(self.offers)
        limits = "" if math.isinf(self.low) and math.isinf(self.high) else f"{self.low:.10g} to {self.high:.10g}"
        if self.least:
            limits = f"{self.low:.10g} to {-self.least:.10g} and {self.least:.10g} to {self.high:.10g}"
        return ", ".join(x for x in (self.unit, limits) if x)


@dataclass(frozen=True, slots=True, kw_only=True)
class Command:
    """wire: its name in the bench's table; "": the shell's own.

    variants: what it is for a value of its first argument: each kind of fault takes arguments of its own.
    """

    name: str
    what: str
    args: tuple[Arg, ...] = ()
    wire: str = ""
    variants: Mapping[str, Command] = field(default_factory=dict)

    def arg(self, name: str) -> Arg | None:
        return next((a for a in self.args if a.name == name), None)

    def variant(self, words: Sequence[str]) -> Command:
        """The command that these words, raw and without its name, choose."""
        if not self.variants:
            return self
        first = self.args[0].name
        named = next((w.partition("=")[2] for w in words if w.startswith(f"{first}=")), None)
        plain = next((w for w in words[:1] if "=" not in w), "")
        return self.variants.get(plain if named is None else named, self)

    @property
    def usage(self) -> str:
        """`table.rate axis rate_dps [limit_s]`."""
        return " ".join([self.name, *(f"[{a.name}]" if a.optional else a.name for a in self.args)])


@dataclass(frozen=True, slots=True)
class Vocabulary:
    """All commands by name, and the objects that are not here: name and why."""

    commands: Mapping[str, Command]
    absent: Mapping[str, str] = field(default_factory=dict)

    def in_shell(self, text: str) -> str:
        """The bench's words, with its commands under the names that they have here: faults.points, not fault.points."""
        wires = {c.wire: c.name for c in self.commands.values() if "." in c.wire and c.wire != c.name}
        for wire, name in wires.items():
            text = re.sub(rf"(?<![\w.]){re.escape(wire)}(?!\w)", name, text)
        return text

    def nearest(self, name: str) -> list[str]:
        """Up to three names that somebody may have meant."""
        near = difflib.get_close_matches(name, self.commands, 3, 0.6)
        return near or [c for c in self.commands if name and name in c.split(".")][:3]


OBJECTS: Mapping[str, str] = {
    "dut": "the device: registers, stream, counters, over CAN",
    "bus": "the parallel bus of a board, cycle by cycle, by the emulator",
    "table": "the rate table",
    "head": "the dividing head",
    "chamber": "the thermal chamber",
    "supply": "the power supply",
    "probe": "the lines of a board: levels, VCD",
    "faults": "faults: kinds, points, add, list, clear",
    "can": "CAN frames as they are",
    "scpi": "SCPI lines as they are",
    "bench": "the bench as a whole: counters, units, snapshot",
}

# Events of a PSA-2, where no emulator tells those of its boards; offered, the bench decides.
EVENTS = ("RES", "SETUP_DONE", "SYNC_A", "SYNC_T", "DRD_A", "DRD_T", "INT_FALL", "INT_RISE", "POWER_DOWN", "POWER_UP")

# Arguments of a fault of any kind: when it comes, and for how long.
WHEN = ("at_s", "after", "count", "since", "unit", "delay_s", "for_s")

# Names of the bench's table that an object of the shell has; others keep theirs.
_BENCH = ("counters", "endpoints", "frames", "quit", "snapshot", "fork", "units")
_NAMES = {name: f"bench.{name}" for name in _BENCH} | {
    "lines": "probe.lines",
    "unit.reset": "bench.reset",
}
_PREFIXES = {"vcd.": "probe.", "fault.": "faults."}
# The shell's own commands stand for these, or they make no sense here: the status bar subscribes.
_HIDDEN = {"help", "run", "run.until", "time", "subscribe", "unsubscribe"}
_KINDS = {"number": Kind.REAL, "integer": Kind.COUNT, "boolean": Kind.BOOL, "bool": Kind.BOOL, "numbers": Kind.REALS}


def shell_name(wire: str) -> str:
    """What the shell calls a command of the bench's table."""
    for prefix, mine in _PREFIXES.items():
        if wire.startswith(prefix):
            return mine + wire.removeprefix(prefix)
    return _NAMES.get(wire, wire)


def from_help(rows: Iterable[Mapping[str, Any]], choices: Mapping[tuple[str, str], tuple[str, ...]]) -> list[Command]:
    """Commands from the reply to `help`. choices: what this bench has for an argument: its units, fault points."""
    commands = []
    for row in rows:
        wire = str(row["name"])
        if wire in _HIDDEN:
            continue
        args = tuple(_arg(a, choices.get((wire, str(a["name"])), ()), choices) for a in row["args"])
        commands.append(Command(name=shell_name(wire), what=str(row["what"]), args=args, wire=wire))
    return commands


def _arg(row: Mapping[str, Any], here: tuple[str, ...], choices: Mapping[tuple[str, str], tuple[str, ...]]) -> Arg:
    kind = _KINDS.get(str(row["type"]), Kind.TEXT)
    named = tuple(str(c) for c in row.get("choices", ())) or (
        choices.get(("", "unit"), ()) if row["type"] == "unit" else ()
    )
    return Arg(
        name=str(row["name"]),
        kind=Kind.CHOICE if named and kind is Kind.TEXT else kind,
        unit=str(row.get("unit") or ""),
        optional=bool(row.get("optional")),
        low=float(row["min"]) if "min" in row else -math.inf,
        high=float(row["max"]) if "max" in row else math.inf,
        least=float(row.get("least", 0.0)),
        choices=named or here,
        strict=bool(named),
        what=str(row.get("what", "")),
    )


def with_events(until: Command, events: tuple[str, ...]) -> Command:
    """`until` with the events that there are."""
    args = tuple(replace(a, choices=events) if a.name == "event" else a for a in until.args)
    return replace(until, args=args)


def with_kinds(add: Command, kinds: Sequence[Mapping[str, Any]], points: Sequence[str]) -> Command:
    """`faults.add` with a variant for each kind of fault: its own points and arguments, needed or not."""
    kind, point, *others = add.args
    names = tuple(str(k["kind"]) for k in kinds)
    kind = replace(kind, kind=Kind.CHOICE, choices=names, strict=True)
    variants = {}
    for k in kinds:
        here = tuple(p for p in points if any(_is_at(p, place) for place in k["points"]))
        own = [_arg(a, (), {}) for a in k["args"]]
        common = [a for a in others if a.name in WHEN and a.name not in {o.name for o in own}]
        needed, optional = [a for a in own if not a.optional], [a for a in own if a.optional]
        args = (kind, replace(point, choices=here, strict=False), *needed, *common, *optional)
        variants[str(k["kind"])] = replace(add, what=str(k["what"]), args=args)
    return replace(add, args=(kind, replace(point, choices=tuple(points), strict=False), *others), variants=variants)


def _is_at(point: str, place: str) -> bool:
    """Whether a point is one of those of a place: a.sensor.y of UNIT.sensor.x|y|z."""
    steps, wanted = point.split("."), place.split(".")
    return len(steps) == len(wanted) and all(
        w in ("UNIT", "NAME", "N") or s in w.split("|") for s, w in zip(steps, wanted, strict=True)
    )
