"""`psabench mavlink`: its options, and what is printed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from psabench.boards.registry import DBC_NODE
from psabench.errors import BadInput, expected
from psabench.instruments import EXAMPLES
from psabench.options import BUS_HELP, Parser, natural, node_id, positive
from psabench.output import STREAM, add_json, show_event
from psabench.procedures.command_line.offered import G_MPS2, ON_THE_HEAD

AUTOPILOTS = ("generic", "px4", "ardupilot", "invalid")  # psabench.mavlink.station has their numbers

EPILOG = """\
examples:
  psabench mavlink                                             an emulator of its own, for a ground station on UDP 14550
  psabench mavlink --mavlink tcp:5760 --control build/ctl      the bench of a running emulator
  psabench mavlink --can slcan:/dev/ttyACM0 --head TCPIP::192.0.2.7::5025::SOCKET   a bench in the laboratory
  psabench mavlink --log run.blf --mavlink udp:14550           a recorded log

MAV_CMD_PREFLIGHT_CALIBRATION with param5 = 1 runs the procedure; with zeros alone it cancels it.
"""


def mavlink_port(text: str) -> Any:
    """A value of --mavlink; it needs no library."""
    from psabench.mavlink.ports import port_spec

    try:
        return port_spec(text)
    except ValueError as e:
        raise argparse.ArgumentTypeError(str(e)) from e


def stream_rate(text: str) -> float:
    """Hz, 0 for off."""
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not (value == 0.0 or 0.01 <= value <= 10000.0):
        raise argparse.ArgumentTypeError(expected("0 or a number from 0.01 to 10000", repr(text)))
    return value


def system_id(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= 255:
        raise argparse.ArgumentTypeError(expected("an integer from 1 to 255", repr(text)))
    return int(text)


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench mavlink`. Raises BadInput."""
    p = Parser(
        prog="psabench mavlink",
        description="Be a MAVLink system: readings of a PSA-2 on CAN, its parameters, and calibrations that run.",
        epilog=EPILOG,
    )
    p.set_defaults(handler=_run_mavlink)
    p.add_argument(
        "--mavlink",
        type=mavlink_port,
        default="udp:14550",
        metavar="PORT",
        help="udp[:PORT] (sends to 127.0.0.1), udpin[:PORT] or tcp[:PORT] (wait there) (%(default)s)",
    )
    p.add_argument("--sysid", type=system_id, default=1, metavar="N", help="system id (%(default)s)")
    p.add_argument("--compid", type=system_id, default=1, metavar="N", help="component id (%(default)s)")
    p.add_argument(
        "--autopilot", choices=AUTOPILOTS, default="px4", help="autopilot of the heartbeat; MAVSDK calibrates px4 alone"
    )
    p.add_argument("--imu", type=stream_rate, default=50.0, metavar="HZ", help="rate of HIGHRES_IMU (%(default)g)")
    p.add_argument("--angles", type=stream_rate, default=5.0, metavar="HZ", help="rate of ATTITUDE (%(default)g)")
    p.add_argument("--codes", type=stream_rate, metavar="HZ", help="rate of PSABENCH_ACCEL (each reading)")
    p.add_argument("--for", dest="for_s", type=positive, metavar="SECONDS", help="stop after this wall time")
    add_json(p, STREAM)
    group = p.add_argument_group("the bench")
    group.add_argument("--can", help=BUS_HELP)
    group.add_argument("--head", metavar="VISA-ADDRESS", help=f"dividing head: {EXAMPLES}")
    group.add_argument("--control", type=Path, metavar="SOCKET", help="control socket of a running emulator")
    group.add_argument("--scenario", default="calibrate", help="of the emulator that is started (%(default)s)")
    group.add_argument("--seed", type=int, metavar="N", help="random seed of that emulator")
    group.add_argument("--real-time", action="store_true", help="that emulator calibrates at wall-clock pace, too")
    group.add_argument("--node", type=node_id, default=DBC_NODE, metavar="N", help="CANopen node (%(default)s)")
    group = p.add_argument_group("a log instead")
    group.add_argument("--log", type=Path, metavar="FILE", help="recorded log, in a format that psabench decode reads")
    group.add_argument("--speed", type=float, default=1.0, metavar="X", help="1: as recorded; 0: as fast as possible")
    group = p.add_argument_group("calibration")
    group.add_argument("--procedure", choices=list(ON_THE_HEAD), default="turns", help="procedure (%(default)s)")
    group.add_argument(
        "--axis", choices=("x", "y", "z"), default="x", help="channel of the accelerometer (%(default)s)"
    )
    group.add_argument("--realisations", type=natural, metavar="N", help="repetitions (the procedure's default)")
    group.add_argument("--average", type=natural, default=16, metavar="N", help="samples per reading (%(default)s)")
    group.add_argument("--gravity", type=positive, default=G_MPS2, metavar="M/S2", help="local g (%(default)s)")
    return p.parse_args(words)


def _run_mavlink(args: argparse.Namespace) -> int:
    from psabench.mavlink.bridge import LiveBridge, LogBridge

    if args.log and (args.can or args.head or args.control):
        raise BadInput(expected("a log or a bench", "both", "--log"))
    if not 0.0 <= args.speed < float("inf"):
        raise BadInput(expected("0 or a number above it", args.speed, "--speed"))
    options = _bridge_options(args)
    if args.log:
        log = LogBridge(options, args.log, args.node, args.speed)
        return _run_bridge(args, log)
    with _open_bench(args) as bench:
        return _run_bridge(args, LiveBridge(options, bench))


def _bridge_options(args: argparse.Namespace) -> Any:
    from psabench.mavlink.bridge import BridgeOptions
    from psabench.mavlink.calibration import CalibrationPlan
    from psabench.mavlink.station import AUTOPILOTS as NUMBERS
    from psabench.mavlink.station import Identity

    params = {"axis": args.axis} | ({} if args.realisations is None else {"realisations": args.realisations})
    return BridgeOptions(
        port=args.mavlink,
        identity=Identity(sysid=args.sysid, compid=args.compid, autopilot=NUMBERS[args.autopilot]),
        imu_hz=args.imu,
        angles_hz=args.angles,
        codes_hz=args.codes,
        for_s=args.for_s,
        plan=CalibrationPlan(procedure=args.procedure, params=params, average=args.average, g_mps2=args.gravity),
    )


def _open_bench(args: argparse.Namespace) -> Any:
    from psabench.bench import Bench

    if args.can or args.control:
        scpi = {"head": args.head} if args.head else {}
        return Bench.connect(args.can, scpi=scpi, control=args.control, node=args.node)
    pace = "wall" if args.real_time else "step"
    return Bench.start(args.scenario, pace=pace, seed=args.seed, node=args.node)


def _run_bridge(args: argparse.Namespace, bridge: Any) -> int:
    port = bridge.station.port
    where = {"mavlink": bridge.options.port.kind, "host": port.host, "port": port.port}
    line = f"ready mavlink={bridge.options.port.kind} host={port.host} port={port.port}\nready all"
    show_event(args, {"event": "ready", **where}, line)
    try:
        bridge.run()
    except KeyboardInterrupt:  # the usual end
        pass
    finally:
        bridge.close()
        s = bridge.station
        counts = {
            "readings": bridge.samples.count,
            "messages_sent": s.messages_sent,
            "lost": port.lost,
            "received": s.received,
            "malformed": s.malformed,
        }
        print(", ".join(f"{k.replace('_', ' ')} {v}" for k, v in counts.items()), file=sys.stderr)
        if args.json:
            show_event(args, {"event": "end", **counts}, "")
    return 0
