"""report.html and result.json of gyrocompassing and heading hold, and their pictures."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from psabench.estimate.angles import wrapped_deg
from psabench.native.nav import DEGPH
from psabench.procedures.result import DEG
from psabench.report import gyro_grading as grading
from psabench.report import plots
from psabench.report.gyro_grading import GyroSection
from psabench.report.page import bullets, figure, folded, section, table, verdict_line, whole_page, write_report

TITLE = "Gyrocompassing and heading hold"
FORMAT = 1  # of result.json
CAPTIONS = {
    "rates": "Levelling rate of each position against the azimuth angle α of the platform: the Earth's horizontal rate "
    "as a sine about the drift. The line is the fit. Below: what the rates miss it by.",
    "course": "The same in time: the line is what the fit expects in each window.",
    "hold": "Heading less the truth while it is kept by the gyroscope. Shaded: U.",
    "claim": " Dashed: the article's 0.3°.",
}


def write(folder: Path, sections: Sequence[GyroSection], facts: Mapping[str, str]) -> Path:
    """result.json and report.html into `folder`, each whole or not at all; returns the page. Raises as write_report."""
    data = {
        "format": FORMAT,
        "facts": dict(facts),
        "within_limits": grading.within_limits(sections),
        "sections": [grading.result_dict(s) for s in sections],
    }
    return write_report(folder, data, html_page(sections, facts))


def html_page(sections: Sequence[GyroSection], facts: Mapping[str, str]) -> str:
    """The whole page. Same input, same bytes."""
    body = [
        verdict_line(grading.verdict(sections), grading.within_limits(sections)),
        *(_section(s, f"g{k}") for k, s in enumerate(sections)),
        _method(any(s.article for s in sections)),
    ]
    return whole_page(TITLE, facts, body)


def _section(s: GyroSection, ident: str) -> str:
    doubts = [f"<span class=bad>{escape(d)}</span>" for d in grading.doubts(s)]
    c = s.result.compass
    return section(
        s.title,
        f"<p class=facts>|hypot(s, c) − 1| <b>{c.quality:.4f}</b> · determinant <b>{c.geometry:.2f}</b> We²</p>",
        table(grading.table(s), symbols={e.name: e.symbol for e in s.result.estimates}),
        f"<p class=facts>{escape(s.result.latitude.words)}</p>",
        bullets([*doubts, *map(escape, s.result.notes)]),
        _figure(rates_figure(s), ident + "rates", CAPTIONS["rates"]),
        _figure(course_figure(s), ident + "course", CAPTIONS["course"]),
        _positions(s),
        _hold(s, ident),
    )


def _hold(s: GyroSection, ident: str) -> str:
    if s.hold is None:
        return ""
    caption = CAPTIONS["hold"] + (CAPTIONS["claim"] if s.article else "")
    return (
        f"<h2>Hold: {s.hold.drift2_radps / DEGPH:.3f} deg/h compensated in azimuth</h2>"
        f"<p>{escape(grading.hold_summary(s))}</p>{table(grading.hold_table(s))}"
        f"{_figure(hold_figure(s), ident + 'hold', caption)}"
    )


def _positions(s: GyroSection) -> str:
    rows: list[tuple[str, ...]] = [
        ("position", "gimbal, deg", "turn of α, deg", "S, deg/h", "β, ′", "γ, deg", "residual, deg/h")
    ]
    for row in s.result.rows:
        p = row.position
        numbers = (row.q_rad * DEG, p.delta_rad * DEG, p.s_radps / DEGPH, p.beta_rad * DEG * 60.0, p.gamma_rad * DEG)
        cells = [f"{x:.4f}" for x in numbers]
        rows.append((str(row.number + 1), *cells, f"{row.residual_radps / DEGPH:+.4f}"))
    return folded("Positions", table(rows))


def _figure(picture: Figure, ident: str, caption: str) -> str:
    return figure(plots.svg(picture, ident), escape(caption))


def _method(article: bool) -> str:
    claims = (
        " The article's figures are of one simulated run; what they are worth, and under which reading they hold, is "
        "on the page of the procedure."
    )
    return section(
        "How to read this",
        "<p>ψ: heading. α<sub>1</sub>: azimuth angle of the platform in the first position. ω<sub>d1</sub>, "
        "ω<sub>d2</sub>: drift about the levelled and the azimuth axis. ϑ: pitch. γ: roll.</p>"
        "<p>U: expanded uncertainty, 95.45 %. It counts the random drift of the passport as a Gauss-Markov process, "
        "and the limits of the constant errors that no window sees: level sensors, zero of the angle sensor, scale of "
        f"the torquers. E<sub>n</sub>: error/U; out of limits is what misses the truth by more than 2 U."
        f"{claims if article else ''}</p>",
        kind="method",
    )


# ---- pictures


def rates_figure(s: GyroSection) -> Figure:
    """S against alpha with its fit, and what is left."""
    r, p = s.result, s.result.params
    we_degph = p.we_radps / DEGPH
    alpha = wrapped_deg(np.array([(r.compass.alpha1_rad + row.position.delta_rad) * DEG for row in r.rows]))
    rate = np.array([row.position.s_radps / DEGPH for row in r.rows])
    left = np.array([row.residual_radps / DEGPH for row in r.rows])
    x = np.linspace(-180.0, 180.0, 361)
    with plots.drawing(4.4, 2, 1, sharex=True, height_ratios=[3, 1.4]) as (picture, (top, bottom)):
        top.plot(x, r.compass.drift1_radps / DEGPH + we_degph * np.sin(np.radians(x)), color=plots.MUTED, lw=1.0)
        top.axhline(r.compass.drift1_radps / DEGPH, color=plots.SERIES[1], lw=0.9, ls="--", label="drift")
        top.plot(alpha, rate, "o", color=plots.SERIES[0], ms=4.5, label="position")
        bottom.plot(alpha, left, "o", color=plots.SERIES[0], ms=4.0)
        bottom.axhline(0.0, color=plots.MUTED, lw=0.8)
        top.set_ylabel("levelling rate S, deg/h")
        bottom.set_ylabel("residual, deg/h")
        bottom.set_xlabel("gimbal azimuth α, deg")
        bottom.set_xlim(-180.0, 180.0)
        bottom.set_xticks(range(-180, 181, 45))
        top.legend(loc="upper left", ncols=2)
        return picture


def course_figure(s: GyroSection) -> Figure:
    """S of each window in time."""
    r = s.result
    run = r.windows[: len(r.params.table.sequence_deg)]
    begun_s = run[0].t_mid_s - run[0].length_s / 2.0
    with plots.drawing(2.8) as (picture, ax):
        for w in run:
            t = w.t_mid_s - begun_s + w.length_s * (np.arange(len(w.beta_rad)) / len(w.beta_rad) - 0.5)
            every = max(1, len(t) // 200)
            ax.plot(t[::every], w.levelling_radps[::every] / DEGPH, color=plots.SERIES[0], lw=0.8)
        for row in r.rows:
            p = row.position
            middle, half = p.t_mid_s - begun_s, p.window_s / 2.0
            expected = (p.s_radps - row.residual_radps) / DEGPH
            ax.plot([middle - half, middle + half], [expected] * 2, color=plots.SERIES[1], lw=1.4)
        ax.set_xlabel("time from the first window, s")
        ax.set_ylabel("levelling rate S, deg/h")
        return picture


def hold_figure(s: GyroSection) -> Figure:
    """Error of the heading in time, with what is to be expected of it."""
    assert s.hold is not None
    hours = np.array([h.t_s / 3600.0 for h in s.hold.held])
    band = np.array([h.u_rad * DEG for h in s.hold.held])
    errors = np.array(grading.hold_errors_deg(s) or np.full(len(hours), np.nan))
    with plots.drawing(3.0) as (picture, ax):
        ax.fill_between(hours, -band, band, color=plots.MUTED, alpha=0.18, lw=0)
        for sign in (-1.0, 1.0) if s.article else ():
            ax.axhline(sign * grading.HOLD_CLAIM_DEG, color=plots.SERIES[1], lw=0.9, ls="--")
        ax.plot(hours, errors, color=plots.SERIES[0], lw=1.4)
        ax.set_xlabel("time, h")
        ax.set_ylabel("heading error, deg")
        ax.set_xlim(0.0, float(hours[-1]))
        return picture
