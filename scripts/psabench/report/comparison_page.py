"""report.html of a comparison of converters, and its pictures."""

from __future__ import annotations

from html import escape
from pathlib import Path

import numpy as np

from psabench.procedures import comparison
from psabench.procedures.comparison import AXES, Comparison
from psabench.report import plots
from psabench.report.page import bullets, figure, section, table, verdict_line, whole_page, write_report

TITLE = "Five generations of converters, one motion"


def write(folder: Path, c: Comparison) -> Path:
    """result.json and report.html into `folder`, each whole or not at all; returns the page. Raises as write_report."""
    return write_report(folder, comparison.result_dict(c), html_page(c))


def html_page(c: Comparison) -> str:
    """The whole page. Same input, same bytes."""
    pictures = zip(_HEADINGS, figures(c), _CAPTIONS, strict=True)
    body = [
        verdict_line(comparison.verdict(c), c.within),
        section("Beside the article", table(comparison.figures_table(c), 2), f"<p class=small>{_ABOUT_FIGURES}</p>"),
        section(
            "Beside the exact integral", table(comparison.errors_table(c), 2), f"<p class=small>{_ABOUT_ERRORS}</p>"
        ),
        *(section(heading, figure(picture, caption)) for heading, picture, caption in pictures),
        _method(c),
    ]
    return whole_page(TITLE, c.facts, body)


_HEADINGS = ("Resolution, noise, error", "Velocity error", "The motion")
_CAPTIONS = (
    "Of each generation: the quantum of its unit, in a ring where the article prints one; the scatter of the velocity "
    "about a line at rest, the largest error while the table moved, the error at the end of the run.",
    "Velocity of each axis less the exact integral, on a scale of its own; the delay of the readings is taken out.",
    "What the accelerometers felt, from the truth log.",
)


_ABOUT_FIGURES = (
    "printed: quantum as the article has it. step seen: smallest difference between two increments on the wire, where "
    "they lie on a grid. noise at rest: about a straight line. drift at rest: slope of that line, the worse of the "
    "level axes, beyond what they felt; as a zero: the same in µg. largest in motion: of any axis, the drift taken off."
)
_ABOUT_ERRORS = (
    "printed: error of the coefficient as the article has it. end: from the first reading to the last, at rest in the "
    "same attitude. U: expanded uncertainty (k = 2) of the coefficient times what the axis felt, of the zero, and of "
    "rounding and noise at both ends."
)


def _method(c: Comparison) -> str:
    rows = [
        f"<b>{escape(g.figures.track.title)}</b>: {escape(g.article.printed)}; {escape(g.figures.track.note)}; "
        f"{g.figures.track.ma_v_per_g:.4g} V/g; its readings are {g.lag_s * 1e3:.2f} ms behind; "
        f"standard uncertainties: {np.hypot(g.article.gain_u, g.figures.track.gain_u) * 1e6:.3g} ppm "
        f"({g.article.k_source}) and {np.hypot(g.article.zero_u_v, g.figures.track.zero_u_v) * 1e6:.3g} µV of zero "
        f"({g.article.zero_source})"
        f"{f'; {escape(g.article.why)}' if g.article.why else ''}"
        for g in c.graded
    ]
    return section("How", bullets(rows), kind="method")


def figures(c: Comparison) -> tuple[str, str, str]:
    """Inline SVG: dots, errors, motion."""
    return _dots(c), _errors(c), _motion(c)


def _dots(c: Comparison) -> str:
    with plots.drawing(0.9 + 0.36 * len(c.graded)) as (picture, ax):
        for i, g in enumerate(c.graded):
            values = (
                ("quantum", "o", plots.SERIES[0], g.figures.track.quantum_mps(c.g_mps2)),
                ("noise at rest", "s", plots.SERIES[2], float(g.figures.noise_mps.max())),
                ("largest error in motion", "^", plots.SERIES[3], g.swing_mps),
                ("error at the end", "D", plots.SERIES[1], float(np.abs(g.end_mps).max())),
            )
            for label, marker, colour, value in values:
                if value:
                    ax.plot(value, -i, marker, color=colour, ms=5, label=label if i == 0 else None, ls="none")
            if g.article.pulse_mps:  # a ring: the quantum lies in it
                ring = ax.plot(g.article.pulse_mps, -i, "o", color=plots.INK, ls="none", ms=10, mfc="none", mew=1.0)
                ring[0].set_label("printed velocity resolution" if i == 0 else "_")
        ax.set_xscale("log")
        ax.set_xlabel("velocity, m/s")
        ax.set_yticks([-i for i in range(len(c.graded))], [g.figures.track.title for g in c.graded])
        ax.set_ylim(-len(c.graded) + 0.4, 0.6)
        ax.legend(loc="upper center", ncols=5, bbox_to_anchor=(0.45, 1.2), handletextpad=0.1, columnspacing=1.0)
        return plots.svg(picture, "dots")


def _errors(c: Comparison) -> str:
    with plots.drawing(1.25 * len(c.graded), len(c.graded), 1, sharex=True) as (picture, rows):
        for ax, g in zip(np.atleast_1d(rows), c.graded, strict=True):
            t_s = g.figures.track.t_s
            every = max(1, len(t_s) // 1400)
            scale, unit = _unit(float(np.abs(g.error_mps).max(initial=0.0)))
            for i, colour in enumerate(plots.SERIES[:3]):
                ax.plot(t_s[::every], g.error_mps[::every, i] * scale, lw=0.8, color=colour, label=AXES[i])
            ax.set_ylabel(unit)
            ax.set_title(g.figures.track.title)
        np.atleast_1d(rows)[0].legend(loc="upper right", ncols=3, bbox_to_anchor=(1.0, 1.35))
        np.atleast_1d(rows)[-1].set_xlabel("time, s")
        return plots.svg(picture, "errors")


def _motion(c: Comparison) -> str:
    m = c.motion
    span = (m.t_s >= c.graded[0].figures.track.t_s[0]) & (m.t_s <= c.graded[0].figures.track.t_s[-1])
    with plots.drawing(3.2, 2, 1, sharex=True) as (picture, (top, bottom)):
        for i, colour in enumerate(plots.SERIES[:3]):
            top.plot(m.t_s[span][::5], m.a_mps2[span][::5, i], lw=1.0, color=colour, label=AXES[i])
            bottom.plot(m.t_s[span][::5], (m.v_mps[span] - m.v_mps[span][0])[::5, i], lw=1.0, color=colour)
        top.set_ylabel("acceleration, m/s²")
        bottom.set_ylabel("integral, m/s")
        bottom.set_xlabel("time, s")
        top.legend(loc="upper right", ncols=3, bbox_to_anchor=(1.0, 1.25))
        return plots.svg(picture, "motion")


def _unit(largest_mps: float) -> tuple[float, str]:
    for scale, unit in ((1.0, "m/s"), (1e3, "mm/s"), (1e6, "µm/s")):
        if largest_mps * scale >= 0.3:
            return scale, unit
    return 1e9, "nm/s"
