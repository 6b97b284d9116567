"""Confidence: delta method, Student quantiles, correlations, and whether a number was measured at all."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """One line of an uncertainty budget."""

    name: str
    u: float  # standard uncertainty that it gives the estimate, in the estimate's unit
    dof: float = math.inf  # degrees of freedom; inf: type B, known without readings
    rectangular: bool = False  # known by limits alone: u is their half width over the root of 3 (GUM 4.3.7)


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """One number of a report. `name` carries the unit; value, sd and CI are in `unit`."""

    name: str
    symbol: str  # as in the article
    unit: str
    value: float
    sd: float  # standard uncertainty: of the scatter, or of all components of `budget`
    ci_half: float  # 95 % confidence interval is value +- ci_half
    identifiable: bool = True
    reason: str = ""  # why not identifiable, for people
    dof: float = math.inf
    budget: tuple[Component, ...] = ()  # of psabench.budget.gum; (): the scatter alone


@dataclass(frozen=True, slots=True, kw_only=True)
class Correlation:
    """Correlation matrix of the estimates of the same names."""

    names: tuple[str, ...]
    matrix: Array  # (q, q)

    def between(self, a: str, b: str) -> float:
        """Raises ValueError for a name that is not in `names`."""
        return float(self.matrix[self.names.index(a), self.names.index(b)])


def within_limit(name: str, limit: float) -> Component:
    """Of an error that is anywhere within +- limit, in the estimate's unit."""
    return Component(name=name, u=limit / math.sqrt(3.0), rectangular=True)


def t_quantile(dof: float, confidence: float = CONFIDENCE) -> float:
    """Two-sided Student quantile: the half width of the interval in standard deviations."""
    from scipy.special import ndtri, stdtrit  # slow to import: the shell and --help do without

    p = 0.5 + confidence / 2
    return float(stdtrit(dof, p) if math.isfinite(dof) else ndtri(p))


def propagate(jacobian: Array, cov: Array) -> Array:
    """Delta method J P J': Jacobian (q, p, ...), covariance (p, p), result (q, q, ...)."""
    out: Array = np.einsum("ip...,pr,jr...->ij...", jacobian, cov, jacobian)
    return out


def correlation(names: Sequence[str], cov: Array) -> Correlation:
    """From a covariance (q, q). A parameter of zero variance correlates with nothing."""
    sd = np.sqrt(np.diag(cov))
    scale = np.where(sd > 0, sd, 1.0)
    matrix = cov / np.outer(scale, scale)
    np.fill_diagonal(matrix, 1.0)
    return Correlation(names=tuple(names), matrix=np.clip(matrix, -1.0, 1.0))


def estimate(name: str, symbol: str, unit: str, value: float, sd: float, dof: int, scale: float = 1.0) -> Estimate:
    """An `Estimate` in `unit`; value and sd are given in unit/scale (180/pi: given in radians)."""
    sd_scaled = float(sd) * scale
    return Estimate(
        name=name,
        symbol=symbol,
        unit=unit,
        value=float(value) * scale,
        sd=sd_scaled,
        ci_half=t_quantile(dof) * sd_scaled,
        dof=dof,
    )


def not_identifiable(e: Estimate, reason: str) -> Estimate:
    """The same number with its flag down."""
    return replace(e, identifiable=False, reason=reason)


def alpha0_doubt(alpha0: Estimate, kxy_v_per_g2: float, quadratic_bound_v_per_g2: float | None) -> str:
    """Why alpha0 (deg) of a single face is no measurement, or "" when it is one.

    A term q = k_xx - k_yy turns the second harmonic just as alpha0 does: it moves alpha0 by q/(2 k_xy) rad.
    Unless the caller knows a bound on |q| (the reversal measures q), nothing in the data of one face excludes
    it.
    """
    if alpha0.ci_half > abs(alpha0.value):
        return f"95 % interval of +-{alpha0.ci_half:.3g} deg is wider than the value"
    enough_v_per_g2 = 2 * abs(kxy_v_per_g2) * math.radians(abs(alpha0.value))
    if quadratic_bound_v_per_g2 is None:
        return (
            "one face cannot exclude k_xx - k_yy; "
            f"{enough_v_per_g2 * 1e6:.3g} uV/g^2 of it would make all of this angle"
        )
    if quadratic_bound_v_per_g2 > enough_v_per_g2:
        return (
            f"|k_xx - k_yy| is only known to be below {quadratic_bound_v_per_g2 * 1e6:.3g} uV/g^2; "
            f"{enough_v_per_g2 * 1e6:.3g} would make all of this angle"
        )
    return ""


def lack_of_fit_p(residual_v: Array, groups: Array, parameters: int) -> float | None:
    """P value of the F test of scatter between settings against scatter within them.

    `groups` numbers the setting of each reading. Small: the model misses something that repeats from turn to
    turn (a third harmonic, a converter's step), and intervals from the residual are too short. None when
    nothing was repeated.
    """
    from scipy.special import fdtrc  # what scipy.stats' f.sf calls, which takes seconds to import

    _, index, count = np.unique(groups, return_inverse=True, return_counts=True)
    dof_between, dof_within = count.size - parameters, residual_v.size - count.size
    if dof_between <= 0 or dof_within <= 0:
        return None
    mean = np.bincount(index, residual_v) / count
    between = float((count * mean**2).sum()) / dof_between
    within = float(((residual_v - mean[index]) ** 2).sum()) / dof_within
    if within == 0.0:
        return None if between == 0.0 else 0.0
    return float(fdtrc(dof_between, dof_within, between / within))
