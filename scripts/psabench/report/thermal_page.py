"""report.html and result.json of a thermal run, and its pictures: figures 6 and 7 of the article."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from psabench.report import plots
from psabench.report import thermal_grading as grading
from psabench.report.page import bullets, figure, folded, section, table, verdict_line, whole_page, write_report
from psabench.report.thermal_grading import ThermalReport
from psabench.thermal.budget import symbol_of
from psabench.thermal.leftover import element_of
from psabench.thermal.result import Method, predicted_sweep

TITLE = "Accelerometers against temperature"
CAPTIONS = {
    "scale": "Scale factor by both methods (the article's figure 6), as its change from the value at the normal "
    "temperature. Points: soak. Lines: the legs of the sweep against the temperature of the case. Below: the same less "
    "the soak's curve; dashed, what that curve becomes with the lag that the sweep's fit has found.",
    "zero": "Zero signal by both methods (the article's figure 7), in the same way.",
    "residual": "What the fits of the zero signal leave on both legs, percent of the largest zero: without a lag, and "
    "with it.",
}
WHY = (
    "In the soak the element has the temperature of the case. During a sweep it runs after the case by rate times "
    "lag: the same zero is seen at a case that is warmer on the way up and colder on the way down. The curve is "
    "displaced by "
    "rate times lag times its slope, and the loop is twice that. A play in the element's temperature adds its own "
    "width, and the fit takes it for a longer lag."
)


def write_page(folder: Path, report: ThermalReport) -> Path:
    """Both files into `folder`, each whole or not at all; returns the page. Raises as write_report."""
    return write_report(folder, grading.result_dict(report), html_page(report))


def html_page(report: ThermalReport) -> str:
    """The whole page. Same input, same bytes."""
    body = [
        verdict_line(grading.state_verdict(report), grading.within_limits(report) if report.graded else None),
        *_compare_methods(report),
        section("Largest residuals", table(grading.residuals_table(report)), *_rate_parts(report)),
        *(_method_section(report, m, f"m{k}") for k, m in enumerate(report.result.methods)),
        _how_to_read(report),
    ]
    return whole_page(TITLE, report.facts, body)


def _compare_methods(report: ThermalReport) -> Iterator[str]:
    pictures = [
        figure(plots.svg(curve_figure(report, kind), kind), escape(CAPTIONS[kind])) for kind in ("scale", "zero")
    ]
    tables = [
        f"<h2>{escape(m.title)} less soak</h2>{table(grading.difference_table(report, m.name))}"
        for m in report.result.sweeps
        if m.name in report.differences
    ]
    why = [f"<p>{escape(WHY)}</p>"] if tables else []
    yield section("The two methods", *pictures, *tables, *why)


def _rate_parts(report: ThermalReport) -> Iterator[str]:
    if report.result.sweeps:
        yield f"<h2>Zero signals against the rate</h2>{table(grading.rates_table(report))}"
    warm_up = report.result.schedule.sweep and report.result.schedule.sweep.warm_up
    if warm_up:
        yield (
            f"<p>In service: {warm_up.mean_rate:.2f} K/min on average, {warm_up.most_rate:.2f} at most, by the warm-up "
            "of the schedule.</p>"
        )


def _method_section(report: ThermalReport, m: Method, ident: str) -> str:
    symbols = {q: symbol_of(q) for q in m.fits}
    graded = [table(grading.graded_table(report, m.name), symbols=symbols)] if report.graded else []
    parts = [f"<p class=facts>at {report.result.normal_c:.1f} °C of the element</p>"]
    parts.append(table(grading.estimates_table(report, m), symbols=symbols))
    parts += [f"<h2>Beside the truth</h2>{g}" for g in graded]
    parts.append(folded("Degrees of the zero of x", table(grading.degree_table(m, "zero_x_ug"))))
    parts.append(folded("Budget", table(_budget_table(report, m))))
    if any(f.both_legs for f in m.fits.values()):
        parts.append(figure(plots.svg(residual_figure(report, m), f"{ident}res"), escape(CAPTIONS["residual"])))
    return section(m.title, *parts)


def _budget_table(report: ThermalReport, m: Method) -> list[tuple[str, ...]]:
    """Standard uncertainties at the normal temperature, of the quantities of x."""
    rows: list[tuple[str, ...]] = [("", "component", "u", "unit")]
    for e in (e for e in report.result.estimates[m.name] if "_x" in e.name):
        rows += [(e.name, c.name, f"{c.u:.2g}", e.unit) for c in e.budget]
    return rows


def _how_to_read(report: ThermalReport) -> str:
    notes = [*grading.interpolation_lines(report), *report.result.notes]
    return section(
        "How to read this",
        "<p>U: expanded uncertainty, 95.45 %. E<sub>n</sub>: error/U. Percents of a zero signal are of its largest "
        "value, those of scale and base of the largest change. The temperature is that of the sensor in the case.</p>",
        bullets([escape(n) for n in notes]),
        kind="method",
    )


# ---- pictures


def curve_figure(report: ThermalReport, kind: str) -> Figure:
    """Zero or scale of the three axes against the temperature of the case, by all methods; below: less the soak."""
    words = ("zero signal, µg", "less soak, µg") if kind == "zero" else ("scale factor, ppm", "less soak, ppm")
    rows = 2 if report.differences else 1
    with plots.drawing(2.8 + 1.9 * (rows - 1), rows, 3, sharex=True, squeeze=False) as (picture, axes):
        for column, axis in zip(axes.T, "xyz", strict=True):
            name = f"zero_{axis}_ug" if kind == "zero" else f"scale_{axis}_v_per_g"
            _draw_curve(column[0], report, name)
            for ax in column[1:]:
                _draw_difference(ax, report, name)
            column[0].set_title(axis.upper())
            column[-1].set_xlabel("case, °C")
        for ax, text in zip(axes[:, 0], words, strict=False):
            ax.set_ylabel(text)
        handles, labels = axes[-1, 0].get_legend_handles_labels()
        soak, name = axes[0, 0].get_legend_handles_labels()
        shown = dict(zip([*name, *labels], [*soak, *handles], strict=True))
        picture.legend(shown.values(), shown.keys(), loc="outside upper center", ncols=4)
        return picture


def _shown_unit(report: ThermalReport, name: str) -> tuple[float, float]:
    """What is taken off, and the factor: a zero as it is, a scale as ppm from its value at the normal temperature."""
    if name.startswith("zero"):
        return 0.0, 1.0
    m = report.result.method("soak") or report.result.methods[0]
    base = float(m.fits[name].best.value_at(report.result.normal_c))
    return base, 1e6 / base


def _legs_of(m: Method) -> dict[str, np.ndarray]:
    return {"sweep, up": m.points.up, "sweep, down": ~m.points.up}


def _draw_curve(ax: Axes, report: ThermalReport, name: str) -> None:
    base, factor = _shown_unit(report, name)
    for m in report.result.sweeps:
        y = (m.points.quantity(name) - base) * factor
        for (label, leg), colour in zip(_legs_of(m).items(), (plots.SERIES[1], plots.SERIES[0]), strict=True):
            ax.plot(m.points.case_c[leg], y[leg], lw=1.1, color=colour, label=label)
    soak = report.result.method("soak")
    if soak is not None:
        y = (soak.points.quantity(name) - base) * factor
        ax.plot(soak.points.case_c, y, "o", ms=3.4, color=plots.SERIES[2], label="soak")


def _draw_difference(ax: Axes, report: ThermalReport, name: str) -> None:
    """Each leg less the soak's curve, and what the lag predicts of that."""
    soak = report.result.method("soak")
    assert soak is not None
    _, factor = _shown_unit(report, name)
    for m in report.result.sweeps:
        still = soak.fits[name].best.value_at(m.points.case_c)
        y = (m.points.quantity(name) - still) * factor
        predicted = (predicted_sweep(soak, m, name) - still) * factor
        for (label, leg), colour in zip(_legs_of(m).items(), (plots.SERIES[1], plots.SERIES[0]), strict=True):
            ax.plot(m.points.case_c[leg], y[leg], lw=1.1, color=colour, label=label)
        ax.plot(m.points.case_c, predicted, lw=0.9, ls="--", color=plots.MUTED, label="predicted by the lag")


def residual_figure(report: ThermalReport, m: Method) -> Figure:
    """What is left of the zero signals on both legs."""
    p = m.points
    with plots.drawing(3.0, 1, 3, sharex=True, sharey=True) as (picture, axes):
        for ax, axis in zip(axes, "xyz", strict=True):
            f, y = m.fits[f"zero_{axis}_ug"], p.quantity(f"zero_{axis}_ug")
            assert f.both_legs
            element = element_of(p, f.best)
            without = 100.0 * (y - f.both_legs.value_at(p.case_c)) / f.largest
            with_lag = 100.0 * (y - f.best.value_at(element, p.case_c - element)) / f.largest
            ax.plot(p.case_c, without, lw=1.0, color=plots.SERIES[1], label="both legs")
            ax.plot(p.case_c, with_lag, lw=1.0, color=plots.SERIES[0], label="with the lag")
            ax.set_xlabel("case, °C")
            ax.set_title(axis.upper())
        axes[0].set_ylabel("residual of the zero, %")
        picture.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        return picture
