#!/usr/bin/env python3
"""Draw the pictures of docs/instruments.md into docs/img, from emu/phys itself. Same bytes each time.

tools/plots/instruments.py [docs/img]
"""

from __future__ import annotations

import ctypes
import math
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "tests/py/support"), str(ROOT / "scripts")]

import physics  # noqa: E402 the compiled physics: its way is known only now
from physics import Array, Lab, doubles, ns  # noqa: E402
from psabench.report import plots as report_plots  # noqa: E402

SERIES = report_plots.SERIES
NEVER = 2**63 - 1


def motion_figure(lib: ctypes.CDLL) -> Figure:
    """Angle and rate of an axis: a position, turned back on the way, a profile, a sine, a stop."""
    lab = Lab(lib, axes=[[2]])
    t_s = np.arange(0, 24, 0.005)
    rows = np.zeros((t_s.size, 3))
    todo: list[tuple[float, Callable[[], int]]] = [
        (0.0, lambda: lib.bridge_position(lab.lab, 0, 200.0, 80.0, ns(0.0))),
        (2.0, lambda: lib.bridge_position(lab.lab, 0, 60.0, 120.0, ns(2.0))),
        (6.0, lambda: lib.bridge_profile(lab.lab, 0, doubles([0, 3, 6]), doubles([40, -40, 0]), 3, ns(6.0))),
        (14.0, lambda: lib.bridge_sine(lab.lab, 0, 30.0, 0.5, ns(14.0))),
        (20.3, lambda: lib.bridge_rate(lab.lab, 0, 0.0, ns(20.3))),
    ]
    marks = []
    for i, t in enumerate(t_s):
        if todo and t >= todo[0][0] - 1e-9:
            at, command = todo.pop(0)
            if command() != 0:
                raise SystemExit(f"the command at {at} s was refused")
            marks.append(at)
        rows[i] = np.degrees(lab.axis(0, float(t)))
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.4, 4.2), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True)
        top.plot(t_s, rows[:, 0], color=SERIES[0], lw=1.4)
        bottom.plot(t_s, rows[:, 1], color=SERIES[1], lw=1.4)
        names = ("200°", "back to 60°", "profile ±40°/s", "sine 30°, 0.5 Hz", "rate 0")
        for at, name in zip(marks, names, strict=True):
            for ax in (top, bottom):
                ax.axvline(at, color=report_plots.MUTED, lw=0.8, ls=":")
            top.annotate(name, (at, 215), xytext=(3, 0), textcoords="offset points", fontsize=8)
        top.set_ylim(-20, 240)
        top.set_ylabel("angle, deg")
        bottom.set_ylabel("rate, deg/s")
        bottom.set_xlabel("time, s")
        return figure


def chamber_figure(lib: ctypes.CDLL) -> Figure:
    """A sweep from -60 to +85 degC and back at 1 K/min, and how far case and element are behind the air."""
    oven = lib.bridge_oven(25.0, 5.0, 3.0, 180.0, 360.0)
    out = (ctypes.c_double * 3)()
    minutes = np.arange(0, 460, 0.5)
    todo = [(0.0, -60.0), (115.0, 85.0), (290.0, -60.0)]
    rows = []
    for m in minutes:
        if todo and m >= todo[0][0]:
            lib.bridge_oven_set(oven, todo.pop(0)[1], ns(float(m) * 60))
        lib.bridge_oven_degc(oven, ns(float(m) * 60), out)
        rows.append(list(out))
    lib.bridge_oven_free(oven)
    degc: Array = np.array(rows)
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.4, 4.2), layout="constrained")
        top, bottom = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1])
        for k, name in enumerate(("air", "case", "sensing element")):
            top.plot(minutes, degc[:, k], color=SERIES[k], lw=1.4, label=name)
        for k in (1, 2):
            bottom.plot(minutes, degc[:, 0] - degc[:, k], color=SERIES[k], lw=1.4)
        top.set_ylabel("°C")
        top.legend(loc="upper right")
        bottom.set_ylabel("behind the air, K")
        bottom.set_xlabel("time, min (1 K/min)")
        return figure


def supply_figure(lib: ctypes.CDLL) -> Figure:
    """Ripple, a dip and a slewing output, and the spans in which the boards are off, from the told instants."""
    supply = lib.bridge_supply(400.0)
    lib.bridge_supply_ripple(supply, 0.6, 300.0, 0)
    lib.bridge_supply_dip(supply, 2.8, ns(8e-3), ns(4e-3))
    lib.bridge_supply_set(supply, 8.5, ns(20e-3))
    t_s = np.arange(0, 0.05, 2e-5)
    volts = [lib.bridge_supply_volts(supply, ns(float(t))) if t < 34e-3 else math.nan for t in t_s]
    changes, fed, at = [], 1, ns(0)
    while (told := lib.bridge_supply_next(supply, fed, at)) < ns(34e-3):
        changes.append(told * 1e-6)
        fed, at = 1 - fed, told
    lib.bridge_supply_set(supply, 12.0, ns(34e-3))
    volts = [v if t < 34e-3 else lib.bridge_supply_volts(supply, ns(float(t))) for t, v in zip(t_s, volts, strict=True)]
    at = max(at, ns(34e-3))
    while (told := lib.bridge_supply_next(supply, fed, at)) < ns(50e-3):
        changes.append(told * 1e-6)
        fed, at = 1 - fed, told
    lib.bridge_supply_free(supply)
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.4, 3.2), layout="constrained")
        ax = figure.subplots()
        for off, on in zip(changes[::2], [*changes[1::2], 50.0][: len(changes[::2])], strict=True):
            ax.axvspan(off, on, color=SERIES[1], alpha=0.18, lw=0)
        ax.plot(t_s * 1e3, volts, color=SERIES[0], lw=1.2)
        for level, text in ((9.0, "off below 9 V"), (9.5, "on from 9.5 V")):
            ax.axhline(level, color=report_plots.MUTED, lw=0.9, ls="--")
            ax.annotate(text, (0.2, level), xytext=(0, 2), textcoords="offset points", fontsize=8)
        ax.set_ylabel("V")
        ax.set_xlabel("time, ms (shaded: the boards are off)")
        return figure


def allan_figure(lib: ctypes.CDLL) -> Figure:
    """Allan deviation of each noise term over one run of 20 000 s, with its law."""
    n, dt_s = 2_000_000, 0.01
    floor = math.sqrt(2 * math.log(2) / math.pi)
    terms: dict[str, tuple[list[float], Callable[[Array], Array]]] = {
        "white 1 mV/√Hz": ([1e-3, 0, 0, 0, 0], lambda tau: 1e-3 / np.sqrt(2 * tau)),
        "bias instability 0.2 mV": (
            [0, 2e-4, 0, 0, 0],
            lambda tau: np.full(tau.size, 2e-4 * floor),
        ),
        "random walk 10 µV/√s": ([0, 0, 1e-5, 0, 0], lambda tau: 1e-5 * np.sqrt(tau / 3)),
        "ramp 0.2 µV/s": ([0, 0, 0, 2e-7, 0], lambda tau: 2e-7 * tau / math.sqrt(2)),
    }
    out = (ctypes.c_double * n)()
    sizes = np.unique(np.geomspace(1, n // 12, 26).astype(int))
    tau_s = sizes * dt_s
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.4, 4.0), layout="constrained")
        ax = figure.subplots()
        for colour, (name, (values, law)) in zip(SERIES, terms.items(), strict=False):
            lib.bridge_noise(doubles(values), 1, ns(dt_s), n, out)
            x: Array = np.array(out)
            means = [x[: x.size // m * m].reshape(-1, m).mean(axis=1) for m in sizes]
            deviation = [math.sqrt(0.5 * float(np.mean(np.diff(v) ** 2))) for v in means]
            ax.loglog(tau_s, deviation, "o", ms=3.5, color=colour, label=name)
            ax.loglog(tau_s, law(tau_s), lw=0.9, color=colour)
        ax.set_ylim(1e-8, 2e-2)
        ax.set_xlabel("averaging time, s")
        ax.set_ylabel("Allan deviation, V")
        ax.legend(loc="lower left", ncols=2)
        return figure


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "docs/img")
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as where:
        lib = physics.build(Path(where))
    pictures = {
        "instruments_motion": motion_figure(lib),
        "instruments_chamber": chamber_figure(lib),
        "instruments_supply": supply_figure(lib),
        "instruments_allan": allan_figure(lib),
    }
    for name, figure in pictures.items():
        (folder / f"{name}.svg").write_text(report_plots.standalone(report_plots.svg(figure, name)), encoding="utf-8")
        print(folder / f"{name}.svg")


if __name__ == "__main__":
    main()
