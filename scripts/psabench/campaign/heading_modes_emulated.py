"""A flight of the heading indicator's modes through the full chain: an emulator, the bus, the host's procedure."""

from __future__ import annotations

import json
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psabench.bench import Bench
from psabench.campaign.emulated import resolved
from psabench.campaign.heading_modes import Row, draw_instruments
from psabench.places import proto_file
from psabench.procedures.gyrocompass_params import GyrocompassParams, params_of
from psabench.procedures.heading_modes import Flown, ModeParams, fly_mode
from psabench.procedures.platform_bench import Floats
from psabench.procedures.wire_platform import WirePlatform

SCENARIO = "scenarios/heading_modes.yaml"
LEVELS_S = 2.0  # of a vehicle that tilts by 2 deg/s
Scenario = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Trip:
    """What a mode showed, and how far off it was."""

    flown: Flown
    error_deg: Floats


def run_scenario(row: Row, seed: int, run: int) -> Scenario:
    """The shipped scenario with what is drawn of that instrument."""
    drawn = draw_instruments(seed, run, 1)
    found: Scenario = json.loads(resolved(str(proto_file(SCENARIO))))
    found["seed"] = int(drawn.seeds[0])
    found["platform"]["drift_degph"][1] = float(drawn.drift2_degph[0])
    found["platform"] |= {"gm_sigma_degph": row.gm_sigma_degph, "gm_from_zero": row.gm_from_zero}
    found["magnetic"]["declination_deg"] -= float(drawn.chart_deg[0])  # the crew's chart says more
    found["magnetic"]["deviation_deg"] = drawn.deviation_deg[0].tolist()
    return found


def compass_params(row: Row, p: ModeParams) -> GyrocompassParams:
    reading = "improved" if row.compass[0] == "improved" else "article"
    return params_of(reading, {"latitude_deg": p.latitude_deg})


def fly_run(row: Row, p: ModeParams, seed: int, run: int, bench: Scenario | None = None) -> Trip:
    """Run `run` of a row. bench: another scenario in place of the run's own."""
    with tempfile.TemporaryDirectory(prefix="psabench-") as folder:
        path = Path(folder) / "run.yaml"
        path.write_text(json.dumps(bench or run_scenario(row, seed, run)), encoding="utf-8")  # YAML, too
        with Bench.start(path) as b:
            return _fly_bench(b, row, p)


def _fly_bench(b: Bench, row: Row, p: ModeParams) -> Trip:
    true_deg: list[float] = []

    def depart() -> None:
        # Level before it moves: levelled in the take-off, the two tilts at once turn the platform by up to 0.1 deg.
        b.control.call("vehicle.attitude", heading_deg=0.0, pitch_deg=0.0, roll_deg=0.0)
        b.run_for(LEVELS_S)
        b.control.call("vehicle.fly", speed_mps=p.speed_mps, track_deg=0.0)

    def watch() -> None:
        true_deg.append(float(b.truth_state()["vehicle"]["heading_deg"]))

    flown = fly_mode(WirePlatform(b), row.mode, p, compass_params(row, p), depart=depart, watch=watch)
    off_deg = np.degrees(flown.heading_rad) - np.array(true_deg)
    return Trip(flown=flown, error_deg=(off_deg + 180.0) % 360.0 - 180.0)
