#!/usr/bin/env python3
"""Draw docs/img/filter_response.svg and docs/img/filter_allan.svg: PSA-2's filter and interference, zero by settings.

    tools/plots/filter_study.py [docs/img]

Curves are the published response and the laws, points are readings through the wire. Same bytes each time.
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
from psabench.estimate import allan  # noqa: E402 of this tree
from psabench.link.signals import Floats  # noqa: E402 of this tree
from psabench.procedures import filter_study as fs  # noqa: E402 of this tree
from psabench.report import plots as report_plots  # noqa: E402 of this tree

EXAMPLES = ROOT / "examples"
TONE_V, WORDS = 0.1, 500
TONES_HZ = {
    1000: (50.0, 300.0, 413.0, 440.0, 950.0, 31_960.0, 1_023_960.0, 1_024_350.0, 2_048_050.0),
    4000: (50.0, 1000.0, 1_652.0, 1_760.0, 3_960.0, 31_960.0, 1_022_000.0, 1_025_000.0, 2_049_500.0),
}
LEAST_DB = -130.0
TAUS_S = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)
ZEROS = ((fs.Setting(rate_hz=1000), 250.0), (fs.Setting(rate_hz=250), 400.0), (fs.Setting(rate_hz=250, gain=64), 400.0))
WALK_V_RTS = 1e-7  # filter_study_drift.yaml


def decibel(gain: Floats) -> Floats:
    level: Floats = np.maximum(20.0 * np.log10(np.maximum(gain, 1e-12)), LEAST_DB)
    return level


def response_figure() -> Figure:
    """Two rates, with and without the board's filter, against the frequency of the disturbance."""
    with Bench.start(EXAMPLES / "filter_study_interference.yaml") as bench:
        found = [
            t
            for rate, hz in TONES_HZ.items()
            for t in fs.tones(bench, fs.Setting(rate_hz=rate), hz, amplitude_v=TONE_V, count=WORDS)
        ]
    around = [k * fs.MOD_HZ + off for k in (1, 2) for off in np.linspace(-4000.0, 4000.0, 161)]
    hz = np.sort(np.concatenate([np.geomspace(10.0, 3e6, 1500), around]))
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.6, 4.6), layout="constrained")
        for row, rate in enumerate(TONES_HZ):
            ax = figure.add_subplot(2, 1, row + 1)
            setting = fs.Setting(rate_hz=rate)
            gain = np.array([fs.converter_gain(setting, f) for f in hz])
            for which, (unit, pole_hz) in enumerate(fs.UNITS.items()):
                colour = report_plots.SERIES[which]
                label = "with the board's 10 kHz" if pole_hz else "converter alone"
                ax.plot(hz, decibel(gain * np.array([fs.pole_gain(f, pole_hz) for f in hz])), color=colour, lw=1.0)
                own = [t for t in found if t.setting.rate_hz == rate]
                seen = decibel(np.array([t.seen_v[unit] for t in own]) / TONE_V)
                ax.plot([t.hz for t in own], seen, "o", ms=3.5, color=colour, label=label)
            ax.axhline(20.0 * np.log10(own[0].floor_v / TONE_V), color=report_plots.MUTED, lw=0.7, ls=":")
            ax.set_xscale("log")
            ax.set_ylim(LEAST_DB, 8.0)
            ax.set_ylabel(f"{rate} SPS, dB")
        ax.legend(loc="lower center", bbox_to_anchor=(0.5, -0.75), ncols=2)
        ax.set_xlabel("disturbance at the load, Hz (line: published; points: measured; dotted: noise of the record)")
        return figure


def allan_figure() -> Figure:
    """Board alone and a sensor whose zero walks, three settings."""
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.6, 3.6), layout="constrained")
        ax = figure.subplots()
        for which, (setting, seconds) in enumerate(ZEROS):
            with Bench.start(EXAMPLES / "filter_study_drift.yaml") as bench:
                z = fs.zero_of(bench, setting, seconds, TAUS_S)
            colour = report_plots.SERIES[which]
            taus_s = np.array(TAUS_S)
            white_v = np.array([allan.of_white(setting.density_v_rthz, tau) for tau in TAUS_S])
            walk_v = np.array([allan.of_walk(WALK_V_RTS, tau) for tau in TAUS_S])
            ax.plot(taus_s, 1e6 * white_v, color=colour, lw=0.9)
            ax.plot(taus_s, 1e6 * np.hypot(white_v, walk_v), color=colour, lw=0.9, ls="--")
            label = f"{setting.rate_hz} SPS, gain {setting.gain}"
            ax.plot(taus_s, 1e6 * z.allan_v[:, 0], "o", ms=4, color=colour, label=label)
            label = "the same, sensor walks"
            ax.plot(taus_s, 1e6 * z.allan_v[:, 1], "s", ms=4, mfc="none", color=colour, label=label)
        ax.set_xscale("log")
        ax.set_yscale("log")
        ax.set_xlabel("averaging time, s (lines: laws of white noise, dashed with the walk; points: readings)")
        ax.set_ylabel("Allan deviation, µV")
        ax.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8)
        return figure


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "docs/img")
    for name, figure in (("filter_response", response_figure()), ("filter_allan", allan_figure())):
        path = folder / f"{name}.svg"
        path.write_text(report_plots.standalone(report_plots.svg(figure, name)), encoding="utf-8")
        print(path)


if __name__ == "__main__":
    main()
