"""The truth of the campaign koi: routes, drawn units, receiver, altimeter, conditions."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from psabench.koi.fleet.classes import ARCSEC, CLASSES, ReceiverSizes
from psabench.koi.fleet.conditions import CONDITIONS, Condition, Episode, draw_episode
from psabench.koi.fleet.receiver import Solutions, draw_heights, draw_slow, draw_solutions, states_at
from psabench.koi.fleet.routes import HOUR_S, ROUTES, Journey, Route, make_journey
from psabench.koi.fleet.unit import GAMMA, count_up, draw_readings, draw_unit
from psabench.link.signals import Floats
from psabench.native.flight_model import Flight
from psabench.native.nav import DEGPH
from psabench.native.strapdown import radii_m

SHORT = Route(
    place_deg_m=(55.7, 37.5, 150.0),
    heading_deg=30.0,
    taxi=({"taxi_m": 300}, {"turn_deg": 90}, {"taxi_m": 60}, {"stop_s": 20}),
    air=({"climb_m": 300, "speed_mps": 110}, {"turn_deg": 120}, {"land_mps": 70}, {"stop_s": 30}),
)
QUIET = ReceiverSizes(white_mps=0.0, slow_mps=0.0, white_m=0.0, slow_m=0.0)
ALWAYS = Episode(begin_s=0.0, end_s=math.inf, azimuth_rad=0.7)
NO_NOISE = replace(CLASSES["bins"].unit, gyro_noise_degph_rts=0.0, accel_noise_mps2_rts=0.0, nu_walk_degph_rth=0.0)


@cache
def journey() -> Journey:
    return make_journey(SHORT)


def solutions(
    sizes: ReceiverSizes = QUIET, c: Condition = CONDITIONS["clean"], e: Episode = ALWAYS, seed: int = 1
) -> Solutions:
    return draw_solutions(sizes, journey(), c, e, np.random.default_rng(seed))


def off_m(s: Solutions, late_s: float) -> Floats:
    """East, north, up of the solutions from where the aircraft was so long before, (n, 3)."""
    true = states_at(journey(), s.t_s - late_s)
    meridian, vertical = np.array([radii_m(a, h) for a, h in zip(true.lat_rad, true.h_m, strict=True)]).T
    east = (s.place_rad_m[:, 1] - true.lon_rad) * vertical * np.cos(true.lat_rad)
    return np.stack([east, (s.place_rad_m[:, 0] - true.lat_rad) * meridian, s.place_rad_m[:, 2] - true.h_m], axis=1)


@pytest.mark.parametrize("name", ROUTES)
def test_routes_park_taxi_and_fly_an_hour(name: str) -> None:
    route = ROUTES[name]
    path = Flight(route.legs, place_deg_m=route.place_deg_m, heading_deg=route.heading_deg)
    leg_s = [ns * 1e-9 for ns in path.leg_ns]
    kinds = [next(iter(leg)) for leg in route.legs]
    run, land = kinds.index("takeoff_mps"), kinds.index("land_mps")
    taxi = kinds[1:run]
    assert (taxi.count("turn_deg"), taxi.count("stop_s")) == (3, 2)
    assert all(abs(leg["turn_deg"]) == 90 for leg in route.taxi if "turn_deg" in leg)
    assert leg_s[1] == 600.0
    assert 360.0 < leg_s[run] - leg_s[1] < 480.0
    assert leg_s[land + 1] - leg_s[run + 1] >= HOUR_S
    assert kinds[run + 1 : land].count("turn_deg") >= 3
    s = path.states(np.arange(path.leg_ns[run], path.leg_ns[run + 1], 100_000_000))
    assert np.linalg.norm(s.a_enu_mps2[:, :2], axis=1).max() == pytest.approx(4.0, rel=1e-3)
    assert np.linalg.norm(s.v_enu_mps[-1]) == pytest.approx(85.0, rel=1e-2)


def test_units_have_the_sizes_of_their_class() -> None:
    for sizes in (CLASSES["good"].unit, CLASSES["bins"].unit):
        drawn = [draw_unit(sizes, 1, k) for k in range(500)]
        for rows, sd in (
            ([u.nu_radps for u in drawn], sizes.nu_degph * DEGPH),
            ([u.df_mps2 for u in drawn], sizes.df_mps2),
            ([np.diag(u.theta) for u in drawn], sizes.theta_scale),
            ([u.theta[0, 1:] for u in drawn], sizes.theta_angle_arcsec * ARCSEC),
            ([np.diag(u.gamma) for u in drawn], sizes.gamma_scale),
        ):
            values = np.array(rows)
            assert np.sqrt(np.mean(values**2)) == pytest.approx(sd, rel=4.0 / math.sqrt(2.0 * values.size))
        places = {(int(i), int(j)) for i, j in zip(*np.nonzero(drawn[0].gamma), strict=True)}
        assert places == set(GAMMA)


def test_a_unit_is_the_same_in_all_its_flights_but_for_what_is_drawn_at_switching_on() -> None:
    sizes, n = CLASSES["bins"].unit, 100
    stays, exact = draw_unit(sizes, 1, 0), np.zeros((n, 3))
    runs = [draw_readings(sizes, stays, exact, exact, np.random.default_rng(k)).errors for k in range(500)]
    off = np.array([r.nu_radps - stays.nu_radps for r in runs])
    assert np.sqrt(np.mean(off**2)) == pytest.approx(sizes.nu_run_degph * DEGPH, rel=0.07)
    off = np.array([r.df_mps2 - stays.df_mps2 for r in runs])
    assert np.sqrt(np.mean(off**2)) == pytest.approx(sizes.df_run_mps2, rel=0.07)
    assert all(np.array_equal(r.theta, stays.theta) and np.array_equal(r.gamma, stays.gamma) for r in runs)


def test_readings_err_as_the_model_says() -> None:
    j, stays = journey(), draw_unit(NO_NOISE, 1, 0)
    r = draw_readings(NO_NOISE, stays, j.dtheta_rad, j.dv_mps, np.random.default_rng(1))
    t_s = len(r.dv_mps) * 0.01
    e = r.errors
    for read, exact, matrix, constant, count in (
        (r.dtheta_rad, j.dtheta_rad, e.theta, e.nu_radps, 0.01 * ARCSEC),
        (r.dv_mps, j.dv_mps, e.gamma, e.df_mps2, 3e-6),
    ):
        total = exact.sum(axis=0)
        assert np.abs(read.sum(axis=0) - (total + matrix @ total + constant * t_s)).max() < 0.51 * count
    assert np.array_equal(r.errors_at(100), e.vector())


def test_walks_and_noise_have_their_sizes() -> None:
    sizes, exact = CLASSES["bins"].unit, np.zeros((100 * 1200, 3))
    r = draw_readings(sizes, draw_unit(sizes, 1, 0), exact, exact, np.random.default_rng(2))
    steps = np.diff(r.nu_walk_radps, axis=0)
    assert np.sqrt(np.mean(steps**2)) * 60.0 == pytest.approx(sizes.nu_walk_degph_rth * DEGPH, rel=0.05)
    means = r.dtheta_rad.reshape(-1, 100, 3).sum(axis=1) - r.errors.nu_radps - r.nu_walk_radps[:-1]
    assert np.sqrt(np.mean(means**2)) == pytest.approx(sizes.gyro_noise_degph_rts * DEGPH, rel=0.05)
    means = r.dv_mps.reshape(-1, 100, 3).sum(axis=1) - r.errors.df_mps2
    assert np.sqrt(np.mean(means**2)) == pytest.approx(sizes.accel_noise_mps2_rts, rel=0.05)


def test_counts_lose_nothing() -> None:
    exact = np.random.default_rng(1).normal(0.0, 0.4, (1000, 3))
    counted = count_up(exact, 0.25)
    assert np.array_equal(counted / 0.25, np.rint(counted / 0.25))
    assert np.abs(np.cumsum(counted, axis=0) - np.cumsum(exact, axis=0)).max() <= 0.125 + 1e-12


def test_a_receiver_without_errors_says_where_it_was() -> None:
    s = solutions()
    position_s, velocity_s = s.delays_s
    assert 0.0 < position_s < 0.1
    assert 0.0 < velocity_s < 0.06
    assert np.abs(off_m(s, position_s)).max() < 1e-3
    moved = states_at(journey(), s.t_s - position_s - velocity_s).v_enu_mps
    assert np.abs(s.v_enu_mps - moved).max() < 1e-9
    assert s.valid.all()


def test_errors_of_a_receiver_have_their_sizes() -> None:
    sizes = CLASSES["bins"].receiver
    rows = [off_m(s, s.delays_s[0]) for s in (solutions(sizes, seed=k) for k in range(20))]
    level = math.hypot(sizes.white_m, sizes.slow_m)
    for axis, factor in ((0, 1.0), (1, 1.0), (2, sizes.vertical_ratio)):
        assert np.sqrt(np.mean([r[:, axis] ** 2 for r in rows])) == pytest.approx(factor * level, rel=0.15)


def test_slow_errors_forget_at_their_rate() -> None:
    x = draw_slow(np.random.default_rng(1), 100_000, 2.0, 10.0)
    assert np.std(x) == pytest.approx(2.0, rel=0.05)
    assert np.mean(x[10:] * x[:-10]) / np.mean(x * x) == pytest.approx(math.exp(-1.0), abs=0.03)


def test_the_antenna_moves_as_its_lever_arm_does() -> None:
    c = replace(CONDITIONS["clean"], lever_m=(5.0, 3.0, -2.0))
    s = solutions(c=c)
    assert np.linalg.norm(off_m(s, s.delays_s[0]), axis=1) == pytest.approx(math.sqrt(38.0), abs=2e-3)
    away_mps = np.gradient(off_m(s, s.delays_s[0]), axis=0)
    late = s.delays_s[0] + s.delays_s[1]
    seen_mps = s.v_enu_mps - states_at(journey(), s.t_s - late).v_enu_mps
    turning = journey().path.leg_ns[2] * 1e-9, journey().path.leg_ns[3] * 1e-9
    middle = (s.t_s > turning[0] + 3.0) & (s.t_s < turning[1] - 3.0)
    assert np.abs(away_mps[middle]).max() > 0.5
    assert np.abs(seen_mps - away_mps)[middle].max() < 0.12 * np.abs(away_mps[middle]).max()


def test_conditions_do_what_they_say_and_nothing_else() -> None:
    e, clean = Episode(begin_s=700.0, end_s=750.0, azimuth_rad=0.5 * math.pi), solutions()
    holds = (clean.t_s >= 700.0) & (clean.t_s < 750.0)
    outage = solutions(c=CONDITIONS["outage"], e=e)
    assert np.array_equal(outage.valid, ~holds)
    assert np.array_equal(outage.place_rad_m, clean.place_rad_m)
    late_s = clean.delays_s[0]
    spoof = solutions(c=CONDITIONS["spoof"], e=e)
    east_m, faster_mps = off_m(spoof, late_s)[:, 0], (spoof.v_enu_mps - clean.v_enu_mps)[:, 0]
    assert east_m == pytest.approx(np.where(holds, 2.0 * (clean.t_s - 700.0), 0.0), abs=1e-3)
    assert faster_mps == pytest.approx(np.where(holds, 2.0, 0.0), abs=1e-9)
    jump = solutions(c=CONDITIONS["jump"], e=e)
    assert off_m(jump, late_s)[:, 0] == pytest.approx(np.where(holds, 100.0, 0.0), abs=1e-3)
    assert np.array_equal(jump.v_enu_mps, clean.v_enu_mps)
    for name, by_s in (("late", 0.5), ("early", -0.5)):
        assert solutions(c=CONDITIONS[name]).delays_s[0] - late_s == pytest.approx(by_s)


def test_episodes_are_on_the_ground_and_in_the_air() -> None:
    j = journey()
    drawn = [draw_episode(CONDITIONS["jump"], j, 600.0, np.random.default_rng(k)) for k in range(400)]
    begin_s = np.array([e.begin_s for e in drawn])
    ground = begin_s < j.run_s
    assert 0.4 < ground.mean() < 0.6
    assert begin_s.min() >= 600.0
    assert np.array_equal(begin_s >= j.take_off_s, ~ground)


def test_an_altimeter_errs_by_its_sizes() -> None:
    sizes, j = CLASSES["good"].baro, journey()
    true_m = states_at(j, np.arange(1.0, j.seconds + 1.0)).h_m
    off = np.array([draw_heights(sizes, j, np.random.default_rng(k)) - true_m for k in range(200)])
    assert np.std(off[:, 0]) == pytest.approx(sizes.offset_m, rel=0.2)
    assert np.std(np.diff(off[:, :500], axis=1)) == pytest.approx(sizes.white_m * math.sqrt(2.0), rel=0.1)
