"""The Verilog models of PSA-2's frame and PSD-1's cycle, built and proved to do what the emulated boards do.

A peer is worth a comparison only if it computes the same thing: the words of 512 frames of the emulated board are
played through each model, and the checksum of the words taken from the lines, and number and instants (in periods of
the clocks) of the edges of each line must be the board's own.
"""

from __future__ import annotations

import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

HERE = Path(__file__).resolve().parent
MODEL = [HERE / "verilog" / name for name in ("psa2.v", "kpsa.v", "adc_port.v")]
BENCH = HERE / "verilog/psa2_tb.v"
DRIVER = HERE / "verilog/psa2_drive.cpp"
NAMES = ("icarus", "verilator-timing", "verilator")
PSD1_MODEL = [HERE / "verilog" / name for name in ("psd1.v", "kpsd1.v", "ad7712_port.v")]
PSD1_DRIVER = HERE / "verilog/psd1_drive.cpp"
PSD1 = "verilator-psd1"
PSA2_LINES, PSD1_LINES = 9, 34
ROWS = 512  # frames in the file of words; psa2_tb.v has the same number

# AVX-512 is left out because valgrind 3.19 cannot run it; without it the driver is as fast.
CFLAGS = "-O3 -march=native -mno-avx512f"
VERILATOR = [
    *("verilator", "--cc", "--exe", "--build", "-O3", "--x-assign", "fast", "--x-initial", "fast", "--noassert"),
    *("-CFLAGS", CFLAGS, "-MAKEFLAGS", "OPT_FAST=-O3 OPT_SLOW=-O3 OPT_GLOBAL=-O3"),
]


@dataclass(frozen=True, slots=True)
class Peer:
    """A built model: `timed` plays so many frames; `checked` also prints the edges of each line."""

    name: str
    timed: tuple[str, ...]
    checked: tuple[str, ...]
    plus: str  # how the number of frames is written on the command line
    after: tuple[str, ...] = ()  # what comes behind it

    def command(self, frames: int, *, check: bool = False) -> list[str]:
        if self.plus:
            return [*(self.checked if check else self.timed), f"{self.plus}{frames}"]
        return [*self.timed, str(frames), *self.after, *(["check"] if check else [])]


def run(command: Sequence[str | Path], **kw: str) -> str:
    """Standard output; RuntimeError with everything that was said when it fails."""
    p = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | kw)
    if p.returncode != 0:
        raise RuntimeError(f"{' '.join(map(str, command))}: status {p.returncode}\n{p.stdout}{p.stderr}")
    return p.stdout


def build(out: Path, words: Path) -> dict[str, Peer]:
    """All three peers of PSA-2, in out; built again only if a source is newer."""
    return {p.name: p for p in (_icarus(out, words), _timing(out, words), _driven(out, words))}


def build_psd1(out: Path, words: Path) -> dict[str, Peer]:
    """The peer of PSD-1. Its clock runs all the time: it is one of the lines."""
    exe = out / "psd1/psd1_drive"
    if _stale(exe, [PSD1_DRIVER, *PSD1_MODEL]):
        no_delays = "-GRFS_ACCESS_NS=0"
        options = ["-Wall", no_delays, "--top-module", "psd1", "--Mdir", str(exe.parent), "-o", exe.name]
        run([*VERILATOR, *options, *PSD1_MODEL, PSD1_DRIVER])
    return {PSD1: Peer(PSD1, (str(exe), str(words)), (str(exe), str(words)), "", ("clock",))}


def _stale(made: Path, sources: Sequence[Path]) -> bool:
    return not made.exists() or any(s.stat().st_mtime > made.stat().st_mtime for s in [*sources, Path(__file__)])


def _icarus(out: Path, words: Path) -> Peer:
    made = [out / f"icarus{check}.vvp" for check in (0, 1)]
    for check, vvp in enumerate(made):
        if _stale(vvp, [BENCH, *MODEL]):
            run(["iverilog", "-g2005", "-Wall", f"-Ppsa2_tb.CHECK={check}", "-o", vvp, BENCH, *MODEL])
    timed, checked = (("vvp", str(vvp), f"+words={words}") for vvp in made)
    return Peer("icarus", timed, checked, "+frames=")


def _timing(out: Path, words: Path) -> Peer:
    made = [out / f"timing{check}/psa2_tb" for check in (0, 1)]
    for check, exe in enumerate(made):
        if _stale(exe, [BENCH, *MODEL]):
            options = ["--main", "--timing", "--top-module", "psa2_tb", f"-GCHECK={check}", "--Mdir", str(exe.parent)]
            run([*VERILATOR, *options, "-o", exe.name, BENCH, *MODEL])
    timed, checked = ((str(exe), f"+words={words}") for exe in made)
    return Peer("verilator-timing", timed, checked, "+frames=")


def _driven(out: Path, words: Path) -> Peer:
    exe = out / "driven/psa2_drive"
    if _stale(exe, [DRIVER, *MODEL]):
        run([*VERILATOR, "-Wall", "--top-module", "psa2", "--Mdir", exe.parent, "-o", exe.name, *MODEL, DRIVER])
    return Peer("verilator", (str(exe), str(words)), (str(exe), str(words)), "")


def facts(output: str) -> dict[str, str]:
    """frames, checksum, and number and instants of the edges of each line, of a model's or the board's output."""
    found: dict[str, str] = {}
    for line in output.splitlines():
        w = line.split()
        if w[:1] == ["frames"]:
            found |= {"frames": w[1], "checksum": w[3]}
        if w[:1] == ["line"]:
            found |= {f"edges of line {w[1]}": w[3], f"instants of line {w[1]}": w[5]}
    return found


def prove(peers: dict[str, Peer], board: str, lines: int = PSA2_LINES) -> None:
    """RuntimeError unless each peer does with the words what the board did; board: output of its bench_words."""
    want = facts(board)
    for peer in peers.values():
        got = facts(run(peer.command(ROWS, check=True)))
        wrong = [f"{k}: {got.get(k)}, the board has {v}" for k, v in want.items() if got.get(k) != v]
        if len(want) != 2 + 2 * lines or wrong:
            raise RuntimeError(f"{peer.name} does not do what the board does: {'; '.join(wrong) or want}")
