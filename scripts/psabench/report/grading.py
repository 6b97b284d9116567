"""Estimates beside the truth and beside the article: tables as data, for the console, the report and result.json.

Truth comes from the truth port after the run, as a mapping with the names of the emulator's scenario (u0_v, alpha0_deg,
kx_v_per_g, ... kyy_v_per_g2); no procedure ever sees it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields

from psabench.errors import expected
from psabench.estimate.model import Sensor
from psabench.estimate.uncertainty import Estimate
from psabench.procedures.registry import PROCEDURES
from psabench.procedures.result import LIMIT_CI, ProcedureResult

# Printed by the article for its sensor, to these digits.
ARTICLE = (
    ("u0_v", "u_0", "V", "2.50"),
    ("alpha0_deg", "α_0", "deg", "0.1121"),
    ("kx_v_per_g", "k_x", "V/g", "1.0"),
    ("ky_v_per_g", "k_y", "V/g", "0.0098"),
    ("kxy_v_per_g2", "k_xy", "V/g²", "0.0010"),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Section:
    """One result of a report, with what distinguishes it: "quiet", "realistic", ..."""

    label: str
    result: ProcedureResult
    truth: Mapping[str, float] | None = None  # the sensor's hidden parameters
    allowance: Mapping[str, float] = field(default_factory=dict)  # by estimate: error of the chain that no CI contains

    @property
    def title(self) -> str:
        return f"{self.result.procedure}, {self.label}" if self.label else self.result.procedure


@dataclass(frozen=True, slots=True, kw_only=True)
class Graded:
    """An estimate beside what it should have been."""

    estimate: Estimate
    truth: float | None
    error: float | None  # estimate - truth
    z: float | None  # error / sd
    within: bool | None  # None: nothing to compare, or flagged as not identifiable


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
    want = PROCEDURES[result.procedure].expected(sensor_of(section.truth)) if section.truth is not None else {}
    return tuple(_graded(e, want.get(e.name), section.allowance.get(e.name, 0.0)) for e in result.estimates)


def _graded(e: Estimate, truth: float | None, allowance: float) -> Graded:
    if truth is None:
        return Graded(estimate=e, truth=None, error=None, z=None, within=None)
    error = e.value - float(truth)
    within = abs(error) <= LIMIT_CI * e.ci_half + allowance if e.identifiable else None
    z = error / e.sd if e.sd > allowance else None  # below it the chain's tolerance speaks, not the noise
    return Graded(estimate=e, truth=float(truth), error=error, z=z, within=within)


def within_limits(sections: Sequence[Section]) -> bool:
    """Nothing that counts as measured misses the truth by more than its limits (exit status 0 or 1)."""
    return not any(g.within is False for s in sections for g in grade(s))


def as_printed(value: float, printed: str) -> str:
    """A value with as many decimals as the article prints."""
    return f"{value:.{len(printed.partition('.')[2])}f}"


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
        "drift": None if r.drift is None else _estimate_dict(r.drift),
        "estimates": [
            {**_estimate_dict(g.estimate), "truth": g.truth, "error": g.error, "z": g.z, "within_limits": g.within}
            for g in grade(section)
        ],
        "correlation": {"names": list(r.correlation.names), "matrix": r.correlation.matrix.tolist()},
        "notes": list(r.notes),
    }


def _estimate_dict(e: Estimate) -> dict[str, object]:
    return {**numbers_of(e), "identifiable": e.identifiable, "reason": e.reason}


def numbers_of(e: Estimate) -> dict[str, object]:
    """An estimate of result.json, for a reading of any procedure."""
    ci95 = [e.value - e.ci_half, e.value + e.ci_half]
    return {"name": e.name, "unit": e.unit, "value": e.value, "sd": e.sd, "ci95": ci95}


def console_table(section: Section) -> str:
    """What the terminal shows at the end of a run: one line an estimate, then the notes."""
    r = section.result
    head = f"{section.title}: {len(r.readings)} readings, residual {r.residual_rms_v * 1e6:.4g} uV rms"
    rows = [("", "estimate", "+- 95 %", "unit", "truth", "error", "z", "")]
    for g in grade(section):
        value, ci = with_ci(g.estimate.value, g.estimate.ci_half)
        truth = "" if g.truth is None else f"{g.truth:.7g}"
        error = "" if g.error is None else f"{g.error:+.2g}"
        z = "" if g.z is None else f"{g.z:+.1f}"
        rows.append((g.estimate.name, value, ci, g.estimate.unit, truth, error, z, _mark(g)))
    lines = [f"  {line}" for line in aligned(rows, left=(0, 7))]
    notes = [f"  note: {n}" for n in r.notes]
    why = [f"  {e.name}: {e.reason}" for e in r.estimates if not e.identifiable]
    return "\n".join([head, *lines, *why, *notes])


def verdict(sections: Sequence[Section]) -> str:
    """One or two sentences on everything that was compared with a truth."""
    graded = [g for s in sections for g in grade(s)]
    compared = [g for g in graded if g.within is not None]
    out = sum(g.within is False for g in compared)
    flagged = sum(not g.estimate.identifiable for g in graded)
    if not compared:
        text = "No truth given: the numbers stand alone."
    elif out == 0:
        text = f"All {len(compared)} measured numbers lie within their limits of the truth."
    else:
        text = f"{out} of {len(compared)} measured numbers lie outside their limits."
    return text + (f" {flagged} numbers are flagged: the data do not determine them." if flagged else "")


def console_comparison(sections: Sequence[Section]) -> str:
    """The article's printed values beside ours, with its digits; `?` marks what is not identifiable."""
    rows = [
        ("", "", *(s.result.procedure for s in sections)),
        ("", "printed", *(s.label for s in sections)),
    ]
    for name, _, _, printed in ARTICLE:
        found = [next((e for e in s.result.estimates if e.name == name), None) for s in sections]
        rows.append((name, printed, *("-" if e is None else _beside(e, printed) for e in found)))
    head = "beside the article, with its digits (?: not identifiable from these data)"
    return "\n".join([head, *(f"  {line}" for line in aligned(rows))])


def _beside(e: Estimate, printed: str) -> str:
    return as_printed(e.value, printed) + ("" if e.identifiable else "?")


def _mark(g: Graded) -> str:
    if not g.estimate.identifiable:
        return "not identifiable"
    return "OUT OF LIMITS" if g.within is False else ""
