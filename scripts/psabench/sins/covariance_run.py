"""`psabench run sins-covariance`: what a plan of rotations would determine, beside the article's tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected
from psabench.native.nav import ARCMIN, Refused
from psabench.native.sins import DEG, Gauge, SinsConfig
from psabench.procedures.result import option
from psabench.report.grading import aligned
from psabench.report.page import bullets, section, table, whole_page, write_report
from psabench.sins.covariance import (
    PRINTED,
    QUANTITIES,
    READINGS,
    Prediction,
    Quantity,
    Reading,
    predict_accuracy,
    read_as,
    warnings_of,
)
from psabench.sins.plan import RotationPlan, read_plan

NAME = "sins-covariance"
FORMAT = 1  # of result.json
GAUGES: Mapping[str, Gauge] = {"article": Gauge.ARTICLE, "lower": Gauge.LOWER, "free9": Gauge.FREE9}
NOTES = (
    "A: noise as printed, standard deviations of 1 s means. B: accelerometer noise times four, which the printed Γii, "
    "Δf and ν follow from. S1: 15″ at 1 Hz. S50: 15″ a sample at 50 Hz.",
    "Cells: root mean square over the elements of the quantity, in brackets the least and the most.",
    "The article does not give the azimuth of the table's axis, the time of the turns between cycles, the prior of the "
    "attitude and the unit of the prior of δ: 0°, 9 s, 1° (heading 3°) and 1° are ours (E0).",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class CovarianceParams:
    """Parameters of `sins-covariance`; the defaults are the article's demonstration."""

    plan: str = option("article", "", "plan of rotations: article, two_rates or a YAML file")
    azimuth_deg: float | None = option(None, "deg", "azimuth of the table's axis from north (the plan's)")
    latitude_deg: float = option(55.7, "deg", "latitude of the table")
    heading_sd_deg: float = option(3.0, "deg", "error of the heading at the start")
    gauge: str = option("article", "", f"elements of Γ that are estimated: {', '.join(GAUGES)}")
    lever: int = option(0, "", "lever arms of the accelerometers: 0 none, 3 along the own axis, 9 all")
    base: bool = option(False, "", "the table's base is turned by an unknown angle of 1'")


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """All readings of one plan."""

    params: CovarianceParams
    plan: RotationPlan
    found: Mapping[str, Prediction]  # by reading
    warnings: tuple[str, ...]


def run_study(p: CovarianceParams) -> Study:
    """Every reading of the noise. Raises BadInput."""
    if p.gauge not in GAUGES:
        raise BadInput(expected(", ".join(GAUGES), p.gauge, "--gauge"))
    plan = read_plan(p.plan)
    if p.azimuth_deg is not None:
        plan = plan.with_azimuth(p.azimuth_deg)
    cfg = SinsConfig(
        latitude_rad=p.latitude_deg * DEG,
        beta_sd_rad=(DEG, DEG, p.heading_sd_deg * DEG),
        gauge=GAUGES[p.gauge],
        lever=p.lever,
    )
    cfgs = {r.name: replace(read_as(r, cfg), base=p.base and r.stand) for r in READINGS.values()}
    try:
        found = {name: predict_accuracy(plan, c) for name, c in cfgs.items()}
    except Refused as e:
        raise BadInput(f"{NAME}: {e}") from e
    said = [w for name, c in cfgs.items() for w in warnings_of(plan, c, found[name])]
    return Study(params=p, plan=plan, found=found, warnings=tuple(dict.fromkeys(said)))


# ---- what is shown


def _mean_cell(q: Quantity, found: Prediction) -> str:
    return f"{found.columns[q.key].rms:.3g}"


def _range_cell(q: Quantity, found: Prediction) -> str:
    c = found.columns[q.key]
    return f"{c.rms:.3g} ({c.low:.3g}-{c.high:.3g})"


def _heading_of(q: Quantity) -> str:
    return f"{q.label}, {q.unit}" if q.unit else q.label


def table_rows(study: Study, stand: bool, cell: Callable[[Quantity, Prediction], str]) -> list[list[str]]:
    """Table 1 or 2 of the article: as printed, then each reading."""
    rows = [["", *map(_heading_of, QUANTITIES)]]
    rows.append(["article", *(f"{PRINTED[stand][q.key]:.3g}" for q in QUANTITIES)])
    for r in _readings_of(stand):
        rows.append([r.name, *(cell(q, study.found[r.name]) for q in QUANTITIES)])
    return rows


def _readings_of(stand: bool) -> Sequence[Reading]:
    return [r for r in READINGS.values() if r.stand == stand]


TITLES = {False: "Table 1: without the table's angles", True: "Table 2: with them"}


def console_lines(study: Study) -> str:
    """Both tables and the warnings."""
    lines = [
        line for angles in (False, True) for line in (TITLES[angles], *aligned(table_rows(study, angles, _mean_cell)))
    ]
    return "\n".join([*lines, *(f"WARNING: {w}" for w in study.warnings)])


def result_dict(study: Study) -> dict[str, Any]:
    """result.json: SI where the key names no unit."""
    readings = {
        name: {
            "columns": {key: asdict(c) for key, c in found.columns.items()},
            "sd": {block: sd.tolist() for block, sd in found.sd.items()},
        }
        for name, found in study.found.items()
    }
    return {
        "format": FORMAT,
        "procedure": NAME,
        "params": asdict(study.params),
        "plan": {
            "name": study.plan.name,
            "axis_azimuth_deg": study.plan.axis_azimuth_deg,
            "duration_s": study.plan.duration_s,
        },
        "printed": {"table_1": PRINTED[False], "table_2": PRINTED[True]},
        "readings": readings,
        "warnings": list(study.warnings),
    }


def write_page(out: Path, study: Study) -> Path:
    """report.html and result.json; the page. Raises OSError, OutputError."""
    facts = {
        "plan": study.plan.name,
        "axis": f"{study.plan.axis_azimuth_deg:g}° from north",
        "duration": f"{study.plan.duration_s:.0f} s",
        "gauge": study.params.gauge,
    }
    own = [[name, *_own_errors(found)] for name, found in study.found.items() if "delta" in found.sd]
    sections = [
        section("Before the run", bullets(study.warnings) or "<p>No warnings.</p>"),
        *(section(title, table(table_rows(study, angles, _range_cell))) for angles, title in TITLES.items()),
        section("The table's own errors", table([["", "δ, ′", "τ, µs"], *own])),
        section("How to read the tables", bullets(NOTES)),
    ]
    page = whole_page("Calibration of a strapdown unit: predicted accuracy", facts, sections)
    return write_report(out, result_dict(study), page)


def _own_errors(found: Prediction) -> list[str]:
    return [f"{found.sd['delta'].max() / ARCMIN:.3f}", f"{found.sd['tau'][0] * 1e6:.1f}"]
