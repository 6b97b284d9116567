"""What a unit's flights say of its instruments: the posterior of a linear model, drawn units, forgetting, roll-back."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from psabench.koi.autocal import (
    YEAR_S,
    FlightEstimate,
    InstrumentClass,
    RollBack,
    age_knowledge,
    filter_prior,
    knowledge_after,
    nothing_known,
    standing_flights,
    update_knowledge,
)
from psabench.link.signals import Floats
from scipy.stats import chi2

# Drifts in rad/s, a scale error, one that is known: of different orders, as a unit's are.
KIND = InstrumentClass(
    names=("nu1", "nu2", "df1", "theta11", "gamma22"),
    persistent_sd=np.array([5e-8, 5e-8, 1e-3, 2e-5, 0.0]),
    run_sd=np.array([2e-8, 1e-8, 3e-4, 0.0, 0.0]),
    aging_sd=np.array([1e-8, 1e-8, 2e-4, 1e-6, 0.0]),
)
M = len(KIND.names)
SEES = np.array([[1.0, 0.0, 1e-5, 0.0, 0.0], [0.0, 1.0, 0.0, 3e-3, 0.0], [0.5, 0.5, 0.0, 0.0, 0.0]])
NOISE_SD = 1e-8
SEED = 20261128
DAY_S = 86_400.0


def fly_unit(rng: np.random.Generator, total: Floats, known: object, time_s: float) -> FlightEstimate:
    """A flight that sees three combinations of the errors with noise: its exact posterior."""
    p, prior = filter_prior(known, KIND, time_s)  # type: ignore[arg-type]
    z = SEES @ (total - p) + NOISE_SD * rng.standard_normal(3)
    gain = prior @ SEES.T @ np.linalg.inv(SEES @ prior @ SEES.T + NOISE_SD**2 * np.eye(3))
    after = prior - gain @ SEES @ prior
    return FlightEstimate(
        serial="A1", names=KIND.names, time_s=time_s, x=p + gain @ z, covariance=(after + after.T) / 2
    )


def draw_errors(rng: np.random.Generator, sd: Floats) -> Floats:
    return sd * rng.standard_normal(M)


def test_one_flight_is_the_posterior_of_both_parts() -> None:
    """Beside a Kalman filter of (p, r) together, which knows nothing of G."""
    rng = np.random.default_rng(SEED)
    known = nothing_known(KIND, "A1")
    flight = fly_unit(rng, draw_errors(rng, KIND.persistent_sd) + draw_errors(rng, KIND.run_sd), known, 0.0)
    both = np.zeros((2 * M, 2 * M))
    both[:M, :M], both[M:, M:] = known.covariance, KIND.run_covariance
    sees = np.hstack([SEES, SEES])
    _, prior = filter_prior(known, KIND, 0.0)
    # z by the flight's estimate: x = prior S' (S prior S' + R)^-1 z has this z of least size in its row space
    innovation = SEES @ prior @ SEES.T + NOISE_SD**2 * np.eye(3)
    z = innovation @ np.linalg.lstsq(prior @ SEES.T, flight.x, rcond=1e-15)[0]
    gain = both @ sees.T @ np.linalg.inv(innovation)
    after = update_knowledge(known, KIND, flight)
    scale = np.where(KIND.persistent_sd > 0, KIND.persistent_sd, 1.0)
    assert after.p / scale == pytest.approx((gain @ z)[:M] / scale, abs=1e-9)
    want = (both - gain @ sees @ both)[:M, :M]
    assert after.covariance / np.outer(scale, scale) == pytest.approx(want / np.outer(scale, scale), abs=1e-9)


@pytest.mark.parametrize("whole", [True, False])
def test_eight_flights_of_many_units_are_as_uncertain_as_is_said(whole: bool) -> None:
    rng = np.random.default_rng(SEED)
    units, at = 400, np.flatnonzero(KIND.persistent_sd > 0)
    sums, shrunk = np.zeros(units), np.zeros(units)
    for u in range(units):
        p, known = draw_errors(rng, KIND.persistent_sd), nothing_known(KIND, "A1")
        for k in range(8):
            time_s = k * 30 * DAY_S
            if k:
                p = p + draw_errors(rng, KIND.aging_sd) * np.sqrt(30 * DAY_S / YEAR_S)
            flight = fly_unit(rng, p + draw_errors(rng, KIND.run_sd), known, time_s)
            known = update_knowledge(known, KIND, flight, whole=whole)
        error = (known.p - p)[at]
        sums[u] = error @ np.linalg.solve(known.covariance[np.ix_(at, at)], error)
        shrunk[u] = known.covariance[0, 0] / KIND.persistent_sd[0] ** 2
    assert shrunk.mean() < 0.25
    low, high = chi2.ppf([0.0005, 0.9995], units * len(at))
    if whole:
        assert low < sums.sum() < high
    else:  # an approximation: it shares out what is seen only in sum, and may be too sure of it
        assert 2.3 < sums.sum() / units / len(at) < 3.5


def test_weights_between_0_and_1_give_that_much_information() -> None:
    rng = np.random.default_rng(SEED)
    known = nothing_known(KIND, "A1")
    flight = fly_unit(rng, draw_errors(rng, KIND.persistent_sd), known, 0.0)
    assert np.array_equal(update_knowledge(known, KIND, replace(flight, weight=0.0)).p, known.p)
    assert update_knowledge(known, KIND, replace(flight, weight=0.0)).flights == 0
    less, more, full = (update_knowledge(known, KIND, replace(flight, weight=w)) for w in (0.3, 1.0 - 1e-12, 1.0))
    scale = np.where(KIND.persistent_sd > 0, KIND.persistent_sd, 1.0)
    assert more.p / scale == pytest.approx(full.p / scale, abs=1e-6)
    assert more.covariance / np.outer(scale, scale) == pytest.approx(full.covariance / np.outer(scale, scale), abs=1e-6)
    assert full.covariance[0, 0] < less.covariance[0, 0] < known.covariance[0, 0]


def test_a_weight_divides_the_variance_of_what_was_measured() -> None:
    kind = InstrumentClass(
        names=("nu",), persistent_sd=np.array([3.0]), run_sd=np.array([1.0]), aging_sd=np.array([0.0])
    )
    known, z, r, w = nothing_known(kind, "A1"), 4.0, 2.0, 0.3

    def seen(variance: float) -> FlightEstimate:
        k = 10.0 / (10.0 + variance)
        p = np.array([[10.0 * (1.0 - k)]])
        return FlightEstimate(serial="A1", names=("nu",), time_s=0.0, x=np.array([k * z]), covariance=p)

    got, want = update_knowledge(known, kind, replace(seen(r), weight=w)), update_knowledge(known, kind, seen(r / w))
    assert got.p == pytest.approx(want.p, rel=1e-12)
    assert got.covariance == pytest.approx(want.covariance, rel=1e-12)


def test_a_drift_that_ages_is_followed() -> None:
    """A change of five of its walk's standard deviations over five years: the last flights say what it is now."""
    rng = np.random.default_rng(SEED)
    still = replace(KIND, aging_sd=np.zeros(M))
    p, step = np.zeros(M), np.array([3e-8, 0.0, 0.0, 0.0, 0.0])
    follows, stays = nothing_known(KIND, "A1"), nothing_known(still, "A1")
    for year in range(10):
        now = p + step * year
        for kind, known in ((KIND, follows), (still, stays)):
            after = update_knowledge(known, kind, fly_unit(rng, now, known, year * YEAR_S))
            follows, stays = (after, stays) if kind is KIND else (follows, after)
    error = abs((follows.p - now)[0]), abs((stays.p - now)[0])
    assert error[0] < 0.5 * error[1]


def test_another_serial_number_starts_afresh_and_time_runs_forward() -> None:
    rng = np.random.default_rng(SEED)
    known = nothing_known(KIND, "A1")
    first = update_knowledge(known, KIND, fly_unit(rng, draw_errors(rng, KIND.persistent_sd), known, DAY_S))
    other = update_knowledge(
        first, KIND, replace(fly_unit(rng, np.zeros(M), known, 2 * DAY_S), serial="B2", weight=0.0)
    )
    assert other.serial == "B2"
    assert not other.p.any()
    assert np.array_equal(other.covariance, known.covariance)
    with pytest.raises(ValueError, match="expected a time after 86400 s, got 0"):
        age_knowledge(first, KIND, 0.0)


def test_a_roll_back_is_as_if_the_flights_had_not_been() -> None:
    rng = np.random.default_rng(SEED)
    known, flights = nothing_known(KIND, "A1"), list[FlightEstimate]()
    for k in range(5):
        flights.append(fly_unit(rng, draw_errors(rng, KIND.persistent_sd), known, k * DAY_S))
    want = knowledge_after(KIND, "A1", [flights[0], flights[1], flights[4]])
    got = knowledge_after(KIND, "A1", [*flights[:4], RollBack(2), flights[4]])
    assert np.array_equal(got.p, want.p)
    assert np.array_equal(got.covariance, want.covariance)
    assert [n for n, _ in standing_flights([*flights[:4], RollBack(2), flights[4]])] == [1, 2, 5]
    assert standing_flights([*flights, RollBack(0)]) == []
    with pytest.raises(ValueError, match="expected a flight of 0 to 5, got 6"):
        standing_flights([*flights, RollBack(6)])


@pytest.mark.parametrize("bad", [np.zeros(4), np.full(M, np.nan), np.full(M, -1.0)])
def test_a_class_that_is_none_is_rejected(bad: Floats) -> None:
    with pytest.raises(ValueError, match="run_sd: expected 5 numbers of 0 or more"):
        replace(KIND, run_sd=bad)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"x": np.zeros(4)}, "expected 5 finite estimates"),
        ({"x": np.full(M, np.nan)}, "expected 5 finite estimates"),
        ({"covariance": np.eye(4)}, "expected a covariance of 5 by 5 finite numbers"),
        ({"covariance": -np.eye(M)}, "expected a covariance of 5 by 5 finite numbers"),
        ({"covariance": np.full((M, M), np.inf)}, "expected a covariance of 5 by 5 finite numbers"),
        ({"weight": np.nan}, "expected a weight of 0 to 1, got nan"),
        ({"weight": 1.5}, "expected a weight of 0 to 1, got 1.5"),
        ({"time_s": np.inf}, "expected a finite time, got inf"),
    ],
)
def test_an_estimate_that_is_none_is_rejected(change: dict[str, Any], said: str) -> None:
    good = FlightEstimate(serial="A1", names=KIND.names, time_s=0.0, x=np.zeros(M), covariance=np.eye(M))
    with pytest.raises(ValueError, match=f"flight of unit A1: {said}"):
        replace(good, **change)


def test_a_flight_of_another_set_of_states_is_rejected() -> None:
    names = (*KIND.names[1:], KIND.names[0])
    flight = FlightEstimate(serial="A1", names=names, time_s=0.0, x=np.zeros(M), covariance=np.eye(M))
    with pytest.raises(ValueError, match=r"flight of unit A1: expected nu1, nu2, .*, got nu2, df1"):
        update_knowledge(nothing_known(KIND, "A1"), KIND, flight)
