#!/usr/bin/env python3
"""Draw docs/img/sins_sigma.svg and sins_gauge.svg of docs/procedures/sins.md. Same bytes each time.

tools/plots/sins_observability.py [docs/img]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from psabench.native.nav import Floats
from psabench.native.sins import Gauge, Sins, SinsConfig, Turn, prior_covariance
from psabench.report import plots as style
from psabench.sins.covariance import GAMMA_AT, QUANTITIES, READINGS, SAMPLE_S, read_as
from psabench.sins.plan import RotationPlan, read_plan

ROOT = Path(__file__).resolve().parents[2]
EVERY_S = 60.0
CONSTANT = ("nu", "theta", "df", "gamma")
TURNED = ((2, 1), (0, 2), (1, 0))  # (i, j) of e_k in [e x]: element ij is e_k, element ji is -e_k


def config(gauge: Gauge = Gauge.ARTICLE) -> SinsConfig:
    """The article's filter without the table's angles, its noise read as B."""
    return replace(read_as(READINGS["B"], SinsConfig()), sample_s=SAMPLE_S, gauge=gauge)


def until(turns: tuple[Turn, ...], to_s: float) -> Iterator[Turn]:
    """What of a plan is over by then."""
    left_s = to_s
    for turn in turns:
        if left_s <= 0.0:
            return
        yield replace(turn, duration_s=min(turn.duration_s, left_s))
        left_s -= turn.duration_s


def after(cfg: SinsConfig, plan: RotationPlan, to_s: float) -> Sins:
    s = Sins(cfg, plan.start_c_nb)
    if to_s > 0.0:
        s.plan(list(until(plan.turns, to_s)))
    return s


def draw_sigmas(plan: RotationPlan) -> str:
    """Standard deviations against time, a panel a quantity, a line an element, its colour that of its row."""
    cfg = config()
    times_s = np.append(np.arange(0.0, plan.duration_s, EVERY_S), plan.duration_s)
    runs = [after(cfg, plan, t) for t in times_s]
    cycles = np.flatnonzero(np.diff([np.argmax(np.abs(t.axis_b)) for t in plan.turns]))
    ends_s = np.cumsum([t.duration_s for t in plan.turns])
    with style.drawing(4.4, 2, 3, sharex=True) as (fig, axes):
        for ax, q in zip(np.ravel(axes), QUANTITIES, strict=True):
            sd = np.array([s.sd(q.block) for s in runs]) * q.scale
            at = {"gamma": GAMMA_AT[cfg.gauge], "theta": tuple(range(9))}.get(q.block, (0, 4, 8))
            for k, place in enumerate(at):
                i, j = divmod(place, 3)
                if q.chosen(i, j):
                    ax.plot(times_s / 60.0, sd[:, k], color=style.SERIES[i], lw=1.2)
            for end_s in ends_s[cycles]:
                ax.axvline(end_s / 60.0, color=style.MUTED, lw=0.6, ls=":")
            ax.set_yscale("log")
            ax.minorticks_off()
            ax.set_title(f"{q.label}{', ' + q.unit if q.unit else ''}")
        for ax in axes[1]:
            ax.set_xlabel("min")
        return style.svg(fig, "sins-sigma")


def normal_covariance(plan: RotationPlan) -> tuple[Floats, list[str]]:
    """Of the constant states with nine elements of Gamma, in prior standard deviations; their names."""
    cfg = config(Gauge.FREE9)
    s = after(cfg, plan, plan.duration_s)
    at = np.concatenate([np.arange(s.rows[b].start, s.rows[b].stop) for b in CONSTANT])
    sd = np.sqrt(np.diag(prior_covariance(cfg))[at])
    of_three, of_nine = (1, 2, 3), [f"{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)]
    places = {"nu": of_three, "theta": of_nine, "df": of_three, "gamma": of_nine}
    letters = {"nu": "ν", "theta": "Θ", "df": "Δf", "gamma": "Γ"}
    names = [f"{letters[b]}{p}" for b in CONSTANT for p in places[b]]
    return s.covariance()[1][np.ix_(at, at)] / np.outer(sd, sd), names


def null_directions(vectors: Floats, names: list[str]) -> Floats:
    """The three directions of the largest eigenvalues, combined so that each turns about one axis: columns."""
    gamma = {name: vectors[k] for k, name in enumerate(names) if name[0] == "Γ"}
    turns = [gamma[f"Γ{i + 1}{j + 1}"] - gamma[f"Γ{j + 1}{i + 1}"] for i, j in TURNED]
    found = vectors @ np.linalg.inv(np.array(turns))
    return np.asarray(found / np.linalg.norm(found, axis=0))


def draw_gauge(plan: RotationPlan) -> str:
    """What is left of the prior in each direction of the state, and the three directions that keep all of it."""
    p, names = normal_covariance(plan)
    values, vectors = np.linalg.eigh(p)
    left = np.sqrt(np.maximum(values[::-1], 0.0))
    null = null_directions(vectors[:, -3:], names)
    with style.drawing(4.4, 2, 2) as (fig, axes):
        first, *others = np.ravel(axes)
        colours = [style.SERIES[1] if k < 3 else style.SERIES[0] for k in range(len(left))]
        first.bar(np.arange(1, len(left) + 1), left, color=colours)
        first.set_yscale("log")
        first.minorticks_off()
        first.set_title("sd / prior sd along each direction")
        for k, ax in enumerate(others):
            draw_direction(ax, null[:, k], names, f"kept whole: a turn about axis {k + 1}")
        print("kept of the prior:", ", ".join(f"{x:.4f}" for x in left[:5]))
        return style.svg(fig, "sins-gauge")


def draw_direction(ax: Any, direction: Floats, names: list[str], title: str) -> None:
    """Its components, named where they are not small."""
    ax.bar(np.arange(len(names)), direction, color=style.SERIES[1])
    for x, (name, y) in enumerate(zip(names, direction, strict=True)):
        if abs(y) > 0.1:
            ax.annotate(name, (x, y), ha="center", va="bottom" if y > 0 else "top", fontsize=8)
    ax.set_ylim(-0.8, 0.8)
    ax.set_xticks([])
    ax.axhline(0.0, color=style.MUTED, lw=0.6)
    ax.set_title(title)


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/img"
    plan = read_plan("article")
    for name, text in (("sins_sigma", draw_sigmas(plan)), ("sins_gauge", draw_gauge(plan))):
        (folder / f"{name}.svg").write_text(style.standalone(text), encoding="utf-8")


if __name__ == "__main__":
    main()
