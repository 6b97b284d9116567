"""Calibration of a strapdown unit from what a table run recorded: two passes, the filter's own checks, estimates.

Pure: no bench, no truth. The method is the article's on rate tables (docs/procedures/sins.md); angles of the table are
used where they were recorded.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from psabench.errors import BadInput, expected
from psabench.native.nav import ARCMIN, DEGPH, Floats, Refused
from psabench.native.sins import Params, Sins, SinsConfig
from psabench.sins.correction import SHAPES, Correction
from psabench.sins.covariance import GAMMA_AT, KNOWN
from psabench.sins.data_check import findings
from psabench.sins.increments import Increments
from psabench.sins.layout import G_MPS2

WHITE = 3.3  # standard deviations of a correlation between innovations of neighbouring seconds, 1 in 1000
NIS_LEAST = 0.02  # what noise that is given to one part in a hundred does
FAR = 5.0  # standard deviations of its prior that a parameter may be from zero
NIS_SPAN = 3.3  # the same of the mean of value^2/variance
T95 = 1.959963984540054
LEAST_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Scale:
    """Of SI to the unit that a parameter is shown in."""

    unit: str
    per_si: float
    symbol: str


SCALES: Mapping[str, Scale] = {
    "nu": Scale(unit="°/h", per_si=1.0 / DEGPH, symbol="ν{i}"),
    "theta_ii": Scale(unit="ppm", per_si=1e6, symbol="Θ{i}{j}"),
    "theta_ij": Scale(unit="″", per_si=60.0 / ARCMIN, symbol="Θ{i}{j}"),
    "df": Scale(unit="µm/s²", per_si=1e6, symbol="Δf{i}"),
    "gamma_ii": Scale(unit="ppm", per_si=1e6, symbol="Γ{i}{j}"),
    "gamma_ij": Scale(unit="″", per_si=60.0 / ARCMIN, symbol="Γ{i}{j}"),
    "lever": Scale(unit="mm", per_si=1e3, symbol="r{i}{j}"),
    "quad": Scale(unit="µg/g²", per_si=1e6 * G_MPS2, symbol="q{i}"),
    "delay": Scale(unit="ms", per_si=1e3, symbol="τ_a"),
    "delta": Scale(unit="″", per_si=60.0 / ARCMIN, symbol="δ{i}"),
    "tau": Scale(unit="ms", per_si=1e3, symbol="τ"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One estimate, in its unit."""

    name: str  # nu_1, theta_12, df_3, gamma_21 ...
    symbol: str
    unit: str
    value: float
    sd: float  # of the filter's covariance
    prior_sd: float

    @property
    def half95(self) -> float:
        return T95 * self.sd

    @property
    def determined(self) -> bool:
        return self.sd <= KNOWN * self.prior_sd


@dataclass(frozen=True, slots=True, kw_only=True)
class SinsResult:
    """What a calibration found."""

    cfg: SinsConfig
    parameters: tuple[Parameter, ...]
    covariance: Floats  # of the parameters, in their units
    params: Params
    correction: Correction
    nis_accel: float
    nis_stand: float  # NaN: no angles
    correlation: Floats  # (6,) of innovations a second apart; NaN: none
    seconds: int  # that the correlation is of
    doubts: tuple[str, ...]

    def parameter(self, name: str) -> Parameter:
        """Raises KeyError."""
        return next((p for p in self.parameters if p.name == name), None) or _no_such(name)


def _no_such(name: str) -> Parameter:
    raise KeyError(name)


def calibrate_unit(
    cfg: SinsConfig, start_c_nb: Floats, data: Increments, stand: tuple[Floats, Floats] | None
) -> SinsResult:
    """Both passes. Raises BadInput for data that no estimate should be made from: what is wrong is named."""
    refused = [f.what for f in findings(data) if f.refuse]
    if refused:
        raise BadInput(expected("a recording without findings", "; ".join(refused), "sins-calibration"))
    if len(data) * data.dt_s < LEAST_S:
        raise BadInput(expected(f"{LEAST_S:g} s or more", f"{len(data) * data.dt_s:.2f} s", "sins-calibration"))
    try:
        first = Sins(cfg, start_c_nb, feedback=True)
        feed(first, data, stand)
        first.again()
        innovations = feed(first, data, stand)
    except Refused as e:
        raise BadInput(f"sins-calibration: {e}") from e
    return _result_of(cfg, first, innovations, start_c_nb)


def feed(s: Sins, data: Increments, stand: tuple[Floats, Floats] | None) -> Floats:
    """All data through an estimator, a second at a time; the last innovations of each second, (n, 6)."""
    second, sample_s = round(1.0 / data.dt_s), s.cfg.sample_s
    times, angles = stand if stand else (np.empty(0), np.empty((0, 3, 3)))
    at, seen = 0, []
    for low in range(0, len(data), second):
        part = slice(low, low + second)
        end_s = (low + second) * sample_s
        while at < len(times) and times[at] < end_s:
            s.stand(float(times[at]), angles[at])
            at += 1
        s.samples(low * sample_s, data.dtheta_rad[part], data.dv_mps[part])
        seen.append(s.state().innovations)
    return np.array(seen)


# ---- the result


def elements(s_rows: Mapping[str, slice], cfg: SinsConfig) -> list[tuple[str, str, int]]:
    """Name, key of SCALES and place in the state of each parameter."""
    found: list[tuple[str, str, int]] = []
    for block in ("nu", "theta", "df", "gamma", "lever", "quad", "delay", "delta", "tau"):
        rows = s_rows[block]
        for k in range(rows.stop - rows.start):
            found.append((*_named(block, k, cfg, rows.stop - rows.start), rows.start + k))
    return found


def _named(block: str, k: int, cfg: SinsConfig, size: int) -> tuple[str, str]:
    """Of the k-th element of a block."""
    if block in ("tau", "delay"):
        return block, block
    if block in ("nu", "df", "quad", "delta"):
        return f"{block}_{k + 1}", block
    at = GAMMA_AT[cfg.gauge][k] if block == "gamma" else 4 * k if block == "lever" and size == 3 else k
    i, j = divmod(at, 3)
    key = block if block == "lever" else f"{block}_{'ii' if i == j else 'ij'}"
    return f"{block}_{i + 1}{j + 1}", key


FIELDS: Mapping[str, str] = {  # of Params, where a block's name is another
    "nu": "nu_radps",
    "df": "df_mps2",
    "lever": "lever_m",
    "quad": "quadratic_s2pm",
    "delay": "delay_s",
    "delta": "delta_rad",
    "tau": "tau_s",
}


def value_of(params: Params, name: str) -> float:
    """In SI, by the name of a parameter."""
    block, _, at = name.partition("_")
    found = getattr(params, FIELDS.get(block, block))
    return float(found if not at else found[tuple(int(c) - 1 for c in at)])


def _result_of(cfg: SinsConfig, s: Sins, innovations: Floats, start_c_nb: Floats) -> SinsResult:
    from psabench.native.sins import prior_covariance

    state, named = s.state(), elements(s.rows, cfg)
    scale = np.array([SCALES[key].per_si for _, key, _ in named])
    at = [k for *_, k in named]
    covariance = s.covariance()[1][np.ix_(at, at)] * np.outer(scale, scale)
    before = np.sqrt(np.diag(prior_covariance(cfg))[at]) * scale
    parameters = tuple(
        Parameter(
            name=name,
            symbol=SCALES[key].symbol.format(i=name[-2:-1] if "{j}" in SCALES[key].symbol else name[-1:], j=name[-1:]),
            unit=SCALES[key].unit,
            value=value_of(state.params, name) * SCALES[key].per_si,
            sd=float(math.sqrt(covariance[i, i])),
            prior_sd=float(before[i]),
        )
        for i, (name, key, _) in enumerate(named)
    )
    correlation = _neighbours(innovations)
    p = state.params
    return SinsResult(
        cfg=cfg,
        parameters=parameters,
        covariance=covariance,
        params=p,
        correction=_correction_of(p),
        nis_accel=state.nis_accel,
        nis_stand=state.nis_stand,
        correlation=correlation,
        seconds=len(innovations),
        doubts=(
            *_noise_doubts(state.nis_accel, state.nis_stand, len(innovations), cfg),
            *_colour_doubts(correlation, len(innovations)),
            *_parameter_doubts(parameters),
            *_attitude_doubts(state.c0_nb @ start_c_nb.T, cfg),
        ),
    )


def _correction_of(p: Params) -> Correction:
    """What of a model a unit carries along: all but the mounting on the table and its clock."""
    return Correction(**{name: getattr(p, name) for name in SHAPES})


def _neighbours(innovations: Floats) -> Floats:
    """Correlation of each channel with itself a second later; NaN where there is none."""
    found = np.full(innovations.shape[1], np.nan)
    for k, x in enumerate(innovations.T):
        x = x[np.isfinite(x)]
        if len(x) > 2 and x.std() > 0.0:
            found[k] = np.corrcoef(x[:-1], x[1:])[0, 1]
    return found


def _noise_doubts(nis_accel: float, nis_stand: float, seconds: int, cfg: SinsConfig) -> Iterator[str]:
    """Innovations of another size than the filter expects. The table's may be smaller: their noise holds its wobble."""
    span = max(NIS_SPAN * math.sqrt(2.0 / (3 * seconds / cfg.step_s)), NIS_LEAST)
    if abs(nis_accel - 1.0) > span:
        what = "mean of innovation²/variance of the accelerometers"
        yield expected(f"1 ± {span:.3f}", f"{nis_accel:.3f}", what)
    if nis_stand > 1.0 + span:
        yield expected(f"1 ± {span:.3f} or less", f"{nis_stand:.3f}", "the same of the table's angles")


def _colour_doubts(correlation: Floats, seconds: int) -> Iterator[str]:
    limit = WHITE / math.sqrt(seconds)
    for name, x in zip("xyz", correlation[:3], strict=True):
        if abs(x) > limit:
            what = f"innovations of {name} of the accelerometers, a second apart"
            yield expected(f"a correlation within {limit:.3f}", f"{x:.3f}", what)


def _attitude_doubts(turn: Floats, cfg: SinsConfig) -> Iterator[str]:
    """Between the attitude that was given for the start and the one found: about east, north, up."""
    found = Rotation.from_matrix(turn).as_rotvec()
    for name, x, sd in zip(("east", "north", "up: its azimuth"), found, cfg.beta_sd_rad, strict=True):
        if abs(x) > FAR * sd:
            limit, got = f"within {math.degrees(FAR * sd):.1f} deg", f"{math.degrees(x):.1f} deg"
            yield expected(limit, got, f"attitude at the start, error about {name}")


def _parameter_doubts(parameters: tuple[Parameter, ...]) -> Iterator[str]:
    loose = [p.symbol for p in parameters if not p.determined and p.name != "tau"]
    if loose:
        yield f"not determined by this run: {', '.join(loose)}"
    for p in parameters:
        if abs(p.value) > FAR * p.prior_sd:
            yield expected(f"within {FAR:g} of its prior's {p.prior_sd:.4g} {p.unit}", f"{p.value:.4g}", p.symbol)
