"""Deformation of a quartz plate on thin hinges: equations (6) to (12) of the article of Denisov and Akilin.

The hinges are one beam of length h and width b, clamped in the ring; the plate behind them is rigid. The force P acts
at the centre of mass, at the distance l from the clamped root, so the bending moment in the hinge is M(x) = P (l - x).
E J w'' = M with w(0) = w'(0) = 0 gives all that follows (D: derived).

The article prints (6), (8), (10) and (11); in the copy that we have the bodies of (7), (9) and (12) are lost, and the
terms of (6) and (11) are in disorder. Read in their order, the terms of (6) give P (l - h)^2 / (2 E J), which does not
vanish for a hinge without length, so they are not read in that order (I: inferred).

Pure functions of SI units and degC; arrays broadcast. A plate has no electrical spring here; `held_share` adds it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Values = Array | float

NORMAL_DEGC = 30.0  # the article's normal temperature


@dataclass(frozen=True, slots=True, kw_only=True)
class Material:
    """Fused quartz: Young's modulus E(T) = a T + b with T in degC, and linear expansion. Scalars or arrays."""

    modulus_slope_pa_per_k: Array  # a
    modulus_0_pa: Array  # b, at 0 degC
    expansion_per_k: Array  # alpha

    def modulus_pa(self, degc: Values) -> Array:
        """The article's E = a t + b."""
        return np.asarray(self.modulus_slope_pa_per_k * degc + self.modulus_0_pa)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plate:
    """Dimensions in m at one temperature. Scalars or arrays."""

    arm_m: Array  # from the root of the hinges to the centre of mass: the article's l of the plate
    hinge_m: Array  # length of the hinges
    width_m: Array  # sum of the widths of both hinges
    thickness_m: Array  # of the hinges
    neck_m: Array  # of the plate between the hinges and the metal layer
    layer_m: Array  # of the metal layer, along the plate
    gap_m: Array  # between the layer and the case, without force

    @property
    def pendulum_arm_m(self) -> Array:
        """From the middle of the hinges, about which a stiff plate turns, to the centre of mass: L of (1)."""
        return np.asarray(self.arm_m - 0.5 * self.hinge_m)


def expanded_m(nominal_m: Values, tolerance_m: Values, expansion_per_k: Values, degc: Values) -> Array:
    """(8): l = (l_nom + D) (1 + alpha (t - t_norm)); the print multiplies the bracket out."""
    whole_m = nominal_m + tolerance_m
    return np.asarray(whole_m * (1.0 + expansion_per_k * (degc - NORMAL_DEGC)))


def second_moment_m4(width_m: Values, thickness_m: Values) -> Array:
    """(7), body lost: J = b h^3 / 12 of a rectangle about its neutral axis (D)."""
    return np.asarray(width_m * thickness_m**3 / 12.0)


def hinge_angle_rad(force_n: Values, plate: Plate, modulus_pa: Values) -> Array:
    """(6): angle of the plate, theta = P (l^2 - (l - h)^2) / (2 E J) = P (2 l h - h^2) / (2 E J)."""
    shape_m2 = (2.0 * plate.arm_m - plate.hinge_m) * plate.hinge_m
    return np.asarray(force_n * shape_m2 / (2.0 * _stiffness_n_m2(plate, modulus_pa)))


def hinge_deflection_m(force_n: Values, plate: Plate, modulus_pa: Values) -> Array:
    """(11): deflection at the end of the hinges, f = P (3 l h^2 - h^3) / (6 E J)."""
    shape_m3 = (3.0 * plate.arm_m - plate.hinge_m) * plate.hinge_m**2
    return np.asarray(force_n * shape_m3 / (6.0 * _stiffness_n_m2(plate, modulus_pa)))


def _stiffness_n_m2(plate: Plate, modulus_pa: Values) -> Array:
    return np.asarray(modulus_pa * second_moment_m4(plate.width_m, plate.thickness_m))


def angle_from_tolerances_rad(
    force_n: Values, nominal: Plate, tolerance: Plate, material: Material, degc: Values
) -> Array:
    """(9), body lost: (7) and (8) in (6), in one expression (D). tolerance: D1 (hinge), D2 (width), D3 (thickness), D4
    (arm), each with its sign, m.

    theta = 6 P [2 (l + D4)(h + D1) - (h + D1)^2] / ((a t + b)(b + D2)(s + D3)^3 (1 + alpha (t - t_norm))^2)
    """
    hinge_m = nominal.hinge_m + tolerance.hinge_m
    shape_m2 = (2.0 * (nominal.arm_m + tolerance.arm_m) - hinge_m) * hinge_m
    section_m4 = (nominal.width_m + tolerance.width_m) * (nominal.thickness_m + tolerance.thickness_m) ** 3
    stretch = 1.0 + material.expansion_per_k * (degc - NORMAL_DEGC)
    return np.asarray(6.0 * force_n * shape_m2 / (material.modulus_pa(degc) * section_m4 * stretch**2))


def expanded_plate(at_30: Plate, expansion_per_k: Values, degc: Values) -> Plate:
    """The plate at a temperature; `at_30` has its tolerances."""
    names = Plate.__dataclass_fields__
    return Plate(**{n: expanded_m(getattr(at_30, n), 0.0, expansion_per_k, degc) for n in names})


def hinge_n_m_per_rad(plate: Plate, modulus_pa: Values) -> Array:
    """Stiffness of the hinges against the moment P L about their middle: E J / h, by (6) exactly (D)."""
    return np.asarray(_stiffness_n_m2(plate, modulus_pa) / plate.hinge_m)


def layer_deflection_m(force_n: Values, plate: Plate, modulus_pa: Values) -> Array:
    """(10): mean deflection of the metal layer, f + d1 + d_mean; by the angle, d1 = theta n, d_mean = theta m / 2 for a
    neck of length n and a layer of length m."""
    angle_rad = hinge_angle_rad(force_n, plate, modulus_pa)
    return np.asarray(hinge_deflection_m(force_n, plate, modulus_pa) + angle_rad * (plate.neck_m + 0.5 * plate.layer_m))


def held_share(plate: Plate, modulus_pa: Values, spring_n_m_per_rad: Values) -> Array:
    """What the hinges carry of the force when the torquer balances the rest: k / (k + K), k of the hinges, K the
    electrical spring of (2), which acts at the centre of mass (E0)."""
    hinge = hinge_n_m_per_rad(plate, modulus_pa)
    return np.asarray(hinge / (hinge + spring_n_m_per_rad))


def gap_m(force_n: Values, plate: Plate, modulus_pa: Values) -> Array:
    """(12), body lost: what is left of the gap, S = gap - (10), with the tolerances of neck and layer, D5 and D6, in
    the plate (D)."""
    return np.asarray(plate.gap_m - layer_deflection_m(force_n, plate, modulus_pa))


def zero_ug(plate: Plate, modulus_pa: Values, position_rad: Values, weight_n: Values) -> Array:
    """Zero signal, millionths of g, by the hinges of a pendulum sealed `position_rad` off the null of its pickoff:
    k position / (P L) (D). It is the one way in which (6) to (12) reach the zero signal."""
    moment_n_m = hinge_n_m_per_rad(plate, modulus_pa) * position_rad
    return np.asarray(moment_n_m / (weight_n * plate.pendulum_arm_m) * 1e6)
