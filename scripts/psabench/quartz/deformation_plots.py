"""Pictures of the deformation study as SVG text in the colours of the page (`report.plots`)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from psabench.quartz.batch import GROUPS
from psabench.quartz.deformation import CLAIM_PERCENT, CYCLES, DEGC, READINGS, SHOWN, Study
from psabench.report import plots as style

CURVES = 8  # units of each group that fig. 2 shows


def draw_gaps(s: Study) -> str:
    """Distribution functions of the gap's change, a line a reading, beside the article's 0.5 %."""
    with style.drawing(3.0) as (figure, ax):
        for reading, colour in zip(READINGS, style.SERIES, strict=True):
            percent = np.sort(s.deformation.gap_percent[reading])
            thin = max(1, len(percent) // 500)
            level = np.arange(1, len(percent) + 1) / len(percent)
            ax.plot(percent[::thin], level[::thin], color=colour, lw=1.4, label=reading)
        ax.axvline(CLAIM_PERCENT, color=style.MUTED, lw=1.0, ls="--")
        ax.set_xscale("log")
        ax.set_xticks(marks := [0.003, 0.01, 0.03, 0.1, 0.3, 1, 3, 10, 30, 100], [f"{m:g}" for m in marks])
        ax.minorticks_off()
        ax.set_xlabel("largest change of the gap, %; dashed: the article's 0.5 %")
        ax.set_ylabel("cumulative share of elements")
        ax.legend(loc="lower left", ncols=2, bbox_to_anchor=(0.0, 1.0))
        return style.svg(figure, "deformation-gaps")


def zero_signals(s: Study) -> str:
    """Fig. 2: zero signals of groups (a) and (b), and the part of the hinges at the same scale and magnified."""
    hinge_ug = s.deformation.zero_ug - s.deformation.zero_ug[:, [int(np.argmin(np.abs(DEGC - 30.0)))]]
    with style.drawing(3.4, 1, 3) as (figure, axes):
        for k, ax in enumerate(axes[:2]):
            for row in s.curve_ug[s.curves.group == k][:CURVES]:
                ax.plot(DEGC, row, color=style.SERIES[k], lw=1.0)
            ax.plot(DEGC, hinge_ug[:CURVES].T, color=style.INK, lw=1.0)
            ax.set_title(f"group ({GROUPS[k]}); black: hinges")
            ax.set_ylim(-800.0, 800.0)
        axes[2].plot(DEGC, hinge_ug[: 5 * CURVES].T, color=style.INK, lw=0.7)
        axes[2].set_title("hinges alone, from 30 °C")
        axes[0].set_ylabel("zero signal, µg")
        for ax in axes:
            ax.set_xticks([-60, -30, 0, 30, 60, 85])
            ax.set_xlabel("°C")
        return style.svg(figure, "deformation-zero")


def draw_batch(s: Study) -> str:
    """Fig. 5: units of the batch, change of the zero signal at the first cycle and after four, and the tolerance."""
    d, limit_ug = s.instability["zero"][:SHOWN], s.batch["zero_tolerance_ug"]
    at = np.arange(1, len(d) + 1)
    with style.drawing(3.0) as (figure, ax):
        ax.bar(at, d[:, 0], width=0.75, color=style.SERIES[0], label="before run-in")
        ax.plot(at, d[:, CYCLES - 1], "o", ms=4, color=style.SERIES[1], label="after four cycles")
        ax.axhline(limit_ug, color=style.MUTED, lw=1.2, ls="--")
        ax.set_xlim(0.0, len(d) + 1.0)
        ax.set_xlabel(f"unit; dashed: tolerance of {limit_ug:g} µg (E0)")
        ax.set_ylabel("change from start to start, µg")
        ax.legend(loc="lower left", ncols=2, bbox_to_anchor=(0.0, 1.0))
        return style.svg(figure, "deformation-batch")


def draw_all(s: Study) -> Mapping[str, str]:
    """All, by name."""
    return {"gaps": draw_gaps(s), "zero": zero_signals(s), "batch": draw_batch(s)}
