"""Accuracy of a calibration before it is done: covariance of the article's filter over a plan of rotations.

`predict_accuracy` is one run of the filter without data; READINGS are the ways to read the article's noise
(docs/procedures/sins.md).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from psabench.native.nav import ARCMIN, DEGPH, Floats
from psabench.native.sins import Gauge, Sins, SinsConfig, prior_covariance
from psabench.sins.plan import RotationPlan, rates_of

SAMPLE_S = 0.05  # of the ideal increments: two a step
EAST_DEG = 25.0  # the axis nearer than this to east: drifts hang on the heading (sources instruments 5.2)
LEAST_CYCLE_S = 300.0
KNOWN = 0.5  # part of its prior that a block may keep before it is called undetermined


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One column of the article's tables."""

    key: str
    label: str
    unit: str
    block: str
    scale: float  # of SI to the unit
    chosen: Callable[[int, int], bool]  # of an element, row and column


def _any_element(_: int, __: int) -> bool:
    return True


def _on_diagonal(i: int, j: int) -> bool:
    return i == j


def _off_diagonal(i: int, j: int) -> bool:
    return i != j


QUANTITIES: tuple[Quantity, ...] = (
    Quantity(key="nu_degph", label="ν", unit="°/h", block="nu", scale=1.0 / DEGPH, chosen=_any_element),
    Quantity(key="theta_ii", label="Θii", unit="", block="theta", scale=1.0, chosen=_on_diagonal),
    Quantity(key="theta_ij_arcmin", label="Θij", unit="′", block="theta", scale=1.0 / ARCMIN, chosen=_off_diagonal),
    Quantity(key="df_mps2", label="Δf", unit="m/s²", block="df", scale=1.0, chosen=_any_element),
    Quantity(key="gamma_ii", label="Γii", unit="", block="gamma", scale=1.0, chosen=_on_diagonal),
    Quantity(key="gamma_ij_arcmin", label="Γij", unit="′", block="gamma", scale=1.0 / ARCMIN, chosen=_off_diagonal),
)
# Tables 1 and 2 as printed.
PRINTED: Mapping[bool, Mapping[str, float]] = {
    False: dict(zip((q.key for q in QUANTITIES), (0.01, 5.1e-7, 0.1, 9e-5, 1.36e-5, 0.1), strict=True)),
    True: dict(zip((q.key for q in QUANTITIES), (0.003, 9.7e-8, 0.05, 7.7e-5, 1.36e-5, 0.05), strict=True)),
}
GAMMA_AT: Mapping[Gauge, tuple[int, ...]] = {
    Gauge.ARTICLE: (0, 3, 4, 5, 6, 8),
    Gauge.LOWER: (0, 3, 4, 6, 7, 8),
    Gauge.FREE9: tuple(range(9)),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading:
    """A way to read the article's noise figures."""

    name: str
    stand: bool
    accel_noise_multiplier: float
    stand_noise_rate_hz: float
    text: str


READINGS: Mapping[str, Reading] = {
    r.name: r
    for r in (
        Reading(name="A", stand=False, accel_noise_multiplier=1.0, stand_noise_rate_hz=1.0, text="as printed"),
        Reading(
            name="B", stand=False, accel_noise_multiplier=4.0, stand_noise_rate_hz=1.0, text="accelerometer noise x 4"
        ),
        Reading(name="A, S1", stand=True, accel_noise_multiplier=1.0, stand_noise_rate_hz=1.0, text="as printed"),
        Reading(
            name="B, S1", stand=True, accel_noise_multiplier=4.0, stand_noise_rate_hz=1.0, text="accelerometers x 4"
        ),
        Reading(
            name="B, S50",
            stand=True,
            accel_noise_multiplier=4.0,
            stand_noise_rate_hz=50.0,
            text="accelerometers x 4, 15″ a sample at 50 Hz",
        ),
    )
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Standard deviations of the elements of one column: root mean square, least, most; the prior's."""

    rms: float
    low: float
    high: float
    prior: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Prediction:
    """What a plan will determine."""

    columns: Mapping[str, Spread]  # by key of QUANTITIES
    sd: Mapping[str, Floats]  # of each block, SI
    covariance: Floats


def predict_accuracy(plan: RotationPlan, cfg: SinsConfig) -> Prediction:
    """One run of the filter without data. Raises Refused."""
    cfg = replace(cfg, sample_s=SAMPLE_S)
    s = Sins(cfg, plan.start_c_nb)
    s.plan(plan.turns)
    p = s.covariance()[1]
    after, before = np.sqrt(np.diag(p)), np.sqrt(np.diag(prior_covariance(cfg)))
    return Prediction(
        columns={q.key: _spread_of(q, cfg.gauge, after[s.rows[q.block]], before[s.rows[q.block]]) for q in QUANTITIES},
        sd={name: after[rows] for name, rows in s.rows.items() if rows.stop > rows.start},
        covariance=p,
    )


def _spread_of(q: Quantity, gauge: Gauge, after: Floats, before: Floats) -> Spread:
    at = {"gamma": GAMMA_AT[gauge], "theta": tuple(range(9))}.get(q.block, (0, 4, 8))
    chosen = np.array([q.chosen(*divmod(k, 3)) for k in at])
    sd = after[chosen] * q.scale
    return Spread(
        rms=float(np.sqrt(np.mean(sd**2))),
        low=float(sd.min()),
        high=float(sd.max()),
        prior=float(before[chosen].max() * q.scale),
    )


def read_as(reading: Reading, cfg: SinsConfig) -> SinsConfig:
    """The configuration with the noise of a reading, with or without the stand."""
    return replace(
        cfg,
        stand=reading.stand,
        accel_noise_multiplier=reading.accel_noise_multiplier,
        stand_noise_rate_hz=reading.stand_noise_rate_hz,
    )


def warnings_of(plan: RotationPlan, cfg: SinsConfig, found: Prediction) -> list[str]:
    """What an operator should know before the run."""
    said = []
    if plan.axis_from_east_deg < EAST_DEG and cfg.beta_sd_rad[2] > ARCMIN:
        said.append(
            f"the table's axis is {plan.axis_from_east_deg:.0f} deg from east: gyro drifts cannot be told from the "
            "heading; turn the table to north +-60 deg, or give the heading to 1'"
        )
    rates = rates_of(plan.turns)
    if cfg.lever and len(rates) < 2:
        said.append("lever arms with one rate merge with the zeros of the accelerometers: use a second rate")
    for q in QUANTITIES:
        c = found.columns[q.key]
        if c.prior > 0.0 and c.high > KNOWN * c.prior:
            said.append(f"{q.label} keeps {c.high / c.prior:.0%} of its prior: the plan does not determine it")
    if plan.duration_s < 3.0 * LEAST_CYCLE_S:
        said.append(f"{plan.duration_s:.0f} s is short: below three cycles of {LEAST_CYCLE_S:.0f} s noise dominates")
    if cfg.stand and cfg.tau_sd_s > cfg.stand_guard_s / 2.0:
        said.append(
            f"the clocks of table and unit may differ by {2 * cfg.tau_sd_s:g} s, more than the {cfg.stand_guard_s:g} s "
            "that are left out around a change of rate"
        )
    return said
