"""Value Change Dump as the emulator writes it: 1-bit wires, read into arrays, cut to windows, written again.

Times are simulated nanoseconds since power-on; the file's unit (10 ns unless asked otherwise) is the resolution.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]

_SCALE_NS = {"ns": 1, "us": 1_000, "ms": 1_000_000, "s": 1_000_000_000}


@dataclass(frozen=True, slots=True)
class Wire:
    """Level (n) of a line from t_ns (n) on; the first entry is the level at the start of the recording."""

    t_ns: Ints
    level: NDArray[np.uint8]

    def at(self, t_ns: Ints | int) -> NDArray[np.uint8]:
        """Level at each instant, an edge at that very instant included."""
        i = np.searchsorted(self.t_ns, t_ns, "right") - 1
        return np.asarray(self.level[np.maximum(i, 0)], np.uint8)

    def edges_ns(self, level: int) -> Ints:
        """Instants at which the line went to this level."""
        t_ns: Ints = self.t_ns[1:][self.level[1:] == level]
        return t_ns


@dataclass(frozen=True, slots=True)
class Vcd:
    """A recording: unit_ns of the file, first and last instant, wires by name in the file's order."""

    unit_ns: int
    start_ns: int
    end_ns: int
    wires: dict[str, Wire]

    def edges(self, names: Sequence[str], start_ns: int, end_ns: int) -> list[tuple[int, str, int]]:
        """(t_ns, name, level) of every change in start_ns < t <= end_ns, in order of time, then of names."""
        found = [
            (int(t), i, int(v))
            for i, name in enumerate(names)
            for t, v in zip(self.wires[name].t_ns, self.wires[name].level, strict=True)
            if start_ns < t <= end_ns
        ]
        return [(t, names[i], v) for t, i, v in sorted(found, key=lambda e: e[:2])]

    def window(self, names: Sequence[str], start_ns: int, end_ns: int) -> str:
        """A VCD file of some wires between two instants, closed one unit after the window at the earliest."""
        return "".join(self._window_lines(names, start_ns, end_ns))

    def _window_lines(self, names: Sequence[str], start_ns: int, end_ns: int) -> Iterator[str]:
        code = {name: chr(ord("!") + i) for i, name in enumerate(names)}
        yield f"$version psabench $end\n$timescale {scale_name(self.unit_ns)} $end\n$scope module psa2 $end\n"
        for name in names:
            yield f"$var wire 1 {code[name]} {name} $end\n"
        yield f"$upscope $end\n$enddefinitions $end\n#{start_ns // self.unit_ns}\n$dumpvars\n"
        for name in names:
            yield f"{int(self.wires[name].at(start_ns))}{code[name]}\n"
        yield "$end\n"
        last_ns = start_ns
        for t_ns, name, level in self.edges(names, start_ns, end_ns):
            if t_ns != last_ns:
                yield f"#{t_ns // self.unit_ns}\n"
            last_ns = t_ns
            yield f"{level}{code[name]}\n"
        yield f"#{max(end_ns, last_ns + self.unit_ns) // self.unit_ns}\n"


def scale_name(unit_ns: int) -> str:
    """The file's unit as VCD writes it. Raises ValueError for what is no unit of VCD."""
    for name, ns in _SCALE_NS.items():
        for factor in (1, 10, 100):
            if unit_ns == factor * ns:
                return f"{factor} {name}"
    raise ValueError(f"{unit_ns} ns is no VCD time unit; 1, 10 or 100 of ns, us, ms or s is")


def read_vcd(path: Path) -> Vcd:
    """Reads a file of 1-bit wires. Raises OSError, or ValueError with the place of what is not understood."""
    return parse_vcd(path.read_text(encoding="ascii"), str(path))


def parse_vcd(text: str, name: str = "VCD") -> Vcd:
    """As `read_vcd`, from text; name stands in error messages."""
    head, found, body = text.partition("$enddefinitions $end")
    scale = re.search(r"\$timescale\s+(1|10|100)\s*(ns|us|ms|s)\s+\$end", head)
    if not found or not scale:
        raise ValueError(f"{name}: no $timescale in ns..s, or no $enddefinitions: not a VCD of ours")
    unit_ns = int(scale[1]) * _SCALE_NS[scale[2]]
    code = {m[1]: m[2] for m in re.finditer(r"\$var wire 1 (\S+) (\S+) \$end", head)}
    t_units: dict[str, list[int]] = {c: [] for c in code}
    levels: dict[str, list[int]] = {c: [] for c in code}
    start = now = -1
    for token in body.split():
        if token[0] == "#":
            if not token[1:].isdecimal():
                raise ValueError(f"{name}: '{token}' is no time")
            now = int(token[1:])
            start = now if start < 0 else start
        elif token[0] in "01" and token[1:] in code:
            t_units[token[1:]].append(now)
            levels[token[1:]].append(int(token[0]))
        elif token not in ("$dumpvars", "$end"):
            raise ValueError(f"{name}: at #{now}: '{token}' is neither a time nor a level of a 1-bit wire")
    wires = {
        code[c]: Wire(np.array(t_units[c], np.int64) * unit_ns, np.array(levels[c], np.uint8))
        for c in code
        if levels[c]
    }
    return Vcd(unit_ns, start * unit_ns, now * unit_ns, wires)
