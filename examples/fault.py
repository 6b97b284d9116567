from psabench import Bench
from psabench.errors import BenchError

with Bench.start("quiet") as bench:
    bench.unit.wait_ready()
    healthy_v = bench.unit.stream(1).axis("x")[0]
    with bench.fault("sensor.bias", "a.sensor.x", bias_v=0.1):
        bench.wait(0.1)  # the filters settle
        print(f"{bench.unit.stream(1).axis('x')[0] - healthy_v:.4f} V")
    try:
        bench.fault("sensor.bias", "a.line.CLK", bias_v=0.1)
    except BenchError as e:
        print(e)
