"""report.html and result.json of the flight after a calibration, and what the console shows."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from psabench.report import plots as style
from psabench.report.grading import aligned
from psabench.report.page import bullets, figure, section, verdict_line, whole_page, write_report
from psabench.report.page import table as html_table
from psabench.sins.snake import ARTICLE_M, BOUND, PAIRS, SHOWN_S, Snake

FORMAT = 1  # of result.json
TITLE = "Autonomous navigation after a calibration on the table"
NOTES = (
    "The article names the flight and gives no figure of it: speed, turns and the unit's mounting are E0. Mounted in "
    "the other 23 ways the unit without the stand's angles is 1830 to 2040 m off, with them 1110 m.",
    "The alignment's errors come from the same sensors. Taken as independent of them they make the flight worse: the "
    "columns show both.",
    "In the reading as printed the stand's angles bring next to nothing. Only the fourfold noise of the accelerometers "
    "gives the 1.7.",
)


def outcome_table(s: Snake) -> list[list[str]]:
    """A row a reading."""
    head = ["reading", "stand", "rho, m", "article, m", "alignment apart, m", "straight, m"]
    rows = [
        [
            name,
            "yes" if o.reading.stand else "no",
            f"{o.rho_m:.0f}",
            f"{ARTICLE_M[o.reading.stand]:.0f}",
            f"{o.uncorrelated_m:.0f}",
            f"{o.straight_m:.0f}",
        ]
        for name, o in s.outcomes.items()
    ]
    return [head, *rows]


def ratio_table(s: Snake) -> list[list[str]]:
    """A row a pair of readings."""
    keys = ("rho_m", "uncorrelated_m", "straight_m")
    rows = [[" / ".join(f"({n})" for n in p), *(f"{s.ratio(p, k):.2f}" for k in keys), "1.7"] for p in PAIRS]
    return [["ratio", "flight", "alignment apart", "straight", "article"], *rows]


def console_lines(s: Snake) -> Iterator[str]:
    """Both tables."""
    yield from aligned(outcome_table(s))
    yield ""
    yield from aligned(ratio_table(s))


def verdict_words(s: Snake) -> str:
    """One line."""
    first, second = (s.outcomes[name].rho_m for name in PAIRS[0])
    found = f"{first:.0f} m and {second:.0f} m, {first / second:.2f} times"
    if s.within is None:
        return f"{found}; not compared: another flight or plan than the default"
    return f"{found}: {'within' if s.within else 'NOT within'} {100 * BOUND:.0f} % of the article's 1900 m and 1100 m"


def draw_curves(s: Snake) -> str:
    """rho against time, a line a reading."""
    with style.drawing(3.2) as (fig, ax):
        shown = [name for pair in PAIRS for name in pair]
        for k, name in enumerate(shown):
            curve = s.outcomes[name].curve_m
            t_min = np.arange(len(curve)) * SHOWN_S / 60.0
            ax.plot(t_min, curve, color=style.SERIES[k // 2], ls="--" if k % 2 else "-", lw=1.5, label=name)
        for value in ARTICLE_M.values():
            ax.axhline(value, color=style.MUTED, lw=1.0, ls=":")
        ax.set_xlabel("time of flight, min; dotted: the article's 1900 and 1100 m")
        ax.set_ylabel("ρ, m")
        ax.legend(loc="upper left")
        return style.svg(fig, "sins-snake")


def result_dict(s: Snake) -> dict[str, Any]:
    """For result.json."""
    f = s.flight
    return {
        "format": FORMAT,
        "within_limits": s.within,
        "flight": {name: getattr(f, name) for name in f.__dataclass_fields__} | {"bank_deg": f.bank_deg},
        "plan": s.plan.name,
        "outcomes": {
            name: {
                "rho_m": o.rho_m,
                "alignment_apart_m": o.uncorrelated_m,
                "straight_m": o.straight_m,
                "alignment_rad": o.alignment_rad.tolist(),
                "curve_m": o.curve_m.tolist(),
            }
            for name, o in s.outcomes.items()
        },
        "ratios": {" / ".join(p): s.ratio(p) for p in PAIRS},
    }


def write_page(folder: Path, s: Snake) -> Path:
    """result.json and report.html into `folder`; returns the page. Raises as write_report."""
    return write_report(folder, result_dict(s), html_page(s))


def html_page(s: Snake) -> str:
    """The whole page. Same input, same bytes."""
    f = s.flight
    facts = {
        "speed": f"{f.speed_mps:g} m/s",
        "turns": f"±{f.amplitude_deg:g}° in {f.period_s:g} s",
        "plan": s.plan.name,
    }
    body = [
        verdict_line(verdict_words(s), s.within),
        section("Error of place after the flight", html_table(outcome_table(s)), figure(draw_curves(s))),
        section("What the stand's angles bring", html_table(ratio_table(s))),
        section("How to read it", bullets(list(NOTES))),
    ]
    return whole_page(TITLE, facts, body)
