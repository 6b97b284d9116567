"""Icarus Verilog beside the emulator: models of tests/bench/verilog in real time, their edges against a recording's."""

from __future__ import annotations

import os
import secrets
import subprocess
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from psabench.link.vcd import Ints, Wire

MODELS = Path(__file__).resolve().parents[2] / "bench/verilog"
TIMEOUT_S = 300


@dataclass(frozen=True, slots=True)
class Edges:
    """What a line does in a stretch of time: level at its start, instants of the changes in ns, levels after them."""

    before: int
    t_ns: Ints
    level: NDArray[np.uint8]


def between(wire: Wire, start_ns: int, end_ns: int) -> Edges:
    """Changes in start < t <= end."""
    inside = (wire.t_ns > start_ns) & (wire.t_ns <= end_ns)
    return Edges(int(wire.at(start_ns)), wire.t_ns[inside], wire.level[inside])


def seed_of_test() -> int:
    """TEST_SEED, or a new one; printed, so that a failure can be had again."""
    seed = int(os.environ.get("TEST_SEED") or secrets.randbelow(2**32))
    print(f"TEST_SEED={seed}")
    return seed


def simulate(
    directory: Path,
    bench: str,
    models: Iterable[str],
    end_ns: int,
    options: Mapping[str, int] | None = None,
    **files: str,
) -> Path:
    """Runs a test bench with these stimuli up to an instant; the file of its edges. Raises AssertionError in words."""
    program, edges = directory / f"{bench}.vvp", directory / f"{bench}.edges"
    sources = [str(MODELS / f"{name}.v") for name in (bench, *models)]
    _run(["iverilog", "-g2005", "-Wall", "-o", str(program), *sources])
    plus = [f"+edges={edges}", f"+end={end_ns}", *(f"+{name}={value}" for name, value in (options or {}).items())]
    for name, text in files.items():
        path = directory / f"{bench}.{name}"
        path.write_text(text, encoding="ascii")
        plus.append(f"+{name}={path}")
    _run(["vvp", str(program), *plus])
    return edges


def _run(command: list[str]) -> None:
    p = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)
    assert (p.returncode, p.stdout + p.stderr) == (0, ""), f"{' '.join(command)}\n{p.stdout}{p.stderr}"


def drawn(path: Path, names: Iterable[str]) -> dict[str, Wire]:
    """Each line in a test bench's record: rows of instant and levels; the last of an instant counts."""
    rows = [(t, v) for t, v in zip(*[iter(path.read_text(encoding="ascii").split())] * 2, strict=True) if _known(v)]
    t_ns = np.array([int(t) for t, _ in rows], np.int64)
    levels = np.array([int(v, 16) for _, v in rows], np.uint64)
    last = np.append(t_ns[1:] != t_ns[:-1], True)
    t_ns, levels = t_ns[last], levels[last]
    found = {}
    for i, name in enumerate(names):
        level = ((levels >> np.uint64(i)) & np.uint64(1)).astype(np.uint8)
        at = np.flatnonzero(np.append(True, level[1:] != level[:-1]))
        found[name] = Wire(t_ns[at], level[at])
    return found


def _known(levels: str) -> bool:
    """Before its first event a register of Verilog is unknown: x, or X where only some of four bits are."""
    return not set(levels) & set("xXzZ")


def difference(name: str, ours: Edges, theirs: Edges) -> str:
    """Where two edge lists part, in words; nothing if they do not."""
    n = min(len(ours.t_ns), len(theirs.t_ns))
    if ours.before != theirs.before:
        return f"{name}: the emulator begins with {ours.before}, Verilog with {theirs.before}"
    same = (ours.t_ns[:n] == theirs.t_ns[:n]) & (ours.level[:n] == theirs.level[:n])
    if same.all() and len(ours.t_ns) == len(theirs.t_ns):
        return ""
    i = n if same.all() else int(np.argmin(same))
    ours_at, theirs_at = (f"{e.t_ns[i]} ns to {e.level[i]}" if i < len(e.t_ns) else "none" for e in (ours, theirs))
    counts = f"{len(ours.t_ns)} and {len(theirs.t_ns)} edges"
    return f"{name}, edge {i}: the emulator {ours_at}, Verilog {theirs_at} ({counts})"
