"""How often gyrocompassing doubts a good run: instruments with the article's errors, drawn again, by latitude."""

from __future__ import annotations

import argparse
import sys
import zlib
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial

import numpy as np

LATITUDES_DEG = (0.0, 10.0, -10.0, 20.0, -20.0, 45.0, -45.0, 60.0, -60.0, 80.0, -80.0)
CHUNK = 50  # runs of one task
WORDS = 40  # of a doubt, that tell which check it is

EPILOG = """\
example (in the root of a checkout, with PYTHONPATH=tools:tests/py/support):
  python -m tests.coverage.doubts improved --latitude 80 --latitude -80 --runs 2000

The table is the one of docs/procedures/gyrocompass.md.
"""


def doubts_of_runs(reading: str, latitude_deg: float, first: int, runs: int) -> Counter[str]:
    """Doubts of runs `first` and on, each with a generator of its own: by check, and by "runs" how many had one."""
    from gyro_instruments import article_s_instrument, run

    found: Counter[str] = Counter()
    for k in range(first, first + runs):
        rng = np.random.default_rng([zlib.crc32(reading.encode()), round(latitude_deg * 100.0) % 36000, k])
        bench = replace(article_s_instrument(rng), latitude_deg=latitude_deg)
        doubts = run(bench, reading, latitude_deg=latitude_deg).doubts
        found.update({d[:WORDS] for d in doubts})
        found["runs"] += bool(doubts)
    return found


def make_parser() -> argparse.ArgumentParser:
    """Options."""
    p = argparse.ArgumentParser(
        prog="doubts", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("reading", choices=("article", "improved"))
    p.add_argument("--latitude", type=float, action="append", metavar="DEG", help="one or several (those of the page)")
    p.add_argument("--runs", type=int, default=2000, metavar="N", help="at each latitude (%(default)s)")
    p.add_argument("--jobs", type=int, default=2, metavar="N", help="processes (%(default)s)")
    return p


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = make_parser().parse_args(argv)
    firsts = range(0, args.runs, CHUNK)
    with ProcessPoolExecutor(args.jobs) as pool:
        for latitude_deg in args.latitude or LATITUDES_DEG:
            work = partial(doubts_of_runs, args.reading, latitude_deg)
            parts = pool.map(work, firsts, [min(CHUNK, args.runs - first) for first in firsts])
            found = sum(parts, Counter[str]())
            share = found.pop("runs", 0) / args.runs
            print(
                f"{args.reading} {latitude_deg:+.0f} deg: {100.0 * share:.2f} % of {args.runs}", dict(found), flush=True
            )
    return 0


if __name__ == "__main__":
    sys.exit(main())
