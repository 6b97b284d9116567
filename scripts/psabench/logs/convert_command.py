"""`psabench convert`: a CAN log into another format, or into a ROS 2 bag of accelerations."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from psabench.errors import BadInput, expected
from psabench.options import Parser, add_board, node_of, positive
from psabench.output import add_json, show_data
from psabench.places import no_package

EPILOG = """\
examples:
  psabench convert run.log run.mcap             for Foxglove, Lichtblick, PlotJuggler: frames, and decoded messages
  psabench convert run.blf run.mf4              channels with units, for asammdf and CANape
  psabench convert run.mcap run.pcap            for Wireshark
  psabench convert run.log imu.mcap --ros2-imu  a ROS 2 bag of sensor_msgs/Imu, m/s^2

The endings select the formats; docs/tools/logs.md says what each keeps.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench convert`. Raises BadInput."""
    p = Parser(prog="psabench convert", description="Convert a CAN log to another format.", epilog=EPILOG)
    p.set_defaults(handler=_convert_log)
    p.add_argument("file", type=Path, help="CAN log that is read")
    p.add_argument("out", type=Path, help="CAN log that is written")
    add_board(p, "whose frames are decoded")
    p.add_argument("--ros2-imu", action="store_true", help="write a ROS 2 bag (.mcap) of one PSA-2's accelerations")
    p.add_argument("--v-per-g", type=positive, default=1.0, help="nominal scale for --ros2-imu, V/g (%(default)g)")
    add_json(p)
    return p.parse_args(words)


def _convert_log(args: argparse.Namespace) -> int:
    from psabench.logs.formats import read_frames

    if args.out.exists() and args.file.exists() and args.out.samefile(args.file):
        raise BadInput(expected("another file than the one that is read", args.out, "OUT"))
    if args.ros2_imu:
        return _convert_imu(args)
    from psabench.link.log_file import LogFile

    frames = read_frames(args.file)
    first = next(frames, None)  # before OUT is made: the log may not be one
    if first is None:
        raise BadInput(expected("CAN frames", "none", args.file))
    log = LogFile(args.out, {node_of(args): args.board})
    trouble: BadInput | None = None
    try:
        log(first)
        for m in frames:
            if not log(m):
                break
    except BadInput as e:
        trouble = e
    finally:
        stored = log.close()
    show_data(args, {"file": str(args.out), "messages": stored}, [f"{stored} messages in {args.out}"])
    if error := log.error or trouble:
        print(f"psabench: {error}", file=sys.stderr)
        return error.exit_status
    return 0


def _convert_imu(args: argparse.Namespace) -> int:
    from psabench.logs.formats import read_frames

    try:
        from psabench.logs.ros2 import write_imu
    except ImportError as e:
        raise no_package(e, "--ros2-imu") from e
    if args.out.suffix != ".mcap":
        raise BadInput(expected("the ending .mcap for --ros2-imu", args.out.suffix or "none", args.out))
    if args.board != "psa2":
        raise BadInput(expected("psa2 for --ros2-imu", args.board, "--board"))
    stored = write_imu(read_frames(args.file), args.out, node_of(args), args.v_per_g)
    if not stored:
        raise BadInput(expected(f"frames of node {node_of(args)}", "none", args.file))
    line = f"{stored} messages of sensor_msgs/Imu in {args.out}"
    show_data(args, {"file": str(args.out), "messages": stored, "type": "sensor_msgs/Imu"}, [line])
    return 0
