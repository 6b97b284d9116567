"""A batch of runs of one bench that is warm: the same unit, other noise in each."""

from psabench import Bench

with Bench.start("stream") as bench:
    bench.run_for(0.5)
    for seed in range(2, 6):
        with bench.fork(seed=seed) as child:
            child.run_for(0.1)
            print(f"seed {seed}: {child.unit.stream(20).axis('x').mean():.9f} V")
