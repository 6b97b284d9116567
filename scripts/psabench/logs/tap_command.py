"""`psabench tap`: its options, and what is printed."""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.errors import BadInput, check_there, expected
from psabench.options import LINE_HZ, Parser, positive
from psabench.output import STREAM, add_json, show_event

if TYPE_CHECKING:
    from psabench.logs.tap import Tap

EPILOG = """\
examples:
  psabench tap slcan /dev/ttyACM0 run.pcap          prints a port for the CAN program, e.g. slcan:/dev/pts/7
  psabench tap bus build/busport run.pcap --for 60  the bus port of psa-emu --bus-port build/busport
  psabench tap line build/capture.bin run.pcap      bytes that were recorded from the line port
  mkfifo run.pcap; wireshark -k -i run.pcap &       then any of them: live

Stops at --for, at the end of PORT, at Ctrl-C. The dissectors: psabench waveform --wireshark.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench tap`. Raises BadInput."""
    p = Parser(prog="psabench tap", description="Record what is on a serial port, for Wireshark.", epilog=EPILOG)
    p.set_defaults(handler=_run_tap)
    p.add_argument("kind", choices=("slcan", "bus", "line"), help="what the port speaks")
    p.add_argument(
        "port", type=Path, metavar="PORT", help="serial port, pseudo-terminal, or file with bytes of a board"
    )
    p.add_argument("out", type=Path, metavar="OUT", help="pcap file")
    p.add_argument("--for", dest="for_s", type=positive, metavar="SECONDS", help="stop after this wall time")
    p.add_argument("--line-hz", type=positive, default=LINE_HZ, help="samples a second of the line port (%(default)g)")
    add_json(p, STREAM)
    return p.parse_args(words)


def _run_tap(args: argparse.Namespace) -> int:
    from psabench.logs import tap

    check_there(args.port, "a port or a file")
    if args.out.exists() and args.port.samefile(args.out):
        raise BadInput(expected("another file than the one that is read", args.out, "OUT"))
    with tap.tap_file(args.kind, args.out) as t:
        if args.port.is_file():
            tap.read_capture(t, args.port, args.line_hz)
        else:
            _tap_port(args, t)
    to, back = t.packets[tap.TO_BOARD], t.packets[tap.FROM_BOARD]
    counts = {"to_board": to, "from_board": back, "cut": t.cut}
    line = f"{to} packets to the board, {back} from it, in {args.out}"
    show_event(args, {"event": "end", "file": str(args.out), **counts}, line)
    if t.cut:
        print(f"{t.cut} were too long and are in pieces", file=sys.stderr)
    return 0


def _tap_port(args: argparse.Namespace, t: Tap) -> None:
    from psabench.logs.tap import Relay

    start_ns = time.time_ns()
    deadline_s = None if args.for_s is None else time.monotonic() + args.for_s
    samples = args.kind == "line"  # have their times from their rate

    def took(direction: int, data: bytes) -> None:
        now_ns = time.time_ns()
        t.take_bytes(direction, data, lambda at: start_ns + round(at * 1e9 / args.line_hz) if samples else now_ns)

    with Relay(args.port, one_way=samples) as relay:
        where = {} if samples else {"tap": str(relay.path)}
        show_event(args, {"event": "ready", **where}, " ".join(["ready", *(f"{k}={v}" for k, v in where.items())]))
        try:
            relay.pass_on(took, deadline_s)
        except KeyboardInterrupt:
            if not args.json:
                print()
