"""`psabench run sins-calibration`: a plan of rotations on a bench, or a recording of one; estimates, truth, report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from psabench.bench import Bench
from psabench.boards.bins.device import Bins
from psabench.errors import BadInput, BenchError, expected
from psabench.native import sins
from psabench.native.nav import Floats, Refused
from psabench.native.sins import DEG, Params, SinsConfig
from psabench.native.strapdown import gravity_mps2
from psabench.procedures.head_bench import Progress
from psabench.procedures.result import made_params, option
from psabench.sins.calibration import SCALES, SinsResult, calibrate_unit, elements, value_of
from psabench.sins.covariance_run import GAUGES
from psabench.sins.layout import read_layout
from psabench.sins.plan import RotationPlan, read_plan
from psabench.sins.readers import read_increments
from psabench.sins.table import attitudes, moves_of
from psabench.sins.table_run import STAND_S, TableData, TableRun, table_axes
from psabench.sins.table_store import read_angles, write_data

NAME = "sins-calibration"
SCENARIO, COARSE = "sins_table", "sins_coarse"
STEP_S, MOST_SAMPLES = 0.1, 64  # of the filter; samples that a step may have
P_LIMIT = 0.001  # of the chi-square of all errors


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationParams:
    """Parameters of `sins-calibration`; the defaults are the article's."""

    plan: str = option("", "", "plan of rotations: article, two_rates or a YAML file (article)")
    azimuth_deg: float | None = option(None, "deg", "azimuth of the table's first axis from north (the plan's)")
    latitude_deg: float = option(55.7, "deg", "latitude of the table")
    height_m: float = option(150.0, "m", "height of the table above the ellipsoid")
    gravity: float | None = option(None, "m/s2", "local gravity (of the ellipsoid there)")
    stand: bool = option(True, "", "use the table's angles; no: as on a coarse table")
    stand_arcsec: float = option(15.0, "arcsec", "noise of a reading of the table's angle")
    wobble_arcsec: float = option(1.0, "arcsec", "what the table's axes do that its angles do not show")
    heading_sd_deg: float = option(3.0, "deg", "error of the heading at the start")
    gauge: str = option("article", "", f"elements of Γ that are estimated: {', '.join(GAUGES)}")
    lever: int = option(0, "", "lever arms of the accelerometers: 0 none, 3 along the own axis, 9 all")
    gyro_noise_degph: float = option(0.1, "deg/h", "white noise of the gyros, a mean of 1 s")
    accel_noise_mps2: float = option(0.001, "m/s2", "white noise of the accelerometers, a mean of 1 s")

    def __post_init__(self) -> None:
        if self.gauge not in GAUGES:
            raise ValueError(expected(", ".join(GAUGES), self.gauge, "gauge"))
        if not -85.0 <= self.latitude_deg <= 85.0:
            raise ValueError(expected("-85 to 85 deg", self.latitude_deg, "latitude_deg"))
        if not 0.0 <= self.wobble_arcsec <= 3600.0:
            raise ValueError(expected("0 to 3600 arcsec", self.wobble_arcsec, "wobble_arcsec"))
        if self.lever not in (0, 3, 9):
            raise ValueError(expected("0, 3 or 9", self.lever, "lever"))

    @property
    def g_mps2(self) -> float:
        return gravity_mps2(self.latitude_deg * DEG, self.height_m) if self.gravity is None else self.gravity

    def config(self, sample_s: float, stand: bool, cycle_s: float) -> SinsConfig:
        """Of the estimator. cycle_s: the longest time about one axis of the table.

        What its angles do not show is the same in all of it, and counts as white noise with that mean over a cycle.
        """
        per_sample_arcsec = math.hypot(self.stand_arcsec, self.wobble_arcsec * math.sqrt(cycle_s / STAND_S))
        return SinsConfig(
            latitude_rad=self.latitude_deg * DEG,
            gravity_mps2=self.g_mps2,
            sample_s=sample_s,
            step_s=sample_s * min(max(round(STEP_S / sample_s), 1), MOST_SAMPLES),
            gauge=GAUGES[self.gauge],
            lever=self.lever,
            stand=stand,
            clone=True,
            beta_sd_rad=(DEG, DEG, self.heading_sd_deg * DEG),
            gyro_noise_radps_rts=self.gyro_noise_degph * DEG / 3600.0,
            accel_noise_mps2_rts=self.accel_noise_mps2,
            stand_sd_rad=per_sample_arcsec * DEG / 3600.0,
            stand_noise_rate_hz=1.0 / STAND_S,
            stand_interval_s=STAND_S,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SinsOptions:
    """What the command line asked for."""

    out: Path
    can: str | None = None
    table: str | None = None
    control: Path | None = None
    scenario: Path | None = None
    seed: int | None = None
    real_time: bool = False
    data: Path | None = None  # recorded increments in place of a bench
    layout: Path | None = None
    angles: Path | None = None
    params: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Graded:
    """Errors beside the truth, in the units of the parameters; of those that a truth has."""

    names: tuple[str, ...]
    truth: Floats
    error: Floats
    chi_square: float
    p: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SinsRun:
    """A run that is over."""

    params: CalibrationParams
    result: SinsResult
    plan: str
    facts: Mapping[str, str]
    graded: Graded | None

    @property
    def within(self) -> bool:
        return not self.result.doubts and (self.graded is None or self.graded.p >= P_LIMIT)


def run_calibration(options: SinsOptions, progress: Progress) -> SinsRun:
    """Measure, or read; estimate; grade. What was measured is in OUT. Raises BadInput, BenchError."""
    p = made_params(CalibrationParams, NAME, options.params)
    _check_options(options, p)
    plan = read_plan(p.plan or "article")
    azimuth_rad = (plan.axis_azimuth_deg if p.azimuth_deg is None else p.azimuth_deg) * DEG
    options.out.mkdir(parents=True, exist_ok=True)
    if options.data:
        data, truth, facts = _recorded(options), None, {"data": str(options.data)}
    else:
        data, truth = _measured(options, p, plan, progress)
        write_data(options.out, data)
        facts = {"bench": str(options.can or options.control or options.scenario or _scenario(p)), "plan": plan.name}
    start = attitudes(azimuth_rad, np.radians(data.start_deg)[None])[0]
    stand = data.stand(azimuth_rad) if p.stand else None
    cfg = p.config(data.increments.dt_s, stand is not None, longest_cycle_s(plan))
    with progress.step("estimate, two passes", 1) as advance:
        result = calibrate_unit(cfg, start, data.increments, stand)
        advance()
    duration = f"{len(data.increments) * data.increments.dt_s:.0f} s"
    facts |= {"recorded": duration, "table's angles": str(len(data.stand_s)) if stand else "not used"}
    return SinsRun(
        params=p, result=result, plan=plan.name, facts=facts, graded=None if truth is None else grade(result, truth)
    )


def _check_options(options: SinsOptions, p: CalibrationParams) -> None:
    """Before minutes are measured. Raises BadInput."""
    try:
        sins.state_layout(p.config(0.01, p.stand, 1.0))
    except Refused as e:
        raise BadInput(f"{NAME}: {e}") from e
    given = [n for n in ("can", "table", "control", "scenario", "seed") if getattr(options, n) is not None]
    if options.data and given:
        raise BadInput(expected("--data without a bench", f"--{given[0]}", NAME))
    if options.data and options.angles and not p.plan:
        raise BadInput(expected("--plan of the recording: its cycles are in the intervals", "none", "--angles"))
    if not options.data and (options.angles or options.layout):
        raise BadInput(expected("--data", "none", "--angles" if options.angles else "--layout"))


def longest_cycle_s(plan: RotationPlan) -> float:
    """Of turns in a row about the same axis."""
    longest = now_s = 0.0
    before: tuple[float, ...] | None = None
    for turn in plan.turns:
        now_s = turn.duration_s + (now_s if turn.axis_b == before else 0.0)
        longest, before = max(longest, now_s), turn.axis_b
    return longest


def _scenario(p: CalibrationParams) -> str:
    return SCENARIO if p.stand else COARSE


def _recorded(options: SinsOptions) -> TableData:
    assert options.data
    increments = read_increments(options.data, read_layout(options.layout) if options.layout else None)
    return read_angles(options.angles, increments)


def _measured(
    options: SinsOptions, p: CalibrationParams, plan: RotationPlan, progress: Progress
) -> tuple[TableData, Params | None]:
    """On a bench that is there, or on an emulator started for it; then with the truth."""
    with _opened(options, p) as bench:
        units = [u for u in bench.units.values() if isinstance(u, Bins)]
        if not units:
            raise BadInput(expected(f"a scenario with an inertial unit, as {SCENARIO}", "none", "--scenario"))
        moves = list(moves_of(plan.turns, table_axes(bench)))
        with progress.step(f"plan {plan.name}", len(moves)) as advance:
            run = TableRun(bench, moves, advance)
            try:
                data = run.measure(p.stand)
            except BaseException:  # Ctrl-C, too: what was measured is kept
                with suppress(BenchError):
                    write_data(options.out, run.data(np.empty(0)))
                raise
        return data, truth_of(bench) if bench.emulator else None


def _opened(options: SinsOptions, p: CalibrationParams) -> Bench:
    if options.can or options.table or options.control:
        scpi = {"table": options.table} if options.table else None
        return Bench.connect(options.can, control=options.control, scpi=scpi)
    pace = "wall" if options.real_time else "step"
    return Bench.start(options.scenario or _scenario(p), pace=pace, seed=options.seed)


def truth_of(bench: Bench) -> Params:
    """Of the only inertial unit, from the truth port."""
    s = next(u for u in bench.truth()["units"].values() if u["board"] == "bins")["specimen"]
    theta, gamma = (np.array([[s[f"{k}_{i}{j}"] for j in (1, 2, 3)] for i in (1, 2, 3)]) for k in ("theta", "gamma"))
    nu, df = (np.array([s[name.format(i)] for i in (1, 2, 3)]) for name in ("nu0_{}_radps", "df0_{}_mps2"))
    return Params(nu_radps=nu, theta=theta, df_mps2=df, gamma=gamma)


GRADED = ("nu", "theta", "df", "gamma")


def grade(r: SinsResult, truth: Params) -> Graded:
    """In the frame of the gauge: a turn of the instrument's axes is no error (docs/procedures/sins.md)."""
    from scipy import stats

    true, _ = sins.to_gauge(r.cfg.gauge, truth)
    keys = {name: key for name, key, _ in elements(sins.state_layout(r.cfg), r.cfg)}
    at = [k for k, p in enumerate(r.parameters) if p.name.split("_")[0] in GRADED]
    names = tuple(r.parameters[k].name for k in at)
    right = np.array([value_of(true, n) * SCALES[keys[n]].per_si for n in names])
    error = np.array([r.parameters[k].value for k in at]) - right
    chi_square = sins.error_nees(error, np.ascontiguousarray(r.covariance[np.ix_(at, at)]))
    p = float(stats.chi2.sf(chi_square, len(at)))
    return Graded(names=names, truth=right, error=error, chi_square=chi_square, p=min(p, 1.0))


# ---- what is shown


def table_rows(run: SinsRun) -> list[list[str]]:
    """Each parameter: value, interval, and beside the truth its error in standard deviations."""
    head = ["", "unit", "value", "± 95 %", "prior sd"]
    graded = run.graded
    rows = [head if graded is None else [*head, "true", "error / sd"]]
    for q in run.result.parameters:
        row = [q.symbol, q.unit, f"{q.value:.4g}", f"{q.half95:.2g}", f"{q.prior_sd:.3g}"]
        if graded is not None:
            k = graded.names.index(q.name) if q.name in graded.names else None
            row += ["", ""] if k is None else [f"{graded.truth[k]:.4g}", f"{graded.error[k] / q.sd:+.2f}"]
        rows.append(row)
    return rows


def verdict(run: SinsRun) -> str:
    """One line: what was compared with what."""
    r = run.result
    said = [f"{len(r.parameters)} parameters"]
    if run.graded is None:
        said.append("no truth to compare with")
    else:
        g = run.graded
        beside = f"{len(g.names)} beside the truth: chi-square {g.chi_square:.1f}, p {g.p:.3f}"
        said.append(beside + ("" if g.p >= P_LIMIT else f", below {P_LIMIT:g}"))
    said.append(f"innovations²/variance {r.nis_accel:.3f}")
    if len(r.parameters) > len(run.graded.names if run.graded else ()) and run.graded:
        said.append(f"{len(r.parameters) - len(run.graded.names)} without a truth")
    return "; ".join(said)


def result_dict(run: SinsRun) -> dict[str, Any]:
    """result.json: `psabench passport add` and `psabench nav apply` read it."""
    from psabench.sins.correction import correction_dict

    r, sd = run.result, np.sqrt(np.diag(run.result.covariance))
    section = {
        "label": run.plan,
        "procedure": NAME,
        "estimates": [_estimate(run, k) for k in range(len(r.parameters))],
        "correlation": {
            "names": [q.name for q in r.parameters],
            "matrix": (r.covariance / np.outer(sd, sd)).tolist(),
        },
        "gauge": run.params.gauge,
        "nis": {"accelerometers": r.nis_accel, "table": r.nis_stand if math.isfinite(r.nis_stand) else None},
        "innovations": {
            "seconds": r.seconds,
            "correlation_1s": [x if math.isfinite(x) else None for x in r.correlation.tolist()],
        },
        "doubts": list(r.doubts),
        "correction": correction_dict(r.correction),
    }
    graded = None if run.graded is None else {"chi_square": run.graded.chi_square, "p": run.graded.p}
    facts = {"procedure": NAME, **run.facts}
    return {"format": 1, "facts": facts, "params": asdict(run.params), "sections": [section], "truth": graded}


def _estimate(run: SinsRun, k: int) -> dict[str, Any]:
    q = run.result.parameters[k]
    found: dict[str, Any] = {
        "name": q.name,
        "unit": q.unit,
        "value": q.value,
        "sd": q.sd,
        "ci95": [q.value - q.half95, q.value + q.half95],
        "identifiable": q.determined,
    }
    if run.graded is not None and q.name in run.graded.names:
        at = run.graded.names.index(q.name)
        found |= {"truth": float(run.graded.truth[at]), "error": float(run.graded.error[at])}
    return found


NOTES = (
    "Error = measured less true: w′ = w + ν + Θw, f′ = f + Δf + Γf. A correction takes it out.",
    "Three turns of the instrument's axes are not observable: the gauge makes three elements of Γ zero, and the truth "
    "is turned into the same axes before it is compared.",
    "The interval is 1.96 standard deviations of the filter's covariance: it holds the noise and the priors, and no "
    "error of the local gravity, which every Γii shares (1 µm/s² is 0.1 ppm). With the table's angles it holds their "
    "noise and the wobble of its axes, as white noise with the same mean over a cycle.",
)


def write_page(out: Path, run: SinsRun) -> Path:
    """report.html and result.json; the page. Raises OSError, OutputError."""
    from psabench.report.page import bullets, section, table, verdict_line, whole_page, write_report

    good = None if run.graded is None and run.within else run.within
    parts: Sequence[str] = (
        section("Verdict", verdict_line(verdict(run), good), bullets(run.result.doubts)),
        section("Parameters", table(table_rows(run))),
        section("How to read them", bullets(NOTES)),
    )
    return write_report(out, result_dict(run), whole_page("Calibration of a strapdown unit", run.facts, parts))
