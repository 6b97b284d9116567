"""Polynomial compensation of one quantity of an accelerometer against temperature, with a column for the lag.

The article's polynomial of sixth degree, y = a x^6 + ... + g, fitted in Chebyshev polynomials of the scaled temperature
s = (2 T - low - high) / (high - low): powers of degrees lose 11 of 16 digits (`degree.condition_numbers`). On a sweep
the element follows the case with a time constant; with both legs of a sweep the fit takes the element's
temperature as the polynomial's argument and case less element as one column more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from numpy.polynomial import Chebyshev, Polynomial
from numpy.polynomial.chebyshev import chebval, chebvander

from psabench.errors import BadInput, expected
from psabench.estimate.uncertainty import CONFIDENCE, t_quantile

Array = npt.NDArray[np.float64]

DEGREE = 6  # the article's
MOST_DEGREE = 12
LEAST_SPAN_K = 1.0
TAU_BOUNDS_S = (1.0, 7200.0)  # of the element behind the case, for the search
SCAN, SCANS = 16, 5  # lags a row of the search, rows: to 4e-4 of tau


@dataclass(frozen=True, kw_only=True)
class Lag:
    """How the element follows the case, and what their difference does to the quantity."""

    tau_s: float
    per_k: float  # the quantity's unit per kelvin of case less element


@dataclass(frozen=True, kw_only=True, eq=False)
class Compensation:
    """A fitted polynomial; `value` is the quantity, to be subtracted from a reading (zero) or divided by (scale)."""

    quantity: str  # name with its unit, as of estimates: u0_v, kx_v_per_g
    low_c: float
    high_c: float
    coefficients: tuple[float, ...]  # of Chebyshev polynomials of the scaled temperature, degree + 1
    covariance: Array  # of the coefficients, and of lag.per_k last: (p, p)
    dof: int
    rms: float  # of the residuals, the quantity's unit; degrees of freedom counted
    lag: Lag | None = None

    @property
    def degree(self) -> int:
        return len(self.coefficients) - 1

    def _scale_clamped(self, element_c: npt.ArrayLike) -> Array:
        """As the polynomials take it; outside of its range the polynomial is no law."""
        return scale_temperature(np.clip(element_c, self.low_c, self.high_c), self.low_c, self.high_c)

    def value_at(self, element_c: npt.ArrayLike, case_less_element_k: npt.ArrayLike = 0.0) -> Array:
        """The quantity at a temperature of the element, deg C; the same shape."""
        curve = np.asarray(chebval(self._scale_clamped(element_c), self.coefficients))
        per_k = self.lag.per_k if self.lag else 0.0
        return np.asarray(curve + per_k * np.asarray(case_less_element_k, np.float64))

    def half_width(self, element_c: npt.ArrayLike, confidence: float = CONFIDENCE) -> Array:
        """Half the confidence interval of the fitted curve: of noise alone, not of what a polynomial cannot follow."""
        rows = chebvander(self._scale_clamped(element_c), self.degree)
        p = self.degree + 1
        variance = np.einsum("...i,ij,...j->...", rows, self.covariance[:p, :p], rows)
        return np.asarray(t_quantile(self.dof, confidence) * np.sqrt(np.maximum(variance, 0.0)))

    def article_powers(self) -> tuple[float, ...]:
        """The article's a, b, ... g: of T^degree down to T^0, T in deg C."""
        series = Chebyshev(self.coefficients, domain=[self.low_c, self.high_c])
        # The identity as domain and window: plain powers of T.
        plain = series.convert(kind=Polynomial, domain=[-1.0, 1.0], window=[-1.0, 1.0])
        coefs = np.zeros(self.degree + 1)
        coefs[: len(plain.coef)] = plain.coef
        return tuple(float(c) for c in coefs[::-1])


def scale_temperature(t_c: npt.ArrayLike, low_c: float, high_c: float) -> Array:
    """-1 at low_c to 1 at high_c; the same shape."""
    return np.asarray((2.0 * np.asarray(t_c, np.float64) - low_c - high_c) / (high_c - low_c))


def element_temperature(t_s: Array, case_c: Array, tau_s: npt.ArrayLike, began_k: float = 0.0) -> Array:
    """Temperature of an element that follows the case, Te' = (Tc - Te) / tau; exact for a case that moves on straight
    lines between the instants; began_k: case less element at the first. t_s, case_c: (n,), ascending; tau_s: () or
    (k,), the result (n,) or (n, k)."""
    tau = np.asarray(tau_s, np.float64)
    behind = np.full((len(t_s), *tau.shape), began_k)  # case less element
    step_s = np.diff(t_s)
    # On a ramp the element runs after the case by rate times tau; what differs from that at the start decays.
    for k, (step, rise) in enumerate(zip(step_s, np.diff(case_c), strict=True)):
        ramp = rise / step * tau
        behind[k + 1] = ramp + (behind[k] - ramp) * np.exp(-step / tau)
    return np.asarray(case_c.reshape(-1, *(1,) * tau.ndim) - behind)


def fit_soak(quantity: str, t_c: npt.ArrayLike, y: npt.ArrayLike, degree: int = DEGREE) -> Compensation:
    """From readings at temperatures of the element: soaked, or one leg of a sweep. t_c, y: (n,).

    Raises BadInput for too few readings, too little of a range or a number that is not finite.
    """
    t_c, y = checked_readings(quantity, t_c, y, degree)
    return _fit_readings(quantity, t_c, y, degree)


def fit_sweep(
    quantity: str,
    t_s: npt.ArrayLike,
    case_c: npt.ArrayLike,
    y: npt.ArrayLike,
    degree: int = DEGREE,
    *,
    history: tuple[Array, Array] | None = None,
    tau_s: float | None = None,
) -> Compensation:
    """From readings of a sweep in both directions, with time: the lag is found beside the polynomial. (n,) each.

    history: instants and temperatures of the case, (m,) each, where it was read more often than y. tau_s: a lag that
    is known, from another quantity of the same element.

    Raises BadInput as fit_soak does, and where time does not ascend or the sweep does not turn: one leg cannot tell a
    lag from a shift of the curve.
    """
    case_c, y = checked_readings(quantity, case_c, y, degree, more=2)
    t_s = np.asarray(t_s, np.float64)
    if t_s.shape != y.shape or not np.all(np.isfinite(t_s)) or np.any(np.diff(t_s) <= 0):
        raise BadInput(expected("instants that ascend, one a reading", "others", quantity))
    if turns_of(case_c) == 0:
        raise BadInput(expected("both legs of a sweep, to tell the lag from the curve", "one leg", quantity))
    sweep = SweepCase(t_s=t_s, case_c=case_c, history=history or (t_s, case_c))
    tau = _best_tau_s(sweep, y, degree) if tau_s is None else tau_s
    element = sweep.element_c(np.array([tau]))[:, 0]
    return _fit_readings(quantity, element, y, degree, Lag(tau_s=tau, per_k=0.0), case_c - element, tau_s is None)


@dataclass(frozen=True, kw_only=True, eq=False)
class SweepCase:
    """Temperature of the case at the readings of a sweep, (n,), and its history, (m,) each."""

    t_s: Array
    case_c: Array
    history: tuple[Array, Array]

    def element_c(self, tau_s: Array) -> Array:
        """Of elements that follow with these lags, (k,), at the readings: (n, k)."""
        element = element_temperature(*self.history, tau_s)
        return np.stack([np.interp(self.t_s, self.history[0], column) for column in element.T], axis=1)


def turns_of(case_c: Array) -> int:
    """How often a sweep turns by more than a tenth of its range: noise of a sensor does not count."""
    least, turns, up, extreme = 0.1 * float(np.ptp(case_c)), 0, 0, float(case_c[0])
    for t in case_c:
        if up == 0 and abs(t - extreme) > least:
            up, extreme = int(np.sign(t - extreme)), float(t)
        elif up * (t - extreme) > 0:
            extreme = float(t)
        elif up and abs(t - extreme) > least:
            up, extreme, turns = -up, float(t), turns + 1
    return turns


def checked_readings(
    quantity: str, t_c: npt.ArrayLike, y: npt.ArrayLike, degree: int, more: int = 0
) -> tuple[Array, Array]:
    """As arrays (n,). more: parameters beside the polynomial's. Raises BadInput."""
    t_c, y = np.asarray(t_c, np.float64), np.asarray(y, np.float64)
    if not 0 <= degree <= MOST_DEGREE:
        raise BadInput(expected(f"a degree of 0 to {MOST_DEGREE}", degree, quantity))
    if t_c.ndim != 1 or t_c.shape != y.shape:
        raise BadInput(expected("a temperature for each reading", f"{t_c.shape} for {y.shape}", quantity))
    if not (np.all(np.isfinite(t_c)) and np.all(np.isfinite(y))):
        raise BadInput(expected("finite temperatures and readings", "others", quantity))
    if len(np.unique(t_c)) < (least := degree + 2 + more):
        raise BadInput(expected(f"readings at {least} temperatures or more", len(np.unique(t_c)), quantity))
    if np.ptp(t_c) < LEAST_SPAN_K:
        raise BadInput(expected(f"a range of {LEAST_SPAN_K:g} K or more", f"{np.ptp(t_c):.3g} K", quantity))
    return t_c, y


def _design_matrix(scaled: Array, degree: int, column: Array | None) -> Array:
    rows = chebvander(scaled, degree)
    return np.asarray(rows if column is None else np.column_stack([rows, column]), np.float64)


def residual_squares(case_c: Array, element_c: Array, y: Array, degree: int) -> float:
    """Sum of the residuals' squares of a fit with that temperature of the element, (n,) each, and the lag's column."""
    scaled = scale_temperature(element_c, float(element_c.min()), float(element_c.max()))
    rows = _design_matrix(scaled, degree, case_c - element_c)
    residual = y - rows @ np.linalg.lstsq(rows, y, rcond=None)[0]
    return float(residual @ residual)


def _best_tau_s(sweep: SweepCase, y: Array, degree: int) -> float:
    """The lag with the least squares: rows of lags in equal ratios, each row between the neighbours of the best."""
    low, high = TAU_BOUNDS_S
    for _ in range(SCANS):
        scan = np.geomspace(low, high, SCAN)
        element = sweep.element_c(scan)
        best = int(np.argmin([residual_squares(sweep.case_c, column, y, degree) for column in element.T]))
        low, high = scan[max(best - 1, 0)], scan[min(best + 1, SCAN - 1)]
    return float(np.sqrt(low * high))


def _fit_readings(
    quantity: str,
    t_c: Array,
    y: Array,
    degree: int,
    lag: Lag | None = None,
    column: Array | None = None,
    lag_found: bool = False,
) -> Compensation:
    """Least squares by QR. lag_found: its time constant counts as a parameter, for these readings gave it."""
    low_c, high_c = float(t_c.min()), float(t_c.max())
    rows = _design_matrix(scale_temperature(t_c, low_c, high_c), degree, column)
    q, r = np.linalg.qr(rows)
    found = np.linalg.solve(r, q.T @ y)
    residual = y - rows @ found
    dof = max(len(y) - rows.shape[1] - lag_found, 1)
    variance = float(residual @ residual) / dof
    inverse = np.linalg.inv(r)
    return Compensation(
        quantity=quantity,
        low_c=low_c,
        high_c=high_c,
        coefficients=tuple(float(c) for c in found[: degree + 1]),
        covariance=variance * inverse @ inverse.T,
        dof=dof,
        rms=float(np.sqrt(variance)),
        lag=replace(lag, per_k=float(found[-1])) if lag else None,
    )


# ---- as JSON, in a passport


def compensation_dict(c: Compensation) -> dict[str, Any]:
    """Of JSON's types; `compensation_of_dict` is the reverse."""
    return {
        "quantity": c.quantity,
        "low_c": c.low_c,
        "high_c": c.high_c,
        "chebyshev": list(c.coefficients),
        "powers": list(c.article_powers()),
        "covariance": c.covariance.tolist(),
        "dof": c.dof,
        "rms": c.rms,
        "lag": None if c.lag is None else {"tau_s": c.lag.tau_s, "per_k": c.lag.per_k},
    }


def compensation_of_dict(data: Mapping[str, Any], where: str = "compensation") -> Compensation:
    """Raises BadInput for what is none."""
    try:
        coefficients = _number_tuple(data["chebyshev"])
        covariance = np.array([_number_tuple(row) for row in data["covariance"]])
        lag = data["lag"]
        made = Compensation(
            quantity=str(data["quantity"]),
            low_c=float(data["low_c"]),
            high_c=float(data["high_c"]),
            coefficients=coefficients,
            covariance=covariance,
            dof=int(data["dof"]),
            rms=float(data["rms"]),
            lag=None if lag is None else Lag(tau_s=float(lag["tau_s"]), per_k=float(lag["per_k"])),
        )
    except (KeyError, TypeError, ValueError) as e:
        raise BadInput(expected("a compensation", f"{type(e).__name__}: {e}", where)) from e
    size = len(coefficients) + (made.lag is not None)
    sound = 1 <= len(coefficients) <= MOST_DEGREE + 1 and covariance.shape == (size, size) and made.dof >= 1
    if not (sound and made.high_c - made.low_c >= LEAST_SPAN_K and np.all(np.isfinite([*coefficients, made.rms]))):
        raise BadInput(expected("a compensation whose sizes and range agree", "another", where))
    return made


def _number_tuple(values: Sequence[Any]) -> tuple[float, ...]:
    return tuple(float(v) for v in values)
