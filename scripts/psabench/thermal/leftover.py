"""What a curve leaves of its points, and how noise of the readings reaches both.

The points of a sweep are interpolated, so their noise is not white: noise of neighbours is shared, the low orders of a
curve keep all of a reading's variance and the high ones little of it. Every sum of squares comes with its part
of a reading's variance, tr(P C), with C the covariance of the points for readings of variance 1 and P the projection on
the orders; its degrees of freedom are tr(P C)^2 / tr(P C P C) (Satterthwaite, Biometrics Bulletin 2, 1946).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.polynomial.chebyshev import chebvander

from psabench.thermal.compensation import Array, Compensation, SweepCase, scale_temperature
from psabench.thermal.reduce import AXES, Curves, Points, Quantities

NEXT_ORDERS = 2  # beyond the degree, an odd and an even one: what a polynomial leaves of a smooth curve is in them
TAU_STEP = 1e-4  # of the lag, for its derivative


@dataclass(frozen=True, slots=True, kw_only=True)
class Squares:
    """A sum of squares."""

    total: float
    noise_part: float  # of it for readings of variance 1
    dof: float  # of that


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Leftover:
    """Of a curve: squares in the next orders, where the misfit to a smooth curve is, and beyond them, where only noise
    is; and the covariance of its parameters."""

    n: int
    smooth: Squares
    rough: Squares | None  # None: no orders are left
    covariance: Array  # for readings of variance 1; Chebyshev coefficients first

    def noise_gain(self, c: Compensation, temp_c: float) -> float:
        """Standard deviation of the curve at a temperature of the element, for readings of variance 1."""
        row = chebvander(_scaled(c, np.array([temp_c])), c.degree)[0]
        p = c.degree + 1
        return float(np.sqrt(max(row @ self.covariance[:p, :p] @ row, 0.0)))


def element_of(p: Points, c: Compensation) -> Array:
    """Temperature of the element by the lag of a fit, (n,); that of the case where it has none."""
    return p.case_c if c.lag is None else _element_at(p.history, p.t_s, c.lag.tau_s)


def curves_of(p: Points, best: Mapping[str, Compensation]) -> Curves:
    """Curves as a sweep went through them, by name of the quantity."""

    def at(t_s: Array) -> Quantities:
        case_c = np.interp(t_s, *p.history)
        taus = {q: c.lag.tau_s if c.lag else None for q, c in best.items()}
        element = {tau: _element_at(p.history, t_s, tau) if tau else case_c for tau in set(taus.values())}
        value = {q: c.value_at(element[taus[q]], case_c - element[taus[q]]) for q, c in best.items()}
        none = np.zeros(len(t_s))
        base = [[value[f"base_{a}{b}_arcsec"] if a != b else none for b in AXES] for a in AXES]
        return Quantities(
            zero_ug=np.stack([value[f"zero_{a}_ug"] for a in AXES], axis=1),
            scale_v_per_g=np.stack([value[f"scale_{a}_v_per_g"] for a in AXES], axis=1),
            base_arcsec=np.moveaxis(np.array(base), 2, 0),
        )

    return at


def leftover_of(p: Points, c: Compensation) -> Leftover:
    """Of the points that the curve was fitted to: all of a soak or of both legs, else those of the way up."""
    used = p.up if c.lag is None and len(p.t_s) > c.dof + c.degree + 1 else np.ones(len(p.t_s), np.bool_)
    y = p.quantity(c.quantity)[used]
    noise = p.noise_covariance[AXES.index(c.quantity.split("_")[1][-1])][np.ix_(used, used)]
    element = element_of(p, c)
    rows = np.asarray(chebvander(_scaled(c, element), c.degree + NEXT_ORDERS), np.float64)[used]
    fitted = np.column_stack([rows[:, : c.degree + 1], *(column[used] for column in _lag_columns(p, c, element))])
    orders = min(NEXT_ORDERS, len(y) - fitted.shape[1])
    inner = fitted.shape[1] + orders
    further = rows[:, c.degree + 1 :][:, :orders]
    basis = np.linalg.qr(np.column_stack([fitted, further]), mode="complete")[0]
    inverse = np.linalg.pinv(fitted)
    return Leftover(
        n=len(y),
        smooth=_squares_in(basis[:, fitted.shape[1] : inner], y, noise),
        rough=_squares_in(basis[:, inner:], y, noise) if inner < len(y) else None,
        covariance=inverse @ noise @ inverse.T,
    )


def _squares_in(basis: Array, y: Array, noise: Array) -> Squares:
    """Of y in the space of the columns, which are orthonormal."""
    inside, spread = basis.T @ y, basis.T @ noise @ basis
    part = float(np.trace(spread))
    return Squares(total=float(inside @ inside), noise_part=part, dof=part**2 / float((spread**2).sum()))


def _lag_columns(p: Points, c: Compensation, element_c: Array) -> Iterator[Array]:
    """How the curve at the points follows what was found of its lag, (n,) each."""
    if c.lag is None:
        return
    yield p.case_c - element_c
    if len(p.t_s) - c.degree - 2 > c.dof:  # the time constant is this quantity's own
        later_c = _element_at(p.history, p.t_s, c.lag.tau_s * (1.0 + TAU_STEP))
        yield (c.value_at(later_c, p.case_c - later_c) - c.value_at(element_c, p.case_c - element_c)) / TAU_STEP


def _scaled(c: Compensation, element_c: Array) -> Array:
    return scale_temperature(np.clip(element_c, c.low_c, c.high_c), c.low_c, c.high_c)


def _element_at(history: tuple[Array, Array], t_s: Array, tau_s: float) -> Array:
    sweep = SweepCase(t_s=t_s, case_c=t_s, history=history)
    return sweep.element_c(np.array([tau_s]))[:, 0]
