"""Calibration of a strapdown unit from what a table run recorded: two passes of the filter, estimates, doubts.

Pure: no bench, no truth. The method is the article's on rate tables (docs/procedures/sins.md); angles of the table are
used where they were recorded.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from psabench.errors import BadInput, expected
from psabench.native.nav import Floats, Refused
from psabench.native.sins import Params, Sins, SinsConfig, feed_data, prior_covariance
from psabench.sins.calibration_doubts import doubts_of, neighbour_correlation
from psabench.sins.correction import SHAPES, Correction
from psabench.sins.data_check import findings
from psabench.sins.increments import Increments
from psabench.sins.parameters import SCALES, Parameter, state_parameters, value_of

LEAST_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SinsResult:
    """What a calibration found."""

    cfg: SinsConfig
    parameters: tuple[Parameter, ...]
    covariance: Floats  # of the parameters, in their units
    correction: Correction
    nis_accel: float
    nis_stand: float  # NaN: no angles
    correlation: Floats  # (6,) of innovations a second apart; NaN: none
    seconds: int  # that the correlation is of
    doubts: tuple[str, ...]


def estimate_unit(
    cfg: SinsConfig, start_c_nb: Floats, data: Increments, stand: tuple[Floats, Floats] | None
) -> SinsResult:
    """Both passes. Raises BadInput for data that no estimate should be made from: what is wrong is named."""
    refused = findings(data)
    if refused:
        raise BadInput(expected("a recording without findings", "; ".join(refused), "sins-calibration"))
    if len(data) * data.dt_s < LEAST_S:
        raise BadInput(expected(f"{LEAST_S:g} s or more", f"{len(data) * data.dt_s:.2f} s", "sins-calibration"))
    seen: list[Floats] = []
    try:
        s = Sins(cfg, start_c_nb, feedback=True)
        feed_data(s, data.dtheta_rad, data.dv_mps, stand)
        s.again()
        feed_data(s, data.dtheta_rad, data.dv_mps, stand, lambda: seen.append(s.state().innovations))
    except Refused as e:
        raise BadInput(f"sins-calibration: {e}") from e
    return _result_of(cfg, s, np.array(seen), start_c_nb)


def _result_of(cfg: SinsConfig, s: Sins, innovations: Floats, start_c_nb: Floats) -> SinsResult:
    state, named = s.state(), state_parameters(s.rows, cfg)
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
    return SinsResult(
        cfg=cfg,
        parameters=parameters,
        covariance=covariance,
        correction=_correction_of(state.params),
        nis_accel=state.nis_accel,
        nis_stand=state.nis_stand,
        correlation=neighbour_correlation(innovations),
        seconds=len(innovations),
        doubts=tuple(doubts_of(state, innovations, parameters, start_c_nb, cfg)),
    )


def _correction_of(p: Params) -> Correction:
    """What of a model a unit carries along: all but the mounting on the table and its clock."""
    return Correction(**{name: getattr(p, name) for name in SHAPES})
