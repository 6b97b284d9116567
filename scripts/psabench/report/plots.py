"""The report's pictures as SVG text. Every colour is a CSS variable of the page, so light and dark both work."""

from __future__ import annotations

import io
import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import matplotlib

matplotlib.use("Agg")

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from psabench.estimate import harmonics
from psabench.estimate.uncertainty import Estimate
from psabench.procedures.result import FaceSeries
from psabench.report.grading import Section, sensor_of
from psabench.report.nominal import Nominal
from psabench.report.picture_texts import localise_texts

# Stand-ins that matplotlib can draw with -> what the page defines. Series colours keep their contrast on both grounds.
INK, MUTED, _GRID = "#010203", "#010204", "#010205"
SERIES = ("#010211", "#010212", "#010213", "#010214")
_CSS = {
    INK: "var(--ink)",
    MUTED: "var(--muted)",
    _GRID: "var(--grid)",
    **{c: f"var(--s{i + 1})" for i, c in enumerate(SERIES)},
}
WIDTH = 7.4  # inch
# For a picture that is alone, in the docs.
LIGHT = {
    "var(--ink)": "#1d2733",
    "var(--muted)": "#5b6875",
    "var(--grid)": "#dfe4ea",
    "var(--s1)": "#1f6fb4",
    "var(--s2)": "#c4572b",
    "var(--s3)": "#2f8f5b",
    "var(--s4)": "#8a5cc2",
}
STYLE: dict[Any, Any] = {
    "svg.fonttype": "none",
    "font.family": "sans-serif",
    "font.size": 9.5,
    "text.color": INK,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlesize": 10,
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": _GRID,
    "grid.linewidth": 0.7,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "legend.frameon": False,
    "axes.unicode_minus": True,
}


@contextmanager
def drawing(height: float, *grid: int, **how: Any) -> Iterator[tuple[Figure, Any]]:
    """A picture of the page's width in its style, inch high, and its axes; grid, how: as `Figure.subplots` takes them.

    What is drawn while the block runs has the style.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(WIDTH, height), layout="constrained")
        yield figure, figure.subplots(*grid, **how)


def svg(figure: Figure, name: str) -> str:
    """Inline SVG in CSS variables; `name` keeps the ids of several pictures apart. Same input, same bytes."""
    out = io.StringIO()
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": name}):
        localise_texts(figure)
        figure.draw_without_rendering()  # the layout may change the ticks, and their labels the layout
        figure.savefig(out, format="svg", transparent=True, metadata={"Date": None, "Creator": None})
    text = out.getvalue()
    text = text[text.index("<svg") :]
    for colour, variable in _CSS.items():
        text = text.replace(colour, variable)
    return text.replace('id="', f'id="{name}-').replace("url(#", f"url(#{name}-").replace('href="#', f'href="#{name}-')


def standalone(text: str) -> str:
    """The same picture as a file of its own, on white."""
    for variable, colour in LIGHT.items():
        text = text.replace(variable, colour)
    start = text.index(">", text.index("<svg")) + 1
    return text[:start] + '<rect width="100%" height="100%" fill="#ffffff"/>' + text[start:] + "\n"


def turn_figure(section: Section) -> Figure:
    """Readings against angle with their fit, and below them the residual."""
    with drawing(4.9, 2, 1, sharex=True, height_ratios=[3, 2]) as (figure, (top, bottom)):
        unit, scale = _unit(max(float(np.abs(s.residual_v).max(initial=0.0)) for s in section.result.series))
        for colour, s in zip(SERIES, section.result.series, strict=False):
            _draw_turn(top, s, colour)
            bottom.plot(s.alpha_deg, s.residual_v * scale, ".", ms=2.6, color=colour, alpha=0.75)
        top.set_ylabel("output, V")
        top.legend(loc="upper center", ncols=4, bbox_to_anchor=(0.5, 1.16), handletextpad=0.3)
        bottom.set_ylabel(f"residual, {unit}")
        bottom.set_xlabel("head angle, deg")
        bottom.set_xticks(range(0, 406, 45))
        return figure


def _draw_turn(ax: Axes, s: FaceSeries, colour: str) -> None:
    first = s.realisation == s.realisation.min()
    label = s.face.value.replace("_", " ")
    ax.plot(s.alpha_deg[first], s.u_v[first], "o", ms=2.8, color=colour, label=label)
    if s.c_v is not None:
        alpha_deg = np.linspace(float(s.alpha_deg.min()), float(s.alpha_deg.max()), 400)
        ax.plot(alpha_deg, harmonics.evaluate(s.c_v, np.radians(alpha_deg)), lw=1.0, color=colour)


def _unit(largest_v: float) -> tuple[str, float]:
    for unit, scale in (("mV", 1e3), ("µV", 1e6)):
        if largest_v * scale >= 1.0:
            return unit, scale
    return "nV", 1e9


def second_harmonic_figure(section: Section) -> Figure:
    """What is left of the direct face without zero and first harmonic: C3, and C4 on which alpha0 hangs."""
    s = section.result.series[0]
    assert s.c_v is not None
    c = s.c_v
    with drawing(2.9) as (figure, ax):
        set_deg = np.round(s.alpha_deg)
        at = np.unique(set_deg)
        first = harmonics.evaluate(np.array([c[0], c[1], c[2], 0.0, 0.0]), np.radians(s.alpha_deg))
        left_v = np.array([(s.u_v - first)[set_deg == a].mean() for a in at])
        fine = np.linspace(0, 395, 400)
        ax.plot(at, left_v * 1e3, "o", ms=3, color=SERIES[0], label="mean of realisations")
        ax.plot(fine, c[3] * np.sin(np.radians(2 * fine)) * 1e3, lw=1.2, color=SERIES[0], label="$C_3$ sin 2α")
        ax.plot(fine, c[4] * np.cos(np.radians(2 * fine)) * 1e3, lw=1.6, color=SERIES[1], label="$C_4$ cos 2α")
        ax.set_ylabel("second harmonic, mV")
        ax.set_xlabel("head angle, deg")
        ax.set_xticks(range(0, 406, 45))
        ax.legend(loc="upper center", ncols=3, bbox_to_anchor=(0.5, 1.2), handletextpad=0.4)
        return figure


def _alpha0_centre(rows: Sequence[tuple[Section, Estimate]], nominal: Nominal | None) -> tuple[float, str]:
    """Where the near picture is, deg, and what is there; "": an estimate, and nothing to compare it with."""
    truth = next((s.truth for s, _ in rows if s.truth is not None), None)
    if truth is not None:
        return math.degrees(sensor_of(truth).alpha0_rad), "the truth"
    said_deg = nominal.number("alpha0_deg") if nominal else None
    if said_deg is not None:
        return said_deg, "the nominal value"
    return min((e for _, e in rows), key=lambda e: e.ci_half).value, ""


def alpha0_figure(sections: Sequence[Section], nominal: Nominal | None) -> Figure | None:
    """95 % intervals of alpha0, all of them and near the truth, the nominal value, or the narrowest of them; None when
    no section has an alpha0.
    """
    rows = [(s, e) for s in sections for e in s.result.estimates if e.name == "alpha0_deg"]
    if not rows:
        return None
    centre_deg, words = _alpha0_centre(rows, nominal)
    with drawing(0.95 + 0.42 * len(rows), 1, 2, sharey=True) as (figure, axes):
        for ax in axes:
            for i, (_, e) in enumerate(rows):
                colour = SERIES[2] if e.identifiable else SERIES[1]
                ax.errorbar(e.value, -i, xerr=e.ci_half, fmt="o", ms=4, color=colour, capsize=3, lw=1.4)
            if words:
                ax.axvline(centre_deg, color=MUTED, lw=1.0, ls="--")
            ax.set_ylim(-len(rows) + 0.4, 0.6)
            ax.set_xlabel("α₀, deg")
            ax.grid(axis="y", visible=False)
        axes[0].set_yticks([-i for i in range(len(rows))], [s.title for s, _ in rows])
        axes[0].tick_params(axis="y", length=0, labelcolor=INK)
        axes[0].set_title("whole interval")
        axes[1].tick_params(axis="y", length=0)
        axes[1].set_title(f"near {words or 'the narrowest'}")
        axes[1].set_xlim(centre_deg - 0.02, centre_deg + 0.02)
        return figure
