"""Pictures of a fleet. Curves in the colours of the report's style; the same input gives the same bytes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from psabench.koi.fleet.figures import Rows, error_curves, largest_errors, rms_curves
from psabench.koi.fleet.grade import MINUTES
from psabench.koi.fleet.linear import Predicted
from psabench.koi.fleet.season import MODES
from psabench.koi.geodesy import MILE_M
from psabench.link.signals import Floats
from psabench.report import plots as style

KM = 1e-3
SWITCHED_ON = 6  # flights before the algorithms were: the article's fig. 1
AXES = ("latitude", "longitude")
SHOWN_UNITS = 3  # of figs 2 to 5


def draw_first(rows: Rows, name: str) -> str:
    """As fig. 1: largest error by number of the flight, for three units; the first six flights with neither."""
    with style.drawing(2.9, 1, SHOWN_UNITS, sharey=True) as (figure, axes):
        for unit, ax in enumerate(axes):
            if unit >= len(rows["none"]):
                ax.set_axis_off()
                continue
            before = largest_errors(rows["none"])[unit, :SWITCHED_ON]
            values = KM * np.vstack([before, largest_errors(rows["both"])[unit]])
            at = np.arange(1, len(values) + 1)
            for axis, (label, mark) in enumerate(zip(AXES, ("o-", "s--"), strict=True)):
                ax.plot(at, values[:, axis], mark, ms=4, lw=1.2, color=style.SERIES[axis], label=label)
            ax.axvline(len(before) + 0.5, color=style.INK, lw=0.9, ls=":")
            ax.axhline(KM * MILE_M, color=style.MUTED, lw=0.9, ls="--")
            ax.set_ylim(0.0)
            ax.set_title(f"unit {unit + 1}")
            ax.set_xlabel("flight")
        axes[0].set_ylabel("largest error in an hour, km")
        axes[0].legend(loc="upper right")
        return style.svg(figure, f"koi-first-{name}")


def draw_curves(rows: Rows, name: str) -> str:
    """As figs 2 to 5: errors of a series of flights, with neither above and with both below."""
    minutes = np.arange(MINUTES + 1)
    with style.drawing(5.0, 2, 2, sharex=True, sharey=True) as (figure, axes):
        for row, (mode, when) in enumerate((("none", "before"), ("both", "after"))):
            lines = KM * error_curves(rows[mode])[:SHOWN_UNITS]
            for axis, label in enumerate(AXES):
                ax = axes[row, axis]
                for unit, colour in zip(lines, style.SERIES, strict=False):
                    ax.plot(minutes, unit[:, axis].T, lw=0.9, color=colour, alpha=0.85)
                for sign in (-1.0, 1.0):
                    ax.plot(minutes, sign * KM * MILE_M * minutes / 60.0, color=style.INK, lw=1.1, ls="--")
                ax.set_title(f"{label}, {when}")
        for ax in axes[1]:
            ax.set_xlabel("minutes from take-off")
        for ax in axes[:, 0]:
            ax.set_ylabel("error, km")
        return style.svg(figure, f"koi-curves-{name}")


def draw_distributions(found: Mapping[str, Rows]) -> str:
    """Share of flights whose larger error is below, all flights."""
    with style.drawing(3.0, 1, len(found)) as (figure, axes):
        for ax, (name, rows) in zip(np.atleast_1d(axes), found.items(), strict=True):
            for (mode, m), colour in zip(MODES.items(), style.SERIES, strict=True):
                worst = np.sort(largest_errors(rows[mode]).max(axis=-1).ravel()) * KM
                share = np.arange(1, len(worst) + 1) / len(worst)
                ax.step(worst, 100.0 * share, where="post", lw=1.3, color=colour, label=m.title)
            ax.axvline(KM * MILE_M, color=style.INK, lw=1.0, ls="--")
            ax.set_xlim(0.0)
            ax.set_title(name)
            ax.set_xlabel("larger error in the hour, km")
        np.atleast_1d(axes)[0].set_ylabel("flights, %")
        np.atleast_1d(axes)[-1].legend(loc="lower right")
        return style.svg(figure, "koi-distributions")


def draw_linear(found: Mapping[str, Rows], predicted: Predicted) -> str:
    """Root mean square error in an hour's course, by flight; dashed: from the covariance."""
    with style.drawing(3.0, 1, len(found)) as (figure, axes):
        for ax, (name, rows) in zip(np.atleast_1d(axes), found.items(), strict=True):
            for (mode, m), colour in zip(MODES.items(), style.SERIES, strict=True):
                _draw_by_flight(ax, rms_curves(rows[mode]), "o-", colour, m.title)
                if (name, mode) in predicted:
                    _draw_by_flight(ax, predicted[name, mode], "--", colour, None)
            ax.set_ylim(0.0)
            ax.set_title(name)
            ax.set_xlabel("flight")
        np.atleast_1d(axes)[0].set_ylabel("largest rms error in the hour, km")
        figure.legend(*np.atleast_1d(axes)[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
        return style.svg(figure, "koi-linear")


def _draw_by_flight(ax: Any, rms: Floats, mark: str, colour: str, label: str | None) -> None:
    """rms: (flights, minutes + 1, 2)."""
    values = KM * largest_rms(rms)
    ax.plot(np.arange(1, len(values) + 1), values, mark, ms=3.5, lw=1.2, color=colour, label=label)


def largest_rms(rms: Floats) -> Floats:
    """Of both axes together, the largest of the hour's, by flight."""
    return np.asarray(np.sqrt(np.mean(np.max(rms, axis=1) ** 2, axis=1)))
