"""Recordings for tests: made by psa-emu in free pace, changed by scripts, written in other formats."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import can
import numpy as np
from can.io.logger import MESSAGE_WRITERS
from psabench.boards.psa2.conform.capture_line import Transfers
from psabench.cli import main
from psabench.conform.dut import scenario
from psabench.conform.profile import variant
from psabench.link.log_file import LogFile
from psabench.link.signals import Ints
from psabench.link.vcd import Vcd, Wire, read_vcd
from psabench.places import find_emulator

INPUTS_V = {"x": 1.0101, "y": -0.3007, "z": 0.7003}
NOISE_V = 1e-5  # so that no two words are the same
NO_VIOLATION = 4  # exit status of a run that judged too little to say more
OPEN = "inconclusive"


@dataclass(frozen=True, slots=True)
class Made:
    """A bench recorded twice: its bus and its lines."""

    log: Path
    vcd: Path


def record(
    folder: Path,
    board: str,
    profile: str | None = None,
    clock_ppm: float = 0.0,
    dwell: str = "550ms",
    faults: Sequence[Mapping[str, Any]] = (),
) -> Made:
    """From power-on; streaming begins with the set-up's end."""
    v = variant(board, profile)
    bench = scenario(v, INPUTS_V, clock_ppm)
    for axis in bench["units"][0].get("axes", {}).values():
        axis["reading_noise_v"] = NOISE_V
    path = folder / f"{board}.yaml"
    path.write_text(json.dumps(bench | {"start": True, "faults": [*faults]}))
    made = Made(folder / f"{board}.log", folder / f"{board}.vcd")
    words = ["--can", f"log:{made.log}", "--vcd", str(made.vcd), "--vcd-unit", "1", "--unit", "a"]
    command = [str(find_emulator()), str(path), *words, "--pace", "free", "--for", dwell, "--seed", "1", "--quiet"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=100, check=False)
    assert run.returncode == 0, run.stderr
    return made


@dataclass(frozen=True, slots=True)
class Judged:
    """What `conform recording` said."""

    status: int
    report: Mapping[str, Any]

    def of(self, verdict: str) -> set[str]:
        """Requirements with this verdict."""
        return {i for i, v in self.report["requirements"].items() if v == verdict}

    @property
    def clean(self) -> bool:
        """No violation seen and nothing open. A recording alone never shows enough to conform."""
        return self.status == NO_VIOLATION and self.report["result"] == "no violation seen" and not self.of(OPEN)

    @property
    def failed(self) -> set[str]:
        return self.of("failed")

    @property
    def passed(self) -> set[str]:
        return self.of("passed")

    def told(self, requirement: str) -> str:
        """What its failing tests saw, or why they could not tell."""
        return "; ".join(t["saw"] + t["reason"] for t in self.report["tests"] if requirement in t["requirements"])


def judge(folder: Path, *words: str | Path, board: str = "psa2") -> Judged:
    """Run the command in this process."""
    out = folder / "out"
    status = main(["conform", "recording", *map(str, words), "--board", board, "--out", str(out)])
    report = json.loads((out / "conform.json").read_text())
    broken = [t for t in report["tests"] if "the test itself failed" in t["reason"]]
    assert not broken, broken
    return Judged(status, report)


def converted(log: Path, ending: str) -> Path:
    """The same log in another format: by python-can's writer, where it has one."""
    path = log.with_suffix(ending)
    out: Any = can.Logger(str(path)) if ending in MESSAGE_WRITERS else LogFile(path)
    with can.LogReader(str(log)) as frames:
        for m in frames:
            out(m)
    (out.close if isinstance(out, LogFile) else out.stop)()
    return path


def changed_log(log: Path, name: str, change: Any) -> Path:
    """change: of the list of lines, to another."""
    path = log.with_name(f"{name}.log")
    path.write_text("".join(f"{line}\n" for line in change(log.read_text().splitlines())))
    return path


def stamped(log: Path, name: str, factor: float, begin_s: float = 0.0) -> Path:
    """All time stamps times a factor."""

    def change(lines: list[str]) -> list[str]:
        cut = [line.partition(")") for line in lines]
        return [f"({begin_s + float(a[1:]) * factor:.6f}){rest}" for a, _, rest in cut]

    return changed_log(log, name, change)


def write_vcd(path: Path, wires: Mapping[str, Wire], end_ns: int, unit: str = "1 ns", per_ns: int = 1) -> Path:
    """A file as another tool may write it: ids of two letters, all in one scope. per_ns: units in a nanosecond."""
    code = {name: f"w{chr(ord('a') + k)}" for k, name in enumerate(wires)}
    head = "".join(f"$var reg 1 {code[n]} {n} $end\n" for n in wires)
    events = sorted(
        (int(t), k, n, f"{level}{code[name]}")
        for k, (name, w) in enumerate(wires.items())
        for n, (t, level) in enumerate(zip(w.t_ns.tolist(), w.level.tolist(), strict=True))
    )
    body = "".join(f"#{t * per_ns}\n{what}\n" for t, _, _, what in events)
    top = f"$date now $end\n$timescale {unit} $end\n$scope module top $end\n"
    path.write_text(f"{top}{head}$upscope $end\n$enddefinitions $end\n{body}#{end_ns * per_ns}\n")
    return path


def port_lines(made: Made) -> dict[str, Wire]:
    """Int, Data and CLK."""
    wires = read_vcd(made.vcd).wires
    return {name: wires[name] for name in ("Int", "Data", "CLK")}


def scaled(wires: Mapping[str, Wire], factor: float) -> dict[str, Wire]:
    """The same by a clock that runs at another rate."""
    return {n: Wire(np.rint(w.t_ns * factor).astype(np.int64), w.level) for n, w in wires.items()}


def with_bits(wires: Mapping[str, Wire], t: Transfers, bits: Ints) -> dict[str, Wire]:
    """The same lines with other bits (n, 4 * 32) on Data, for half a period of CLK before and after its rises."""
    at = np.array(t.rises, np.int64).reshape(-1, 4, 32)
    begin, end = (at - 250).reshape(-1), (at[:, :, -1] + 250).reshape(-1)
    t_ns = np.concatenate((wires["Data"].t_ns[:1], begin, end))
    level = np.concatenate(([0], bits.reshape(-1), np.zeros(len(end), np.int64)))
    order = np.argsort(t_ns, kind="stable")
    t_ns, level = t_ns[order], level[order]
    moved = np.concatenate(([True], np.diff(level) != 0))
    return {**wires, "Data": Wire(t_ns[moved], level[moved].astype(np.uint8))}


def without_edges(wires: Mapping[str, Wire], line: str, first: int, count: int = 2) -> dict[str, Wire]:
    """The same with some edges of a line gone."""
    w = wires[line]
    keep = np.ones(len(w.t_ns), bool)
    keep[first : first + count] = False
    return {**wires, line: replace(w, t_ns=w.t_ns[keep], level=w.level[keep])}


def samples(wires: Mapping[str, Wire], end_ns: int, hz: float) -> bytes:
    """As the line port delivers them: bit k is the k-th line."""
    at_ns = np.floor(np.arange(int(end_ns * 1e-9 * hz)) / hz * 1e9).astype(np.int64)
    found = sum(w.at(at_ns).astype(np.int64) << k for k, w in enumerate(wires.values()))
    return np.asarray(found, np.uint8).tobytes()


def span_ns(made: Made) -> int:
    """Of the lines."""
    recording: Vcd = read_vcd(made.vcd)
    return recording.end_ns
