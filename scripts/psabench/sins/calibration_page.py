"""report.html and result.json of a calibration on a table, and what the console shows."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from psabench.report.page import bullets, section, table, verdict_line, whole_page, write_report
from psabench.sins.calibration_grade import P_LIMIT
from psabench.sins.calibration_params import NAME
from psabench.sins.calibration_run import SinsRun
from psabench.sins.correction import correction_dict


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


def verdict_words(run: SinsRun) -> str:
    """One line: what was compared with what."""
    r = run.result
    said = [f"{len(r.parameters)} parameters"]
    if run.graded is None:
        said.append("no truth to compare with")
    else:
        g = run.graded
        beside = f"{len(g.names)} beside the truth: chi-square {g.chi_square:.1f}, p {g.p:.3f}"
        said.append(beside + ("" if g.p >= P_LIMIT else f", below {P_LIMIT:g}"))
        if without := len(r.parameters) - len(g.names):
            said.append(f"{without} without a truth")
    return "; ".join([*said, f"innovations²/variance {r.nis_accel:.3f}"])


def result_dict(run: SinsRun) -> dict[str, Any]:
    """result.json: `psabench passport add` and `psabench nav apply` read it."""
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
        "advice": list(run.advice),
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
    good = None if run.graded is None and run.within else run.within
    parts: Sequence[str] = (
        section("Verdict", verdict_line(verdict_words(run), good), bullets(run.result.doubts)),
        *([section("Before the run", bullets(run.advice))] if run.advice else []),
        section("Parameters", table(table_rows(run))),
        section("How to read them", bullets(NOTES)),
    )
    return write_report(out, result_dict(run), whole_page("Calibration of a strapdown unit", run.facts, parts))
