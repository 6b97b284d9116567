"""A flight beside the truth that its emulator logged. The host does not see it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psabench.errors import BadInput, expected
from psabench.koi.flight_data import FlightFound
from psabench.koi.geodesy import offset_m, radii_rows_m
from psabench.link.signals import Floats

HOUR_S = 3600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FlightTruth:
    """At m instants of the bench."""

    t_s: Floats  # (m,)
    lat_rad: Floats
    lon_rad: Floats
    h_m: Floats
    v_enu_mps: Floats  # (m, 3)
    heading_rad: Floats
    bank_rad: Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Graded:
    """Errors, found less true, at the seconds of FlightFound.t_s that the truth has."""

    t_s: Floats  # (m,)
    autonomous_m: Floats  # (m, 3) east, north, up
    hybrid_m: Floats
    hybrid_mps: Floats
    heading_rad: Floats  # (m,) of the autonomous attitude
    way_m: Floats  # (m, 2) of the aircraft from its place at first, east, north
    bank_rad: Floats

    def hour_error_m(self, take_off_s: float | None) -> float:
        """The largest horizontal error of the autonomous solution within an hour from take-off."""
        begin_s = self.t_s[0] if take_off_s is None else take_off_s
        within = (self.t_s >= begin_s) & (self.t_s <= begin_s + HOUR_S)
        return float(np.hypot(*self.autonomous_m[within, :2].T).max()) if within.any() else math.nan

    @property
    def hybrid_rms_m(self) -> float:
        return float(np.sqrt(np.mean(np.sum(self.hybrid_m[:, :2] ** 2, axis=1))))


def read_truth(path: Path) -> FlightTruth | None:
    """What `psa-emu --truth-log` wrote; None: there is none. Raises BadInput with the line."""
    if not path.is_file():
        return None
    rows: dict[float, list[float]] = {}
    with path.open(encoding="utf-8") as file:
        for number, line in enumerate(file, start=1):
            if not line.endswith("\n"):
                break
            try:
                got = json.loads(line)
                f = got.get("flight")
                if f is not None:
                    angles = np.radians([f["latitude_deg"], f["longitude_deg"], f["heading_deg"], f["roll_deg"]])
                    rows[got["t_ns"] * 1e-9] = [*angles.tolist(), f["height_m"], *f["v_enu_mps"]]
            except (ValueError, KeyError, TypeError) as e:
                raise BadInput(expected("a record of a flight", e, f"{path}: line {number}")) from e
    if len(rows) < 2:
        return None
    columns = np.array(list(rows.values()))
    return FlightTruth(
        t_s=np.array(list(rows)),
        lat_rad=columns[:, 0],
        lon_rad=columns[:, 1],
        heading_rad=columns[:, 2],
        bank_rad=columns[:, 3],
        h_m=columns[:, 4],
        v_enu_mps=columns[:, 5:],
    )


def grade_flight(found: FlightFound, begin_s: float, truth: FlightTruth) -> Graded | None:
    """begin_s: instant of the bench where the first interval of the increments begins. None: no instant in common."""
    at_s = found.t_s + begin_s
    there = (at_s >= truth.t_s[0]) & (at_s <= truth.t_s[-1])
    if not there.any():
        return None
    at_s, autonomous, hybrid = at_s[there], found.autonomous[there], found.hybrid[there]
    place, speed = _place_at(truth, at_s)
    heading = np.arctan2(autonomous[:, 6], autonomous[:, 9])
    true_heading = np.interp(at_s, truth.t_s, np.unwrap(truth.heading_rad))
    first = np.array([truth.lat_rad[0], truth.lon_rad[0], truth.h_m[0]])
    return Graded(
        t_s=found.t_s[there],
        autonomous_m=offset_m(autonomous[:, :3], place),
        hybrid_m=offset_m(hybrid[:, :3], place),
        hybrid_mps=hybrid[:, 3:6] - speed,
        heading_rad=(heading - true_heading + math.pi) % (2.0 * math.pi) - math.pi,
        way_m=offset_m(place, np.broadcast_to(first, place.shape))[:, :2],
        bank_rad=np.interp(at_s, truth.t_s, truth.bank_rad),
    )


def _place_at(truth: FlightTruth, at_s: Floats) -> tuple[Floats, Floats]:
    """By cubics through places and velocities: 1 mm in turns logged every second."""
    k = np.clip(np.searchsorted(truth.t_s, at_s, side="right") - 1, 0, len(truth.t_s) - 2)
    step = truth.t_s[k + 1] - truth.t_s[k]
    s = ((at_s - truth.t_s[k]) / step)[:, None]
    value = np.stack([truth.lat_rad, truth.lon_rad, truth.h_m], axis=1)
    rate = _place_rates(truth)
    begin, end, r0, r1 = value[k], value[k + 1], rate[k] * step[:, None], rate[k + 1] * step[:, None]
    place = (
        begin * (2 * s**3 - 3 * s**2 + 1)
        + r0 * (s**3 - 2 * s**2 + s)
        + end * (3 * s**2 - 2 * s**3)
        + r1 * (s**3 - s**2)
    )
    speed = np.stack([np.interp(at_s, truth.t_s, truth.v_enu_mps[:, i]) for i in range(3)], axis=1)
    return place, speed


def _place_rates(truth: FlightTruth) -> Floats:
    """Of latitude, longitude, height."""
    meridian, vertical = radii_rows_m(truth.lat_rad, truth.h_m)
    east, north, up = truth.v_enu_mps.T
    return np.stack([north / meridian, east / (vertical * np.cos(truth.lat_rad)), up], axis=1)
