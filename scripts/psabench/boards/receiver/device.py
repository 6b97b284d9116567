"""A satellite receiver over CAN: its solutions in SI (docs/reference/protocol_receiver.md).

receiver = bench.board(Receiver)
receiver.wait_ready()
got = solutions_of(receiver.stream(100))
got.lat_rad, got.v_enu_mps      # (n,), (n, 3)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psabench.boards.readings import ReadingLayout, Readings
from psabench.boards.unit import BusUnit
from psabench.link.signals import Floats, Ints

MESSAGES = ("RECEIVER_POSITION", "RECEIVER_VELOCITY", "RECEIVER_HEIGHT", "RECEIVER_TIME")
WEEK_S = 604_800
NO_FIX = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Solutions:
    """n solutions. Position and velocity belong to earlier instants than gps_s: the receiver's latency is in them."""

    t_rx_s: Floats  # (n,) when the last message came, in the time of the transport
    gps_s: Floats  # (n,) GPS time since 1980-01-06
    lat_rad: Floats  # (n,) geodetic, WGS 84
    lon_rad: Floats  # (n,)
    height_m: Floats  # (n,) above the ellipsoid
    v_enu_mps: Floats  # (n, 3) east, north, up
    valid: np.ndarray  # (n,) bool: it has a fix; else position and velocity mean nothing
    seq: Ints  # (n,) a step other than 1, modulo 256, is a loss


def solutions_of(readings: Readings) -> Solutions:
    """Readings as the receiver sends them, in SI."""
    return Solutions(
        t_rx_s=readings.t_rx_s,
        gps_s=readings["WEEK"] * WEEK_S + readings["TOW"] * 1e-3,
        lat_rad=np.deg2rad(readings["LAT"]),
        lon_rad=np.deg2rad(readings["LON"]),
        height_m=readings["H"],
        v_enu_mps=np.stack([readings["VE"], readings["VN"], readings["VU"]], axis=1),
        valid=readings["FIX"] != NO_FIX,
        seq=np.asarray(readings["SEQ"], np.int64),
    )


class Receiver(BusUnit):
    """One unit on the bus."""

    board = "receiver"
    title = "RECEIVER"
    layout = ReadingLayout(board="receiver", messages=MESSAGES, counter="SEQ")
