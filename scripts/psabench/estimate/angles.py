"""Angles brought into one turn: a number, or an array of them."""

from __future__ import annotations

import math
from typing import TypeVar

import numpy as np
import numpy.typing as npt

Angle = TypeVar("Angle", float, npt.NDArray[np.float64])


def wrapped(angle_rad: Angle) -> Angle:
    """Into (-pi, pi]."""
    return math.pi - (math.pi - angle_rad) % (2.0 * math.pi)


def wrapped_deg(angle_deg: Angle) -> Angle:
    """Into (-180, 180]."""
    return 180.0 - (180.0 - angle_deg) % 360.0
