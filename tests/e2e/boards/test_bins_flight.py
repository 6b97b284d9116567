"""An ideal inertial unit in the aircraft: what comes over CAN is the flight's own increments, reading by reading."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from psabench.bench import Bench
from psabench.boards.bins.device import Bins, increments_of
from psabench.boards.objects import BinsObjects as OD
from psabench.boards.objects import Common
from psabench.boards.unit import TPDO_OFF
from psabench.errors import DeviceError
from psabench.native.flight_model import Flight, Leg

pytestmark = pytest.mark.host

ARCSEC = np.pi / 648_000
NO_RTR = 1 << 30  # of a COB-ID of a TPDO
NO_ERRORS = (
    "gyro_bias_sd_degph: 0, gyro_scale_sd: 0, gyro_misalignment_sd_arcmin: 0, accel_bias_sd_mps2: 0, "
    "accel_scale_sd: 0, accel_misalignment_sd_arcmin: 0, gyro_noise_degph: 0, accel_noise_mps2: 0"
)
LEGS: list[Leg] = [
    {"park_s": 8, "roll_deg": 0.5, "roll_s": 3},
    {"taxi_m": 60, "speed_mps": 6},
    {"turn_deg": 90, "radius_m": 20},
    {"takeoff_mps": 85},
    {"climb_m": 100},
    {"turn_deg": 30},
    {"land_mps": 70},
    {"stop_s": 5},
]


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return Flight(LEGS, heading_deg=50.0)


def lagged(h_m: np.ndarray, step_s: float, lag_s: float) -> np.ndarray:
    """Of lag y' = h - y, h straight between steps; at rest before."""
    y, keep = h_m.copy(), np.exp(-step_s / lag_s)
    for k in range(1, len(h_m)):
        slope = (h_m[k] - h_m[k - 1]) / step_s
        y[k] = h_m[k] - lag_s * slope + (y[k - 1] - h_m[k - 1] + lag_s * slope) * keep
    return y


def scenario(folder: Path, flight_keys: str = "") -> Path:
    file = folder / "flight.yaml"
    legs = ", ".join("{" + ", ".join(f"{k}: {v}" for k, v in leg.items()) + "}" for leg in LEGS)
    file.write_text(f"""seed: 1
site: {{latitude_deg: 55.7, longitude_deg: 37.5, height_m: 150}}
flight: {{heading_deg: 50, legs: [{legs}]{flight_keys}}}
units:
  - {{name: sins, board: bins, on: flight, adc_chain: direct, adc_noise_scale: 0, profile_set: {{{NO_ERRORS}}}}}
""")
    return file


def test_each_reading_is_the_increment_of_its_interval(path: Flight, tmp_path: Path) -> None:
    """Angle to a count of 0.01 arcsec. Velocity to half a code of a word that is truncated, and what the converter's
    filter makes of a force that changes within its word."""
    with Bench.start(scenario(tmp_path)) as bench:
        unit = bench.board(Bins)
        unit.wait_ready()
        got = increments_of(unit.stream(8500), unit.weights())
    assert got.whole.all()
    ends_ns = np.round(got.end_s * 1e9).astype(np.int64)
    assert ends_ns[0] < 2 * 10**9  # parked
    assert ends_ns[-1] > path.leg_ns[5] + 5 * 10**9  # banked
    true = [path.increments(int(begin), int(end - begin), 1) for begin, end in pairwise(ends_ns)]
    angle, speed = (np.vstack([t[i] for t in true]) for i in (0, 1))
    off_rad, off_mps = got.dtheta_rad[1:] - angle, got.dv_mps[1:] - speed
    assert np.abs(off_rad).max() < 0.0101 * ARCSEC + 1e-7 * np.abs(angle / 0.01).max()  # TSTAMP counts 0.1 us
    assert np.abs(off_rad.sum(axis=0)).max() < 0.02 * ARCSEC
    assert np.abs(off_mps).max() < 3e-6
    assert np.abs(off_mps.sum(axis=0)).max() < 4.9e-6 * 85.0  # half a code
    assert np.abs(speed[:, 0]).max() > 0.035  # the run: 4 m/s2
    assert np.degrees(np.abs(angle[:, 0]).max()) > 0.05  # the bank: 8 deg/s


def test_the_unit_sends_what_the_altimeter_shows(path: Flight, tmp_path: Path) -> None:
    """With each reading, of its instant."""
    keys = ", baro: {lag_s: 0.8, scale_ppm: 3000, offset_m: 12, drift_m_per_h: 90}"
    with Bench.start(scenario(tmp_path, keys)) as bench:
        unit = bench.board(Bins)
        unit.wait_ready()
        unit.also("BINS_BARO")
        got = unit.stream(8000)
    t_ns = np.round(got.t_sample_s * 1e9).astype(np.int64)
    grid_ns = np.arange(0, t_ns[-1] + 20_000_000, 10_000_000)
    shown = 1.003 * lagged(path.states(grid_ns).h_m, 0.01, 0.8) + 12.0 + 90.0 * grid_ns * 1e-9 / 3600.0
    assert np.ptp(shown) > 90.0
    assert np.abs(got["HBARO"] - np.interp(t_ns, grid_ns, shown)).max() < 0.0025  # it counts 1 mm, the grid bends


def test_a_unit_on_a_table_shows_the_height_of_the_site(tmp_path: Path) -> None:
    file = tmp_path / "table.yaml"
    file.write_text("seed: 1\nsite: {latitude_deg: 55.7, height_m: 163.5}\nunits: [{name: sins, board: bins}]\n")
    with Bench.start(file) as bench:
        unit = bench.board(Bins)
        unit.wait_ready()
        unit.also("BINS_BARO")
        assert set(unit.stream(10)["HBARO"]) == {163.5}
        assert unit.node.read(OD.BARO, 1) == 163500


def test_beyond_node_95_the_height_needs_an_identifier_of_the_host(tmp_path: Path) -> None:
    """680h + node is in 6E0h to 6FFh there, which CiA 301 keeps from PDOs."""
    file = tmp_path / "table.yaml"
    file.write_text("seed: 1\nsite: {latitude_deg: 10, height_m: 20}\nunits: [{name: sins, board: bins, node: 96}]\n")
    with Bench.start(file) as bench:
        unit = bench.board(Bins)
        unit.wait_ready()
        with pytest.raises(DeviceError, match=r"0609.?0030"):
            unit.also("BINS_BARO")
        unit.node.write(Common.TPDO + 4, 1, TPDO_OFF | NO_RTR | 0x190)
        unit.node.write(Common.TPDO + 4, 1, NO_RTR | 0x190)
        assert int(unit.node.read(Common.TPDO + 4, 1)) == NO_RTR | 0x190


def test_the_truth_port_has_the_aircraft(path: Flight, tmp_path: Path) -> None:
    with Bench.start(scenario(tmp_path)) as bench:
        bench.run_for(60.0)
        t_ns = round(bench.time_s * 1e9)
        state = bench.truth_state()["flight"]
    true = path.states(np.array([t_ns]))
    assert state["kind"] == next(iter(LEGS[state["leg"]]))
    assert path.leg_ns[state["leg"]] <= t_ns < path.leg_ns[state["leg"] + 1]
    found = [
        state[k]
        for k in ("latitude_deg", "longitude_deg", "height_m", "heading_deg", "pitch_deg", "roll_deg", "baro_m")
    ]
    assert found == pytest.approx(
        [
            *np.degrees([true.lat_rad[0], true.lon_rad[0]]), true.h_m[0],
            *np.degrees([true.heading_rad[0], true.pitch_rad[0], true.roll_rad[0]]), true.baro_m[0],
        ],
        rel=1e-12, abs=1e-12,
    )  # fmt: skip
    assert state["v_enu_mps"] == pytest.approx(true.v_enu_mps[0].tolist(), abs=1e-12)
    assert state["a_enu_mps2"] == pytest.approx(true.a_enu_mps2[0].tolist(), abs=1e-12)
