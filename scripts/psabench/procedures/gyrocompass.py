"""Gyrocompassing: heading and drifts from levelling rates in several positions, eqs (7)-(19) corrected.

`measure` turns the platform from position to position and keeps a window in each; `estimate` is pure. The derivations,
the errata and what the article's figures are worth: docs/procedures/gyrocompass.md. The algebra is libpsabench-nav's.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from psabench.budget.gum import expand_estimate
from psabench.errors import LinkError
from psabench.estimate.uncertainty import Component, Estimate, within_limit
from psabench.native import nav
from psabench.native.nav import ARCMIN, DEGPH
from psabench.procedures.gyrocompass_doubts import Evidence, doubts_of, level_heading_rad, notes_of, quality_limit
from psabench.procedures.gyrocompass_fit import (
    Fit,
    Row,
    WindowMean,
    attitude_sd_rad,
    drift1_of,
    drift2_of,
    fit,
    sensitivity,
)
from psabench.procedures.gyrocompass_latitude import LatitudeEffect, latitude_effect
from psabench.procedures.gyrocompass_params import NAME, GyrocompassParams
from psabench.procedures.gyrocompass_windows import good_calibration, sorted_out
from psabench.procedures.head_bench import Progress
from psabench.procedures.platform_bench import PlatformBench, Window
from psabench.procedures.result import DEG, estimate_named

LEVEL_LIMIT_S = 60.0  # timeout for levelling


# ---- the run


def measure(
    bench: PlatformBench, p: GyrocompassParams, progress: Progress, *, seen: Callable[[], None] = lambda: None
) -> tuple[Window, ...]:
    """Level, go through the positions, calibrate: the last window is the calibration's if there is one.

    seen: called soon after the end of each window of the run. Raises LinkError where the platform does not do it.
    """
    bench.prepare(latitude_rad=p.latitude_rad, m1_per_s=p.m1_per_s, m2_per_s=p.m2_per_s)
    with progress.step("levelling", 1) as done:
        bench.level(LEVEL_LIMIT_S)
        done()
    table = p.table
    with progress.step("gyrocompassing", len(table.sequence_deg)) as done:

        def over(_: Window) -> None:
            seen()
            done()

        windows = tuple(bench.measure(table, over))
    if p.calibrate_s:
        with progress.step("calibrating the azimuth axis", 1) as done:
            windows += (bench.calibrate(p.calibrate_s, p.settle_s),)
            done()
    return windows


# ---- from windows to numbers


@dataclass(frozen=True, slots=True, kw_only=True)
class GyrocompassResult:
    """Estimates with their confidence, and everything a report shows."""

    params: GyrocompassParams
    windows: tuple[Window, ...]  # all, with the calibration's last
    rows: tuple[Row, ...]  # of the windows that count
    compass: nav.Compass
    attitude: nav.Attitude
    heading_rad: float
    drift1: WindowMean  # of the levelling axis
    drift2: WindowMean  # of the azimuth axis
    latitude: LatitudeEffect
    estimates: tuple[Estimate, ...]
    doubts: tuple[str, ...]  # reasons not to trust the heading
    notes: tuple[str, ...]

    def get(self, name: str) -> Estimate:
        """The estimate of that name; raises KeyError with the names there are."""
        return estimate_named(self.estimates, name, "estimate")

    @property
    def duration_s(self) -> float:
        """From the first window to the last of the run."""
        run = self.windows[: len(self.params.table.sequence_deg)]
        return run[-1].t_mid_s - run[0].t_mid_s + run[-1].length_s


def estimate(windows: Sequence[Window], p: GyrocompassParams) -> GyrocompassResult:
    """Pure. Raises LinkError when too few windows are good, with what was wrong with the others."""
    run = windows[: len(p.table.sequence_deg)]
    good, left_out = sorted_out(run)
    try:
        f = fit(good, p)
    except nav.Refused as e:
        why = "expected three" if e.status is nav.Status.TOO_FEW else str(e).removeprefix(f"{NAME}: ")
        told = "; ".join(left_out) or "all windows are good"
        raise LinkError(f"{NAME}: no heading from {len(good)} of {len(run)} windows: {why} ({told})") from e
    found = _evidence(f, len(run), drift2_of(f, good_calibration(windows, p)))
    return GyrocompassResult(
        params=p,
        windows=tuple(windows),
        rows=f.rows,
        compass=f.compass,
        attitude=f.attitude,
        heading_rad=f.heading_rad,
        drift1=found.drift1,
        drift2=found.drift2,
        latitude=found.latitude,
        estimates=_estimates(found),
        doubts=doubts_of(found),
        notes=(*left_out, *notes_of(found, windows)),
    )


def _evidence(f: Fit, planned: int, drift2: WindowMean) -> Evidence:
    s = sensitivity(f)
    limit = quality_limit(f, s)
    return Evidence(
        fit=f,
        planned=planned,
        sensitivity=s,
        quality_limit=limit,
        drift1=drift1_of(f, s),
        drift2=drift2,
        latitude=latitude_effect(f, limit, drift2),
    )


# ---- what is reported


def _estimates(e: Evidence) -> tuple[Estimate, ...]:
    """Angles as they are in the run, drifts as means over its windows; each with its budget.

    The zero of the angle sensor turns pitch into roll; that of gamma is fitted, and that of beta enters as its square.
    """
    f, c, attitude = e.fit, e.fit.compass, e.fit.attitude
    pitch, roll = attitude.pitch_rad, attitude.roll_rad
    pitch_sd, roll_sd, _ = attitude_sd_rad(f)
    zero = f.params.angle_zero_arcmin * ARCMIN
    level = within_limit("level zero", level_heading_rad(f.params, attitude))
    angle, to_pitch, to_roll = (within_limit("angle zero", zero * abs(by)) for by in (1.0, roll, pitch))
    drift1, drift2 = e.drift1, e.drift2
    return (
        _estimate("heading_deg", "ψ", f.heading_rad, c.alpha1_sd_rad, (angle, level)),
        _estimate("alpha1_deg", "α_1", c.alpha1_rad, c.platform_sd_rad, (level,)),
        _estimate("drift1_degph", "ω_d1", drift1.radps, drift1.sd_radps, drift1.constant),
        _estimate("drift2_degph", "ω_d2", drift2.radps, drift2.sd_radps, drift2.constant),
        _estimate("pitch_deg", "ϑ", pitch, pitch_sd, (to_pitch,)),
        _estimate("roll_deg", "γ", roll, roll_sd, (to_roll,)),
    )


def _estimate(name: str, symbol: str, value: float, sd: float, constant: Sequence[Component]) -> Estimate:
    """In deg or deg/h, from radians or rad/s. The interval of an angle is a whole turn at most."""
    unit, scale = ("deg/h", 1.0 / DEGPH) if name.endswith("_degph") else ("deg", DEG)
    e = Estimate(name=name, symbol=symbol, unit=unit, value=value * scale, sd=sd * scale, ci_half=0.0)
    e = expand_estimate(e, [replace(part, u=part.u * scale) for part in constant])
    return replace(e, ci_half=min(e.ci_half, 180.0)) if unit == "deg" else e
