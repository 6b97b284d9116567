#!/usr/bin/env python3
"""Draw docs/img/pmka_rotation.svg: the four integrators of a PMKA over the beats tau1..tau5 (article, figure 5).

    tools/plots/pmka.py [docs/img/pmka_rotation.svg]

From a recording over CAN of a unit with short beats. Same bytes each time.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts")]

from psabench import Bench  # noqa: E402 of this tree
from psabench.boards.pmka import estimate as est  # noqa: E402
from psabench.boards.pmka.device import Pmka  # noqa: E402
from psabench.link.signals import Floats  # noqa: E402
from psabench.report import plots as report_plots  # noqa: E402 of this tree

BEAT, ZERO = 14, 5  # Ts; the article's figure has four machine cycles a beat
TS_MS = 4.8
SCENARIO = """
seed: 4
site: {g_mps2: 9.8}
units:
  - name: a
    board: pmka
    axes:
      x: {sensor: mems, u0_v: 2.6, kx_v_per_g: 0.0}
      y: {sensor: mems, u0_v: -1.7, kx_v_per_g: 0.0}
      z: {sensor: mems, u0_v: 1.1, kx_v_per_g: 0.0}
"""


def record() -> dict[str, Floats]:
    """Columns from the first reading of tau1 to the end of tau5."""
    with tempfile.TemporaryDirectory() as where:
        path = Path(where) / "rotation.yaml"
        path.write_text(SCENARIO, encoding="utf-8")
        with Bench.start(path) as bench:
            unit = bench.board(Pmka)
            unit.wait_ready()
            unit.autonomous(True, beat=BEAT, zero=ZERO)
            readings = unit.stream(BEAT * 40)
    tau = readings["TAU"]
    first = int(np.flatnonzero((tau == 1) & (np.roll(tau, 1) == 5))[2])
    return {name: column[first - 1 : first + 5 * BEAT] for name, column in readings.columns.items()}


def figure_of(columns: dict[str, Floats]) -> Figure:
    """A row an integrator: its codes in volts, the colour says whose input it has."""
    colours = {0: report_plots.MUTED, 1: report_plots.SERIES[0], 2: report_plots.SERIES[1], 3: report_plots.SERIES[2]}
    names = {0: "out of work: zero, resets", 1: "serves X", 2: "serves Y", 3: "serves Z"}
    t_ms = np.arange(len(columns["X"])) * TS_MS
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.6, 5.4), layout="constrained")
        rows = figure.subplots(4, 1, sharex=True, sharey=True)
        for i, (ax, name) in enumerate(zip(rows, est.INTEGRATORS, strict=True)):
            serves = columns[f"SERVES_{name}"].astype(int)
            for who in colours:
                for first, last in est.runs(serves[1:] == who):
                    ax.plot(t_ms[first : last + 2], columns[name][first : last + 2], color=colours[who], lw=1.3)
            ax.plot(t_ms, columns[name], ".", ms=2.5, color=report_plots.MUTED)
            for beat in range(6):
                ax.axvline(beat * BEAT * TS_MS, color=report_plots.MUTED, lw=0.8, ls=":")
            for level in (-3.5, 3.5):
                ax.axhline(level, color=report_plots.MUTED, lw=0.5, ls="--")
            ax.set_ylabel(f"U {name}, V" if i < 3 else "U K, V")
        for beat in range(5):
            rows[0].annotate(f"τ{beat + 1}", ((beat + 0.5) * BEAT * TS_MS, 6.3), ha="center", fontsize=9)
        rows[0].set_ylim(-6, 8)
        for who, colour in colours.items():
            rows[3].plot([], [], color=colour, lw=2.0, label=names[who])
        rows[3].legend(loc="upper center", bbox_to_anchor=(0.5, -0.42), ncols=4)
        rows[3].set_xlabel("time, ms (dots: samples; dashed: ±Uc, beyond which a reset follows)")
        return figure


def main() -> None:
    path = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "docs/img/pmka_rotation.svg")
    figure = figure_of(record())
    path.write_text(report_plots.standalone(report_plots.svg(figure, "pmka_rotation")), encoding="utf-8")
    print(path)


if __name__ == "__main__":
    main()
