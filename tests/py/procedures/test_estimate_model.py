"""Eqs (13), (15), (18) and the reversal: forward and back, the repairs to the article, Jacobians."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from fake_bench import seeded
from hypothesis import given
from hypothesis import strategies as st
from psabench.estimate import model
from psabench.estimate.face import Face
from psabench.estimate.model import Array, Sensor

ARTICLE = Sensor(u0_v=2.50, alpha0_rad=np.radians(0.1121), kx_v_per_g=1.0, ky_v_per_g=0.0098, kxy_v_per_g2=0.0010)


def test_printed_values_as_harmonics() -> None:
    """sources instruments 2.2: alpha0 hangs on two microvolts."""
    c = model.harmonics_of(ARTICLE)
    want = np.array([2.5, -0.99998, -0.011756, 5.0e-4, 1.957e-6])
    half_digit = np.array([1e-15, 2e-6, 1e-6, 1e-8, 1e-9])
    assert (np.abs(c - want) <= half_digit).all(), c


def sensors(quadratic: float) -> st.SearchStrategy[Sensor]:
    def between(lo: float, hi: float) -> st.SearchStrategy[float]:
        return st.floats(lo, hi, allow_subnormal=False)

    def away_from_0(lo: float, hi: float) -> st.SearchStrategy[float]:
        return st.tuples(between(lo, hi), st.sampled_from([1.0, -1.0])).map(lambda v: v[0] * v[1])

    return st.builds(
        Sensor,
        u0_v=between(-5, 5),
        alpha0_rad=between(-0.7, 0.7),  # inside +-45 deg
        kx_v_per_g=away_from_0(0.1, 2),
        ky_v_per_g=between(-0.05, 0.05),
        kxy_v_per_g2=away_from_0(1e-4, 1e-2),
        kxx_v_per_g2=between(-quadratic, quadratic),
        kyy_v_per_g2=between(-quadratic, quadratic),
    )


@given(sensors(quadratic=0.0))
def test_one_face_recovers_every_sensor_without_quadratic_terms(s: Sensor) -> None:
    """Also for kxy < 0, where the printed (18) loses the sign and atan2 would be 90 deg off."""
    want = [s.u0_v, s.alpha0_rad, s.kx_v_per_g, s.ky_v_per_g, s.kxy_v_per_g2]
    np.testing.assert_allclose(model.one_face(model.harmonics_of(s)), want, atol=1e-10)


@given(sensors(quadratic=0.05))
def test_reversal_recovers_every_sensor_whatever_its_quadratic_terms(s: Sensor) -> None:
    c = np.concatenate([model.harmonics_of(s, Face.DIRECT), model.harmonics_of(s, Face.REVERSED)])
    quad = s.kxx_v_per_g2 - s.kyy_v_per_g2
    u0_1g = s.u0_v + (s.kxx_v_per_g2 + s.kyy_v_per_g2) / 2
    want = [u0_1g, s.alpha0_rad, s.kx_v_per_g, s.ky_v_per_g, s.kxy_v_per_g2, quad]
    np.testing.assert_allclose(model.reversal(c), want, atol=1e-12)


def test_reversal_is_the_formula_of_the_facts() -> None:
    """sources instruments 2.4, written as there (atan2, kx > 0)."""
    c = np.concatenate([model.harmonics_of(ARTICLE, Face.DIRECT), model.harmonics_of(ARTICLE, Face.REVERSED)])
    a0 = np.arctan2(-(c[2] + c[7]), -(c[1] + c[6]))
    kx = 0.5 * np.hypot(c[1] + c[6], c[2] + c[7])
    ky = ((c[7] - c[2]) * np.cos(a0) - (c[6] - c[1]) * np.sin(a0)) / 2
    np.testing.assert_allclose(model.reversal(c)[1:4], [a0, kx, ky], atol=1e-15)


@pytest.mark.parametrize(("kxx", "alpha0_deg", "kx"), [(1e-5, -0.17, 1.0), (1e-4, -2.7, 0.998), (1e-3, -22.4, 0.92)])
def test_one_face_is_thrown_by_a_quadratic_term_as_the_facts_say(kxx: float, alpha0_deg: float, kx: float) -> None:
    """sources instruments 2.3: the bias that no noise figure shows."""
    s = Sensor(
        u0_v=2.5, alpha0_rad=np.radians(0.1121), kx_v_per_g=1.0, ky_v_per_g=0.0098, kxy_v_per_g2=1e-3, kxx_v_per_g2=kxx
    )
    _, a0, kx_got, _, _ = model.one_face(model.harmonics_of(s))
    assert np.degrees(a0) == pytest.approx(alpha0_deg, rel=0.03)
    assert kx_got == pytest.approx(kx, abs=2e-3)


@pytest.mark.parametrize(
    ("function", "jacobian", "rows"),
    [
        (model.one_face, model.one_face_jacobian, 5),
        (model.measured, model.measured_jacobian, 5),
        (model.reversal, model.reversal_jacobian, 10),
    ],
)
def test_jacobians_are_the_central_differences(
    function: Callable[[Array], Array], jacobian: Callable[[Array], Array], rows: int
) -> None:
    """Every entry, at 200 random coefficient sets at once (which also proves the trailing axis)."""
    rng = seeded("jacobians")
    c = rng.uniform(0.2, 1.0, (rows, 200)) * rng.choice([-1.0, 1.0], (rows, 200))
    c[6:8] = c[1:3] * rng.uniform(0.5, 1.0, (2, 200)) if rows == 10 else c[6:8]  # faces that resemble each other
    step = 1e-6
    want = np.stack(
        [(function(c + step * e[:, None]) - function(c - step * e[:, None])) / (2 * step) for e in np.eye(rows)], axis=1
    )
    np.testing.assert_allclose(jacobian(c), want, atol=1e-7, rtol=1e-6)
