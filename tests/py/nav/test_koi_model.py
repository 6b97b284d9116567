"""The integration filter's equations: each column against central differences of the nonlinear strapdown integration on
a flight with turns and climbs, and the matrix against the article's equations written out."""

from __future__ import annotations

import math

import numpy as np
import pytest
from koi_flight import (
    DT_S,
    LEGS,
    Floats,
    Truth,
    error_between,
    errors_of,
    measured,
    moving_of,
    sensors_of,
    t_per_m,
    with_errors,
)
from psabench.native.flight_model import Flight
from psabench.native.koi import Koi, KoiConfig, UnitClass, koi_default, koi_layout, koi_prior
from psabench.native.nav import Refused
from psabench.native.nav_errors import ErrorsConfig
from psabench.native.sins import Gauge
from psabench.native.strapdown import Strapdown, gravity_mps2, radii_m
from psabench.sins.alignment import aligned_state

DEGPH, EARTH_RADPS = math.radians(1.0) / 3600.0, 7.292115e-5
STEPS = {"dr": 100.0, "dV": 0.1, "alpha": 3e-4, "beta3": 3e-4, "vertical": 1.0, "nu": 0.01 * DEGPH, "df": 1e-4}
# dr, dV, alpha, beta3, dr3, dV3: an error counts against the largest of its column in these rows.
SCALES = ((0, 2), (2, 4), (4, 6), (6, 7), (7, 8), (8, 9))
COMPARED_S = 500


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Flight:
    return Flight(LEGS, heading_deg=30.0)


@pytest.fixture(scope="module")
def truth(path: Flight) -> Truth:
    """From the take-off run over a climb, a turn and the next climb."""
    begin_ns = path.leg_ns[9]
    return Truth.of(path, begin_ns, begin_ns + COMPARED_S * 10**9)


def config(gauge: Gauge) -> KoiConfig:
    cfg = koi_default(UnitClass.GOOD)
    cfg.gauge = int(gauge)
    return cfg


def transition(truth: Truth, cfg: KoiConfig) -> Floats:
    """Of a unit without errors over the whole stretch: moving rows."""
    koi, total = Koi(cfg, 0.0, truth.state(0)), np.eye(koi_layout(cfg)["dt"].stop)
    for k in range(0, len(truth), 10):
        koi.push(truth.dtheta_rad[k : k + 10], truth.dv_mps[k : k + 10])
        phi, _ = koi.jacobians()
        total[: len(phi)] = phi @ total
    return total[:9]


def navigated(truth: Truth, cfg: KoiConfig, x: Floats) -> Floats:
    """The moving states after the stretch of a unit that began with the state x."""
    begin, end = truth.state(0), truth.state(len(truth))
    unit = Strapdown(with_errors(begin, errors_of(x[:9], begin)))
    unit.advance(*measured(truth, sensors_of(cfg, x)), DT_S)
    return moving_of(error_between(unit.state, end), end)


def reference(truth: Truth, cfg: KoiConfig) -> Floats:
    """The integration's own error, as a unit without errors has it, cancels in central differences."""
    rows = koi_layout(cfg)
    sizes = np.full(rows["dt"].stop, 1e-5)
    for name, size in STEPS.items():
        sizes[rows[name]] = size
    slopes = np.zeros((9, len(sizes)))
    for k in range(len(sizes)):
        if rows["baro"].start <= k < rows["baro"].stop or k >= rows["dt"].start:
            continue
        x = np.zeros(len(sizes))
        x[k] = sizes[k]
        slopes[:, k] = (navigated(truth, cfg, x) - navigated(truth, cfg, -x)) / (2.0 * sizes[k])
    return slopes


@pytest.mark.parametrize("gauge", [Gauge.ARTICLE, Gauge.FREE9])
def test_every_column_is_the_central_difference_of_the_nonlinear_integration(truth: Truth, gauge: Gauge) -> None:
    """Within 1 % of each column's largest element among the rows of one kind. beta3 is what remains of betaU and t dr1,
    and errs by a part of them."""
    cfg = config(gauge)
    model, slopes = transition(truth, cfg), reference(truth, cfg)
    assert model.shape[1] == (33 if gauge is Gauge.ARTICLE else 36)
    worst = 0.0
    for low, high in SCALES:
        most = np.abs(slopes[low:high]).max(axis=0)
        if low == 6:
            most = np.maximum(most, np.abs(slopes[0]) * t_per_m(truth.state(len(truth))))
        off = np.abs(model - slopes)[low:high].max(axis=0)
        share = off / np.maximum(most, 1e-9)
        share[off < 1e-9] = 0.0
        worst = max(worst, share.max())
        assert share.max() < 0.01, f"rows {low} to {high}: {share.round(4)}"
    print(f"worst column: {worst:.4f}")


def article(truth: Truth, k: int) -> Floats:
    """The horizontal equations on a sphere at interval k, by states dr1 dr2 dV1 dV2 alpha1 alpha2 beta3, then nu1 nu2
    nu3 and Df1 Df2 in n."""
    at = truth.state(k)
    f = at.C_nb @ truth.dv_mps[k] / DT_S
    meridian, vertical = radii_m(at.lat_rad, at.h_m)
    radius = math.sqrt(meridian * vertical)
    v1, v2, _ = at.v_n_mps
    u2, u3 = EARTH_RADPS * math.cos(at.lat_rad), EARTH_RADPS * math.sin(at.lat_rad)
    o1, o2, o3 = -v2 / radius, v1 / radius, v1 * math.tan(at.lat_rad) / radius
    w3, g = 2 * u3 + o3, gravity_mps2(at.lat_rad, at.h_m)
    a = np.zeros((7, 12))
    r1, r2, dv1, dv2, a1, a2, b3, n1, n2, n3, f1, f2 = np.eye(12)
    beta1, beta2 = a1 - r2 / radius, a2 + r1 / radius
    a[6] = (o2 + u2) * beta1 - o1 * beta2 + n3
    a[0] = o3 * r2 + dv1 - v2 * b3
    a[1] = -o3 * r1 + dv2 + v1 * b3
    a[2] = g * a2 + w3 * dv2 + v2 * a[6] + f1 + (f[2] - g) * beta2
    a[3] = -g * a1 - w3 * dv1 - v1 * a[6] + f2 - (f[2] - g) * beta1
    a[4] = (o3 + u3) * a2 - u2 * b3 + u3 * r1 / radius + dv2 / radius + n1
    a[5] = -(o3 + u3) * a1 + u3 * r2 / radius - dv1 / radius + n2
    return a


def test_the_equations_are_the_articles(path: Flight) -> None:
    """In the steep turn, at constant height: (Phi - 1)/dt of a short step. u1 is 0 in n."""
    turn = LEGS.index({"turn_deg": -100, "bank_deg": 30})
    begin_ns = path.leg_ns[turn] + 10 * 10**9
    truth, cfg = Truth.of(path, begin_ns, begin_ns + 10**8), config(Gauge.ARTICLE)
    cfg.step_s = DT_S
    koi = Koi(cfg, 0.0, truth.state(0))
    koi.push(truth.dtheta_rad[:1], truth.dv_mps[:1])
    phi, _ = koi.jacobians()
    c, rows = truth.state(0).C_nb, koi_layout(cfg)
    rates = (phi[:7] - np.eye(len(phi), phi.shape[1])[:7]) / DT_S
    found = np.hstack([rates[:, :7], rates[:, rows["nu"]] @ c.T, (rates[:, rows["df"]] @ c.T)[:, :2]])
    want = article(truth, 0)
    # Sizes of states that matter alike: a mile, m/s, minutes, their drifts.
    size = np.array([1e3, 1e3, 1.0, 1.0, 2e-4, 2e-4, 1e-3, 5e-8, 5e-8, 5e-8, 1e-3, 1e-3])
    least = np.array([1.0, 1.0, 2e-3, 2e-3, 2e-7, 2e-7, 2e-7])
    off = np.abs(found - want) * size / np.maximum(np.abs(want * size).max(axis=1), least)[:, None]
    assert off.max() < 0.01, off.round(4)


def test_the_prior_is_that_of_an_alignment_at_rest(truth: Truth) -> None:
    """The calibration's page makes the same of the same sensors: attitude, and its correlations with them."""
    cfg, at = koi_default(UnitClass.BINS), truth.state(0)
    cfg.dr_sd_m[:] = [0.0] * 3
    p, rows = koi_prior(cfg, at), koi_layout(cfg)
    order = [k for name in ("nu", "theta", "df", "gamma") for k in range(rows[name].start, rows[name].stop)]
    model = ErrorsConfig(
        height_fixed=False,
        gyro_noise_radps_rts=cfg.gyro_noise_radps_rts,
        accel_noise_mps2_rts=cfg.accel_noise_mps2_rts,
    )
    constants = p[np.ix_(order, order)]
    _, full = aligned_state(model, at.row(), np.zeros(len(order)), constants, cfg.alignment_s)
    kept = [4, 5, 6, *order]
    sd = np.sqrt(np.diag(full)[6:])
    assert p[np.ix_(kept, kept)] / np.outer(sd, sd) == pytest.approx(full[6:, 6:] / np.outer(sd, sd), abs=1e-6)
    assert constants.diagonal()[0] == pytest.approx(cfg.nu_sd_radps**2 + cfg.nu_run_radps**2)
    assert abs(p[4, rows["df"].start + 1]) > 0.0


def test_noise_of_the_gyros_moves_the_dynamic_velocity_too(truth: Truth) -> None:
    """Q = T diag(density^2) T' of a step in flight, then the walks."""
    cfg, at = koi_default(UnitClass.BINS), truth.state(40_000)
    koi = Koi(cfg, 0.0, at)
    koi.push(truth.dtheta_rad[40_000:40_010], truth.dv_mps[40_000:40_010])
    to = np.stack([moving_of(row, koi.state.autonomous) for row in np.eye(9)], -1)
    density = np.repeat([0.0, cfg.accel_noise_mps2_rts, cfg.gyro_noise_radps_rts], 3)
    want = np.zeros((13, 13))
    want[:9, :9] = 0.1 * to @ np.diag(density**2) @ to.T
    want[9:, 9:] = 0.1 * np.diag([cfg.baro_walk_m_rts**2] + [cfg.nu_walk_radps_rts**2] * 3)
    _, q = koi.jacobians()
    scale = np.sqrt(np.outer(np.diag(want), np.diag(want)))
    assert q.shape == want.shape
    assert np.abs(want[2, 6]) > 0.0
    assert (np.abs(q - want) <= 1e-9 * scale + 1e-30).all()


def test_a_configuration_out_of_range_is_refused_with_its_field() -> None:
    cfg = config(Gauge.ARTICLE)
    cfg.velocity_sd_mps[1] = 0.0
    with pytest.raises(Refused, match=r"velocity_sd_mps\[1\]"):
        koi_layout(cfg)
    cfg = config(Gauge.ARTICLE)
    cfg.step_s = 0.015
    with pytest.raises(Refused, match="step_s"):
        koi_layout(cfg)


def test_the_state_has_32_elements_without_the_barometers_error_and_35_with_nine_gamma() -> None:
    cfg = config(Gauge.ARTICLE)
    cfg.baro_sd_m = 0.0
    assert koi_layout(cfg)["dt"].stop == 32
    cfg.gauge = int(Gauge.FREE9)
    assert koi_layout(cfg)["dt"].stop == 35
