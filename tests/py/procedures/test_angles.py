"""One turn, its ends, and arrays as well as numbers."""

from __future__ import annotations

import math

import numpy as np
import pytest
from psabench.estimate.angles import wrapped, wrapped_deg


@pytest.mark.parametrize(
    ("angle_deg", "within_deg"),
    [(0.0, 0.0), (180.0, 180.0), (-180.0, 180.0), (181.0, -179.0), (-181.0, 179.0), (540.0, 180.0), (-719.0, 1.0)],
)
def test_an_angle_is_brought_into_one_turn(angle_deg: float, within_deg: float) -> None:
    assert wrapped_deg(angle_deg) == within_deg
    assert wrapped(math.radians(angle_deg)) == pytest.approx(math.radians(within_deg), abs=1e-14)


def test_arrays_are_as_their_numbers() -> None:
    angles_deg = np.array([-540.0, -180.0, -0.25, 0.0, 179.5, 180.0, 1000.0])
    assert wrapped_deg(angles_deg).tolist() == [wrapped_deg(x) for x in angles_deg.tolist()]
    assert wrapped(angles_deg).tolist() == [wrapped(x) for x in angles_deg.tolist()]
