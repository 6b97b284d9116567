"""A turn of a rate table as an inertial unit's increments of angle show it: docs/boards/bins.md."""

import numpy as np
from psabench.bench import Bench
from psabench.boards.bins.device import Bins, increments_of

with Bench.start("sins_table") as bench:
    unit = bench.board(Bins)
    unit.wait_ready()
    bench.table.rate(10.0)  # deg/s, about x
    bench.run_for(1.0)
    got = increments_of(unit.stream(1000), unit.weights())
    turned_deg = np.degrees(got.dtheta_rad.sum(axis=0))
    print(f"{len(got.seq)} readings, {got.whole.sum()} whole, {turned_deg[0]:.2f} deg about x")
