"""A level flight with a heading that swings, as data, and what an ideal unit measures on it.

n is east, north, up, b the unit's axes as `axes` mounts them. The aircraft banks so that a turn has no side force.
Place comes from the velocity by Simpson's rule over half steps; rates and forces are those of the equations of motion
at each instant, so that increments differ from the exact ones by the rule's error alone.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from psabench.errors import BadInput, expected
from psabench.named_yaml import checked_number, read_named
from psabench.native.nav_errors import Way
from psabench.native.strapdown import Floats, dcm, gravity_mps2, radii_m
from psabench.sins.alignment import EARTH_RADPS

NAMED = ("snake", "straight")  # of proto/flights
ALONG: Mapping[
    str, tuple[float, float, float]
] = {  # where an axis of the unit points in the aircraft: right, forward, up
    "right": (1.0, 0.0, 0.0),
    "left": (-1.0, 0.0, 0.0),
    "forward": (0.0, 1.0, 0.0),
    "back": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0),
    "down": (0.0, 0.0, -1.0),
}
LIMITS: Mapping[str, tuple[float, float]] = {
    "speed_mps": (1.0, 1000.0),
    "height_m": (-500.0, 30000.0),
    "latitude_deg": (-80.0, 80.0),
    "longitude_deg": (-180.0, 180.0),
    "heading_deg": (-360.0, 360.0),
    "amplitude_deg": (0.0, 180.0),
    "period_s": (10.0, 1e5),
    "duration_s": (1.0, 86400.0),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight:
    """Heading = heading_deg + amplitude_deg sin(2 pi t / period_s), at one speed and height over the ellipsoid."""

    speed_mps: float = 210.0
    height_m: float = 10000.0
    latitude_deg: float = 55.7
    longitude_deg: float = 37.5
    heading_deg: float = 60.0
    amplitude_deg: float = 30.0
    period_s: float = 600.0
    duration_s: float = 3600.0
    axes: tuple[str, str, str] = ("forward", "left", "up")  # z1, z2, z3 of the unit

    @property
    def mounting(self) -> Floats:
        """(3, 3): from coordinates in the unit to right, forward, up."""
        return np.array([ALONG[a] for a in self.axes]).T

    def heading_rad(self, t_s: Floats, derivative: int = 0) -> Floats:
        """And its derivatives by time."""
        k = 2.0 * math.pi / self.period_s
        swing = math.radians(self.amplitude_deg) * k**derivative * np.sin(k * t_s + derivative * math.pi / 2.0)
        return np.asarray(swing + (math.radians(self.heading_deg) if derivative == 0 else 0.0))

    @property
    def bank_deg(self) -> float:
        """The steepest."""
        rate = math.radians(self.amplitude_deg) * 2.0 * math.pi / self.period_s
        return math.degrees(
            math.atan(self.speed_mps * rate / gravity_mps2(math.radians(self.latitude_deg), self.height_m))
        )


def read_flight(name: str) -> Flight:
    """Of this name (NAMED) or a YAML file with the fields of Flight. Raises BadInput with the file and the key."""
    found, path = read_named(name, NAMED, "flights", "--flight", "a flight")
    if not isinstance(found, dict) or set(found) - set(LIMITS) - {"axes"}:
        raise BadInput(expected(" ".join([*LIMITS, "axes"]), str(found)[:80], path))
    axes = _read_axes(found.pop("axes", "forward left up"), f"{path}: axes")
    numbers = {key: checked_number(value, *LIMITS[key], f"{path}: {key}") for key, value in found.items()}
    return Flight(axes=axes, **numbers)


def _read_axes(value: object, where: str) -> tuple[str, str, str]:
    words = str(value).split()
    want = f"three of {', '.join(ALONG)}, right-handed"
    if len(words) != 3 or set(words) - set(ALONG):
        raise BadInput(expected(want, value, where))
    axes = (words[0], words[1], words[2])
    if np.linalg.det(np.array([ALONG[a] for a in axes])) < 0.5:
        raise BadInput(expected(want, value, where))
    return axes


@dataclass(frozen=True, slots=True, kw_only=True)
class Flown:
    """A flight at the ends of its steps, and increments between them."""

    dt_s: float
    states: Floats  # (n + 1, 15)
    dtheta_rad: Floats  # (n, 3)
    dv_mps: Floats  # (n, 3)

    def way(self) -> Way:
        """For the error model."""
        return Way(
            dt_s=self.dt_s,
            states=self.states[:-1],
            w_b_radps=self.dtheta_rad / self.dt_s,
            f_b_mps2=self.dv_mps / self.dt_s,
        )


def fly_steps(flight: Flight, dt_s: float) -> Flown:
    """The flight in steps of dt_s."""
    n = round(flight.duration_s / dt_s)
    t_s: Floats = 0.5 * dt_s * np.arange(2 * n + 1, dtype=np.float64)
    place = _place_rows(flight, t_s)
    w_a, f_a, c_na, v_n = _felt_by_unit(flight, t_s, place[:, 0])
    w_b, f_b, c_nb = w_a @ flight.mounting, f_a @ flight.mounting, c_na @ flight.mounting
    rows = np.hstack([place, v_n, c_nb.reshape(-1, 9)])
    return Flown(dt_s=dt_s, states=rows[::2], dtheta_rad=_simpson_rule(w_b, dt_s), dv_mps=_simpson_rule(f_b, dt_s))


def rest_state(flight: Flight) -> Floats:
    """State on the ground at the start, level, with the heading of the start: where the unit is aligned."""
    c_nb = dcm(float(flight.heading_rad(np.zeros(1))[0]), 0.0, 0.0) @ flight.mounting
    place = [math.radians(flight.latitude_deg), math.radians(flight.longitude_deg), 0.0]
    return np.concatenate([place, np.zeros(3), c_nb.ravel()])


def _simpson_rule(values: Floats, dt_s: float) -> Floats:
    return np.asarray((values[:-2:2] + 4.0 * values[1::2] + values[2::2]) * (dt_s / 6.0))


def _place_rows(flight: Flight, t_s: Floats) -> Floats:
    """Latitude, longitude, height; Runge and Kutta's fourth order on the grid of t_s."""
    step = float(t_s[1] - t_s[0])
    speed = flight.speed_mps
    ahead = flight.heading_rad(np.stack([t_s, t_s + 0.5 * step, t_s + step], -1))
    east, north = speed * np.sin(ahead), speed * np.cos(ahead)
    lat, lon = math.radians(flight.latitude_deg), math.radians(flight.longitude_deg)
    out = np.empty((len(t_s), 3))
    out[:, 2] = flight.height_m
    for k in range(len(t_s)):
        out[k, :2] = lat, lon
        meridian, vertical = radii_m(lat, flight.height_m)
        n, e = north[k], east[k]
        lat_mid = lat + 0.5 * step * n[0] / meridian
        # Radii change by 1e-9 within a step; the cosine is what counts.
        lat_after = lat + step * (n[0] + 4.0 * n[1] + n[2]) / (6.0 * meridian)
        rate = [e[i] / (vertical * math.cos(x)) for i, x in enumerate((lat, lat_mid, lat_after))]
        lon += step * (rate[0] + 4.0 * rate[1] + rate[2]) / 6.0
        lat = lat_after
    return out


def _felt_by_unit(flight: Flight, t_s: Floats, lat: Floats) -> tuple[Floats, Floats, Floats, Floats]:
    """Rate, force and C_n of right, forward, up, and v_n at each instant."""
    radii = np.array([radii_m(x, flight.height_m) for x in lat])
    g = np.array([gravity_mps2(x, flight.height_m) for x in lat])
    psi, psi1, psi2 = (flight.heading_rad(t_s, k) for k in range(3))
    z = np.zeros_like(psi)
    v = flight.speed_mps * np.stack([np.sin(psi), np.cos(psi), z], -1)
    dv = flight.speed_mps * psi1[:, None] * np.stack([np.cos(psi), -np.sin(psi), z], -1)
    u = EARTH_RADPS * np.stack([z, np.cos(lat), np.sin(lat)], -1)
    rho = np.stack([-v[:, 1] / radii[:, 0], v[:, 0] / radii[:, 1], v[:, 0] * np.tan(lat) / radii[:, 1]], -1)
    f_n = dv + np.cross(2.0 * u + rho, v)
    f_n[:, 2] += g
    bank = np.arctan(flight.speed_mps * psi1 / g[0])
    bank1 = flight.speed_mps * psi2 / g[0] * np.cos(bank) ** 2
    c_nb = _banked_attitude(psi, bank)
    to_b = np.swapaxes(c_nb, 1, 2)
    w_nb = np.stack([psi1 * np.sin(bank), bank1, -psi1 * np.cos(bank)], -1)
    return np.einsum("nij,nj->ni", to_b, u + rho) + w_nb, np.einsum("nij,nj->ni", to_b, f_n), c_nb, v


def _banked_attitude(psi: Floats, bank: Floats) -> Floats:
    """Right, forward, up of a unit with its nose level."""
    s, c, sr, cr, z = np.sin(psi), np.cos(psi), np.sin(bank), np.cos(bank), np.zeros_like(psi)
    rows = [[c * cr, s, c * sr], [-s * cr, c, -s * sr], [-sr, z, cr]]
    return np.stack([np.stack(r, -1) for r in rows], -2)
