"""Pictures of a run-in as SVG text in the colours of the page (`report.plots`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from psabench.quartz.limits import ARTICLE
from psabench.quartz.run_in_figures import SMALL, Figures
from psabench.report import plots as style

SHOWN_CYCLES = (2, 3, 4)  # of the article's fig. 8
BINS = 40


def draw_distributions(zero: Figures, tolerance_ug: float) -> str:
    """Fig. 8: instability of the zero signal after cycles 2, 3 and 4, a panel each, beside that after the first."""
    shown = [n for n in SHOWN_CYCLES if n <= zero.change.shape[1]]
    edges = np.linspace(0.0, float(np.quantile(zero.change[:, 0], 0.995)), BINS + 1)
    with style.drawing(2.8, 1, len(shown), sharey=True) as (figure, axes):
        for ax, n in zip(np.atleast_1d(axes), shown, strict=True):
            first, own = (100.0 * np.histogram(zero.change[:, k - 1], edges)[0] / len(zero.change) for k in (1, n))
            ax.stairs(first, edges, color=style.MUTED, lw=1.0, label="cycle 1")
            ax.stairs(own, edges, color=style.SERIES[0], lw=1.4, fill=True, alpha=0.6, label=f"cycle {n}")
            ax.axvline(tolerance_ug, color=style.SERIES[1], lw=1.0, ls="--")
            ax.set_title(f"after cycle {n}")
            ax.set_xlabel("Δ of the zero signal, µg")
        np.atleast_1d(axes)[0].set_ylabel("share of units, %")
        return style.svg(figure, "run-in-distributions")


def draw_means(found: Mapping[str, Figures]) -> str:
    """Mean instability by cycle with 95 % intervals, in percent of the first."""
    with style.drawing(3.0) as (figure, ax):
        for (q, f), colour in zip(found.items(), style.SERIES, strict=False):
            percent = 100.0 / f.means[0].value
            at = np.arange(1, len(f.means) + 1)
            value = [percent * m.value for m in f.means]
            half = [percent * m.half95 for m in f.means]
            ax.errorbar(at, value, half, fmt="o-", ms=4, lw=1.3, capsize=3, color=colour, label=q)
        ax.set_xticks(at)
        ax.set_ylim(0.0)
        ax.set_xlabel("thermal cycles")
        ax.set_ylabel("mean change from start to start, % of the first")
        ax.legend(loc="upper right")
        return style.svg(figure, "run-in-means")


def draw_small(found: Mapping[str, Figures]) -> str:
    """Gains of batches of SMALL units; dashed: what the article reports."""
    with style.drawing(2.8, 1, len(found)) as (figure, axes):
        for ax, (q, f), colour in zip(axes, found.items(), style.SERIES, strict=False):
            low, high = (float(x) for x in np.quantile(f.gains_of_small, (0.001, 0.999)))
            edges = np.linspace(low, high, BINS + 1)
            share = 100.0 * np.histogram(f.gains_of_small, edges)[0] / len(f.gains_of_small)
            ax.stairs(share, edges, color=colour, lw=1.2, fill=True, alpha=0.6)
            ax.axvline(ARTICLE[q][1], color=style.INK, lw=1.2, ls="--")
            ax.set_title(q)
            ax.set_xlabel(f"gain of {SMALL} units")
        axes[0].set_ylabel("share of batches, %")
        return style.svg(figure, "run-in-small")


def draw_all(found: Mapping[str, Figures], tolerance_ug: float) -> Mapping[str, str]:
    """All, by name."""
    zero = found["zero"]
    return {
        "distributions": draw_distributions(zero, tolerance_ug),
        "means": draw_means(found),
        "small": draw_small(found),
    }
