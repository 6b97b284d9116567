"""Places on the ellipsoid of WGS 84, and what lies between them.

A place is a row: latitude and longitude, rad, height, m.
"""

from __future__ import annotations

import numpy as np

from psabench.link.signals import Floats

A_M, E2 = 6_378_137.0, 6.694379990141317e-3
MILE_M = 1852.0  # the article's mile in an hour, read as a nautical one


def radii_rows_m(lat_rad: Floats, h_m: Floats) -> tuple[Floats, Floats]:
    """Radii of curvature plus height, of the meridian and of the prime vertical, (m,)."""
    w = np.sqrt(1.0 - E2 * np.sin(lat_rad) ** 2)
    return A_M * (1.0 - E2) / w**3 + h_m, A_M / w + h_m


def offset_m(place: Floats, true: Floats) -> Floats:
    """East, north, up of places from other ones nearby, (m, 3)."""
    meridian, vertical = radii_rows_m(true[:, 0], true[:, 2])
    off = place - true
    return np.stack([off[:, 1] * vertical * np.cos(true[:, 0]), off[:, 0] * meridian, off[:, 2]], axis=1)


def moved_place(place: Floats, off_m: Floats) -> Floats:
    """Places moved by east, north, up: the inverse of offset_m()."""
    meridian, vertical = radii_rows_m(place[:, 0], place[:, 2])
    off = np.stack([off_m[:, 1] / meridian, off_m[:, 0] / (vertical * np.cos(place[:, 0])), off_m[:, 2]], axis=1)
    return np.asarray(place + off)
