"""The inertial unit through the wire: CAN frames and the table's SCPI alone, compared with the truth port where said."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from psabench.bench import Bench
from psabench.boards.bins.device import Bins, Increments, increments
from psabench.errors import InstrumentError

pytestmark = pytest.mark.host

LATITUDE = np.radians(55.7)
EARTH_RADPS = 7.292115e-5
ARCSEC = np.pi / 648_000
G_MPS2 = 9.8152  # at the site, WGS 84
NO_ERRORS = (
    "gyro_bias_sd_degph: 0, gyro_scale_sd: 0, gyro_misalignment_sd_arcmin: 0, accel_bias_sd_mps2: 0, "
    "accel_scale_sd: 0, accel_misalignment_sd_arcmin: 0, gyro_noise_degph: 0, accel_noise_mps2: 0"
)
TABLE = "{along: x, wobble_arcsec: 0, readout_noise_arcsec_rms: 15, readout_delay_s: 0.05, readout_resolution_arcsec: 0}"
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


def taken(bench: Bench, count: int) -> Increments:
    unit = bench.board(Bins)
    return increments(unit.stream(count), unit.weights())


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
    assert np.radians(now_deg) - angles_rad[0] == pytest.approx(np.radians(10.0) * (t_s - got.end_s[0]), abs=60 * ARCSEC)


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


@pytest.mark.parametrize("scenario", ["sins_table", "sins_coarse"])
def test_three_cycles_of_fifteen_minutes_in_seconds(scenario: str) -> None:
    """The article's plan through CAN: 45 minutes. The wall time is of the emulator and this host together."""
    begun_s = time.monotonic()
    with Bench.start(scenario) as bench:
        unit = bench.board(Bins)
        unit.wait_ready()
        for pose in ((0.0, 0.0), (0.0, -90.0), (90.0, 0.0)):
            for axis, angle_deg in zip((2, 3), pose, strict=True):
                bench.table.position(angle_deg, 10.0, axis=axis)
            bench.table.profile([0.0, 450.0, 900.0], [10.0, -10.0, 0.0])
            got = taken(bench, 90_000)
            assert got.whole.all()
            assert np.unique(np.diff(got.seq) % 65536).tolist() == [1]
    print(f"{time.monotonic() - begun_s:.1f} s")
