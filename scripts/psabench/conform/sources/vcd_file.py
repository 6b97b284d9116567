"""VCD files of any tool: any names, any unit down to 1 fs, scopes, vectors beside the 1-bit wires (which are left out).

IEEE 1364-2001, clause 18. x and z leave a line as it was. `psabench.link.vcd` reads the emulator's own files at once;
this reader takes a file block by block and keeps what came before a damage.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import takewhile
from pathlib import Path
from typing import BinaryIO

import numpy as np
import numpy.typing as npt

from psabench.conform.capture.log import Bools
from psabench.conform.sources.taken import BLOCK, MOST_CHANNELS, MOST_EDGES, MOST_NS, NS, Bounds, LineTake
from psabench.errors import BadInput
from psabench.link.signals import Ints
from psabench.link.vcd import Tokens, Wire

MOST_HEAD = 1 << 22  # bytes before $enddefinitions
MOST_CODE = 8  # characters of a wire's code
MOST_REST = 4 * BLOCK  # bytes without a time
UNIT_FS = {"fs": 1, "ps": 10**3, "ns": 10**6, "us": 10**9, "ms": 10**12, "s": 10**15}
FS_A_NS = 10**6
TIMESCALE = re.compile(r"\$timescale\s+(1|10|100)\s*(fs|ps|ns|us|ms|s)\s+\$end")
NO_WIRE = ("real", "realtime", "string", "event")
SAMPLED = re.compile(r"channels at (\d+(?:\.\d+)?) ?([kMG]?)Hz")  # of sigrok, in $comment
HZ = {"": 1.0, "k": 1e3, "M": 1e6, "G": 1e9}
QUIET = ("$dumpvars", "$dumpall", "$dumpon", "$dumpoff", "$end")
Bits = npt.NDArray[np.uint8]
LEVELS, VECTORS = np.frombuffer(b"01xXzZ", np.uint8), np.frombuffer(b"bBrRsS", np.uint8)


@dataclass(slots=True)
class _Reader:
    """codes: names by code, 1-bit wires only; others: codes of all else."""

    codes: Mapping[str, str]
    others: frozenset[str]
    unit_fs: int
    max_ns: float
    now: int = -1  # in units; -1: no time was given yet
    start_ns: int = -1
    edges: int = 0
    note: str = ""
    comment: bool = False
    at: dict[str, list[Ints]] = field(default_factory=dict)
    levels: dict[str, list[Bits]] = field(default_factory=dict)

    def ns(self, t: Ints) -> Ints:
        """Units to ns, rounded down."""
        if self.unit_fs >= FS_A_NS:
            return t * (self.unit_fs // FS_A_NS)
        return t // (FS_A_NS // self.unit_fs)


def read_vcd_file(path: Path, bounds: Bounds) -> LineTake:
    """Raises BadInput for what is no VCD with 1-bit wires and times; OSError."""
    with path.open("rb") as file:
        head, rest = _head(path, file)
        reader = _declared(path, head, bounds)
        while not reader.note:
            data = file.read(BLOCK)
            rest += data
            cut = _before_last_time(rest) if data else len(rest)
            _body(reader, rest[:cut])
            rest = rest[cut:]
            if len(rest) > MOST_REST:
                reader.note = reader.note or f"no time in {MOST_REST} bytes"
            if not data:
                break
    if reader.start_ns < 0 or not reader.at:
        why = reader.note or "no time or no level of a 1-bit wire"
        raise BadInput(f"{path}: {why}; nothing in it can be judged")
    return _take(reader, head, bounds)


def _head(path: Path, file: BinaryIO) -> tuple[str, bytes]:
    data = b""
    while b"$enddefinitions" not in data:
        more = file.read(1 << 16)
        if not more or len(data) > MOST_HEAD:
            raise BadInput(f"{path}: no $enddefinitions in its first {len(data)} bytes: not a VCD file")
        data += more
    head, _, rest = data.partition(b"$enddefinitions")
    while b"$end" not in rest:
        more = file.read(1 << 16)
        if not more or len(rest) > MOST_HEAD:
            raise BadInput(f"{path}: $enddefinitions has no $end")
        rest += more
    return head.decode("latin-1"), rest.partition(b"$end")[2]


def _declared(path: Path, head: str, bounds: Bounds) -> _Reader:
    scale = TIMESCALE.search(head)
    if not scale:
        raise BadInput(f"{path}: no $timescale of 1, 10 or 100 fs to s")
    codes: dict[str, str] = {}
    others: set[str] = set()
    scopes: list[str] = []
    for kind, words in _sections(head):
        if kind == "$scope":
            scopes.append(words[-1] if words else "")
        elif kind == "$upscope":
            del scopes[-1:]
        elif kind == "$var" and len(words) >= 4 and words[1] == "1" and words[0] not in NO_WIRE:
            if len(words[2]) > MOST_CODE:
                raise BadInput(f"{path}: $var {words[2][:40]} has a code of more than {MOST_CODE} characters")
            codes.setdefault(words[2], _name(words[3], scopes, set(codes.values())))
        elif kind == "$var" and len(words) >= 3:
            others.add(words[2])
    if not codes:
        raise BadInput(f"{path}: no $var of 1 bit")
    if len(codes) > MOST_CHANNELS * 16:
        raise BadInput(f"{path}: {len(codes)} wires; not more than {MOST_CHANNELS * 16} are read")
    unit_fs = int(scale[1]) * UNIT_FS[scale[2]]
    return _Reader(codes, frozenset(others - set(codes)), unit_fs, min(bounds.max_s * NS, MOST_NS))


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

    tokens: Tokens
    which: Ints  # (n,) places in tokens
    wire: Ints  # (n,) index of the code whose level it is, -1: none
    value: Ints  # (n,) 0 or 1; others: unknown
    time: Ints  # (n,) in units, -1: none
    good: Bools  # (n,)


def _body(r: _Reader, body: bytes) -> None:
    """Take a piece, up to the first word that is none of VCD's."""
    tokens = Tokens.of(body.decode("ascii", "replace"))
    which = _without_comments(r, tokens)
    if not len(which):
        return
    codes, kind = list(r.codes), tokens.first[which]
    level, times = np.isin(kind, LEVELS), kind == ord("#")
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


def _without_comments(r: _Reader, tokens: Tokens) -> Ints:
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
        w.good[k] = w.tokens.word(int(w.which[k])) in QUIET


def _vectors(r: _Reader, w: _Words, codes: list[str]) -> None:
    """b... CODE, r... CODE and s... CODE: the level of a 1-bit wire, or passed over; so are levels of other codes."""
    bare = np.flatnonzero(~w.good & (w.time < 0)).tolist()
    done = -1
    for k in bare:
        if k <= done:
            continue
        word = w.tokens.word(int(w.which[k]))
        if w.tokens.first[w.which[k]] not in VECTORS or k + 1 >= len(w.which):
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
    most = MOST_NS * FS_A_NS // r.unit_fs
    ends = [
        (np.flatnonzero(~w.good), "'{}' is neither a time nor a level"),
        (times[np.diff(t) < 0], "'{}' is before the time that precedes it"),
        (times[t[1:] > most], "'{}' is beyond any recording"),
    ]
    found = [(int(at[0]), why) for at, why in ends if len(at)]
    if found:
        k, why = min(found)
        r.note = (
            why.format(w.tokens.word(int(w.which[k]))[:40]) + f" (after #{int(max(w.time[:k].max(initial=-1), r.now))})"
        )
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
        r.note = r.note or f"judged to {r.max_ns / NS:g} s"
        stamps = stamps[r.ns(stamps) <= r.start_ns + r.max_ns]
    r.now = int(stamps[-1])
    r.edges += int(known.sum())
    if r.edges > MOST_EDGES:
        r.note = r.note or f"judged to its {MOST_EDGES} edges"
    for i in np.unique(wire[known]).tolist():
        mine = known & (wire == i)
        r.at.setdefault(codes[i], []).append(at_ns[mine])
        r.levels.setdefault(codes[i], []).append(value[mine].astype(np.uint8))


def _take(r: _Reader, head: str, bounds: Bounds) -> LineTake:
    unit_ns = r.unit_fs / FS_A_NS
    sampled = SAMPLED.search(head)
    of_file_ns = NS / (float(sampled[1]) * HZ[sampled[2]]) if sampled and float(sampled[1]) > 0 else 0.0
    sample_ns = NS / bounds.line_hz if bounds.line_hz else of_file_ns
    return LineTake(
        channels={r.codes[c]: _wire(r, c) for c in r.codes if c in r.at},
        start_ns=r.start_ns,
        end_ns=int(r.ns(np.array([r.now]))[0]),
        resolution_ns=max(1.0, unit_ns, sample_ns),
        note=r.note,
    )


def _wire(r: _Reader, code: str) -> Wire:
    """Real changes only: some tools repeat levels."""
    t, level = np.maximum(np.concatenate(r.at[code]), r.start_ns), np.concatenate(r.levels[code])
    moved = np.concatenate(([True], level[1:] != level[:-1]))
    t, level = t[moved], level[moved]
    return Wire(np.concatenate(([r.start_ns], t[1:])), level)
