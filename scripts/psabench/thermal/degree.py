"""Which degree a compensation takes: residual, AIC and BIC per degree; and how well each form keeps its digits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from numpy.polynomial.chebyshev import chebvander

from psabench.thermal.compensation import Array, checked_readings, fit_soak, scale_temperature

ZERO_C_IN_K = 273.15


@dataclass(frozen=True, kw_only=True)
class DegreeRow:
    """A degree tried."""

    degree: int
    most_percent: float  # largest residual, of the largest magnitude of the quantity
    rms: float  # the quantity's unit
    aic: float
    bic: float


def degree_rows(quantity: str, t_c: npt.ArrayLike, y: npt.ArrayLike, degrees: Sequence[int]) -> list[DegreeRow]:
    """Each degree fitted to the same readings, (n,). AIC and BIC of normal residuals, one constant left out.

    Raises BadInput as fit_soak does, for the highest degree.
    """
    t_c, y = checked_readings(quantity, t_c, y, max(degrees))
    return [_degree_row(quantity, t_c, y, degree) for degree in degrees]


def _degree_row(quantity: str, t_c: Array, y: Array, degree: int) -> DegreeRow:
    fit = fit_soak(quantity, t_c, y, degree)
    residual = y - fit.value_at(t_c)
    n, parameters = len(y), degree + 2  # the variance is one of them
    # Residuals of rounding alone would give a logarithm of nothing.
    level = n * np.log(max(float(residual @ residual) / n, np.finfo(np.float64).tiny))
    return DegreeRow(
        degree=degree,
        most_percent=100.0 * float(np.abs(residual).max() / np.abs(y).max()),
        rms=fit.rms,
        aic=float(level + 2 * parameters),
        bic=float(level + np.log(n) * parameters),
    )


def best_degree(rows: Sequence[DegreeRow]) -> int:
    """That of the least BIC."""
    return min(rows, key=lambda row: row.bic).degree


def condition_numbers(t_c: npt.ArrayLike, degree: int) -> dict[str, float]:
    """Condition number (2-norm) of the matrix of each form's fit at these temperatures, (n,)."""
    t_c = np.asarray(t_c, np.float64)
    s = scale_temperature(t_c, float(t_c.min()), float(t_c.max()))
    forms: Mapping[str, Array] = {
        "powers of °C": np.vander(t_c, degree + 1),
        "powers of K": np.vander(t_c + ZERO_C_IN_K, degree + 1),
        "powers of scaled temperature": np.vander(s, degree + 1),
        "Chebyshev polynomials": np.asarray(chebvander(s, degree), np.float64),
    }
    return {name: float(np.linalg.cond(rows)) for name, rows in forms.items()}
