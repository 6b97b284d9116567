"""The inertial unit through the wire: CAN frames and the table's SCPI alone; the truth port where said."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from psabench.bench import Bench
from psabench.boards.bins.device import Bins, NavState, UnitIncrements, increments_of
from psabench.errors import DeviceError, InstrumentError
from psabench.link.vcd import read_vcd
from psabench.native.strapdown import State, Strapdown
from psabench.sins.secondary.on_bench import record_outputs
from psabench.sins.secondary.outputs import Outputs, Point, matrices_of
from psabench.sins.table import Move

pytestmark = pytest.mark.host

LATITUDE = np.radians(55.7)
EARTH_RADPS = 7.292115e-5
ARCSEC = np.pi / 648_000
G_MPS2 = 9.8152  # at the site, WGS 84
NO_ERRORS = (
    "gyro_bias_sd_degph: 0, gyro_scale_sd: 0, gyro_misalignment_sd_arcmin: 0, accel_bias_sd_mps2: 0, "
    "accel_scale_sd: 0, accel_misalignment_sd_arcmin: 0, gyro_noise_degph: 0, accel_noise_mps2: 0"
)
TABLE = (
    "{along: x, wobble_arcsec: 0, readout_noise_arcsec_rms: 15, readout_delay_s: 0.05, readout_resolution_arcsec: 0}"
)
IDEAL = f"""seed: 1
site: {{latitude_deg: 55.7, longitude_deg: 37.5, height_m: 150}}
table: {{axes: [{TABLE}]}}
units:
  - {{name: sins, board: bins, on: table, adc_chain: direct, adc_noise_scale: 0, profile_set: {{{NO_ERRORS}}}}}
"""


def ideal(folder: Path, table: str = "") -> Path:
    path = folder / "ideal.yaml"
    path.write_text(IDEAL.replace("{axes:", f"{{{table}axes:"))
    return path


def taken(bench: Bench, count: int) -> UnitIncrements:
    unit = bench.board(Bins)
    return increments_of(unit.stream(count), unit.weights())


def test_at_rest_it_shows_earth_and_gravity(tmp_path: Path) -> None:
    with Bench.start(ideal(tmp_path)) as bench:
        bench.board(Bins).wait_ready()
        got = taken(bench, 1000)
    assert got.whole.all()
    assert np.unique(np.diff(got.seq)).tolist() == [1]
    assert np.allclose(np.diff(got.end_s), 0.01, atol=2e-6)
    earth = EARTH_RADPS * np.array([np.cos(LATITUDE), 0.0, -np.sin(LATITUDE)])
    assert np.abs(got.dtheta_rad.sum(axis=0) - earth * 10.0).max() < 0.011 * ARCSEC
    assert np.abs(got.dv_mps.sum(axis=0) - [0.0, 0.0, -G_MPS2 * 10.0]).max() < 2e-3  # gravity as rounded above


def test_increments_of_angle_are_the_table_s(tmp_path: Path) -> None:
    """The readout is 50 ms late and has 15 arcsec of noise: their mean over 400 angles is good to 1 arcsec."""
    with Bench.start(ideal(tmp_path)) as bench:
        unit = bench.board(Bins)
        unit.wait_ready()
        bench.table.rate(10.0)
        bench.run_for(1.0)
        got = taken(bench, 900)
        sums_rad = np.cumsum(got.dtheta_rad[:, 0] - EARTH_RADPS * np.cos(LATITUDE) * 0.01)
        angles_rad = np.radians(bench.table.log(got.end_s[0], 0.02, 400))
        t_s, now_deg = bench.table.stamped()
    off_rad = angles_rad - sums_rad[::2][:400]
    assert np.std(off_rad) == pytest.approx(15 * ARCSEC, rel=0.15)
    late_s = -(np.diff(angles_rad).mean() / 0.02 - np.radians(10.0)), np.mean(off_rad)
    assert abs(late_s[0]) < 1e-5
    # against the angle of the stamped reading, which is as late: the rate alone lies between the two
    assert np.radians(now_deg) - angles_rad[0] == pytest.approx(
        np.radians(10.0) * (t_s - got.end_s[0]), abs=60 * ARCSEC
    )


def test_the_table_keeps_no_log_beyond_its_motions_and_a_coarse_one_none(tmp_path: Path) -> None:
    with Bench.start(ideal(tmp_path)) as bench:
        for _ in range(5):
            bench.run_for(1.0)
            bench.table.rate(5.0)
        with pytest.raises(InstrumentError, match="expected instants from 2"):
            bench.table.log(0.5, 0.1, 10)
        with pytest.raises(InstrumentError, match="expected instants from"):
            bench.table.log(4.5, 0.1, 100)
        assert len(bench.table.log(2.1, 0.001, 900)) == 900
    with Bench.start(ideal(tmp_path, "coarse: true, ")) as bench:
        assert bench.table.stamped()[1] == 9.91e37
        with pytest.raises(InstrumentError, match="it is coarse"):
            bench.table.log(0.0, 0.1, 1)
        bench.table.position(90.0)  # it turns all the same


def test_noise_is_that_of_the_article_at_all_averages() -> None:
    """White: the deviation of means falls with the square root of their length, from 0.01 s to 1 s."""
    with Bench.start("sins_table") as bench:
        bench.board(Bins).wait_ready()
        got = taken(bench, 20_000)
    for values, of_a_second in ((got.dtheta_rad / 0.01 / ARCSEC, 0.1), (got.dv_mps / 0.01, 1e-3)):  # 0.1 deg/h = 0.1"/s
        for n in (1, 10, 100):
            means = values.reshape(-1, n, 3).mean(axis=1)
            floor = 0.01 / 0.01 / np.sqrt(6) / n if of_a_second == 0.1 else 0.0  # of the counts: triangular, over n
            want = np.hypot(of_a_second / np.sqrt(0.01 * n), floor)
            assert np.std(means, axis=0) == pytest.approx(want, rel=0.06 if n < 100 else 0.18)


def test_what_the_unit_shows_is_what_was_drawn_for_it() -> None:
    """There and back about x on a coarse table: drift and scale of gyro X, zero and scale of accelerometers Y and Z."""
    with Bench.start("sins_coarse") as bench:
        bench.board(Bins).wait_ready()
        turns = []
        for angle_deg in (360.0, 0.0):
            bench.table.position(angle_deg, 12.0, wait=False)
            turns.append(taken(bench, 3500))
        specimen = bench.truth()["units"]["sins"]["specimen"]
    there, back = (t.dtheta_rad[:, 0].sum() for t in turns)
    scale = (there - back) / (4.0 * np.pi) - 1.0
    drift_radps = (there + back) / 70.0 - EARTH_RADPS * np.cos(LATITUDE)
    assert scale == pytest.approx(specimen["theta_11"], abs=1.3e-6)  # four times 0.1 deg/h over 35 s
    assert drift_radps == pytest.approx(specimen["nu0_1_radps"], abs=0.06 * ARCSEC)
    # in a turn at a constant rate gravity is a circle in y and z: centre and axes of what is measured
    steady = turns[0].dv_mps[400:2700, 1:] / 0.01
    angle = np.cumsum(turns[0].dtheta_rad[:, 0])[400:2700]
    base = np.stack([np.ones_like(angle), np.sin(angle), np.cos(angle)], axis=1)
    (zero_y, sin_y, cos_y), (zero_z, sin_z, cos_z) = np.linalg.lstsq(base, steady, rcond=None)[0].T
    noise = 5 * 1e-3 / np.sqrt(23.0)
    assert zero_y == pytest.approx(specimen["df0_2_mps2"], abs=noise)
    assert zero_z == pytest.approx(specimen["df0_3_mps2"], abs=noise)
    assert np.hypot(sin_y, cos_y) / G_MPS2 - 1 == pytest.approx(specimen["gamma_22"], abs=noise / 5)
    assert np.hypot(sin_z, cos_z) / G_MPS2 - 1 == pytest.approx(specimen["gamma_33"], abs=noise / 5)


def test_faults_show_in_the_flags_and_end(tmp_path: Path) -> None:
    with Bench.start(ideal(tmp_path)) as bench:
        unit = bench.board(Bins)
        unit.wait_ready()
        with bench.fault("controller.frozen_words", "sins.computer"):
            got = taken(bench, 20)
            assert (got.dtheta_rad == got.dtheta_rad[0]).all()
        with bench.fault("chip.dout_dead", "sins.adc.y", level="high"):
            assert np.ptp(taken(bench, 20).dv_mps[5:, 1]) == 0.0
        with bench.fault("sensor.bias", "sins.sensor.x", bias_v=12.0):
            assert unit.stream(20)["CLIP"][5:].all()
        with bench.fault("chip.drdy_stuck", "sins.adc.x", level="high"):
            bench.run_for(0.5)
            assert unit.node.read(0x1001) & 0x81 == 0x81
        bench.run_for(0.2)
        assert taken(bench, 20).whole.all()
        assert unit.counters()["Missed words"] > 100
        assert unit.node.read(0x1001) == 0


@pytest.mark.parametrize(
    ("kind", "values", "due_dps"),
    [
        ("gyro.stuck", {}, 0.0),
        ("gyro.saturation", {"limit_dps": 4.0}, 4.0),
        ("gyro.bias", {"drift_degph": 360.0}, 10.1),
        ("gyro.scale", {"scale_ppm": -1e4}, 9.9),
        ("gyro.lock_in", {"lock_in_degph": 21_600.0}, 8.0),  # 6 deg/s: 10^2 - 6^2 = 8^2
    ],
)
def test_a_fault_of_a_gyro_shows_in_its_increments_alone_and_ends(
    tmp_path: Path, kind: str, values: dict[str, float], due_dps: float
) -> None:
    earth = EARTH_RADPS * np.cos(LATITUDE)

    def rate_dps() -> float:
        got = taken(bench, 110)
        assert got.whole.all()
        assert np.abs(got.dtheta_rad[10:, 1:]).max() < 2 * EARTH_RADPS * 0.01
        return float(np.degrees(got.dtheta_rad[10:, 0].mean() / 0.01 - earth))

    with Bench.start(ideal(tmp_path)) as bench:
        bench.board(Bins).wait_ready()
        bench.table.rate(10.0)
        bench.run_for(3.0)
        assert rate_dps() == pytest.approx(10.0, abs=1e-5)
        with bench.fault(kind, "sins.gyro.x", **values):
            assert rate_dps() == pytest.approx(due_dps, abs=5e-3)  # a multiple of the Earth's rate, 0.0024 deg/s
        assert rate_dps() == pytest.approx(10.0, abs=1e-5)


def test_three_cycles_of_fifteen_minutes_in_seconds() -> None:
    """The article's plan through CAN: 45 minutes. What is printed is the wall time of emulator and host together."""
    begun_s = time.monotonic()
    with Bench.start("sins_table") as bench:
        bench.board(Bins).wait_ready()
        for axis, pose in enumerate(((0.0, 0.0), (0.0, -90.0), (90.0, 0.0))):
            for which, angle_deg in zip((2, 3), pose, strict=True):
                bench.table.position(angle_deg, 10.0, axis=which)
            bench.table.profile([0.0, 450.0, 900.0], [10.0, -10.0, 0.0])
            got = taken(bench, 90_000)
            assert got.whole.all()
            assert np.unique(np.diff(got.seq) % 65536).tolist() == [1]
            most = np.abs(np.cumsum(got.dtheta_rad, axis=0)).max(axis=0)
            assert np.degrees(most[axis]) == pytest.approx(4500.0, abs=15.0)
            assert np.degrees(np.delete(most, axis)).max() < 20.0
    print(f"{time.monotonic() - begun_s:.1f} s")


def test_weight_and_delay_are_those_of_the_converters_as_they_are_set() -> None:
    """Before set-up those of their registers after reset."""
    with Bench.start("sins_table") as bench:
        node = bench.board(Bins).node
        first = (node.read(0x2220, 2), node.read(0x2221, 3))
        bench.board(Bins).wait_ready()
        ready = (node.read(0x2220, 2), node.read(0x2221, 3))
    assert first == (pytest.approx(19.4835, abs=1e-4), pytest.approx(30.909e6, abs=1e3))
    assert ready == (pytest.approx(19.4808, abs=1e-4), pytest.approx(10.1135e6, abs=1e2))


def test_tick_is_where_the_interval_ends(tmp_path: Path) -> None:
    with Bench.start(ideal(tmp_path)) as bench:
        bench.board(Bins).wait_ready()
        with bench.trace(tmp_path / "tick.vcd") as path:
            got = taken(bench, 30)
    tick = read_vcd(Path(path)).wires["TICK"]
    rises_us = np.round(tick.edges_ns(1) / 1e3)
    assert set(np.round(got.end_s * 1e6)[1:-1]) <= set(rises_us)
    assert np.unique(tick.edges_ns(0)[-20:] - tick.edges_ns(1)[-20:]).tolist() == [100_000]


def test_it_navigates_as_the_host_s_integrator_does(tmp_path: Path) -> None:
    """A minute at rest, two minutes of turns; accelerometers have zeros; the host aligns by the same increments."""
    path = tmp_path / "s.yaml"
    path.write_text(IDEAL.replace(NO_ERRORS, f"{NO_ERRORS}, accel_bias_mps2: [0.003, -0.002, 0.001]"))
    with Bench.start(path) as bench:
        unit = bench.board(Bins)
        unit.wait_ready()
        unit.frames.forget()
        unit.start()
        bench.run_for(0.1)
        outputs = unit.navigate(55.7, 37.5, 150.0, 60, increments=True)
        bench.run_for(62.0)
        assert unit.navigation() is NavState.NAVIGATING
        bench.table.rate(5.0)
        bench.run_for(120.0)
        unit.stop()
        got, shown = increments_of(unit.frames.take(), unit.weights()), outputs.take()
    first = int(np.argmin(np.abs(got.end_s - shown.t_sample_s[0]))) + 1  # readings of the alignment
    rest = slice(first - 6000, first)
    up = got.dv_mps[rest].sum(axis=0)
    up /= np.linalg.norm(up)
    east = np.cross(got.dtheta_rad[rest].sum(axis=0), up)
    east /= np.linalg.norm(east)
    start = State(
        lat_rad=np.radians(55.7),
        lon_rad=np.radians(37.5),
        h_m=150.0,
        v_n_mps=np.zeros(3),
        C_nb=np.stack([east, np.cross(up, east), up]),
    )
    host = Strapdown(start, height_fixed=True)
    rows = host.advance(got.dtheta_rad[first:], got.dv_mps[first:], 0.01)[19::20][: len(shown) - 1]
    n = len(rows)
    place_m = (np.radians(np.column_stack([shown["LAT"], shown["LON"]]))[1 : n + 1] - rows[:, :2]) * 6.4e6
    speed_mps = np.column_stack([shown["VE"], shown["VN"]])[1 : n + 1] - rows[:, 3:5]
    assert n >= 590
    assert np.abs(rows[-1, 3:5]).max() > 0.1  # the zeros carry it away
    assert np.abs(place_m).max() < 0.02  # rounded to 1 cm
    assert np.abs(speed_mps).max() < 3e-4
    q = np.stack([shown[f"Q{k}"] for k in range(4)], axis=1)[1 : n + 1]
    turned = np.abs(matrices_of(q / np.linalg.norm(q, axis=1)[:, None]) - rows[:, 6:].reshape(-1, 3, 3)).max()
    assert turned < 1e-4  # a quaternion's steps are 3e-5
    assert shown["WX"][-1] == pytest.approx(5.0, abs=0.005)


def test_navigation_is_refused_before_a_reading_and_fails_on_a_table_that_turns(tmp_path: Path) -> None:
    with Bench.start(ideal(tmp_path)) as bench:
        unit = bench.board(Bins)
        with pytest.raises(DeviceError, match="08000022"):
            unit.navigate(55.7, 37.5, 150.0, 10)
        assert "no reading has come yet" in unit.refusal()
        unit.wait_ready()
        bench.table.rate(1.0)
        bench.run_for(1.0)
        unit.navigate(55.7, 37.5, 150.0, 10)
        bench.run_for(1.0)
        assert unit.navigation() is NavState.FAILED


def test_what_a_run_cut_short_has_shown_is_kept() -> None:
    """Half a minute of a plan, then Ctrl-C."""

    def interrupt() -> None:
        raise KeyboardInterrupt

    kept: list[Outputs] = []
    point = Point(lat_rad=np.radians(55.7), lon_rad=np.radians(37.5), h_m=150.0)
    with Bench.start("sins_secondary") as bench, pytest.raises(KeyboardInterrupt):
        kept.extend(record_outputs(bench, [Move(axis=1, rate_dps=5.0, duration_s=60.0)], point, 20, interrupt))
    assert [150 < len(k) < 160 for k in kept] == [True]  # 31 s, five a second
