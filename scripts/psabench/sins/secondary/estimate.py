"""Calibration from what a navigating unit gives out on a rate table, its true place being known.

The unit is coarsely calibrated, aligned and navigates while the table turns it. Its errors of place and velocity
follow linear equations (`psabench.native.nav_errors`), whose constants are the sensors' errors: a Kalman filter finds
them. With them the errors of another run are predicted and taken off. Attitudes and rates are coefficients alone.
Pure: arrays in, arrays out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from psabench.errors import BadInput, expected
from psabench.native import nav_errors
from psabench.native.kalman import Kalman
from psabench.native.nav import ARCMIN, DEGPH, Floats
from psabench.native.nav_errors import ErrorsConfig, Way
from psabench.native.sins import Gauge
from psabench.native.strapdown import gravity_mps2, radii_m
from psabench.sins.alignment import aligned_state
from psabench.sins.correction import Correction
from psabench.sins.covariance import GAMMA_AT
from psabench.sins.secondary.outputs import Outputs, Point, check_axes

UPDATE_S = 1.0  # between measurements
SHOWN_S = 10.0  # between points of a compensated run
# At this size the equations of the first order miss the errors by 2 % (docs/procedures/sins_secondary.md).
LINEAR_M = 60_000.0
# Innovations of a unit that follows the equations stay far below 1: what it gives out is smooth, place_sd_m and
# velocity_sd_mps leave room for the second order. Above this they do not describe it.
NIS_MOST = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondaryConfig:
    """Priors of a coarsely calibrated unit, and noise of what it gives out. All E0."""

    gauge: Gauge = Gauge.ARTICLE
    place_sd_m: float = 1.0
    velocity_sd_mps: float = 0.01
    level_sd_rad: float = 2.0 * ARCMIN
    heading_sd_rad: float = 20.0 * ARCMIN
    nu_sd_radps: float = 0.1 * DEGPH
    theta_scale_sd: float = 1e-4
    theta_angle_sd_rad: float = ARCMIN
    df_sd_mps2: float = 5e-3
    gamma_scale_sd: float = 5e-4
    gamma_angle_sd_rad: float = ARCMIN
    alignment_s: float = 600.0  # of the unit, before it navigates
    gyro_noise_radps_rts: float = 0.1 * DEGPH
    accel_noise_mps2_rts: float = 1e-3

    def error_model(self) -> ErrorsConfig:
        """The error model with a fixed vertical: a table does not rise."""
        return ErrorsConfig(
            gauge=self.gauge,
            gyro_noise_radps_rts=self.gyro_noise_radps_rts,
            accel_noise_mps2_rts=self.accel_noise_mps2_rts,
        )

    def prior_sd(self) -> Floats:
        """Of all states."""
        theta = np.where(np.eye(3) > 0, self.theta_scale_sd, self.theta_angle_sd_rad).ravel()
        gamma = np.where(np.eye(3) > 0, self.gamma_scale_sd, self.gamma_angle_sd_rad).ravel()
        return np.concatenate(
            [
                [self.place_sd_m] * 2,
                [self.velocity_sd_mps] * 2,
                [self.level_sd_rad] * 2,
                [self.heading_sd_rad],
                [self.nu_sd_radps] * 3,
                theta,
                [self.df_sd_mps2] * 3,
                gamma[list(GAMMA_AT[self.gauge])],
            ]
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Errors:
    """Of what a unit gave out, against the table's place: east and north."""

    t_s: Floats
    place_m: Floats  # (n, 2)
    velocity_mps: Floats  # (n, 2)

    @property
    def radial_m(self) -> float:
        """The largest."""
        return float(np.hypot(*self.place_m.T).max())


@dataclass(frozen=True, slots=True, kw_only=True)
class Secondary:
    """What one run says of the sensors."""

    config: SecondaryConfig
    point: Point
    rows: Mapping[str, slice]
    x: Floats
    covariance: Floats
    nis: float  # mean of value^2/variance of the measurements: 1 when model and noise are right
    errors: Errors
    warnings: tuple[str, ...] = field(default=())

    def correction(self) -> Correction:
        """For `psabench nav`."""
        gamma = np.zeros(9)
        gamma[list(GAMMA_AT[self.config.gauge])] = self.x[self.rows["gamma"]]
        return Correction(
            nu_radps=self.x[self.rows["nu"]],
            theta=self.x[self.rows["theta"]].reshape(3, 3),
            df_mps2=self.x[self.rows["df"]],
            gamma=gamma.reshape(3, 3),
        )

    def sd(self, block: str) -> Floats:
        """Standard deviations of a block."""
        return np.asarray(np.sqrt(np.diag(self.covariance)[self.rows[block]]))


@dataclass(frozen=True, slots=True, kw_only=True)
class Compensated:
    """Another run, before and after."""

    before: Errors
    after: Errors
    predicted_sd_m: Floats  # (n, 2) of what is left, if no sensor has changed since the calibration

    @property
    def factor(self) -> float:
        """Largest radial error before over after."""
        return self.before.radial_m / self.after.radial_m


def errors_of(outputs: Outputs, point: Point) -> Errors:
    """Place and velocity less the true ones."""
    meridian, vertical = radii_m(point.lat_rad, point.h_m)
    east = (outputs.lon_rad - point.lon_rad) * vertical * math.cos(point.lat_rad)
    place = np.column_stack([east, (outputs.lat_rad - point.lat_rad) * meridian])
    return Errors(t_s=outputs.t_s, place_m=place, velocity_mps=outputs.v_mps)


def way_of(outputs: Outputs, point: Point) -> Way:
    """The table's point at rest with the unit's own attitudes and rates; the force is that which holds it there."""
    n = len(outputs) - 1
    c_nb, w_b = outputs.c_nb[:-1], outputs.w_b_radps[1:]
    up_b = c_nb[:, 2, :]
    half = 0.5 * outputs.dt_s * w_b
    turned = up_b - np.cross(half, up_b)
    turned /= np.linalg.norm(turned, axis=1)[:, None]
    place = np.tile([point.lat_rad, point.lon_rad, point.h_m, 0.0, 0.0, 0.0], (n, 1))
    return Way(
        dt_s=outputs.dt_s,
        states=np.hstack([place, c_nb.reshape(n, 9)]),
        w_b_radps=w_b,
        f_b_mps2=gravity_mps2(point.lat_rad, point.h_m) * turned,
    )


def check_linear(errors: Errors, where: object) -> None:
    """Raises BadInput for a unit whose errors are beyond the equations of the first order."""
    if errors.radial_m > LINEAR_M:
        raise BadInput(
            expected(
                f"navigation errors of {LINEAR_M / 1000:g} km at most, where the error equations are linear",
                f"{errors.radial_m / 1000:.0f} km: calibrate the unit coarsely first, from raw data",
                where,
            )
        )


def check_fit(nis: float, where: object) -> None:
    """Raises BadInput for outputs that do not follow the equations: jumps, errors beyond the first order."""
    if not nis <= NIS_MOST:
        got = f"{nis:.1f}: a jump, or errors too large for a linear model"
        raise BadInput(expected(f"innovations of a mean square of {NIS_MOST:g} variances at most", got, where))


def calibrate_outputs(
    outputs: Outputs, point: Point, cfg: SecondaryConfig | None = None, *, where: object = "outputs"
) -> Secondary:
    """The sensors' errors from one run. Raises BadInput for errors that are not linear."""
    cfg = cfg or SecondaryConfig()
    check_axes(outputs, where)
    errors = errors_of(outputs, point)
    check_linear(errors, where)
    model, way, sd = cfg.error_model(), way_of(outputs, point), cfg.prior_sd()
    rows = nav_errors.error_layout(model)
    kf = Kalman(np.zeros(len(sd)), np.diag(sd**2), rows["nu"].start)
    each = max(round(UPDATE_S / way.dt_s), 1)
    h = np.eye(4, len(sd))
    variance = np.array([cfg.place_sd_m**2] * 2 + [cfg.velocity_sd_mps**2] * 2)
    z = np.hstack([errors.place_m, errors.velocity_mps])
    squares = []
    for first in range(0, len(way) - each + 1, each):
        nav_errors.predict_errors(model, kf, way.part(first, first + each))
        squares.append(kf.update(h, z[first + each], variance))
    nis = float(np.mean([s[:, 0] ** 2 / s[:, 1] for s in squares]))
    check_fit(nis, where)
    p = kf.p
    return Secondary(
        config=cfg,
        point=point,
        rows=rows,
        x=kf.x,
        covariance=p,
        nis=nis,
        errors=errors,
        warnings=tuple(_warnings_of(rows, np.sqrt(np.diag(p)) / sd)),
    )


def _warnings_of(rows: Mapping[str, slice], left: Floats) -> list[str]:
    """Blocks that keep most of their prior; the common scale of the accelerometers needs a vertical channel."""
    said = []
    for name in ("nu", "theta", "df"):
        most = float(left[rows[name]].max())
        if most > 0.5:
            said.append(f"{name} keeps {most:.0%} of its prior: the run does not determine it")
    return said


def compensate_outputs(found: Secondary, outputs: Outputs, *, where: object = "outputs") -> Compensated:
    """Errors that the constants predict are taken off another run's. Raises BadInput for errors that are not linear.

    The run starts at the table's point after an alignment at rest, whose error follows from the same constants."""
    check_axes(outputs, where)
    before = errors_of(outputs, found.point)
    check_linear(before, where)
    model, way = found.config.error_model(), way_of(outputs, found.point)
    constants = slice(found.rows["nu"].start, len(found.x))
    x, p = found.x[constants], found.covariance[constants, constants]
    kf = Kalman(*aligned_state(model, way.states[0], x, p, found.config.alignment_s), constants.start)
    each = max(round(SHOWN_S / way.dt_s), 1)
    at = list(range(0, len(way) + 1, each))
    predicted, sd = [kf.x[:4]], [np.sqrt(np.diag(kf.p)[:2])]
    for first in at[:-1]:
        nav_errors.predict_errors(model, kf, way.part(first, first + each))
        predicted.append(kf.x[:4])
        sd.append(np.sqrt(np.diag(kf.p)[:2]))
    off = np.array(predicted)
    shown = Errors(t_s=before.t_s[at], place_m=before.place_m[at], velocity_mps=before.velocity_mps[at])
    after = Errors(t_s=shown.t_s, place_m=shown.place_m - off[:, :2], velocity_mps=shown.velocity_mps - off[:, 2:])
    return Compensated(before=shown, after=after, predicted_sd_m=np.array(sd))
