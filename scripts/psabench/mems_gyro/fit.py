"""Estimates of a gyro from its dwells, with covariance and budget. Pure.

Generalised least squares: the noise that correlates the dwells is fitted to the same readings (`noise`). The zero is
the mean over the rests of the series: flicker and random walk move it, and no run says where it will be later.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.budget.gum import expand_estimate
from psabench.errors import BenchError, expected
from psabench.estimate.uncertainty import Component, Correlation, Estimate, correlation, not_identifiable
from psabench.link.signals import Floats
from psabench.mems_gyro import model
from psabench.mems_gyro.noise import NoiseFit, allan_deviations, fit_noise, term_kernels
from psabench.mems_gyro.params import BLOCK_S, NAME, MemsGyroParams
from psabench.mems_gyro.plan import Dwell

NEWTON_ROUNDS = 4
MEANS = ((1, 100), (10, 60), (30, 1000))  # of the recording at rest: so many blocks each, up to so many times
KNOWN_SD = 2.0  # a power below so many of its sd may be none
FOLLOWS = 0.5  # of the variance of the readings is the rate's, at the least
STILL_P = 1e-7  # a dwell that is so quiet by chance is none
OUTLIER_SD = 4.5  # a dwell that is farther from the others' prediction is a doubt


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """How an estimate is printed: `per_si` of it is one of the model's."""

    name: str
    symbol: str
    unit: str
    per_si: float = 1.0


QUANTITIES = (
    Quantity(name="zero_v", symbol="u_0", unit="V"),
    Quantity(name="scale_mv_per_dps", symbol="S", unit="mV/(°/s)", per_si=1e3),
    Quantity(name="cross_y_mrad", symbol="m_y", unit="mrad", per_si=1e3),
    Quantity(name="cross_z_mrad", symbol="m_z", unit="mrad", per_si=1e3),
    Quantity(name="gx_dps_per_g", symbol="d_x", unit="°/s/g"),
    Quantity(name="gy_dps_per_g", symbol="d_y", unit="°/s/g"),
    Quantity(name="gz_dps_per_g", symbol="d_z", unit="°/s/g"),
    Quantity(name="square_ppm_per_dps", symbol="c_2", unit="ppm/(°/s)", per_si=1e6),
    Quantity(name="cube_ppm_per_dps2", symbol="c_3", unit="ppm/(°/s)²", per_si=1e6),
)
PER_HOUR = 3600.0
NOISE = (
    Quantity(name="angle_walk_deg_per_rth", symbol="N", unit="°/√h", per_si=math.sqrt(PER_HOUR)),
    Quantity(name="bias_instability_degph", symbol="B", unit="°/h", per_si=PER_HOUR),
    Quantity(name="rate_walk_degph_per_rth", symbol="K", unit="°/h/√h", per_si=PER_HOUR * math.sqrt(PER_HOUR)),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class MemsGyroResult:
    """Everything that the report shows."""

    estimates: tuple[Estimate, ...]
    noise: tuple[Estimate, ...]
    correlation: Correlation
    theta: Floats  # (model.SIZE,) in V, °/s and g
    nonlinearity: float  # part of full scale
    powers: Floats  # (3,) of the terms of the noise, °/s
    tau_s: Floats
    allan_dps: Floats
    dwells: tuple[Dwell, ...]
    residual_v: Floats  # of each dwell of the series
    doubts: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Observations:
    """Means, in the order of time."""

    y: Floats
    rows: Floats  # (n, 6) of model.felt_rows
    t_s: Floats
    duration_s: Floats
    rest: npt.NDArray[np.bool_]  # of the series: the zero is theirs
    dwell: npt.NDArray[np.int64]  # number among the series' dwells; -1: of the recording


def estimate_gyro(dwells: Sequence[Dwell], p: MemsGyroParams) -> MemsGyroResult:
    """From one recording at rest and the dwells of the series. Raises BenchError where a term cannot be told."""
    o = _as_observations(dwells, p)
    theta = _least_squares(o, np.eye(len(o.y)))
    parts = term_kernels(o.t_s, o.duration_s)
    noise = fit_noise(o.y - model.predict_v(theta, o.rows), model.model_jacobian(theta, o.rows), parts)
    v = sum((x * k for x, k in zip(noise.v, parts, strict=True)), np.zeros_like(parts[0]))
    inverse = np.linalg.inv(v)
    theta = _least_squares(o, inverse)
    gain = _gain_matrix(o, theta, inverse)
    estimates, cov = _with_confidence(o, theta, gain, noise, parts)
    budget = dict(_budget_rows(o, theta, gain, p))
    expanded = [
        expand_estimate(e, [Component(name=n, u=float(u[k])) for n, u in budget.items() if u[k] > 1e-6 * e.sd])
        for k, e in enumerate(estimates)
    ]
    residual = o.y - model.predict_v(theta, o.rows)
    recording = np.concatenate([d.blocks_v for d in dwells if d.recording]) / abs(theta[model.SCALE])
    tau_s, allan = allan_deviations(recording, BLOCK_S)
    powers = noise.v / theta[model.SCALE] ** 2
    return MemsGyroResult(
        estimates=tuple(expanded),
        noise=tuple(_noise_estimates(noise, abs(float(theta[model.SCALE])))),
        correlation=correlation([q.name for q in QUANTITIES], cov),
        theta=theta,
        nonlinearity=model.nonlinearity_part(theta, p.range_dps),
        powers=powers,
        tau_s=tau_s,
        allan_dps=allan,
        dwells=tuple(dwells),
        residual_v=residual[o.dwell >= 0],
        doubts=tuple(_list_doubts(o, theta, inverse, residual, dwells, float(noise.v[0]))),
    )


def _as_observations(dwells: Sequence[Dwell], p: MemsGyroParams) -> _Observations:
    y, rows, t_s, duration_s, rest, number = [], [], [], [], [], []
    count = 0
    for d in dwells:
        row = np.concatenate(model.felt_motion(d, p))
        sizes = _mean_sizes(len(d.blocks_v)) if d.recording else [len(d.blocks_v)]
        block_s, first = d.duration_s / len(d.blocks_v), 0
        for size in sizes:
            y.append(float(d.blocks_v[first : first + size].mean()))
            rows.append(row)
            t_s.append(d.t_s + first * block_s)
            duration_s.append(size * block_s)
            rest.append(d.at_rest and not d.recording)
            number.append(-1 if d.recording else count)
            first += size
        count += not d.recording
    return _Observations(
        y=np.array(y),
        rows=np.array(rows),
        t_s=np.array(t_s),
        duration_s=np.array(duration_s),
        rest=np.array(rest),
        dwell=np.array(number),
    )


def _mean_sizes(blocks: int) -> list[int]:
    """Of the means of a recording: short ones show white noise, long ones the slow terms."""
    found: list[int] = []
    for size, most in MEANS:
        found += [size] * min(most, (blocks - sum(found)) // size)
    return found


def _least_squares(o: _Observations, weight: Floats) -> Floats:
    """Gauss-Newton: the model is nearly linear."""
    theta = np.zeros(model.SIZE)
    theta[model.SCALE] = _first_scale(o)
    theta[model.ZERO] = float(o.y.mean())
    for _ in range(NEWTON_ROUNDS):
        theta = theta + _gain_matrix(o, theta, weight) @ (o.y - model.predict_v(theta, o.rows))
    return theta


def _first_scale(o: _Observations) -> float:
    """Raises BenchError for an output that is not a gyro's on this table."""
    x, y = (a - a.mean() for a in (o.rows[:, 0], o.y))
    slope = float(x @ y) / float(x @ x)
    if slope * float(x @ y) <= FOLLOWS * float(y @ y):
        raise BenchError(expected("an output that follows the table's rate", "one that does not", NAME))
    return slope


def _gain_matrix(o: _Observations, theta: Floats, weight: Floats) -> Floats:
    """(SIZE, n): changes of the estimates by the readings."""
    j = model.model_jacobian(theta, o.rows)
    size = np.abs(j).max(axis=0)
    x = j / size
    normal = x.T @ weight @ x
    if not np.linalg.cond(normal) < 1e12:
        raise BenchError(expected("attitudes and rates that tell all terms apart", "fewer", NAME))
    out: Floats = np.linalg.solve(normal, x.T @ weight) / size[:, np.newaxis]
    return out


def _with_confidence(
    o: _Observations, theta: Floats, gain: Floats, noise: NoiseFit, parts: list[Floats]
) -> tuple[list[Estimate], Floats]:
    """Scatter alone; degrees of freedom after Satterthwaite, from how well the noise is known."""
    zero = o.rest / o.rest.sum()
    residual = o.y - model.predict_v(theta, o.rows)
    white, slow = gain.copy(), gain.copy()
    white[0] = gain[0] + zero - zero @ model.model_jacobian(theta, o.rows) @ gain
    slow[0] = white[0] - zero
    weights = [white, slow, slow]
    shares = np.array([w @ k @ w.T for w, k in zip(weights, parts, strict=True)])  # (3, SIZE, SIZE)
    cov = np.einsum("k,kij->ij", noise.v, shares)
    values = theta.copy()
    values[0] += float(zero @ residual)
    found = []
    for i, q in enumerate(QUANTITIES):
        spread = float(shares[:, i, i] @ noise.cov @ shares[:, i, i])
        dof = 2.0 * cov[i, i] ** 2 / spread if spread > 0.0 else math.inf
        sd = math.sqrt(cov[i, i]) * q.per_si
        found.append(
            Estimate(
                name=q.name,
                symbol=q.symbol,
                unit=q.unit,
                value=float(values[i]) * q.per_si,
                sd=sd,
                ci_half=2 * sd,
                dof=dof,
            )
        )
    return found, cov


def _budget_rows(o: _Observations, theta: Floats, gain: Floats, p: MemsGyroParams) -> Iterator[tuple[str, Floats]]:
    """What no reading shows: each influence disturbs the readings by one standard uncertainty (GUM 5.1.3, note 2)."""
    out_v = model.predict_v(theta, o.rows)
    zero = o.rest / o.rest.sum()
    per = np.array([q.per_si for q in QUANTITIES])

    def moved(change_v: Floats) -> Floats:
        d = gain @ change_v
        d[0] += float(zero @ (change_v - model.model_jacobian(theta, o.rows) @ (gain @ change_v)))
        found: Floats = d * per
        return found

    def together(*changes_v: Floats) -> Floats:
        return np.asarray(np.sqrt(sum((moved(c) ** 2 for c in changes_v), np.zeros(model.SIZE))))

    ones = np.ones_like(out_v)
    faster = o.rows.copy()
    faster[:, :3] *= 1.0 + p.rate_ppm * 1e-6
    yield "chain gain", together(out_v * p.chain_gain_ppm * 1e-6)
    yield "chain zero", together(ones * p.chain_zero_uv * 1e-6)
    yield (
        "temperature",
        together(
            out_v * p.chain_gain_tc_ppm_per_k * p.chain_off_k * 1e-6,
            ones * p.chain_zero_tc_uv_per_k * p.chain_off_k * 1e-6,
        ),
    )
    yield "table rate", together(model.predict_v(theta, faster) - out_v)
    turned = (model.turned_rows(o.rows, k, math.radians(p.mount_arcsec / 3600.0)) for k in range(3))
    yield "mounting", together(*(model.predict_v(theta, rows) - out_v for rows in turned))


def _noise_estimates(noise: NoiseFit, scale_v_per_dps: float) -> Iterator[Estimate]:
    for q, v, sd_v in zip(NOISE, noise.v, noise.sd, strict=True):
        per = q.per_si / scale_v_per_dps
        value, most = math.sqrt(v) * per, math.sqrt(v + 2.0 * sd_v) * per
        known = v > KNOWN_SD * sd_v
        sd = sd_v / (2.0 * math.sqrt(v)) * per if known else (most - value) / 2.0
        e = Estimate(name=q.name, symbol=q.symbol, unit=q.unit, value=value, sd=sd, ci_half=2.0 * sd)
        yield e if known else not_identifiable(e, f"the recording says no more than: below {most:.3g} {q.unit}")


def _list_doubts(
    o: _Observations, theta: Floats, inverse: Floats, residual: Floats, dwells: Sequence[Dwell], white: float
) -> Iterator[str]:
    """Dwells that the others do not predict; outputs that stand still."""
    j = model.model_jacobian(theta, o.rows)
    j = j / np.abs(j).max(axis=0)
    pure = inverse - inverse @ j @ np.linalg.solve(j.T @ inverse @ j, j.T @ inverse)
    z = (pure @ residual) / np.sqrt(np.maximum(np.diag(pure), 1e-300))
    series = [d for d in dwells if not d.recording]
    for k in np.flatnonzero((np.abs(z) > OUTLIER_SD) & (o.dwell >= 0)):
        d = series[o.dwell[k]]
        yield f"{_dwell_name(d)}: {z[k]:+.1f} standard deviations from what the other dwells say"
    for d in series:
        if _too_still(d, white):
            yield f"{_dwell_name(d)}: the output has no noise: at a limit, or stuck"


def _too_still(d: Dwell, white: float) -> bool:
    """Against the white noise of the gyro."""
    from scipy.special import gammainc  # slow to import

    n = len(d.blocks_v)
    squares = float(np.sum((d.blocks_v - d.u_v) ** 2)) * d.duration_s / n / white
    return bool(gammainc((n - 1) / 2.0, squares / 2.0) < STILL_P)


def _dwell_name(d: Dwell) -> str:
    return f"{d.rate_dps:+.1f} °/s at {d.middle_deg:g}°, {d.inner_deg:g}°"


def expected_values(truth: Mapping[str, float]) -> dict[str, float]:
    """By the parameters of a scenario's gyro at 25 °C: what each estimate should have been, had the zero not moved."""
    phase = math.radians(truth["phase_deg"])
    scale = truth["scale_v_per_dps"]
    return {
        "zero_v": truth["u0_v"] + scale * math.sin(phase) * truth["quadrature_dps"],
        "scale_mv_per_dps": 1e3 * scale * math.cos(phase),
        "cross_y_mrad": 1e3 * truth["cross_y"],
        "cross_z_mrad": 1e3 * truth["cross_z"],
        "gx_dps_per_g": truth["gx_dps_per_g"],
        "gy_dps_per_g": truth["gy_dps_per_g"],
        "gz_dps_per_g": truth["gz_dps_per_g"],
        "square_ppm_per_dps": 1e6 * truth["square_per_dps"],
        "cube_ppm_per_dps2": 1e6 * truth["cube_per_dps2"],
        "angle_walk_deg_per_rth": truth["noise_dps_rthz"] / math.sqrt(2.0) * math.sqrt(PER_HOUR),
        "bias_instability_degph": truth["bias_instability_dps"] * PER_HOUR,
        "rate_walk_degph_per_rth": truth["walk_dps_rts"] * PER_HOUR * math.sqrt(PER_HOUR),
    }
