"""Every generation of converters in a chamber: drift of zero and scale of each with temperature. Wire only.

The table turns each accelerometer into gravity, across it and against it at every temperature; gravity along the
table's angle is the known input. Of each position a unit tells the mean voltage at its load, from its own readings by
the article's formulas (`psabench.procedures.compare_converters`). Zero and scale of an axis are the straight line
through its positions; what they change by from the first temperature on is the drift. Sensors and gravity are the
same at all temperatures, so that their errors drop out of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psabench.bench import Bench
from psabench.climate.coefficients import weights_per_k
from psabench.climate.soak import soak_units
from psabench.errors import expected
from psabench.link.signals import Floats
from psabench.procedures.compare_converters import GENERATIONS, SETTLE_S, OfGeneration, Track, tracks_of, units_of
from psabench.procedures.comparison import COVERAGE_K, PSD1_CODE_V, PSD1_FULL_SCALE_V, PSD1_NOISE_V
from psabench.procedures.head_bench import Progress

SCENARIO = "converters_chamber"
ANGLES_DEG = (0.0, 90.0, 180.0, 270.0)  # of the table, about the level axis y: Z down, X up, Z up, X down
SCALED = (0, 2)  # axes that gravity comes along: X, Z; Y stays level, so that of it there is a zero alone
BLOCKS = 10  # parts of a recording, whose scatter says how much its mean scatters
REST_S = 0.5  # after a turn: filters settle

# Noise of the words of which one calibrates the unit at power-up.
SELF_CALIBRATION_V: Mapping[str, float] = {"psd1": PSD1_NOISE_V}
# Words that are cut off and whose noise is below a code: the mean of an input at rest is off by up to a code, however
# long it is taken.
ROUNDING_V: Mapping[str, float] = {"psd1": PSD1_CODE_V / math.sqrt(12.0)}


@dataclass(frozen=True, slots=True, kw_only=True)
class ChamberParams:
    """Parameters of `compare-converters --chamber`. points_degc: the first is the one that drifts are counted from."""

    points_degc: tuple[float, ...] = (25.0, -60.0, -20.0, 55.0, 85.0)
    seconds: float = 30.0  # of recording at each position
    soak_s: float = 300.0  # after the air is there; 15 time constants of the scenario's units

    def __post_init__(self) -> None:
        if len(set(self.points_degc)) < 3 or len(set(self.points_degc)) < len(self.points_degc):
            raise ValueError(expected("three or more different temperatures", self.points_degc, "points_degc"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """What a unit told at one position."""

    mean_v: Floats  # (3,) at the load
    block_var_v2: Floats  # (3,) variance of the means of its blocks
    span_s: float
    quantum_vs: float
    gain_u: float  # standard uncertainty from the unit's own calibrations, relative; 0: it makes none
    zero_u_v: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Soak:
    """One temperature: the units at the table's positions."""

    degc: float  # by the chamber's thermometer
    angle_deg: tuple[float, ...]  # by the table's readout
    positions: Mapping[str, tuple[Position, ...]]  # by name of GENERATIONS


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """A figure against temperature: its values and the straight line through them."""

    values: Floats  # (p,) at the temperatures of the run
    u: float  # standard uncertainty of each
    per_k: float
    per_k_u: float  # standard

    @property
    def drift(self) -> Floats:
        """From the first temperature on."""
        return np.asarray(self.values - self.values[0])

    @property
    def worst(self) -> float:
        """The greatest drift, with its sign."""
        return float(self.drift[np.argmax(np.abs(self.drift))])

    @property
    def drift_expanded_u(self) -> float:
        """U of a drift: the difference of two values."""
        return COVERAGE_K * math.sqrt(2.0) * self.u

    @property
    def per_k_expanded_u(self) -> float:
        return COVERAGE_K * self.per_k_u


@dataclass(frozen=True, slots=True, kw_only=True)
class Drift(OfGeneration):
    """Of one generation: zeros of X, Y, Z at the load, V; scales of X and Z, as parts of the nominal one."""

    zero_v: tuple[Line, ...]
    scale: tuple[Line, ...]

    @property
    def worst_zero(self) -> Line:
        """Of the axis that drifts most."""
        return max(self.zero_v, key=lambda line: abs(line.worst))

    @property
    def worst_scale(self) -> Line:
        return max(self.scale, key=lambda line: abs(line.worst))


# ---- measuring


def measure_soaks(bench: Bench, p: ChamberParams, progress: Progress) -> tuple[Soak, ...]:
    """Every position at every temperature. Raises BadInput for a bench without the units, LinkError."""
    units = units_of(bench)
    soaks = []
    with progress.step("converters in a chamber", len(p.points_degc) * len(ANGLES_DEG)) as done:
        for point in p.points_degc:
            degc = soak_units(bench, point, p.soak_s, SETTLE_S)
            angles, told = [], []
            for angle in ANGLES_DEG:
                bench.table.position(angle)
                bench.wait(REST_S)
                angles.append(bench.table.angle_deg())
                told.append({t.name: position_of(t) for t in tracks_of(units, lambda: bench.wait(p.seconds))})
                done()
            positions = {name: tuple(each[name] for each in told) for name in units}
            soaks.append(Soak(degc=degc, angle_deg=tuple(angles), positions=positions))
    return tuple(soaks)


def position_of(track: Track) -> Position:
    """Mean over the whole recording, and the scatter of the means of its parts. Pure."""
    at_s = np.linspace(track.t_s[0], track.t_s[-1], BLOCKS + 1)
    s_vs = np.stack([np.interp(at_s, track.t_s, track.s_vs[:, i]) for i in range(3)], axis=1)
    span_s = float(at_s[-1] - at_s[0])
    blocks_v = np.diff(s_vs, axis=0) / (span_s / BLOCKS)
    return Position(
        mean_v=np.asarray((track.s_vs[-1] - track.s_vs[0]) / span_s),
        block_var_v2=np.asarray(blocks_v.var(axis=0, ddof=1)),
        span_s=span_s,
        quantum_vs=track.quantum_vs,
        gain_u=track.gain_u,
        zero_u_v=track.zero_u_v,
    )


# ---- estimating; pure


def estimate_drifts(soaks: Sequence[Soak]) -> tuple[Drift, ...]:
    """Of every generation that all soaks have."""
    return tuple(_drift_of(name, soaks) for name in soaks[0].positions)


def mean_u_v(positions: Sequence[Position]) -> float:
    """Standard uncertainty of the mean of one position, V: noise, pooled over all, and the rounding of its ends."""
    noise, ends = [], []
    for p in positions:
        rounded_v2 = (p.quantum_vs / (p.span_s / BLOCKS)) ** 2 / 6.0  # of a block: two ends, each rectangular
        noise.append(float(p.block_var_v2.mean()) - rounded_v2)
        ends.append((p.quantum_vs / p.span_s) ** 2 / 6.0)
    noise_v2 = max(0.0, float(np.mean(noise))) / BLOCKS
    return math.sqrt(noise_v2 + float(np.mean(ends)))


def _drift_of(name: str, soaks: Sequence[Soak]) -> Drift:
    ma, degc = GENERATIONS[name].ma_v_per_g, np.array([s.degc for s in soaks])
    every = [p for s in soaks for p in s.positions[name]]
    u_v, own = mean_u_v(every), _own_u(name, every)
    zeros, scales, zero_u, scale_u = [], [], [], []
    for s in soaks:
        design = inputs_g(s.angle_deg)
        means_v = np.stack([p.mean_v for p in s.positions[name]])
        fits = [_fit_axis(design[:, i], means_v[:, i]) for i in range(3)]
        zeros.append([f.zero_v for f in fits])
        scales.append([fits[i].slope_v_per_g / ma for i in SCALED])
        zero_u.append([math.hypot(f.zero_factor * u_v, own.zero_v) for f in fits])
        scale_u.append([math.hypot(fits[i].slope_factor * u_v / ma, own.scale) for i in SCALED])
    of_zeros = _lines_of(degc, zeros, zero_u, second_order=False)
    of_scales = _lines_of(degc, scales, scale_u, second_order=True)
    return Drift(name=name, quantum_vs=every[0].quantum_vs, zero_v=of_zeros, scale=of_scales)


@dataclass(frozen=True, slots=True, kw_only=True)
class _OwnU:
    """Standard uncertainties that are the same at all positions of a temperature."""

    zero_v: float
    scale: float


def _own_u(name: str, positions: Sequence[Position]) -> _OwnU:
    """From the unit's calibrations and the rounding of an input at rest, which repeats with the input."""
    zero_v2, gain2 = (
        float(np.mean([x**2 for x in each])) for each in zip(*((p.zero_u_v, p.gain_u) for p in positions), strict=True)
    )
    rounding_v, calibration_v = ROUNDING_V.get(name, 0.0), SELF_CALIBRATION_V.get(name, 0.0)
    ma = GENERATIONS[name].ma_v_per_g
    return _OwnU(
        zero_v=math.sqrt(zero_v2 + rounding_v**2 + calibration_v**2),
        scale=math.sqrt(gain2 + (rounding_v / ma) ** 2 / 2.0 + 2.0 * (calibration_v / PSD1_FULL_SCALE_V) ** 2),
    )


def inputs_g(angle_deg: Sequence[float]) -> Floats:
    """What X, Y, Z feel at angles of the table about y, g, by the convention a = -f: (n, 3)."""
    a = np.radians(np.asarray(angle_deg))
    return np.stack([-np.sin(a), np.zeros_like(a), np.cos(a)], axis=1)


@dataclass(frozen=True, slots=True, kw_only=True)
class _AxisFit:
    """Zero and slope over the inputs; factors from the standard uncertainty of a position to theirs."""

    zero_v: float
    slope_v_per_g: float
    zero_factor: float
    slope_factor: float


def _fit_axis(input_g: Floats, mean_v: Floats) -> _AxisFit:
    """Least squares; of an axis that stays level the mean."""
    if np.ptp(input_g) < 0.5:
        return _AxisFit(
            zero_v=float(mean_v.mean()), slope_v_per_g=math.nan, zero_factor=len(mean_v) ** -0.5, slope_factor=math.nan
        )
    design = np.stack([np.ones_like(input_g), input_g], axis=1)
    cofactors = np.linalg.inv(design.T @ design)
    zero_v, slope = cofactors @ design.T @ mean_v
    return _AxisFit(
        zero_v=float(zero_v),
        slope_v_per_g=float(slope),
        zero_factor=math.sqrt(cofactors[0, 0]),
        slope_factor=math.sqrt(cofactors[1, 1]),
    )


def _lines_of(
    degc: Floats, values: Sequence[Sequence[float]], u: Sequence[Sequence[float]], *, second_order: bool
) -> tuple[Line, ...]:
    """Of each axis; values and u have a row for each temperature."""
    of_axes = zip(np.array(values).T, np.array(u).mean(axis=0), strict=True)
    return tuple(_line_of(degc, v, float(u_axis), second_order=second_order) for v, u_axis in of_axes)


def _line_of(degc: Floats, values: Floats, u: float, *, second_order: bool) -> Line:
    """second_order: of a ratio of parts that drift, whose square the straight line leaves."""
    if second_order:
        u = math.hypot(u, float(np.max(np.abs(values - values[0]))) ** 2)
    w = weights_per_k(degc)
    return Line(values=values, u=u, per_k=float(w @ values), per_k_u=u * math.sqrt(float(w @ w)))
