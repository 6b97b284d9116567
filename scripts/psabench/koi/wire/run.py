"""`psabench run koi-flight`: one flight over the wire, or from its recording; beside the truth where there is one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from psabench.boards.bins.device import Bins, Weights
from psabench.errors import BadInput, expected
from psabench.koi.autocal import Knowledge
from psabench.koi.flight_data import FlightFound, FlightSetup
from psabench.koi.host import FlightHost
from psabench.koi.wire.clock import ReceiverClock
from psabench.koi.wire.feed import FlightFeed
from psabench.koi.wire.live import LiveFlight, serial_of
from psabench.koi.wire.params import NAME, TRUTH_LOG, KoiOptions, KoiParams
from psabench.koi.wire.port import SerialPort
from psabench.koi.wire.recording import FlightRecorder, Look, read_events, read_setup
from psabench.koi.wire.truth import Graded, grade_flight, read_truth
from psabench.link.endpoints import emulator_endpoints
from psabench.native.nav import Refused
from psabench.procedures.head_bench import Progress
from psabench.procedures.result import made_params

EXPECTED_MIN = 82  # of a whole flight, for the progress line


@dataclass(frozen=True, slots=True, kw_only=True)
class KoiRun:
    """A flight that is over."""

    params: KoiParams
    found: FlightFound
    feed: FlightFeed
    facts: Mapping[str, str]
    graded: Graded | None

    @property
    def notes(self) -> list[str]:
        """What was wrong on the lines."""
        return self.feed.notes()


def run_flight(
    options: KoiOptions,
    progress: Progress,
    *,
    serial: str = "unit",
    time_s: float = 0.0,
    known: Knowledge | None = None,
) -> KoiRun:
    """Fly, or read; find; grade. What came is in OUT. Raises BadInput, BenchError."""
    options.check()
    p = made_params(KoiParams, NAME, options.params)
    setup = p.setup(serial, time_s, known)
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / TRUTH_LOG).unlink(missing_ok=True)
    try:
        feed = read_flight(options.data, p, setup) if options.data else _fly_live(options, p, setup, progress)
        found = feed.finish()
    except Refused as e:
        raise BadInput(f"{NAME}: {e}") from e
    graded = grade_feed(feed, found, options.data or options.out)
    facts = _run_facts(options, feed)
    return KoiRun(params=p, found=found, feed=feed, facts=facts, graded=graded)


def grade_feed(feed: FlightFeed, found: FlightFound, folder: Path) -> Graded | None:
    """Beside the truth in that folder; None: there is none. Raises BadInput."""
    truth, begin_us = read_truth(folder / TRUTH_LOG), feed.grid.begin_us
    return None if truth is None or begin_us is None else grade_flight(found, begin_us * 1e-6, truth)


def new_feed(setup: FlightSetup, p: KoiParams, weights: Weights, node: int) -> FlightFeed:
    """From frames and bytes to a host with this set-up."""
    return FlightFeed(FlightHost(setup), weights, node, ReceiverClock(p.limits))


def _fly_live(options: KoiOptions, p: KoiParams, setup: FlightSetup, progress: Progress) -> FlightFeed:
    with options.open_bench() as bench:
        unit = next((u for u in bench.units.values() if isinstance(u, Bins)), None)
        if unit is None:
            raise BadInput(expected("a scenario with an inertial unit, as koi_flight", "none", "--scenario"))
        at = options.control
        endpoints = emulator_endpoints(at) if at else bench.emulator.endpoints if bench.emulator else []
        port = SerialPort(serial_of(bench, options.receiver, endpoints), p.baud)
        try:
            live = LiveFlight(bench, unit, port)
            weights = live.prepare()
            feed = new_feed(setup, p, weights, unit.node.node_id)
            told = {"format": 1, "node": unit.node.node_id, "weights": asdict(weights), "params": asdict(p)}
            told |= {"serial": setup.serial, "time_s": setup.time_s}
            minutes = min(EXPECTED_MIN, round(p.flight_s / 60.0) or 1)
            with FlightRecorder(options.out, told) as recorder, progress.step("flight", minutes) as advance:
                live.fly(feed, recorder, p.flight_s, lambda t_s: advance(f"{t_s:.0f} s"))
        finally:
            port.close()
    return feed


def read_flight(folder: Path, p: KoiParams, setup: FlightSetup) -> FlightFeed:
    """What a recording holds, through a host with this set-up. Raises BadInput, Refused."""
    weights, node = recorded_unit(folder)
    feed = new_feed(setup, p, weights, node)
    for event in read_events(folder):
        if isinstance(event, Look):
            feed.look(event)
        else:
            feed.on_message(event)
    return feed


def recorded_unit(folder: Path) -> tuple[Weights, int]:
    """Weights and node. Raises BadInput."""
    told = read_setup(folder)
    try:
        return Weights(**told["weights"]), int(told["node"])
    except (KeyError, TypeError, ValueError) as e:
        raise BadInput(expected("node and weights of a unit", e, folder)) from e


def _run_facts(options: KoiOptions, feed: FlightFeed) -> dict[str, str]:
    there = options.can or options.control or options.scenario or "koi_flight"
    where: dict[str, Any] = {"data": options.data} if options.data else {"bench": there}
    clock = feed.clock
    return {
        **{k: str(v) for k, v in where.items()},
        "increments": f"{feed.grid.now_s:.2f} s, {feed.grid.counts.filled} rows filled",
        "solutions of the receiver": str(feed.stream.counts.solutions),
        "its clock": f"{clock.rate_ppm:+.2f} ppm ± {2.0 * clock.rate_sd_ppm:.2f} to the unit's",
    }
