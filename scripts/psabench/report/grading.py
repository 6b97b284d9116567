"""Estimates beside the truth: tables as data, for the console, the report and result.json.

Truth comes from the truth port after the run, as a mapping with the names of the emulator's scenario (u0_v, alpha0_deg,
kx_v_per_g, ... kyy_v_per_g2, drift_v_per_s); no procedure ever sees it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace

from psabench.budget.gum import COVERAGE
from psabench.errors import expected
from psabench.estimate.face import Face
from psabench.estimate.model import Sensor
from psabench.estimate.uncertainty import Estimate
from psabench.procedures.registry import PROCEDURES
from psabench.procedures.result import LIMIT_CI, ProcedureResult


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One result of a report, with what distinguishes it: "quiet", "realistic", ..."""

    label: str
    result: ProcedureResult
    truth: Mapping[str, float] | None = None  # the sensor's hidden parameters
    zero_moved_v: tuple[float, ...] = ()  # from u0_v, at each reading; (): by drift_v_per_s alone
    expected: Callable[[Sensor, Sensor], Mapping[str, float]] | None = None  # None: the procedure's own

    @property
    def title(self) -> str:
        return f"{self.result.procedure}, {self.label}" if self.label else self.result.procedure


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """An estimate beside what it should have been."""

    estimate: Estimate
    truth: float | None
    error: float | None  # estimate - truth

    @property
    def z(self) -> float | None:
        """Error in standard uncertainties. None: no truth."""
        return None if self.error is None else ratio_of(self.error, self.estimate.sd)

    @property
    def en(self) -> float | None:
        """Normalised error, ISO 13528 9.6: error over U, for the truth is exact. None: no truth."""
        return None if self.error is None else ratio_of(self.error, self.estimate.ci_half)


@dataclass(frozen=True, slots=True, kw_only=True)
class Graded(Compared):
    """An estimate of a calibration."""

    within: bool | None  # None: nothing to compare, or flagged as not identifiable


def ratio_of(error: float, u: float) -> float:
    """Of an error to an uncertainty; without uncertainty any error is infinitely many of them."""
    return error / u if u > 0.0 else math.copysign(math.inf, error) if error else 0.0


def sensor_of(truth: Mapping[str, float]) -> Sensor:
    """The sensor of a truth mapping; names it does not know are other people's.

    Raises ValueError when u0_v or kx_v_per_g is missing.
    """
    missing = [name for name in ("u0_v", "kx_v_per_g") if name not in truth]
    if missing:
        raise ValueError(expected(f"truth with {' and '.join(missing)}", ", ".join(sorted(truth))))
    known = {f.name: float(truth[f.name]) for f in fields(Sensor) if f.name in truth}
    if "alpha0_deg" in truth:
        known["alpha0_rad"] = math.radians(truth["alpha0_deg"])
    return Sensor(**known)


def grade(section: Section) -> tuple[Graded, ...]:
    """Every estimate of a section beside the truth, when there is one."""
    result = section.result
    if section.truth is None:
        return tuple(_graded(e, None) for e in result.estimates)
    upright, side = (_sensor_when(section, faces) for faces in (_UPRIGHT, _SIDE))
    want = (section.expected or PROCEDURES[result.procedure].expected)(upright, side)
    return tuple(_graded(e, want.get(e.name)) for e in result.estimates)


_UPRIGHT, _SIDE = (Face.DIRECT, Face.REVERSED), (Face.SIDE, Face.SIDE_REVERSED)


def _sensor_when(section: Section, faces: Collection[Face]) -> Sensor:
    """The sensor with its zero as it was, on average, in the readings on these faces: it drifts and wanders."""
    assert section.truth is not None
    sensor, readings = sensor_of(section.truth), section.result.readings
    drift_vps = float(section.truth.get("drift_v_per_s", 0.0))
    moved_v = section.zero_moved_v or tuple(drift_vps * r.t_s for r in readings)
    of_faces = [v for v, r in zip(moved_v, readings, strict=True) if r.face in faces]
    return replace(sensor, u0_v=sensor.u0_v + math.fsum(of_faces) / max(len(of_faces), 1))


def _graded(e: Estimate, truth: float | None) -> Graded:
    if truth is None:
        return Graded(estimate=e, truth=None, error=None, within=None)
    error = e.value - float(truth)
    within = abs(error) <= LIMIT_CI * e.ci_half if e.identifiable else None
    return Graded(estimate=e, truth=float(truth), error=error, within=within)


def within_limits(sections: Sequence[Section]) -> bool:
    """Nothing that counts as measured misses the truth by more than its limits (exit status 0 or 1)."""
    return not any(s.result.doubts or g.within is False for s in sections for g in grade(s))


def with_ci(value: float, ci_half: float, most: int = 9) -> tuple[str, str]:
    """Value and half width with the decimals that the half width deserves (two digits of it), at most `most`."""
    if not (math.isfinite(value) and math.isfinite(ci_half)):
        return f"{value:.6g}", f"{ci_half:.2g}"
    if max(abs(value), ci_half) < 1e-5 and value != 0.0:
        return f"{value:.4g}", f"{ci_half:.2g}"
    decimals = most if ci_half <= 0.0 else min(most, max(0, 1 - math.floor(math.log10(ci_half))))
    small = ci_half < 0.5 * 10.0**-decimals
    return f"{value:.{decimals}f}", f"{ci_half:.1g}" if small else f"{ci_half:.{decimals}f}"


def aligned(rows: Sequence[Sequence[str]], left: Sequence[int] = (0,)) -> list[str]:
    """A table as lines of text: these columns, the first alone, to the left, the others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    sides = [str.ljust if i in left else str.rjust for i in range(len(widths))]
    return ["  ".join(put(x, w) for put, x, w in zip(sides, r, widths, strict=True)).rstrip() for r in rows]


def result_dict(section: Section) -> dict[str, object]:
    """One section of result.json: plain data, units in the names."""
    r = section.result
    return {
        "label": section.label,
        "procedure": r.procedure,
        "axis": r.axis,
        "g_mps2": r.g_mps2,
        "readings": len(r.readings),
        "duration_s": r.duration_s,
        "residual_rms_v": r.residual_rms_v,
        "drift": None if r.drift is None else estimate_dict(r.drift),
        "estimates": [
            {
                **estimate_dict(g.estimate),
                "truth": g.truth,
                "error": g.error,
                "z": finite_or_none(g.z),
                "en": finite_or_none(g.en),
                "within_limits": g.within,
            }
            for g in grade(section)
        ],
        "correlation": {"names": list(r.correlation.names), "matrix": r.correlation.matrix.tolist()},
        "doubts": list(r.doubts),
        "notes": list(r.notes),
    }


def estimate_dict(e: Estimate) -> dict[str, object]:
    return {
        **numbers_of(e),
        "expanded_u": e.ci_half,
        "dof": finite_or_none(e.dof),
        "budget": {c.name: c.u for c in e.budget},
        "identifiable": e.identifiable,
        "reason": e.reason,
    }


def finite_or_none(x: float | None) -> float | None:
    """JSON has no infinity."""
    return x if x is not None and math.isfinite(x) else None


def numbers_of(e: Estimate) -> dict[str, object]:
    """An estimate of result.json, for a reading of any procedure."""
    ci95 = [e.value - e.ci_half, e.value + e.ci_half]
    return {"name": e.name, "unit": e.unit, "value": e.value, "sd": e.sd, "ci95": ci95}


def console_table(section: Section) -> str:
    """What the terminal shows at the end of a run: one line an estimate, then the notes."""
    r = section.result
    head = f"{section.title}: {len(r.readings)} readings, residual {r.residual_rms_v * 1e6:.4g} uV rms"
    rows = [("", "estimate", "U", "unit", "truth", "error", "z", "En", "")]
    for g in grade(section):
        value, ci = with_ci(g.estimate.value, g.estimate.ci_half)
        truth = "" if g.truth is None else f"{g.truth:.7g}"
        error = "" if g.error is None else f"{g.error:+.2g}"
        z, en = as_ratio(g.z, 1), as_ratio(g.en, 2)
        rows.append((g.estimate.name, value, ci, g.estimate.unit, truth, error, z, en, _mark(g)))
    lines = [f"  {line}" for line in aligned(rows, left=(0, 8))]
    notes = [f"  DOUBT: {d}" for d in r.doubts] + [f"  note: {n}" for n in r.notes]
    why = [f"  {e.name}: {e.reason}" for e in r.estimates if not e.identifiable]
    return "\n".join([head, *lines, *why, *notes])


def as_ratio(x: float | None, decimals: int) -> str:
    """z or En as text; "" without a truth."""
    return "" if x is None else f"{x:+.{decimals}f}"


def verdict(sections: Sequence[Section]) -> str:
    """What was compared with what, and how it came out."""
    graded = [g for s in sections for g in grade(s)]
    compared = [g for g in graded if g.within is not None]
    out = sum(g.within is False for g in compared)
    flagged = sum(not g.estimate.identifiable for g in graded)
    if any(s.result.doubts for s in sections):
        text = "The intervals are not to be trusted: see the doubts."
    elif not compared:
        text = "No truth given: the numbers stand alone."
    else:
        head, within = ("All", "within") if out == 0 else (f"{out} of", "not within")
        beyond, by_chance = sum(abs(g.en or 0.0) > 1.0 for g in compared), (1.0 - COVERAGE) * len(compared)
        text = (
            f"{head} {len(compared)} numbers are {within} {LIMIT_CI:g} U of the sensor's true parameters, "
            f"{beyond} are beyond U (expected: {by_chance:.1f})."
        )
    return text + (f" {flagged} flagged numbers are not compared." if flagged else "")


def _mark(g: Graded) -> str:
    if not g.estimate.identifiable:
        return "not identifiable"
    return "OUT OF LIMITS" if g.within is False else ""
