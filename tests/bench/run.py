"""`make bench`: the emulator beside HDL simulators of the same board, and what else has a target of speed.

Everything is measured in the same run, interleaved, round after round; medians go into build/bench/result.json, and
from there into docs/reference/performance.md and its picture. `--page-only` writes these from the last result.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import subprocess
import sys

import numpy

from tests.bench import cases, page, peers
from tests.bench.cases import ROOT, Case
from tests.bench.targets import Result

OUT = ROOT / "build/bench"
PAGE = ROOT / "docs/reference/performance.md"
PICTURE = ROOT / "docs/img/performance.svg"
PEER = page.PEER


def say(text: str) -> None:
    print(f"bench: {text}", flush=True)


def first_line(*command: str) -> str:
    p = subprocess.run(command, capture_output=True, text=True, check=False)
    return (p.stdout or p.stderr).partition("\n")[0].strip()


def machine() -> dict[str, str | int]:
    """What the figures depend on, and nothing that tells whose machine it is."""
    return {
        "cores": os.cpu_count() or 1,
        "arch": platform.machine(),
        "cc": " ".join(first_line(os.environ.get("BENCH_CC", "gcc"), "--version").split()[:1])
        + " "
        + first_line(os.environ.get("BENCH_CC", "gcc"), "-dumpfullversion", "-dumpversion"),
        "cflags": os.environ.get("BENCH_CFLAGS", "-O2 -g"),
        "cxx": first_line("g++", "-dumpfullversion", "-dumpversion"),
        "peer_cflags": peers.CFLAGS,
        "verilator": " ".join(first_line("verilator", "--version").split()[:2]),
        "icarus": "Icarus " + first_line("vvp", "-V").partition("version ")[2].split()[0],
        "valgrind": first_line("valgrind", "--version"),
        "python": platform.python_version(),
        "numpy": numpy.__version__,
    }


def summary(done: list[Case], rounds: int) -> Result:
    by_name = {c.name: c for c in done}
    rows = {}
    for c in done:
        if c.name in peers.NAMES:  # only the driver counts while it is timed; all three were proved to make the same
            c.edges_per_unit = by_name[PEER].edges_per_unit
        row: dict[str, object] = {
            "unit": c.unit,
            "count": c.count,
            "per_s": statistics.median(c.rates),
            "rates": c.rates,
            "edges_per_unit": c.edges_per_unit,
            "instructions_per_unit": c.instructions_per_unit,
            "ms": statistics.median(c.ns) / 1e6,
            "facts": c.facts,
        }
        if c.unit == "frames":
            peer = by_name[peers.PSD1 if "psd1" in c.name else PEER]
            row["times_peer"] = statistics.median(a / b for a, b in zip(c.rates, peer.rates, strict=True))
        if c.unit == "runs":
            row["times_peer"] = statistics.median(
                a / b for a, b in zip(c.rates, by_name[cases.NUMPY].rates, strict=True)
            )
        if c.edges_per_unit:
            row["medges_per_s"] = statistics.median(c.rates) * c.edges_per_unit / 1e6
            if c.instructions_per_unit:
                row["instructions_per_edge"] = c.instructions_per_unit / c.edges_per_unit
        rows[c.name] = row
    return {"machine": {}, "rounds": rounds, "cases": rows}


def bench(seconds: float) -> Result:
    """Build, prove, calibrate, measure; about so many seconds of measuring."""
    OUT.mkdir(parents=True, exist_ok=True)
    words, words_psd1 = OUT / "words.hex", OUT / "words_psd1.hex"
    board = peers.run([OUT / "bench_words", words, str(peers.ROWS)])
    board_psd1 = peers.run([OUT / "bench_psd1_words", words_psd1, str(peers.ROWS)])
    say("building the Verilog models (Icarus, Verilator)")
    made, made_psd1 = peers.build(OUT, words), peers.build_psd1(OUT, words_psd1)
    peers.prove(made, board)
    peers.prove(made_psd1, board_psd1, peers.PSD1_LINES)
    say(f"the models send the words of the emulated board, edge for edge: {board.partition(chr(10))[0]}")
    return measured(cases.all_cases(OUT, made | made_psd1), seconds) | {"machine": machine()}


def measured(todo: list[Case], seconds: float, *, instructions: bool = True) -> Result:
    """Instructions, then rounds of rates; the machine is not yet named."""
    for case in todo if instructions else []:
        say(f"instructions: {case.name}") if case.under_callgrind else None
        cases.count_instructions(case)
    rounds = 7 if seconds >= 120 else 5
    for case in todo:
        cases.calibrate(case, seconds / rounds / len(todo))
    for n in range(rounds):
        for case in todo:
            cases.measure(case)
        done = ", ".join(f"{c.name} {page.figure(c.rates[-1])}" for c in todo)
        say(f"round {n + 1} of {rounds}, units/s: {done}")
    return summary(todo, rounds)


def _measured_nav(seconds: float) -> Result:
    """The table of filters has no instructions."""
    return measured(cases.nav_cases(OUT), seconds, instructions=False)


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=180.0, help="of measuring, about (default 180)")
    parser.add_argument("--no-page", action="store_true", help="leave docs/reference/performance.md as it is")
    parser.add_argument("--page-only", action="store_true", help="write it from the last result")
    parser.add_argument("--nav", action="store_true", help="the table of filters alone, from what is built")
    args = parser.parse_args(argv)
    result_file = OUT / "result.json"
    os.environ["PYTHONPATH"] = str(ROOT / "scripts")  # what is measured is this checkout
    os.environ["OPENBLAS_NUM_THREADS"] = "1"  # threads that wait would count
    if not args.page_only:
        result_file.unlink(missing_ok=True)
        result_file.parent.mkdir(parents=True, exist_ok=True)
        result = _measured_nav(args.seconds) if args.nav else bench(args.seconds)
        result_file.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    result = json.loads(result_file.read_text(encoding="utf-8"))
    sections = ["nav"] if args.nav else list(page.SECTIONS)
    print("\n" + "\n\n".join(page.SECTIONS[name](result) for name in sections))
    if not args.no_page:
        PAGE.write_text(page.fill(PAGE.read_text(encoding="utf-8"), result, sections), encoding="utf-8")
        if not args.nav:
            PICTURE.write_text(page.picture(result), encoding="utf-8")
        say(f"{PAGE.relative_to(ROOT)} and {result_file.relative_to(ROOT)} written")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except (RuntimeError, OSError) as e:
        sys.exit(f"bench: {e}")
