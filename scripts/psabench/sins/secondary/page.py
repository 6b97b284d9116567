"""report.html and result.json of a calibration from secondary outputs, and what the console shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from psabench.native.nav import ARCMIN, DEGPH, Floats
from psabench.report import plots as style
from psabench.report.grading import aligned
from psabench.report.page import bullets, figure, section, verdict_line, whole_page, write_report
from psabench.report.page import table as html_table
from psabench.sins.correction import correction_dict
from psabench.sins.covariance import GAMMA_AT
from psabench.sins.secondary.estimate import Compensated, Errors, Secondary
from psabench.sins.secondary.run import SecondaryResult

FORMAT = 1  # of result.json
TITLE = "Strapdown unit calibrated from its own navigation"
ARCSEC = ARCMIN / 60.0
PPM = 1e-6
NOTES = (
    "Apply: w = (I + Θ)⁻¹ (w′ − ν), f = (I + Γ)⁻¹ (f′ − Δf); errors are measured less true, Γ in the article's gauge. "
    "psabench nav apply does it with result.json.",
    "How much smaller the errors become is set by what changes in the unit between two experiments, not by the filter.",
    "Only differences of the accelerometers' scales are seen: the common one needs a vertical channel.",
    "The unit's attitudes and rates are coefficients; the table's angles are not used.",
)


def estimate_rows(found: Secondary) -> list[tuple[str, float, float, str]]:
    """Name, value, standard deviation, unit of every constant."""
    rows: list[tuple[str, float, float, str]] = []
    for name, scale, unit in _constant_rows(found):
        k = found.rows["nu"].start + len(rows)
        rows.append((name, float(found.x[k] / scale), float(np.sqrt(found.covariance[k, k]) / scale), unit))
    return rows


def _constant_rows(found: Secondary) -> Iterator[tuple[str, float, str]]:
    """Name, unit in SI and its name, in the order of the state."""
    for i in range(3):
        yield f"ν{i + 1}", DEGPH, "°/h"
    for k in range(9):
        yield _element_row("Θ", k)
    for i in range(3):
        yield f"Δf{i + 1}", 1.0, "m/s²"
    for k in GAMMA_AT[found.config.gauge]:
        yield _element_row("Γ", k)


def _element_row(name: str, k: int) -> tuple[str, float, str]:
    i, j = divmod(k, 3)
    return (f"{name}{i + 1}{j + 1}", PPM, "ppm") if i == j else (f"{name}{i + 1}{j + 1}", ARCSEC, "″")


def estimate_table(found: Secondary) -> list[list[str]]:
    """A row a constant."""
    rows = [[name, f"{value:.4g}", f"{sd:.2g}", unit] for name, value, sd, unit in estimate_rows(found)]
    return [["", "value", "sd", "unit"], *rows]


def error_table(r: SecondaryResult) -> list[list[str]]:
    """Largest errors of both runs."""
    rows = [["calibrates", *_largest_km(r.found.errors)]]
    if r.compensated is not None:
        rows.append(["compensated, before", *_largest_km(r.compensated.before)])
        rows.append(["compensated, after", *_largest_km(r.compensated.after)])
    return [["run", "latitude, km", "longitude, km", "radial, km"], *rows]


def _largest_km(e: Errors) -> list[str]:
    east, north = np.abs(e.place_m).max(axis=0) / 1000.0
    return [f"{north:.2f}", f"{east:.2f}", f"{e.radial_m / 1000.0:.2f}"]


def console_lines(r: SecondaryResult) -> Iterator[str]:
    """Estimates and errors."""
    yield from aligned(estimate_table(r.found))
    yield ""
    yield from aligned(error_table(r))
    yield from (f"warning: {w}" for w in r.found.warnings)


def verdict_words(r: SecondaryResult) -> str:
    """One line."""
    c = r.compensated
    if c is None:
        most = r.found.errors.radial_m / 1000.0
        return f"errors up to {most:.1f} km explained by the sensors; no second run to compensate"
    left = f"{c.before.radial_m / 1000.0:.1f} km became {c.after.radial_m / 1000.0:.1f} km, {c.factor:.1f} times less"
    return f"{left}: {'at least' if r.within else 'NOT'} {r.least_factor:g} times"


def draw_fig1(c: Compensated) -> str:
    """Fig. 1: errors of latitude and longitude before and after the compensation."""
    t_min = c.before.t_s / 60.0
    with style.drawing(3.4) as (fig, ax):
        for errors, dashes, name in ((c.before, "-", "bins"), (c.after, "--", "res")):
            for axis, word, colour in ((1, "Lat", style.SERIES[0]), (0, "Long", style.SERIES[1])):
                ax.plot(t_min, errors.place_m[:, axis] / 1000.0, dashes, color=colour, lw=1.4, label=f"d{word}_{name}")
        ax.set_xlabel("time of navigation, min")
        ax.set_ylabel("error of place, km")
        ax.legend(loc="lower left", ncols=4, bbox_to_anchor=(0.0, 1.0))
        return style.svg(fig, "sins-fig1")


def draw_left(c: Compensated) -> str:
    """What is left beside what the estimates' covariance allows if no sensor has changed."""
    t_min = c.after.t_s / 60.0
    with style.drawing(2.8) as (fig, ax):
        ax.plot(t_min, np.hypot(*c.after.place_m.T) / 1000.0, color=style.SERIES[0], lw=1.4, label="left")
        sd: Floats = np.hypot(*c.predicted_sd_m.T) / 1000.0
        ax.plot(t_min, sd, color=style.MUTED, lw=1.2, ls=":", label="sd of the estimates alone")
        ax.set_xlabel("time of navigation, min")
        ax.set_ylabel("radial error, km")
        ax.legend(loc="upper left")
        return style.svg(fig, "sins-left")


def result_dict(r: SecondaryResult) -> dict[str, Any]:
    """For result.json."""
    names = [name for name, *_ in estimate_rows(r.found)]
    constants = slice(r.found.rows["nu"].start, len(r.found.x))
    p = r.found.covariance[constants, constants]
    sd = np.sqrt(np.diag(p))
    return {
        "format": FORMAT,
        "within_limits": r.within,
        "point": {n: getattr(r.found.point, n) for n in ("lat_rad", "lon_rad", "h_m")},
        "nis": r.found.nis,
        "warnings": list(r.found.warnings),
        "estimates": [dict(zip(("name", "value", "sd", "unit"), row, strict=True)) for row in estimate_rows(r.found)],
        "correlations": {"names": names, "rows": (p / np.outer(sd, sd)).tolist()},
        "correction": correction_dict(r.found.correction()),
        "errors": _row_dicts(error_table(r)),
        "factor": None if r.compensated is None else r.compensated.factor,
    }


def _row_dicts(table: Sequence[Sequence[str]]) -> list[dict[str, str]]:
    head, *rows = table
    return [dict(zip(head, row, strict=True)) for row in rows]


def write_page(folder: Path, r: SecondaryResult) -> Path:
    """result.json and report.html into `folder`; returns the page. Raises as write_report."""
    return write_report(folder, result_dict(r), html_page(r))


def html_page(r: SecondaryResult, *more: str) -> str:
    """The whole page, with more sections. Same input, same bytes."""
    c = r.compensated
    pictures = () if c is None else (figure(draw_fig1(c), "As fig. 1 of the article."), figure(draw_left(c)))
    facts = {
        "calibrates": r.first,
        "compensated": r.second or "none",
        "mean square of innovations": f"{r.found.nis:.2f}",
    }
    body = [
        verdict_line(verdict_words(r), r.within),
        section("Errors of place", html_table(error_table(r)), *pictures),
        *more,
        section("Errors of the sensors", html_table(estimate_table(r.found))),
        section("How to read it", bullets([*NOTES, *r.found.warnings])),
    ]
    return whole_page(TITLE, facts, body)
