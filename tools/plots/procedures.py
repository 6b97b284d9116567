#!/usr/bin/env python3
"""Draw the pictures of docs/procedures into docs/img, and print the figures that the pages quote.

The sensor is simulated here from model (1) at the level of readings, without emulator: what a page says of a method is
then a property of the method. Same seed, same bytes.

    tools/plots/procedures.py [docs/img]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import cast

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from psabench.estimate import harmonics, model
from psabench.estimate.face import Face
from psabench.estimate.model import Array, Sensor
from psabench.procedures.fourier import FourierParams, fourier
from psabench.procedures.head_bench import HeadBench
from psabench.procedures.reversal import ReversalParams, reversal
from psabench.report import plots as report_plots
from psabench.report.grading import Section

ARTICLE = Sensor(
    u0_v=2.50, alpha0_rad=np.radians(0.1121), kx_v_per_g=1.0, ky_v_per_g=0.0098, kz_v_per_g=0.004, kxy_v_per_g2=0.0010
)
TRUTH = {
    "u0_v": 2.50,
    "alpha0_deg": 0.1121,
    "kx_v_per_g": 1.0,
    "ky_v_per_g": 0.0098,
    "kz_v_per_g": 0.004,
    "kxy_v_per_g2": 1e-3,
}
ALPHA_RAD = np.tile(np.radians(5.0 * np.arange(80)), 5)
RUNS = 4000


class Readings:
    """The least a procedure needs of a bench: model (1) and white noise."""

    g_mps2 = 9.81

    def __init__(self, sensor: Sensor, noise_v: float, seed: int) -> None:
        self.t_s = 0.0
        self._sensor, self._noise_v, self._rng = sensor, noise_v, np.random.default_rng(seed)
        self._alpha_rad, self._face = 0.0, Face.DIRECT

    def turn(self, angle_deg: float) -> float:
        self._alpha_rad = np.radians(angle_deg)
        return angle_deg

    def mount(self, face: Face) -> None:
        self._face = face

    def wait(self, dwell_s: float) -> None:
        self.t_s += dwell_s

    def read(self, axis: str, readings: int) -> Array:
        self.t_s += readings
        level_v = harmonics.evaluate(model.harmonics_of(self._sensor, self._face), np.array([self._alpha_rad]))
        return cast(Array, level_v[0] + self._noise_v * self._rng.standard_normal(readings))


def bench(noise_v: float, seed: int, sensor: Sensor = ARTICLE) -> HeadBench:
    return Readings(sensor, noise_v, seed)


def scatter(noise_v: float, seed: int) -> tuple[Array, Array]:
    """alpha0 (deg) and ky (V/g) of RUNS calibrations: one face, then reversal; each (2, RUNS)."""
    rng = np.random.default_rng(seed)
    fits = []
    for face in (Face.DIRECT, Face.REVERSED):
        clean_v = harmonics.evaluate(model.harmonics_of(ARTICLE, face), ALPHA_RAD)
        fits.append(harmonics.fit(ALPHA_RAD, clean_v[:, None] + noise_v * rng.standard_normal((400, RUNS))).c_v)
    one, both = model.one_face(fits[0]), model.reversal(np.concatenate(fits))
    return np.stack([np.degrees(one[1]), one[3]]), np.stack([np.degrees(both[1]), both[3]])


def noise_figure() -> Figure:
    """Standard deviation of alpha0 against the noise of a reading: one face and reversal."""
    noise_v = np.geomspace(1e-9, 3e-3, 14)
    sd = np.array([[s[0].std() for s in scatter(float(n), i)] for i, n in enumerate(noise_v)])
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.4, 3.6), layout="constrained")
        ax = figure.subplots()
        ax.loglog(
            noise_v * 1e6, sd[:, 0], "o-", ms=3.5, lw=1.3, color=report_plots.SERIES[1], label="one face, eq. (18)"
        )
        ax.loglog(noise_v * 1e6, sd[:, 1], "o-", ms=3.5, lw=1.3, color=report_plots.SERIES[2], label="reversal")
        for level, at_uv, text in (
            (0.1121, 1e-3, "α₀ itself"),
            (0.1121 / 10 / 1.37, 1e-3, "10 % in 83 % of runs"),
            (5e-5, 0.1, "the fourth printed digit"),
        ):
            ax.axhline(level, color=report_plots.MUTED, lw=0.9, ls="--")
            ax.annotate(text, (at_uv, level), xytext=(0, 3), textcoords="offset points", fontsize=8.5)
        ax.set_xlabel("noise of one reading, µV (5 × 80 readings a face)")
        ax.set_ylabel("sd of α₀, deg")
        ax.legend(loc="lower right")
        return figure


def quadratic_figure() -> Figure:
    """alpha0 that one face and the reversal return when k_xx is not zero, without any noise."""
    kxx = np.linspace(-2e-4, 2e-4, 201)
    one, both = [], []
    for q in kxx:
        s = replace(ARTICLE, kxx_v_per_g2=float(q))
        c = [model.harmonics_of(s, face) for face in (Face.DIRECT, Face.REVERSED)]
        one.append(np.degrees(model.one_face(c[0])[1]))
        both.append(np.degrees(model.reversal(np.concatenate(c))[1]))
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.4, 3.2), layout="constrained")
        ax = figure.subplots()
        ax.plot(kxx * 1e6, one, lw=1.5, color=report_plots.SERIES[1], label="one face, eq. (18)")
        ax.plot(kxx * 1e6, both, lw=1.5, color=report_plots.SERIES[2], label="reversal")
        ax.set_xlabel("$k_{xx} - k_{yy}$, µV/g²")
        ax.set_ylabel("α₀ returned, deg")
        ax.legend(loc="upper right")
        return figure


def correlation_figure() -> Figure:
    """alpha0 against ky at 50 uV a reading: one face knows their sum, the reversal both."""
    one, both = scatter(50e-6, 1)
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.4, 3.4), layout="constrained")
        ax = figure.subplots()
        ax.plot(one[0, :600], one[1, :600] * 1e3, ".", ms=3, color=report_plots.SERIES[1], label="one face, 600 runs")
        ax.plot(both[0, :600], both[1, :600] * 1e3, ".", ms=3, color=report_plots.SERIES[2], label="reversal, 600 runs")
        ax.plot(0.1121, 9.8, "+", ms=11, mew=1.6, color=report_plots.INK, label="truth")
        ax.set_xlabel("α₀, deg")
        ax.set_ylabel("$k_y$, mV/g")
        ax.legend(loc="upper right")
        return figure


def alpha0_figure() -> Figure:
    """The picture of the report: alpha0 quiet, realistic, by reversal."""
    rows = [
        Section(label="quiet, 2 nV", result=fourier(bench(2e-9, 1), FourierParams()), truth=TRUTH),
        Section(label="realistic, 1 mV", result=fourier(bench(1e-3, 2), FourierParams()), truth=TRUTH),
        Section(label="realistic, 1 mV", result=reversal(bench(1e-3, 3), ReversalParams()), truth=TRUTH),
    ]
    figure = report_plots.alpha0_figure(rows, None)
    assert figure is not None
    return figure


def quote() -> None:
    """The table of docs/procedures/fourier.md and reversal.md."""
    print("noise   one face: sd alpha0, sd ky, within 10 %   reversal: sd alpha0, sd ky")
    for noise_v in (1e-3, 78e-6, 50e-6, 10e-6, 2e-6, 1e-6, 2e-9):
        one, both = scatter(noise_v, 7)
        share = np.mean(np.abs(one[0] / 0.1121 - 1) < 0.1)
        print(f"{noise_v * 1e6:8.3f} uV  {one[0].std():.2g}  {one[1].std():.2g}  {share:.3f}   ", end="")
        print(f"{both[0].std():.2g}  {both[1].std():.2g}")


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/img")
    folder.mkdir(parents=True, exist_ok=True)
    quiet = Section(label="", result=fourier(bench(2e-9, 1), FourierParams()))
    realistic = Section(label="", result=fourier(bench(1e-3, 2), FourierParams()))
    pictures = {
        "fourier_turn": report_plots.turn_figure(realistic),
        "fourier_second_harmonic": report_plots.second_harmonic_figure(quiet),
        "fourier_noise": noise_figure(),
        "fourier_quadratic": quadratic_figure(),
        "reversal_correlation": correlation_figure(),
        "reversal_alpha0": alpha0_figure(),
    }
    for name, figure in pictures.items():
        (folder / f"{name}.svg").write_text(report_plots.standalone(report_plots.svg(figure, name)), encoding="utf-8")
        print(folder / f"{name}.svg")
    quote()


if __name__ == "__main__":
    main()
