"""Offsets of places beside the library's radii, and there and back."""

from __future__ import annotations

import numpy as np
import pytest
from psabench.koi.geodesy import moved_place, offset_m, radii_rows_m
from psabench.native.strapdown import radii_m

PLACES = np.array([[0.97, 0.65, 150.0], [-1.4, -3.0, 9000.0], [0.0, 0.0, -20.0]])


def test_radii_are_the_library_s() -> None:
    expected = np.array([radii_m(lat, h) for lat, _, h in PLACES.tolist()]).T
    assert np.stack(radii_rows_m(PLACES[:, 0], PLACES[:, 2])) == pytest.approx(expected, rel=1e-14)


def test_a_place_moved_is_off_by_as_much() -> None:
    off = np.array([[100.0, -3.0, 7.0], [-1852.0, 20.0, -1.0], [0.0, 1.0, 0.0]])
    assert offset_m(moved_place(PLACES, off), PLACES) == pytest.approx(off, abs=1e-7)


def test_a_metre_to_the_north_and_to_the_east() -> None:
    """At 55.7 deg: 8.9818e-6 deg of latitude and 1.5911e-5 deg of longitude, from tables of WGS 84."""
    at = np.array([[np.radians(55.7), 0.3, 0.0]])
    step = np.radians([[1.0 / 111_340.7, 1.0 / 62_892.0, 0.0]])
    assert offset_m(at + step, at)[0] == pytest.approx([1.0, 1.0, 0.0], abs=1e-3)
