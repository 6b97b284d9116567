"""Value Change Dump (IEEE 1364-2001, clause 18): 1-bit wires, read into arrays, cut to windows, written again.

`read_vcd` reads files of the emulator and raises at the first damage; `read_vcd_part` reads files of any tool (any
names, any unit down to 1 fs, scopes, vectors, x and z, which leave a line as it was) and keeps what came before it.
"""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from psabench.errors import expected

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Bits = NDArray[np.uint8]

BLOCK = 1 << 18  # bytes read together: 40 ms of work
MOST_EDGES = 40_000_000  # of one recording of lines: 0.4 GB
MOST_NS = 1 << 60  # of a time: 36 years
_MOST_HEAD = 1 << 22  # bytes before $enddefinitions
_MOST_REST = 1 << 24  # bytes without a time
_MOST_WIRES = 1024
_MOST_CODE = 8  # characters of a wire's code, in one 64-bit number
_MOST_DIGITS = 18  # of a time: what 64 bits hold
_FS = {"fs": 1, "ps": 10**3, "ns": 10**6, "us": 10**9, "ms": 10**12, "s": 10**15}
_FS_PER_NS = 10**6
_TIMESCALE = re.compile(r"\$timescale\s+(1|10|100)\s*(fs|ps|ns|us|ms|s)\s+\$end")
_NO_WIRE = ("real", "realtime", "string", "event")
_KEYWORDS = ("$dumpvars", "$dumpall", "$dumpon", "$dumpoff", "$end")
_VECTORS = np.frombuffer(b"bBrRsS", np.uint8)


@dataclass(frozen=True, slots=True)
class Wire:
    """Level (n) of a line from t_ns (n) on; the first entry is the level at the start of the recording."""

    t_ns: Ints
    level: Bits

    def at(self, t_ns: Ints | int) -> Bits:
        """Level at each instant, an edge at that very instant included."""
        i = np.searchsorted(self.t_ns, t_ns, "right") - 1
        return np.asarray(self.level[np.maximum(i, 0)], np.uint8)

    def edges_ns(self, level: int) -> Ints:
        """Instants at which the line went to this level."""
        t_ns: Ints = self.t_ns[1:][self.level[1:] == level]
        return t_ns

    def part(self, begin_ns: int, end_ns: int) -> Wire:
        """Its level at the begin, then its edges up to the end."""
        k = max(0, int(np.searchsorted(self.t_ns, begin_ns, "right")) - 1)
        n = int(np.searchsorted(self.t_ns, end_ns, "right"))
        return Wire(np.concatenate(([np.int64(begin_ns)], self.t_ns[k + 1 : n])), self.level[k : max(n, k + 1)])


@dataclass(frozen=True, slots=True)
class Vcd:
    """A recording: unit_ns of the file, first and last instant, wires by name in the file's order."""

    unit_ns: int
    start_ns: int
    end_ns: int
    wires: dict[str, Wire]

    def part(self, names: Sequence[str], begin_ns: int, end_ns: int) -> Vcd:
        """Some wires between two instants."""
        return Vcd(self.unit_ns, begin_ns, end_ns, {name: self.wires[name].part(begin_ns, end_ns) for name in names})

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
    for name, fs in _FS.items():
        for factor in (1, 10, 100):
            if unit_ns * _FS_PER_NS == factor * fs:
                return f"{factor} {name}"
    raise ValueError(expected("1, 10 or 100 of ns, us, ms or s", f"{unit_ns} ns", "VCD time unit"))


@dataclass(frozen=True, slots=True, kw_only=True)
class VcdPart:
    """What was read of a file. note: where and why reading ended before the end of the file, "" if it did not."""

    head: str  # before $enddefinitions
    unit_fs: int
    start_ns: int  # -1: no time in it
    end_ns: int
    wires: dict[str, Wire]  # in order of declaration; only those with a level
    note: str


def read_vcd(path: Path) -> Vcd:
    """Reads a file of the emulator. Raises OSError, or ValueError with the place of what is not understood."""
    with path.open("rb") as file:
        return _whole(file, str(path))


def parse_vcd(text: str, name: str = "VCD") -> Vcd:
    """As `read_vcd`, from text; name is in error messages."""
    return _whole(io.BytesIO(text.encode()), name)


def _whole(file: BinaryIO, name: str) -> Vcd:
    part = read_vcd_part(file, name, levels=b"01")
    if part.note:
        raise ValueError(f"{name}: {part.note}")
    if part.unit_fs < _FS_PER_NS:
        raise ValueError(expected("$timescale of 1 ns to 100 s", f"{part.unit_fs} fs", name))
    unit_ns = part.unit_fs // _FS_PER_NS
    if part.start_ns < 0:
        return Vcd(unit_ns, -unit_ns, -unit_ns, {})
    return Vcd(unit_ns, part.start_ns, part.end_ns, part.wires)


def read_vcd_part(
    file: BinaryIO,
    name: str,
    max_ns: float = MOST_NS,
    levels: bytes = b"01xXzZ",
    *,
    most_edges: int = MOST_EDGES,
    look: Callable[[], None] = lambda: None,
) -> VcdPart:
    """Reads block by block, to max_ns after the first time or to most_edges. Calls `look` after each block.

    Raises ValueError where the head is not that of a VCD, and what `look` raises.
    """
    head, rest = _head(name, file)
    r = _declared(name, head, min(max_ns, MOST_NS), np.frombuffer(levels, np.uint8))
    r.most_edges = most_edges
    while not r.note:
        data = file.read(BLOCK)
        rest += data
        cut = _before_last_time(rest) if data else len(rest)
        _body(r, rest[:cut])
        rest = rest[cut:]
        if len(rest) > _MOST_REST:
            r.note = r.note or f"no time in {_MOST_REST} bytes"
        look()
        if not data:
            break
    return VcdPart(
        head=head,
        unit_fs=r.unit_fs,
        start_ns=r.start_ns,
        end_ns=int(r.ns(np.array([r.now]))[0]),
        wires={r.codes[c]: _wire(r, c) for c in r.codes if c in r.at},
        note=r.note,
    )


@dataclass(slots=True)
class _Reader:
    """codes: names by code, 1-bit wires only; others: codes of all else."""

    codes: Mapping[str, str]
    others: frozenset[str]
    unit_fs: int
    max_ns: float
    level_chars: Bits
    now: int = -1  # in units; -1: no time was given yet
    start_ns: int = -1
    edges: int = 0
    most_edges: int = MOST_EDGES
    note: str = ""
    comment: bool = False
    at: dict[str, list[Ints]] = field(default_factory=dict)
    levels: dict[str, list[Bits]] = field(default_factory=dict)

    def ns(self, t: Ints) -> Ints:
        """Units to ns, rounded down."""
        if self.unit_fs >= _FS_PER_NS:
            return t * (self.unit_fs // _FS_PER_NS)
        return t // (_FS_PER_NS // self.unit_fs)


def _head(name: str, file: BinaryIO) -> tuple[str, bytes]:
    data = b""
    while b"$enddefinitions" not in data:
        more = file.read(1 << 16)
        if not more or len(data) > _MOST_HEAD:
            raise ValueError(expected("a VCD file", f"no $enddefinitions in the first {len(data)} bytes", name))
        data += more
    head, _, rest = data.partition(b"$enddefinitions")
    while b"$end" not in rest:
        more = file.read(1 << 16)
        if not more or len(rest) > _MOST_HEAD:
            raise ValueError(expected("$end after $enddefinitions", "none", name))
        rest += more
    return head.decode("latin-1"), rest.partition(b"$end")[2]


def _declared(name: str, head: str, max_ns: float, level_chars: Bits) -> _Reader:
    scale = _TIMESCALE.search(head)
    if not scale:
        raise ValueError(expected("$timescale of 1, 10 or 100 fs to s", "none", name))
    codes: dict[str, str] = {}
    others: set[str] = set()
    scopes: list[str] = []
    for kind, words in _sections(head):
        if kind == "$scope":
            scopes.append(words[-1] if words else "")
        elif kind == "$upscope":
            del scopes[-1:]
        elif kind == "$var" and len(words) >= 4 and words[1] == "1" and words[0] not in _NO_WIRE:
            if len(words[2]) > _MOST_CODE:
                raise ValueError(expected(f"a code of at most {_MOST_CODE} characters", words[2][:40], name))
            codes.setdefault(words[2], _name(words[3], scopes, set(codes.values())))
        elif kind == "$var" and len(words) >= 3:
            others.add(words[2])
    if not codes:
        raise ValueError(expected("$var of 1 bit", "none", name))
    if len(codes) > _MOST_WIRES:
        raise ValueError(expected(f"at most {_MOST_WIRES} wires", len(codes), name))
    unit_fs = int(scale[1]) * _FS[scale[2]]
    return _Reader(codes, frozenset(others - set(codes)), unit_fs, max_ns, level_chars)


def _sections(head: str) -> Iterator[tuple[str, list[str]]]:
    """Each keyword with its words up to $end; a wire's code may begin with $, too."""
    words = iter(head.split())
    for kind in words:
        if kind.startswith("$"):
            yield kind, list(takewhile(lambda w: w != "$end", words))


def _name(name: str, scopes: list[str], taken: set[str]) -> str:
    """Bare where it is the first of that name, with its scopes otherwise."""
    bare = name.split("[")[0] if name.endswith("[0]") else name
    return bare if bare not in taken else ".".join([*scopes, bare])


def _before_last_time(data: bytes) -> int:
    """Where the last time begins: no value and its code are torn there."""
    end = len(data)
    while (end := data.rfind(b"#", 0, end)) > 0:
        if data[end - 1 : end] in (b" ", b"\n", b"\r", b"\t") and data[end + 1 : end + 2].isdigit():
            return end
    return 0


@dataclass(slots=True)
class _Words:
    """Words of a piece, comments left out, and what each is."""

    tokens: _Tokens
    which: Ints  # (n,) places in tokens
    wire: Ints  # (n,) index of the code whose level it is, -1: none
    value: Ints  # (n,) 0 or 1; others: unknown
    time: Ints  # (n,) in units, -1: none
    good: Bools  # (n,)


def _body(r: _Reader, body: bytes) -> None:
    """Take a piece, up to the first word that is none of VCD's."""
    tokens = _Tokens.of(body.decode("ascii", "replace"))
    which = _without_comments(r, tokens)
    if not len(which):
        return
    codes, kind = list(r.codes), tokens.first[which]
    level, times = np.isin(kind, r.level_chars), kind == ord("#")
    wire, value, time = np.full((3, len(which)), -1, np.int64)
    w = _Words(tokens, which, wire, value, time, kind == ord("$"))
    w.wire[level] = tokens.looked_up(which[level], codes)
    w.value[level] = kind[level].astype(np.int64) - ord("0")
    w.time[times] = tokens.numbers(which[times])
    w.good |= (w.wire >= 0) | (w.time >= 0)
    _unknown_dollars(w)
    _vectors(r, w, codes)
    end = _first_bad(r, w)
    _keep(r, codes, w, end)


def _without_comments(r: _Reader, tokens: _Tokens) -> Ints:
    """Places of the words outside $comment ... $end."""
    keep = np.ones(len(tokens), bool)
    begin = 0 if r.comment else -1
    for i in np.flatnonzero(tokens.first == ord("$")).tolist():
        word = tokens.word(i)
        if word == "$comment" and begin < 0:
            begin = i
        elif word == "$end" and begin >= 0:
            keep[begin : i + 1] = False
            begin = -1
    if begin >= 0:
        keep[begin:] = False
    r.comment = begin >= 0
    return np.flatnonzero(keep)


def _unknown_dollars(w: _Words) -> None:
    for k in np.flatnonzero(w.tokens.first[w.which] == ord("$")).tolist():
        w.good[k] = w.tokens.word(int(w.which[k])) in _KEYWORDS


def _vectors(r: _Reader, w: _Words, codes: list[str]) -> None:
    """b... CODE, r... CODE and s... CODE: the level of a 1-bit wire, or passed over; so are levels of other codes."""
    bare = np.flatnonzero(~w.good & (w.time < 0)).tolist()
    done = -1
    for k in bare:
        if k <= done:
            continue
        word = w.tokens.word(int(w.which[k]))
        if w.tokens.first[w.which[k]] not in _VECTORS or k + 1 >= len(w.which):
            w.good[k] = word[1:] in r.others
            continue
        code = w.tokens.word(int(w.which[k + 1]))
        if code in r.others or code in codes:
            w.good[k : k + 2], w.wire[k + 1], w.time[k + 1], done = True, -1, -1, k + 1
        if code in codes and code not in r.others:
            w.wire[k + 1], w.value[k + 1] = codes.index(code), ord(word[-1]) - ord("0")


def _first_bad(r: _Reader, w: _Words) -> int:
    """How many words are taken; the note says why there are no more."""
    times = np.flatnonzero(w.time >= 0)
    t = np.concatenate(([np.int64(r.now)], w.time[times]))
    most = MOST_NS * _FS_PER_NS // r.unit_fs
    ends = [
        (np.flatnonzero(~w.good), "a time or a level of a declared wire"),
        (times[np.diff(t) < 0], "a time after the one before it"),
        (times[t[1:] > most], f"a time up to #{most}"),
    ]
    found = [(int(at[0]), due) for at, due in ends if len(at)]
    if found:
        k, due = min(found)
        at, got = int(max(w.time[:k].max(initial=-1), r.now)), w.tokens.word(int(w.which[k]))[:40]
        r.note = expected(due, f"'{got}'", f"after #{at}")
        return k
    return len(w.which)


def _keep(r: _Reader, codes: list[str], w: _Words, end: int) -> None:
    time, wire, value = w.time[:end], w.wire[:end], w.value[:end]
    stamps = np.concatenate(([np.int64(r.now)], time[time >= 0]))
    at_ns = r.ns(stamps)[np.cumsum(time >= 0)] if len(time) else np.empty(0, np.int64)
    if r.start_ns < 0 and len(stamps) > 1:
        r.start_ns = int(r.ns(stamps[1:2])[0])
    known = (wire >= 0) & ((value == 0) | (value == 1))
    late = known & (at_ns > r.start_ns + r.max_ns) if r.start_ns >= 0 else np.zeros(len(time), bool)
    if late.any():
        known &= ~late
        r.note = r.note or f"judged to {r.max_ns / 1e9:g} s"
        stamps = stamps[r.ns(stamps) <= r.start_ns + r.max_ns]
    r.now = int(stamps[-1])
    r.edges += int(known.sum())
    if r.edges > r.most_edges:
        r.note = r.note or f"read to its {r.edges} edges"
    for i in np.unique(wire[known]).tolist():
        mine = known & (wire == i)
        r.at.setdefault(codes[i], []).append(at_ns[mine])
        r.levels.setdefault(codes[i], []).append(value[mine].astype(np.uint8))


def _wire(r: _Reader, code: str) -> Wire:
    """Real changes only: some tools repeat levels."""
    t, level = np.maximum(np.concatenate(r.at[code]), r.start_ns), np.concatenate(r.levels[code])
    moved = np.concatenate(([True], level[1:] != level[:-1]))
    t, level = t[moved], level[moved]
    return Wire(np.concatenate(([r.start_ns], t[1:])), level)


@dataclass(frozen=True, slots=True)
class _Tokens:
    """The words of a file's body, by where they are in its bytes: no Python loop over a million edges."""

    text: Bits
    begin: Ints
    end: Ints
    first: Bits  # byte of each

    @classmethod
    def of(cls, body: str) -> _Tokens:
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
