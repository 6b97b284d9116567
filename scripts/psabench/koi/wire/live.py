"""A flight on a bench: the unit's readings over CAN, the receiver's port, in lockstep with simulated time or in real time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

from psabench.bench import Bench
from psabench.boards.bins.device import Bins, Weights
from psabench.errors import DeviceError, expected
from psabench.koi.wire.feed import FlightFeed
from psabench.koi.wire.port import LEAST_S, WALL_S, LookPlan, SerialPort
from psabench.koi.wire.recording import FlightRecorder, Look

PERIOD_S = 0.01
QUIET_LOOK_S = 0.25  # between two entries of a port without bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class LandedRule:
    """When a flight is over, by the receiver: it has flown, and stands (E0)."""

    flown_mps: float = 40.0
    rest_mps: float = 0.5
    rest_s: float = 30.0


@dataclass
class Landing:
    """Fed with the receiver's ground speed."""

    rule: LandedRule
    _flown: bool = False
    _rest_since_s: float | None = None

    def take(self, t_s: float, speed_mps: float, *, valid: bool) -> bool:
        """Whether the flight is over."""
        if not valid:
            return False
        self._flown = self._flown or speed_mps > self.rule.flown_mps
        if speed_mps > self.rule.rest_mps:
            self._rest_since_s = None
        elif self._rest_since_s is None:
            self._rest_since_s = t_s
        return self._flown and self._rest_since_s is not None and t_s - self._rest_since_s >= self.rule.rest_s


class LiveFlight:
    """One flight over the wire; what comes is recorded before it is used."""

    def __init__(self, bench: Bench, unit: Bins, port: SerialPort) -> None:
        self._bench, self._unit, self._port = bench, unit, port
        self._plan = LookPlan()
        self._landing = Landing(LandedRule())
        self._begin_s = 0.0  # of the last frame before the look before
        self._looked_s = 0.0

    def prepare(self) -> Weights:
        """The unit is ready; its weights. Raises BenchError, DeviceError for another period than 10 ms."""
        self._unit.wait_ready()
        got = self._unit.stream(3)
        period = float(got.t_sample_s[-1] - got.t_sample_s[-2])
        if abs(period - PERIOD_S) > 0.1 * PERIOD_S:
            raise DeviceError("increments", 0, expected("readings every 10 ms", f"{period * 1e3:.3f} ms"))
        self._unit.also("BINS_BARO")
        return self._unit.weights()

    def fly(self, feed: FlightFeed, recorder: FlightRecorder, for_s: float, advance: Callable[[float], None]) -> None:
        """Until it has landed, or for_s. Ctrl-C ends it as well; what has come is in the recording."""
        host = self._bench.host
        with ExitStack() as stack:
            for unit in self._bench.units.values():  # their own readers would look at each frame, too
                host.listeners.remove(unit.frames.on_message)
                stack.callback(host.listeners.append, unit.frames.on_message)
            for listener in (recorder.on_message, feed.on_message):
                host.listeners.append(listener)
                stack.callback(host.listeners.remove, listener)
            self._port.take()  # what came before belongs to no time
            self._unit.start()
            try:
                self._follow(feed, recorder, for_s, advance)
            finally:
                self._unit.stop()

    def _follow(self, feed: FlightFeed, recorder: FlightRecorder, for_s: float, advance: Callable[[float], None]) -> None:
        begin_s = self._looked_s = self._bench.time_s
        landed, shown_s = False, 0.0
        while not landed and feed.grid.now_s < for_s and not feed.grid.ended:
            if self._bench.time_s - begin_s > for_s + 10.0:
                raise DeviceError("increments", 0, expected("readings", f"none since {feed.grid.now_s:.1f} s"))
            landed = self._look(feed, recorder)
            if feed.grid.now_s >= shown_s + 60.0:
                shown_s = feed.grid.now_s
                advance(shown_s)

    def _look(self, feed: FlightFeed, recorder: FlightRecorder) -> bool:
        """One step of time and a look; whether the flight is over."""
        now_s = self._bench.time_s
        step_s = self._plan.next_look_s(now_s) - now_s if self._bench.pace == "step" else WALL_S
        self._bench.run_for(max(step_s, LEAST_S / 4))
        data = self._port.take()
        if not data and self._bench.time_s - self._looked_s < QUIET_LOOK_S:
            self._begin_s = recorder.last_s
            self._plan.missed(self._bench.time_s)
            return False
        self._looked_s = self._bench.time_s
        look = Look(recorder.last_s, self._begin_s or recorder.last_s, recorder.frames, data)
        recorder.look(look)
        before = feed.stream.counts.solutions
        feed.look(look)
        self._begin_s = recorder.last_s
        if feed.stream.counts.solutions == before:
            self._plan.missed(self._bench.time_s)
            return False
        self._plan.arrived(now_s, self._bench.time_s)
        return self._has_landed(feed)

    def _has_landed(self, feed: FlightFeed) -> bool:
        s = feed.last
        if s is None:
            return False
        speed = (s.v_enu_mps[0] ** 2 + s.v_enu_mps[1] ** 2) ** 0.5
        return self._landing.take(feed.grid.now_s, speed, valid=s.valid)


def serial_of(bench: Bench, given: str | None, endpoints: list[dict[str, Any]]) -> str:
    """The receiver's port: what was given, or the only one of the emulator. Raises DeviceError."""
    if given:
        return given
    ports = [e["pty"] for e in endpoints if "serial" in e]
    if len(ports) != 1:
        got = f"{len(ports)} of the emulator" if bench.pace != "real" else "none"
        raise DeviceError("receiver", 0, expected("--serial, or an emulator with one serial port", got))
    return str(ports[0])
