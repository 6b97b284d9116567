"""Pictures of a campaign as SVG text in the colours of the page (`report_plots`)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import NullLocator

from psabench.campaign.cases import Case, Study
from psabench.campaign.claims import CLAIM_DEG, HOLD_DEG, SEVERAL_HOURS_DEG, Figures, HoldFigures, Spread
from psabench.campaign.store import Rows
from psabench.report import plots as style

ROW = 0.3  # inch
BINS = 120


def distribution(rows: Mapping[str, Rows]) -> str:
    """Heading errors by name, as densities beside the claim; a curve leaves where 99 % of the widest lie."""
    errors = {name: r[np.isfinite(r[:, 1]), 1].astype(np.float64) for name, r in rows.items()}
    half = max(float(np.quantile(np.abs(e), 0.99)) for e in errors.values())
    edges = np.linspace(-half, half, BINS + 1)
    with style.drawing(3.2) as (figure, ax):
        ax.axvspan(-CLAIM_DEG, CLAIM_DEG, color=style.MUTED, alpha=0.14, lw=0)
        for (name, e), colour in zip(errors.items(), style.SERIES, strict=False):
            density = np.histogram(e, edges)[0] / (len(e) * (edges[1] - edges[0]))
            ax.stairs(density, edges, color=colour, lw=1.5, label=name)
        ax.set_ylim(0.0)
        ax.set_xlabel("heading error, deg; grey: the claimed ±0.1°")
        ax.set_ylabel("density, 1/deg")
        ax.legend(loc="upper right")
        return style.svg(figure, "distribution")


def scan(study: Study, cases: Sequence[Case], found: Mapping[str, Figures]) -> str:
    """Error against what the study varies, a line a curve."""
    curves: dict[str, list[tuple[float, float]]] = {}
    for case in cases:
        f = found[case.name].platform
        curves.setdefault(case.curve, []).append((case.x, f.rms if study.figure == "sd" else f.p95))
    with style.drawing(3.2) as (figure, ax):
        for (curve, points), colour in zip(curves.items(), style.SERIES, strict=False):
            x, y = zip(*points, strict=True)
            ax.plot(x, y, "o-", ms=3.5, lw=1.4, color=colour, label=curve)
        ax.axhline(CLAIM_DEG, color=style.MUTED, lw=1.0, ls="--")
        _scale(ax, study, sorted({x for points in curves.values() for x, _ in points}))
        ax.set_xlabel(study.axis)
        ax.set_ylabel(f"heading error, {'rms' if study.figure == 'sd' else 'p95'}, deg")
        ax.legend(loc="lower left", ncols=2, bbox_to_anchor=(0.0, 1.0))
        return style.svg(figure, study.name)


def _scale(ax: Axes, study: Study, x: Sequence[float]) -> None:
    if study.log_y:
        ax.set_yscale("log")
        _mark(ax.yaxis)
    else:
        ax.set_ylim(0.0)
    if x[-1] > 20 * x[0] > 0.0:
        ax.set_xscale("log")
        ax.xaxis.set_minor_locator(NullLocator())
    ax.set_xticks(x, [f"{v:g}" for v in x])


def _mark(axis: Axis) -> None:
    """1, 2, 5 of each decade of a logarithmic axis, and nothing between."""
    low, high = axis.get_view_interval()
    marks = [m for k in range(-4, 2) for m in (10.0**k, 2 * 10.0**k, 5 * 10.0**k) if low <= m <= high]
    axis.set_ticks(marks, [f"{m:g}" for m in marks])
    axis.set_minor_locator(NullLocator())


def bars(name: str, cases: Sequence[Case], found: Mapping[str, Figures]) -> str:
    """rms and p95 of each case, one under the other: heading of the readings, platform of the others."""
    heading = name == "readings"
    spreads = [found[c.name].heading if heading else found[c.name].platform for c in cases]
    labels = [c.name if heading else c.title for c in cases]
    what = "heading" if heading else "the platform"
    return _dots(name, labels, spreads, what, [CLAIM_DEG])


def held(cases: Sequence[Case], found: Mapping[str, HoldFigures]) -> str:
    """Heading after the hold."""
    spreads = [found[c.name].end for c in cases]
    return _dots("hold", [c.title for c in cases], spreads, "heading after the hold", [HOLD_DEG, SEVERAL_HOURS_DEG])


def _dots(name: str, labels: Sequence[str], spreads: Sequence[Spread], what: str, lines: Sequence[float]) -> str:
    values = {"rms": [s.rms for s in spreads], "p95": [s.p95 for s in spreads]}
    with style.drawing(0.9 + ROW * len(labels)) as (figure, ax):
        for at in lines:
            ax.axvline(at, color=style.MUTED, lw=1.0, ls="--")
        for (label, numbers), colour in zip(values.items(), style.SERIES, strict=False):
            # What is exactly zero has no place on a logarithmic scale, and needs none.
            there = [(v, -i) for i, v in enumerate(numbers) if v > 1e-7]
            ax.plot(*zip(*there, strict=True), "o", ms=5, color=colour, label=label, ls="none")
        ax.set_xscale("log")
        _mark(ax.xaxis)
        ax.set_yticks([-i for i in range(len(labels))], labels)
        ax.set_ylim(-len(labels) + 0.4, 0.6)
        ax.set_xlabel(f"error of {what}, deg; dashed: {' and '.join(f'{x:g}' for x in lines)}°")
        ax.legend(loc="lower left", ncols=2, bbox_to_anchor=(0.0, 1.0))
        return style.svg(figure, name)


def agreement(name: str, rows: Mapping[str, Rows]) -> str:
    """Distribution functions of the heading error of the same set-up, by chain."""
    with style.drawing(3.0) as (figure, ax):
        for (chain, r), colour in zip(rows.items(), style.SERIES, strict=False):
            errors = np.sort(r[np.isfinite(r[:, 1]), 1].astype(np.float64))
            level = np.arange(1, len(errors) + 1) / len(errors)
            thin = max(1, len(errors) // 2000)
            ax.plot(errors[::thin], level[::thin], drawstyle="steps-post", lw=1.4, color=colour, label=chain)
        ax.set_xlabel("heading error, deg")
        ax.set_ylabel("cumulative share of runs")
        ax.legend(loc="upper left")
        return style.svg(figure, name)
