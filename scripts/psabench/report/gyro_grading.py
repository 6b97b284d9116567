"""Gyrocompassing and heading hold beside the truth and the article: tables as data, for all kinds of reports.

The truth comes from the truth port, after each window and at each look; no procedure sees it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from psabench.budget.gum import COVERAGE
from psabench.estimate.angles import wrapped_deg
from psabench.native.nav import DEGPH
from psabench.procedures.gyrocompass import GyrocompassResult
from psabench.procedures.heading_hold import HoldResult
from psabench.procedures.result import DEG, LIMIT_CI
from psabench.report.grading import Compared, aligned, as_ratio, estimate_dict, finite_or_none, ratio_of, with_ci

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
    article: bool = False  # of the article's platform: its claims are beside what was found

    @property
    def title(self) -> str:
        p = self.result.params
        run = f"{len(p.table.sequence_deg)} positions, {p.window_s:g} s each, {self.result.duration_s:.0f} s in all"
        return f"gyrocompass, {self.label}: {run}"


@dataclass(frozen=True, slots=True, kw_only=True)
class GradedEstimate(Compared):
    """A number of gyrocompassing."""

    claim: str  # of the article, "": none

    @property
    def limit(self) -> float:
        """That |error| may reach."""
        return LIMIT_CI * self.estimate.ci_half

    @property
    def within(self) -> bool | None:
        return None if self.error is None else abs(self.error) <= self.limit


def grade(s: GyroSection) -> tuple[GradedEstimate, ...]:
    """Every estimate beside the truth, when there is one."""
    rows = []
    for e in s.result.estimates:
        truth = None if s.truth is None else s.truth.get(e.name)
        error = None if truth is None else e.value - truth
        if error is not None and e.unit == "deg":
            error = wrapped_deg(error)
        bound, unit = CLAIMS.get(e.name, (0.0, "")) if s.article else (0.0, "")
        claim = f"within {bound:g} {unit}" if unit else ""
        rows.append(GradedEstimate(estimate=e, truth=truth, error=error, claim=claim))
    return tuple(rows)


def hold_errors_deg(s: GyroSection) -> tuple[float, ...]:
    """Heading less the truth at each look; (): no hold, or no truth."""
    if s.hold is None or s.hold_truth is None:
        return ()
    pairs = zip(s.hold.held, s.hold_truth.heading_deg, strict=True)
    return tuple(wrapped_deg(h.heading_rad * DEG - truth) for h, truth in pairs)


def hold_limits_deg(s: GyroSection) -> tuple[float, ...]:
    """What |error| may be at each look."""
    return tuple(LIMIT_CI * h.u_rad * DEG for h in s.hold.held) if s.hold else ()


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
    """What was compared with what, and how it came out."""
    compared = [g for s in sections for g in grade(s) if g.within is not None]
    out = sum(g.within is False for g in compared) + sum(hold_within(s) is False for s in sections)
    beyond, by_chance = sum(abs(g.en or 0.0) > 1.0 for g in compared), (1.0 - COVERAGE) * len(compared)
    if any(doubts(s) for s in sections):
        return "The heading is not to be trusted: see the doubts."
    if not compared:
        return "No truth given: the numbers stand alone."
    held = " and the heading that was kept" if any(s.hold for s in sections) else ""
    if not out:
        return (
            f"All {len(compared)} numbers{held} are within {LIMIT_CI:g} U of the truth, {beyond} of the numbers are "
            f"beyond U (expected: {by_chance:.1f})."
        )
    both = len(compared) + sum(hold_within(s) is not None for s in sections)
    return f"{out} of {both} comparisons are not within {LIMIT_CI:g} U of the truth."


# ---- text


def table(s: GyroSection) -> list[tuple[str, ...]]:
    """Rows for console and page, the head first."""
    claims = ("the article",) if s.article else ()
    rows: list[tuple[str, ...]] = [("", "found", "U", "unit", "truth", "error", "z", "En", *claims, "")]
    for g in grade(s):
        value, ci = with_ci(g.estimate.value, g.estimate.ci_half, most=4)
        truth = "" if g.truth is None else f"{g.truth:.4f}"
        error = "" if g.error is None else f"{g.error:+.4f}"
        mark = "OUT OF LIMITS" if g.within is False else ""
        ratios = as_ratio(g.z, 1), as_ratio(g.en, 2)
        claim = (g.claim,) if s.article else ()
        rows.append((g.estimate.name, value, ci, g.estimate.unit, truth, error, *ratios, *claim, mark))
    return rows


def hold_table(s: GyroSection) -> list[tuple[str, ...]]:
    """The same of a hold; [] without one. At most nine looks of it."""
    if s.hold is None:
        return []
    errors = hold_errors_deg(s)
    rows: list[tuple[str, ...]] = [("", "heading", "U", "unit", "error", "En")]
    n = len(s.hold.held)
    for k in sorted({round(i * (n - 1) / 8) for i in range(9)}):
        h = s.hold.held[k]
        error = f"{errors[k]:+.4f}" if errors else ""
        u_deg = h.u_rad * DEG
        en = as_ratio(ratio_of(errors[k], u_deg), 2) if errors else ""
        rows.append((f"after {h.t_s / 3600.0:.2f} h", f"{h.heading_rad * DEG:.4f}", f"{u_deg:.3f}", "deg", error, en))
    return rows


def hold_summary(s: GyroSection) -> str:
    """One sentence; "" without a hold or truth."""
    errors = hold_errors_deg(s)
    if not errors or s.hold is None:
        return ""
    worst, hours = max(abs(e) for e in errors), s.hold.held[-1].t_s / 3600.0
    found = f"largest error {worst:.3f} deg in {hours:.2g} h"
    if not s.article:
        return found
    met = "met" if worst <= HOLD_CLAIM_DEG else "not met"
    return (
        f"{found}; the article has {HOLD_CLAIM_DEG:g} in 4 h ({HOLD_CLAIM_ABSTRACT_DEG:g} in its abstract): "
        f"{met} by this run"
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
                **estimate_dict(g.estimate),
                "truth": g.truth,
                "error": g.error,
                "z": finite_or_none(g.z),
                "en": finite_or_none(g.en),
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
        "expanded_u_deg": [h.u_rad * DEG for h in s.hold.held],
        "error_deg": list(errors) if errors else None,
        "limit_deg": list(hold_limits_deg(s)),
        "within_limits": hold_within(s),
    }
