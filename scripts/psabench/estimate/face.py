"""How the sensor sits in its mount on the dividing head, and what gravity does to it there.

Gravity on the sensor axes, per face. `a` is the projection of gravity (an axis that points down reads +g),
`th = alpha + alpha0`, alpha the head angle and alpha0 the mounting error about the head axis. Every face is a
turn of the sensor about its own Ox, so Ox, and with it a_x and alpha0, stay where they were:

    face            a_x          a_y          a_z
    DIRECT          -g sin th    -g cos th     0             article, eq. (12)
    REVERSED        -g sin th    +g cos th     0             180 deg about Ox
    SIDE            -g sin th     0           -g cos th      90 deg about Ox: Oz is where Oy stood
    SIDE_REVERSED   -g sin th     0           +g cos th      90 deg the other way: SIDE turned by 180 deg
"""

from __future__ import annotations

from enum import Enum


class Face(Enum):
    """How the sensor sits in its mount; see the table of the module."""

    DIRECT = "direct"
    REVERSED = "reversed"
    SIDE = "side"
    SIDE_REVERSED = "side_reversed"
