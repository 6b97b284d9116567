"""A flight of the host: drawn units on a flight of emu/phys, raw increments, a receiver, a barometer."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from koi_flight import LEGS, Drawn, Truth, error_between, state_of, with_errors
from psabench.errors import BadInput
from psabench.koi.autocal import Knowledge, nothing_known
from psabench.koi.flight_data import Fix, FlightFound, FlightSetup
from psabench.koi.host import FlightHost
from psabench.koi.sensors import (
    instrument_class,
    sensor_names,
    sensor_rows,
    sensors_of_vector,
    state_names,
    vector_of_sensors,
)
from psabench.link.signals import Floats
from psabench.native.flight_model import Flight, Leg
from psabench.native.koi import Kind, Reason, UnitClass, koi_default, koi_layout, koi_prior
from psabench.native.strapdown import State

# Ten minutes parked, the taxi of LEGS, four minutes in the air.
SHORT: list[Leg] = [
    {"park_s": 600, "roll_deg": 0.05, "roll_s": 2.5},
    *LEGS[1:14],
    {"land_mps": 70},
    {"stop_s": 30},
]
CFG = koi_default(UnitClass.BINS)
Change = Callable[[Fix], Fix]


@cache
def truth() -> Truth:
    path = Flight(SHORT, heading_deg=30.0)
    return Truth.of(path, 0, path.end_ns // 10**9 * 10**9)


@cache
def unit(seed: int) -> Drawn:
    return Drawn.of(CFG, truth(), koi_prior(CFG, truth().state(0)), seed)


def fixes(d: Drawn) -> list[Fix]:
    """At whole seconds, late as the unit's draw says."""
    rng, n = np.random.default_rng(d.seed), len(d.truth) // 100
    t_s = np.arange(1.0, n + 1.0)
    late = d.x[koi_layout(CFG)["dt"]]
    place, speed = (d.truth.times(t_s - s) for s in (late[0], late[0] + late[1]))
    noise = rng.normal(size=(n, 6))
    out = []
    for i, t in enumerate(t_s):
        off = np.concatenate([noise[i, :3] * np.array(CFG.position_sd_m), np.zeros(6)])
        at = with_errors(state_of(place, i), off)
        v = speed.v_enu_mps[i] + noise[i, 3:] * np.array(CFG.velocity_sd_mps)
        east, north, up = (float(x) for x in v)
        out.append(Fix(t_s=t, lat_rad=at.lat_rad, lon_rad=at.lon_rad, h_m=at.h_m, v_enu_mps=(east, north, up)))
    return out


def feed(host: FlightHost, d: Drawn, change: Change = lambda fix: fix, *, piece: int = 100) -> None:
    heights = d.truth.times(np.arange(0.0, len(d.truth) // 100 + 1)).h_m + d.baro[: len(d.truth) // 100 + 1]
    pushed = 0
    for i, fix in enumerate(fixes(d), 1):
        while pushed < 100 * i:
            end = min(pushed + piece, 100 * i)
            host.push(d.angle[pushed:end], d.speed[pushed:end])
            pushed = end
        host.take_fix(change(fix))
        host.take_height(float(i), float(heights[i]))


def fly(seed: int, change: Change = lambda fix: fix, *, piece: int = 100, **setup: object) -> FlightFound:
    host = FlightHost(FlightSetup(cfg=CFG, **setup))  # type: ignore[arg-type]
    feed(host, unit(seed), change, piece=piece)
    return host.finish()


def end_error_m(found: FlightFound) -> float:
    true = state_of(truth().times(found.t_s[-1:]), 0)
    return math.hypot(*error_between(State.of(found.autonomous[-1]), true)[:2])


def happened(found: FlightFound) -> list[str]:
    return [e.what for e in found.events]


def test_a_unit_aligns_taxies_takes_off_and_corrects_itself() -> None:
    found = fly(1)
    assert happened(found) == ["aligned", "moves", "stop", "moves", "stop", "moves", "take-off", "corrected", "stop"]
    assert found.take_off_s is not None
    climbs_s = truth().path.leg_ns[SHORT.index({"takeoff_mps": 85}) + 1] * 1e-9
    assert 0.0 <= found.take_off_s - climbs_s < 10.0
    assert found.verdict == ""
    assert 0.8 < found.estimate.weight <= 1.0
    stopped_s = 1e-9 * sum(truth().path.leg_ns[i + 1] - truth().path.leg_ns[i] for i in (5, 9))
    assert found.taken[Kind.STOP].counts[Reason.ACCEPTED] == pytest.approx(600 + stopped_s + 30, abs=25)
    assert len(found.t_s) == len(found.autonomous) == len(found.hybrid) == len(truth()) // 100 - 600


def test_a_corrected_unit_errs_less() -> None:
    """Root mean square of eight units, seven minutes after take-off."""
    rms = [math.sqrt(np.mean([end_error_m(fly(s, corrects=c)) ** 2 for s in range(8)])) for c in (False, True)]
    print(f"without {rms[0]:.0f} m, with {rms[1]:.0f} m")
    assert rms[1] < 0.4 * rms[0]


def test_estimates_of_sensors_are_within_their_covariance() -> None:
    """Normalised errors squared of the sensors of eight units; whole errors, corrected or not."""
    rows, sums = sensor_rows(CFG), []
    for seed in range(8):
        found = fly(seed)
        off = found.estimate.x - unit(seed).x[rows]
        sums.append(off @ np.linalg.solve(found.estimate.covariance, off))
    m = rows.stop - rows.start
    print(f"NEES {np.mean(sums):.1f} of {m}")
    assert abs(np.mean(sums) - m) < 4.0 * math.sqrt(2.0 * m / 8)


@pytest.mark.parametrize("piece", [37, 100])
def test_the_size_of_the_pieces_does_not_matter(piece: int) -> None:
    found, other = fly(1, piece=piece), fly(1, piece=64)
    assert np.array_equal(found.autonomous, other.autonomous)
    assert np.array_equal(found.p, other.p)


def silent(fix: Fix) -> Fix:
    return replace(fix, valid=fix.t_s < 600.0)


def test_without_a_receiver_nothing_is_corrected_or_learned() -> None:
    found = fly(1, silent)
    assert not found.corrected
    assert found.decision is not None
    assert any("expected 60 measurements of position or more, got none" in r for r in found.decision.reasons)
    assert found.estimate.weight == 0.0
    assert "passport: expected 600 measurements of position or more, got none" in found.verdict
    assert np.array_equal(found.autonomous, fly(1, corrects=False).autonomous)


def test_late_fixes_are_estimated_or_not_believed() -> None:
    """Half a second late, where the filter expects 0.05 s."""
    found = fly(1, lambda fix: replace(fix, t_s=fix.t_s - 0.45))
    assert not found.corrected
    assert found.decision is not None
    assert found.decision.reasons


def test_a_filter_that_reopens_is_a_doubt() -> None:
    """A place that jumps by 600 m and stays there: after two minutes it is believed, and the flight teaches nothing."""
    found = fly(1, lambda fix: replace(fix, lat_rad=fix.lat_rad + (1e-4 if fix.t_s > 1200.0 else 0.0)))
    assert found.corrected
    assert found.taken[Kind.POSITION].counts[Reason.REOPENED] > 0
    assert "flight: expected a filter whose gates stay open, got one that has reopened" in found.verdict
    assert found.estimate.weight == 0.0


def test_a_flight_that_is_doubted_does_not_count() -> None:
    host = FlightHost(FlightSetup(cfg=CFG))
    host.doubt("increments: expected 100 in a second, got 60")
    feed(host, unit(1))
    found = host.finish()
    assert not found.corrected
    assert found.verdict == "increments: expected 100 in a second, got 60"
    assert found.estimate.weight == 0.0


def test_what_the_passport_knows_is_taken_off() -> None:
    """A unit whose errors are known errs as one without errors of sensors does: by its noise."""
    kind, rows = instrument_class(CFG), sensor_rows(CFG)
    new = nothing_known(kind, "unit")
    known = Knowledge(serial="unit", p=unit(1).x[rows], covariance=new.covariance * 1e-6)
    found = fly(1, known=known, corrects=False)
    assert end_error_m(found) < 0.4 * end_error_m(fly(1, corrects=False))
    assert found.verdict == ""  # what the filter found beyond it is within its prior
    scales = slice(6, None)  # which do not change from run to run: the filter began with what is known of them
    assert (np.diag(found.estimate.covariance)[scales] <= 1.01 * np.diag(known.covariance)[scales]).all()


def test_a_unit_that_moves_during_its_alignment_is_doubted() -> None:
    host, d = FlightHost(FlightSetup(cfg=CFG, place_rad_m=(0.97, 0.65, 150.0), align_s=720.0)), unit(1)
    host.push(d.angle, d.speed)
    found = host.finish()
    assert found.events[0].what == "aligned"
    assert "alignment: expected at most 5% of the seconds in motion" in found.verdict


def test_a_flight_without_alignment_or_place_is_an_error() -> None:
    host, d = FlightHost(FlightSetup(cfg=CFG)), unit(1)
    host.push(d.angle[:50_000], d.speed[:50_000])
    with pytest.raises(BadInput, match=r"flight: expected 600 s of increments at rest, got 500.00 s"):
        host.finish()
    with pytest.raises(BadInput, match=r"alignment: expected a place, or valid solutions of the receiver, got none"):
        host.push(d.angle[50_000:60_000], d.speed[50_000:60_000])


@pytest.mark.parametrize(("gauge", "slow_mps"), [(0, 0.0), (1, 0.0), (0, 0.1)])
def test_sensors_by_name(gauge: int, slow_mps: float) -> None:
    cfg = koi_default()
    cfg.gauge = gauge
    cfg.slow_v_sd_mps[:] = [slow_mps] * 3
    names, rows = sensor_names(cfg), sensor_rows(cfg)
    assert len(state_names(cfg)) == koi_layout(cfg)["dt"].stop
    assert state_names(cfg)[rows] == names
    x: Floats = np.arange(1.0, len(names) + 1.0)
    s = sensors_of_vector(cfg, x)
    assert np.array_equal(vector_of_sensors(cfg, s), x)
    by_name = {"nu2_radps": s.nu_radps[1], "df3_mps2": s.df_mps2[2], "gamma21": s.gamma[1, 0], "theta32": s.theta[2, 1]}
    assert {n: x[names.index(n)] for n in by_name} == by_name
    with pytest.raises(ValueError, match="errors of sensors"):
        sensors_of_vector(cfg, x[1:])


def test_the_class_is_the_priors_sensors() -> None:
    kind, rows = instrument_class(CFG), sensor_rows(CFG)
    prior = np.diag(koi_prior(CFG, truth().state(0)))[rows]
    assert np.sqrt(prior) == pytest.approx(np.hypot(kind.persistent_sd, kind.run_sd), rel=1e-12)
