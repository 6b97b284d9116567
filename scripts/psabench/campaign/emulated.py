"""A run through the wire: an emulator of its own, the gyro unit and its PSA-2 on the bus, the host's procedure.

The virtual instrument of run k is drawn from the seed and k: heading and attitude of the vehicle, and the emulator's
own seed, from which it draws drift and errors. The truth is what this file put into the scenario.
"""

from __future__ import annotations

import json
import math
import random
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from psabench.bench import Bench
from psabench.campaign.setup import Setup, level_white_degph_rts
from psabench.errors import BadInput, LinkError
from psabench.nav import DEGPH
from psabench.places import proto_file
from psabench.procedures import gyrocompass
from psabench.procedures.gyrocompass import GyrocompassParams
from psabench.store import CELL, Rows
from psabench.wire_platform import WirePlatform

SCENARIO = "scenarios/gyrocompass.yaml"
SEED_BITS = 62
UNIT_DPS2 = 20.0  # of the unit's turns, its object 2101h; with 0 a set-up ignores what speeding up and braking take
UNIT_DPS, FAST_PROFILE, FAST_LIMIT_DPS = 18.0, "gyro_fast", 40.0  # quicker turns want stronger torquers


@dataclass(frozen=True, slots=True, kw_only=True)
class Instrument:
    """What is drawn for a run."""

    heading_deg: float
    pitch_deg: float
    roll_deg: float
    seed: int


def instrument(setup: Setup, seed: int, run: int) -> Instrument:
    """That of a run, the same each time."""
    draw = random.Random(f"{seed} {run}")
    heading_deg = draw.uniform(-180.0, 180.0)
    if setup.alpha1_deg is not None:
        heading_deg = setup.angles_deg[0] - setup.alpha1_deg
    if setup.tilt == "corners":
        pitch_deg, roll_deg = (setup.tilt_deg * draw.choice((-1, 1)) for _ in range(2))
    else:
        pitch_deg, roll_deg = (setup.tilt_deg * draw.uniform(-1.0, 1.0) for _ in range(2))
    return Instrument(heading_deg=heading_deg, pitch_deg=pitch_deg, roll_deg=roll_deg, seed=draw.getrandbits(SEED_BITS))


def check(setup: Setup) -> None:
    """Raises BadInput for what an instrument cannot be told to be."""
    white = level_white_degph_rts(setup.window_s)
    reasons = (
        (setup.slew_dps <= 0.0, "its turns take time: slew_dps is wanted"),
        (setup.gimbal == "alpha", "its platform turns about the gimbal: gimbal is uncorrected or corrected"),
        (setup.angle_sys in ("increment", "accumulates"), "its angle sensor has one zero: angle_sys is none or common"),
        (setup.slew_dps2 not in (0.0, UNIT_DPS2), f"its turns accelerate with slew_dps2={UNIT_DPS2:g}"),
        (setup.per_sample, "its errors are drawn once a position"),
        (
            setup.white_degph_rts not in (0.0, white),
            f"its noise is that of sensors and converters, white_degph_rts={white}, or 0",
        ),
        (setup.random_sign, "the signs of its systematic errors are those given"),
        (
            setup.beta_sys_arcmin != setup.gamma_sys_arcmin or setup.beta_random_arcmin != setup.gamma_random_arcmin,
            "both its level sensors have the same errors",
        ),
    )
    for wrong, reason in reasons:
        if wrong:
            raise BadInput(f"--chain emulated: {reason}")


class _Yaml12(yaml.SafeLoader):
    """PyYAML reads `on` as true; YAML 1.2 and the emulator read a word."""


_BOOL = "tag:yaml.org,2002:bool"
_Yaml12.yaml_implicit_resolvers = {
    first: [r for r in rules if r[0] != _BOOL or first in "tTfF"]
    for first, rules in yaml.SafeLoader.yaml_implicit_resolvers.items()
}


def scenario(setup: Setup, at: Instrument) -> dict[str, Any]:
    """The bench for a run: the scenario of the procedure's page with the set-up's numbers."""
    found: dict[str, Any] = yaml.load(proto_file(SCENARIO).read_text(encoding="utf-8"), _Yaml12)
    found["seed"] = at.seed
    found["site"]["latitude_deg"] = setup.latitude_deg
    # The gimbal begins at the first position: alpha is its angle less the heading.
    found["platform"] = {
        "alpha0_deg": _wrapped(setup.angles_deg[0] - at.heading_deg),
        "beta0_deg": 0.5,
        "drift_degph": [setup.drift_degph] * 2,
        "gm_sigma_degph": setup.gm_sigma_degph,
        "gm_tau_s": setup.gm_tau_s,
        "gm_from_zero": setup.gm_from_zero,
        "torquer_scale": [setup.torquer_scale] * 2,
        "level_tilt_arcmin": [setup.beta_sys_arcmin, setup.gamma_sys_arcmin],
        "level_repeat_arcmin": setup.beta_random_arcmin,
        "angle_zero_arcmin": setup.angle_sys_arcmin if setup.angle_sys == "common" else 0.0,
        "angle_set_arcmin": 0.0 if setup.encoder else setup.angle_random_arcmin,
        "angle_read_arcmin": setup.angle_random_arcmin if setup.encoder else 0.0,
    }
    if setup.slew_dps > UNIT_DPS:
        found["platform"]["torquer_limit_dps"] = FAST_LIMIT_DPS
        for unit in found["units"]:
            unit |= {"profile": FAST_PROFILE} if unit["board"] == "gyro" else {}
    if setup.white_degph_rts == 0.0:
        level = found["units"][0]
        level |= {"adc_noise_scale": 0, "temp_noise_scale": 0}
        for axis in level["axes"].values():
            axis["quartz"]["noise_a_rthz"] = 0
    found["vehicle"] = {"heading_deg": at.heading_deg, "pitch_deg": at.pitch_deg, "roll_deg": at.roll_deg}
    return found


def _wrapped(angle_deg: float) -> float:
    """Into (-180, 180]."""
    return 180.0 - (180.0 - angle_deg) % 360.0


def params(setup: Setup) -> GyrocompassParams:
    """The host's procedure. Raises BadInput where it cannot do it."""
    check(setup)
    try:
        return GyrocompassParams(
            sequence=",".join(repr(a) for a in setup.angles_deg),
            window_s=setup.window_s,
            settle_s=setup.settle_s,
            slew_dps=setup.slew_dps,
            latitude_deg=setup.latitude_deg + setup.latitude_error_arcmin / 60.0,
            method=setup.method.replace("_", "-"),
            angles="encoder" if setup.encoder else "set",
            cardan=setup.gimbal == "corrected",
            simplified=setup.simplified,
            calibrate_s=0.0,
            gm_sigma_degph=setup.gm_sigma_degph,
            gm_tau_s=setup.gm_tau_s,
            angle_sd_arcmin=setup.angle_random_arcmin,
            level_sd_arcmin=setup.gamma_random_arcmin,
        )
    except ValueError as e:
        raise BadInput(f"--chain emulated: {e}") from e


def runs(setup: Setup, seed: int, first_run: int, count: int) -> Rows:
    """Errors of the runs. The platform's own in position 1, which the wire does not tell, is NaN; so is a run without
    a heading."""
    p = params(setup)
    return np.stack([_errors(setup, p, instrument(setup, seed, first_run + k)) for k in range(count)]).astype(CELL)


class _Silent:
    """Progress of a run among many."""

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Callable[[], None]]:
        yield lambda: None


def _errors(setup: Setup, p: GyrocompassParams, at: Instrument) -> list[float]:
    with tempfile.TemporaryDirectory(prefix="psabench-") as folder:
        path = Path(folder) / "run.yaml"
        path.write_text(json.dumps(scenario(setup, at)), encoding="utf-8")  # YAML, too
        with Bench.start(path) as bench:
            try:
                r = gyrocompass.estimate(gyrocompass.measure(WirePlatform(bench), p, _Silent()), p)
            except LinkError:
                return [math.nan] * 4
    heading = _wrapped(math.degrees(r.heading_rad) - at.heading_deg)
    quality = r.compass.quality
    # As alpha, counter-clockwise, like the errors of the other chains.
    return [math.nan, -heading, r.compass.drift1_radps / DEGPH - setup.drift_degph, quality]
