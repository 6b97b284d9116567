"""Drawn units on three tables, calibrated by each method: the campaign `sins-methods`."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from psabench.campaign.sins_table import BASES, FILTER, SAMPLE_S, Base, Recording, draw_unit, platform_at, record_run
from psabench.campaign.sins_unit import UnitErrors
from psabench.native.nav import ARCMIN, DEGPH, Floats
from psabench.native.sins import Params, calibrate_unit
from psabench.procedures.head_bench import Progress
from psabench.quartz.draws import draw_source
from psabench.sins.covariance import GAMMA_AT, KNOWN, QUANTITIES
from psabench.sins.methods.fourier import calibrate_by_fourier, cycles_of
from psabench.sins.methods.legs import Leg, legs_of
from psabench.sins.methods.positions import calibrate_by_positions
from psabench.sins.plan import RotationPlan, read_plan


@dataclass(frozen=True, slots=True, kw_only=True)
class Method:
    """A way to calibrate."""

    name: str
    plan: str  # of proto/rotation_plans
    needs: str  # of the table
    find: Callable[[Recording], Params]


def _by_positions(r: Recording) -> Params:
    return calibrate_by_positions(r.data, legs_of(r.plan, SAMPLE_S), r.side)


def _by_dwells(r: Recording) -> Params:
    return calibrate_by_positions(r.data, legs_of(r.plan, SAMPLE_S), r.side, turns=False)


def _by_fourier(r: Recording) -> Params:
    legs = legs_of(r.plan, SAMPLE_S)
    along = [float(_axis_n(r.plan, leg) @ r.side.earth_n_radps) for leg in legs]
    return calibrate_by_fourier(r.data, cycles_of(legs, along), float(r.side.gravity_n_mps2[2]))


def _axis_n(plan: RotationPlan, leg: Leg) -> Floats:
    """The table's axis in n: horizontal, at the plan's azimuth, in the sense of the instrument's axis."""
    sense = np.sign(platform_at(plan, np.array([leg.begin_s]))[0][:, leg.axis] @ plan.start_c_nb[:, 0])
    return np.asarray(sense * plan.start_c_nb[:, 0])


def _by_filter(r: Recording, *, stand: bool = False) -> Params:
    cfg = replace(FILTER, gravity_mps2=float(r.side.gravity_n_mps2[2]), stand=stand, base=stand)
    angles = (r.side.t_s[1:-1], r.side.c_st[1:-1]) if stand else None
    start = r.plan.start_c_nb
    return calibrate_unit(cfg, start, r.data.dtheta_rad, r.data.dv_mps, stand=angles).state.params


METHODS = (
    Method(name="six positions alone", plan="six_positions", needs="level, azimuth, angles", find=_by_dwells),
    Method(name="six positions and turns", plan="six_positions", needs="level, azimuth, angles", find=_by_positions),
    Method(name="filter, the same data", plan="six_positions", needs="attitude to degrees", find=_by_filter),
    Method(name="Fourier", plan="article", needs="a steady axis, its azimuth", find=_by_fourier),
    Method(name="filter", plan="article", needs="attitude to degrees", find=_by_filter),
    Method(
        name="filter with angles",
        plan="article",
        needs="angles, attitude to degrees",
        find=partial(_by_filter, stand=True),
    ),
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One method on one table."""

    method: Method
    base: Base
    rms: Mapping[str, float]  # by key of QUANTITIES, in their units, over units and elements
    minutes: float  # of the table
    compute_s: float  # of a unit; no part of the result, which is the same everywhere

    def found(self, key: str) -> bool:
        """Is the error below half of the prior's?"""
        return self.rms[key] < KNOWN * PRIOR[key]


def run_methods(units: int, seed: int, progress: Progress) -> list[Row]:
    """Every method on every table, over the same units. One run of a plan is seen by all methods that take it."""
    plans = {m.plan: read_plan(m.plan) for m in METHODS}
    errors: dict[tuple[str, str], list[Floats]] = {}
    took: dict[tuple[str, str], float] = {}
    with progress.step("units, three tables each", units) as done:
        for unit in range(units):
            drawn = draw_unit(seed, unit)
            for base in BASES:
                runs = {
                    name: record_run(plan, drawn, base, draw_source(seed, f"{name} {base.name} {unit}"))
                    for name, plan in plans.items()
                }
                for m in METHODS:
                    start_s = time.process_time()
                    found = m.find(runs[m.plan])
                    key = m.name, base.name
                    took[key] = took.get(key, 0.0) + time.process_time() - start_s
                    errors.setdefault(key, []).append(error_columns(found, drawn))
            done()
    return [
        Row(
            method=m,
            base=base,
            rms=dict(zip(PRIOR, np.sqrt(np.mean(np.square(errors[m.name, base.name]), axis=0)), strict=True)),
            minutes=plans[m.plan].duration_s / 60.0,
            compute_s=took[m.name, base.name] / units,
        )
        for base in BASES
        for m in METHODS
    ]


def error_columns(found: Params, truth: UnitErrors) -> Floats:
    """Rms over the elements of each column of the article's tables."""
    off = {
        "nu": found.nu_radps - truth.nu_radps,
        "theta": found.theta - truth.theta,
        "df": found.df_mps2 - truth.df_mps2,
        "gamma": found.gamma - truth.gamma,
    }
    rms = []
    for q in QUANTITIES:
        kept = range(off[q.block].size) if q.block != "gamma" else GAMMA_AT[FILTER.gauge]
        chosen = [k for k in kept if q.chosen(*divmod(k, 3))]
        rms.append(q.scale * math.sqrt(float(np.mean(off[q.block].ravel()[chosen] ** 2))))
    return np.array(rms)


PRIOR: Mapping[str, float] = dict(
    zip(
        (q.key for q in QUANTITIES),
        (
            FILTER.nu_sd_radps / DEGPH,
            FILTER.theta_scale_sd,
            FILTER.theta_angle_sd_rad / ARCMIN,
            FILTER.df_sd_mps2,
            FILTER.gamma_scale_sd,
            FILTER.gamma_angle_sd_rad / ARCMIN,
        ),
        strict=True,
    )
)
