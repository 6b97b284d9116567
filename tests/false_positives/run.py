"""False alarms of the conformance suite. It runs on boards that conform: seeds, profiles, clocks that are off."""

from __future__ import annotations

import argparse
import logging
import os
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path

from psabench.conform import suite
from psabench.places import find_emulator

from tests.false_positives import report
from tests.false_positives.design import LOAD_SEEDS, SEEDS, Case, lockstep, under_load
from tests.false_positives.verdict import Result, judged, result
from tests.mutants.run import state
from tests.mutants.tree import ROOT, copy

OUT = ROOT / "build" / "false_positives.json"
PAGE = ROOT / "docs/reference/false_positives.md"

EPILOG = """\
examples (in the root of a checkout, with PYTHONPATH=tools):
  python -m tests.false_positives.run               what has not been run yet of 200 seeds of each profile
  python -m tests.false_positives.run --minutes 20  as far as it comes
  python -m tests.false_positives.run w24 pik --seeds 1-20
  python -m tests.false_positives.run --full        every error of the clocks with every seed
  python -m tests.false_positives.run --load        in real time, with all cores busy

What was run is in build/false_positives.json and is not run again, but for what alarmed before the sources
changed. Exit status: 0 no false alarm in all that was asked for and has been run, 1 there is one, 2 bad input, 130
ended by Ctrl-C.
"""


def parser() -> argparse.ArgumentParser:
    """Options."""
    p = argparse.ArgumentParser(
        prog="false_positives", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("names", nargs="*", metavar="PROFILE", help="profiles (all)")
    p.add_argument("--seeds", type=seeds, metavar="A-B", help="the lockstep part has 1-200, that under load 1-3")
    p.add_argument("--full", action="store_true", help="each error of the clocks with each seed")
    p.add_argument("--load", action="store_true", help="the part in real time under load")
    p.add_argument(
        "--busy", type=int, default=os.cpu_count() or 1, metavar="N", help="busy loops beside --load (one a core)"
    )
    p.add_argument("--only", nargs="+", default=[], metavar="ID", help="tests of these requirements; nothing is kept")
    p.add_argument("--anew", action="store_true", help="run again what was run")
    p.add_argument("--stale", action="store_true", help="run again what was run with other sources")
    p.add_argument("--minutes", type=float, metavar="N", help="begin no run after that")
    p.add_argument(
        "--merge", type=Path, action="append", default=[], metavar="FILE", help="take in another false_positives.json"
    )
    p.add_argument("--out", type=Path, default=OUT, metavar="FILE", help="results (build/false_positives.json)")
    p.add_argument("--docs", action="store_true", help="write the tables of docs/reference/false_positives.md")
    return p


def seeds(text: str) -> range:
    """`A-B`, both included. Raises ArgumentTypeError."""
    first, _, last = text.partition("-")
    if not (first.isdecimal() and last.isdecimal() and SEEDS.start <= int(first) <= int(last) < SEEDS.stop):
        raise argparse.ArgumentTypeError(f"{text}: expected A-B of {SEEDS.start} to {SEEDS.stop - 1}")
    return range(int(first), int(last) + 1)


def cases(args: argparse.Namespace) -> list[Case]:
    """What is asked for. Raises ValueError."""
    if args.load:
        return list(under_load(args.names, args.seeds or LOAD_SEEDS))
    return list(lockstep(args.names, args.seeds or SEEDS, full=args.full))


def to_do(wanted: Sequence[Case], known: dict[str, Result], now: str, args: argparse.Namespace) -> list[Case]:
    """What has to be run."""

    def again(r: Result) -> bool:
        return bool(args.anew or (r.state != now and (args.stale or r.alarms)))

    return [c for c in wanted if c.key not in known or again(known[c.key])]


def own_copy(folder: Path) -> None:
    """The emulator and its tables as they are now: who builds meanwhile changes nothing here."""
    emulator = shutil.copy2(find_emulator(), folder / "psa-emu")
    copy(("proto",), ROOT, folder / "device")
    os.environ |= {"PSA_EMU": str(emulator), "PSABENCH_PROTO": str(folder / "device" / "proto")}


def carry_out(args: argparse.Namespace, wanted: Sequence[Case]) -> int:
    """Run, tell, keep."""
    now, known = state(), report.read(args.out)
    for path in args.merge:
        known |= report.read(path)
    todo = to_do(wanted, known, now, args)
    ends_s = time.monotonic() + 60.0 * args.minutes if args.minutes is not None else float("inf")
    interrupted = False
    try:
        for n, case in enumerate(todo, 1):
            if time.monotonic() >= ends_s:
                print(f"{len(todo) - n + 1} runs are left")
                break
            r = result(case, now, partial(judged, loops=args.busy, only=args.only))
            known[case.key] = r
            report.write(args.out, known)
            print(f"{n}/{len(todo)} {report.line(r)}", flush=True)
    except KeyboardInterrupt:
        interrupted = True
    if args.merge:
        report.write(args.out, known)
    mine = [known[c.key] for c in wanted if c.key in known]
    for words in report.summary(mine):
        print(words)
    if args.docs:
        report.page(PAGE, list(known.values()), now)
    return 130 if interrupted else 1 if any(r.alarms for r in mine) or not mine else 0


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = parser().parse_args(argv)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a script may have started us in the background
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C
    logging.getLogger("can").setLevel(logging.CRITICAL)  # what goes wrong there is raised as well
    suite.load()
    try:
        wanted = cases(args)
    except ValueError as e:
        print(e, file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="alarms-") as folder:
        own_copy(Path(folder))
        if args.only:  # less than a run
            args.out, args.docs = Path(folder) / OUT.name, False
        return carry_out(args, wanted)


if __name__ == "__main__":
    sys.exit(main())
