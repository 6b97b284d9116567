"""Gyrocompassing and heading hold through the wire: right where nothing errs, refused or flagged elsewhere."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from psabench import cli
from psabench.bench import Bench
from psabench.boards.gyro.device import Gyro, Mode
from psabench.boards.psa2.device import Psa2
from psabench.errors import DeviceError, LinkError
from psabench.places import proto_file
from psabench.procedures import gyrocompass as g
from psabench.procedures.gyrocompass import GyrocompassResult
from psabench.procedures.gyrocompass_params import GyrocompassParams, params_of
from psabench.procedures.head_bench import Silent
from psabench.procedures.platform_bench import Table
from psabench.procedures.wire_platform import WirePlatform

pytestmark = pytest.mark.host

IDEAL, REAL = "gyrocompass_ideal", "gyrocompass"
HEADING_DEG, PITCH_DEG, ROLL_DEG, DRIFT_DEGPH = 40.0, 2.0, -1.5, 25.0  # of both scenarios


def run(bench: Bench, p: GyrocompassParams) -> GyrocompassResult:
    return g.estimate(g.measure(WirePlatform(bench, signals=p.signals), p, Silent()), p)


def ideal(**given: Any) -> GyrocompassParams:
    """Without noise nothing dithers the codes: levelling goes from one to the next, 0.2 arc seconds, and a window has
    to be long beside the time that takes."""
    quiet = {
        "window_s": 15.0,
        "settle_s": 12.0,
        "gm_sigma_degph": 0.0,
        "angle_sd_arcmin": 0.1,
        "level_sd_arcmin": 0.1,
        "calibrate_s": 10.0,
    }
    return params_of("improved", {"repeat": 1, **quiet, **given})


@pytest.mark.parametrize(
    "given",
    [
        {"sequence": "0,90,180", "method": "closed3"},
        {"sequence": "-30,170,75,300", "slope": True},
        {"sequence": "0,180,90,270", "signals": "readings"},
        {"sequence": "0,120,240", "freeze": True},
    ],
    ids=lambda given: ",".join(given),
)
def test_without_errors_all_comes_out(given: dict[str, Any]) -> None:
    """To what codes of 1.2 uV leave."""
    with Bench.start(IDEAL) as bench:
        r = run(bench, ideal(**given))
    assert r.get("heading_deg").value == pytest.approx(HEADING_DEG, abs=0.02)
    assert r.get("drift1_degph").value == pytest.approx(DRIFT_DEGPH, abs=5e-3)
    assert r.get("drift2_degph").value == pytest.approx(DRIFT_DEGPH, abs=2e-3)
    assert r.get("pitch_deg").value == pytest.approx(PITCH_DEG, abs=2e-3)
    assert r.get("roll_deg").value == pytest.approx(ROLL_DEG, abs=2e-3)
    assert r.doubts == r.notes == ()


def test_frames_and_readings_tell_the_same_angles() -> None:
    """Frames of the PSA-2, averaged here, are the controller's own beta and gamma to the 2e-6 deg of its readings."""
    with Bench.start(REAL) as bench:
        platform = WirePlatform(bench)
        platform.prepare(latitude_rad=0.87, m1_per_s=1.0, m2_per_s=2.0)
        platform.level(60.0)
        seen: list[Any] = []
        ordinary = platform._of

        def both(tape: Any, span: slice, number: int, set_rad: float) -> Any:
            w = ordinary(tape, span, number, set_rad)
            seen.append((w, tape.readings["BETA"][span], tape.readings["GAMMA"][span]))
            return w

        platform._of = both  # type: ignore[method-assign]
        platform.calibrate(5.0, 10.0)
    w, beta_deg, gamma_deg = seen[0]
    assert len(beta_deg) == pytest.approx(500, abs=1)
    assert w.lost == 0
    assert abs(w.beta_rad * 180 / 3.141592653589793 - beta_deg).max() < 2e-6
    assert abs(w.gamma_rad * 180 / 3.141592653589793 - gamma_deg).max() < 2e-6


def test_as_a_user_runs_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", "gyrocompass", "--verbose", "--out", str(tmp_path)]) == 0
    out = capsys.readouterr().out
    assert "gyrocompass, article: 3 positions" in out
    assert "gyrocompass, improved: 24 positions" in out
    assert "All 10 numbers are within 2 U of the truth" in out
    data = json.loads((tmp_path / "result.json").read_text())
    article, improved = (s["estimates"][1] for s in data["sections"])  # of the platform: without the sensor's zero
    assert improved["sd"] < 0.3 * article["sd"]
    assert (tmp_path / "report.html").read_text().count("<svg") == 4
    assert json.loads((tmp_path / "scenario-gyrocompass.json").read_text())["units"]


def test_a_hold_as_a_user_runs_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["run", "heading-hold", "--reading", "article", "--scenario", f"{IDEAL}", "--settle-s", "15"]
    argv += ["--hours", "0.5", "--look-s", "600", "--calibrate-s", "20", "--out", str(tmp_path)]
    assert cli.main(argv) == 0
    held = json.loads((tmp_path / "result.json").read_text())["sections"][0]["hold"]
    assert len(held["t_s"]) == 4
    assert max(abs(e) for e in held["error_deg"]) < 0.01
    assert cli.main([*argv, "--compensate", "none"]) == 1
    assert "comparisons are not within 2 U" in capsys.readouterr().out
    held = json.loads((tmp_path / "result.json").read_text())["sections"][0]["hold"]
    assert held["error_deg"][-1] == pytest.approx(-0.5 * DRIFT_DEGPH, abs=0.05)


def test_a_flight_needs_the_rate_of_transport(tmp_path: Path) -> None:
    """500 km/h to the east at 50 deg: 5.4 deg/h of azimuth, which the controller makes up for."""
    argv = ["run", "heading-hold", "--reading", "article", "--scenario", f"{IDEAL}", "--settle-s", "15"]
    argv += ["--hours", "0.5", "--look-s", "600", "--speed-kmh", "500", "--calibrate-s", "20", "--out", str(tmp_path)]
    assert cli.main(argv) == 0
    held = json.loads((tmp_path / "result.json").read_text())["sections"][0]["hold"]
    assert held["heading_deg"][-1] == pytest.approx(90.0, abs=0.15)
    assert max(abs(e) for e in held["error_deg"]) < 0.15


# ---- what must not pass in silence


@pytest.mark.parametrize(
    ("option", "why"),
    [
        (["--sequence", "0,90"], "too few positions"),
        (["--sequence", "30,30,30"], "coincide"),
        (["--latitude-deg", "90"], "latitude beyond 85"),
        (["--settle-s", "3"], "at least 7 with m1_per_s 1"),
        (["--m2-per-s", "0.1", "--slope", "yes"], "at least 70 with m2_per_s 0.1"),
        (["--reading", "best"], "article, improved or both"),
        (["--head", "x"], "expected an option that --help lists"),
        (["--realisations", "3"], "expected an option that --help lists"),
        (["--scenario", "quiet"], "expected a scenario with a gyro unit"),
    ],
)
def test_bad_input(option: list[str], why: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", "gyrocompass", "--out", str(tmp_path), *option]) == 2
    err = capsys.readouterr().err
    assert why in err
    assert not (tmp_path / "report.html").exists()


def test_a_lost_frame_in_a_window_costs_the_window() -> None:
    """Of three positions nothing is left to conclude from two; of four, three are."""
    for sequence, heading in (("0,90,180", False), ("0,90,180,270", True)):
        with Bench.start(IDEAL) as bench:
            platform = WirePlatform(bench)
            drop(bench, position=2)
            p = ideal(sequence=sequence, method="lsq")
            windows = g.measure(platform, p, Silent())
        assert windows[1].lost > 0
        if heading:
            r = g.estimate(windows, p)
            assert r.get("heading_deg").value == pytest.approx(HEADING_DEG, abs=0.02)
            assert "position 2 (90 deg) does not count" in r.notes[0]
            assert "lost" in r.notes[0]
        else:
            with pytest.raises(LinkError, match=r"no heading from 2 of 3 windows: expected three \(position 2 .*lost"):
                g.estimate(windows, p)


def drop(bench: Bench, position: int) -> None:
    """A frame of the level unit does not reach this program in the window of a position."""
    gyro, level = bench.board(Gyro), bench.board(Psa2)
    host, in_window = bench.host, [False, False]
    ordinary = level.frames.on_message

    def with_a_hole(m: Any) -> None:
        if m.arbitration_id == 0x280 + gyro.node.node_id:
            state = m.data[6] | m.data[7] << 8
            in_window[0] = state >> 3 & 3 == 3 and state >> 5 & 127 == position
        if in_window[0] and not in_window[1] and m.arbitration_id in (0x185, 0x285):
            in_window[1] = m.arbitration_id == 0x285  # both halves of one
            return
        ordinary(m)

    host.listeners.remove(ordinary)
    host.listeners.append(with_a_hole)


def fault(kind: str, point: str, **args: Any) -> GyrocompassResult:
    with Bench.start(IDEAL) as bench:
        platform = WirePlatform(bench)
        bench.fault(kind, point, **args)
        p = ideal(sequence="0,90,180", method="closed3")
        return g.estimate(g.measure(platform, p, Silent()), p)


def test_a_stuck_encoder_is_no_heading() -> None:
    with pytest.raises(LinkError, match="stuck"):
        fault("platform.encoder_stuck", "platform.encoder", at_s=22.0)


def test_a_dead_torquer_never_settles() -> None:
    with pytest.raises(LinkError, match=r"expected a level platform within|never settles"):
        fault("platform.torquer", "platform.level", at_s=0.5)


def test_a_drift_that_jumps_is_seen_in_a_long_run() -> None:
    with Bench.start(IDEAL) as bench:
        platform = WirePlatform(bench)
        bench.fault("platform.drift_step", "platform.level", drift_degph=5.0, at_s=100.0)
        p = ideal(sequence="0,180,90,270", repeat=2)
        r = g.estimate(g.measure(platform, p, Silent()), p)
    assert any("the drift jumped" in d for d in r.doubts)


def test_a_level_unit_that_falls_silent_is_no_heading() -> None:
    with Bench.start(IDEAL) as bench:
        platform = WirePlatform(bench)
        p = ideal(sequence="0,90,180", method="closed3")
        platform.prepare(latitude_rad=p.latitude_rad, m1_per_s=1.0, m2_per_s=2.0)
        platform.level(60.0)
        platform.level_unit.stop()
        bench.wait(0.2)
        with pytest.raises(DeviceError, match="the level unit is silent"):
            platform.level(5.0)


def test_a_wrong_latitude_is_told_when_it_shows() -> None:
    with Bench.start(IDEAL) as bench:
        r = run(bench, ideal(latitude_deg=52.0))
    assert "right at latitude 50.0" in r.doubts[0]


def test_the_other_hemisphere_is_told_by_the_drift_of_the_passport(tmp_path: Path) -> None:
    """-50 for 50 deg: the Earth's horizontal rate is the same, 2 U sin(50 deg) of azimuth drift is not."""
    p = ideal(sequence="0,90,180", method="closed3", latitude_deg=-50.0)
    scenario = tmp_path / "east.yaml"
    text = proto_file(f"scenarios/{IDEAL}.yaml").read_text()
    text = text.replace("heading_deg: 40, pitch_deg: 2, roll_deg: -1.5", "heading_deg: 135, pitch_deg: 1, roll_deg: 1")
    scenario.write_text(text.replace("alpha0_deg: -33", "alpha0_deg: -130"))
    with Bench.start(scenario) as bench:
        windows = g.measure(WirePlatform(bench), p, Silent())
    r = g.estimate(windows, p)
    off_deg = abs(r.get("heading_deg").value - 135.0)
    assert off_deg > 3.0
    assert r.doubts == ()
    assert r.latitude.sign_deg == pytest.approx(off_deg, abs=0.3)
    told = g.estimate(windows, replace(p, drift2_degph=DRIFT_DEGPH, drift2_limit_degph=5.0))
    assert "its passport says 25 +- 5 deg/h: it would be right at latitude 50.0 deg" in told.doubts[0]


def test_the_latitude_is_the_scenario_s(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of its site, unless the operator says otherwise."""
    scenario = tmp_path / "sixty.yaml"
    scenario.write_text(
        proto_file(f"scenarios/{IDEAL}.yaml").read_text().replace("latitude_deg: 50", "latitude_deg: 60")
    )
    argv = ["run", "gyrocompass", "--reading", "article", "--calibrate-s", "0", "--scenario", str(scenario)]
    assert cli.main([*argv, "-v", "--out", str(tmp_path)]) == 0
    section = json.loads((tmp_path / "result.json").read_text())["sections"][0]
    assert section["params"]["latitude_deg"] == 60.0
    assert section["latitude"]["low_deg"] < 60.0 < section["latitude"]["high_deg"]
    assert "deg look alike" in capsys.readouterr().out
    assert cli.main([*argv, "--out", str(tmp_path), "--latitude-deg", "50"]) == 1
    assert "DOUBT: article: the horizontal Earth rate found is 0.77" in capsys.readouterr().out


def impatient(**given: float) -> tuple[str, ...]:
    """Doubts of a run that the procedure itself would refuse: three positions, settled for too short a time."""
    p = ideal(sequence="0,90,180", method="closed3", slope=False)
    with Bench.start(IDEAL) as bench:
        platform = WirePlatform(bench)
        platform.prepare(latitude_rad=p.latitude_rad, m1_per_s=given.get("m1", 1.0), m2_per_s=given.get("m2", 2.0))
        platform.level(60.0)
        table = Table(angles_deg=p.angles_deg, window_s=10.0, settle_s=given.get("settle_s", 10.0))
        return g.estimate(platform.measure(table, lambda _: None), p).doubts


@pytest.mark.parametrize("given", [{"settle_s": 3.0}, {"m1": 0.4}, {"m2": 0.1}], ids=str)
def test_a_rate_that_still_runs_is_a_doubt(given: dict[str, float]) -> None:
    """Each turns this heading by 0.3 deg to a degree; the unit calls all of them settled."""
    assert any("S still runs in its windows" in d for d in impatient(**given))


@pytest.mark.parametrize(("sequence", "method"), [("0,90,180", "closed3"), ("0,180,90,270", "gls")])
def test_a_vehicle_that_turned_between_positions_is_a_doubt(sequence: str, method: str) -> None:
    p = ideal(sequence=sequence, method=method, calibrate_s=0.0)
    with Bench.start(IDEAL) as bench:
        seen = iter((False, True, False, False))

        def turn() -> None:
            if next(seen):
                attitude = {"pitch_deg": PITCH_DEG, "roll_deg": ROLL_DEG}
                bench.control.call("vehicle.attitude", heading_deg=HEADING_DEG + 3.0, **attitude)

        windows = g.measure(WirePlatform(bench), p, Silent(), seen=turn)
    told = [d for d in g.estimate(windows, p).doubts if "the vehicle turned by" in d]
    assert "between positions 2 and 3 the vehicle turned by 3.00 deg" in told[0]


@pytest.mark.parametrize(
    ("spoil", "why", "by_s"),
    [
        (lambda platform: platform.gyro.set(tolerance_arcmin=0.02), "the platform does not settle", 120.0),
        (lambda platform: setattr(platform.gyro, "start", lambda: None), "no reading of the gyro unit came", 160.0),
    ],
    ids=["never settles", "never tells"],
)
def test_a_run_without_windows_gives_up(spoil: Callable[[WirePlatform], object], why: str, by_s: float) -> None:
    """In the settling limit, or when position 1 should long have been measured."""
    p = ideal(sequence="0,90,180", method="closed3")
    with Bench.start(IDEAL) as bench:
        platform = WirePlatform(bench)
        platform.prepare(latitude_rad=p.latitude_rad, m1_per_s=1.0, m2_per_s=2.0)
        platform.level(60.0)
        spoil(platform)
        with pytest.raises(LinkError, match=f"position 1 was .*{why}"):
            platform.measure(p.table, lambda _: None)
        assert bench.time_s < by_s


@pytest.mark.parametrize("slope", [False, True])
def test_the_unit_s_own_step_counts(tmp_path: Path, slope: bool) -> None:
    """50 readings a second instead of 100: lengths, slopes and turns follow."""
    scenario = tmp_path / "slow.yaml"
    text = proto_file(f"scenarios/{IDEAL}.yaml").read_text()
    scenario.write_text(text.replace("    board: gyro\n", "    board: gyro\n    profile_set: {step_ns: 20000000}\n"))
    with Bench.start(scenario) as bench:
        r = run(bench, ideal(sequence="0,90,180", method="closed3", slope=slope))
    assert r.windows[0].step_s == 0.02
    assert r.windows[0].length_s == pytest.approx(15.0)
    assert r.get("heading_deg").value == pytest.approx(HEADING_DEG, abs=0.03)
    assert r.doubts == ()


def test_the_unit_is_asked_again_while_its_gyroscope_runs_up() -> None:
    with Bench.start(IDEAL) as bench:
        platform = WirePlatform(bench)
        platform.prepare(latitude_rad=0.87, m1_per_s=1.0, m2_per_s=2.0)
        platform.gyro.reset()
        platform.level(60.0)
        assert platform.gyro.mode is Mode.LEVEL
