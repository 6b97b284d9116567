#!/usr/bin/env python3
"""Draw docs/img/pmka_waveform.svg: the integrators' voltages over the beats tau1..tau5 of four T0 (article, figure 5).

    tools/plots/pmka_waveform.py [docs/img/pmka_waveform.svg]

From the real-valued channels of a VCD. Prints the levels at t1, t2, t3 that the article's figure marks. Same bytes each
time.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts")]

from psabench import Bench  # noqa: E402 of this tree
from psabench.boards.pmka import estimate as est  # noqa: E402 of this tree
from psabench.boards.pmka.device import Pmka  # noqa: E402
from psabench.link.vcd import Vcd, read_vcd  # noqa: E402
from psabench.link.vcd_reals import Real, read_reals  # noqa: E402
from psabench.report import plots as report_plots  # noqa: E402 of this tree

T0_TS = 3  # Ts in a machine cycle: ours, E0
BEAT_T0 = 4  # article, the text after figure 5
TS_NS = 4_800_000
BEAT_NS = BEAT_T0 * T0_TS * TS_NS
SCENARIO = f"""
seed: 4
site: {{g_mps2: 9.8}}
units:
  - name: a
    board: pmka
    profile_set: {{beat_periods: {T0_TS * BEAT_T0}, zero_periods: 3}}
    axes:
      x: {{sensor: mems, u0_v: 2.6, kx_v_per_g: 0.0}}
      y: {{sensor: mems, u0_v: -1.7, kx_v_per_g: 0.0}}
      z: {{sensor: mems, u0_v: 1.1, kx_v_per_g: 0.0}}
"""
Array = np.ndarray[Any, Any]
NAMES = ("U_X", "U_Y", "U_Z", "U_K")
KEYS = ("KL1", "KL2", "KL3")


def record() -> tuple[Vcd, dict[str, Real]]:
    """Lines and voltages of the first second."""
    with tempfile.TemporaryDirectory() as where:
        scenario, file = Path(where) / "beats.yaml", Path(where) / "beats.vcd"
        scenario.write_text(SCENARIO, encoding="utf-8")
        with Bench.start(scenario, extra=["--vcd", file, "--vcd-analog"]) as bench:
            bench.board(Pmka).wait_ready()
            bench.wait(1.0)
        return read_vcd(file), read_reals(file)


def hand_overs(vcd: Vcd) -> tuple[int, list[int]]:
    """Where a beat tau1 begins, ns, and t1, t2, t3 of it: the keys of X, Y, Z open."""
    begin = int(vcd.wires["TAU2"].edges_ns(0)[0])  # 5 is followed by 1
    opens = [vcd.wires[key].edges_ns(0) for key in KEYS]
    return begin, [int(t[t > begin][0]) for t in opens]


def draw_voltage(ax: Axes, t_ms: Array, volts: Array, serves: Array) -> None:
    """Straight from value to value, which is exact for steady inputs; its colour says whose input it has."""
    colours = (report_plots.MUTED, *report_plots.SERIES[:3])
    for who, colour in enumerate(colours):
        for first, last in est.runs(serves == who):
            ax.plot(t_ms[first : last + 2], volts[first : last + 2], color=colour, lw=1.3)


def served(vcd: Vcd, channel: int, t_ns: Array) -> Array:
    """Axis + 1 that an integrator has after each instant, by the keys; 0: none."""
    if channel < 3:
        return np.where(vcd.wires[KEYS[channel]].at(t_ns) == 1, channel + 1, 0)
    has_k = vcd.wires["KL4"].at(t_ns) == 1
    away = [vcd.wires[key].at(t_ns) == 0 for key in KEYS]
    return np.where(has_k, np.select(away, [1, 2, 3], 0), 0)


def draw_row(ax: Axes, vcd: Vcd, reals: dict[str, Real], channel: int, begin_ns: int) -> None:
    """One integrator over the five beats; dotted: T0."""
    r = reals[NAMES[channel]]
    inside = (r.t_ns >= begin_ns) & (r.t_ns <= begin_ns + 5 * BEAT_NS)
    t_ns, volts = r.t_ns[inside], r.value[inside]
    draw_voltage(ax, (t_ns - begin_ns) * 1e-6, volts, served(vcd, channel, t_ns))
    for cycle in range(5 * BEAT_T0 + 1):
        width = 0.8 if cycle % BEAT_T0 == 0 else 0.3
        ax.axvline(cycle * T0_TS * TS_NS * 1e-6, color=report_plots.MUTED, lw=width, ls=":")
    for level in (-3.5, 3.5):
        ax.axhline(level, color=report_plots.MUTED, lw=0.5, ls="--")
    ax.set_ylabel(f"{NAMES[channel].replace('_', ' ')}, V")


def levels(reals: dict[str, Real], at_ns: list[int]) -> list[tuple[int, float, float]]:
    """t1, t2, t3, ns, with the voltage of X, Y, Z and that of K."""
    return [(t, reals[f"U_{axis}"].at(t), reals["U_K"].at(t)) for t, axis in zip(at_ns, "XYZ", strict=True)]


def mark(ax: Axes, t_ms: float, volts: float, label: str) -> None:
    """A level of the article's figure."""
    ax.plot(t_ms, volts, "o", ms=3.5, color=report_plots.SERIES[3])
    ax.annotate(label, (t_ms, volts), (3, 5), textcoords="offset points", fontsize=8)


def figure_of(vcd: Vcd, reals: dict[str, Real]) -> tuple[Figure, list[str]]:
    """A row an integrator, with t1..t3 and the levels of both integrators there, which are the text, too."""
    begin_ns, at_ns = hand_overs(vcd)
    says = []
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.6, 5.8), layout="constrained")
        rows = figure.subplots(4, 1, sharex=True, sharey=True)
        for channel, ax in enumerate(rows):
            draw_row(ax, vcd, reals, channel, begin_ns)
        for n, (t_ns, axis_v, k_v) in enumerate(levels(reals, at_ns), start=1):
            t_ms, axis = (t_ns - begin_ns) * 1e-6, "XYZ"[n - 1]
            mark(rows[n - 1], t_ms, axis_v, f"U{axis}{n} t{n}")
            mark(rows[3], t_ms, k_v, f"UK{n} t{n}")
            says.append(f"t{n} {t_ms:.2f} ms: U{axis}{n} {axis_v:+.3f} V, UK{n} {k_v:+.3f} V")
        for beat in range(5):
            rows[0].annotate(f"τ{beat + 1}", ((beat + 0.5) * BEAT_NS * 1e-6, 6.3), ha="center", fontsize=9)
        rows[0].set_ylim(-6, 8)
        for who, name in enumerate(("out of work: zero, resets", "has X", "has Y", "has Z")):
            rows[3].plot([], [], color=(report_plots.MUTED, *report_plots.SERIES[:3])[who], lw=2.0, label=name)
        rows[3].legend(loc="upper center", bbox_to_anchor=(0.5, -0.42), ncols=4)
        rows[3].set_xlabel(f"time, ms (dotted: T0 = {T0_TS} Ts; dashed: ±Uc)")
        return figure, says


def main() -> None:
    path = Path(sys.argv[1] if len(sys.argv) > 1 else ROOT / "docs/img/pmka_waveform.svg")
    figure, says = figure_of(*record())
    path.write_text(report_plots.standalone(report_plots.svg(figure, "pmka_waveform")), encoding="utf-8")
    print("\n".join([*says, str(path)]))


if __name__ == "__main__":
    main()
