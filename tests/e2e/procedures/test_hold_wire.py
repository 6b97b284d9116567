"""Heading hold through the wire: what spoils it is named, whether it is still active at a look or is long over."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from psabench import Bench
from psabench.boards.gyro.device import Flag, Gyro, Mode, SelfTest
from psabench.errors import DeviceError, LinkError
from psabench.places import proto_file
from psabench.procedures import gyrocompass
from psabench.procedures.gyrocompass_params import params_of
from psabench.procedures.head_bench import Silent
from psabench.procedures.heading_hold import Held, HoldParams, HoldResult, hold
from psabench.procedures.wire_platform import WirePlatform
from rig import HOST

pytestmark = HOST

IDEAL, REAL = "gyrocompass_ideal", "gyrocompass"
LOOK_S = 300.0
LOST = "the level sensors are silent or lose frames"
STUCK = "the angle sensor does not follow the torquer: it is stuck, or the torquer is dead"
RESET = "reset, or without power for a while"
SOAK = (pytest.mark.soak, pytest.mark.timeout(1200))
Spoil = Callable[[Bench], object]


def held(
    spoil: Spoil, *, scenario: str | Path = IDEAL, hours: float = 0.5, speed_kmh: float = 0.0, **given: Any
) -> tuple[HoldResult, list[float]]:
    """A hold, spoilt after its second look, and its errors, deg."""
    errors_deg: list[float] = []
    with Bench.start(scenario) as bench:
        platform = WirePlatform(bench)
        p = params_of("article", {"settle_s": 15.0, "calibrate_s": 20.0, **given})
        start = gyrocompass.estimate(gyrocompass.measure(platform, p, Silent()), p)

        def watch(h: Held) -> None:
            off_deg = math.degrees(h.heading_rad) - float(bench.truth_state()["vehicle"]["heading_deg"])
            errors_deg.append(math.remainder(off_deg, 360.0))
            if len(errors_deg) == 2:
                spoil(bench)

        def depart() -> None:
            bench.control.call("vehicle.attitude", heading_deg=90.0, pitch_deg=0.0, roll_deg=0.0)
            bench.control.call("vehicle.fly", speed_mps=speed_kmh / 3.6, track_deg=90.0)

        flight = HoldParams(hours=hours, look_s=LOOK_S, speed_kmh=speed_kmh)
        return hold(platform, start, flight, Silent(), watch=watch, depart=depart), errors_deg


def fault(kind: str, point: str, **args: Any) -> Spoil:
    return lambda bench: bench.fault(kind, point, **args)


def later(kind: str, point: str, **args: Any) -> Spoil:
    """50 s after the look, where no one is looking."""
    return lambda bench: bench.fault(kind, point, at_s=bench.time_s + 50.0, **args)


def stuck_and_turned(bench: Bench) -> None:
    bench.fault("platform.encoder_stuck", "platform.encoder")
    bench.control.call("vehicle.attitude", heading_deg=70.0, pitch_deg=2.0, roll_deg=-1.5)


@pytest.mark.parametrize(
    ("spoil", "speed_kmh", "says", "at_s"),
    [
        (stuck_and_turned, 0.0, STUCK, (600, 615)),
        (fault("platform.encoder_stuck", "platform.encoder"), 500.0, STUCK, (600, 615)),
        (fault("platform.torquer", "platform.azimuth"), 0.0, STUCK, (320, 380)),
        (fault("platform.torquer", "platform.azimuth"), 500.0, STUCK, (320, 380)),
        (later("platform.torquer", "platform.azimuth", for_s=90.0), 0.0, STUCK, (370, 430)),
        (later("platform.torquer", "platform.level", for_s=100.0), 0.0, "the platform does not settle", (390, 450)),
        (later("link.drop", "level.can", can_id=0x185, frames=3), 0.0, LOST, (350, 353)),
        (later("link.drop", "level.can", can_id=0x185, frames=25_000), 500.0, LOST, (350, 353)),
        (lambda bench: bench.control.call("unit.reset", unit="gyro"), 0.0, "the unit left navigation", (300, 303)),
    ],
    ids=["stuck", "stuck-flying", "dead", "dead-flying", "dead-a-while", "tilt", "a-frame", "silent-a-while", "reset"],
)  # fmt: skip
def test_what_spoils_a_hold_is_named_with_its_time(
    spoil: Spoil, speed_kmh: float, says: str, at_s: tuple[int, int]
) -> None:
    r, _ = held(spoil, speed_kmh=speed_kmh)
    (doubt,) = [d for d in r.doubts if d.startswith(says)]
    time_s = float(doubt.removesuffix(" s into navigation").rpartition(" ")[2])
    assert at_s[0] <= time_s <= at_s[1], doubt


def test_a_dead_azimuth_torquer_moves_the_heading_of_a_parked_vehicle() -> None:
    """Beside what the unit says: the platform turns as the Earth does not, 11.5 deg/h."""
    r, _ = held(fault("platform.torquer", "platform.azimuth"))
    (doubt,) = [d for d in r.doubts if d.startswith("the heading moved by")]
    assert "in 600 s of standing" in doubt


def test_a_dip_of_the_supply_between_two_looks_is_a_doubt(tmp_path: Path) -> None:
    """Board and level unit lose their power for a tenth of a second and are back long before the next look."""
    path = tmp_path / "supplied.yaml"
    path.write_text("supply: {}\n" + proto_file(f"scenarios/{IDEAL}.yaml").read_text(encoding="utf-8"))
    r, errors_deg = held(later("supply.brownout", "supply", for_s=0.1, drop_v=20.0), scenario=path)
    (doubt,) = [d for d in r.doubts if d.startswith("the unit left navigation, its mode is off")]
    assert f"{RESET}, 35" in doubt
    assert abs(errors_deg[-1]) > 5.0  # what would have passed for a heading


@pytest.mark.parametrize(
    ("hours", "speed_kmh"),
    [
        (0.5, 0.0),
        (0.5, 500.0),
        pytest.param(4.0, 0.0, marks=SOAK),
        pytest.param(4.0, 500.0, marks=SOAK),
    ],
)
def test_good_hours_raise_no_doubt(hours: float, speed_kmh: float) -> None:
    """With all its errors, parked and swaying, or in flight."""

    def sway(bench: Bench) -> None:
        if not speed_kmh:
            bench.control.call("vehicle.sway", pitch_arcmin=3.0, pitch_s=7.0, roll_arcmin=3.0, roll_s=11.0)

    r, errors_deg = held(sway, scenario=REAL, hours=hours, speed_kmh=speed_kmh)
    assert len(errors_deg) == round(hours * 3600.0 / LOOK_S) + 1
    assert r.doubts == r.start.doubts == ()
    assert all(abs(e) < 3.0 * math.degrees(h.sd_rad) for e, h in zip(errors_deg, r.held, strict=True))


# ---- the self test


def navigating(bench: Bench) -> Gyro:
    gyro = bench.board(Gyro)
    bench.wait(1.0)
    gyro.mode = Mode.LEVEL
    bench.wait(10.0)
    s = bench.truth_state()["platform"]
    gyro.set(azimuth_deg=s["alpha_deg"], drift1_degph=25.0, drift2_degph=25.0)
    gyro.mode = Mode.NAVIGATE
    return gyro


def nod(bench: Bench, gyro: Gyro) -> SelfTest:
    gyro.begin_self_test()
    for _ in range(10):
        assert gyro.self_test in (None, *SelfTest)
        bench.wait(1.0)
        if (result := gyro.self_test) is not None:
            return result
    raise AssertionError("it does not end")


def test_the_platform_nods_and_comes_back() -> None:
    with Bench.start(IDEAL) as bench:
        gyro = navigating(bench)
        before = bench.truth_state()["platform"]["alpha_deg"]
        assert nod(bench, gyro) is SelfTest.PASSED
        assert bench.truth_state()["platform"]["alpha_deg"] == pytest.approx(before, abs=1e-3)
        gyro.begin_self_test()
        bench.wait(0.5)
        assert bench.truth_state()["platform"]["alpha_deg"] == pytest.approx(before + 0.1, abs=0.01)
        with pytest.raises(DeviceError, match="a self test is under way"):
            gyro.begin_self_test()
        bench.wait(1.0)
        gyro.mode = Mode.LEVEL
        with pytest.raises(DeviceError, match="of navigation"):
            gyro.begin_self_test()


@pytest.mark.parametrize(
    ("kind", "point"), [("platform.encoder_stuck", "platform.encoder"), ("platform.torquer", "platform.azimuth")]
)
def test_a_nod_without_an_answer_is_an_encoder_fault(kind: str, point: str) -> None:
    with Bench.start(IDEAL) as bench:
        gyro = navigating(bench)
        bench.fault(kind, point)
        assert nod(bench, gyro) is SelfTest.FAILED
        assert gyro.flags == Flag.ENCODER_FAULT
        began = gyro.began()
        assert (began[Flag.ENCODER_FAULT].count, began[Flag.LEVEL_LOST].count) == (1, 0)
        assert 0 < gyro.steps - began[Flag.ENCODER_FAULT].step < 200


def test_a_nod_goes_on_from_a_snapshot(tmp_path: Path) -> None:
    saved = tmp_path / "nod.snapshot"

    def rest(bench: Bench, gyro: Gyro) -> tuple[Any, ...]:
        bench.wait(5.0)
        return bench.truth_state()["platform"], gyro.self_test, gyro.began()

    with Bench.start(REAL) as bench:
        gyro = navigating(bench)
        bench.fault("platform.torquer", "platform.azimuth")
        gyro.begin_self_test()
        bench.wait(0.8)
        bench.snapshot(saved)
        want = rest(bench, gyro)
    with Bench.restore(saved) as bench:
        assert rest(bench, bench.board(Gyro)) == want


# ---- levelling


def test_levelling_that_cannot_end_gives_up_after_its_time_constants() -> None:
    with Bench.start(IDEAL) as bench:
        platform = WirePlatform(bench)
        platform.prepare(latitude_rad=0.87, m1_per_s=1.0, m2_per_s=2.0)
        bench.fault("platform.torquer", "platform.level")
        begun_s = bench.time_s
        with pytest.raises(LinkError, match=r"expected a level platform within 25 s, got \d+\.\d' off"):
            platform.level(120.0)
        assert 25.0 <= bench.time_s - begun_s < 26.0
        with pytest.raises(LinkError, match="expected a level platform within 5 s"):
            platform.level(5.0)
