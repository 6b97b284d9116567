"""libpsabench's flight: what it takes, what it refuses. What the motion is: test_flight.py, test_flight.c."""

from __future__ import annotations

import numpy as np
import pytest
from psabench.errors import BadInput
from psabench.native.flight_model import KINDS, Flight, Leg, leg_keys

LEGS: list[Leg] = [{"park_s": 20.0}, {"taxi_m": 200.0}, {"stop_s": 5.0}]


def test_legs_follow_each_other_to_the_end() -> None:
    path = Flight(LEGS, heading_deg=90.0)
    assert path.leg_ns[:2] == [0, 20_000_000_000]
    s = path.states(np.array([0, path.end_ns, path.end_ns + 10**9]))
    assert s.lat_rad[0] == pytest.approx(np.radians(55.7), rel=1e-15)
    assert (s.lon_rad[1] - s.lon_rad[0]) * np.cos(s.lat_rad[0]) * 6.378e6 == pytest.approx(
        235.2, abs=0.1
    )  # 200 m and braking from 8 m/s
    assert s.lon_rad[1] == s.lon_rad[2]
    assert s.v_enu_mps[1].tolist() == [0.0, 0.0, 0.0]


def test_increments_do_not_depend_on_how_they_are_asked() -> None:
    path = Flight(LEGS)
    whole, (first, second) = (
        path.increments(25 * 10**9, 10**7, 20)[1],
        (path.increments(25 * 10**9 + k * 10**8, 10**7, 10)[1] for k in (0, 1)),
    )
    assert np.array_equal(whole, np.vstack([first, second]))


def test_keys_are_those_of_a_scenario() -> None:
    assert leg_keys()[:KINDS] == (
        "park_s",
        "taxi_m",
        "stop_s",
        "turn_deg",
        "takeoff_mps",
        "climb_m",
        "descend_m",
        "fly_s",
        "snake_s",
        "land_mps",
    )
    assert len(leg_keys()) == KINDS + 11


@pytest.mark.parametrize(
    ("legs", "said"),
    [
        ([], r"flight: legs: expected 1 to 64, got 0"),
        ([{"park_s": 1.0}] * 65, r"flight: legs: expected 1 to 64, got 65"),
        ([{"park_s": float("nan")}], r"flight: legs\[0\].park_s: expected 0.1 to 86400, got -?nan"),
        ([{"park_s": 1e300}], r"legs\[0\].park_s: expected 0.1 to 86400, got 1e\+300"),
        ([{"park_s": 1.0}, {"taxi_m": 9.0, "speed_mps": -1.0}], r"legs\[1\].speed_mps: expected 0 to 400, got -1"),
        ([{"park_s": 1.0}, {"takeoff_mps": 80.0}], r"legs\[1\].takeoff_mps: expected"),
        ([{"speed_mps": 1.0}], r"legs\[0\]: expected one of park_s, .*, got none"),
        ([{"park_s": 1.0, "stop_s": 1.0}], r"legs\[0\]: expected one of park_s, .*, got park_s, stop_s"),
        ([{"park_s": 1.0, "colour": 1.0}], r"legs\[0\]: expected speed_mps, .*, got colour"),
    ],
)
def test_what_cannot_be_flown_is_one_line(legs: list[Leg], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        Flight(legs)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"place_deg_m": (86.0, 0.0, 0.0)}, "latitude_deg: expected -85 to 85, got 86"),
        ({"place_deg_m": (0.0, 181.0, 0.0)}, "longitude_deg"),
        ({"place_deg_m": (0.0, 0.0, float("inf"))}, "height_m"),
        ({"jerk_mps3": 0.0}, "jerk_mps3: expected 0.1 to 100, got 0"),
        ({"baro": (-1.0, 0.0, 0.0, 0.0)}, "baro.lag_s: expected 0 to 60, got -1"),
    ],
)
def test_an_aircraft_out_of_range_is_one_line(change: dict[str, object], said: str) -> None:
    with pytest.raises(BadInput, match=said):
        Flight(LEGS, **change)  # type: ignore[arg-type]


def test_times_before_the_beginning_and_intervals_of_nothing_are_errors() -> None:
    path = Flight(LEGS)
    with pytest.raises(BadInput, match="flight: expected times of 0 or more, got -1"):
        path.states(np.array([5, -1]))
    for from_ns, dt_ns, n in ((-1, 10, 1), (0, 0, 1), (0, 10**11, 1), (2**60, 10**9, 100)):
        with pytest.raises(BadInput, match="flight: expected intervals of 1 ns to 10 s"):
            path.increments(from_ns, dt_ns, n)
