"""Find north over CAN: turn the platform to three azimuths, keep a window in each, fit heading and drifts.

Starts its own emulator. The estimate uses what the boards send; the scenario's heading is read only to compare.
"""

from psabench import Bench
from psabench.procedures.gyrocompass import estimate, measure
from psabench.procedures.gyrocompass_params import params_of
from psabench.procedures.head_bench import Silent
from psabench.procedures.wire_platform import WirePlatform

with Bench.start("gyrocompass", seed=1) as bench:
    params = params_of("article", {"latitude_deg": 50.0})
    windows = measure(WirePlatform(bench, signals=params.signals), params, Silent())
    result = estimate(windows, params)
    for name in ("heading_deg", "drift1_degph", "pitch_deg"):
        found = result.get(name)
        print(f"{name:12} {found.value:9.3f} +- {found.ci_half:.3f} {found.unit}")
    print(f"{result.duration_s:.0f} s of simulated time")
    print(f"true heading {bench.truth_state()['vehicle']['heading_deg']:.3f} deg")
