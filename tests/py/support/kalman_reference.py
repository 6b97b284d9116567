"""A Kalman filter as a textbook has it, in dense NumPy: what the library's is compared with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

Floats = np.ndarray[Any, np.dtype[np.float64]]


@dataclass
class Step:
    """A step of a random system."""

    phi: Floats
    q: Floats
    h: Floats
    z: Floats
    r: Floats


def joseph(x: Floats, p: Floats, h: Floats, z: Floats, r: Floats) -> tuple[Floats, Floats]:
    """All measurements at once, as a textbook has it."""
    k = p @ h.T @ np.linalg.inv(h @ p @ h.T + np.diag(r))
    left = np.eye(len(x)) - k @ h
    return x + k @ (z - h @ x), left @ p @ left.T + k @ np.diag(r) @ k.T


def dense_step(x: Floats, p: Floats, s: Step) -> tuple[Floats, Floats, Floats, Floats]:
    """Predicted and updated."""
    moving, n = s.phi.shape
    whole = np.eye(n)
    whole[:moving] = s.phi
    x1, p1 = whole @ x, whole @ p @ whole.T
    p1[:moving, :moving] += s.q
    return x1, p1, *joseph(x1, p1, s.h, s.z, s.r)


def relative(p: Floats, reference: Floats) -> float:
    """Largest difference in standard deviations of the reference."""
    sd = np.sqrt(np.diag(reference))
    return float(np.max(np.abs(p - reference) / np.outer(sd, sd)))
