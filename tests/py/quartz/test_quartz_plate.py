"""Equations (6) to (12) of the deformation study, against a beam integrated numerically and each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from psabench.quartz import element, plate
from psabench.quartz.deformation import DEGC, count_turns
from psabench.quartz.plate import Material, Plate

P_N = 0.8e-3 * 9.80665
STEPS = 20000


def a_plate(**changed: float) -> Plate:
    sizes = {
        "arm_m": 8.5e-3,
        "hinge_m": 1e-3,
        "width_m": 4e-3,
        "thickness_m": 50e-6,
        "neck_m": 2e-3,
        "layer_m": 11e-3,
        "gap_m": 20e-6,
    }
    return Plate(**{k: np.asarray(v) for k, v in (sizes | changed).items()})


def integrated(p: Plate, modulus_pa: float) -> tuple[float, float, float]:
    """Angle and deflection at the hinges' end, and the layer's mean deflection: the beam's section summed over its
    thickness, its curvature over its length, the layer point by point."""
    fibre_m = (np.arange(2000) + 0.5) / 2000 * float(p.thickness_m) - 0.5 * float(p.thickness_m)
    bending_n_m2 = modulus_pa * float(p.width_m) * float(np.sum(fibre_m**2)) * float(p.thickness_m) / 2000
    dx_m = float(p.hinge_m) / STEPS
    middle_m = (np.arange(STEPS) + 0.5) * dx_m
    angle = np.cumsum(P_N * (float(p.arm_m) - middle_m) / bending_n_m2) * dx_m
    deflection_m = float(np.sum(angle) * dx_m)
    layer_m = float(p.neck_m) + (np.arange(1000) + 0.5) / 1000 * float(p.layer_m)
    return float(angle[-1]), deflection_m, float(np.mean(deflection_m + angle[-1] * layer_m))


@pytest.mark.parametrize("sizes", [{}, {"hinge_m": 4e-3}, {"arm_m": 3e-3, "hinge_m": 2.9e-3, "thickness_m": 80e-6}])
def test_the_equations_are_those_of_a_bent_beam(sizes: dict[str, float]) -> None:
    p, modulus_pa = a_plate(**sizes), 72e9
    angle, deflection_m, layer_m = integrated(p, modulus_pa)
    assert float(plate.hinge_angle_rad(P_N, p, modulus_pa)) == pytest.approx(angle, rel=2e-4)
    assert float(plate.hinge_deflection_m(P_N, p, modulus_pa)) == pytest.approx(deflection_m, rel=2e-4)
    assert float(plate.layer_deflection_m(P_N, p, modulus_pa)) == pytest.approx(layer_m, rel=2e-4)
    assert float(plate.gap_m(P_N, p, modulus_pa)) == pytest.approx(20e-6 - layer_m, rel=2e-3)


def test_a_hinge_without_length_does_not_bend() -> None:
    """The terms of (6) in the printed order, P (l - h)^2 / (2 E J), would."""
    p = a_plate(hinge_m=1e-9)
    assert float(plate.hinge_angle_rad(P_N, p, 72e9)) < 2e-6 * float(plate.hinge_angle_rad(P_N, a_plate(), 72e9))


def test_the_lost_equation_9_is_7_and_8_in_6() -> None:
    tolerance = a_plate(arm_m=2e-5, hinge_m=-3e-5, width_m=1e-5, thickness_m=2e-6, neck_m=0.0, layer_m=0.0, gap_m=0.0)
    material = Material(
        modulus_slope_pa_per_k=np.asarray(14.4e6), modulus_0_pa=np.asarray(71.6e9), expansion_per_k=np.asarray(5e-7)
    )
    nominal = a_plate()
    whole = Plate(**{n: getattr(nominal, n) + getattr(tolerance, n) for n in Plate.__dataclass_fields__})
    at = plate.expanded_plate(whole, material.expansion_per_k, DEGC)
    composed = plate.hinge_angle_rad(P_N, at, material.modulus_pa(DEGC))
    direct = plate.angle_from_tolerances_rad(P_N, nominal, tolerance, material, DEGC)
    np.testing.assert_allclose(direct, composed, rtol=1e-12)
    assert np.ptp(direct) > 1e-2 * float(direct[0])  # it depends on temperature


def test_the_hinges_have_the_stiffness_of_the_emulators_pendulum() -> None:
    """3e-3 N m/rad, 186 urad for 1 g in the loop, 47.8 ug/urad (docs/instruments.md, 9.81 m/s^2)."""
    e = element.nominal_element(element.change_figures())
    hinge = float(plate.hinge_n_m_per_rad(e.plate, e.material.modulus_pa(30.0))[0, 0])
    assert hinge == pytest.approx(3e-3, rel=1e-3)
    moment_n_m = 0.8e-3 * 9.81 * float(e.plate.pendulum_arm_m[0, 0])
    assert 1e6 * moment_n_m / (hinge + 0.334) == pytest.approx(186.3, abs=0.05)
    force_n = 0.8e-3 * 9.81
    free = plate.hinge_angle_rad(force_n, e.plate, e.material.modulus_pa(30.0))
    held = free * plate.held_share(e.plate, e.material.modulus_pa(30.0), 0.334)
    assert 1e6 * float(held[0, 0]) == pytest.approx(186.3, abs=0.05)
    assert float(plate.zero_ug(e.plate, e.material.modulus_pa(30.0), 1e-6, force_n)[0, 0]) == pytest.approx(
        47.8, abs=0.05
    )


def test_a_size_at_30_degrees_is_its_own_and_expands_with_its_tolerance() -> None:
    assert float(plate.expanded_m(1e-3, 2e-5, 5e-7, 30.0)) == 1.02e-3
    assert float(plate.expanded_m(1e-3, 2e-5, 5e-7, 80.0)) == pytest.approx(1.02e-3 + 1.02e-3 * 5e-7 * 50.0, rel=1e-12)


def test_an_element_does_not_depend_on_how_many_are_drawn_or_on_other_figures() -> None:
    figures = element.change_figures()
    many, few = element.draw_elements(figures, 7, 50), element.draw_elements(figures, 7, 5)
    np.testing.assert_array_equal(many.plate.thickness_m[:5], few.plate.thickness_m)
    np.testing.assert_array_equal(element.part_of(many, slice(3, 5)).position_rad, few.position_rad[3:5])
    other = element.draw_elements(element.change_figures(["hinge_mm=1:0.1"]), 7, 5)
    np.testing.assert_array_equal(other.plate.thickness_m, few.plate.thickness_m)
    assert not np.array_equal(other.plate.hinge_m, few.plate.hinge_m)
    assert replace(figures["hinge_mm"], tolerance=0.1) == element.change_figures(["hinge_mm=1:0.1"])["hinge_mm"]


def test_turns_are_counted() -> None:
    x = np.linspace(0.0, 2.0 * np.pi, 50)
    np.testing.assert_array_equal(count_turns(np.stack([x, np.sin(x), np.cos(x), 0.0 * x])), [0, 2, 1, 0])
