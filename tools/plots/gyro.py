#!/usr/bin/env python3
"""Draw docs/img/gyro_run.svg: a gyrocompassing run of three positions, as it comes over CAN and as it is.

    tools/plots/gyro.py [docs/img/gyro_run.svg]

From a run of the scenario gyrocompass. Same bytes each time.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts")]

from psabench import Bench  # noqa: E402 of this tree
from psabench.boards.gyro.device import Gyro, Mode, Phase  # noqa: E402
from psabench.boards.readings import Readings  # noqa: E402
from psabench.report import plots as report_plots  # noqa: E402 of this tree

RUN_S = 86.0
STEP_S = 0.01
DEGPH_PER_DEG = 3600.0  # S = -m1 beta with m1 = 1 1/s
EARTH_DEGPH, LATITUDE_DEG = 15.041067, 50.0
SMOOTH, THIN = 50, 10  # steps


def record() -> tuple[Readings, list[dict[str, float]]]:
    """All readings of a run, and the truth at the end of each window."""
    truth: list[dict[str, float]] = []
    with Bench.start("gyrocompass") as bench:
        bench.wait(1.0)
        gyro = bench.board(Gyro)
        gyro.mode = Mode.GYROCOMPASS
        gyro.frames.forget()
        gyro.start()
        for _ in range(int(RUN_S / 0.5)):
            bench.wait(0.5)
            if gyro.phase == Phase.WINDOW:
                truth[int(gyro.position) - 1 :] = [bench.truth_state()["platform"]]
        gyro.stop()
        return gyro.frames.take(), truth


def expected_degph(state: dict[str, float], drift_degph: float) -> float:
    """Article, eq. (9)."""
    a, b, g = (np.radians(state[f"{name}_deg"]) for name in ("alpha", "beta", "gamma"))
    we_degph = EARTH_DEGPH * np.cos(np.radians(LATITUDE_DEG))
    return float(we_degph * (np.sin(a) * np.cos(g) + np.cos(a) * np.sin(g) * np.sin(b)) + drift_degph)


def figure_of(r: Readings, truth: list[dict[str, float]]) -> Figure:
    """Gimbal, levelling rate, torquers; windows are shaded."""
    first, second, third = report_plots.SERIES[:3]
    t_s = np.arange(len(r["U1"])) * STEP_S
    s_degph = -DEGPH_PER_DEG * r["BETA"]
    smooth = np.convolve(s_degph, np.ones(SMOOTH) / SMOOTH, mode="same")
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.6, 5.6), layout="constrained")
        rows = figure.subplots(3, 1, sharex=True)
        rows[0].plot(t_s[::THIN], r["ENCODER"][::THIN], color=first)
        rows[0].set_ylabel("ENCODER, deg")
        rows[1].plot(t_s[::3], s_degph[::3], color=report_plots.MUTED, lw=0.4, label="each third reading")
        rows[1].plot(t_s[::THIN], smooth[::THIN], color=second, lw=1.2, label="mean of half a second")
        rows[1].set_ylabel("S = -m1 BETA, deg/h")
        rows[1].set_ylim(0.0, 60.0)
        u2_degph = np.convolve(r["U2"], np.ones(SMOOTH) / SMOOTH, mode="same")
        rows[2].plot(t_s[::THIN], u2_degph[::THIN], color=third)
        rows[2].set_ylabel("U2, deg/h")
        rows[2].set_ylim(0.0, 60.0)
        for position, state in enumerate(truth, start=1):
            inside = np.flatnonzero((r["PHASE"] == Phase.WINDOW) & (r["POSITION"] == position))
            span = t_s[inside[0]], t_s[inside[-1]]
            for ax in rows:
                ax.axvspan(*span, color=report_plots.MUTED, alpha=0.15, lw=0)
            want = expected_degph(state, state["drift_degph"][0])  # type: ignore[index]
            label = "eq. (9) with the true angles and drift" if position == 1 else None
            rows[1].hlines(want, *span, color=first, lw=1.6, zorder=5, label=label)
        rows[1].legend(loc="upper center", ncols=3)
        rows[2].set_xlabel("time from the mode's beginning, s (shaded: windows)")
        return figure


def main() -> None:
    path = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "docs/img/gyro_run.svg")
    figure = figure_of(*record())
    path.write_text(report_plots.standalone(report_plots.svg(figure, "gyro_run")), encoding="utf-8")
    print(path)


if __name__ == "__main__":
    main()
