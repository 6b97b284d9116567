"""`psabench view`: the bus live in Foxglove, Lichtblick and PlotJuggler."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from psabench.errors import expected
from psabench.options import CAN_HELP, Parser, add_board, node_of, positive
from psabench.places import no_package

PORT = 8765  # what Foxglove offers

EPILOG = """\
examples:
  psabench view --can socketcand:127.0.0.1:29536          then open ws://127.0.0.1:8765 in Foxglove
  psabench view --can slcan:/dev/ttyACM0 --board psd1 --port 9000

Serves until --for, Ctrl-C, or the end of the link (exit status 3). The server accepts local connections only.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench view`. Raises BadInput."""
    p = Parser(prog="psabench view", description="Serve a CAN bus live as a Foxglove WebSocket.", epilog=EPILOG)
    p.set_defaults(handler=_view_bus)
    p.add_argument("--can", help=CAN_HELP)
    add_board(p, "whose frames are decoded")
    p.add_argument("--port", type=_view_port, default=PORT, help="TCP port on 127.0.0.1; 0: a free one (%(default)s)")
    p.add_argument("--for", dest="for_s", type=positive, metavar="SECONDS", help="stop after this wall time")
    p.add_argument("--v-per-g", type=positive, default=1.0, help="nominal scale of /nodeN/imu, V/g (%(default)g)")
    return p.parse_args(words)


def _view_port(text: str) -> int:
    if not text.isdecimal() or int(text) > 65535:
        raise argparse.ArgumentTypeError(expected("a TCP port, 0 to 65535", repr(text)))
    return int(text)


def _view_bus(args: argparse.Namespace) -> int:
    from psabench.link.can_host import open_bus

    try:
        from psabench.logs.view import view
    except ImportError as e:
        raise no_package(e, "view") from e

    def ready(address: str) -> None:
        print(f"ready {address}", flush=True)

    v = view(open_bus(args.can), args.port, node_of(args), args.board, args.for_s, args.v_per_g, ready)
    print(f"{v.frames} frames, {v.decoded} decoded; {v.warnings} warnings about clients")
    if v.broken:
        print(f"psabench: {v.broken}", file=sys.stderr)
        return 3
    return 0
