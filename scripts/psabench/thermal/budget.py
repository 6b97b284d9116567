"""Uncertainty budget of a quantity that a thermal run found, at one temperature (docs/procedures/thermal.md).

Each cause is counted once. What is drawn again from point to point (noise of the readings, reading of the head's scale,
tilt at a mounting) reaches the curve through the fit; what such noise does not explain of the residual is misfit; what
is the same in every point (chain, circle, sensor of the case, play) is of type B.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from psabench.boards.psa2.device import CODE_V
from psabench.budget.accuracy import BenchAccuracy
from psabench.budget.gum import expand_estimate
from psabench.estimate.uncertainty import Component, Estimate, estimate, t_quantile, within_limit
from psabench.thermal.bench import BLOCKS
from psabench.thermal.compensation import Array, Compensation, SweepCase, residual_squares
from psabench.thermal.reduce import ARCSEC, AXES, Points, left_out_error, turning_axes

TEMP_U_K = 0.05  # standard uncertainty of the case's sensor (E0)
PLAY_K = 0.3  # limit of how far the way to a temperature moves what the element feels (E0)
NEXT_ORDERS = 3  # beyond the degree: what a polynomial leaves of a smooth curve is in them
SCALE_U_ARCSEC = 1.0 / 12.0**0.5  # of the head's scale, read to 1 arcsec; drawn again at each turn


@dataclass(frozen=True, slots=True, kw_only=True)
class Leftover:
    """Squares of what a curve leaves of its points: in the next orders, where the misfit to a smooth curve is, and
    beyond them, where only noise is. Sums, with their degrees of freedom."""

    smooth: float
    smooth_dof: int
    rough: float
    rough_dof: int


def element_of(p: Points, c: Compensation) -> Array:
    """Temperature of the element by the lag of a fit, (n,); that of the case where it has none."""
    if c.lag is None:
        return p.case_c
    sweep = SweepCase(t_s=p.t_s, case_c=p.case_c, history=p.history)
    return sweep.element_c(np.array([c.lag.tau_s]))[:, 0]


def leftover_of(p: Points, c: Compensation) -> Leftover:
    """By a fit of more orders to the same points."""
    all_squares = c.rms**2 * c.dof
    orders = min(NEXT_ORDERS, c.dof)
    rough_dof, rough = c.dof - orders, 0.0
    if rough_dof:
        used = p.up if c.lag is None and len(p.t_s) > c.dof + c.degree + 1 else np.ones(len(p.t_s), np.bool_)
        case, element, y = (x[used] for x in (p.case_c, element_of(p, c), p.quantity(c.quantity)))
        rough = min(residual_squares(case, element, y, c.degree + orders), all_squares)
    return Leftover(smooth=all_squares - rough, smooth_dof=orders, rough=rough, rough_dof=rough_dof)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Fitted:
    """A quantity by one method, with what is known of how it was measured."""

    points: Points
    best: Compensation
    leftover: Leftover
    settling_k: float  # that the element may miss the case by, at the end of a dwell
    play: bool  # whether the way to a temperature was not that of the soak

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


def estimate_at(f: Fitted, temp_c: float, accuracy: BenchAccuracy) -> Estimate:
    """The quantity at a temperature of the element, with its budget."""
    name, value = f.best.quantity, float(f.best.value_at(temp_c))
    noise = _readings_noise(f)
    dof = (BLOCKS - 1) * len(f.points.history[0])
    made = estimate(name, symbol_of(name), unit_of(name), value, noise * _leverage(f.best, temp_c), dof)
    parts = [*_point_parts(f, temp_c, accuracy), *_temperature_parts(f, temp_c), *_bench_parts(f, temp_c, accuracy)]
    return expand_estimate(made, [part for part in parts if part.u > 0.0])


# ---- what differs from point to point


def _readings_noise(f: Fitted) -> float:
    """Standard deviation of one point by the scatter within its recordings, two of them."""
    of_mean_v = float(f.points.scatter_v[f.axis_pair[0]])
    return of_mean_v / math.sqrt(2.0) * f.per_volt


def _head_noise(f: Fitted, a: BenchAccuracy) -> float:
    """Of one point: each position's scale is read, both are of one mounting."""
    return math.hypot(SCALE_U_ARCSEC / 2.0**0.5, a.mount_arcsec) if f.moves_with_head else 0.0


def _interpolation(f: Fitted, a: BenchAccuracy) -> float:
    """Of one point: what leaving out recordings shows beyond their noise."""
    i, j = f.axis_pair
    left_out = f.points.left_out
    square_v2 = float(left_out.half_sum_v2[i] if f.kind == "zero" else left_out.half_diff_v2[i, j])
    noise = math.hypot(_readings_noise(f), _head_noise(f, a))
    return float(left_out_error(square_v2 * f.per_volt**2, noise, f.points.left_out.noise_part))


def _leverage(c: Compensation, temp_c: float) -> float:
    """Standard deviation of the curve for noise of 1 in each point; 1 where the fit is exact."""
    return float(c.half_width([temp_c])[0]) / t_quantile(c.dof) / c.rms if c.rms > 0.0 else 1.0


def _point_parts(f: Fitted, temp_c: float, a: BenchAccuracy) -> Iterator[Component]:
    head, interpolation = _head_noise(f, a), _interpolation(f, a)
    leverage = _leverage(f.best, temp_c)
    known = float(f.points.noise_part[f.axis_pair[1]]) * (_readings_noise(f) ** 2 + head**2) + interpolation**2
    left = f.leftover
    unknown = max(left.rough / left.rough_dof - known, 0.0) if left.rough_dof else 0.0
    yield Component(name="head", u=head * leverage)
    yield Component(name="interpolation", u=interpolation * leverage)
    yield Component(name="between recordings", u=unknown**0.5 * leverage, dof=max(left.rough_dof, 1))
    yield _misfit(left, known + unknown, f.best.dof + f.best.degree + 1)


def _misfit(left: Leftover, known: float, n: int) -> Component:
    """What the polynomial leaves, rms over n points, where the variance of their errors is known.

    The squares in the next orders sum to smooth_dof * known + n m^2 on average; the variance of that sum gives m^2 its
    degrees of freedom (GUM G.3, eq. E.7).
    """
    square = (left.smooth - left.smooth_dof * known) / n
    if square <= 0.0:
        return Component(name="misfit", u=0.0)
    variance = (2.0 * left.smooth_dof * known**2 + 4.0 * n * known * square) / n**2
    return Component(name="misfit", u=square**0.5, dof=2.0 * square**2 / variance if variance > 0.0 else math.inf)


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
