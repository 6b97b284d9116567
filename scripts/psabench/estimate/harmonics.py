"""Fourier coefficients of a turn by least squares, eqs (14), (16), (17).

The article writes C = A^-1 U for an 80 x 5 matrix; it is solved here by QR, never through A'A. An optional
sixth column takes a zero signal that drifts linearly in time: 50 uV over a turn otherwise moves alpha0 from
0.11 to 0.28 deg.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.errors import expected

Array = npt.NDArray[np.float64]

HARMONICS = 5  # C0..C4
MAX_CONDITION = 1e6  # the article's 80 x 5 deg has 1.52


@dataclass(frozen=True, slots=True, kw_only=True)
class HarmonicFit:
    """C0..C4 of u = C0 + C1 sin a + C2 cos a + C3 sin 2a + C4 cos 2a (+ drift)."""

    c_v: Array  # (5,) or (5, k), volts
    drift_vps: Array  # () or (k,), V/s; zero when not fitted
    unit_cov: Array  # (5, 5): covariance of C for a reading noise of 1 V
    drift_unit_sd_ps: float  # sd of drift_vps for a reading noise of 1 V, 1/s
    sigma_v: Array  # () or (k,), noise of one reading from the residual
    dof: int
    residual_v: Array  # (m,) or (m, k)
    condition: float  # of the design with columns of comparable size


def design_matrix(alpha_rad: Array, t_s: Array | None = None) -> Array:
    """A of eq. (16), shape (m, 5), or (m, 6) with the drift column (time, centred, in units of its span)."""
    columns = [
        np.ones_like(alpha_rad),
        np.sin(alpha_rad),
        np.cos(alpha_rad),
        np.sin(2 * alpha_rad),
        np.cos(2 * alpha_rad),
    ]
    if t_s is not None:
        columns.append((t_s - t_s.mean()) / _span_s(t_s))
    return np.column_stack(columns)


def _span_s(t_s: Array) -> float:
    span_s = float(np.ptp(t_s))
    if not span_s > 0.0:
        raise ValueError(expected("different times for a drift column", "one t_s in all readings", "t_s"))
    return span_s


def fit(alpha_rad: Array, u_v: Array, t_s: Array | None = None) -> HarmonicFit:
    """Least squares of `u_v`, shape (m,), or (m, k) for k series over the same angles, by QR.

    Raises ValueError when there are too few readings, when a number is not finite, or when the angles (and
    times) do not tell the columns apart.
    """
    m, p = alpha_rad.size, HARMONICS + (t_s is not None)
    if m <= p:
        raise ValueError(expected(f"at least {p + 1} readings for {p} unknowns and a residual", m))
    a = design_matrix(alpha_rad, t_s)
    if not (np.isfinite(a).all() and np.isfinite(u_v).all()):
        raise ValueError(expected("finite angles, times and voltages", "inf or NaN"))
    condition = float(np.linalg.cond(a))
    if condition > MAX_CONDITION:
        raise ValueError(expected("angles that separate the harmonics: spread them out", f"condition {condition:.1e}"))
    q, r = np.linalg.qr(a)
    x = np.linalg.solve(r, q.T @ u_v)
    residual_v = u_v - a @ x
    r_inv = np.linalg.solve(r, np.eye(p))
    cov = r_inv @ r_inv.T
    span_s = 1.0 if t_s is None else _span_s(t_s)
    return HarmonicFit(
        c_v=x[:HARMONICS],
        drift_vps=np.zeros_like(x[0]) if t_s is None else x[HARMONICS] / span_s,
        unit_cov=cov[:HARMONICS, :HARMONICS],
        drift_unit_sd_ps=0.0 if t_s is None else float(np.sqrt(cov[HARMONICS, HARMONICS])) / span_s,
        sigma_v=np.sqrt((residual_v**2).sum(axis=0) / (m - p)),
        dof=m - p,
        residual_v=residual_v,
        condition=condition,
    )


def evaluate(c_v: Array, alpha_rad: Array) -> Array:
    """Eq. (14) without drift: volts at `alpha_rad`, shape of alpha_rad."""
    value: Array = design_matrix(alpha_rad) @ c_v
    return value
