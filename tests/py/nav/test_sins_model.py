"""The calibration's model beside finite rotations in NumPy: Jacobians, stand, gauges, whole runs without noise."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import sins_truth as truth
from kalman_reference import Step, dense_step, relative
from psabench.native import sins
from psabench.native.nav import Floats, Refused
from psabench.native.navlib import library
from psabench.native.sins import Form, Gauge, Params, Sins, SinsConfig, Turn
from psabench.native.sinslib import BLOCKS, SinsConfigStruct
from sins_truth import ARCMIN, DEG, DEGPH, G_N, U_N, Errors, Table, rotation_vector, turned

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
SHORT = [(X, 10 * DEG, 5.0), (Z, -10 * DEG, 5.0), (Y, -10 * DEG, 4.0)]


def turns(legs: list[truth.Leg]) -> list[Turn]:
    return [Turn(axis_b=axis, rate_radps=rate, duration_s=duration) for axis, rate, duration in legs]


def test_the_defaults_of_python_are_those_of_the_library() -> None:
    default, ours = SinsConfigStruct(), sins.config_struct(SinsConfig())
    library().sins_default(default)
    for name, *_ in SinsConfigStruct._fields_:
        a, b = getattr(ours, name), getattr(default, name)
        assert (list(a), list(b))[0] == list(b) if name == "beta_sd_rad" else a == pytest.approx(b, rel=1e-14), name


def test_blocks_have_their_names_and_places() -> None:
    assert [library().sins_block_name(k).decode() for k in range(-1, len(BLOCKS) + 1)] == ["", *BLOCKS, ""]
    full = SinsConfig(
        gauge=Gauge.FREE9, lever=9, stand=True, base=True, walk=True, clone=True, quad_sd_s2pm=1e-5, delay_sd_s=5e-3
    )
    sizes = {name: rows.stop - rows.start for name, rows in sins.state_layout(full).items()}
    assert sizes == dict(zip(BLOCKS, (3, 3, 3, 9, 3, 9, 9, 3, 1, 3, 1, 3, 3), strict=True))
    p = sins.prior_covariance(full)
    sd = np.sqrt(np.diag(p))
    rows = sins.state_layout(full)
    assert sd[rows["theta"]].reshape(3, 3) == pytest.approx(np.where(np.eye(3) > 0, 1e-3, 3 * ARCMIN))
    assert sd[rows["nu"]] == pytest.approx(0.5 * DEGPH)
    assert sd[rows["quad"]] == pytest.approx(1e-5)
    assert sd[rows["delay"]] == pytest.approx(5e-3)
    assert sins.state_layout(SinsConfig())["quad"] == sins.state_layout(SinsConfig())["delay"]  # empty: no prior
    assert np.array_equal(p[rows["beta"], rows["beta0"]], p[rows["beta"], rows["beta"]])


# ---- Jacobians


def strapdown(c: Floats, dtheta: Floats, dv: Floats, dt: float, per_step: int) -> Floats:
    """z_a of each step: means of Chat f' less g, by finite rotations of half samples."""
    out, total = [], np.zeros(3)
    earth = turned(-0.5 * U_N * dt)
    for k, (half, v) in enumerate(zip(turned(0.5 * dtheta), dv, strict=True), 1):
        c = earth @ c @ half
        total += c @ v
        c = earth @ c @ half
        if k % per_step == 0:
            out.append(total / (per_step * dt) - G_N)
            total = np.zeros(3)
    return np.array(out)


def residuals(
    e: Errors, beta0: Floats, lever: Floats | None = None, quad: Floats | None = None, delay_s: float = 0.0
) -> Floats:
    """Of the nonlinear model: an uncalibrated strapdown on what a unit with these errors measures."""
    table = Table(truth.placed(0.3), SHORT)
    d = truth.measured(table, e, 0.01)
    d.dv += unlike_samples(table, np.zeros(3) if quad is None else quad, delay_s)
    if lever is not None:
        middle: Floats = np.arange(len(d.dv), dtype=np.float64) * 0.01 + 0.005
        relative_rate, earth = table.rate(middle), np.einsum("kji,j->ki", table.attitude(middle), U_N)
        rate, turning = relative_rate + earth, np.cross(earth, relative_rate)  # the Earth's rate turns in b
        for i in range(3):
            seen = np.cross(rate, np.cross(rate, lever[i])) + np.cross(turning, lever[i])
            d.dv[:, i] += seen[:, i] * 0.01
    return strapdown(turned(beta0) @ truth.placed(0.3), d.dtheta, d.dv, 0.01, 10)


def unlike_samples(table: Table, quad: Floats, delay_s: float) -> Floats:
    """Increments of velocity of q f^2 and of the force of delay_s ago less that of now, by Simpson's rule."""
    total = np.zeros((round(table.edges[-1] / 0.01), 3))
    for part, weight in ((0.0, 1.0), (0.5, 4.0), (1.0, 1.0)):
        t = np.asarray((np.arange(len(total)) + part) * 0.01, np.float64)
        now, then = (np.einsum("kji,j->ki", table.attitude(at), G_N) for at in (t, t - delay_s))
        total += weight * (then - now + quad * then**2)
    return total * (0.01 / 6.0)


def sensitivities(cfg: SinsConfig) -> Floats:
    """The library's z_a in each step by each state at the start: H Phi ... Phi."""
    s = Sins(cfg, truth.placed(0.3))
    n, moving = s.states, s.rows["nu"].start
    since, out = np.eye(n), []
    for t in turns(SHORT):
        for _ in range(round(t.duration_s / 0.1)):
            s.plan([replace(t, duration_s=0.1)])
            phi, _, h = s.jacobians()
            whole = np.eye(n)
            whole[:moving] = phi
            since = whole @ since
            out.append(h[:3] @ since)
    return np.array(out)


def error_of(block: str, k: int, size: float) -> tuple[Errors, Floats, Floats | None, Floats | None, float]:
    """An instrument with one error."""
    e, beta0, lever, quad, delay_s = Errors(), np.zeros(3), None, None, 0.0
    if block == "beta":
        beta0[k] = size
    elif block == "nu":
        e.nu[k] = size
    elif block == "df":
        e.df[k] = size
    elif block == "theta":
        e.theta.flat[k] = size
    elif block == "gamma":
        e.gamma.flat[k] = size
    elif block == "quad":
        quad = size * np.eye(3)[k]
    elif block == "delay":
        delay_s = size
    else:
        lever = np.zeros((3, 3))
        lever.flat[k] = size
    return e, beta0, lever, quad, delay_s


@pytest.mark.parametrize(
    ("block", "size"),
    [
        ("beta", 1e-4),
        ("nu", 1e-6),
        ("theta", 1e-5),
        ("df", 1e-3),
        ("gamma", 1e-4),
        ("lever", 1e-1),
        ("quad", 1e-5),
        ("delay", 1e-3),
    ],
)
def test_the_jacobians_are_central_differences_of_finite_rotations(block: str, size: float) -> None:
    cfg = SinsConfig(gauge=Gauge.FREE9, lever=9, quad_sd_s2pm=1e-5, delay_sd_s=5e-3)
    got, rows = sensitivities(cfg), sins.state_layout(cfg)[block]
    # Where rates change, their difference of two samples is an acceleration that the reference does not have.
    # The force of a delay ago turned by another rate there.
    steady = np.ones(len(got), bool)
    if block in ("lever", "delay"):
        for edge in (0, 50, 100):
            steady[max(edge - (block == "delay"), 0) : edge + 1] = False  # a negative delay sees what comes
    for k in range(rows.stop - rows.start):
        plus, minus = (residuals(*error_of(block, k, sign * size)) for sign in (1.0, -1.0))
        want = (plus - minus) / (2.0 * size)
        scale = np.max(np.abs(want))
        within = 3e-4
        if block == "lever":  # its acceleration is of half a sample ago; many columns hold the Earth's rate alone
            scale, within = max(scale, 1e-3 * (10 * DEG) ** 2), 1e-3
        assert np.max(np.abs((got[:, :, rows.start + k] - want)[steady])) < within * scale, (block, k)


@pytest.mark.parametrize("delta_deg", [0.0, 2.0])
def test_the_stands_rows_are_central_differences_with_delta_as_a_finite_rotation(delta_deg: float) -> None:
    """z_s = log(Chat exp(delta) C_st') by beta, delta and tau, about a delta of degrees."""
    delta, tau, w = np.array([1.0, -0.7, 0.4]) * delta_deg * DEG, 0.02 if delta_deg else 0.0, 10 * DEG
    cfg = SinsConfig(stand=True, base=True, stand_guard_s=0.2)
    table = Table(truth.placed(), [(X, w, 5.0)])
    s = Sins(cfg, truth.placed())
    s.about(Params(delta_rad=delta, tau_s=tau))
    d = truth.measured(table, Errors(), 0.01)
    t_st = 2.0
    s.stand(t_st, table.attitude(np.array([t_st + tau]))[0] @ turned(delta))
    s.samples(0.0, d.dtheta, d.dv)
    rows, h = s.rows, s.jacobians()[2][3:]
    c = table.attitude(np.array([t_st + tau]))[0]

    def residual(beta: Floats, delta_is: Floats, tau_is: float, eps: Floats) -> Floats:
        c_st = turned(eps) @ table.attitude(np.array([t_st + tau_is]))[0] @ turned(delta_is)
        return rotation_vector(turned(beta) @ c @ turned(delta) @ c_st.T)

    zero, small = np.zeros(3), 1e-5
    for k in range(3):
        d_k = small * np.eye(3)[k]
        for block, plus, minus in (
            ("beta", residual(d_k, delta, tau, zero), residual(-d_k, delta, tau, zero)),
            ("delta", residual(zero, delta + d_k, tau, zero), residual(zero, delta - d_k, tau, zero)),
            ("eps", residual(zero, delta, tau, d_k), residual(zero, delta, tau, -d_k)),
        ):
            # delta x delta / 12 is what a first order of the finite rotation's derivative leaves out.
            left = 1e-6 + (float(delta @ delta) / 6.0 if block == "delta" else 0.0)
            assert h[:, rows[block].start + k] == pytest.approx((plus - minus) / (2 * small), abs=left), block
    late = (residual(zero, delta, tau + small, zero) - residual(zero, delta, tau - small, zero)) / (2 * small)
    assert h[:, rows["tau"].start] == pytest.approx(late, abs=1e-6)
    # beta of the angle's time is that of the first step after the guard, in 2.25 s, less what drifts made of it since.
    lag = 2.25 - t_st - tau
    assert h[:, rows["nu"]] == pytest.approx(-c @ turned(np.array([0.5 * lag * w, 0, 0])) * lag, abs=1e-6)


def test_angles_near_a_change_of_rate_are_left_out_and_others_fit() -> None:
    """A clock shift of 0.12 s, unknown until the reversal, where z_s errs by up to a degree."""
    e = Errors(tau=0.12, delta=np.array([0.01, -0.02, 0.015]))
    table = Table(truth.placed(), [(X, 10 * DEG, 20.0), (X, -10 * DEG, 20.0)])
    d = truth.measured(table, e, 0.01)
    cfg = SinsConfig(stand=True, clone=True, beta_sd_rad=(1e-9,) * 3, tau_sd_s=0.1, stand_interval_s=0.02)
    done = sins.calibrate_unit(cfg, truth.placed(), d.dtheta, d.dv, stand=truth.angles(table, e, 0.02))
    # 0.3 s at either side of the reversal; at the start of the run there is no motion to compare with.
    assert 25 <= done.state.stand_left_out <= 50
    assert done.state.params.tau_s == pytest.approx(0.12, abs=1e-5)
    assert done.state.params.delta_rad == pytest.approx(e.delta, abs=1e-5)
    open_guard = sins.calibrate_unit(
        replace(cfg, stand_guard_s=0.0), truth.placed(), d.dtheta, d.dv, stand=truth.angles(table, e, 0.02)
    )
    assert open_guard.first.nis_stand > 2.0 * done.first.nis_stand


# ---- the filter as a whole


def test_a_known_quadratic_term_and_delay_are_taken_out() -> None:
    """Not in the state, but in the model: nothing is left. 5 ms at 10 deg/s are 9e-3 m/s^2, q up to 3e-3."""
    q, delay_s, table = np.array([1e-5, -2e-5, 3e-5]), 5e-3, Table(truth.placed(0.3), SHORT)
    d = truth.measured(table, Errors(), 0.01)
    d.dv += unlike_samples(table, q, delay_s)
    left = []
    for model in (Params(), Params(quadratic_s2pm=q, delay_s=delay_s)):
        s = Sins(SinsConfig(), truth.placed(0.3))
        s.about(model)
        s.samples(0.0, d.dtheta, d.dv)
        left.append(np.max(np.abs(s.state().innovations[:3])))
    assert left[0] > 0.2, left
    assert left[1] < 2e-3  # where rates change, the force of a delay ago turned by another one
    got = Params(quadratic_s2pm=q, gamma=np.diag([1e-3, 0.0, 0.0])).accelerometers(np.array([[9.0, -9.0, 5.0]]))
    want = np.array([[(9.0 - 1e-5 * 9.0**2) / 1.001, -9.0 + 2e-5 * 9.0**2, 5.0 - 3e-5 * 5.0**2]])
    assert got == pytest.approx(want, abs=5e-6)


@pytest.mark.parametrize("form", list(Form))
def test_a_quadratic_term_and_a_delay_are_found_in_two_passes(form: Form) -> None:
    """In the model they are taken out, so a first pass that subtracts with the wrong sign never gets there."""
    q, delay_s = np.array([1e-5, -2e-5, 3e-5]), 5e-3
    e = truth.drawn(np.random.default_rng(5), kept=())
    table = Table(truth.placed(), truth.article_plan(half_s=90.0))
    d = truth.measured(table, e, 0.01)
    d.dv += unlike_samples(table, q, delay_s)
    cfg = SinsConfig(form=form, clone=True, quad_sd_s2pm=1e-4, delay_sd_s=0.02)
    done = sins.calibrate_unit(cfg, truth.placed(), d.dtheta, d.dv)
    p, sd = done.state.params, np.sqrt(np.diag(done.covariance))
    assert np.all(np.abs(p.quadratic_s2pm - q) < 0.2 * sd[done.rows["quad"]])
    assert abs(p.delay_s - delay_s) < 0.2 * sd[done.rows["delay"]][0]
    assert np.all(sd[done.rows["quad"]] < 5e-6)
    assert sd[done.rows["delay"]][0] < 1e-3


@pytest.mark.parametrize("form", list(Form))
def test_a_run_is_what_dense_joseph_updates_make_of_the_same_rows(form: Form) -> None:
    cfg = SinsConfig(form=form, accel_noise_multiplier=4.0)
    s = Sins(cfg, truth.placed())
    p, x, r = sins.prior_covariance(cfg), np.zeros(24), np.full(3, 0.004**2 / 0.1)
    for t in turns(truth.article_plan(half_s=18.0)):
        for _ in range(round(t.duration_s / 0.1)):
            s.plan([replace(t, duration_s=0.1)])
            phi, q, h = s.jacobians()
            *_, x, p = dense_step(x, p, Step(phi, q, h[:3], np.zeros(3), r))
    assert relative(s.covariance()[1], p) < 1e-9


def test_both_forms_give_the_same_covariance() -> None:
    plan = turns(truth.article_plan(half_s=90.0))
    found = []
    for form in Form:
        s = Sins(SinsConfig(form=form, stand=True, clone=True, lever=3, sample_s=0.05), truth.placed())
        s.plan(plan)
        found.append(s.covariance()[1])
    assert relative(found[1], found[0]) < 1e-7


def test_a_unit_without_noise_is_found_in_two_passes() -> None:
    """Errors of the article's size; what is left is far below what noise would leave."""
    rng = np.random.default_rng(5)
    e = truth.drawn(rng)
    table = Table(truth.placed(), truth.article_plan(half_s=90.0))
    d = truth.measured(table, e, 0.01)
    start = turned(np.array([0.01, -0.012, 0.04])) @ truth.placed()
    done = sins.calibrate_unit(SinsConfig(clone=True), start, d.dtheta, d.dv)
    p, sd = done.state.params, np.sqrt(np.diag(done.covariance))
    left = np.concatenate([p.nu_radps - e.nu, (p.theta - e.theta).ravel(), p.df_mps2 - e.df])
    assert np.all(np.abs(left) < 0.2 * sd[3:18])
    assert np.all(np.abs(rotation_vector(done.state.c_nb @ d.c_end.T)) < 0.2 * sd[:3])
    assert np.all(np.abs(rotation_vector(done.state.c0_nb @ truth.placed().T)) < 0.2 * sd[done.rows["beta0"]])
    measured = np.array([[0.1, -0.2, 0.3]])
    true = np.linalg.solve(np.eye(3) + p.theta, (measured - p.nu_radps).T).T
    assert p.gyros(measured) == pytest.approx(true)
    assert p.accelerometers(measured @ (np.eye(3) + p.gamma).T + p.df_mps2) == pytest.approx(measured)


# ---- gauges


@pytest.mark.parametrize(
    ("gauge", "zero"), [(Gauge.ARTICLE, [(0, 1), (0, 2), (2, 1)]), (Gauge.LOWER, [(0, 1), (0, 2), (1, 2)])]
)
def test_a_gauge_turns_the_instrument_frame_and_nothing_else(gauge: Gauge, zero: list[tuple[int, int]]) -> None:
    rng = np.random.default_rng(2)
    p = Params(theta=rng.normal(0, 1e-2, (3, 3)), gamma=rng.normal(0, 1e-2, (3, 3)), delta_rad=rng.normal(0, 0.02, 3))
    q, r = sins.to_gauge(gauge, p)
    assert [q.gamma[k] for k in zero] == [0.0, 0.0, 0.0]
    assert r @ r.T == pytest.approx(np.eye(3), abs=1e-14)
    for before, after in ((p.gamma, q.gamma), (p.theta, q.theta)):  # the same outputs of the same motion
        assert (np.eye(3) + after) @ r == pytest.approx(np.eye(3) + before, abs=1e-12)
    assert turned(q.delta_rad) == pytest.approx(r @ turned(p.delta_rad), abs=1e-12)
    assert sins.to_gauge(Gauge.FREE9, p)[0].gamma == pytest.approx(p.gamma)


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"nu_sd_radps": float("nan")}, "nu_sd_radps"),
        ({"theta_scale_sd": -1.0}, "theta_scale_sd"),
        ({"accel_noise_mps2_rts": 0.0}, "accel_noise_mps2_rts"),
        ({"latitude_rad": 1.6}, "latitude_rad"),
        ({"step_s": 0.105}, "step_s"),
        ({"lever": 6}, "lever"),
        ({"base": True}, "base"),
        ({"stand": True, "sample_s": 0.001, "step_s": 0.05}, "sample_s"),
    ],
)
def test_a_configuration_that_cannot_be_is_rejected_by_the_name_of_its_field(
    change: dict[str, Any], field: str
) -> None:
    with pytest.raises(Refused) as e:
        Sins(replace(SinsConfig(), **change), truth.placed())
    assert e.value.field == field


def test_the_mean_of_the_accelerometers_is_exact_to_the_third_order_of_a_samples_turn() -> None:
    """5 deg a sample: the second order left out would be 6e-3 m/s^2, the fourth is 1e-6."""
    table = Table(truth.placed(), [(X, 10 * DEG, 40.0)])
    d = truth.measured(table, Errors(), 0.5)
    s = Sins(SinsConfig(sample_s=0.5, step_s=1.0), truth.placed())
    s.samples(0.0, d.dtheta, d.dv)
    x, _ = s.covariance()
    h = s.jacobians()[2][:3]
    assert h @ x == pytest.approx(np.zeros(3), abs=2e-6)
    assert np.max(np.abs(s.state().innovations[:3])) < 2e-3


def test_the_second_pass_takes_the_prior_once() -> None:
    """A tilt of half its prior, at rest: data that are worth as much as the prior must not be counted twice."""
    table = Table(truth.placed(), [(X, 0.0, 5.0)])
    d = truth.measured(table, Errors(df=np.array([0.02, -0.01, 0.03]), gamma=np.diag([0.0, 0.0, 2e-3])), 0.01)
    cfg = SinsConfig(clone=True)
    found = sins.calibrate_unit(cfg, turned(np.array([1e-3, 2e-3, 0.0])) @ truth.placed(), d.dtheta, d.dv)
    once, twice = found.first.params, found.state.params
    assert abs(once.df_mps2[2]) > 1e-2
    assert twice.df_mps2 == pytest.approx(once.df_mps2, rel=2e-2)
    assert np.diag(twice.gamma) == pytest.approx(np.diag(once.gamma), rel=2e-2, abs=1e-7)
    assert found.state.c_nb == pytest.approx(found.first.c_nb, abs=1e-5)


@pytest.mark.parametrize(("gauge", "kept"), [(Gauge.ARTICLE, (0, 3, 4, 5, 6, 8)), (Gauge.LOWER, (0, 3, 4, 6, 7, 8))])
def test_a_gauge_keeps_its_elements(gauge: Gauge, kept: tuple[int, ...]) -> None:
    rows = []
    for g in (gauge, Gauge.FREE9):
        s = Sins(SinsConfig(gauge=g, sample_s=0.05), truth.placed(0.4))
        s.plan(turns(SHORT))
        rows.append(s.jacobians()[2][:3, s.rows["gamma"]])
    assert np.array_equal(rows[0], rows[1][:, list(kept)])
