"""Angles brought into one turn."""

from __future__ import annotations

import math


def wrapped(angle_rad: float) -> float:
    """Into (-pi, pi]."""
    return math.pi - (math.pi - angle_rad) % (2.0 * math.pi)


def wrapped_deg(angle_deg: float) -> float:
    """Into (-180, 180]."""
    return 180.0 - (180.0 - angle_deg) % 360.0
