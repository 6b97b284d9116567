"""Temperature compensation: exact where a polynomial is the law, and the article's 0.7 % for units drawn as it says."""

from __future__ import annotations

import numpy as np
import pytest
from psabench.errors import BadInput
from psabench.thermal.compensation import (
    compensation_dict,
    compensation_of_dict,
    element_temperature,
    fit_soak,
    fit_sweep,
    turns_of,
)
from quartz_units import HIGH_C, LOW_C, QuartzUnit, Sweep, draw_unit, sweep_unit
from scipy.integrate import solve_ivp

SEED = 24
UNITS = 400
GRID_C = np.linspace(LOW_C, HIGH_C, 146)


def most_percent(residual: np.ndarray, y: np.ndarray) -> float:
    return 100.0 * float(np.abs(residual).max() / np.abs(y).max())


def test_a_polynomial_of_sixth_degree_is_found_with_the_articles_coefficients() -> None:
    rng = np.random.default_rng(SEED)
    powers = rng.standard_normal(7) * 60.0 ** -np.arange(6.0, -1.0, -1.0)
    found = fit_soak("u0_v", GRID_C, np.polyval(powers, GRID_C))
    assert np.allclose(found.article_powers(), powers, rtol=1e-9, atol=1e-9 * np.abs(powers).max() * 60.0**-6)
    assert np.allclose(found.value_at(GRID_C), np.polyval(powers, GRID_C), rtol=0, atol=1e-12)


@pytest.mark.parametrize("tau_s", [30.0, 360.0, 5000.0])
def test_the_element_follows_a_case_on_straight_lines_exactly(tau_s: float) -> None:
    t_s = np.array([0.0, 100.0, 700.0, 1900.0, 2000.0])
    case_c = np.array([20.0, 20.0, -40.0, 60.0, 59.0])
    found = element_temperature(t_s, case_c, tau_s)
    pieces = [20.0]
    for a, b, p, q in zip(t_s, t_s[1:], case_c, case_c[1:], strict=False):
        run = solve_ivp(
            lambda t, y, a=a, b=b, p=p, q=q: (p + (q - p) * (t - a) / (b - a) - y) / tau_s,
            (a, b),
            [pieces[-1]],
            rtol=1e-11,
            atol=1e-11,
        )
        pieces.append(float(run.y[0, -1]))
    assert found == pytest.approx(pieces, abs=1e-7)


def test_one_leg_of_drawn_units_is_fitted_to_the_articles_limit() -> None:
    """400 units, noise of 0.1 % of the largest: at most 0.7 % of it for 95 % of them (the article, fig. 9)."""
    rng = np.random.default_rng(SEED)
    found = []
    for _ in range(UNITS):
        y = draw_unit(rng).zero_ug(GRID_C)
        noisy = y + 1e-3 * np.abs(y).max() * rng.standard_normal(len(y))
        found.append(most_percent(fit_soak("u0_v", GRID_C, noisy).value_at(GRID_C) - y, y))
    assert np.mean(np.array(found) <= 0.7) >= 0.95, f"seed {SEED}: p95 {np.percentile(found, 95):.3f} %"
    assert np.median(found) > 0.1  # the law is no polynomial: nothing at all would be a test that sees nothing


def draw_sweeps(count: int) -> list[Sweep]:
    rng = np.random.default_rng(SEED)
    units: list[QuartzUnit] = [draw_unit(rng) for _ in range(count)]
    return [sweep_unit(u, 1e-3 * float(np.abs(u.zero_ug(GRID_C)).max()), rng) for u in units]


def test_both_legs_need_the_lag() -> None:
    """An independent computation: 6.0 % of the largest on both legs, 0.45 % with the lag."""
    plain, lagged = [], []
    for s in draw_sweeps(40):
        free = np.abs(s.y_ug).max()
        without = fit_soak("u0_v", s.case_c, s.y_ug)
        plain.append(100 * float(np.abs(smoothed_means(s.y_ug - without.value_at(s.case_c))).max() / free))
        found = fit_sweep("u0_v", s.t_s, s.case_c, s.y_ug)
        assert found.lag is not None
        element = element_temperature(s.t_s, s.case_c, found.lag.tau_s)
        lagged.append(
            100 * float(np.abs(smoothed_means(s.y_ug - found.value_at(element, s.case_c - element))).max() / free)
        )
    assert 4.0 <= np.median(plain) <= 9.0, f"seed {SEED}"
    assert np.percentile(lagged, 95) <= 0.7, f"seed {SEED}: {np.sort(lagged)[-5:]}"


def smoothed_means(residual: np.ndarray, n: int = 5) -> np.ndarray:
    """Means of five minutes: what is left of the law, without the reading's noise."""
    return np.convolve(residual, np.ones(n) / n, mode="valid")


def test_a_leg_is_wrong_by_the_loop_on_the_other_leg() -> None:
    """An independent computation: the loop is 11.7 % of the largest, median."""
    here: list[float] = []
    there: list[float] = []
    for s in draw_sweeps(40):
        up = fit_soak("u0_v", s.case_c[s.up], s.y_ug[s.up])
        for legs, leg in ((here, s.up), (there, ~s.up)):
            legs.append(most_percent(smoothed_means(s.y_ug[leg] - up.value_at(s.case_c[leg])), s.y_ug))
    assert np.percentile(here, 95) < 0.9, f"seed {SEED}"
    assert np.percentile(there, 5) > 5.0, f"seed {SEED}"
    assert 9.0 < np.median(there) < 15.0, f"seed {SEED}"


def test_the_interval_holds_the_curve() -> None:
    """95 % of 400 fits, at each of three temperatures; the law is a polynomial here."""
    rng = np.random.default_rng(SEED)
    at_c = np.array([-60.0, 0.0, 70.0])
    true = np.polyval([1e-10, 0, 0, 0, 0, 0.3, 5.0], GRID_C)
    hits = np.zeros(3)
    for _ in range(400):
        found = fit_soak("u0_v", GRID_C, true + rng.standard_normal(len(true)))
        hits += np.abs(found.value_at(at_c) - np.polyval([1e-10, 0, 0, 0, 0, 0.3, 5.0], at_c)) <= found.half_width(at_c)
    assert np.all((hits >= 361) & (hits <= 395)), f"seed {SEED}: {hits}"  # 99.9 % of a binomial law of 0.95


def test_outside_its_range_it_is_clamped() -> None:
    found = fit_soak("u0_v", GRID_C, draw_unit(np.random.default_rng(SEED)).zero_ug(GRID_C))
    assert found.value_at([-80.0, 120.0]) == pytest.approx(found.value_at([LOW_C, HIGH_C]))
    assert found.value_at(84.0) != found.value_at(85.0)


def test_turns_of_a_sweep() -> None:
    noise = 0.5 * np.random.default_rng(SEED).standard_normal(200)
    leg = np.linspace(-60, 85, 100)
    assert turns_of(leg) == 0
    assert turns_of(np.concatenate([leg, leg[::-1]]) + noise) == 1
    assert turns_of(np.concatenate([leg, leg[::-1], leg])) == 2


def test_a_lag_that_is_given_is_no_parameter() -> None:
    s = draw_sweeps(1)[0]
    found = fit_sweep("u0_v", s.t_s, s.case_c, s.y_ug)
    assert found.lag is not None
    given = fit_sweep("u0_v", s.t_s, s.case_c, s.y_ug, tau_s=found.lag.tau_s)
    assert given.coefficients == found.coefficients
    assert (given.dof, found.dof) == (len(s.y_ug) - 8, len(s.y_ug) - 9)


def test_json_gives_the_same_compensation() -> None:
    s = draw_sweeps(1)[0]
    found = fit_sweep("u0_v", s.t_s, s.case_c, s.y_ug)
    again = compensation_of_dict(compensation_dict(found))
    assert compensation_dict(again) == compensation_dict(found)


@pytest.mark.parametrize(
    ("t_c", "y", "says"),
    [
        ([0.0, 1.0], [1.0], "a temperature for each reading"),
        ([0.0, np.nan] * 8, [1.0] * 16, "finite"),
        ([20.0] * 16, [1.0] * 16, "8 temperatures or more"),
        (list(np.linspace(20, 20.5, 16)), [1.0] * 16, "a range of 1 K or more, got 0.5 K"),
    ],
)
def test_bad_readings(t_c: list[float], y: list[float], says: str) -> None:
    with pytest.raises(BadInput, match=says):
        fit_soak("u0_v", t_c, y)


def test_one_leg_does_not_tell_a_lag() -> None:
    s = draw_sweeps(1)[0]
    with pytest.raises(BadInput, match="both legs of a sweep"):
        fit_sweep("u0_v", s.t_s[s.up], s.case_c[s.up], s.y_ug[s.up])
    with pytest.raises(BadInput, match="instants that ascend"):
        fit_sweep("u0_v", s.t_s[::-1], s.case_c, s.y_ug)


@pytest.mark.parametrize("key", ["chebyshev", "covariance", "low_c", "lag"])
def test_a_damaged_compensation_is_rejected(key: str) -> None:
    data = compensation_dict(fit_soak("u0_v", GRID_C, GRID_C))
    with pytest.raises(BadInput, match="passport: expected"):
        compensation_of_dict({**data, key: "?"}, "passport")
    with pytest.raises(BadInput, match="passport: expected"):
        compensation_of_dict({**data, "high_c": data["low_c"]}, "passport")
