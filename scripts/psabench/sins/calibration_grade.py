"""A calibration beside the truth of an emulated unit. The procedure does not see it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from psabench.bench import Bench
from psabench.native import sins
from psabench.native.nav import Floats
from psabench.native.sins import Params
from psabench.sins.calibration import SinsResult
from psabench.sins.parameters import SCALES, state_parameters, value_of

GRADED = ("nu", "theta", "df", "gamma")  # blocks that the truth port has
P_LIMIT = 0.001  # of the chi-square of all errors


@dataclass(frozen=True, slots=True, kw_only=True)
class Graded:
    """Errors beside the truth, in the units of the parameters; of those that a truth has."""

    names: tuple[str, ...]
    truth: Floats
    error: Floats
    chi_square: float
    p: float


def truth_of(bench: Bench) -> Params:
    """Of the only inertial unit, from the truth port."""
    s = next(u for u in bench.truth()["units"].values() if u["board"] == "bins")["specimen"]
    theta, gamma = (np.array([[s[f"{k}_{i}{j}"] for j in (1, 2, 3)] for i in (1, 2, 3)]) for k in ("theta", "gamma"))
    nu, df = (np.array([s[name.format(i)] for i in (1, 2, 3)]) for name in ("nu0_{}_radps", "df0_{}_mps2"))
    return Params(nu_radps=nu, theta=theta, df_mps2=df, gamma=gamma)


def grade_result(r: SinsResult, truth: Params) -> Graded:
    """In the frame of the gauge: a turn of the instrument's axes is no error (docs/procedures/sins.md)."""
    from scipy import stats

    true, _ = sins.to_gauge(r.cfg.gauge, truth)
    keys = {name: key for name, key, _ in state_parameters(sins.state_layout(r.cfg), r.cfg)}
    at = [k for k, p in enumerate(r.parameters) if p.name.split("_")[0] in GRADED]
    names = tuple(r.parameters[k].name for k in at)
    right = np.array([value_of(true, n) * SCALES[keys[n]].per_si for n in names])
    error = np.array([r.parameters[k].value for k in at]) - right
    chi_square = sins.error_nees(error, np.ascontiguousarray(r.covariance[np.ix_(at, at)]))
    p = float(stats.chi2.sf(chi_square, len(at)))
    return Graded(names=names, truth=right, error=error, chi_square=chi_square, p=min(p, 1.0))
