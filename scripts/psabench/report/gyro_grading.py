"""Gyrocompassing and heading hold beside the truth and the article: tables as data, for all kinds of reports.

The truth comes from the truth port, after each window and at each look; no procedure sees it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from psabench.estimate.angles import wrapped_deg
from psabench.estimate.uncertainty import Estimate
from psabench.native.nav import DEGPH
from psabench.procedures.gyrocompass import GyrocompassResult, allowance
from psabench.procedures.heading_hold import HoldResult
from psabench.procedures.result import DEG, LIMIT_CI
from psabench.report.grading import aligned, numbers_of, with_ci

# What the article says that its simulation reaches, and what a hold may be off by.
CLAIMS: Mapping[str, tuple[float, str]] = {"heading_deg": (0.1, "deg"), "drift1_degph": (0.05, "deg/h")}
HOLD_CLAIM_DEG, HOLD_CLAIM_ABSTRACT_DEG = 0.3, 0.5


@dataclass(frozen=True, slots=True, kw_only=True)
class HeldTruth:
    """The vehicle's true heading at each look of a hold."""

    heading_deg: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class GyroSection:
    """One reading of the article, run once."""

    label: str
    result: GyrocompassResult
    truth: Mapping[str, float] | None = None  # by name of the estimate
    hold: HoldResult | None = None
    hold_truth: HeldTruth | None = None

    @property
    def title(self) -> str:
        p = self.result.params
        run = f"{len(p.table.sequence_deg)} positions, {p.window_s:g} s each, {self.result.duration_s:.0f} s in all"
        return f"gyrocompass, {self.label}: {run}"


@dataclass(frozen=True, slots=True, kw_only=True)
class GradedEstimate:
    """An estimate beside what it should have been."""

    estimate: Estimate
    truth: float | None
    error: float | None
    limit: float  # that |error| may reach: intervals, and the constant errors that no window sees
    claim: str  # of the article, "": none

    @property
    def within(self) -> bool | None:
        return None if self.error is None else abs(self.error) <= self.limit


def grade(s: GyroSection) -> tuple[GradedEstimate, ...]:
    """Every estimate beside the truth, when there is one."""
    may = allowance(s.result)
    rows = []
    for e in s.result.estimates:
        truth = None if s.truth is None else s.truth.get(e.name)
        error = None if truth is None else e.value - truth
        if error is not None and e.unit == "deg":
            error = wrapped_deg(error)
        bound, unit = CLAIMS.get(e.name, (0.0, ""))
        claim = f"within {bound:g} {unit}" if unit else ""
        limit = LIMIT_CI * e.ci_half + may.get(e.name, 0.0)
        rows.append(GradedEstimate(estimate=e, truth=truth, error=error, limit=limit, claim=claim))
    return tuple(rows)


def hold_errors_deg(s: GyroSection) -> tuple[float, ...]:
    """Heading less the truth at each look; (): no hold, or no truth."""
    if s.hold is None or s.hold_truth is None:
        return ()
    pairs = zip(s.hold.held, s.hold_truth.heading_deg, strict=True)
    return tuple(wrapped_deg(h.heading_rad * DEG - truth) for h, truth in pairs)


def hold_limits_deg(s: GyroSection) -> tuple[float, ...]:
    """What |error| may be at each look: what is to be expected, with the constant errors of heading and drift."""
    if s.hold is None:
        return ()
    may = allowance(s.result)
    return tuple(
        LIMIT_CI * h.half95_rad * DEG + may["heading_deg"] + may["drift2_degph"] * h.t_s / 3600.0 for h in s.hold.held
    )


def hold_within(s: GyroSection) -> bool | None:
    """None: nothing to compare."""
    errors = hold_errors_deg(s)
    return all(abs(e) <= m for e, m in zip(errors, hold_limits_deg(s), strict=True)) if errors else None


def doubts(s: GyroSection) -> tuple[str, ...]:
    return s.hold.doubts if s.hold else s.result.doubts


def within_limits(sections: Sequence[GyroSection]) -> bool:
    """Nothing misses the truth by more than its limits, and nothing is in doubt (exit status 0 or 1)."""
    graded = [g.within for s in sections for g in grade(s)] + [hold_within(s) for s in sections]
    return False not in graded and not any(doubts(s) for s in sections)


def verdict(sections: Sequence[GyroSection]) -> str:
    """A sentence or two on all that was compared."""
    compared = [g for s in sections for g in grade(s) if g.within is not None]
    out = sum(g.within is False for g in compared) + sum(hold_within(s) is False for s in sections)
    if any(doubts(s) for s in sections):
        return "The heading is not to be trusted: see the doubts."
    if not compared:
        return "No truth given: the numbers stand alone."
    held = " and the heading that was kept" if any(s.hold for s in sections) else ""
    if not out:
        return f"All {len(compared)} numbers{held} lie within their limits of the truth."
    return (
        f"{out} of {len(compared) + sum(hold_within(s) is not None for s in sections)} comparisons are out of limits."
    )


# ---- text


def table(s: GyroSection) -> list[tuple[str, ...]]:
    """Rows for console and page, the head first."""
    rows: list[tuple[str, ...]] = [("", "found", "+- 95 %", "unit", "truth", "error", "limit", "the article", "")]
    for g in grade(s):
        value, ci = with_ci(g.estimate.value, g.estimate.ci_half, most=4)
        truth = "" if g.truth is None else f"{g.truth:.4f}"
        error = "" if g.error is None else f"{g.error:+.4f}"
        mark = "OUT OF LIMITS" if g.within is False else ""
        rows.append((g.estimate.name, value, ci, g.estimate.unit, truth, error, f"{g.limit:.2g}", g.claim, mark))
    return rows


def hold_table(s: GyroSection) -> list[tuple[str, ...]]:
    """The same of a hold; [] without one. At most nine looks of it."""
    if s.hold is None:
        return []
    errors, limits = hold_errors_deg(s), hold_limits_deg(s)
    rows: list[tuple[str, ...]] = [("", "heading", "+- 95 %", "unit", "error", "limit")]
    n = len(s.hold.held)
    for k in sorted({round(i * (n - 1) / 8) for i in range(9)}):
        h = s.hold.held[k]
        error = f"{errors[k]:+.4f}" if errors else ""
        ci = f"{h.half95_rad * DEG:.3f}"
        rows.append(
            (f"after {h.t_s / 3600.0:.2f} h", f"{h.heading_rad * DEG:.4f}", ci, "deg", error, f"{limits[k]:.2g}")
        )
    return rows


def hold_summary(s: GyroSection) -> str:
    """One sentence; "" without a hold or truth."""
    errors = hold_errors_deg(s)
    if not errors or s.hold is None:
        return ""
    worst, hours = max(abs(e) for e in errors), s.hold.held[-1].t_s / 3600.0
    met = "met" if worst <= HOLD_CLAIM_DEG else "not met"
    return (
        f"largest error {worst:.3f} deg in {hours:.2g} h; the article has {HOLD_CLAIM_DEG:g} in 4 h "
        f"({HOLD_CLAIM_ABSTRACT_DEG:g} in its abstract): {met} by this run"
    )


def console_table(s: GyroSection) -> str:
    """What the terminal shows."""
    lines = [s.title, *(f"  {line}" for line in aligned(table(s)))]
    c = s.result.compass
    lines.append(f"  |hypot(s, c) - 1| = {c.quality:.4f}, determinant {c.geometry:.2f} We^2")
    lines.append(f"  {s.result.latitude.words}")
    if s.hold is not None:
        lines.append(f"hold, drift of the azimuth axis compensated: {s.hold.drift2_radps / DEGPH:.3f} deg/h")
        lines += [f"  {line}" for line in aligned(hold_table(s))]
        lines += [f"  {hold_summary(s)}"] if hold_summary(s) else []
    lines += [f"  DOUBT: {d}" for d in doubts(s)] + [f"  note: {n}" for n in s.result.notes]
    return "\n".join(lines)


# ---- data


def result_dict(s: GyroSection) -> dict[str, object]:
    """One section of result.json: plain data, units in the names."""
    r = s.result
    return {
        "reading": s.label,
        "params": {name: getattr(r.params, name) for name in r.params.__dataclass_fields__},
        "duration_s": r.duration_s,
        "estimates": [
            {
                **numbers_of(g.estimate),
                "truth": g.truth,
                "error": g.error,
                "limit": g.limit,
                "within_limits": g.within,
                "article": g.claim,
            }
            for g in grade(s)
        ],
        "quality": r.compass.quality,
        "determinant": r.compass.geometry,
        "latitude": {name: getattr(r.latitude, name) for name in r.latitude.__dataclass_fields__},
        "positions": [
            {
                "number": row.number + 1,
                "angle_deg": row.q_rad * DEG,
                "alpha_turn_deg": row.position.delta_rad * DEG,
                "t_mid_s": row.position.t_mid_s,
                "s_degph": row.position.s_radps / DEGPH,
                "beta_arcmin": row.position.beta_rad * DEG * 60.0,
                "gamma_deg": row.position.gamma_rad * DEG,
                "residual_degph": row.residual_radps / DEGPH,
            }
            for row in r.rows
        ],
        "doubts": list(doubts(s)),
        "notes": list(r.notes),
        "hold": _hold_dict(s),
    }


def _hold_dict(s: GyroSection) -> dict[str, object] | None:
    if s.hold is None:
        return None
    errors = hold_errors_deg(s)
    return {
        "params": {name: getattr(s.hold.params, name) for name in s.hold.params.__dataclass_fields__},
        "drift2_degph": s.hold.drift2_radps / DEGPH,
        "t_s": [h.t_s for h in s.hold.held],
        "heading_deg": [h.heading_rad * DEG for h in s.hold.held],
        "sd_deg": [h.sd_rad * DEG for h in s.hold.held],
        "error_deg": list(errors) if errors else None,
        "limit_deg": list(hold_limits_deg(s)),
        "within_limits": hold_within(s),
    }
