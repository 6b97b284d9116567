"""A run through the full chain: an emulator of its own, the gyro unit and its PSA-2 on the bus, the host's procedure.

The virtual instrument of run k is drawn from the seed and k: heading and attitude of the vehicle, and the emulator's
own seed, from which it draws drift and errors. The truth is what this file put into the scenario. Two chains: the
emulator alone in free pace, its bus recorded (`recorded_platform`), and live over socketcand (`wire_platform`); the
host's procedure is the same.
"""

from __future__ import annotations

import json
import math
import random
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from psabench.bench import Bench
from psabench.campaign.setup import BEFORE_S, Setup, level_white_degph_rts
from psabench.campaign.store import CELL, Rows
from psabench.errors import BadInput, DeviceError, LinkError, expected
from psabench.estimate.angles import wrapped_deg
from psabench.native.nav import DEGPH
from psabench.places import find_emulator, proto_file
from psabench.procedures import gyrocompass
from psabench.procedures.gyrocompass_params import GyrocompassParams
from psabench.procedures.head_bench import Silent
from psabench.procedures.host_script import Plates
from psabench.procedures.platform_bench import PlatformBench
from psabench.procedures.recorded_platform import RecordedPlatform
from psabench.procedures.wire_platform import WirePlatform

OPTION = "--chain emulated or wire"  # of the command line
SCENARIO = "scenarios/gyrocompass.yaml"
SEED_BITS = 62
FIRST_TURN_DEG = 1.0  # the gimbal begins at the first position, but for its errors
UNIT_DPS2 = 20.0  # of the unit's turns, its object 2101h; with 0 a set-up ignores what speeding up and braking take
UNIT_DPS, FAST_PROFILE, FAST_LIMIT_DPS = 18.0, "gyro_fast", 40.0  # quicker turns want stronger torquers

# Fields of a set-up that have the same names elsewhere: in a scenario's platform, in the host's procedure.
OF_PLATFORM = ("gm_sigma_degph", "gm_tau_s", "gm_from_zero")
OF_PROCEDURE = ("window_s", "settle_s", "slew_dps", "m1_per_s", "m2_per_s", "simplified", "gm_sigma_degph", "gm_tau_s")

Scenario = dict[str, Any]


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
    white = level_white_degph_rts(setup.window_s, setup.m1_per_s)
    beta, gamma = setup.beta_random_arcmin, setup.gamma_random_arcmin
    wrong = (
        (setup.slew_dps <= 0.0, "slew_dps", "a rate above 0 (a turn takes time)", setup.slew_dps),
        (setup.m2_per_s <= 0.0, "m2_per_s", "the gain of the azimuth loop, as 2", setup.m2_per_s),
        (setup.gimbal == "alpha", "gimbal", "uncorrected or corrected", setup.gimbal),
        (setup.angle_sys in ("increment", "accumulates"), "angle_sys", "none or common", setup.angle_sys),
        (setup.slew_dps2 not in (0.0, UNIT_DPS2), "slew_dps2", f"0 or {UNIT_DPS2:g}", setup.slew_dps2),
        (setup.per_sample, "per_sample", "no (errors are drawn once a position)", "yes"),
        (
            not setup.scenario and setup.white_degph_rts not in (0.0, white),
            "white_degph_rts",
            f"{white} (the noise of the sensors and converters) or 0",
            setup.white_degph_rts,
        ),
        (setup.random_sign, "random_sign", "no (systematic errors keep their signs)", "yes"),
        (beta != gamma, "beta_random_arcmin", f"gamma_random_arcmin = {gamma:g} (the level sensors are alike)", beta),
    )
    for found, name, what, value in wrong:
        if found:
            raise BadInput(expected(what, value, f"{OPTION}: {name}"))


# ---- scenarios


@cache
def resolved(path: str) -> str:
    """A scenario with every key, as JSON. Raises BadInput with the emulator's own words."""
    done = subprocess.run([str(find_emulator()), path, "--dump"], capture_output=True, text=True, check=False)
    if done.returncode:
        raise BadInput(done.stderr.strip().removeprefix("psa-emu: "))
    return done.stdout


def setup_of(path: Path) -> Setup:
    """The set-up that a scenario of one's own represents: its latitude and its platform's errors.

    The vehicle is anywhere, tilted within its default range; of the article only the schedule is left. Raises
    BadInput for a scenario that has no such instrument.
    """
    text = resolved(str(path))
    s: Scenario = json.loads(text)
    boards = {u["board"] for u in s.get("units", [])}
    if "platform" not in s or not {"gyro", "psa2"} <= boards:
        raise BadInput(expected("a platform, a gyro unit and the PSA-2 of its levels", None, f"--scenario {path}"))
    p = s["platform"]
    if p["torquer_scale"][0] != p["torquer_scale"][1]:
        raise BadInput(expected("one torquer_scale for both axes", p["torquer_scale"], f"--scenario {path}"))
    return Setup(
        scenario=text,
        latitude_deg=s["site"]["latitude_deg"],
        gimbal="corrected",
        drift_degph=p["drift_degph"][0],
        **{name: p[name] for name in OF_PLATFORM},
        torquer_scale=p["torquer_scale"][0],
        beta_sys_arcmin=p["level_tilt_arcmin"][0],
        gamma_sys_arcmin=p["level_tilt_arcmin"][1],
        beta_random_arcmin=p["level_repeat_arcmin"],
        gamma_random_arcmin=p["level_repeat_arcmin"],
        angle_sys="common" if p["angle_zero_arcmin"] else "none",
        angle_sys_arcmin=-p["angle_zero_arcmin"],
        angle_random_arcmin=p["angle_set_arcmin"],
        slew_dps=9.0,
        settle_s=12.0,
        m2_per_s=2.0,
        gm_before_s=BEFORE_S,
        white_degph_rts=level_white_degph_rts(Setup().window_s),
    )


def scenario(setup: Setup, at: Instrument) -> Scenario:
    """The bench for a run: the shipped scenario or one's own, with the set-up's numbers."""
    found: Scenario = json.loads(setup.scenario or resolved(str(proto_file(SCENARIO))))
    found |= {"seed": at.seed, "start": True}
    found["site"]["latitude_deg"] = setup.latitude_deg
    second = found["platform"]["drift_degph"][1] if setup.scenario else setup.drift_degph
    # The gimbal begins at the first position: alpha is its angle less the heading.
    found["platform"] |= {
        "alpha0_deg": wrapped_deg(setup.angles_deg[0] - at.heading_deg),
        "beta0_deg": 0.5,
        "drift_degph": [setup.drift_degph, second],
        **{name: getattr(setup, name) for name in OF_PLATFORM},
        "torquer_scale": [setup.torquer_scale] * 2,
        "level_tilt_arcmin": [setup.beta_sys_arcmin, setup.gamma_sys_arcmin],
        "level_repeat_arcmin": setup.beta_random_arcmin,
        # Where the gimbal is at more than was asked for, its sensor shows less than there is.
        "angle_zero_arcmin": -setup.angle_sys_arcmin if setup.angle_sys == "common" else 0.0,
        "angle_set_arcmin": 0.0 if setup.encoder else setup.angle_random_arcmin,
        "angle_read_arcmin": setup.angle_random_arcmin if setup.encoder else 0.0,
    }
    if setup.slew_dps > UNIT_DPS and not setup.scenario:
        found["platform"]["torquer_limit_dps"] = FAST_LIMIT_DPS
        for unit in found["units"]:
            if unit["board"] == "gyro":  # without the resolved keys of the usual profile, which would win
                unit |= {"profile": FAST_PROFILE, "profile_set": {}}
    if setup.white_degph_rts == 0.0:
        _silence(found)
    found["vehicle"] |= {"heading_deg": at.heading_deg, "pitch_deg": at.pitch_deg, "roll_deg": at.roll_deg}
    return found


def _silence(found: Scenario) -> None:
    """No noise of converters and level sensors."""
    for unit in found["units"]:
        if unit["board"] == "psa2":
            unit |= {"adc_noise_scale": 0, "temp_noise_scale": 0}
            for axis in unit["axes"].values():
                if "quartz" in axis:
                    axis["quartz"]["noise_a_rthz"] = 0


# ---- runs


def params(setup: Setup) -> GyrocompassParams:
    """The host's procedure. Raises BadInput where it cannot do it."""
    check(setup)
    try:
        return GyrocompassParams(
            sequence=",".join(repr(a) for a in setup.angles_deg),
            **{name: getattr(setup, name) for name in OF_PROCEDURE},
            latitude_deg=setup.latitude_deg + setup.latitude_error_arcmin / 60.0,
            method=setup.method.replace("_", "-"),
            angles="encoder" if setup.encoder else "set",
            cardan=setup.gimbal == "corrected",
            calibrate_s=0.0,
            angle_sd_arcmin=setup.angle_random_arcmin,
            level_sd_arcmin=setup.gamma_random_arcmin,
        )
    except ValueError as e:
        raise BadInput(f"{OPTION}: {e}") from e


Platforms = Callable[[Scenario], AbstractContextManager[PlatformBench]]


def platforms(chain: str) -> Platforms:
    """Of a chain, "emulated" or "wire"."""
    return live if chain == "wire" else recorded()


def recorded() -> Platforms:
    """An emulator a run, in free pace. What the units tell of themselves is asked for once."""
    plates: Plates = {}
    return lambda s: nullcontext(RecordedPlatform(s, first_turn_deg=FIRST_TURN_DEG, plates=plates))


@contextmanager
def live(s: Scenario) -> Iterator[PlatformBench]:
    """An emulator a run, in step pace, and socketcand."""
    with tempfile.TemporaryDirectory(prefix="psabench-") as folder:
        path = Path(folder) / "run.yaml"
        path.write_text(json.dumps(s), encoding="utf-8")  # YAML, too
        with Bench.start(path) as bench:
            yield WirePlatform(bench)


def runs(platforms: Platforms, setup: Setup, seed: int, first_run: int, count: int) -> Rows:
    """Errors of the runs, and how many doubts the procedure has. The platform's own in position 1, which the wire does
    not tell, is NaN; so is a run without a heading."""
    p = params(setup)
    return np.stack([_errors(platforms, setup, p, seed, first_run + k) for k in range(count)]).astype(CELL)


def why(platforms: Platforms, setup: Setup, seed: int, run: int) -> tuple[str, ...]:
    """Why a run has no heading, or what makes its heading doubtful; (): nothing does."""
    try:
        return _result(platforms, setup, params(setup), instrument(setup, seed, run)).doubts
    except (LinkError, DeviceError) as e:
        return (str(e),)


def _result(platforms: Platforms, setup: Setup, p: GyrocompassParams, at: Instrument) -> gyrocompass.GyrocompassResult:
    try:
        with platforms(scenario(setup, at)) as platform:
            return gyrocompass.estimate(gyrocompass.measure(platform, p, Silent()), p)
    except BadInput as e:
        raise BadInput(f"{OPTION}: {e}") from e


def _errors(platforms: Platforms, setup: Setup, p: GyrocompassParams, seed: int, run: int) -> list[float]:
    at = instrument(setup, seed, run)
    try:
        r = _result(platforms, setup, p, at)
    except (LinkError, DeviceError):  # `why` tells
        return [math.nan] * 5
    heading = wrapped_deg(math.degrees(r.heading_rad) - at.heading_deg)
    # As alpha, counter-clockwise, like the errors of the other chains.
    drift_degph = r.compass.drift1_radps / DEGPH - setup.drift_degph
    return [math.nan, -heading, drift_degph, r.compass.quality, float(len(r.doubts))]
