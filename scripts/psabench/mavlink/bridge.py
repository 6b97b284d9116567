"""`psabench mavlink`: a navigation computer on CAN that is a MAVLink system to everybody else, and its replay of a log.

The main thread has the bench: it receives frames, reads and writes objects of the unit, calibrates. The station has a
thread of its own (`station`), so that it answers while a procedure runs.
"""

from __future__ import annotations

import math
import queue
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from psabench.bench import Bench
from psabench.boards.objects import Psa2Objects as OD
from psabench.boards.parameters import PARAMETERS
from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import FrameReader
from psabench.errors import BadInput, BenchError, DeviceError, expected
from psabench.link.canopen_host import Described
from psabench.logs.formats import check_readable, read_frames
from psabench.mavlink import calibration
from psabench.mavlink.calibration import CalibrationPlan, CalibrationResult, Cancelled
from psabench.mavlink.dialect import mavlink
from psabench.mavlink.parameters import I32, R32, U32, Parameter, Parameters
from psabench.mavlink.ports import PortSpec
from psabench.mavlink.samples import ACCEL, AXES, IMU, Samples, Scale, hz
from psabench.mavlink.station import (
    ACCEPTED,
    CANCELLED,
    FAILED,
    WARNING,
    CalibrateJob,
    Identity,
    Job,
    ReadJob,
    Station,
    WriteJob,
)
from psabench.procedures.head_bench import Reading

SLICE_S = 0.02  # bench time between looks at jobs
JOBS_A_SLICE = 8
RATE_MAX_HZ = 10000.0
LOG_SLICE_S = 0.02
PEER_S = 0.05  # real time between looks whether a peer has come
ANGLES, ATTITUDE, RESULT = 54101, 30, 54103
HEAD_VALID = 8  # PSABENCH_INSTRUMENT_HEAD


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeOptions:
    """What the command line asked for."""

    port: PortSpec
    identity: Identity = field(default_factory=Identity)
    imu_hz: float = 50.0
    angles_hz: float = 5.0
    codes_hz: float | None = None  # None: each reading
    for_s: float | None = None  # wall time; None: until Ctrl-C
    plan: CalibrationPlan


class Bridge:
    """What a live bench and a log have in common: the station, its own parameters, readings out."""

    def __init__(self, options: BridgeOptions) -> None:
        """Raises BadInput for a port that is in use."""
        self.options = options
        self.parameters = Parameters()
        self.scale = Scale(g_mps2=options.plan.g_mps2)
        self.results: list[CalibrationResult] = []
        self._results_us = 0
        self.station = Station(options.port, options.identity, self.parameters, lambda: self.samples.time_us)
        self.samples = Samples(self.station.send, self.scale, imu_hz=options.imu_hz, codes_hz=options.codes_hz)
        self.angles_s = hz(options.angles_hz)
        self.station.on_interval = self._set_interval
        self.station.on_request = self._send_latest
        self._deadline_s = math.inf if options.for_s is None else time.monotonic() + options.for_s
        self._add_own()

    def close(self) -> None:
        self.station.close()

    def over(self) -> bool:
        """Whether the time is over. Raises what ended the station's thread."""
        if self.station.failure is not None:
            raise self.station.failure
        return time.monotonic() >= self._deadline_s

    def _add_own(self) -> None:
        def rate(number: int) -> Callable[[float], None]:
            return lambda rate_hz: setattr(self.samples.rates[number], "interval_s", hz(rate_hz))

        def angles(rate_hz: float) -> None:
            self.angles_s = hz(rate_hz)

        def add(name: str, value: float, write: Callable[[float], None]) -> None:
            self.parameters.add(Parameter(name=name, value=value, low=0.0, high=RATE_MAX_HZ, write=write))

        codes_hz = RATE_MAX_HZ if self.options.codes_hz is None else self.options.codes_hz
        add("MAV_IMU_HZ", self.options.imu_hz, rate(IMU))
        add("MAV_ANGLES_HZ", self.options.angles_hz, angles)
        add("MAV_CODES_HZ", codes_hz, rate(ACCEL))
        self.parameters.add(Parameter(name="GRAVITY_MPS2", value=self.scale.g_mps2))
        self.parameters.add(Parameter(name="CAL_VALID", value=0.0))

    def _set_interval(self, number: int, interval_us: float) -> bool:
        if not (interval_us in (-1.0, 0.0) or 100.0 <= interval_us <= 1e9):
            return False
        defaults = {IMU: hz(self.options.imu_hz), ACCEL: 0.0}
        if number in (ANGLES, ATTITUDE):
            standard = hz(self.options.angles_hz)
            self.angles_s = None if interval_us < 0 else standard if interval_us == 0 else interval_us * 1e-6
        elif number in self.samples.rates:
            seconds = None if interval_us < 0 else defaults[number] if interval_us == 0 else interval_us * 1e-6
            self.samples.rates[number].interval_s = seconds
        else:
            return False
        return True

    def _send_latest(self, number: int) -> bool:
        if number == RESULT and self.results:
            self.send_results()
            return True
        message = self.samples.latest.get(number)
        if message is not None:
            self.station.send(message)
        return message is not None

    def send_results(self) -> None:
        for k, r in enumerate(self.results):
            name, unit = r.name.encode("ascii", "replace")[:16], r.unit.encode("ascii", "replace")[:12]
            self.station.send(
                mavlink().MAVLink_psabench_result_message(
                    self._results_us, r.value, r.sd, k, len(self.results), name, unit
                )
            )

    def send_head(self, head_deg: float) -> None:
        """The head's scale, as pitch and exactly."""
        t_us = self.samples.time_us
        rad = math.remainder(math.radians(head_deg), math.tau)
        attitude = mavlink().MAVLink_attitude_message((t_us // 1000) & 0xFFFFFFFF, 0.0, rad, 0.0, 0.0, 0.0, 0.0)
        angles = mavlink().MAVLink_psabench_angles_message(t_us, [0.0] * 3, [0.0] * 3, head_deg, HEAD_VALID)
        for number, message in ((ATTITUDE, attitude), (ANGLES, angles)):
            self.samples.latest[number] = message
            self.station.send(message)


class LiveBridge(Bridge):
    """A bench that is there: its PSA-2 and, for calibrations, the dividing head."""

    def __init__(self, options: BridgeOptions, bench: Bench) -> None:
        super().__init__(options)
        self.bench = bench
        self.unit: Psa2 = bench.unit
        self._angles_due_s = 0.0
        self._has_head = "head" in bench.addresses
        self.station.can_calibrate = self._has_head

    def run(self) -> None:
        """Until --for is over or Ctrl-C. Raises BenchError when the bench or the link fails."""
        self.unit.wait_ready()
        self._add_objects()
        self.unit.frames.forget()
        self.unit.start()
        self.station.start()
        begun_s, passed_s = time.monotonic(), 0.0
        while not self.over():
            self.bench.wait(SLICE_S)
            passed_s += SLICE_S
            self.samples.take(self.unit.frames.take())
            self._do_jobs()
            self._look_at_angles()
            if self.bench.pace == "step":  # its time goes as real time does, and faster while it calibrates
                ahead_s = begun_s + passed_s - time.monotonic()
                if ahead_s < 0.0:
                    begun_s, passed_s = time.monotonic(), 0.0
                else:
                    time.sleep(ahead_s)
        self.unit.stop()

    # ---- objects of the unit

    def _add_objects(self) -> None:
        known = {(d.index, d.sub): d for d in self.unit.node.objects()}
        for name, (index, sub) in PARAMETERS[self.unit.board].items():
            d = known.get((index, sub))
            if d is not None:
                self.parameters.add(self._of_object(name, d))
        for k, axis in enumerate(AXES.upper()):
            self.scale.zero_v[k] = self._known(f"ZERO_V_{axis}")
            self.scale.v_per_g[k] = self._known(f"V_PER_G_{axis}")

    def _known(self, name: str) -> float:
        """A parameter that is read now."""
        p = self.parameters.named(name)
        if p.read is not None:
            p.value = p.read()
        return p.value

    def _of_object(self, name: str, d: Described) -> Parameter:
        size = d.data_bytes or 0

        def read() -> float:
            return float(self.unit.node.read(d.index, d.sub))

        def write(value: float) -> None:
            self.unit.node.write(d.index, d.sub, value if d.real else int(value))

        half = 2.0 ** (8 * size - 1)
        least, most = (-3.4e38, 3.4e38) if d.real else (-half, half - 1) if d.signed else (0.0, 2 * half - 1)
        return Parameter(
            name=name,
            kind=R32 if d.real or size < 4 else I32 if d.signed else U32,
            integer=not d.real,
            low=float(d.low) if d.low is not None else least,
            high=float(d.high) if d.high is not None else most,
            read=read,
            write=write if d.access == "rw" else None,
        )

    # ---- jobs of the station

    def _do_jobs(self) -> None:
        for _ in range(JOBS_A_SLICE):
            try:
                job = self.station.jobs.get_nowait()
            except queue.Empty:
                return
            self._do(job)

    def _do(self, job: Job) -> None:
        if isinstance(job, CalibrateJob):
            self._calibrate()
            return
        p = self.parameters[job.index]
        try:
            if isinstance(job, WriteJob) and p.write is not None:
                p.write(job.value)
                p.value = job.value
        except DeviceError as e:
            self.station.text(WARNING, f"{p.name}: {e.text} (abort {e.abort_code:08X}h)")
        try:
            if p.read is not None:
                p.value = p.read()  # what the unit has now, changed or not
        except DeviceError as e:
            self.station.text(WARNING, f"{p.name}: {e.text} (abort {e.abort_code:08X}h)")
            p.value = math.nan
        self._follow_scale(p)
        self.station.send_parameter(job.index)

    def _follow_scale(self, p: Parameter) -> None:
        """Zero signal and scale factor that another host wrote are those of the readings from now on."""
        for k, axis in enumerate(AXES.upper()):
            if p.name == f"ZERO_V_{axis}":
                self.scale.zero_v[k] = p.value
            if p.name == f"V_PER_G_{axis}" and p.value > 0.0:
                self.scale.v_per_g[k] = p.value

    # ---- instruments

    def _look_at_angles(self) -> None:
        now_s = self.bench.time_s
        if self.angles_s is None or not self._has_head or now_s < self._angles_due_s:
            return
        self._angles_due_s = now_s + self.angles_s
        self.send_head(self.bench.head.angle_deg)

    # ---- calibration

    def _calibrate(self) -> None:
        station = self.station
        self.unit.stop()
        try:
            result = calibration.calibrate(
                self.bench,
                self.options.plan,
                percent=station.calibration_progress,
                cancelled=lambda: station.cancelled() or self.over(),
                reading=self._on_reading,
            )
            self._keep(calibration.results_of(result), result.axis)
        except Cancelled:
            station.calibration_over(CANCELLED, "cancelled")
        except (BenchError, ValueError) as e:
            station.calibration_over(FAILED, f"failed: {e}")
        else:
            station.calibration_over(ACCEPTED, "done: accel")
        self.unit.frames.forget()
        self.unit.start()

    def _on_reading(self, r: Reading) -> None:
        self.samples.time_us = max(self.samples.time_us, round(r.t_s * 1e6))
        self.send_head(r.alpha_deg)

    def _keep(self, results: list[CalibrationResult], axis: str) -> None:
        """Zero signal and scale factor go into the unit and are used from now on; all results become parameters."""
        by_name = {r.name: r for r in results}
        k = AXES.index(axis)
        zero_v, v_per_g = by_name["u0_v"].value, by_name["kx_v_per_g"].value
        self.unit.node.write(OD.ZERO_V, k + 1, zero_v)
        self.unit.node.write(OD.SCALE_V_PER_G, k + 1, v_per_g)
        self.scale.zero_v[k], self.scale.v_per_g[k], self.scale.calibrated = zero_v, v_per_g, True
        self.results, self._results_us = results, self.samples.time_us
        self.parameters.named("CAL_VALID").value = 1.0
        changed = [self.parameters.find("CAL_VALID")]
        for r in results:
            changed.append(self.parameters.add(Parameter(name=r.parameter, value=r.value)))
        for name in (f"ZERO_V_{axis.upper()}", f"V_PER_G_{axis.upper()}"):
            self._known(name)
            changed.append(self.parameters.find(name))
        for index in changed:
            if index is not None:
                self.station.send_parameter(index)
        self.send_results()


class LogBridge(Bridge):
    """A recorded log as if the board were there: at its own pace, `speed` times as fast, or (0) at once."""

    def __init__(self, options: BridgeOptions, path: Path, node: int, speed: float) -> None:
        """Raises BadInput for a file that is not there and for an ending that we do not read."""
        check_readable(path)
        super().__init__(options)
        self.station.can_calibrate = False
        self._path, self._node, self._speed = path, node, speed
        self._reader = FrameReader(node)
        for k, axis in enumerate(AXES.upper()):
            self._add_scale(f"ZERO_V_{axis}", self.scale.zero_v, k, -10.0, 10.0)
            self._add_scale(f"V_PER_G_{axis}", self.scale.v_per_g, k, 0.001, 1000.0)

    def _add_scale(self, name: str, values: Any, k: int, low: float, high: float) -> None:
        def write(value: float) -> None:
            values[k] = value

        self.parameters.add(Parameter(name=name, value=float(values[k]), low=low, high=high, write=write))

    def run(self) -> None:
        """To the end of the log; begins with the first peer.

        Raises BadInput for a damaged log, its good part sent, and for one without a reading.
        """
        self.station.start()
        while not self.station.port.peers and not self.over():
            self._settle(PEER_S)
        self.station.send_heartbeat()  # the peer knows whose readings follow, even when all come at once
        begun_s = first_s = None
        for t_s in self._slices():
            if begun_s is None or first_s is None:
                begun_s, first_s = time.monotonic(), t_s
            self.samples.take(self._reader.take())
            ahead_s = begun_s + (t_s - first_s) / self._speed - time.monotonic() if self._speed else 0.0
            self._settle(max(0.0, ahead_s))
            if self.over():
                return
        self.samples.take(self._reader.take())
        self._settle(PEER_S)
        if not self.samples.count:
            raise BadInput(expected(f"frames of node {self._node}", "none", self._path))

    def _slices(self) -> Iterator[float]:
        """Time of the log after each slice of it, whose frames the reader has."""
        slice_s = -math.inf
        try:
            for m in read_frames(self._path):
                self._reader.on_message(m)
                if m.timestamp >= slice_s:
                    slice_s = m.timestamp + LOG_SLICE_S
                    yield m.timestamp
        except BadInput:
            self.samples.take(self._reader.take())  # what came before the damage is good
            raise

    def _settle(self, for_s: float) -> None:
        """Do the station's jobs for this real time."""
        deadline_s = time.monotonic() + for_s
        while True:
            with suppress(queue.Empty):
                job = self.station.jobs.get(timeout=max(0.0, deadline_s - time.monotonic())) if for_s else None
                self._do(job or self.station.jobs.get_nowait())
            if time.monotonic() >= deadline_s:
                return

    def _do(self, job: Job) -> None:
        if isinstance(job, WriteJob):
            p = self.parameters[job.index]
            if p.write is not None:
                p.write(job.value)
                p.value = job.value
        if isinstance(job, ReadJob | WriteJob):
            self.station.send_parameter(job.index)
