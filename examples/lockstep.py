"""Time that moves only when the host says so: to the instant of an event, a line's level there, a recording."""

from psabench import Bench

with Bench.start("quiet", seed=1) as bench:
    bench.unit.wait_ready()
    with bench.trace("build/lockstep.vcd") as vcd:  # edges are made while somebody looks
        bench.step()
        frame_s = bench.run_until("DRD_A")
        for event in ("INT_FALL", "INT_RISE", "DRD_A"):
            after_us = (bench.run_until(event, limit_s=0.01) - frame_s) * 1e6
            print(f"{event:8} {after_us:8.3f} us after DRD_A, Int is {bench.probe.lines()['Int']}")
        bench.run_for(0.005)
    print(f"{bench.time_s:.6f} s of simulated time; {vcd} has {vcd.read_text().count('$var')} lines")
