#!/usr/bin/env python3
"""Draw the pictures of docs/boards/pik.md and docs/procedures/compare_converters.md into docs/img, from the emulator.

The pulses are those of its VCD file; the output of the integrator is computed here from the input and the parts
of the profile. Prints the table of the procedure's page. Same emulator, same bytes.

    tools/plots/converters.py [docs/img]
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from psabench.link.vcd import Vcd, read_vcd
from psabench.places import find_emulator
from psabench.procedures import comparison
from psabench.procedures.compare_converters import CompareParams
from psabench.progress import Bar
from psabench.report import comparison_page
from psabench.report import plots as report_plots

INPUT_V = {"X": 3.0, "Y": -1.0, "Z": 9.0}
SCENARIO = """\
seed: 1
units:
  - name: p
    board: pik6
    profile_set:
      {zero_v: 0, uref_tol_ppm: 0, ratio_tol_ppm: 0, asymmetry_ppm: 0, c_tol_pct: 0, clock_tol_ppm: 0, noise_v_rthz: 0}
    axes:
      x: {sensor: mems, u0_v: 3.0, kx_v_per_g: 1.0e-9}
      y: {sensor: mems, u0_v: -1.0, kx_v_per_g: 1.0e-9}
      z: {sensor: mems, u0_v: 9.0, kx_v_per_g: 1.0e-9}
"""
TCLK_S, STEP_V, UC_V = 25e-6, 10.0 * 25e-6 / (10e3 * 4.7e-9), 3.9
FROM_S, TO_S = 0.0100, 0.0115


def vcd_of_pulses() -> Vcd:
    with tempfile.TemporaryDirectory() as folder:
        scenario, out = Path(folder) / "pulses.yaml", Path(folder) / "pulses.vcd"
        scenario.write_text(SCENARIO, encoding="utf-8")
        command = [str(find_emulator()), str(scenario), "--vcd", str(out)]
        subprocess.run(
            [*command, *"--pace free --for 12ms --can none --quiet".split()], check=True, capture_output=True
        )
        return read_vcd(out)


def edges_s(vcd: Vcd, name: str) -> list[tuple[float, int]]:
    wire = vcd.wires[name]
    return [(float(t) * 1e-9, int(v)) for t, v in zip(wire.t_ns, wire.level, strict=True)]


def integrator_v(axis: str, pulses_s: list[float], t_s: np.ndarray) -> np.ndarray:
    """Us: input, less the charge of each reset spread over TCLK. It inverts; drawn the way of the input."""
    k = 10e3 / (20e3 * 10.0 * TCLK_S)  # Rr / (RIN UREF TCLK)
    sign = np.sign(INPUT_V[axis])
    removed = sum((np.clip((t_s - p) / TCLK_S, 0.0, 1.0) for p in pulses_s), np.zeros_like(t_s))
    return np.asarray((k * INPUT_V[axis] * t_s - sign * removed) * STEP_V)


def pulses_picture() -> str:
    vcd = vcd_of_pulses()
    with matplotlib.rc_context(report_plots.STYLE):
        figure = Figure(figsize=(7.4, 5.2), layout="constrained")
        axes = figure.subplots(6, 1, sharex=True, height_ratios=[3, 1, 3, 1, 3, 1])
        for i, (axis, volts) in enumerate(INPUT_V.items()):
            line = f"F{axis}{'P' if volts > 0 else 'N'}"
            colour = report_plots.SERIES[i]
            edges = edges_s(vcd, line)
            t_s = np.linspace(FROM_S, TO_S, 3001)
            us_v = integrator_v(axis, [t for t, v in edges if v], t_s)
            top, bottom = axes[2 * i], axes[2 * i + 1]
            top.plot((t_s - FROM_S) * 1e6, us_v, lw=1.0, color=colour)
            top.axhline(np.sign(volts) * UC_V, lw=0.8, ls="--", color=report_plots.MUTED)
            top.set_ylabel("V")
            top.set_title(f"{axis}: input {volts:g} V, integrator (dashed: Uc)")
            t, v = [(x - FROM_S) * 1e6 for x, _ in edges], [y for _, y in edges]
            bottom.step(t, v, where="post", lw=1.0, color=colour)
            bottom.set_ylabel(line)
            bottom.set_yticks([])
        axes[-1].set_xlim(0.0, (TO_S - FROM_S) * 1e6)
        axes[-1].set_xlabel("µs")
        return report_plots.svg(figure, "pik_pulses")


def main() -> None:
    out = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).resolve().parents[2] / "docs/img")
    pictures = {"pik_pulses": pulses_picture()}
    with tempfile.TemporaryDirectory() as folder:
        c = comparison.compare(Path(folder), CompareParams(), Bar())
    pictures |= zip(("compare_figures", "compare_errors", "compare_motion"), comparison_page.figures(c), strict=True)
    for name, text in pictures.items():
        (out / f"{name}.svg").write_text(report_plots.standalone(text), encoding="utf-8")
    print(comparison.console_table(c))
    for title, times in comparison.finer(c):
        print(f"{title:8} {times:.4g} times finer")


if __name__ == "__main__":
    main()
