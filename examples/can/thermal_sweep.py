"""Step a thermal chamber from -40 to +60 degC and fit the zero of an axis as a straight line of temperature.

Starts its own emulator: half an hour in the chamber takes seconds. The chamber speaks SCPI, as in a laboratory.
"""

import numpy as np
from psabench import Bench

POINTS_DEGC = (-40.0, -20.0, 0.0, 20.0, 40.0, 60.0)
SOAK_S = 300.0  # five time constants of the sensor behind its case

with Bench.start("chamber_sweep", seed=1) as bench:
    unit, chamber = bench.unit, bench.chamber
    unit.wait_ready()
    bench.wait(12.0)  # the scenario sets the chamber at 10 s; from here on it is ours
    x_v = []
    for temp_degc in POINTS_DEGC:
        chamber.set(temp_degc, wait=True)
        bench.wait(SOAK_S)
        x_v.append(unit.stream(100).axis("x").mean())
        print(f"{temp_degc:6.1f} degC  X {x_v[-1]:.6f} V")
    slope, zero = np.polyfit(np.array(POINTS_DEGC) - 25.0, x_v, 1)
    residual = np.ptp(x_v - np.polyval([slope, zero], np.array(POINTS_DEGC) - 25.0))
    print(f"{zero:.6f} V at 25 degC, {slope * 1e3:.4f} mV/K, residuals within {residual * 1e6:.1f} uV")
    print(f"{bench.time_s / 60:.0f} minutes of simulated time")
