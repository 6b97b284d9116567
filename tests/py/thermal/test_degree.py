"""Choice of the degree, and the digits that each form of a polynomial keeps."""

from __future__ import annotations

import numpy as np
import pytest
from psabench.thermal.degree import best_degree, condition_numbers, degree_rows
from quartz_units import HIGH_C, LOW_C, draw_unit

SEED = 25
GRID_C = np.linspace(LOW_C, HIGH_C, 146)


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_the_degree_of_a_polynomial_is_found(degree: int) -> None:
    rng = np.random.default_rng(SEED)
    s = GRID_C / 85.0
    y = s**degree + 0.02 * rng.standard_normal(len(s))
    rows = degree_rows("u0_v", GRID_C, y, range(1, 10))
    assert best_degree(rows) == degree, f"seed {SEED}"
    n, rms = len(y), rows[degree].rms
    assert rows[degree].bic - rows[degree].aic == pytest.approx((np.log(n) - 2) * (degree + 3))
    assert rms == pytest.approx(0.02, rel=0.2)


def test_residuals_by_degree_are_those_of_an_independent_computation() -> None:
    """Median of the largest residual, % of the largest: 3: 4.2, 5: 0.36, 6: 0.24 within a quarter; 7: 0.02, a digit."""
    rng = np.random.default_rng(SEED)
    found = np.array(
        [
            [row.most_percent for row in degree_rows("u0_v", GRID_C, draw_unit(rng).zero_ug(GRID_C), (3, 5, 6, 7))]
            for _ in range(200)
        ]
    )
    *known, seventh = np.median(found, axis=0)
    assert known == pytest.approx([4.2, 0.36, 0.24], rel=0.25), f"seed {SEED}"
    assert 0.01 <= seventh <= 0.03, f"seed {SEED}"


def test_condition_numbers_are_those_of_an_independent_computation() -> None:
    found = condition_numbers(GRID_C, 6)
    assert found["powers of °C"] == pytest.approx(1.7e11, rel=0.1)
    assert found["powers of K"] == pytest.approx(1.6e20, rel=0.5)  # beyond double precision: rounding makes it
    assert found["powers of scaled temperature"] == pytest.approx(99, rel=0.05)
    assert found["Chebyshev polynomials"] == pytest.approx(2.7, rel=0.05)
