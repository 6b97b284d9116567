"""The gyro unit through the wire: readings against codes and truth, runs, faults, scenarios, lines."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench import Bench
from psabench.boards.gyro.device import Flag, Gyro, Mode, Phase
from psabench.emulator import Emulator
from psabench.errors import DeviceError
from psabench.link.control import Control
from psabench.link.protocol_files import message
from psabench.link.vcd import read_vcd
from rig import HOST, one_line, psa_emu

pytestmark = HOST

IDEAL = "gyrocompass_ideal"
LEVEL_NODE, GYRO_NODE = 5, 9
BETA_LSB_DEG = 2e-6
EARTH_DEGPH = 15.041067
DRIFT_DEGPH = 25.0  # of both scenarios, systematic
BATCH_S = 1.0


@dataclass
class Reading:
    """One step of the controller, as its three messages have it, in their units."""

    u1_degph: float
    u2_degph: float
    encoder_deg: float
    step: int
    mode: Mode
    phase: Phase
    position: int
    flags: Flag
    beta_deg: float
    gamma_deg: float
    level_seq: int


@dataclass
class Ear:
    """What passes on the bus: codes of the level unit by SEQ, readings of the gyro unit, its emergencies."""

    codes: dict[int, tuple[float, float]] = field(default_factory=dict)
    readings: list[Reading] = field(default_factory=list)
    emergencies: list[int] = field(default_factory=list)
    parts: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __call__(self, m: Any) -> None:
        name = {
            0x180 + LEVEL_NODE: "PSA2_XY", 0x080 + GYRO_NODE: "GYRO_EMCY", 0x180 + GYRO_NODE: "GYRO_RATES",
            0x280 + GYRO_NODE: "GYRO_ANGLES", 0x380 + GYRO_NODE: "GYRO_LEVEL",
        }.get(m.arbitration_id)  # fmt: skip
        if name is None:
            return
        values = message(name).decode(bytes(m.data), decode_choices=False)
        if name == "PSA2_XY":
            self.codes[int(values["SEQ"])] = (values["X"], values["Y"])
        elif name == "GYRO_EMCY":
            self.emergencies.append(int(values["CODE"]))
        else:
            self.parts[name] = values
        if name == "GYRO_LEVEL":
            self.readings.append(self.whole())
            self.parts.clear()

    def whole(self) -> Reading:
        u, a, level = (self.parts[f"GYRO_{name}"] for name in ("RATES", "ANGLES", "LEVEL"))
        flags = Flag(sum(int(f) for f in Flag if a[str(f.name)]))
        return Reading(
            u["U1"], u["U2"], a["ENCODER"], int(a["STEP"]), Mode(a["MODE"]), Phase(a["PHASE"]), int(a["POSITION"]),
            flags, level["BETA"], level["GAMMA"], int(level["LEVEL_SEQ"]),
        )  # fmt: skip

    def windows(self) -> dict[int, list[Reading]]:
        """By position."""
        found: dict[int, list[Reading]] = {}
        for r in self.readings:
            if r.phase == Phase.WINDOW:
                found.setdefault(r.position, []).append(r)
        return found


@contextmanager
def gyro_bench(scenario: str | Path = IDEAL, **options: Any) -> Iterator[tuple[Bench, Gyro, Ear]]:
    with Bench.start(scenario, **options) as bench:
        ear = Ear()
        bench.host.listeners.append(ear)
        bench.wait(1.0)
        yield bench, bench.board(Gyro), ear


def until_mode(bench: Bench, gyro: Gyro, mode: Mode, limit_s: float) -> None:
    for _ in range(int(limit_s / BATCH_S)):
        bench.wait(BATCH_S)
        if gyro.mode == mode:
            return
    raise AssertionError(f"mode is {gyro.mode.name}, not {mode.name}, after {limit_s} s")


def platform(bench: Bench) -> dict[str, Any]:
    state: dict[str, Any] = bench.truth_state()["platform"]
    return state


# ---- readings and runs


def test_level_angles_are_those_of_the_level_unit_s_codes() -> None:
    """Nothing but the frames on the bus: all between two steps, by LEVEL_SEQ."""
    with gyro_bench("gyrocompass") as (bench, gyro, ear):
        gyro.mode = Mode.LEVEL
        ear.readings.clear()
        bench.wait(5.0)
    for before, r in itertools.pairwise(ear.readings):
        volts = [ear.codes[seq] for seq in range(before.level_seq + 1, r.level_seq + 1)]
        assert 2 <= len(volts) <= 3
        x_v, y_v = np.mean(volts, axis=0)
        beta_rad = np.arcsin(y_v / -1.2)
        gamma_rad = np.arcsin(-x_v / (-1.2 * np.cos(beta_rad)))
        assert abs(np.degrees(beta_rad) - r.beta_deg) <= 0.51 * BETA_LSB_DEG
        assert abs(np.degrees(gamma_rad) - r.gamma_deg) <= 0.51 * BETA_LSB_DEG
        assert r.step == (before.step + 1) % 65536
    assert len(ear.readings) >= 499


def test_a_run_measures_the_earth_s_rate_and_the_drift_at_each_position() -> None:
    """S of the article's eq. (9); a code of the level unit is 0.2 deg/h at m1 = 1."""
    with gyro_bench() as (bench, gyro, ear):
        gyro.positions_deg = (0.0, 120.0, 240.0)
        gyro.set(latitude_deg=50.0, window_s=10.0)
        gyro.mode = Mode.GYROCOMPASS
        alpha: dict[int, dict[str, Any]] = {}
        for _ in range(100):
            bench.wait(BATCH_S)
            if gyro.phase == Phase.WINDOW:
                alpha[gyro.position] = platform(bench)
            if gyro.mode != Mode.GYROCOMPASS:
                break
    assert {k: len(w) for k, w in ear.windows().items()} == {1: 1000, 2: 1000, 3: 1000}
    we_degph = EARTH_DEGPH * np.cos(np.radians(50.0))
    for position, window in ear.windows().items():
        assert all(r.flags == Flag(0) for r in window)
        a, b, g = (np.radians(alpha[position][f"{name}_deg"]) for name in ("alpha", "beta", "gamma"))
        want = we_degph * (np.sin(a) * np.cos(g) + np.cos(a) * np.sin(g) * np.sin(b)) + DRIFT_DEGPH
        got = np.mean([-3600.0 * r.beta_deg for r in window])
        assert abs(got - want) < 0.03, position
        assert abs(window[-1].encoder_deg - (position - 1) * 120.0 + 360.0 * (position == 3)) < 0.01
    assert ear.emergencies == []


def test_calibration_then_navigation_keep_the_heading_in_a_turn_of_the_vehicle() -> None:
    with gyro_bench() as (bench, gyro, ear):
        gyro.mode = Mode.HOLD
        bench.wait(10.0)
        gyro.mode = Mode.CALIBRATE
        until_mode(bench, gyro, Mode.HOLD, 90.0)
        s = platform(bench)
        a, b, g = (np.radians(s[f"{name}_deg"]) for name in ("alpha", "beta", "gamma"))
        earth = EARTH_DEGPH * np.array([np.cos(np.radians(50.0)), np.sin(np.radians(50.0))])
        along_z = np.array([np.sin(a) * np.sin(g) - np.cos(a) * np.cos(g) * np.sin(b), np.cos(b) * np.cos(g)])
        mean_u2 = float(np.mean([r.u2_degph for r in ear.windows()[0]]))
        drift2_degph = mean_u2 - float(earth @ along_z)
        assert abs(drift2_degph - DRIFT_DEGPH) < 0.05
        gyro.set(azimuth_deg=s["alpha_deg"], drift1_degph=DRIFT_DEGPH, drift2_degph=drift2_degph)
        gyro.mode = Mode.NAVIGATE
        bench.control.call("vehicle.attitude", heading_deg=-100.0, pitch_deg=0.0, roll_deg=0.0)
        bench.wait(300.0)
        truth = bench.truth_state()
        assert abs(truth["platform"]["alpha_deg"] - s["alpha_deg"]) < 0.02
        assert abs(truth["vehicle"]["heading_deg"] + 100.0) < 1e-9
        assert abs(gyro.heading_deg - 260.0) < 0.05


def test_lines_show_turns_and_windows(tmp_path: Path) -> None:
    path = tmp_path / "run.vcd"
    with Emulator(IDEAL, pace="step", extra=("--unit", "gyro", "--vcd", path)) as emulator:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            control.call("run", for_s=1.0)
            control.call("gyro.mode", unit="gyro", mode="gyrocompass")
            control.call("run", for_s=90.0)
    wires = read_vcd(path).wires
    for name in ("SLEW", "SETTLE", "WINDOW"):
        assert len(wires[name].edges_ns(1)) == 3
    window = wires["WINDOW"]
    assert (window.edges_ns(0)[-3:] - window.edges_ns(1)).tolist() == [10_000_000_000] * 3


def test_a_run_goes_on_from_a_snapshot(tmp_path: Path) -> None:
    saved = tmp_path / "mid.snapshot"
    with gyro_bench("gyrocompass") as (bench, gyro, ear):
        gyro.mode = Mode.GYROCOMPASS
        bench.wait(20.0)
        bench.snapshot(saved)
        first = platform(bench)
        ear.readings.clear()
        bench.wait(30.0)
        later, readings = platform(bench), ear.readings[:]
    with Bench.restore(saved) as bench:
        ear = Ear()
        bench.host.listeners.append(ear)
        assert platform(bench) == first
        bench.wait(30.0)
        assert platform(bench) == later
    assert ear.readings == readings


# ---- what is refused


def test_modes_are_refused_in_words() -> None:
    with gyro_bench() as (bench, gyro, _):
        gyro.set(count=32, repeat=4)
        with pytest.raises(DeviceError, match="127"):
            gyro.mode = Mode.GYROCOMPASS
        gyro.set(count=3, repeat=1)
        gyro.mode = Mode.GYROCOMPASS
        with pytest.raises(DeviceError, match="a run is under way"):
            gyro.positions_deg = (0.0, 1.0)
        bench.unit.stop()
        bench.wait(0.2)
        with pytest.raises(DeviceError, match="the level unit is silent"):
            gyro.mode = Mode.HOLD


UNITS = """
units:
  - {name: level, board: psa2, on: platform}
  - {name: gyro, board: gyro, level: level}
"""


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("platform: {}" + UNITS, "platform: expected site.latitude_deg"),
        ("site: {latitude_deg: 50}" + UNITS, "level: expected a section platform to mount it on"),
        ("site: {latitude_deg: 50}\nunits: [{board: gyro}]", "a: expected a section platform for it to control"),
        ("vehicle: {heading_deg: 3}\nunits: [{}]", "vehicle: expected a section platform"),
        (
            "site: {latitude_deg: 50}\nplatform: {}\nunits: [{board: gyro, level: b}, {name: b}]",
            "expected a PSA-2 with on: platform",
        ),
        (
            "site: {latitude_deg: 50}\nplatform: {}\nunits: [{board: gyro, level: c}]",
            'expected the name of a PSA-2, got "c"',
        ),
        (
            "site: {latitude_deg: 50}\nplatform: {}\nunits: [{board: gyro}, {board: gyro}]",
            "expected one gyro unit on the platform",
        ),
        ("units: [{level: b}]", "level: expected a key of a PSA-2"),
        (
            "site: {latitude_deg: 50}\nplatform: {}\nunits: [{board: gyro, axes: {}}]",
            "axes: expected a key of a Gyro unit",
        ),
        ("platform: {gm_tau_s: 0}\nunits: [{}]", "platform.gm_tau_s: expected "),
        (
            "timeline: [{cmd: vehicle.fly, args: {speed_mps: 1, track_deg: 0}}]\nunits: [{}]",
            "this scenario has no platform",
        ),
        (
            "timeline: [{cmd: gyro.mode, args: {unit: a, mode: hold}}]\nunits: [{}]",
            "unit: expected a gyro unit, got a, a PSA-2",
        ),
    ],
)
def test_scenarios_that_cannot_be_are_refused(text: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "s.yaml"
    path.write_text(text + "\n")
    done = psa_emu(path, "--dump")
    assert done.returncode == 2
    assert says in one_line(done.stderr, "psa-emu"), done.stderr


# ---- what goes wrong


def test_a_lost_frame_of_the_level_unit_is_told_in_the_window_that_lacks_it() -> None:
    with gyro_bench() as (bench, gyro, ear):
        gyro.set(settle_s=5.0, window_s=5.0)
        gyro.mode = Mode.GYROCOMPASS
        while gyro.phase != Phase.WINDOW:
            bench.wait(0.1)
        bench.fault("link.drop", "level.can", can_id=0x180 + LEVEL_NODE, frames=1)
        until_mode(bench, gyro, Mode.HOLD, 90.0)
    lacking = {k: sum(Flag.LEVEL_LOST in r.flags for r in w) for k, w in ear.windows().items()}
    assert lacking == {1: 1, 2: 0, 3: 0}
    assert ear.emergencies == [0xFF21, 0]


def test_a_stuck_encoder_and_a_dead_azimuth_torquer_end_the_run_without_a_window() -> None:
    for kind, point in (("platform.encoder_stuck", "platform.encoder"), ("platform.torquer", "platform.azimuth")):
        with gyro_bench() as (bench, gyro, ear):
            gyro.mode = Mode.HOLD
            bench.wait(5.0)
            bench.fault(kind, point)
            gyro.positions_deg = (90.0, 180.0, 270.0)
            gyro.mode = Mode.GYROCOMPASS
            until_mode(bench, gyro, Mode.LEVEL, 10.0)
            assert Flag.ENCODER_FAULT in gyro.flags
        assert ear.windows() == {}
        assert 0xFF22 in ear.emergencies


def test_a_platform_that_never_settles_gives_no_window() -> None:
    with gyro_bench() as (bench, gyro, ear):
        gyro.set(settle_limit_s=10.0)
        bench.fault("platform.torquer", "platform.level")
        gyro.mode = Mode.GYROCOMPASS
        until_mode(bench, gyro, Mode.HOLD, 60.0)
        assert Flag.NOT_SETTLED in gyro.flags
    assert ear.windows() == {}
    assert 0xFF23 in ear.emergencies


def test_a_step_of_drift_is_in_the_levelling_rate() -> None:
    with gyro_bench() as (bench, gyro, ear):
        gyro.mode = Mode.HOLD
        bench.wait(20.0)
        ear.readings.clear()
        bench.wait(10.0)
        before = np.mean([r.u1_degph for r in ear.readings])
        fault = bench.fault("platform.drift_step", "platform.level", drift_degph=3.0)
        bench.wait(10.0)
        ear.readings.clear()
        bench.wait(10.0)
        assert abs(np.mean([r.u1_degph for r in ear.readings]) - before - 3.0) < 0.05
        assert platform(bench)["drift_degph"] == pytest.approx([DRIFT_DEGPH + 3.0, DRIFT_DEGPH])
        fault.clear()
        bench.wait(0.1)
        assert platform(bench)["drift_degph"] == pytest.approx([DRIFT_DEGPH, DRIFT_DEGPH])


def test_frozen_words_go_on_with_their_numbers() -> None:
    with gyro_bench() as (bench, gyro, ear):
        gyro.mode = Mode.HOLD
        bench.wait(1.0)
        bench.fault("controller.frozen_words", "gyro.controller")
        ear.readings.clear()
        bench.wait(1.0)
    assert len({r.step for r in ear.readings}) == len(ear.readings) > 90
    assert len({(r.u1_degph, r.encoder_deg, r.beta_deg) for r in ear.readings[1:]}) == 1


def test_the_vehicle_sways_and_the_level_unit_feels_it() -> None:
    with gyro_bench() as (bench, gyro, ear):
        gyro.mode = Mode.LEVEL
        bench.wait(20.0)
        bench.control.call("vehicle.sway", pitch_arcmin=3.0, pitch_s=5.0, roll_arcmin=3.0, roll_s=5.0)
        ear.readings.clear()
        bench.wait(20.0)
        gamma = np.array([r.gamma_deg for r in ear.readings]) * 60.0
    assert 3.0 < np.ptp(gamma) < 9.0
