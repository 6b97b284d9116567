"""The modes of the heading indicator on an emulated bench: flights beside the algebra, drift by specific force."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench.bench import Bench
from psabench.campaign import heading_modes as algebra
from psabench.campaign.emulated import resolved
from psabench.campaign.heading_modes import ROWS, errors_deg
from psabench.campaign.heading_modes_emulated import Scenario, Trip, compass_params, fly_run, run_scenario
from psabench.errors import LinkError
from psabench.native.nav import DEGPH
from psabench.procedures import gyrocompass
from psabench.procedures.gyrocompass import GyrocompassResult
from psabench.procedures.gyrocompass_params import params_of
from psabench.procedures.head_bench import Silent
from psabench.procedures.heading_modes import ModeParams
from psabench.procedures.wire_platform import WirePlatform
from rig import HOST, ROOT

pytestmark = HOST

SHORT = ModeParams(hours=0.5)
EXACT = {"level_repeat_arcmin": 0.0, "angle_set_arcmin": 0.0, "angle_read_arcmin": 0.0}


def without_chance(name: str, p: ModeParams, run: int) -> tuple[Trip, np.ndarray[Any, Any]]:
    """An emulated flight and the algebra's, of the same instrument, with all that is drawn in flight taken away."""
    row = replace(ROWS[name], gm_sigma_degph=0.0)
    s: Scenario = run_scenario(row, 1, run)
    s["platform"] |= EXACT
    s["magnetic"]["noise_ut"] = 0.0
    flown = fly_run(row, p, 1, run, s)
    at = np.searchsorted(p.looks_s, flown.flown.t_s)
    return flown, errors_deg(row, p, 1, 1, run)[0][at]


@pytest.mark.parametrize(("name", "within_deg"), [("magnetic", 0.02), ("half-compass", 0.012)])
def test_the_prototype_flies_as_the_algebra_says(name: str, within_deg: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """Sensor, dip, setter, panel, take-off, tilts: at each look, of 0.15 deg and more."""
    monkeypatch.setattr(algebra, "NOISE_UT", 0.0)
    flown, want_deg = without_chance(name, SHORT, 1)
    assert flown.error_deg == pytest.approx(want_deg, abs=within_deg)
    assert np.ptp(want_deg) > 0.15
    assert flown.flown.ready_s == pytest.approx(13.6, abs=1.0)


def test_the_article_s_hold_flies_as_the_algebra_says() -> None:
    """Since the beginning of the flight; its readiness is the prototype's and two minutes, one of them optional."""
    flown, want_deg = without_chance("literal", SHORT, 1)
    moved_deg = flown.error_deg - flown.error_deg[0]
    assert moved_deg == pytest.approx(want_deg - want_deg[0], abs=0.012)
    assert abs(flown.error_deg[0]) < 0.2
    assert flown.flown.ready_s == pytest.approx(159.6, abs=1.0)
    assert flown.flown.doubts == ()


@pytest.mark.parametrize("name", ["literal", "improved"])
def test_the_windows_of_the_algebra_are_those_of_a_run(name: str, tmp_path: Path) -> None:
    """When each window was before the flight, how long, and where the platform stood."""
    row, path = ROWS[name], tmp_path / "run.yaml"
    path.write_text(json.dumps(run_scenario(row, 1, 1)), encoding="utf-8")
    with Bench.start(path) as b:
        platform = WirePlatform(b)
        p = compass_params(row, ModeParams())
        windows = gyrocompass.measure(platform, p, Silent())
        end_s = platform.t_s
    first_rad = windows[0].set_rad
    lengths_s = [w.step_s * len(w.beta_rad) for w in windows]
    begun_s = [w.t_mid_s - 0.5 * length_s - end_s for w, length_s in zip(windows, lengths_s, strict=True)]
    assert begun_s == pytest.approx([b for b, _ in row.windows_s], abs=0.6)
    assert lengths_s == pytest.approx([length_s for _, length_s in row.windows_s], abs=0.05)
    turned_deg = [math.degrees(w.set_rad - first_rad) % 360.0 for w in windows]
    assert turned_deg == pytest.approx(row.turned_deg, abs=0.1)


def test_magnetic_modes_need_the_sensor() -> None:
    row = ROWS["magnetic"]
    s: Scenario = json.loads(resolved(str(ROOT / "proto/scenarios/gyrocompass.yaml")))
    with pytest.raises(LinkError, match="expected an induction sensor"):
        fly_run(row, SHORT, 1, 0, s)


def tilted_compass(folder: Path, *, known: Mapping[str, float] | None = None, **platform: object) -> GyrocompassResult:
    """The article's run on the ideal platform with these keys, 5 deg of pitch and roll. known: passport."""
    s: Scenario = json.loads(resolved(str(ROOT / "proto/scenarios/gyrocompass_ideal.yaml")))
    s["platform"] |= platform
    s["vehicle"] |= {"heading_deg": 40.0, "pitch_deg": 5.0, "roll_deg": -5.0}
    path = folder / "tilted.yaml"
    path.write_text(json.dumps(s), encoding="utf-8")
    p = params_of("article", {"latitude_deg": 50.0, **(known or {})})
    with Bench.start(path) as b:
        return gyrocompass.estimate(gyrocompass.measure(WirePlatform(b), p, Silent()), p)


def heading_off_deg(r: GyrocompassResult) -> float:
    return (math.degrees(r.heading_rad) - 40.0 + 180.0) % 360.0 - 180.0


def test_mass_unbalance_turns_the_heading_of_a_tilted_vehicle(tmp_path: Path) -> None:
    """1 deg/h/g times the sine of 5 deg twice over, by the Earth's 9.67 deg/h: 0.73 deg; with its passport nothing."""
    want_deg = -math.degrees(math.sin(math.radians(5.0)) * math.sqrt(2.0) / 9.67)
    keys = {"unbalance_degph_per_g": [1.0, 1.0], "drift_degph": [25.0, 24.0]}
    without, known = (tilted_compass(tmp_path, known=k, **keys) for k in ({}, {"unbalance1_degph_per_g": 1.0}))
    assert heading_off_deg(without) == pytest.approx(want_deg, abs=0.03)
    assert abs(heading_off_deg(known)) < 0.01


def test_quadrature_turns_the_drift_of_a_level_flight(tmp_path: Path) -> None:
    """What the windows find about z has the force of a parked vehicle in it; a hold is level."""
    keys = {"quadrature_degph_per_g": [1.0, 1.0], "drift_degph": [24.0, 25.0]}
    without, known = (tilted_compass(tmp_path, known=k, **keys).drift2 for k in ({}, {"quadrature2_degph_per_g": 1.0}))
    assert abs(without.level_radps / DEGPH - 25.0) > 0.04
    assert known.level_radps / DEGPH == pytest.approx(25.0, abs=0.004)
    assert known.radps == pytest.approx(without.radps, abs=1e-4 * DEGPH)


def test_motors_cost_a_heading_by_their_dead_zone_not_by_their_bandwidth(tmp_path: Path) -> None:
    """1 Hz without a dead zone changes nothing; 20 Hz with one of 10 arcsec costs half a degree, in doubt."""
    slow = tilted_compass(tmp_path, servo_hz=1.0)
    stiff = tilted_compass(tmp_path, servo_hz=20.0, servo_dead_arcsec=10.0)
    assert abs(heading_off_deg(slow)) < 0.06
    assert slow.doubts == ()
    assert abs(heading_off_deg(stiff)) > 0.3
    assert stiff.doubts
