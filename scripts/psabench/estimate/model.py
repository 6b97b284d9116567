"""From Fourier coefficients to parameters of the sensor, and back: eqs (13), (15), (18) and the reversal.

Every function is elementwise over trailing axes, so thousands of simulated calibrations are one call:
coefficients have shape (5, ...) for one face and (10, ...) for a pair (direct, then reversed), parameters (q,
...), Jacobians (q, p, ...). Each Jacobian is beside its function and is tested against central
differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.estimate.face import Face

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """Model (1) plus the quadratic terms that a single face cannot tell from alpha0."""

    u0_v: float
    alpha0_rad: float = 0.0
    kx_v_per_g: float
    ky_v_per_g: float = 0.0
    kz_v_per_g: float = 0.0
    kxy_v_per_g2: float = 0.0
    kxz_v_per_g2: float = 0.0
    kxx_v_per_g2: float = 0.0
    kyy_v_per_g2: float = 0.0
    kzz_v_per_g2: float = 0.0


def harmonics_of(s: Sensor, face: Face = Face.DIRECT) -> Array:
    """C0..C4 of a sensor, eq. (15) with the quadratic terms: shape (5,), volts."""
    side = face in (Face.SIDE, Face.SIDE_REVERSED)
    sign = -1.0 if face in (Face.REVERSED, Face.SIDE_REVERSED) else 1.0
    k_cross = sign * (s.kz_v_per_g if side else s.ky_v_per_g)
    k_prod = sign * (s.kxz_v_per_g2 if side else s.kxy_v_per_g2)
    k_square = s.kzz_v_per_g2 if side else s.kyy_v_per_g2
    return _harmonics(s, k_cross, k_prod, k_square)


def _harmonics(s: Sensor, k_cross: float, k_prod: float, k_square: float) -> Array:
    sin1, cos1 = np.sin(s.alpha0_rad), np.cos(s.alpha0_rad)
    sin2, cos2 = np.sin(2 * s.alpha0_rad), np.cos(2 * s.alpha0_rad)
    quad = s.kxx_v_per_g2 - k_square
    return np.array(
        [
            s.u0_v + (s.kxx_v_per_g2 + k_square) / 2,
            k_cross * sin1 - s.kx_v_per_g * cos1,
            -(s.kx_v_per_g * sin1 + k_cross * cos1),
            (k_prod * cos2 + quad * sin2) / 2,
            (k_prod * sin2 - quad * cos2) / 2,
        ]
    )


ONE_FACE = ("u0_v", "alpha0_rad", "kx_v_per_g", "ky_v_per_g", "kxy_v_per_g2")


def one_face(c: Array) -> Array:
    """Eq. (18) with its two repairs: alpha0 by atan, and k_xy with the sign of C3.

    (atan2 would jump by 90 deg for k_xy < 0.) It rests on k_xx = k_yy and |alpha0| < 45 deg. Shape (5, ...)
    to (5, ...), in the order of ONE_FACE.
    """
    alpha0 = 0.5 * np.arctan(c[4] / c[3])
    kx = -(c[1] * np.cos(alpha0) + c[2] * np.sin(alpha0))
    ky = c[1] * np.sin(alpha0) - c[2] * np.cos(alpha0)
    kxy = 2 * np.copysign(np.hypot(c[3], c[4]), c[3])
    return np.stack([c[0], alpha0, kx, ky, kxy])


def one_face_jacobian(c: Array) -> Array:
    """d(one_face)/dC, shape (5, 5, ...)."""
    _, alpha0, kx, ky, _ = one_face(c)
    sin1, cos1 = np.sin(alpha0), np.cos(alpha0)
    h = np.hypot(c[3], c[4])
    j = np.zeros((5, 5, *c.shape[1:]))
    j[0, 0] = 1.0
    j[1, 3], j[1, 4] = -0.5 * c[4] / h**2, 0.5 * c[3] / h**2
    j[2, 1], j[2, 2] = -cos1, -sin1
    j[3, 1], j[3, 2] = sin1, -cos1
    for k in (3, 4):  # alpha0 enters both: d kx/d alpha0 = ky, d ky/d alpha0 = -kx
        j[2, k], j[3, k] = ky * j[1, k], -kx * j[1, k]
    sign = np.copysign(1.0, c[3])
    j[4, 3], j[4, 4] = 2 * sign * c[3] / h, 2 * sign * c[4] / h
    return j


MEASURED = ("kx_eff_v_per_g", "angle_rad", "ky_sum_v_per_g", "second_v_per_g2", "second_phase_rad")


def measured(c: Array) -> Array:
    """What one face does measure, whatever the quadratic terms: shape (5, ...), in the order of MEASURED.

    kx_eff = hypot(kx, ky); angle = alpha0 + atan(ky/kx); ky_sum = kx sin alpha0 + ky cos alpha0; amplitude
    (as a coefficient of a_x a_y) and phase of the second harmonic.
    """
    return np.stack(
        [
            np.hypot(c[1], c[2]),
            np.arctan2(-c[2], -c[1]),
            -c[2],
            2 * np.hypot(c[3], c[4]),
            0.5 * np.arctan2(c[4], c[3]),
        ]
    )


def measured_jacobian(c: Array) -> Array:
    """d(measured)/dC, shape (5, 5, ...)."""
    h1, h2 = np.hypot(c[1], c[2]), np.hypot(c[3], c[4])
    j = np.zeros((5, 5, *c.shape[1:]))
    j[0, 1], j[0, 2] = c[1] / h1, c[2] / h1
    j[1, 1], j[1, 2] = -c[2] / h1**2, c[1] / h1**2
    j[2, 2] = -1.0
    j[3, 3], j[3, 4] = 2 * c[3] / h2, 2 * c[4] / h2
    j[4, 3], j[4, 4] = -0.5 * c[4] / h2**2, 0.5 * c[3] / h2**2
    return j


REVERSAL = ("u0_v", "alpha0_rad", "kx_v_per_g", "ky_v_per_g", "kxy_v_per_g2", "quad_v_per_g2")


def reversal(c: Array) -> Array:
    """Parameters from C (rows 0..4, direct) and C' (rows 5..9, turned by 180 deg about Ox): shape (6, ...).

    Only the first harmonic is used for alpha0, kx, ky, so k_xx and k_yy cannot enter. The second harmonic
    then gives k_xy (which changes sign with the face) and quad = k_xx - k_yy (which does not) apart. On the
    side faces read kz, k_xz, k_zz. |alpha0| < 90 deg; kx keeps its sign.
    """
    s1, s2, d1, d2 = c[1] + c[6], c[2] + c[7], c[6] - c[1], c[7] - c[2]
    alpha0 = np.arctan(s2 / s1)
    kx = -0.5 * np.copysign(np.hypot(s1, s2), s1)
    ky = 0.5 * (d2 * np.cos(alpha0) - d1 * np.sin(alpha0))
    sin2, cos2 = np.sin(2 * alpha0), np.cos(2 * alpha0)
    kxy = (c[3] - c[8]) * cos2 + (c[4] - c[9]) * sin2
    quad = (c[3] + c[8]) * sin2 - (c[4] + c[9]) * cos2
    return np.stack([0.5 * (c[0] + c[5]), alpha0, kx, ky, kxy, quad])


def reversal_jacobian(c: Array) -> Array:
    """d(reversal)/d(C, C'), shape (6, 10, ...)."""
    s1, s2, d1, d2 = c[1] + c[6], c[2] + c[7], c[6] - c[1], c[7] - c[2]
    alpha0, kx = reversal(c)[1:3]
    sin1, cos1, sin2, cos2 = np.sin(alpha0), np.cos(alpha0), np.sin(2 * alpha0), np.cos(2 * alpha0)
    slope_ky = -0.5 * (d2 * sin1 + d1 * cos1)
    slope_kxy = 2 * ((c[4] - c[9]) * cos2 - (c[3] - c[8]) * sin2)
    slope_quad = 2 * ((c[3] + c[8]) * cos2 + (c[4] + c[9]) * sin2)
    h2 = s1**2 + s2**2
    j = np.zeros((6, 10, *c.shape[1:]))
    j[0, 0] = j[0, 5] = 0.5
    for face, sign in ((0, -1.0), (5, 1.0)):  # C, then C'; `sign` is that of the differences d1, d2
        a1, a2 = -s2 / h2, s1 / h2  # d alpha0 / dC1, dC2
        j[1, face + 1], j[1, face + 2] = a1, a2
        j[2, face + 1], j[2, face + 2] = s1 / (4 * kx), s2 / (4 * kx)
        j[3, face + 1] = -0.5 * sign * sin1 + slope_ky * a1
        j[3, face + 2] = 0.5 * sign * cos1 + slope_ky * a2
        j[4, face + 1], j[4, face + 2] = slope_kxy * a1, slope_kxy * a2
        j[4, face + 3], j[4, face + 4] = -sign * cos2, -sign * sin2
        j[5, face + 1], j[5, face + 2] = slope_quad * a1, slope_quad * a2
        j[5, face + 3], j[5, face + 4] = sin2, -cos2
    return j
