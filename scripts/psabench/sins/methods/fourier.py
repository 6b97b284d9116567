"""The Fourier method: cycles of steady rotation there and back about a horizontal axis, no angles of the table.

In a cycle about axis j the unit's own gyro, less the Earth's rate along the axis, gives the angle psi. The
accelerometers of the other two axes, k and m, show gravity going round: z = f_k + i f_m = Z exp(-i psi). Its Fourier
coefficients over both halves are

    1                 df_k + i df_m
    exp(-i psi)       |Z| = g (1 + (Gamma_kk + Gamma_mm)/2)
    exp(+i psi)       Z* ((Gamma_kk - Gamma_mm)/2 + i (Gamma_km + Gamma_mk)/2)
    psi exp(-i psi)   Theta_jj: the gyro's angle grows by (1 + Theta_jj)
    t exp(-i psi)     nu_j: what the gyro, less the Earth's rate, has turned when the unit is back

Along the axis f_j has f_k and f_m by Gamma_jk + Theta_kj and Gamma_jm + Theta_mj, when the axis is where the gyros see
it. All is linear in small errors: the data are corrected by what was found and taken again, until nothing is left.
Needs gravity, two turns or more, and the azimuth of the axis for u_j = u cos(latitude) cos(azimuth).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.native.nav import Floats
from psabench.native.sins import Params
from psabench.sins.increments import Increments
from psabench.sins.methods.legs import Leg

LEAST_RAD = 4.0 * np.pi  # of a leg
PASSES = 6  # each leaves some 2 % of the errors before: a mounting of one degree
Complexes = npt.NDArray[np.complex128]


@dataclass(frozen=True, slots=True, kw_only=True)
class Cycle:
    """Two legs about one axis, there and back."""

    there: Leg
    back: Leg
    earth_radps: float  # along the axis

    @property
    def axes(self) -> tuple[int, int, int]:
        """j, k, m: the table's axis and those that it turns, right-handed."""
        j = self.there.axis
        return j, (j + 1) % 3, (j + 2) % 3


def cycles_of(legs: Sequence[Leg], earth_radps: Sequence[float]) -> list[Cycle]:
    """Neighbours that turn there and back; earth_radps: along the table's axis, of each leg. Raises BadInput."""
    found = [
        Cycle(there=a, back=b, earth_radps=u)
        for a, b, u in zip(legs, legs[1:], earth_radps, strict=False)
        if a.axis == b.axis and abs(a.angle_rad) >= LEAST_RAD and a.angle_rad == -b.angle_rad
    ]
    if {c.there.axis for c in found} != {0, 1, 2}:
        raise BadInput(expected("two turns or more there and back about each axis", f"{len(found)} cycles", "plan"))
    return found


def calibrate_by_fourier(data: Increments, cycles: Sequence[Cycle], gravity_mps2: float) -> Params:
    """Errors of both triads in the article's gauge, from one cycle or more about each axis."""
    found = Params()
    for _ in range(PASSES):
        w = found.gyros(data.dtheta_rad / data.dt_s)
        f = found.accelerometers(data.dv_mps / data.dt_s)
        left = _gather_cycles([_cycle_errors(c, w, f, data.dt_s, gravity_mps2) for c in cycles])
        found = _composed_errors(found, left)
    return found


def _composed_errors(before: Params, left: Params) -> Params:
    """Errors of the data, whose correction by `before` leaves `left`."""
    return Params(
        nu_radps=before.nu_radps + (np.eye(3) + before.theta) @ left.nu_radps,
        theta=(np.eye(3) + before.theta) @ (np.eye(3) + left.theta) - np.eye(3),
        df_mps2=before.df_mps2 + (np.eye(3) + before.gamma) @ left.df_mps2,
        gamma=before.gamma + left.gamma,  # keeps the gauge's zeros; the product is of second order and goes next time
    )


@dataclass(frozen=True, slots=True)
class _Seen:
    """Of one cycle: what it says of the errors."""

    axes: tuple[int, int, int]
    nu_j: float
    theta_jj: float
    df: complex  # k and m
    mean_scale: float  # (Gamma_kk + Gamma_mm)/2
    half: complex  # (Gamma_kk - Gamma_mm)/2 + i (Gamma_km + Gamma_mk)/2
    along: tuple[float, float]  # Gamma_jk + Theta_kj, Gamma_jm + Theta_mj


def _cycle_errors(c: Cycle, w: Floats, f: Floats, dt_s: float, gravity_mps2: float) -> _Seen:
    j, k, m = c.axes
    halves = (c.there.rows, c.back.rows)
    whole = slice(halves[0].start, halves[1].stop)
    seen = [w[h].mean(axis=0) for h in halves]
    onto = _rotation_onto(np.eye(3)[j], seen[0] - seen[1])
    w_a, f_a = w[whole] @ onto.T, f[whole] @ onto.T
    rate = w_a[:, j] - c.earth_radps
    psi = np.cumsum(rate) * dt_s - 0.5 * rate * dt_s
    t_s = (np.arange(len(psi)) + 0.5) * dt_s
    going = np.exp(-1j * psi) * np.sinc(rate * dt_s / (2.0 * np.pi))  # a sample is a mean over its turn
    z = f_a[:, k] + 1j * f_a[:, m]
    slopes = [(x - x.mean()) * going for x in (psi, t_s)]  # about the middle: |Z| does not hang on them
    one, on, round_, by_psi, by_t = _fit_basis(z, [np.ones(len(z)), going, going.conj(), *slopes])
    towards = on / abs(on)
    along = [_along_axis(f_a[part], w_a[part], going[part] * on, c.axes) for part in _parts(halves)]
    mean = 0.5 * (along[0] + along[1])
    return _Seen(
        axes=c.axes,
        nu_j=float((by_t / on).imag),
        theta_jj=float((by_psi / on).imag),
        df=complex(one),
        mean_scale=float(abs(on)) / gravity_mps2 - 1.0,
        half=complex(round_ * towards) / gravity_mps2,
        along=(float(mean[0]), float(mean[1])),
    )


def _parts(halves: tuple[slice, slice]) -> tuple[slice, slice]:
    first = halves[0].stop - halves[0].start
    return slice(0, first), slice(first, None)


def _fit_basis(z: Complexes, basis: Sequence[npt.NDArray[np.generic]]) -> Complexes:
    """Coefficients by least squares; each of the basis to its own size."""
    a = np.stack([np.asarray(b, np.complex128) for b in basis], axis=1)
    size = np.abs(a).max(axis=0)
    normal = (a / size).conj().T @ (a / size)
    return np.asarray(np.linalg.solve(normal, (a / size).conj().T @ z) / size)


def _along_axis(f: Floats, w: Floats, z: Complexes, axes: tuple[int, int, int]) -> Floats:
    """What f_j has of f_k and f_m, and where gyros k and m see the axis; the Earth's rate across it is left out."""
    j, k, m = axes
    a = np.stack([np.ones(len(z)), z.real, z.imag], axis=1)
    of = np.linalg.solve(a.T @ a, a.T @ np.column_stack([f[:, j], w[:, k], w[:, m]]))
    return np.asarray(of[1:, 0] + of[0, 1:] / w[:, j].mean())


def _rotation_onto(axis: Floats, v: Floats) -> Floats:
    """The smallest rotation that takes v onto plus or minus the axis."""
    n = v / np.linalg.norm(v) * np.sign(v @ axis)
    across = np.cross(n, axis)
    m = np.array([[0.0, -across[2], across[1]], [across[2], 0.0, -across[0]], [-across[1], across[0], 0.0]])
    return np.asarray(np.eye(3) + m + m @ m / (1.0 + n @ axis))


def _gather_cycles(cycles: Sequence[_Seen]) -> Params:
    """Means over the cycles that see the same; Gamma_12, Gamma_13 and Gamma_32 are 0."""
    nu, df, scale = np.zeros(3), np.zeros((2, 3)), np.zeros((2, 3))
    theta, gamma, turns = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros(3)
    for s in cycles:
        j, k, m = s.axes
        turns[j] += 1
        nu[j] += s.nu_j
        theta[j, j] += s.theta_jj
        df[:, k] += s.df.real, 1.0
        df[:, m] += s.df.imag, 1.0
        scale[:, k] += s.mean_scale + s.half.real, 1.0
        scale[:, m] += s.mean_scale - s.half.real, 1.0
        gamma[max(k, m), min(k, m)] += 2.0 * s.half.imag
        theta[k, j] += s.along[0]
        theta[m, j] += s.along[1]
    for k, m, j in ((1, 0, 2), (2, 0, 1), (2, 1, 0)):
        gamma[k, m] /= turns[j]
    gamma[1, 2], gamma[2, 1] = gamma[2, 1], 0.0
    theta /= turns
    theta -= (gamma * (1.0 - np.eye(3))).T
    np.fill_diagonal(gamma, scale[0] / scale[1])
    return Params(nu_radps=nu / turns, theta=theta, df_mps2=df[0] / df[1], gamma=gamma)
