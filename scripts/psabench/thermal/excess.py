"""How much more than their noise mean squares show, over quantities that share the cause.

Each is the difference of two variances, and where there is nothing it comes out negative as often as not. Cut off at 0
one by one, such differences are too large on average: by 0.4 of their standard deviation. So they are pooled with
their signs, by the weights of their noise, and only their sum in a budget is cut; where one of a group is clearly more
than the others say, the cause is not the same and each has its own (Bancroft and Han, International Statistical Review
45, 1977: pooling after a preliminary test).
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from psabench.estimate.uncertainty import Component
from psabench.thermal.compensation import Array

ALIKE_P = 0.05  # chance that a group whose cause is the same is taken for one of different causes
LARGE = 1e3  # noncentrality from which chi-square is as good as normal
K = TypeVar("K", bound=Hashable)
LEAST = 1e-12  # variance, of the largest one of a group: no weight is infinite


@dataclass(frozen=True, slots=True, kw_only=True)
class MeanSquare:
    """On average noise + gain x, x the square that is looked for."""

    value: float
    dof: float
    noise: float
    gain: float
    drawn: bool  # whether what x measures is drawn as the noise is; else it is the same in each run
    source: Hashable  # of the noise: squares of one source count once

    @property
    def signed(self) -> float:
        return (self.value - self.noise) / self.gain

    def variance(self, x: float) -> float:
        """Of `signed`. A fixed part adds to the variance of chi-square by its product with the noise alone."""
        part = self.gain * max(x, 0.0)
        own = part**2 if self.drawn else 0.0
        return 2.0 * (self.noise**2 + 2.0 * self.noise * part + own) / self.dof / self.gain**2

    def exceeds(self, x: float, p: float) -> bool:
        """Whether the value is more than x allows but with chance p."""
        from scipy.special import chdtrc, chndtr, ndtr  # slow to import

        if self.drawn or x <= 0.0:
            mean = self.noise + self.gain * x
            return bool(chdtrc(self.dof, self.dof * self.value / mean) < p) if mean > 0.0 else self.value > 0.0
        if self.noise <= 0.0:
            return self.signed > x
        above = self.dof * self.gain * x / self.noise  # noncentrality
        if above > LARGE:
            return bool(ndtr((x - self.signed) / math.sqrt(self.variance(x))) < p)
        return bool(1.0 - chndtr(self.dof * self.value / self.noise, self.dof, above) < p)


@dataclass(frozen=True, slots=True, kw_only=True)
class Excess:
    """A variance beyond noise as it came out, with its sign."""

    square: float
    variance: float  # of that

    def times(self, factor: float) -> Excess:
        return Excess(square=self.square * factor, variance=self.variance * factor**2)


def excess_of(each: Mapping[K, MeanSquare]) -> dict[K, Excess]:
    """Of a group of quantities: one for all of them, or each its own."""
    squares = list(each.values())
    weights = _weights_of(np.array([s.variance(0.0) for s in squares]))
    pooled = float(weights @ [s.signed for s in squares])
    if len(squares) > 1 and any(s.exceeds(pooled, ALIKE_P / len(squares)) for s in squares):
        return {name: Excess(square=s.signed, variance=s.variance(s.signed)) for name, s in each.items()}
    return dict.fromkeys(each, Excess(square=pooled, variance=_pooled_variance(squares, weights, pooled)))


def excess_lines(lines: Mapping[str, Excess]) -> Iterator[Component]:
    """Lines of a budget whose squares sum to the signed sum, at least 0: what is negative is taken off the others."""
    off = sum(min(x.square, 0.0) for x in lines.values())
    spread = sum(x.variance for x in lines.values() if x.square < 0.0)
    above = sum(max(x.square, 0.0) for x in lines.values())
    for name, x in lines.items():
        square = x.square * max(1.0 + off / above, 0.0) if x.square > 0.0 else 0.0
        variance = x.variance + spread
        yield Component(name=name, u=math.sqrt(square), dof=2.0 * square**2 / variance if variance > 0.0 else math.inf)


def _pooled_variance(squares: Sequence[MeanSquare], weights: Array, x: float) -> float:
    """Those of one source have the same error."""
    of: dict[Hashable, float] = {}
    for s, weight in zip(squares, weights, strict=True):
        of[s.source] = of.get(s.source, 0.0) + float(weight) * math.sqrt(s.variance(x))
    return sum(sd**2 for sd in of.values())


def _weights_of(variances: Array) -> Array:
    """By their variances where there is nothing but noise; without noise all are alike."""
    most = float(variances.max())
    weights = 1.0 / np.maximum(variances, LEAST * most) if most > 0.0 else np.ones(len(variances))
    return np.asarray(weights / weights.sum())
