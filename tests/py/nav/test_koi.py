"""The integration filter on flights of emu/phys/flight: consistency over drawn units, gates and reasons, prediction
alone, the one-off correction, alignment."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from koi_flight import (
    DT_S,
    LEGS,
    ON_GROUND_LEGS,
    Drawn,
    Truth,
    error_between,
    errors_of,
    measured,
    moving_of,
    sensors_of,
)
from psabench.errors import BadInput
from psabench.native.flight_model import Flight, Leg
from psabench.native.koi import (
    Kind,
    Koi,
    KoiConfig,
    Reason,
    UnitClass,
    coarse_alignment,
    koi_default,
    koi_prior,
)
from psabench.native.nav import Refused
from psabench.native.sins import Form, error_nees
from psabench.native.strapdown import State
from scipy import stats

RUNS, ALIGNED = 60, 60
ARCMIN = math.radians(1.0) / 60.0
PARK: list[Leg] = [{"park_s": 600, "roll_deg": 0.05, "roll_s": 2.5, "pitch_deg": 0.02, "pitch_s": 3.5}]


@pytest.fixture(scope="module")
def fly(tmp_path_factory: pytest.TempPathFactory) -> partial[Flight]:
    return partial(Flight, heading_deg=30.0)


@pytest.fixture(scope="module")
def whole(fly: partial[Flight]) -> Truth:
    path = fly(LEGS)
    return Truth.of(path, 0, path.end_ns // 10**9 * 10**9)


@pytest.fixture(scope="module")
def ground(fly: partial[Flight]) -> Truth:
    """Taxi to the runway."""
    path = fly(LEGS)
    return Truth.of(path, 0, path.leg_ns[ON_GROUND_LEGS] // 10**9 * 10**9)


@pytest.fixture(scope="module")
def parked(fly: partial[Flight]) -> Truth:
    path = fly(PARK)
    return Truth.of(path, 0, path.end_ns)


def drawn(truth: Truth, seed: int, unit_class: UnitClass = UnitClass.GOOD, form: Form = Form.JOSEPH) -> Drawn:
    cfg = koi_default(unit_class)
    cfg.form = int(form)
    return Drawn.of(cfg, truth, koi_prior(cfg, truth.state(0)), seed)


def flown(d: Drawn, seconds: int, *, height: bool = True) -> Koi:
    koi = d.start()
    d.fly(koi, 0, seconds, height=height)
    return koi


def band(runs: int, states: int) -> tuple[float, float]:
    """Of the mean NEES: 99.9 %."""
    low, high = stats.chi2.interval(0.999, runs * states)
    return low / runs, high / runs


@pytest.mark.parametrize("unit_class", list(UnitClass))
def test_errors_at_the_end_are_what_the_covariance_says(whole: Truth, unit_class: UnitClass) -> None:
    found = []
    for seed in range(RUNS):
        d = drawn(whole, seed, unit_class)
        koi = flown(d, len(whole) // 100)
        found.append(error_nees(koi.x - d.true_x(koi, len(whole)), koi.p))
    mean, (low, high) = float(np.mean(found)), band(RUNS, koi.n)
    print(f"{unit_class.name}: NEES {mean:.2f} of {koi.n}, band {low:.2f} to {high:.2f}")
    assert low < mean < high


def test_the_hybrid_solution_is_metres_off_where_the_autonomous_one_is_kilometres(whole: Truth) -> None:
    d = drawn(whole, 1, UnitClass.BINS)
    koi = flown(d, 1500)
    true = whole.state(150_000)
    alone, both = (error_between(s, true) for s in (koi.state.autonomous, koi.state.hybrid))
    assert np.hypot(*alone[:2]) > 1000.0
    assert np.abs(both[:3]).max() < 4.0
    assert np.abs(both[3:6]).max() < 0.2
    assert np.abs(both[6:8]).max() < 0.5 * ARCMIN
    assert abs(both[8]) < 2.0 * ARCMIN
    assert abs(alone[2]) < 60.0  # the barometer holds the autonomous height


def test_the_autonomous_solution_does_not_know_of_the_satellites(ground: Truth) -> None:
    d, seconds = drawn(ground, 3), len(ground) // 100
    koi, alone = flown(d, seconds, height=False), d.start()
    alone.push(d.angle[: 100 * seconds], d.speed[: 100 * seconds])
    assert np.array_equal(koi.state.autonomous.row(), alone.state.autonomous.row())
    assert not np.array_equal(koi.state.hybrid.row(), alone.state.hybrid.row())


def test_latencies_of_the_receiver_are_found(whole: Truth) -> None:
    d = drawn(whole, 2)
    koi = flown(d, 700)
    dt = koi.layout["dt"]
    assert koi.sd[dt].max() < 0.1 * d.cfg.dt1_sd_s
    assert np.abs(koi.x[dt] - d.x[dt]).max() < 4.0 * koi.sd[dt].max()


@pytest.mark.parametrize("late_s", [0.35, 0.08, 0.0, -0.07])
def test_a_value_is_compared_with_its_own_time(whole: Truth, late_s: float) -> None:
    """A unit without errors in a turn; values late by up to max_age_s, and between two steps."""
    begin = 74_000
    cfg, unit = koi_default(), slice(begin, begin + 1007)
    koi = Koi(cfg, 0.0, whole.state(begin))
    koi.push(whole.dtheta_rad[unit], whole.dv_mps[unit])
    true = whole.times(np.array([(begin + 1000) * DT_S - late_s]))
    speed = float(np.hypot(*true.v_enu_mps[0, :2]))
    assert speed > 80.0
    koi.take(Kind.POSITION, 10.0 - late_s, [true.lat_rad[0], true.lon_rad[0], true.h_m[0]])
    koi.take(Kind.HEIGHT, 10.0 - late_s, [true.h_m[0]])
    koi.take(Kind.VELOCITY, 10.0 - late_s, true.v_enu_mps[0])
    taken = koi.state.taken
    limit = 0.02 + 2.0 * late_s**2  # the jerk's share
    assert np.abs(taken[Kind.POSITION].innovation[:, 0]).max() < limit
    assert abs(taken[Kind.HEIGHT].innovation[0, 0]) < limit
    assert np.abs(taken[Kind.VELOCITY].innovation[:, 0]).max() < limit


# ---- gates


@pytest.fixture
def taxied(ground: Truth) -> tuple[Drawn, Koi]:
    d = drawn(ground, 5)
    koi = d.start()
    d.fly(koi, 0, 100)
    return d, koi


def fix(koi: Koi, **change: float) -> list[float]:
    """A position where the hybrid solution is, shifted."""
    s = koi.state.hybrid
    return [s.lat_rad + change.get("lat_rad", 0.0), s.lon_rad + change.get("lon_rad", 0.0), s.h_m]


FINE = (5.0, 5.0, 8.0)
GATES: dict[str, tuple[Reason, dict[str, Any]]] = {
    "fine": (Reason.ACCEPTED, {}),
    "its status": (Reason.INVALID, {"valid": False}),
    "no number": (Reason.NOT_FINITE, {"lat_rad": math.nan}),
    "no sigma": (Reason.NOT_FINITE, {"sd": (math.inf, 5.0, 5.0)}),
    "beyond the pole": (Reason.UNFIT, {"lat_rad": 1.0}),
    "negative sigma": (Reason.UNFIT, {"sd": (5.0, -5.0, 8.0)}),
    "the same time": (Reason.BACKWARDS, {"t_s": 100.0}),
    "back in time": (Reason.BACKWARDS, {"t_s": 99.9}),
    "too old": (Reason.STALE, {"t_s": 100.4}),
    "not yet": (Reason.EARLY, {"t_s": 101.02}),
    "25 m off": (Reason.GATED, {"lat_rad": 25.0 / 6.37e6}),
    "10 km off": (Reason.OUTLIER, {"lat_rad": 1e4 / 6.37e6}),
}


@pytest.mark.parametrize("case", list(GATES))
def test_each_measurement_is_taken_or_left_with_its_reason(taxied: tuple[Drawn, Koi], case: str) -> None:
    """And what is left leaves the filter as it was."""
    d, koi = taxied
    reason, change = GATES[case]
    koi.push(d.angle[10_000:10_100], d.speed[10_000:10_100])
    x, p, before = koi.x, koi.p, koi.state.taken[Kind.POSITION]
    t_s, sd = change.get("t_s", 101.0), change.get("sd", FINE)
    value = fix(koi, **{k: v for k, v in change.items() if k in ("lat_rad", "lon_rad")})
    assert koi.take(Kind.POSITION, t_s, value, sd, valid=change.get("valid", True)) is reason
    after = koi.state.taken[Kind.POSITION]
    assert after.reason is reason
    assert after.counts[reason] == before.counts[reason] + 1
    assert sum(after.counts.values()) == sum(before.counts.values()) + 1
    same = np.array_equal(koi.x, x) and np.array_equal(koi.p, p)
    assert same is (reason is not Reason.ACCEPTED)
    assert after.accepted_s == (101.0 if reason is Reason.ACCEPTED else 100.0)


@pytest.mark.parametrize("scale", [0.9, 1.1])
def test_the_gate_is_the_normalised_innovation_of_all_three_together(taxied: tuple[Drawn, Koi], scale: float) -> None:
    """Against NumPy: y' S^-1 y with S = H P H' + R of a velocity."""
    d, koi = taxied
    koi.push(d.angle[10_000:10_090], d.speed[10_000:10_090])
    v_before = koi.state.autonomous.v_n_mps
    koi.push(d.angle[10_090:10_100], d.speed[10_090:10_100])
    at, h, dt = koi.state, np.zeros((3, koi.n)), koi.layout["dt"]
    a = (at.autonomous.v_n_mps - v_before) / 0.1
    v1, v2 = (float(v) for v in at.autonomous.v_n_mps[:2])
    t = moving_of(np.eye(9)[0], at.autonomous)[6]
    h[0, [2, 6, 0]], h[1, [3, 6, 0]], h[2, 8] = (1.0, -v2, t * v2), (1.0, v1, -t * v1), 1.0
    h[:, dt] = a[:, None]
    s = h @ koi.p @ h.T + np.diag([0.03**2, 0.04**2, 0.05**2])
    unit = np.array([1.0, 0.5, 0.2])
    nis = scale * d.cfg.gate_nis[1]
    y = math.sqrt(nis / (unit @ np.linalg.solve(s, unit))) * unit
    before = koi.state.taken[Kind.VELOCITY]
    reason = koi.take(Kind.VELOCITY, 101.0, at.hybrid.v_n_mps - koi.x[dt].sum() * a - y, (0.03, 0.04, 0.05))
    last = koi.state.taken[Kind.VELOCITY]
    counted = reason is Reason.ACCEPTED
    assert last.nis_sum - before.nis_sum == pytest.approx(nis if counted else 0.0, rel=1e-6)
    assert last.nis_dof - before.nis_dof == (3 if counted else 0)
    assert last.nis == pytest.approx(nis, rel=1e-6)
    assert last.innovation == pytest.approx(np.stack([y, np.diag(s)], -1), rel=1e-6)
    assert reason is (Reason.ACCEPTED if scale < 1.0 else Reason.GATED)


def test_without_measurements_the_filter_predicts(taxied: tuple[Drawn, Koi]) -> None:
    d, koi = taxied
    assert koi.state.alone_s == 0.0
    sd = koi.sd
    koi.push(d.angle[10_000:13_000], d.speed[10_000:13_000])
    assert koi.state.alone_s == pytest.approx(30.0)
    assert koi.state.t_s == pytest.approx(130.0)
    assert (koi.sd[:4] > sd[:4]).all()
    assert koi.take(Kind.VELOCITY, 130.0, koi.state.hybrid.v_n_mps, valid=False) is Reason.INVALID
    assert koi.state.alone_s == pytest.approx(30.0)
    d.fly(koi, 130, 131)
    assert koi.state.alone_s == 0.0


def test_spikes_are_left_and_the_flight_goes_on(ground: Truth) -> None:
    """Every tenth fix is 200 m off: the rest is as good as without."""
    d, spiked = drawn(ground, 6), drawn(ground, 6).start()
    clean, seconds = d.start(), 270
    for t in range(1, seconds + 1):
        for koi in (clean, spiked):
            koi.push(d.angle[100 * t - 100 : 100 * t], d.speed[100 * t - 100 : 100 * t])
            true = ground.times(np.array([float(t)]))
            koi.take(Kind.VELOCITY, t, true.v_enu_mps[0])
            off = 200.0 / 6.37e6 if koi is spiked and t % 10 == 0 else 0.0
            koi.take(Kind.POSITION, t, [true.lat_rad[0] + off, true.lon_rad[0], true.h_m[0]])
    assert spiked.state.taken[Kind.POSITION].counts[Reason.OUTLIER] == seconds // 10
    assert np.abs(spiked.x - clean.x).max() < 1.0
    left = error_between(spiked.state.hybrid, ground.state(100 * seconds))
    assert np.abs(left[:3]).max() < 3.0


# ---- one-off correction


def error_map(n: int, at: State) -> np.ndarray:
    """From the state to errors of errors.h, which do not depend on where the autonomous solution is."""
    out = np.eye(n)
    out[:9, :9] = np.stack([errors_of(row, at) for row in np.eye(9)], -1)
    return out


def test_a_correction_moves_the_estimates_into_the_autonomous_solution(ground: Truth) -> None:
    d = drawn(ground, 7)
    koi = flown(d, 270)
    before, p, found = koi.state, koi.p, sensors_of(d.cfg, koi.x)
    koi.correct(np.ones(koi.n, bool))
    after = koi.state
    assert np.abs(error_between(after.autonomous, before.hybrid)).max() < 1e-9
    assert np.abs(error_between(after.hybrid, before.hybrid)).max() < 1e-9
    kept = np.zeros(koi.n, bool)  # the barometer's and the receiver's own stay in the filter
    kept[koi.layout["dt"]] = kept[koi.layout["baro"]] = True
    assert not koi.x[~kept].any()
    assert koi.x[kept].all()
    for name in ("nu_radps", "df_mps2", "gamma", "theta"):
        assert np.array_equal(getattr(after.sensors, name), getattr(before.total, name))
        assert np.array_equal(getattr(after.sensors, name), getattr(found, name))
    now, then = (error_map(koi.n, at.autonomous) for at in (after, before))
    errors = np.sqrt(np.diag(then @ p @ then.T))
    assert np.sqrt(np.diag(now @ koi.p @ now.T)) == pytest.approx(errors, rel=1e-9)
    d.fly(koi, 270, 271)
    assert koi.state.taken[Kind.VELOCITY].reason is Reason.ACCEPTED


def test_a_correction_takes_what_has_converged_and_no_more(ground: Truth) -> None:
    d = drawn(ground, 8)
    koi = flown(d, 270)
    take, prior = koi.converged(0.7), np.sqrt(np.diag(koi_prior(d.cfg, ground.state(0))))
    assert np.array_equal(take, koi.sd < 0.7 * prior)
    assert 0 < take.sum() < koi.n
    x = koi.x
    koi.correct(take)
    nu = koi.layout["nu"]
    assert koi.state.sensors.nu_radps == pytest.approx(np.where(take[nu], x[nu], 0.0))
    assert koi.x[nu] == pytest.approx(np.where(take[nu], 0.0, x[nu]))


def test_a_correction_at_take_off_makes_the_autonomous_flight_better(whole: Truth) -> None:
    """Eight units, each with and without: at rms, a half."""
    take_off = 310
    off: dict[bool, list[float]] = {False: [], True: []}
    for seed in range(8):
        d = drawn(whole, 100 + seed)
        for corrected in (False, True):
            koi = flown(d, take_off)
            if corrected:
                koi.correct(koi.converged(0.7))
            koi.push(d.angle[100 * take_off :], d.speed[100 * take_off :])
            error = error_between(koi.state.autonomous, whole.state(len(whole)))
            off[corrected].append(float(np.hypot(*error[:2])))
    without, withal = (math.sqrt(float(np.mean(np.square(off[c])))) for c in (False, True))
    print(f"{without:.0f} m without, {withal:.0f} m with")
    assert withal < 0.7 * without


def test_corrections_wait_for_the_end_of_a_step(taxied: tuple[Drawn, Koi]) -> None:
    d, koi = taxied
    koi.push(d.angle[10_000:10_003], d.speed[10_000:10_003])
    with pytest.raises(Refused):
        koi.correct(np.ones(koi.n, bool))
    with pytest.raises(BadInput, match="33 flags"):
        koi.correct(np.ones(3, bool))


# ---- numbers


def test_the_same_data_give_the_same_bytes_in_any_portions(ground: Truth) -> None:
    d = drawn(ground, 9)
    once, parts = flown(d, 60), d.start()
    for k in range(0, 6000, 100):
        for i in range(k, k + 100, 7):
            part = slice(i, min(i + 7, k + 100))
            parts.push(d.angle[part], d.speed[part])
    whole_push = d.start()
    whole_push.push(d.angle[:6000], d.speed[:6000])
    assert np.array_equal(parts.x, whole_push.x)
    assert np.array_equal(parts.p, whole_push.p)
    again = flown(d, 60)
    assert np.array_equal(once.p, again.p)
    assert np.array_equal(once.state.hybrid.row(), again.state.hybrid.row())


def test_both_forms_of_the_covariance_agree(ground: Truth) -> None:
    joseph, ud = (flown(drawn(ground, 10, form=form), 270) for form in (Form.JOSEPH, Form.UD))
    assert ud.sd == pytest.approx(joseph.sd, rel=1e-6)
    assert np.abs(ud.x - joseph.x).max() == pytest.approx(0.0, abs=1e-6)


# ---- alignment


def aligned(d: Drawn, cfg: KoiConfig) -> Koi:
    """Coarse by two minutes, then zero velocity by the filter from the beginning, then a correction of all but the
    sensors."""
    truth, coarse = d.truth, 12_000
    true = truth.state(0)
    found = coarse_alignment(d.angle[:coarse], d.speed[:coarse], DT_S, true.lat_rad)
    at = State(lat_rad=true.lat_rad, lon_rad=true.lon_rad, h_m=true.h_m, v_n_mps=np.zeros(3), C_nb=found.begin_C_nb)
    koi = Koi(cfg, 0.0, at)
    for k in range(0, len(truth), 100):
        koi.push(d.angle[k : k + 100], d.speed[k : k + 100])
        koi.take(Kind.STOP, (k + 100) * DT_S)
    take = np.zeros(koi.n, bool)
    take[:9] = True
    koi.correct(take)
    return koi


def align_config(unit_class: UnitClass) -> KoiConfig:
    """Prior of the coarse alignment; place is known."""
    cfg = koi_default(unit_class)
    cfg.alignment_s, cfg.alpha_sd_rad, cfg.beta3_sd_rad = 0.0, 2.0 * ARCMIN, math.radians(1.5)
    cfg.dr_sd_m[:] = [0.01] * 3
    cfg.dv_sd_mps[:] = [0.02] * 3
    return cfg


def test_a_swaying_unit_without_errors_finds_north(parked: Truth) -> None:
    found = coarse_alignment(parked.dtheta_rad, parked.dv_mps, DT_S, parked.state(0).lat_rad)
    assert found.ratio == pytest.approx(1.0, abs=1e-3)
    for c_nb, k in ((found.begin_C_nb, 0), (found.end_C_nb, len(parked))):
        here = State(lat_rad=0.0, lon_rad=0.0, h_m=0.0, v_n_mps=np.zeros(3), C_nb=c_nb)
        beta = error_between(here, parked.state(k))[6:]
        assert np.abs(beta[:2]).max() < 0.2 * ARCMIN
        assert abs(beta[2]) < 1.0 * ARCMIN


@pytest.mark.parametrize(("unit_class", "heading", "level"), [(UnitClass.GOOD, 4.5, 0.25), (UnitClass.BINS, 10.0, 0.7)])
def test_alignments_err_as_their_covariance_says(
    parked: Truth, unit_class: UnitClass, heading: float, level: float
) -> None:
    """Heading and levels in minutes of arc, as the class has them after 600 s (E0)."""
    nees, cfg = [], align_config(unit_class)
    for seed in range(ALIGNED):
        d = Drawn.of(cfg, parked, koi_prior(cfg, parked.state(0)), seed)
        koi = aligned(d, cfg)
        error = koi.x[:9] - moving_of(
            error_between(koi.state.autonomous, parked.state(len(parked))), koi.state.autonomous
        )
        nees.append(error_nees(error[4:7], np.ascontiguousarray(koi.p[4:7, 4:7])))
    sd = koi.sd[4:7] / ARCMIN
    print(f"{unit_class.name}: {sd.round(3)}', NEES {np.mean(nees):.2f} of 3")
    assert sd[2] == pytest.approx(heading, rel=0.15)
    assert sd[:2].max() == pytest.approx(level, rel=0.3)
    low, high = band(ALIGNED, 3)
    assert low < np.mean(nees) < high


def test_a_unit_that_turns_about_is_not_aligned(parked: Truth) -> None:
    turned = parked.dtheta_rad.copy()
    turned[:, 0] += 2e-4 * DT_S  # 40 deg/h that are not the Earth's
    with pytest.raises(Refused):
        coarse_alignment(turned, parked.dv_mps, DT_S, parked.state(0).lat_rad)


def test_an_alignment_of_nothing_or_at_the_pole_is_refused(parked: Truth) -> None:
    with pytest.raises(Refused):
        coarse_alignment(parked.dtheta_rad[:500], parked.dv_mps[:500], DT_S, 0.9)
    with pytest.raises(Refused):
        coarse_alignment(parked.dtheta_rad, parked.dv_mps, DT_S, 1.5)


def test_sensors_known_before_are_taken_off(ground: Truth) -> None:
    """Corrections from earlier flights: a unit whose errors they are goes as one without."""
    d, cfg = drawn(ground, 11), koi_default()
    known = sensors_of(cfg, d.x)
    angle, speed = measured(ground, known)
    unit, ideal = Koi(cfg, 0.0, ground.state(0), sensors=known), Koi(cfg, 0.0, ground.state(0))
    unit.push(angle[:20_000], speed[:20_000])
    ideal.push(ground.dtheta_rad[:20_000], ground.dv_mps[:20_000])
    off = error_between(unit.state.autonomous, ideal.state.autonomous)
    assert np.abs(off[:3]).max() < 1e-3
    assert np.array_equal(unit.state.sensors.nu_radps, known.nu_radps)
