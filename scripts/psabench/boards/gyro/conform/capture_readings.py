"""Readings of a gyro unit from a log: its three messages of a step as columns, in deg and deg/h."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

import numpy as np

from psabench.conform.capture.intervals import fact
from psabench.conform.capture.log import CanLog, Capture
from psabench.conform.verdict import Inconclusive, conclusive, damaged_data_are
from psabench.link.protocol_files import message
from psabench.link.signals import Floats, layout

MESSAGES = ("GYRO_RATES", "GYRO_ANGLES", "GYRO_LEVEL")
EMCY = "GYRO_EMCY"
EARTH_DEGPH = 15.041067  # docs/reference/protocol_gyro.md


def columns(e: Capture, least: int = 20) -> Mapping[str, Floats]:
    """Signals of whole readings in the units of the DBC. Raises Inconclusive."""
    return _columns(e.can, e.variant.family, e.node, least)


@lru_cache(maxsize=8)
def _columns(can: CanLog, board: str, node: int, least: int) -> Mapping[str, Floats]:
    logs = [can.of(name, board, node) for name in MESSAGES]
    n = min(len(log) for log in logs)
    conclusive(n >= least, f"{', '.join(f'{len(log)} {name}' for log, name in zip(logs, MESSAGES, strict=True))}")
    found: dict[str, Floats] = {}
    with damaged_data_are(Inconclusive):
        for name, log in zip(MESSAGES, logs, strict=True):
            raw, scales = CanLog(frames=log.frames[:n]).raw(name), layout(message(name))
            found |= {k: np.asarray(v * scales[k].scale, np.float64) for k, v in raw.items()}
    return found


def vertical_degph(latitude_deg: float) -> float:
    """Wz of a vehicle that is parked still."""
    return EARTH_DEGPH * float(np.sin(np.radians(latitude_deg)))


def setting(e: Capture, name: str) -> float:
    """A setting of the unit, or what else the stimulus has read. Raises Inconclusive."""
    return float(fact(e, name, f"{name} is not known"))
