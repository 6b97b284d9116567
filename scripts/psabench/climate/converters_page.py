"""report.html of converters compared in a chamber."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from psabench.climate import converters_result as result
from psabench.climate.converters_result import ChamberComparison
from psabench.report import plots
from psabench.report.page import figure, section, table, verdict_line, whole_page, write_report

TITLE = "Generations of converters in a chamber"
_ABOUT = (
    "Of the axis that drifts most: greatest drift from the first temperature; straight line through all temperatures. "
    "U: expanded uncertainty (k = 2) of noise, rounding and the unit's own calibrations. Sensors and gravity drop out."
)
_CAPTION = "Of the axis that drifts most; bars: U of a drift."


def write_page(folder: Path, c: ChamberComparison) -> Path:
    """result.json and report.html into `folder`; returns the page. Raises as write_report."""
    return write_report(folder, result.result_dict(c), html_page(c))


def html_page(c: ChamberComparison) -> str:
    """The whole page. Same input, same bytes."""
    body = [
        verdict_line(result.verdict_of_drifts(c), c.within),
        section("Drift with temperature", table(result.drift_table(c), 2), f"<p class=small>{_ABOUT}</p>"),
        section("At each temperature", table(result.course_table(c), 2), figure(_course_picture(c), _CAPTION)),
        section("What the drift is made of", table(result.sources_table(c), 1)),
    ]
    return whole_page(TITLE, c.facts, body)


def _course_picture(c: ChamberComparison) -> str:
    """Zero and scale of each generation against temperature."""
    degc = np.array([s.degc for s in c.soaks])
    order = np.argsort(degc)
    with plots.drawing(3.4, 1, 2) as (picture, (left, right)):
        for k, d in enumerate(c.drifts):
            for ax, line, scale in ((left, d.worst_zero, 1e6 / d.ma_v_per_g), (right, d.worst_scale, 1e6)):
                ax.errorbar(
                    degc[order],
                    line.drift[order] * scale,
                    yerr=line.drift_expanded_u * scale,
                    color=plots.SERIES[k % len(plots.SERIES)],
                    lw=0.9,
                    capsize=2,
                    label=d.title if ax is left else None,
                )
        left.set_ylabel("zero, µg")
        right.set_ylabel("scale, ppm")
        for ax in (left, right):
            ax.set_xlabel("temperature, °C")
        left.legend(loc="upper center", ncols=7, bbox_to_anchor=(1.1, 1.2), handletextpad=0.3, columnspacing=1.0)
        return plots.svg(picture, "chamber")
