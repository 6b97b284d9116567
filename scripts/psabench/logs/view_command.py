"""`psabench view`: a recording of lines in PulseView or GTKWave; the bus live in Foxglove, Lichtblick, PlotJuggler."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from psabench.errors import BadInput, expected
from psabench.options import CAN_HELP, Parser, add_board, node_of, port_number, positive
from psabench.output import STREAM, add_json, show_data, show_event
from psabench.places import no_package

PORT = 8765  # what Foxglove offers
DECODE_S = 0.2  # of a recording, for GTKWave: two seconds of a processor for a PSA-2, whose frames begin at 189 ms

USAGE = """\
psabench view FILE [--with pulseview|gtkwave] [--decode SECONDS] [--print]
       psabench view [--can BUS] [--board BOARD] [--port PORT] [--for SECONDS] [--v-per-g V]"""
EPILOG = """\
examples:
  psabench view run.vcd                                   PulseView, or GTKWave where it is not installed
  psabench view run.vcd --with gtkwave
  psabench view run.vcd --print                           the command line, for a machine without a display
  psabench view --can socketcand:127.0.0.1:29536          then open ws://127.0.0.1:8765 in Foxglove
  psabench view --can slcan:/dev/ttyACM0 --board psd1 --port 9000

With FILE: writes the session files beside it, as psabench waveform, and keeps those that are there; for GTKWave also
FILE.decoded.vcd, a copy with decoded rows, which sigrok-cli makes. In a browser: psabench panel --recording FILE.
Without: serves until --for, Ctrl-C, or the end of the link (exit status 3). The server accepts local connections only.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench view`. Raises BadInput."""
    p = Parser(
        prog="psabench view",
        usage=USAGE,
        description="Open a recording of lines in a viewer, or serve a CAN bus live as a Foxglove WebSocket.",
        epilog=EPILOG,
    )
    p.set_defaults(handler=_run_view)
    file = p.add_argument_group("a recording of lines")
    file.add_argument("file", type=Path, nargs="?", metavar="FILE", help="VCD file of psa-emu --vcd or probe.start")
    file.add_argument("--with", dest="program", choices=["pulseview", "gtkwave"], help="(the first that is installed)")
    first = "how much of it is decoded for GTKWave, from its first instant on (%(default)g)"
    file.add_argument("--decode", dest="decode_s", type=positive, default=DECODE_S, metavar="SECONDS", help=first)
    file.add_argument("--print", dest="show", action="store_true", help="print the command line instead of starting it")
    live = p.add_argument_group("the bus, live")
    live.add_argument("--can", help=CAN_HELP)
    add_board(live, "whose frames are decoded")
    live.add_argument(
        "--port", type=port_number, default=PORT, help="TCP port on 127.0.0.1; 0: a free one (%(default)s)"
    )
    live.add_argument("--for", dest="for_s", type=positive, metavar="SECONDS", help="stop after this wall time")
    live.add_argument("--v-per-g", type=positive, default=1.0, help="nominal scale of /nodeN/imu, V/g (%(default)g)")
    add_json(p, f"{STREAM}; of --print: the words and the environment")
    args = p.parse_args(words)
    if args.file is None and (args.program or args.show):
        raise BadInput(expected("a VCD file", "none", "--with" if args.program else "--print"))
    of_bus = {"can": "--can", "node": "--node", "port": "--port", "for_s": "--for", "v_per_g": "--v-per-g"}
    both = [option for name, option in of_bus.items() if args.file and getattr(args, name) != p.get_default(name)]
    if both:
        raise BadInput(expected(f"a file or {both[0]}", "both", "view"))
    return args


def _run_view(args: argparse.Namespace) -> int:
    if args.file is None:
        return _view_bus(args)
    from psabench.logs.vcd_view import start_of, view_file

    if not args.show:
        view_file(args.file, args.program, args.decode_s)
        return 0
    start = start_of(args.file, args.program, args.decode_s)
    show_data(args, {"command": [*start.words], "environment": dict(start.environment)}, [start.command_line()])
    return 0


def _view_bus(args: argparse.Namespace) -> int:
    from psabench.link.can_host import open_bus

    try:
        from psabench.logs.view import view
    except ImportError as e:
        raise no_package(e, "view") from e

    def ready(address: str) -> None:
        show_event(args, {"event": "ready", "address": address}, f"ready {address}")

    v = view(open_bus(args.can), args.port, node_of(args), args.board, args.for_s, args.v_per_g, ready)
    counts = {"frames": v.frames, "decoded": v.decoded, "warnings": v.warnings}
    line = f"{v.frames} frames, {v.decoded} decoded; {v.warnings} warnings about clients"
    show_event(args, {"event": "end", **counts}, line)
    if v.broken:
        print(f"psabench: {v.broken}", file=sys.stderr)
        return 3
    return 0
