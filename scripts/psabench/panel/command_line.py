"""`psabench panel`: its options. What it needs is loaded when it runs."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from psabench.options import BUS_HELP, Parser, add_scpi, board_name, node_id, port_number, report_folder
from psabench.output import STREAM, add_json
from psabench.places import no_package

EPILOG = """\
examples:
  psabench panel                            an emulator with the scenario calibrate, its time driven by the page
  psabench panel stream --pace wall         in real time
  psabench panel --connect /tmp/psa.ctl     a running emulator; its bus and instruments are found
  psabench panel --recording run.log        a recording of the bus, or of lines: run.vcd

Open the printed address in a browser of this machine. Ctrl-C ends the panel, and the emulator that it has started.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench panel`. Raises BadInput."""
    panel = Parser(
        prog="psabench panel", description="Serve a web page for a bench (docs/tools/panel.md).", epilog=EPILOG
    )
    panel.set_defaults(handler=_run_panel)
    panel.add_argument("scenario", nargs="?", help="scenario of the emulator to start: name or file (calibrate)")
    panel.add_argument("--pace", choices=["wall", "step"], help="pace of that emulator (step)")
    panel.add_argument("--paused", action="store_true", help="in step pace: time stands still until the page says so")
    panel.add_argument("--connect", "--control", type=Path, metavar="CONTROL", help="control socket of an emulator")
    panel.add_argument("--truth", type=Path, metavar="SOCKET", help="truth port of that emulator")
    panel.add_argument("--port", type=port_number, default=0, help="port on 127.0.0.1 (any free one)")
    panel.add_argument("--out", type=report_folder, default=Path("build/panel"), help="folder for files (%(default)s)")
    panel.add_argument("--seed", type=int, help="random seed; overrides the scenario")
    panel.add_argument("--can", help=f"{BUS_HELP}; default: the bus of the emulator")
    add_scpi(panel, "VISA address of an instrument; may be repeated")
    panel.add_argument("--node", type=node_id, help="CANopen node of the unit (the emulator's, else 5)")
    add_json(panel, STREAM)
    panel.add_argument(
        "--recording",
        type=Path,
        metavar="PATH",
        help="instead of a bench: a CAN log, lines as VCD, or a folder of them",
    )
    panel.add_argument("--board", type=board_name, help="with --recording: board of the nodes (psa2)")
    return panel.parse_args(words)


def _run_panel(args: argparse.Namespace) -> int:
    try:
        from psabench.panel import command_run
    except ModuleNotFoundError as e:
        raise no_package(e, "panel") from e
    return command_run.run(args)
