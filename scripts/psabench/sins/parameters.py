"""The parameters of a calibration by name, in the units that they are shown in, and where they are in the state."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from psabench.estimate.uncertainty import t_quantile
from psabench.native.nav import ARCMIN, DEGPH
from psabench.native.sins import Params, SinsConfig
from psabench.procedures.command_line.offered import G_MPS2
from psabench.sins.covariance import GAMMA_AT, KNOWN


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
        return t_quantile(math.inf) * self.sd

    @property
    def determined(self) -> bool:
        return self.sd <= KNOWN * self.prior_sd


def state_parameters(rows_of: Mapping[str, slice], cfg: SinsConfig) -> list[tuple[str, str, int]]:
    """Name, key of SCALES and place in the state of each parameter."""
    found: list[tuple[str, str, int]] = []
    for block in ("nu", "theta", "df", "gamma", "lever", "quad", "delay", "delta", "tau"):
        rows = rows_of[block]
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
