"""A flight on a bench: readings over CAN, the receiver's port, in lockstep with simulated time or in real time."""

from __future__ import annotations

import math
from collections.abc import Callable, Generator
from contextlib import ExitStack, closing, suppress
from dataclasses import dataclass
from typing import Any

from psabench.bench import Bench
from psabench.boards.bins.device import Bins, Weights
from psabench.errors import BenchError, DeviceError, expected
from psabench.koi.wire.feed import FlightFeed
from psabench.koi.wire.increments import END_S, SAMPLE_S
from psabench.koi.wire.nav_pvt import PvtStream, Solution
from psabench.koi.wire.port import LOOK_S, WALL_S, LookPlan, SerialPort
from psabench.koi.wire.recording import FlightRecorder, Look
from psabench.link.can_host import StepClock

QUIET_LOOK_S = 1.0  # between two entries of a port without bytes
SHOWN_S = 60.0  # of the flight, between two reports of its progress

Steps = Generator[tuple[bytes, list[Solution], float], None, None]  # bytes of the port, what they complete, time


@dataclass(frozen=True, slots=True, kw_only=True)
class LandedRule:
    """When a flight is over, by the receiver: it has flown, and is at rest (E0)."""

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
        self._landing = Landing(LandedRule())
        self._landed = False

    def prepare(self) -> Weights:
        """The unit is ready; its weights. Raises BenchError, DeviceError for another period than 10 ms."""
        self._unit.wait_ready()
        got = self._unit.stream(3)
        period = float(got.t_sample_s[-1] - got.t_sample_s[-2])
        if abs(period - SAMPLE_S) > 0.1 * SAMPLE_S:
            raise DeviceError("increments", 0, expected("readings every 10 ms", f"{period * 1e3:.3f} ms"))
        self._unit.also("BINS_BARO")
        return self._unit.weights()

    def fly(self, feed: FlightFeed, recorder: FlightRecorder, for_s: float, advance: Callable[[float], None]) -> None:
        """Until it has landed, or for_s. Ctrl-C ends it as well; what has come is in the recording."""
        with ExitStack() as stack:
            stack.callback(self._unit.stop)
            stack.enter_context(self._bench.host.listeners.only(recorder.on_message, feed.on_message))
            self._port.take()  # what came before belongs to no time
            self._unit.start()
            begin_s, shown_s = self._bench.time_s, 0.0
            for look, found in stack.enter_context(closing(self._looks(feed.stream, recorder))):
                feed.look(look, found)
                if feed.grid.now_s >= shown_s + SHOWN_S:
                    shown_s = feed.grid.now_s
                    advance(shown_s)
                if self._landed or feed.grid.now_s >= for_s or feed.grid.ended:
                    break
                if self._bench.time_s - begin_s > for_s + END_S:
                    raise DeviceError("increments", 0, expected("readings", f"none since {feed.grid.now_s:.1f} s"))

    def _looks(self, stream: PvtStream, recorder: FlightRecorder) -> Generator[tuple[Look, list[Solution]], None, None]:
        """At the port, with what it had: those with bytes, and others now and then."""
        clock = self._bench.step_clock
        begin_s = recorder.last_s
        looked_s = self._bench.time_s
        with closing(self._steps(stream, clock) if clock else self._moments(stream)) as steps:
            for data, found, now_s in steps:
                if data or now_s - looked_s >= QUIET_LOOK_S:
                    look = Look(recorder.last_s, begin_s or recorder.last_s - LOOK_S, recorder.frames, data)
                    recorder.look(look)
                    looked_s = now_s
                    yield look, found
                begin_s = recorder.last_s

    def _steps(self, stream: PvtStream, clock: StepClock) -> Steps:
        """In lockstep: while the emulator makes a step, what came in the step before is taken."""
        plan, host, before_s = LookPlan(), self._bench.host, clock.now_s()
        clock.start_run(plan.next_look_s(before_s) - before_s)
        under_way = True
        try:
            while True:
                counts, under_way = clock.finish_run(), False
                now_s, data = clock.now_s(), self._port.take()
                if found := self._follow(stream, data, now_s):
                    plan.arrived(before_s, now_s, found[-1].tow_s)
                else:
                    plan.missed(now_s)
                clock.start_run(plan.next_look_s(now_s) - now_s)
                under_way = True
                host.receive_up_to(counts[0])
                yield data, found, now_s
                before_s = now_s
        finally:
            with suppress(BenchError):  # one that has gone
                if under_way:
                    host.receive_up_to(clock.finish_run()[0])

    def _moments(self, stream: PvtStream) -> Steps:
        """In real time, or over a link that does not count."""
        while True:
            self._bench.wait(WALL_S)
            data, now_s = self._port.take(), self._bench.time_s
            yield data, self._follow(stream, data, now_s), now_s

    def _follow(self, stream: PvtStream, data: bytes, now_s: float) -> list[Solution]:
        """The solutions that these bytes complete; whether it has landed."""
        found = stream.take(data) if data else []
        for s in found:
            self._landed = self._landing.take(now_s, math.hypot(*s.v_enu_mps[:2]), valid=s.valid) or self._landed
        return found


def serial_of(bench: Bench, given: str | None, endpoints: list[dict[str, Any]]) -> str:
    """The receiver's port: what was given, or the only one of the emulator. Raises DeviceError."""
    if given:
        return given
    ports = [e["pty"] for e in endpoints if "serial" in e]
    if len(ports) != 1:
        got = f"{len(ports)} of the emulator" if bench.pace != "real" else "none"
        raise DeviceError("receiver", 0, expected("--receiver, or an emulator with one serial port", got))
    return str(ports[0])
