"""Scenarios of a season: one drawn unit, whose persistent errors are the same in each flight of it.

This is the side of the bench: an operator who sets up emulators. The host knows nothing of it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import yaml

from psabench.errors import BadInput, expected, input_error
from psabench.koi.autocal import InstrumentClass
from psabench.link.own import replace_file
from psabench.link.signals import Floats
from psabench.native.nav import DEGPH
from psabench.places import proto_file

FLIGHT_SEEDS = 1000  # of a season's flights behind one another


def draw_persistent(kind: InstrumentClass, seed: int) -> Floats:
    """Errors of a unit that stay, (m,), as kind.names."""
    return np.asarray(np.random.default_rng(seed).normal(size=len(kind.names)) * kind.persistent_sd)


def flight_scenario(base: str, kind: InstrumentClass, persistent: Floats, path: Path) -> None:
    """Write the scenario with a unit that has these errors; the emulator's seed draws what changes from run to run.

    Raises BadInput for a scenario without an inertial unit, OutputError.
    """
    scenario = _read_scenario(base)
    units = [u for u in scenario.get("units") or [] if isinstance(u, dict) and u.get("board") == "bins"]
    if len(units) != 1:
        raise BadInput(expected("one inertial unit", len(units), base))
    units[0].setdefault("profile_set", {}).update(_unit_profile(kind, persistent))
    for unit in scenario["units"]:
        unit["on"] = unit.pop(True, unit.pop("on", None))  # `on` is true in YAML 1.1
    replace_file(path, yaml.safe_dump(scenario, sort_keys=False, width=100))


def _read_scenario(base: str) -> dict[str, Any]:
    path = Path(base) if base.endswith(".yaml") else proto_file(f"scenarios/{base}.yaml")
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as e:
        raise input_error(base, "a scenario", e) from e
    except yaml.YAMLError as e:
        raise BadInput(expected("YAML", str(e).splitlines()[0], base)) from e
    if not isinstance(found, dict):
        raise BadInput(expected("a scenario", type(found).__name__, base))
    return found


def _unit_profile(kind: InstrumentClass, persistent: Floats) -> dict[str, Any]:
    """Given errors, and the spread of what is drawn beside them."""
    values = dict(zip(kind.names, persistent.tolist(), strict=True))
    spread = dict(zip(kind.names, kind.run_sd.tolist(), strict=True))
    matrices = {
        name: [values.get(f"{name}{i}{j}", 0.0) for i in (1, 2, 3) for j in (1, 2, 3)] for name in ("gamma", "theta")
    }
    return {
        "gyro_bias_degph": [values[f"nu{i}_radps"] / DEGPH for i in (1, 2, 3)],
        "gyro_bias_sd_degph": spread["nu1_radps"] / DEGPH,
        "accel_bias_mps2": [values[f"df{i}_mps2"] for i in (1, 2, 3)],
        "accel_bias_sd_mps2": spread["df1_mps2"],
        "accel_gamma": matrices["gamma"],
        "gyro_theta": matrices["theta"],
        **dict.fromkeys(("gyro_scale_sd", "accel_scale_sd"), 0.0),
        **dict.fromkeys(("gyro_misalignment_sd_arcmin", "accel_misalignment_sd_arcmin"), 0.0),
    }
