"""`psabench run gyrocompass` and `heading-hold`: the runs over the wire, their truth, the report.

Without --can and --control each reading gets an emulator of its own with the same scenario and seed.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from psabench.bench import Bench
from psabench.boards.gyro.device import Gyro
from psabench.emulator import read_resolved
from psabench.errors import BadInput, expected
from psabench.logs.call_log import Calls, check_procedure, refuse_beside_replay
from psabench.procedures import gyrocompass, heading_hold
from psabench.procedures.gyro_params import ReadingParams
from psabench.procedures.gyrocompass import GyrocompassResult
from psabench.procedures.gyrocompass_fit import WindowMean
from psabench.procedures.gyrocompass_params import GyrocompassParams, params_of
from psabench.procedures.head_bench import Progress
from psabench.procedures.heading_hold import Held, HoldParams
from psabench.procedures.platform_bench import Floats
from psabench.procedures.recorded_bench import BenchRecorder, RecordedBench
from psabench.procedures.recording import PlatformRecorder
from psabench.procedures.result import fields_of, made_params
from psabench.procedures.wire_platform import WirePlatform
from psabench.report.gyro_grading import GyroSection, HeldTruth

SCENARIO = "gyrocompass"
ARTICLE_SCENARIOS = (SCENARIO, "gyrocompass_ideal")  # of the article's platform, with its errors and without
WINDOW_POINTS = 200  # of a truth over a window


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroOptions:
    """What the command line asked for."""

    procedure: str
    out: Path
    can: str | None = None
    control: Path | None = None
    truth: Path | None = None
    scenario: Path | None = None
    seed: int | None = None
    real_time: bool = False
    record: Path | None = None  # CAN log of the run, its calls beside it
    replay: Path | None = None  # such a log instead of a bench
    params: Mapping[str, Any] = field(default_factory=dict)  # fields of the parameters, by name


def run(options: GyroOptions, progress: Progress) -> list[GyroSection]:
    """Every reading that was asked for. Parameters are checked before anything starts. Raises BenchError."""
    readings: ReadingParams = made_params(ReadingParams, options.procedure, options.params)
    for name in readings.readings:
        params_of(name, fields_of(GyrocompassParams, options.params))
    if options.record and len(readings.readings) != 1:
        raise BadInput(expected("one reading (--reading article or improved)", "several", "--record"))
    holds = options.procedure == heading_hold.NAME
    hold_params = made_params(HoldParams, options.procedure, options.params) if holds else None
    options.out.mkdir(parents=True, exist_ok=True)
    if options.replay:
        sections = [_replay_reading(hold_params, options, progress)]
    else:
        sections = [_one(name, hold_params, options, progress) for name in readings.readings]
    article = facts(options)["bench"] in ARTICLE_SCENARIOS
    return [replace(s, article=article) for s in sections]


def facts(options: GyroOptions) -> dict[str, str]:
    """What the report says of the run, once its bench has been there."""
    if options.replay:
        return {str(k): str(v) for k, v in Calls(options.replay).setup["facts"].items()}
    there = " ".join(str(x) for x in (options.can, options.control) if x)
    resolved = _resolved(options)
    return {
        "procedure": options.procedure,
        "bench": there or str(options.scenario or SCENARIO),
        **({"seed": str(read_resolved(resolved)["seed"])} if resolved else {}),
        "pace": "real time" if options.real_time else "simulated time",
    }


def _one(label: str, hold_params: HoldParams | None, options: GyroOptions, progress: Progress) -> GyroSection:
    with _bench(options) as bench:
        if options.scenario and not any(isinstance(u, Gyro) for u in bench.units.values()):
            raise BadInput(expected(f"a scenario with a gyro unit, as {SCENARIO}", options.scenario, "--scenario"))
        with ExitStack() as stack:
            heard: Any = bench
            site = _site(options)
            if options.record:
                setup = {"procedure": options.procedure, "reading": label, "site": site, "facts": facts(options)}
                heard = stack.enter_context(BenchRecorder(bench, options.record, setup))
            truth = _Truth(bench)
            return _measure_reading(
                heard, label, site, hold_params, options, progress, truth, lambda p: _depart(bench, p)
            )


def _measure_reading(
    bench: Any,
    label: str,
    site: Mapping[str, float],
    hold_params: HoldParams | None,
    options: GyroOptions,
    progress: Progress,
    truth: _Truth,
    depart: Callable[[HoldParams], None],
) -> GyroSection:
    """bench: a Bench, or its recorder or recording."""
    p = params_of(label, {**site, **fields_of(GyrocompassParams, options.params)})
    wired = WirePlatform(bench, signals=p.signals, watch=truth.watch_drift)
    with PlatformRecorder(wired, options.out, label, holds=hold_params is not None) as platform:
        windows = gyrocompass.measure(platform, p, progress, seen=truth.window)
        result = gyrocompass.estimate(windows, p)
        section = GyroSection(label=label, result=result, truth=truth.of(result))
        if hold_params is None or result.doubts:
            return section  # navigation does not begin with a heading that is in doubt
        hold = heading_hold.hold(
            platform, result, hold_params, progress, watch=truth.look, depart=lambda: depart(hold_params)
        )
    return GyroSection(label=label, result=result, truth=section.truth, hold=hold, hold_truth=truth.held())


def _replay_reading(hold_params: HoldParams | None, options: GyroOptions, progress: Progress) -> GyroSection:
    """The reading that was recorded, on the recording: the same result, without a truth."""
    assert options.replay is not None
    given: dict[str, object] = {"--record": options.record, "--can": options.can, "--control": options.control}
    given |= {"--truth": options.truth, "--scenario": options.scenario, "--seed": options.seed}
    refuse_beside_replay(given | {"--real-time": options.real_time or None})
    bench = RecordedBench(options.replay)
    check_procedure(options.replay, bench.setup, options.procedure)
    site = {k: float(v) for k, v in dict(bench.setup.get("site", {})).items()}
    label = str(bench.setup.get("reading"))
    section = _measure_reading(bench, label, site, hold_params, options, progress, _Truth(bench), lambda _: None)
    bench.end_run()
    return section


def _resolved(options: GyroOptions) -> Path | None:
    """Where the emulator of a run writes its scenario, None: the bench is not ours."""
    return None if options.can or options.control else options.out / f"scenario-{SCENARIO}.json"


def _site(options: GyroOptions) -> dict[str, float]:
    """The latitude that an operator at the scenario's site knows; {}: no one says where the bench is."""
    path = _resolved(options)
    site = read_resolved(path).get("site", {}) if path else {}
    return {"latitude_deg": float(site["latitude_deg"])} if "latitude_deg" in site else {}


def _bench(options: GyroOptions) -> Bench:
    resolved = _resolved(options)
    if resolved is None:
        return Bench.connect(options.can, control=options.control, truth=options.truth)
    pace = "wall" if options.real_time else "step"
    return Bench.start(options.scenario or SCENARIO, pace=pace, seed=options.seed, extra=["--resolved", resolved])


def _depart(bench: Bench, p: HoldParams) -> None:
    """An emulated vehicle flies, level, when it is commanded to; a real one has a pilot."""
    if bench.pace != "real":
        bench.control.call("vehicle.attitude", heading_deg=p.track_deg, pitch_deg=0.0, roll_deg=0.0)
        bench.control.call("vehicle.fly", speed_mps=p.speed_mps, track_deg=p.track_deg)


class _Truth:
    """What the truth port says in the run, after each window and at each look, where there is one."""

    def __init__(self, bench: Bench | RecordedBench) -> None:
        self._bench: Any = bench
        self._there = bench.truth_path is not None
        self._vehicle: Mapping[str, Any] = {}  # after the last window
        self._drifts: list[tuple[float, ...]] = []  # time of the readings, both drifts, deg/h
        self._headings: list[float] = []

    def watch_drift(self, t_s: float) -> None:
        if self._there:
            self._drifts.append((t_s, *map(float, self._bench.truth_state()["platform"]["drift_degph"])))

    def window(self) -> None:
        if self._there:
            self._vehicle = self._bench.truth_state()["vehicle"]

    def look(self, _: Held) -> None:
        if self._there:
            self._headings.append(float(self._bench.truth_state()["vehicle"]["heading_deg"]))

    def held(self) -> HeldTruth | None:
        return HeldTruth(heading_deg=tuple(self._headings)) if self._there else None

    def of(self, result: GyrocompassResult) -> dict[str, float] | None:
        """By name of the estimate: attitude at the end, drifts as means over the windows of each estimate."""
        if not self._vehicle or not self._drifts:
            return None
        t_s, drift1_degph, drift2_degph = np.array(self._drifts).T
        return {
            "heading_deg": float(self._vehicle["heading_deg"]) % 360.0,
            "drift1_degph": mean_over_windows(result.drift1, t_s, drift1_degph),
            "drift2_degph": mean_over_windows(result.drift2, t_s, drift2_degph),
            "pitch_deg": float(self._vehicle["pitch_deg"]),
            "roll_deg": float(self._vehicle["roll_deg"]),
        }


def mean_over_windows(over: WindowMean, t_s: Floats, x: Floats) -> float:
    """Mean of x over the windows of a drift, in their shares; x at the instants t_s, linear between them."""
    part = (np.arange(WINDOW_POINTS) + 0.5) / WINDOW_POINTS - 0.5
    at_s = over.t_mid_s[:, np.newaxis] + np.outer(over.length_s, part)
    return float(over.share @ np.interp(at_s, t_s, x).mean(axis=1))
