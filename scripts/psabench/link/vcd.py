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
    """As `read_vcd`, from text; name is in error messages."""
    head, found, body = text.partition("$enddefinitions $end")
    scale = re.search(r"\$timescale\s+(1|10|100)\s*(ns|us|ms|s)\s+\$end", head)
    if not found or not scale:
        raise ValueError(f"{name}: no $timescale in ns..s, or no $enddefinitions: not a VCD of ours")
    unit_ns = int(scale[1]) * _SCALE_NS[scale[2]]
    code = {m[1]: m[2] for m in re.finditer(r"\$var wire 1 (\S+) (\S+) \$end", head)}
    tokens = Tokens.of(body)
    wire = np.full(len(tokens), -1)
    levels = np.flatnonzero((tokens.first == ord("0")) | (tokens.first == ord("1")))
    if code:
        wire[levels] = tokens.looked_up(levels, list(code))
    hashes = np.flatnonzero(tokens.first == ord("#"))
    numbers = tokens.numbers(hashes)
    times = np.zeros(len(tokens), bool)
    times[hashes] = numbers >= 0
    tokens.refuse(~times & (wire < 0), times, name)
    t_units = numbers[numbers >= 0]
    now = np.cumsum(times)  # times so far, at each token
    since = np.concatenate((np.array([-1], np.int64), t_units))
    wires = {}
    for i, c in enumerate(code):
        mine = np.flatnonzero(wire == i)
        if len(mine):
            wires[code[c]] = Wire(since[now[mine]] * unit_ns, (tokens.first[mine] - ord("0")).astype(np.uint8))
    start, end = (int(t_units[0]), int(t_units[-1])) if len(t_units) else (-1, -1)
    return Vcd(unit_ns, start * unit_ns, end * unit_ns, wires)


_MOST_DIGITS = 18  # of a time: what 64 bits hold
_MOST_CODE = 8  # characters of a wire's code, in one 64-bit number


@dataclass(frozen=True, slots=True)
class Tokens:
    """The words of a file's body, by their places in its bytes: a million edges want no loop of Python's."""

    text: NDArray[np.uint8]
    begin: Ints
    end: Ints
    first: NDArray[np.uint8]  # byte of each

    @classmethod
    def of(cls, body: str) -> Tokens:
        text = np.frombuffer(body.encode(), np.uint8)
        blank = (text == 32) | ((text >= 9) & (text <= 13)) | ((text >= 28) & (text <= 31))  # as str.split has it
        edges = np.flatnonzero(np.diff(np.concatenate(([True], blank, [True])).view(np.int8)))
        begin, end = edges[::2].astype(np.int64), edges[1::2].astype(np.int64)
        return cls(text, begin, end, text[begin])

    def __len__(self) -> int:
        return len(self.begin)

    def word(self, i: int) -> str:
        return self.text[self.begin[i] : self.end[i]].tobytes().decode()

    def numbers(self, which: Ints) -> Ints:
        """What follows the first byte of these words as decimal numbers; -1: none that 64 bits hold."""
        begin, end = self.begin[which] + 1, self.end[which]
        size = end - begin
        good = (size > 0) & (size <= _MOST_DIGITS)
        value = np.zeros(len(which), np.int64)
        for k in range(min(int(size.max(initial=0)), _MOST_DIGITS)):  # from the last digit on
            digit = self.text[np.maximum(end - 1 - k, begin - 1)] - np.uint8(ord("0"))
            mine = size > k
            good &= ~mine | (digit <= 9)
            value += np.where(mine, digit, 0) * np.int64(10**k)
        return np.where(good, value, -1)

    def looked_up(self, which: Ints, codes: Sequence[str]) -> Ints:
        """Which of the codes follows the first byte of each of these words, -1: none."""
        begin, size = self.begin[which] + 1, self.end[which] - self.begin[which] - 1
        key = np.zeros(len(which), np.uint64)
        for k in range(min(int(size.max(initial=0)), _MOST_CODE)):
            more = size > k
            byte = self.text[begin[more] + k].astype(np.uint64)
            key[more] = key[more] << np.uint64(8) | byte
        keys = np.array([int.from_bytes(c.encode()[:_MOST_CODE], "big") for c in codes], np.uint64)
        order = np.argsort(keys)
        at = order[np.minimum(np.searchsorted(keys[order], key), len(codes) - 1)]
        same = (keys[at] == key) & (np.array([len(c) for c in codes])[at] == size)
        return np.where(same, at, -1)

    def refuse(self, strange: NDArray[np.bool_], times: NDArray[np.bool_], name: str) -> None:
        """Raises ValueError for the first of these that is none of the two words that may stand there."""
        for i in np.flatnonzero(strange):
            word = self.word(int(i))
            if word in ("$dumpvars", "$end"):
                continue
            if word[0] == "#":
                raise ValueError(f"{name}: '{word}' is no time")
            before = np.flatnonzero(times[:i])
            now = int(self.word(int(before[-1]))[1:]) if len(before) else -1
            raise ValueError(f"{name}: at #{now}: '{word}' is neither a time nor a level of a 1-bit wire")
