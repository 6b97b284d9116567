"""One bench, three futures: as it is, restored from a file, and forked to see what a fault would do."""

from pathlib import Path

from psabench import Bench

path = Path("build/run/half.snapshot")
path.parent.mkdir(parents=True, exist_ok=True)


def next_volts(bench: Bench) -> str:
    """Mean of X over the next 20 readings."""
    return f"{bench.unit.stream(20).axis('x').mean():.9f} V"


with Bench.start("stream") as bench:
    bench.run_for(0.5)
    bench.snapshot(path)
    with bench.fork() as other:
        other.fault("sensor.bias", "a.sensor.x", bias_v=0.1)
        print("with a fault ", next_volts(other))
    print("without      ", next_volts(bench))
with Bench.restore(path) as again:
    print("from the file", next_volts(again))
