"""When an aircraft takes off, what it did before, and whether its unit may correct itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from psabench.koi.take_off import Decision, TakeOffDetector, Taxi, decide_correction, taxi_of
from psabench.koi.trust import Evidence, Gate, TrustLimits, trust_weight
from psabench.link.signals import Floats

NAMES = ("dr1", "dr2", "dV1", "dV2", "alpha1", "alpha2", "beta3", "nu1", "nu2", "nu3")
PRIOR = np.full(10, 2.0)
GOOD = Gate(taken=300, gated=2, nis_sum=910.0, nis_dof=900)
GATES = {"position": GOOD, "velocity": GOOD}
RATIO = np.array([0.1, 0.1, 0.1, 0.1, 0.9, 0.3, 0.5, 0.2, 0.69, 0.71])
EVIDENCE = Evidence(
    names=NAMES,
    x=np.full(10, 1.0),
    sd=RATIO * PRIOR,
    prior_sd=PRIOR,
    gates=GATES,
    alone_s=1.0,
)
TAXI = Taxi(turns=3, stops=2)


def detect_runs(t_s: Floats, speed_mps: Floats, valid: Floats | None = None) -> list[float]:
    """Where an aircraft that climbs all the time is seen to take off, one sample after its run is."""
    d = TakeOffDetector()
    ok = np.ones(len(t_s)) if valid is None else valid
    return [
        float(t) - 1.0 for t, v, good in zip(t_s, speed_mps, ok, strict=True) if d.take(t, v, 5.0, valid=bool(good))
    ]


def test_a_run_is_seen_once_and_a_taxi_never() -> None:
    t = np.arange(0.0, 900.0)
    taxi = 8.0 + 7.0 * np.sin(0.05 * t)
    run = np.where(t < 600.0, taxi, np.minimum(taxi[600] + 4.0 * (t - 600.0), 250.0))
    (at,) = detect_runs(t, run)
    assert 600.0 + (40.0 - taxi[600]) / 4.0 <= at < 600.0 + (40.0 - taxi[600]) / 4.0 + 4.0
    assert detect_runs(t, taxi) == []
    assert detect_runs(t, 16.0 + 0.03 * t) == []  # never so slow again: too little acceleration for a run


def test_outliers_of_the_receiver_are_no_take_off() -> None:
    t = np.arange(0.0, 300.0)
    speed, valid = np.full(300, 6.0), np.ones(300)
    speed[100:102] = 90.0  # two in a row
    speed[150:160], valid[150:160] = 90.0, 0.0  # and ten that say so themselves
    speed[200] = np.nan
    assert detect_runs(t, 240.0 + 0.0 * t) == []  # it was never slow
    cruise = np.where(np.isin(t, [50.0, 120.0, 121.0]), 0.0, np.where(t < 10.0, 3.0, 240.0))
    assert detect_runs(t, np.where(t < 40.0, np.minimum(3.0, t), cruise)) == [42.0]  # low outliers are no stop
    assert detect_runs(t, speed, valid) == []
    speed[100:104] = [40.0, 41.0, 42.0, 43.0]
    assert detect_runs(t, speed, valid) == [102.0]


def take_offs(climb_mps: Floats, speed_mps: Floats) -> list[float]:
    d = TakeOffDetector()
    return [float(t) for t, (v, c) in enumerate(zip(speed_mps, climb_mps, strict=True)) if d.take(float(t), v, c)]


def test_a_take_off_is_when_it_has_left_the_ground() -> None:
    t = np.arange(0.0, 200.0)
    speed = np.clip(4.0 * (t - 100.0), 2.0, 85.0)  # 40 m/s at 110 s
    assert take_offs(np.where(t < 125.0, 0.0, 3.0), speed) == [126.0]
    assert take_offs(np.where((t == 118.0) | (t > 130.0), 3.0, 0.0), speed) == [132.0]  # one sample is noise
    assert take_offs(np.zeros(200), speed) == [112.0 + 40.0]  # a climb that is never seen
    stopped = np.where(t < 120.0, speed, np.maximum(80.0 - 4.0 * (t - 120.0), 0.0))
    assert take_offs(np.zeros(200), stopped) == []  # a run that was broken off


def test_turns_and_stops_of_a_taxi() -> None:
    t = np.arange(0.0, 600.0)
    heading = np.interp(t, [0, 100, 115, 250, 265, 400, 600], [3.0, 3.0, 4.57, 4.57, 6.14, 6.14, 7.1])
    speed = np.where((t > 50) & (t < 80) | (t > 300) & (t < 303) | (t > 500), 0.1, 7.0)
    wrapped = (heading + np.pi) % (2 * np.pi) - np.pi
    assert taxi_of(t, wrapped, speed) == Taxi(turns=2, stops=2)  # the last turn takes 200 s, the stop of 2 s is none
    heading[200] = speed[400] = np.nan
    assert taxi_of(t, heading, speed) == Taxi(turns=2, stops=2)
    assert taxi_of(t[:1], wrapped[:1], speed[:1]) == Taxi(turns=0, stops=0)


def test_what_has_converged_is_corrected_and_the_solution_whole() -> None:
    d = decide_correction(EVIDENCE, TAXI)
    assert d.passed
    assert d.take.tolist() == [True] * 7 + [True, True, False]


def decide_with(taxi: Taxi = TAXI, **changes: object) -> Decision:
    return decide_correction(replace(EVIDENCE, **changes), taxi)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"alone_s": 12.0}, "expected a measurement in the last 5 s, got the last 12.0 s ago"),
        ({"alone_s": float("nan")}, "expected a measurement in the last 5 s"),
        (
            {"gates": GATES | {"velocity": replace(GOOD, taken=20, gated=0)}},
            "expected 60 measurements of velocity or more, got 20",
        ),
        (
            {"gates": GATES | {"position": replace(GOOD, gated=30)}},
            "expected at most 5% of position outside its gate, got 9.1%",
        ),
        ({"gates": GATES | {"position": replace(GOOD, nis_sum=1800.0)}}, "of 0.02 to 1.3, got 2.00"),
        ({"gates": GATES | {"position": replace(GOOD, nis_sum=9.0)}}, "of 0.02 to 1.3, got 0.01"),
        ({"gates": GATES | {"position": replace(GOOD, nis_sum=float("nan"))}}, "of 0.02 to 1.3, got nan"),
        ({"x": np.append(np.full(9, 1.0), -9.0)}, "of their priors, got 4.5 for nu3"),
        ({"x": np.full(10, np.nan)}, "expected finite estimates, got one that is not for dr1"),
        ({"sd": PRIOR * 0.8}, "expected a heading known to 0.7 of its prior, got 0.80"),
        ({"taxi": Taxi(turns=0, stops=2)}, "expected turns during the taxi: 1 or more, got 0"),
        ({"taxi": Taxi(turns=3, stops=0)}, "expected stops during the taxi: 1 or more, got 0"),
        ({"gates": {"position": GOOD}}, "expected 60 measurements of velocity or more, got none"),
        ({"gates": GATES | {"position": replace(GOOD, nis_sum=0.0, nis_dof=0)}}, "got nan"),
        ({"prior_sd": np.append(np.full(9, 2.0), np.nan)}, "expected finite estimates, got one that is not for nu3"),
        ({"prior_sd": np.append(np.full(9, 2.0), 0.0)}, "of their priors, got inf for nu3"),
    ],
)
def test_each_doubt_is_a_reason_and_then_nothing_is_corrected(changes: dict[str, object], said: str) -> None:
    d = decide_with(**changes)  # type: ignore[arg-type]
    assert not d.passed
    assert not d.take.any()
    (reason,) = d.reasons
    assert reason.startswith("correction at take-off: expected")
    assert said in reason


def test_all_reasons_are_given_together() -> None:
    assert len(decide_with(alone_s=99.0, taxi=Taxi(turns=0, stops=0), sd=PRIOR).reasons) == 4


def test_a_heading_that_is_no_state_is_rejected() -> None:
    with pytest.raises(ValueError, match=r"state of the heading: expected dr1, .* got yaw"):
        decide_correction(EVIDENCE, TAXI, heading="yaw")


def test_evidence_of_other_lengths_than_its_names_is_rejected() -> None:
    with pytest.raises(ValueError, match=r"evidence of a filter: expected 10 numbers, got \(9,\)"):
        replace(EVIDENCE, sd=np.ones(9))


@pytest.mark.parametrize(
    ("changes", "weight"),
    [
        ({"gated": 0}, 1.0),
        ({"gated": 0, "nis_sum": 450.0}, 1.0),  # smaller than expected: no more than whole
        ({"gated": 0, "nis_sum": 1125.0}, 0.8),
        ({"taken": 294, "gated": 6}, 1.0 - 0.02 / 0.1),
        ({"taken": 294, "gated": 6, "nis_sum": 1125.0}, 0.8 * 0.8),
    ],
)
def test_a_flight_is_worth_what_its_measurements_are(changes: dict[str, float], weight: float) -> None:
    usual = replace(GOOD, gated=0, nis_sum=900.0)
    gates = {"position": usual, "velocity": replace(usual, **changes)}  # type: ignore[arg-type]
    assert trust_weight(gates, TrustLimits()) == pytest.approx(weight, rel=1e-12)
