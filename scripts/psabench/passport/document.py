"""A passport as JSON (proto/passport.schema.json) and as lines for the terminal."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from psabench.passport.store import Measured, Passport, UnitRun
from psabench.report.grading import aligned, with_ci
from psabench.thermal.compensation import compensation_dict

FORMAT = 1


def passport_dict(p: Passport) -> dict[str, Any]:
    """Of JSON's types. `current` names the runs that are valid now."""
    return {
        "format": FORMAT,
        "serial": p.serial,
        "type": p.type,
        "current": [run.number for run in p.current_runs()],
        "runs": [run_dict(run) for run in p.runs],
    }


def run_dict(run: UnitRun) -> dict[str, Any]:
    """One run; its estimates have the keys of result.json."""
    return {
        "number": run.number,
        "method": run.method,
        "begun": run.begun,
        "seed": run.seed,
        "version": run.version,
        "data_sha256": run.data_sha256,
        "within_limits": run.within,
        "range_c": None if run.range_c is None else list(run.range_c),
        "supersedes": run.supersedes,
        "estimates": [_measured_dict(q) for q in run.quantities],
        "covariance": None
        if run.covariance is None
        else {"names": list(run.covariance.names), "matrix": [list(row) for row in run.covariance.matrix]},
        "provenance": dict(run.provenance),
    }


def _measured_dict(q: Measured) -> dict[str, Any]:
    return {
        "name": q.name,
        "unit": q.unit,
        "value": q.value,
        "ci95": [q.value - q.half_width, q.value + q.half_width],
        "compensation": None if q.compensation is None else compensation_dict(q.compensation),
    }


def comparable_dict(run: UnitRun) -> dict[str, Any]:
    """A run for a comparison: its estimates, and apart from them where they come from."""
    made = run_dict(run)
    kept = ("method", "within_limits", "range_c", "estimates")
    return {
        "provenance": {k: v for k, v in made.items() if k not in (*kept, "covariance", "provenance")},
        **{k: made[k] for k in kept},
    }


# ---- the terminal


def list_lines(passports: list[Passport]) -> Iterator[str]:
    """A line a unit."""
    rows = [("serial", "type", "runs", "valid now", "last run")]
    for p in passports:
        methods = ", ".join(run.method for run in p.current_runs())
        rows.append((p.serial, p.type, str(len(p.runs)), methods, p.runs[-1].begun if p.runs else ""))
    yield from aligned(rows, left=(0, 1, 3, 4))


def passport_lines(p: Passport, *, history: bool) -> Iterator[str]:
    """The runs that are valid now, or all of them."""
    yield f"{p.serial}, {p.type}: {len(p.runs)} run{'s' if len(p.runs) != 1 else ''}"
    for run in p.runs if history else p.current_runs():
        yield ""
        yield from _run_lines(run)


def _run_lines(run: UnitRun) -> Iterator[str]:
    limits = {None: "no limits", True: "within limits", False: "OUT OF LIMITS"}[run.within]
    seed = "" if run.seed is None else f", seed {run.seed}"
    past = "" if run.supersedes is None else f", supersedes run {run.supersedes}"
    yield f"run {run.number}: {run.method}, {run.begun}, psabench {run.version}{seed}, {limits}{past}"
    rows = []
    for q in run.quantities:
        value, half = with_ci(q.value, q.half_width)
        rows.append((q.name, value, f"± {half}", q.unit, _curve_text(q)))
    yield from (f"  {line}" for line in aligned(rows, left=(0, 3, 4)))


def _curve_text(q: Measured) -> str:
    c = q.compensation
    if c is None:
        return ""
    lag = "" if c.lag is None else f", lag {c.lag.tau_s:.0f} s"
    return f"degree {c.degree}, {c.low_c:g} to {c.high_c:g} °C{lag}"
