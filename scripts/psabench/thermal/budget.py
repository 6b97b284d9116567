"""Uncertainty budget of a quantity that a thermal run found, at one temperature (docs/procedures/thermal.md).

Each cause is counted once. What is drawn again from point to point (noise of the readings, reading of the head's scale,
tilt at a mounting) reaches the curve through the fit; what such noise does not explain of the residual is misfit; what
is the same in every point (chain, circle, sensor of the case, play) is of type B.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from psabench.boards.psa2.device import CODE_V
from psabench.budget.accuracy import BenchAccuracy
from psabench.budget.gum import expand_estimate
from psabench.estimate.uncertainty import Component, Estimate, estimate, within_limit
from psabench.thermal.bench import BLOCKS
from psabench.thermal.compensation import Compensation
from psabench.thermal.excess import Excess, MeanSquare, excess_lines, excess_of
from psabench.thermal.leftover import Leftover
from psabench.thermal.reduce import ARCSEC, AXES, Points, face_of, turning_axes

TEMP_U_K = 0.05  # standard uncertainty of the case's sensor (E0)
PLAY_K = 0.3  # limit of how far the way to a temperature moves what the element feels (E0)
Key = tuple[str, str]  # method and quantity
NOTHING = Excess(square=0.0, variance=0.0)
SCALE_U_ARCSEC = 1.0 / 12.0**0.5  # of the head's scale, read to 1 arcsec; drawn again at each turn


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fitted:
    """A quantity by one method, with what is known of how it was measured."""

    method: str  # soak; sweep-1
    points: Points
    best: Compensation
    leftover: Leftover
    settling_k: float  # that the element may miss the case by, at the end of a dwell
    play: bool  # whether the way to a temperature was not that of the soak

    @property
    def key(self) -> Key:
        return self.method, self.best.quantity

    @property
    def kind(self) -> str:
        return self.best.quantity.partition("_")[0]

    @property
    def axis_pair(self) -> tuple[int, int]:
        """The axis, and the one that is vertical where the quantity is read."""
        letters = self.best.quantity.split("_")[1]
        return AXES.index(letters[0]), AXES.index(letters[-1])

    @property
    def moves_with_head(self) -> bool:
        """Whether an error of the head's angle moves it: the axis is not along the head's, the other one vertical."""
        i, j = self.axis_pair
        return self.kind == "base" and i in turning_axes(j)

    @property
    def per_volt(self) -> float:
        """The quantity's unit a volt of half a sum or a difference."""
        scale = float(self.points.scale_v_per_g[:, self.axis_pair[0]].mean())
        by_kind: dict[str, float] = {"zero": 1e6 / scale, "scale": 1.0, "base": ARCSEC / scale}
        return by_kind[self.kind]


def unit_of(quantity: str) -> str:
    """By the name of the quantity."""
    return {"zero": "µg", "scale": "V/g", "base": "″"}[quantity.partition("_")[0]]


def symbol_of(quantity: str) -> str:
    """As on pages."""
    kind, axes = quantity.split("_")[:2]
    return {"zero": f"g_t,{axes}", "scale": f"U_k,{axes}", "base": f"δ_{axes}"}[kind]


@dataclass(frozen=True, kw_only=True, eq=False)
class Budget:
    """Of all quantities by all methods: what is more than noise is found over those that share its cause."""

    fitted: Mapping[Key, Fitted]
    accuracy: BenchAccuracy

    def estimate_at(self, method: str, quantity: str, temp_c: float) -> Estimate:
        """The quantity at a temperature of the element, with its budget."""
        f = self.fitted[method, quantity]
        gain, dof = f.leftover.noise_gain(f.best, temp_c), (BLOCKS - 1) * len(f.points.history[0])
        value, scatter = float(f.best.value_at(temp_c)), _readings_noise(f) * gain
        made = estimate(quantity, symbol_of(quantity), unit_of(quantity), value, scatter, dof)
        points, temps = self._point_parts(f, gain), _temperature_parts(f, temp_c)
        parts = [*points, *temps, *_bench_parts(f, temp_c, self.accuracy)]
        return expand_estimate(made, [part for part in parts if part.u > 0.0])

    # ---- what differs from point to point

    def _point_parts(self, f: Fitted, gain: float) -> Iterator[Component]:
        yield Component(name="head", u=_head_noise(f, self.accuracy) * gain)
        between, misfit = self._between[f.key], self._misfit[f.key]
        yield from excess_lines({"between recordings": between.times(gain**2), "misfit": misfit})

    @cached_property
    def _between(self) -> dict[Key, Excess]:
        """Of one point: what is beyond the next orders. Tilts of the mounting are in what the head moves alone."""
        return self._pooled(self._rough_square, by=lambda f: (f.kind, f.moves_with_head, f.method))

    @cached_property
    def _misfit(self) -> dict[Key, Excess]:
        """What the polynomial leaves, rms over the points: the curve is the same for all methods."""
        return self._pooled(self._smooth_square, by=lambda f: f.kind)

    def _pooled(
        self, square: Callable[[Fitted], MeanSquare | None], by: Callable[[Fitted], Hashable]
    ) -> dict[Key, Excess]:
        """Over the groups of quantities that share the cause."""
        groups: dict[Hashable, dict[Key, MeanSquare]] = {}
        for key, f in self.fitted.items():
            if (made := square(f)) is not None:
                groups.setdefault(by(f), {})[key] = made
        found = dict.fromkeys(self.fitted, NOTHING)
        for group in groups.values():
            found |= excess_of(group)
        return found

    def _known(self, f: Fitted) -> float:
        """Variance of what is drawn at each position, of two of them."""
        return _readings_noise(f) ** 2 + _head_noise(f, self.accuracy) ** 2

    def _rough_square(self, f: Fitted) -> MeanSquare | None:
        rough = f.leftover.rough
        if rough is None:
            return None
        return MeanSquare(
            value=rough.total / rough.noise_part,
            dof=rough.dof,
            noise=self._known(f),
            gain=1.0,
            drawn=True,
            source=_source_of(f),
        )

    def _smooth_square(self, f: Fitted) -> MeanSquare:
        smooth = f.leftover.smooth
        return MeanSquare(
            value=smooth.total / smooth.noise_part,
            dof=smooth.dof,
            noise=self._known(f) + self._between[f.key].square,
            gain=f.leftover.n / smooth.noise_part,
            drawn=False,
            source=_source_of(f),
        )


def _source_of(f: Fitted) -> Hashable:
    """Of what is drawn: a tilt is the same for all axes that the head turns on one face, noise is each quantity's."""
    return f.method, face_of(f.axis_pair[1]) if f.moves_with_head else f.best.quantity


def _readings_noise(f: Fitted) -> float:
    """Standard deviation of one point by the scatter within its recordings, two of them."""
    of_mean_v = float(f.points.scatter_v[f.axis_pair[0]])
    return of_mean_v / math.sqrt(2.0) * f.per_volt


def _head_noise(f: Fitted, a: BenchAccuracy) -> float:
    """Of one point: each position's scale is read, both are of one mounting."""
    return math.hypot(SCALE_U_ARCSEC / 2.0**0.5, a.mount_arcsec) if f.moves_with_head else 0.0


# ---- what all points share


def _slope_of(c: Compensation, temp_c: float) -> float:
    """A kelvin, within the range."""
    inside_c = min(max(temp_c, c.low_c + 0.5), c.high_c - 0.5)
    return float(c.value_at(inside_c + 0.5) - c.value_at(inside_c - 0.5))


def _temperature_parts(f: Fitted, temp_c: float) -> Iterator[Component]:
    slope = abs(_slope_of(f.best, temp_c))
    yield Component(name="temperature", u=slope * TEMP_U_K)
    if f.play:
        yield within_limit("play", slope * PLAY_K)
    yield within_limit("settling", slope * f.settling_k)


def _bench_parts(f: Fitted, temp_c: float, a: BenchAccuracy) -> Iterator[Component]:
    """Chain, codes and circle."""
    yield within_limit("resolution", _undithered_v(f) * f.per_volt)
    board_k = abs(temp_c - 25.0)
    if f.kind == "scale":
        scale = float(f.best.value_at(temp_c))
        yield Component(name="chain gain", u=scale * a.chain_gain_ppm * 1e-6)
        yield Component(name="chain over temperature", u=scale * a.chain_gain_tc_ppm_per_k * board_k * 1e-6)
    elif f.kind == "zero":
        yield Component(name="chain zero", u=a.chain_zero_uv * 1e-6 * f.per_volt)
        yield Component(name="chain over temperature", u=a.chain_zero_tc_uv_per_k * board_k * 1e-6 * f.per_volt)
    elif f.moves_with_head:
        yield Component(name="circle", u=a.circle_arcsec / 2.0**0.5)


def _undithered_v(f: Fitted) -> float:
    """Limit of what cutting codes off does to a mean, beside the half code that is taken out: noise of sd s in the
    samples leaves exp(-2 pi^2 s^2) of it, s in codes (Widrow and Kollar, Quantization Noise, 2008)."""
    s = float(f.points.scatter_v[f.axis_pair[0]]) * f.points.samples**0.5 / CODE_V
    return CODE_V / 2.0 * float(np.exp(-2.0 * (np.pi * s) ** 2))
