"""Pictures of a flight: the way, errors, standard deviations, innovations."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from psabench.koi.flight_data import FlightFound
from psabench.koi.geodesy import MILE_M, offset_m
from psabench.koi.wire.run import KoiRun
from psabench.koi.wire.truth import Graded
from psabench.native.nav import ARCMIN, DEGPH
from psabench.report import plots as style
from psabench.report.page import figure

MINUTE_S, KM = 60.0, 1000.0
TURN_RADPS = math.radians(0.5)  # more is a turn, on the ground as well
SIGMAS = (
    ("beta3", ARCMIN, "heading, ′"),
    ("nu1_radps", DEGPH, "drift ν₁, °/h"),
    ("df1_mps2", 1e-3, "bias Δf₁, mm/s²"),
    ("dt1", 1e-3, "latency Δt₁, ms"),
)


def draw_pictures(run: KoiRun) -> Iterator[tuple[str, str]]:
    """Titles and SVG."""
    if not len(run.found.t_s):
        return
    yield "The way", figure(_draw_way(run))
    if run.graded is not None:
        yield "Errors of place", figure(_draw_errors(run.graded, run.found))
    yield "What the filter knows", figure(_draw_sigmas(run))
    yield "Innovations", figure(_draw_nis(run.found))


def _draw_way(run: KoiRun) -> str:
    """Both solutions, and the truth where it is known."""
    f = run.found
    first = np.broadcast_to(f.hybrid[0, :3], (len(f.hybrid), 3))
    with style.drawing(4.2) as (fig, ax):
        for rows, label, color in (
            (f.autonomous, "autonomous", style.SERIES[1]),
            (f.hybrid, "hybrid", style.SERIES[0]),
        ):
            way_km = offset_m(rows[:, :3], first)[:, :2] / KM
            ax.plot(*way_km.T, color=color, lw=1.3, label=label)
        if run.graded is not None:
            ax.plot(*(run.graded.way_m.T / KM), color=style.MUTED, lw=0.8, ls=":", label="truth")
        ax.set_xlabel("east, km")
        ax.set_ylabel("north, km")
        ax.set_aspect("equal", adjustable="datalim")
        ax.legend(loc="best")
        return style.svg(fig, "koi-way")


def _draw_errors(g: Graded, f: FlightFound) -> str:
    """Radial, of both, on a logarithmic scale; a mile an hour from take-off."""
    t_min = g.t_s / MINUTE_S
    with style.drawing(3.4) as (fig, ax):
        for off, label, color in (
            (g.autonomous_m, "autonomous", style.SERIES[1]),
            (g.hybrid_m, "hybrid", style.SERIES[0]),
        ):
            ax.plot(t_min, np.maximum(np.hypot(*off[:, :2].T), 0.1), color=color, lw=1.2, label=label)
        if f.take_off_s is not None:
            hours = np.maximum(g.t_s - f.take_off_s, 0.0) / 3600.0
            ax.plot(t_min, np.maximum(hours * MILE_M, 0.1), color=style.MUTED, lw=0.9, ls=":", label="a mile an hour")
        ax.set_yscale("log")
        ax.set_xlabel("time, min")
        ax.set_ylabel("horizontal error, m")
        ax.legend(loc="upper left")
        return style.svg(fig, "koi-errors")


def _draw_sigmas(run: KoiRun) -> str:
    """By their values at first; grey: turns in flight; lines: take-off, stops."""
    f = run.found
    with style.drawing(3.6) as (fig, ax):
        for k, (name, unit, label) in enumerate(SIGMAS):
            sd = f.sd[:, f.names.index(name)] / unit
            ax.plot(
                f.sd_t_s / MINUTE_S, sd / sd[0], color=style.SERIES[k], lw=1.3, label=f"{label}: {sd[0]:.3g} at first"
            )
        _mark_phases(ax, run)
        ax.set_ylim(0.0, 1.1)
        ax.set_xlabel("time, min; grey: turns; dashed: take-off; dotted: stops")
        ax.set_ylabel("standard deviation / that at first")
        ax.legend(loc="upper right")
        return style.svg(fig, "koi-sigma")


def _mark_phases(ax: Any, run: KoiRun) -> None:
    f = run.found
    if f.take_off_s is not None:
        ax.axvline(f.take_off_s / MINUTE_S, color=style.INK, lw=1.0, ls="--")
    for e in f.events:
        if e.what == "stop":
            ax.axvline(e.t_s / MINUTE_S, color=style.MUTED, lw=0.8, ls=":")
    heading = np.unwrap(np.arctan2(f.hybrid[:, 6], f.hybrid[:, 9]))
    rate = np.abs(np.gradient(heading, f.t_s)) if len(heading) > 1 else np.zeros(len(heading))
    turning = np.concatenate([[False], rate > TURN_RADPS, [False]])
    begins, ends = np.flatnonzero(turning[1:] & ~turning[:-1]), np.flatnonzero(~turning[1:] & turning[:-1]) - 1
    for begin, end in zip(begins, ends, strict=True):
        ax.axvspan(f.t_s[begin] / MINUTE_S, f.t_s[end] / MINUTE_S, color=style.MUTED, alpha=0.15, lw=0)


def _draw_nis(f: FlightFound) -> str:
    """Mean between two rows, a minute's worth."""
    with style.drawing(3.0) as (fig, ax):
        for k, (kind, sums) in enumerate(f.nis_sum.items()):
            dof = f.nis_dof[kind]
            sums, dof = np.diff(sums[::6]), np.diff(dof[::6])
            t_min = f.sd_t_s[::6][1:] / MINUTE_S
            there = dof > 0
            if there.any():
                ax.plot(t_min[there], sums[there] / dof[there], color=style.SERIES[k], lw=1.2, label=kind)
        ax.set_xlabel("time, min")
        ax.set_ylabel("NIS by degree of freedom")
        if ax.lines:  # a flight of a minute has none
            ax.legend(loc="upper right")
        return style.svg(fig, "koi-nis")
