"""Coefficients against temperature, without a bench: the truth there, the slope and its budget."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from psabench.climate.coefficients import Point, at_temperature, courses_of, weights_per_k
from psabench.estimate.uncertainty import Component, Correlation, Estimate
from psabench.procedures.result import ProcedureResult
from psabench.report.grading import Section

DEGC = (-40.0, 0.0, 25.0, 60.0, 85.0)
TRUTH = {
    "u0_v": 2.5,
    "kx_v_per_g": 1.0,
    "ky_v_per_g": 0.01,
    "kxx_v_per_g2": 1e-4,
    "u0_tc_v_per_k": 2e-4,
    "k_tc_ppm_per_k": -50.0,
}


def point(degc: float, value: float, budget: tuple[Component, ...], *, identifiable: bool = True) -> Point:
    e = Estimate(name="u0_v", symbol="u_0", unit="V", value=value, sd=1e-5, ci_half=2e-5, budget=budget)
    result = ProcedureResult(
        procedure="turns",
        axis="x",
        g_mps2=9.8,
        readings=(),
        series=(),
        estimates=(replace(e, identifiable=identifiable),),
        correlation=Correlation(names=(), matrix=np.eye(0)),
        residual_rms_v=0.0,
        drift=None,
        notes=(),
    )
    truth = at_temperature({**TRUTH, "kxx_v_per_g2": 0.0}, degc)
    return Point(degc=degc, section=Section(label=f"{degc:g} °C", result=result, truth=truth))


def budget(degc: float, scatter: float = 0.0, tc: float = 0.0, constant: float = 0.0) -> tuple[Component, ...]:
    return (
        Component(name="scatter", u=scatter, dof=10),
        Component(name="temperature", u=tc * abs(degc - 25.0)),
        Component(name="chain zero", u=constant),
    )


def test_zero_and_sensitivities_go_with_the_temperature() -> None:
    warm = at_temperature(TRUTH, 75.0)
    assert warm["u0_v"] == pytest.approx(2.51)
    assert warm["kx_v_per_g"] == pytest.approx(0.9975)
    assert warm["ky_v_per_g"] == pytest.approx(0.009975)
    assert warm["kxx_v_per_g2"] == TRUTH["kxx_v_per_g2"]


def test_a_slope_comes_out_as_it_went_in() -> None:
    (c,) = courses_of([point(t, 2.5 + 3e-4 * (t - 25.0), budget(t, scatter=1e-6)) for t in DEGC])
    assert c.slope.value == pytest.approx(3e-4, rel=1e-9)
    assert c.truth_per_k == pytest.approx(2e-4, rel=1e-9)
    assert not c.within
    (good,) = courses_of([point(t, 2.5 + 2e-4 * (t - 25.0), budget(t, scatter=1e-6)) for t in DEGC])
    assert good.within
    assert good.slope.name == "u0_v_per_k"
    assert good.slope.unit == "V/K"


def test_scatter_is_independent_and_the_chain_drifts_in_line() -> None:
    degc = np.array(DEGC)
    w = weights_per_k(degc)
    (scatter,) = courses_of([point(t, 2.5, budget(t, scatter=1e-5)) for t in DEGC])
    assert scatter.slope.sd == pytest.approx(1e-5 / math.sqrt(((degc - degc.mean()) ** 2).sum()))
    (chain,) = courses_of([point(t, 2.5, budget(t, tc=1e-5)) for t in DEGC])
    assert chain.slope.sd == pytest.approx(1e-5 * abs(w @ (degc - 25.0)))  # a coefficient: no mean takes it off
    assert chain.slope.sd == pytest.approx(1e-5)
    (constant,) = courses_of([point(t, 2.5, budget(t, scatter=1e-7, constant=1e-3)) for t in DEGC])
    assert constant.slope.sd < 1e-8


def test_u_is_what_slopes_scatter_by() -> None:
    rng = np.random.default_rng(3)
    errors, u = [], 0.0
    for _ in range(300):
        tc = 1e-5 * rng.standard_normal()
        values = [2.5 + (2e-4 + tc) * (t - 25.0) + 2e-4 * rng.standard_normal() for t in DEGC]
        (c,) = courses_of([point(t, v, budget(t, scatter=2e-4, tc=1e-5)) for t, v in zip(DEGC, values, strict=True)])
        assert c.truth_per_k is not None
        errors.append(c.slope.value - c.truth_per_k)
        u = c.slope.sd
    assert np.std(errors) == pytest.approx(u, rel=0.12)


def test_what_one_temperature_does_not_determine_has_no_slope() -> None:
    points = [point(t, 2.5, budget(t), identifiable=t != 60.0) for t in DEGC]
    assert courses_of(points) == []
