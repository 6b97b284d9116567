"""The routes that a fleet flies: ten minutes parked in wind, taxi with three right-angle turns and two stops, take-off
run of 4 m/s2 to 85 m/s, more than an hour in the air with turns, landing. All figures are E0, as those of the scenario
`flight` (docs/procedures/flight.md).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from psabench.link.signals import Floats
from psabench.native.flight_model import Flight, Leg

DT_S, DT_NS = 0.01, 10_000_000
HOUR_S = 3600.0
PARKED: Leg = {"park_s": 600, "roll_deg": 0.05, "roll_s": 2.5, "pitch_deg": 0.02, "pitch_s": 3.5}
TAKE_OFF: Leg = {"takeoff_mps": 85, "accel_mps2": 4}
TAXI_LEFT: tuple[Leg, ...] = (
    {"taxi_m": 300},
    {"turn_deg": -90},
    {"taxi_m": 900},
    {"stop_s": 45},
    {"taxi_m": 300},
    {"turn_deg": -90},
    {"taxi_m": 700},
    {"turn_deg": -90},
    {"taxi_m": 40, "speed_mps": 5},
    {"stop_s": 30},
)
TAXI_RIGHT: tuple[Leg, ...] = (
    {"taxi_m": 500},
    {"turn_deg": 90},
    {"taxi_m": 600},
    {"turn_deg": 90},
    {"taxi_m": 400},
    {"stop_s": 60},
    {"taxi_m": 600},
    {"turn_deg": 90},
    {"taxi_m": 60, "speed_mps": 5},
    {"stop_s": 20},
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Route:
    """What is flown, from where; more than HOUR_S in the air."""

    place_deg_m: tuple[float, float, float]  # latitude, longitude, height
    heading_deg: float
    taxi: tuple[Leg, ...]
    air: tuple[Leg, ...]  # from the end of the run to the landing

    @property
    def legs(self) -> list[Leg]:
        return [PARKED, *self.taxi, TAKE_OFF, *self.air]


ROUTES: Mapping[str, Route] = {
    "north-west": Route(
        place_deg_m=(55.7, 37.5, 150.0),
        heading_deg=30.0,
        taxi=TAXI_RIGHT,
        air=(
            {"climb_m": 600, "rate_mps": 8, "speed_mps": 110},
            {"turn_deg": 60},
            {"climb_m": 5400, "speed_mps": 210},
            {"fly_s": 700},
            {"turn_deg": 110},
            {"fly_s": 700},
            {"turn_deg": -80, "bank_deg": 30},
            {"fly_s": 500},
            {"descend_m": 4500, "speed_mps": 130},
            {"turn_deg": 90},
            {"fly_s": 120},
            {"descend_m": 1500, "rate_mps": 6, "speed_mps": 90},
            {"land_mps": 70},
            {"taxi_m": 500},
            {"stop_s": 60},
        ),
    ),
    "east": Route(
        place_deg_m=(55.7, 37.5, 150.0),
        heading_deg=0.0,
        taxi=TAXI_LEFT,
        air=(
            {"climb_m": 900, "speed_mps": 120},
            {"turn_deg": -150},
            {"climb_m": 6000, "rate_mps": 12, "speed_mps": 230},
            {"fly_s": 1000},
            {"turn_deg": 180, "bank_deg": 30},
            {"fly_s": 1000},
            {"turn_deg": 45},
            {"descend_m": 5900, "rate_mps": 10, "speed_mps": 120},
            {"turn_deg": -60},
            {"descend_m": 1000, "rate_mps": 5, "speed_mps": 90},
            {"land_mps": 70},
            {"stop_s": 60},
        ),
    ),
    "south": Route(
        place_deg_m=(46.3, 48.0, 20.0),
        heading_deg=250.0,
        taxi=TAXI_RIGHT,
        air=(
            {"climb_m": 500, "speed_mps": 110},
            {"turn_deg": 40},
            {"climb_m": 3500, "speed_mps": 160},
            {"snake_s": 1200, "amplitude_deg": 30, "period_s": 600},
            {"turn_deg": -120},
            {"fly_s": 650},
            {"turn_deg": -90},
            {"fly_s": 600},
            {"turn_deg": 70},
            {"descend_m": 3000, "speed_mps": 110},
            {"turn_deg": 90},
            {"descend_m": 1000, "rate_mps": 6, "speed_mps": 90},
            {"land_mps": 70},
            {"stop_s": 60},
        ),
    ),
    "circles": Route(
        place_deg_m=(55.7, 37.5, 150.0),
        heading_deg=120.0,
        taxi=TAXI_LEFT,
        air=(
            {"climb_m": 900, "speed_mps": 120},
            {"turn_deg": 360, "bank_deg": 20},
            {"fly_s": 500},
            {"turn_deg": -180},
            {"fly_s": 500},
            {"turn_deg": -180},
            {"climb_m": 1500, "speed_mps": 140},
            {"fly_s": 500},
            {"turn_deg": 180},
            {"fly_s": 500},
            {"turn_deg": 180, "bank_deg": 30},
            {"fly_s": 350},
            {"turn_deg": -90},
            {"descend_m": 1400, "rate_mps": 6, "speed_mps": 110},
            {"turn_deg": 90},
            {"descend_m": 1000, "rate_mps": 6, "speed_mps": 90},
            {"land_mps": 70},
            {"stop_s": 60},
        ),
    ),
}


@dataclass(frozen=True, kw_only=True, eq=False)
class Journey:
    """A route as it is flown: exact increments of whole seconds, and the truth at any instant."""

    path: Flight
    dtheta_rad: Floats  # (n, 3)
    dv_mps: Floats
    take_off_s: float  # end of the run
    run_s: float  # its beginning

    @property
    def seconds(self) -> int:
        return len(self.dtheta_rad) // round(1.0 / DT_S)


@cache
def fly_route(name: str) -> Journey:
    """Some seconds of work, once a process."""
    return make_journey(ROUTES[name])


def make_journey(route: Route) -> Journey:
    """Raises BadInput for legs that cannot be flown."""
    path = Flight(route.legs, place_deg_m=route.place_deg_m, heading_deg=route.heading_deg)
    n = path.end_ns // 10**9 * 10**9 // DT_NS
    angle, speed = path.increments(0, DT_NS, n)
    run = 1 + len(route.taxi)
    run_s, up_s = path.leg_ns[run] * 1e-9, path.leg_ns[run + 1] * 1e-9
    return Journey(
        path=path,
        dtheta_rad=np.ascontiguousarray(angle),
        dv_mps=np.ascontiguousarray(speed),
        take_off_s=up_s,
        run_s=run_s,
    )
