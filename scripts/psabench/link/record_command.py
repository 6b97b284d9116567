"""`psabench record`: its options, and what is printed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.options import CAN_HELP, Parser, add_board, natural, node_of, positive
from psabench.output import add_json, show_data

if TYPE_CHECKING:
    import can

FORMATS = ".asc .blf .csv .db .lcmlog .log .mcap .mf4 .pcap .trc .txt"  # of log_file, without loading it

EPILOG = """\
examples:
  psabench record run.log --can socketcand:127.0.0.1:29536         until Ctrl-C, candump -L format
  psabench record run.blf --can slcan:/dev/ttyACM0 --for 60        one minute, for CANalyzer
  psabench record run.mcap --can socketcand:127.0.0.1:29536        for Foxglove and PlotJuggler, decoded as well
  psabench record run.asc --can socketcan:vcan0,fd=true --count 1000
  psabench record run.lcmlog --can socketcand:127.0.0.1:29536      for lcm-logplayer
  psabench record run.log --lcm udpm://239.255.76.67:7667          what psa-emu --lcm publishes

Stops at --for, --count, Ctrl-C, SIGTERM, or with exit status 3 when the link fails, the disk is full or the file is
removed. The file is readable in each case and holds the messages counted as stored.
lost: missing frame numbers; torn: frames with one half only; overruns: conversions that the board missed.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench record`. Raises BadInput."""
    p = Parser(
        prog="psabench record",
        description="Record all frames of a CAN bus and count the frames that one node lost.",
        epilog=EPILOG,
    )
    p.set_defaults(handler=_record, kept="what was recorded is kept")
    p.add_argument("file", type=Path, help=f"log file; its extension selects the format: {FORMATS}")
    source = p.add_mutually_exclusive_group()
    source.add_argument("--can", help=CAN_HELP)
    source.add_argument("--lcm", metavar="URL", help="CAN frames that are published with LCM, udpm://GROUP:PORT")
    add_board(p, "whose frames are counted")
    p.add_argument("--for", dest="for_s", type=positive, metavar="SECONDS", help="stop after this wall time")
    p.add_argument("--count", type=natural, help="stop after this number of CAN messages")
    add_json(p)
    return p.parse_args(words)


def _source(args: argparse.Namespace) -> can.BusABC:
    if args.lcm is not None:
        from psabench.lcm.channel import LcmBus

        return LcmBus(args.lcm)
    from psabench.link.can_host import open_bus

    return open_bus(args.can)


def _record(args: argparse.Namespace) -> int:
    from psabench.link.record import record

    node = node_of(args)
    r = record(_source(args), args.file, node, args.for_s, args.count, args.board)
    c = r.counters
    counts = {"node": node, "frames": c.frames, "lost": c.lost, "torn": c.torn, "overruns": c.overruns}
    span_s = r.last_s - r.first_s
    show_data(
        args,
        {"file": str(args.file), "messages": r.stored, "received": r.received, "span_s": span_s, **counts},
        [
            f"{r.stored} messages, {span_s:.3f} s, in {args.file}",
            f"frames of node {node}: {c.frames}, lost {c.lost}, torn {c.torn}, overruns {c.overruns}",
        ],
    )
    if r.unstored:
        print(f"psabench: {r.unstored}; stored {r.stored} of {r.received} messages", file=sys.stderr)
        return r.unstored.exit_status
    if r.broken:
        print(f"psabench: {r.broken}; the recording up to there is complete", file=sys.stderr)
        return 3
    return 0
