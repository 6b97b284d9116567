"""Navigation after a calibration: the article's figures by covariance, and by units that fly the nonlinear
integration."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from psabench.errors import BadInput
from psabench.native.nav_errors import ErrorsConfig
from psabench.native.sins import SinsConfig
from psabench.native.strapdown import State, Strapdown, gravity_mps2, radii_m
from psabench.sins import snake, snake_page
from psabench.sins.covariance import READINGS, read_as
from psabench.sins.flight import Flight, Flown, fly_steps, read_flight, rest_state
from psabench.sins.plan import read_plan
from psabench.sins.snake import PAIRS, Snake, SnakeParams

Floats = np.ndarray
U_RADPS = 7.292115e-5
MC_S = 0.5


@cache
def found() -> Snake:
    return snake.run_snake(SnakeParams())


# An independent simulation of the same flight (psi equations on a sphere): correlated alignment.
@pytest.mark.parametrize(
    ("reading", "rho_m"), [("B", 1909.0), ("B, S50", 1106.0), ("A", 1197.0), ("A, S1", 1150.0)], ids=str
)
def test_the_figures_of_the_flight(reading: str, rho_m: float) -> None:
    assert found().outcomes[reading].rho_m == pytest.approx(rho_m, rel=0.005)


def test_the_article_comes_out_with_the_fourfold_noise_and_not_without() -> None:
    s = found()
    assert s.within
    assert s.outcomes["B"].rho_m == pytest.approx(1900.0, rel=0.03)
    assert s.outcomes["B, S50"].rho_m == pytest.approx(1100.0, rel=0.03)
    assert s.ratio(PAIRS[0]) == pytest.approx(1.7, rel=0.03)
    assert s.ratio(PAIRS[1]) == pytest.approx(1.04, rel=0.03)


def test_an_alignment_that_is_taken_as_independent_is_worse() -> None:
    for outcome in found().outcomes.values():
        assert outcome.uncorrelated_m > 1.15 * outcome.rho_m


def test_the_dominant_term_is_the_drift_of_schuler() -> None:
    """A drift of sd nu on both axes: R nu (t - sin(ws t)/ws), on a straight flight."""
    model, flight = ErrorsConfig(), replace(Flight(), amplitude_deg=0.0)
    p = np.zeros((28, 28))
    nu = math.radians(0.01 / 3600.0)
    p[7:10, 7:10] = np.eye(3) * nu**2
    r_m, ws = 6.39e6, math.sqrt(9.81 / 6.39e6)
    want = math.sqrt(2.0) * r_m * nu * (3600.0 - math.sin(ws * 3600.0) / ws)
    assert snake.rho_at_end(model, fly_steps(flight, MC_S).way(), p) == pytest.approx(want, rel=0.03)


def test_steep_banks_rectify_misalignments() -> None:
    """Why the default turns are gentle: the pitfall in figures."""
    steep = Flight(speed_mps=250.0, amplitude_deg=45.0, period_s=300.0)
    assert steep.bank_deg > 20.0
    assert Flight().bank_deg < 10.0
    p = np.zeros((28, 28))
    p[10:19, 10:19] = np.diag(np.where(np.eye(3) > 0, 0.0, math.radians(0.1 / 60.0) ** 2).ravel())
    far, near = (snake.rho_at_end(ErrorsConfig(), fly_steps(f, 1.0).way(), p) for f in (steep, Flight()))
    assert far > 3000.0
    assert near < 0.5 * far


def test_the_increments_of_a_flight_bring_an_ideal_unit_home() -> None:
    flown = fly_steps(read_flight("snake"), 0.2)
    unit = Strapdown(State.of(flown.states[0]), height_fixed=True)
    unit.advance(flown.dtheta_rad, flown.dv_mps, flown.dt_s)
    assert math.hypot(*end_error(unit.state, flown)) < 10.0


def test_a_flight_is_read_and_refused(tmp_path: Path) -> None:
    assert read_flight("straight").amplitude_deg == 0.0
    for text, word in (
        ("speed_mps: -3", "1 to 1000"),
        ("axes: up up up", "right-handed"),
        ("axes: forward right up", "right-handed"),
        ("velocity: 3", "speed_mps"),
        ("[1]", "speed_mps"),
        ("7", "speed_mps"),
        ("[" * 5000, "a flight in YAML"),
    ):
        path = tmp_path / "f.yaml"
        path.write_text(text, encoding="utf-8")
        with pytest.raises(BadInput, match=word):
            read_flight(str(path))
    with pytest.raises(BadInput, match="no such file"):
        read_flight("loop")


def test_the_report_has_the_figures(tmp_path: Path) -> None:
    page = snake_page.write_page(tmp_path, found())
    text = page.read_text(encoding="utf-8")
    assert "1909" in text
    assert "1.73" in text
    assert (tmp_path / "result.json").stat().st_size > 1000


# ---- units that fly


def end_error(s: State, flown: Flown) -> tuple[float, float]:
    """East, north, m."""
    row = flown.states[-1]
    meridian, vertical = radii_m(row[0], row[2])
    return (s.lon_rad - row[1]) * vertical * math.cos(row[0]), (s.lat_rad - row[0]) * meridian


def fly_unit(flown: Flown, c: Floats, rng: np.random.Generator | None, cfg: ErrorsConfig) -> tuple[float, float]:
    """End of a unit with constants c (21) in the article's gauge: aligned by exact triads, then the nonlinear
    integration."""
    gyro, accel = (cfg.gyro_noise_radps_rts, cfg.accel_noise_mps2_rts) if rng else (0.0, 0.0)
    draw = rng.standard_normal if rng else np.zeros
    nu, theta, df = c[:3], np.eye(3) + c[3:12].reshape(3, 3), c[12:15]
    gamma = np.eye(3)
    for value, (i, j) in zip(c[15:], [(0, 0), (1, 0), (1, 1), (1, 2), (2, 0), (2, 2)], strict=True):
        gamma[i, j] += value
    ground = rest_state(Flight())
    c_bn = ground[6:].reshape(3, 3).T
    u = U_RADPS * np.array([0.0, math.cos(ground[0]), math.sin(ground[0])])
    w = theta @ c_bn @ u + nu + draw(3) * gyro / math.sqrt(600.0)
    f = gamma @ c_bn @ [0.0, 0.0, gravity_mps2(ground[0], 0.0)] + df + draw(3) * accel / math.sqrt(600.0)
    up = f / np.linalg.norm(f)
    east = np.cross(w, up) / np.linalg.norm(np.cross(w, up))
    turn = np.stack([east, np.cross(up, east), up]) @ c_bn  # Chat times C of the rest, transposed
    row = flown.states[0]
    start = State.of(np.concatenate([row[:6], (turn @ row[6:].reshape(3, 3)).ravel()]))
    root = math.sqrt(flown.dt_s)
    unit = Strapdown(start, height_fixed=True)
    unit.advance(
        flown.dtheta_rad @ theta.T + nu * flown.dt_s + draw(flown.dtheta_rad.shape) * gyro * root,
        flown.dv_mps @ gamma.T + df * flown.dt_s + draw(flown.dv_mps.shape) * accel * root,
        flown.dt_s,
    )
    return end_error(unit.state, flown)


@pytest.mark.parametrize("reading", ["B", "B, S50"])
def test_drawn_units_fly_as_far_off_as_the_covariance_says(reading: str) -> None:
    """The spread of the nonlinear ends against rho, within 3 % when the draws' own covariance takes the place of the
    true one; and with noise within three standard deviations of a sample of this size."""
    count, rng = 150, np.random.default_rng(11)
    cfg = SinsConfig()
    model = snake.error_model(cfg)
    quiet = ErrorsConfig(
        gyro_noise_radps_rts=1e-10, accel_noise_mps2_rts=1e-6
    )  # hardly any: the sample's covariance is singular
    sensors = snake.sensors_left(read_plan("article"), read_as(READINGS[reading], cfg))
    flown = fly_steps(Flight(), MC_S)
    ideal = np.array(fly_unit(flown, np.zeros(21), None, model))
    drawn = rng.multivariate_normal(np.zeros(21), sensors, size=count)
    ends = np.array([fly_unit(flown, c, None, model) for c in drawn]) - ideal
    sample = drawn.T @ drawn / count
    rho = snake.rho_at_end(quiet, flown.way(), snake.start_of(quiet, Flight(), sample, 600.0))
    assert np.sqrt((ends**2).sum(axis=1).mean()) == pytest.approx(rho, rel=0.03)
    noisy = np.array([fly_unit(flown, c, rng, model) for c in drawn]) - ideal
    squares = (noisy**2).sum(axis=1)
    want = found().outcomes[reading].rho_m ** 2
    assert squares.mean() == pytest.approx(want, abs=3.0 * squares.std() / math.sqrt(count))
