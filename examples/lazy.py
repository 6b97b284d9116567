"""A minute that no one looks at, then twenty readings: the same with every conversion computed (--eager)."""

import sys

from psabench import Bench

with Bench.start("calibrate", extra=sys.argv[1:]) as bench:
    bench.run_for(60.0)
    eager = bench.control.call("units").result["units"][0]["eager"]
    print("eager:", eager or "no")
    print(f"X after a minute: {bench.unit.stream(20).axis('x').mean():.9f} V")
