"""What the drift of an integrator's capacitor costs on a PMKA, and what measuring its K_IN at work saves.

.venv/bin/python examples/pmka_k_in.py

A chamber warms three units from 20 to 60 degC. The host knows what it gave them, 1.2, -0.6 and 0.3 V, reads their
frames, and computes the same readings three times: with the reset of the printed parts, with that of the first
rotation, with each rotation's.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from psabench import Bench
from psabench.boards.pmka import estimate as est
from psabench.boards.pmka import k_in
from psabench.boards.pmka.device import Pmka

INPUT_V = (1.2, -0.6, 0.3)
COUNT = 18_750  # readings: 90 s
LAST = 2_000
WAYS = ("printed", "once", "at work")
ROW = "{:<6} {:<8} {:>12} {:>12} {:>12} {:>12} {:>9} {:>9}"


def readings(bench: Bench) -> dict[str, tuple[est.Periods, est.Rom]]:
    """Of each unit: what it sent while the chamber warmed up, and its ROM."""
    units = {name: bench.board(Pmka, name) for name in ("still", "usual", "poor")}
    for unit in units.values():
        unit.wait_ready()
    roms = {name: est.rom_of(unit.rom_words()) for name, unit in units.items()}
    for unit in units.values():
        unit.frames.forget()
        unit.start()
    bench.wait(6.0)  # a rotation before the warm-up
    bench.chamber.set(60.0)
    bench.host.pump_until(lambda: all(len(u.frames) >= COUNT for u in units.values()), 100.0)
    return {n: (est.periods_of(u.frames.take().head(COUNT).columns), roms[n]) for n, u in units.items()}


def velocity_errors_mps(p: est.Periods, rom: est.Rom, calibrations: list[est.Calibration]) -> est.Floats:
    """Between the first and the last reading at which every axis is on its own integrator."""
    home = p.serves[:, 3] == 0
    both = np.flatnonzero(home & np.roll(home, 1))[1:]
    first, last = int(both[0]), int(both[-1])
    integral = est.integrals_vs(p, rom, calibrations)
    exact = np.array(INPUT_V) * rom.ts_s * (last - first)
    return est.velocity_mps(integral[last] - integral[first] - exact, ma_v_per_g=1.2, g_mps2=9.8)


def main() -> None:
    with Bench.start(Path(__file__).with_suffix(".yaml")) as bench:
        recorded = readings(bench)
    print("K_IN of integrator X from frames, 1/s: in the first rotation, in the last")
    for name, (p, rom) in recorded.items():
        cal = est.calibrate(p, 0)
        k = k_in.k_in_per_s(cal, rom, 0, p.degc, cal.nr_at[[0, -1]])
        print(f"{name:<6} {k[0]:.3f} {k[1]:.3f}, {1e6 * (k[1] / k[0] - 1):+.0f} ppm at {p.degc[-1] - p.degc[0]:+.1f} K")
    print("\nerrors of increments at the end, ppm; of velocity, mm/s")
    print(ROW.format("unit", "K_IN", "X ppm", "Y ppm", "Z ppm", "X mm/s", "Y mm/s", "Z mm/s"))
    for name, (p, rom) in recorded.items():
        each = [est.calibrate(p, i) for i in range(4)]
        ways = ([k_in.printed(c, rom) for c in each], [k_in.held(c) for c in each], each)
        for way, cals in zip(WAYS, ways, strict=True):
            ppm = 1e6 * k_in.error_of_increments(p, rom, cals, INPUT_V, LAST)
            mmps = 1e3 * velocity_errors_mps(p, rom, cals)
            print(ROW.format(name, way, *(f"{v:.0f}" for v in ppm), *(f"{v:.2f}" for v in mmps)))


if __name__ == "__main__":
    main()
