"""`psabench decode`: its options, and where the table goes."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psabench.errors import BadInput, expected
from psabench.link.own import output_text
from psabench.options import LINE_HZ, Parser, add_board, node_of, positive
from psabench.output import add_json, print_json
from psabench.passport.command import STORE

if TYPE_CHECKING:
    from psabench.boards.decode import Form
    from psabench.thermal.apply import Compensator

Decoded = tuple[dict[str, int], int]  # counters, exit status

ARTICLE_CONFIG0 = 0x56
EPILOG = """\
examples:
  psabench decode run.log --out run.csv        frames of node 5: time of reception and of sampling, volts at the load
  psabench decode run.blf --node 7 | head
  psabench decode run.log --passport QA-0001   with acceleration, by the curves of a passport
  psabench decode --line capture.bin           words from INT/DATA/CLK samples; capture: cat LINK > capture.bin

Counters on stderr at the end: frames, lost, torn (CAN); also late, early, gaps with --line.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench decode`. Raises BadInput."""
    p = Parser(
        prog="psabench decode",
        description="Convert the frames of one node in a CAN log, or the words in a capture of the line port, to CSV.",
        epilog=EPILOG,
    )
    p.set_defaults(handler=_decode)
    p.add_argument("file", type=Path, help="CAN log (python-can formats), or line port samples with --line")
    p.add_argument("--out", type=Path, help="CSV file (standard output)")
    add_board(p, "to decode")
    p.add_argument("--line", action="store_true", help="read INT/DATA/CLK samples, one byte each")
    p.add_argument("--word-bits", type=int, default=32, help="word width on the line: 16, 24 or 32 (%(default)s)")
    p.add_argument("--sample-hz", type=positive, default=LINE_HZ, help="sample rate of the capture (%(default)g)")
    p.add_argument(
        "--passport",
        metavar="SERIAL[@NUMBER]",
        help="acceleration as well, by the curves of this unit (of its latest run)",
    )
    p.add_argument(
        "--config0",
        type=_register_value,
        default=ARTICLE_CONFIG0,
        metavar="VALUE",
        help="for --passport: CONFIG0 of the converters, whose filter has a known gain (0x56, the article's)",
    )
    p.add_argument("--store", type=Path, default=STORE, help="store of passports (%(default)s)")
    add_json(p, "print one JSON object per row instead of CSV; with --out, its counters")
    return p.parse_args(words)


def _register_value(text: str) -> int:
    try:
        value = int(text, 0)
    except ValueError:
        value = -1
    if not 0 <= value <= 0xFF:
        raise argparse.ArgumentTypeError(expected("a byte as 0x56", repr(text)))
    return value


def _decode(args: argparse.Namespace) -> int:
    from psabench.boards.decode import csv_table, json_table

    if args.line and args.board != "psa2":
        raise BadInput(expected("a CAN log for this board (leave --line out)", args.board, "--line"))
    if args.passport and (args.line or args.board != "psa2"):
        raise BadInput(expected("a CAN log of a PSA-2", "--line" if args.line else args.board, "--passport"))
    if args.out and args.out.exists() and args.file.exists() and args.out.samefile(args.file):
        raise BadInput(expected("another file than the one that is read", args.out, "--out"))
    with output_text(args.out) if args.out else _Stdout() as out:
        form = csv_table if args.out or not args.json else json_table
        counts, status = _decode_line(args, out, form) if args.line else _decode_can(args, out, form)
    if args.out and args.json:
        print_json({"file": str(args.out), **counts})
    return status


def _decode_line(args: argparse.Namespace, out: Any, form: Form) -> Decoded:
    from psabench.boards.decode import decode_line
    from psabench.link.lineport import LineFormat

    try:
        line_format = LineFormat(word_bits=args.word_bits, sample_hz=args.sample_hz)
    except ValueError as e:
        raise BadInput(str(e)) from e
    counts = decode_line(args.file, line_format, out, form).counts
    print(counts, file=sys.stderr)
    return asdict(counts), 0


def _decode_can(args: argparse.Namespace, out: Any, form: Form) -> Decoded:
    from psabench.boards.decode import decode_can

    compensator = _open_compensator(args) if args.passport else None
    columns = compensator.columns if compensator else None
    c = decode_can(args.file, node_of(args), out, args.board, columns, form).counters
    print(f"frames {c.frames}, lost {c.lost}, torn {c.torn}", file=sys.stderr)
    counts = {"frames": c.frames, "lost": c.lost, "torn": c.torn}
    return counts, _report_compensation(compensator, c.frames) if compensator else 0


def _report_compensation(compensator: Compensator, frames: int) -> int:
    """What has to be known of the accelerations; the exit status."""
    from psabench.thermal.bench import SENSOR_HIGH_C, SENSOR_LOW_C

    if compensator.clamped:
        what = "frames at temperatures outside of the compensation; taken at the end of its range"
        print(f"{compensator.clamped} {what}", file=sys.stderr)
    if compensator.open:
        what = f"temperatures of the case outside {SENSOR_LOW_C:g} to {SENSOR_HIGH_C:g} degC"
        print(f"{compensator.open} {what}: its sensor is open, the last one holds", file=sys.stderr)
    if compensator.blind:
        print(f"{compensator.blind} frames without acceleration: no temperature of the case", file=sys.stderr)
    return 1 if compensator.open or compensator.blind >= frames else 0


def _open_compensator(args: argparse.Namespace) -> Compensator:
    from psabench.boards.psa2.device import filter_gain_of
    from psabench.passport.store import PassportStore, find_run
    from psabench.thermal.apply import Compensator, has_every_curve

    with PassportStore(args.store, read_only=True) as store:
        run = find_run(store, args.passport, has_every_curve, "a run of psabench run thermal")
    return Compensator(run.curves, filter_gain_of(args.config0))


class _Stdout:
    """Standard output as a context that does not close it."""

    def __enter__(self) -> Any:
        return sys.stdout

    def __exit__(self, *_: object) -> None:
        sys.stdout.flush()
