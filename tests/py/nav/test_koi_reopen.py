"""Gates that have shut: a filter that is wrong gets out of it, one whose receiver is wrong does not at once."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from koi_flight import LEGS, Drawn, Truth, error_between, errors_of, with_errors
from psabench.native.flight_model import Flight
from psabench.native.koi import Kind, Koi, Reason, koi_default, koi_layout, koi_prior
from psabench.native.nav import Refused

JUMP_M, AT_S, REOPEN_S = 300.0, 100, 120
ARCMIN = math.radians(1.0) / 60.0
IN_AIR_S = 400


@pytest.fixture(scope="module")
def truth() -> Truth:
    path = Flight(LEGS, heading_deg=30.0)
    return Truth.of(path, 0, 400 * 10**9)


@pytest.fixture(scope="module")
def air() -> Truth:
    path = Flight(LEGS, heading_deg=30.0)
    return Truth.of(path, IN_AIR_S * 10**9, (IN_AIR_S + 600) * 10**9)


def unit(truth: Truth, reopen_s: float = REOPEN_S) -> Drawn:
    cfg = koi_default()
    cfg.reopen_s = reopen_s
    return Drawn.of(cfg, truth, koi_prior(cfg, truth.state(0)), 5)


def reopened(koi: Koi) -> dict[Kind, int]:
    return {kind: n for kind, taken in koi.state.taken.items() if (n := taken.counts[Reason.REOPENED])}


def start_turned(d: Drawn, reopen_s: float) -> Koi:
    """Heading 3 deg and levels 10' off, by a filter that believes in minutes."""
    true, e = d.truth.state(0), errors_of(d.x[:9], d.truth.state(0))
    e[6:9] += [10.0 * ARCMIN, -10.0 * ARCMIN, math.radians(3.0)]
    d.cfg.reopen_s = reopen_s
    return Koi(d.cfg, 0.0, with_errors(true, e))


def test_a_filter_that_is_wrong_gets_out_of_it(air: Truth) -> None:
    d, off = unit(air), {}
    for reopen_s in (0.0, REOPEN_S):
        koi = start_turned(d, reopen_s)
        d.fly(koi, 0, 599)
        off[reopen_s] = error_between(koi.state.hybrid, air.state(59_900))
        if not reopen_s:
            assert koi.state.taken[Kind.VELOCITY].counts[Reason.ACCEPTED] == 0
            assert not reopened(koi)
    assert np.hypot(*off[0.0][:2]) > 5000.0
    found = reopened(koi)
    print(found, off[REOPEN_S].round(5))
    assert found[Kind.VELOCITY] >= 1
    assert found[Kind.POSITION] >= 1
    assert np.abs(off[REOPEN_S][:3]).max() < 15.0
    assert np.abs(off[REOPEN_S][3:6]).max() < 0.3
    assert np.abs(off[REOPEN_S][6:]).max() < 5.0 * ARCMIN


def test_a_place_that_jumps_and_stays_is_believed_in_the_end(truth: Truth) -> None:
    """After two minutes; velocities go on, and the attitude is as good as before."""
    d, plain = unit(truth), unit(truth)
    d.slow[AT_S + 1 :, 1] += JUMP_M
    koi, other = d.start(), plain.start()
    d.fly(koi, 0, AT_S + REOPEN_S)
    assert not reopened(koi)
    assert koi.state.taken[Kind.POSITION].accepted_s == AT_S
    d.fly(koi, AT_S + REOPEN_S, AT_S + REOPEN_S + 1)
    taken = koi.state.taken[Kind.POSITION]
    assert taken.reason is Reason.REOPENED
    assert taken.accepted_s == AT_S + REOPEN_S + 1
    d.fly(koi, AT_S + REOPEN_S + 1, 300)
    plain.fly(other, 0, 300)
    assert reopened(koi) == {Kind.POSITION: 1}
    assert koi.state.taken[Kind.POSITION].counts[Reason.ACCEPTED] > AT_S + 70
    assert koi.state.taken[Kind.VELOCITY].counts[Reason.ACCEPTED] >= 299
    off = error_between(koi.state.hybrid, truth.state(30_000))
    assert off[1] == pytest.approx(JUMP_M, abs=6.0)
    assert koi.sd[2:7] == pytest.approx(other.sd[2:7], rel=0.05)
    assert (np.abs(error_between(koi.state.hybrid, other.state.hybrid)[6:]) < 2.0 * koi.sd[4:7]).all()


WRONG: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "a jump of 100 s": lambda t: JUMP_M * (t < 100.0),
    "1 m/s": lambda t: 30.0 + 1.0 * t,
    "here and there": lambda t: JUMP_M * np.random.default_rng(1).uniform(1.0, 3.0, len(t)),
}


@pytest.mark.parametrize("case", list(WRONG))
def test_a_receiver_that_is_wrong_is_not_believed(truth: Truth, case: str) -> None:
    """And the filter is to the bit the one that never opens."""
    ends = []
    for reopen_s in (0.0, REOPEN_S):
        d = unit(truth, reopen_s)
        d.slow[AT_S + 1 :, 1] += WRONG[case](np.arange(len(d.slow) - AT_S - 1.0))
        koi = d.start()
        d.fly(koi, 0, 400)
        assert not reopened(koi)
        ends.append(koi)
    counts = koi.state.taken[Kind.POSITION].counts
    assert counts[Reason.GATED] + counts[Reason.OUTLIER] >= 95
    assert np.array_equal(ends[0].x, ends[1].x)
    assert np.array_equal(ends[0].p, ends[1].p)


def test_one_that_is_taken_begins_it_again(truth: Truth) -> None:
    d = unit(truth)
    d.slow[AT_S + 1 :, 1] += JUMP_M
    d.slow[AT_S + 60, 1] -= JUMP_M
    koi = d.start()
    d.fly(koi, 0, AT_S + 60 + REOPEN_S)
    assert not reopened(koi)
    d.fly(koi, AT_S + 60 + REOPEN_S, AT_S + 60 + REOPEN_S + 1)
    assert reopened(koi) == {Kind.POSITION: 1}


def test_few_measurements_do_not_open_it(truth: Truth) -> None:
    """One in 15 s: the tenth, not the ninth, which is the first after two minutes."""
    d = unit(truth)
    koi = d.start()
    d.fly(koi, 0, AT_S)
    for n in range(1, 11):
        begin = 100 * (AT_S + 15 * (n - 1))
        koi.push(d.angle[begin : begin + 1500], d.speed[begin : begin + 1500])
        koi.take(Kind.VELOCITY, AT_S + 15.0 * n, koi.state.hybrid.v_n_mps)
        true = with_errors(truth.state(begin + 1500), np.array([0.0, JUMP_M, *np.zeros(7)]))
        reason = koi.take(Kind.POSITION, AT_S + 15.0 * n, [true.lat_rad, true.lon_rad, true.h_m])
        assert (reason is Reason.REOPENED) is (n == 10)


def test_the_covariance_is_widened_by_the_least_power_of_two(truth: Truth) -> None:
    """Against NumPy: D P D with D of the place, then the update."""
    d = unit(truth)
    d.slow[AT_S + 1 :, :2] += JUMP_M, 0.5 * JUMP_M
    koi = d.start()
    d.fly(koi, 0, AT_S + REOPEN_S)
    begin = 100 * (AT_S + REOPEN_S)
    koi.push(d.angle[begin : begin + 100], d.speed[begin : begin + 100])
    x, p, at, dt = koi.x, koi.p, koi.state.hybrid, koi.layout["dt"].start
    true = with_errors(truth.state(begin + 100), np.array([JUMP_M, 0.5 * JUMP_M, *np.zeros(7)]))
    assert koi.take(Kind.POSITION, AT_S + REOPEN_S + 1.0, [true.lat_rad, true.lon_rad, true.h_m]) is Reason.REOPENED
    y = koi.state.taken[Kind.POSITION].innovation[:, 0]
    h, r = np.zeros((3, koi.n)), np.diag(np.square(d.cfg.position_sd_m))
    h[0, 0] = h[1, 1] = h[2, 7] = 1.0
    h[:, dt] = at.v_n_mps
    for power in range(20):
        wide = np.ones(koi.n)
        wide[[0, 1, 7]] = 2.0**power
        prior = wide[:, None] * p * wide
        s = h @ prior @ h.T + r
        if y @ np.linalg.solve(s, y) <= 3.0:
            break
    assert power > 3
    gain = prior @ h.T @ np.linalg.inv(s)
    after = prior - gain @ s @ gain.T
    scale = np.sqrt(np.diag(after))
    assert koi.p / np.outer(scale, scale) == pytest.approx(after / np.outer(scale, scale), abs=1e-6)
    assert koi.x == pytest.approx(x + gain @ y, rel=1e-6, abs=1e-12)


def test_a_time_below_zero_is_refused() -> None:
    cfg = koi_default()
    cfg.reopen_s = -1.0
    with pytest.raises(Refused, match="reopen_s"):
        koi_layout(cfg)
