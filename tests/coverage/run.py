"""Coverage of the stated uncertainties: seeded runs through the wire, how often U contains the truth."""

from __future__ import annotations

import argparse
import json
import signal
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import islice
from pathlib import Path

from tests.coverage.studies import STUDIES, run_study
from tests.coverage.table import Run, coverage_kept, markdown_table, pooled_share, rows_of

ROOT = Path(__file__).resolve().parents[2]
OUT = ROOT / "build" / "coverage.jsonl"
PAGE = ROOT / "docs/reference/coverage.md"
MARK = "<!-- table of tests/coverage -->"

EPILOG = """\
examples (in the root of a checkout, with PYTHONPATH=tools):
  python -m tests.coverage.run                        seeds 1 to 200 of every study: an hour of two cores
  python -m tests.coverage.run calibrations --seeds 12
  python -m tests.coverage.run --minutes 10 --docs    as far as it comes, into docs/reference/coverage.md

Runs that are in build/coverage.jsonl are not run again; remove the file after a change of procedures or physics.
Exit status: 0 every quantity within its band and all together at 94 to 96 %, 1 not, 2 bad input, 130 ended by Ctrl-C.
"""


def make_parser() -> argparse.ArgumentParser:
    """Options."""
    p = argparse.ArgumentParser(
        prog="coverage", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("studies", nargs="*", metavar="STUDY", help=f"{', '.join(STUDIES)} (all)")
    p.add_argument("--seeds", type=int, default=200, metavar="N", help="1 to N (%(default)s)")
    p.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (%(default)s)")
    p.add_argument(
        "--minutes", type=float, default=60.0, metavar="N", help="begin no run after that; 0: none at all (%(default)g)"
    )
    p.add_argument("--out", type=Path, default=OUT, metavar="FILE", help="results (build/coverage.jsonl)")
    p.add_argument("--docs", action="store_true", help="write the table of docs/reference/coverage.md")
    return p


def load_runs(path: Path) -> dict[tuple[str, int], Run]:
    """What was run, by study and seed; a last line that was cut short is left out."""
    found: dict[tuple[str, int], Run] = {}
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        try:
            row = json.loads(line)
        except ValueError:
            continue
        found[row["study"], row["seed"]] = {name: (z, en) for name, (z, en) in row["run"].items()}
    return found


def run_missing(todo: Sequence[tuple[str, int]], args: argparse.Namespace) -> None:
    """Runs and stores, a line for each. Ctrl-C ends it; what is stored stays."""
    ends_s = time.monotonic() + 60.0 * args.minutes
    args.out.parent.mkdir(parents=True, exist_ok=True)
    if args.out.exists() and not args.out.read_text(encoding="utf-8").endswith("\n"):
        args.out.write_text(args.out.read_text(encoding="utf-8") + "\n", encoding="utf-8")  # a line that was cut
    with ProcessPoolExecutor(args.jobs) as pool, args.out.open("a", encoding="utf-8") as out:
        waiting = iter(todo if args.minutes > 0.0 else ())
        futures = {pool.submit(run_study, *key): key for key in islice(waiting, args.jobs)}
        done = 0
        while futures:
            future = next(as_completed(futures))
            study, seed = futures.pop(future)
            out.write(json.dumps({"study": study, "seed": seed, "run": future.result()}) + "\n")
            out.flush()
            done += 1
            print(f"{done}/{len(todo)} {study}, seed {seed}", flush=True)
            key = next(waiting, None) if time.monotonic() < ends_s else None
            if key is not None:
                futures[pool.submit(run_study, *key)] = key


def write_page(table: str) -> None:
    """The table behind the mark of the page."""
    head = PAGE.read_text(encoding="utf-8").partition(MARK)[0]
    PAGE.write_text(f"{head}{MARK}\n\n{table}\n", encoding="utf-8")


def report_table(known: Mapping[tuple[str, int], Run], wanted: Sequence[tuple[str, int]], docs: bool) -> int:
    """Prints the table; returns the exit status."""
    rows = rows_of(known[key] for key in wanted if key in known)
    if not rows:
        print("no run")
        return 1
    table = markdown_table(rows)
    print(table)
    left = sum(key not in known for key in wanted)
    print(f"{'kept' if coverage_kept(rows) else 'NOT KEPT'}: {pooled_share(rows):.3f} of all; {left} runs are left")
    if docs:
        write_page(table)
    return 0 if coverage_kept(rows) else 1


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = make_parser().parse_args(argv)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    unknown = [s for s in args.studies if s not in STUDIES]
    if unknown:
        print(f"coverage: expected {', '.join(STUDIES)}, got {', '.join(unknown)}", file=sys.stderr)
        return 2
    wanted = [(study, seed) for seed in range(1, args.seeds + 1) for study in args.studies or STUDIES]
    known = load_runs(args.out)
    try:
        run_missing([key for key in wanted if key not in known], args)
    except KeyboardInterrupt:
        report_table(load_runs(args.out), wanted, args.docs)
        return 130
    return report_table(load_runs(args.out), wanted, args.docs)


if __name__ == "__main__":
    sys.exit(main())
