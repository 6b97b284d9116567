"""report.html and result.json of a gyro's calibration, and what the console shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from psabench.estimate.uncertainty import Estimate
from psabench.mems_gyro.noise import allan_law
from psabench.mems_gyro.params import NAME
from psabench.mems_gyro.run import MemsGyroRun, verdict_words
from psabench.report import plots
from psabench.report.page import bullets, figure, section, table, verdict_line, whole_page, write_report

NOTES = (
    "u = u0 + S (W + c2 W² + c3 W³), W = ωx + my ωy + mz ωz + dx ax + dy ay + dz az; "
    "a is +1 g on an axis that points down.",
    "u0 is the mean over the rests of the series. It holds what the quadrature makes of a zero; a rate table at one "
    "temperature cannot tell them apart.",
    "U is the expanded uncertainty, k = 2 of a normal distribution (95.45 %): scatter and the bench's components.",
    "my and mz hold the mounting of the unit on the table.",
)


def table_rows(run: MemsGyroRun) -> list[list[str]]:
    """Each number: value, U, and beside the truth its error in U."""
    head = ["", "unit", "value", "U"]
    rows = [head if run.truth is None else [*head, "true", "error / U", ""]]
    for e in (*run.result.estimates, *run.result.noise):
        row = [e.symbol, e.unit, f"{e.value:.6g}", f"{e.ci_half:.2g}"]
        if run.truth is not None:
            en = run.en(e)
            row += [f"{run.truth[e.name]:.6g}", "" if en is None else f"{en:+.2f}", e.reason]
        elif e.reason:
            row[3] = e.reason
        rows.append(row)
    return rows


def budget_rows(run: MemsGyroRun) -> list[list[str]]:
    """Standard uncertainties by component."""
    names = list(dict.fromkeys(c.name for e in run.result.estimates for c in e.budget))
    rows = [["", "unit", *names, "combined"]]
    for e in run.result.estimates:
        u = {c.name: f"{c.u:.2g}" for c in e.budget}
        rows.append([e.symbol, e.unit, *(u.get(n, "") for n in names), f"{e.sd:.2g}"])
    return rows


def draw_allan(run: MemsGyroRun) -> str:
    """Allan deviation of the recording, and the law of the terms that were found."""
    r = run.result
    tau_s = np.geomspace(r.tau_s[0], r.tau_s[-1], 60)
    with plots.drawing(3.0) as (fig, ax):
        ax.loglog(r.tau_s, 3600.0 * r.allan_dps, "o", ms=4, color=plots.SERIES[0], label="recording at rest")
        ax.loglog(
            tau_s, 3600.0 * allan_law(r.powers, tau_s), lw=1.3, color=plots.SERIES[1], label="N, B, K as estimated"
        )
        ax.set_xlabel("averaging time τ, s")
        ax.set_ylabel("Allan deviation, °/h")
        ax.legend(loc="best")
        return plots.svg(fig, "mems-gyro-allan")


def draw_residuals(run: MemsGyroRun) -> str:
    """What the model leaves of each dwell, against the rate of the table."""
    r = run.result
    rates = [d.rate_dps for d in r.dwells if not d.recording]
    with plots.drawing(2.6) as (fig, ax):
        ax.plot(rates, 1e3 * r.residual_v / r.theta[1], "o", ms=3, color=plots.SERIES[0])
        ax.set_xlabel("rate of the table, °/s")
        ax.set_ylabel("residual, m°/s")
        return plots.svg(fig, "mems-gyro-residuals")


def result_dict(run: MemsGyroRun) -> dict[str, Any]:
    """result.json: `psabench passport add` reads such sections."""
    r = run.result
    one = {
        "label": str(run.facts["bench"]),
        "procedure": NAME,
        "estimates": [_estimate_dict(run, e) for e in (*r.estimates, *r.noise)],
        "correlation": {"names": list(r.correlation.names), "matrix": r.correlation.matrix.tolist()},
        "nonlinearity_part_of_full_scale": r.nonlinearity,
        "allan": {"tau_s": r.tau_s.tolist(), "deviation_dps": r.allan_dps.tolist()},
        "doubts": list(r.doubts),
    }
    return {"format": 1, "facts": {"procedure": NAME, **run.facts}, "params": asdict(run.params), "sections": [one]}


def _estimate_dict(run: MemsGyroRun, e: Estimate) -> dict[str, Any]:
    found: dict[str, Any] = {
        "name": e.name,
        "unit": e.unit,
        "value": e.value,
        "sd": e.sd,
        "ci95": [e.value - e.ci_half, e.value + e.ci_half],
        "identifiable": e.identifiable,
        "budget": {c.name: c.u for c in e.budget},
    }
    if run.truth is not None:
        found |= {"truth": run.truth[e.name], "error": e.value - run.truth[e.name]}
    return found


def write_page(out: Path, run: MemsGyroRun) -> Path:
    """report.html and result.json; the page. Raises OSError, OutputError."""
    bent = f"Largest deviation from the best straight line: {100.0 * run.result.nonlinearity:.3f} % of full scale."
    facts: Mapping[str, str] = run.facts
    parts = (
        section("Verdict", verdict_line(verdict_words(run), None if run.truth is None else run.within)),
        section("Doubts", bullets(run.result.doubts)) if run.result.doubts else "",
        section("Parameters", table(table_rows(run)), f"<p>{bent}</p>"),
        section("Uncertainty budget", table(budget_rows(run))),
        section("Noise at rest", figure(draw_allan(run))),
        section("Residuals", figure(draw_residuals(run))),
        section("How to read them", bullets(NOTES)),
    )
    return write_report(out, result_dict(run), whole_page("Calibration of a micromechanical gyro", facts, parts))
