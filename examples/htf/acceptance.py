"""Acceptance of a unit in OpenHTF: the bench is a plug, scale and zero are measurements with limits.

acceptance.py [FOLDER [FAULT-BIAS-V]]: the record of the test as JSON in FOLDER (build/run/openhtf). With a bias, the
sensor's zero steps by so many volts before it is measured, and the unit fails. On a real bench, BenchPlug opens
`Bench.connect("slcan:/dev/ttyACM0", scpi={"head": ...})` instead.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import openhtf as htf
from openhtf.output.callbacks import json_factory
from openhtf.plugs import BasePlug
from psabench import Bench


class BenchPlug(BasePlug):
    """A bench for as long as the test of one unit lasts."""

    def __init__(self) -> None:
        super().__init__()
        self.bench = Bench.start("quiet", seed=1)

    def tearDown(self) -> None:
        self.bench.close()


@htf.plug(plug=BenchPlug)
def power_up(test: Any, plug: BenchPlug) -> None:
    plug.bench.unit.wait_ready()
    test.logger.info("board ready at %.3f s of simulated time", plug.bench.time_s)


@htf.PhaseOptions(name="two_positions")
@htf.plug(plug=BenchPlug)
@htf.measures(
    htf.Measurement("scale_v_per_g").in_range(0.999, 1.001).with_precision(6),
    htf.Measurement("zero_v").in_range(2.499, 2.501).with_precision(6),
)
def two_positions(test: Any, plug: BenchPlug, bias_v: float = 0.0) -> None:
    """V per g and V: from a_x = -g sin alpha at -90 and 90 deg."""
    bench = plug.bench
    if bias_v:
        bench.faults.add("sensor.bias", "a.sensor.x", bias_v=bias_v)
    u_v = {}
    for angle_deg in (-90.0, 90.0):
        bench.head.turn(angle_deg)
        bench.wait(0.1)  # the filters settle
        u_v[angle_deg] = bench.unit.stream(100).axis("x").mean()
    test.measurements.scale_v_per_g = (u_v[-90.0] - u_v[90.0]) / 2
    test.measurements.zero_v = (u_v[-90.0] + u_v[90.0]) / 2


def main(folder: Path, bias_v: float) -> int:
    """0: the unit passed, 1: it did not."""
    folder.mkdir(parents=True, exist_ok=True)
    test = htf.Test(power_up, two_positions.with_args(bias_v=bias_v), test_name="psa2 acceptance")
    test.add_output_callbacks(json_factory.OutputToJSON(str(folder / "{dut_id}.json"), indent=2))
    return 0 if test.execute(test_start=lambda: "unit-1") else 1


if __name__ == "__main__":
    out, bias = [*sys.argv[1:], *("build/run/openhtf", "0")[len(sys.argv) - 1 :]][:2]
    sys.exit(main(Path(out), float(bias)))
