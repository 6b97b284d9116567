"""Pairs of experiments with drawn units: the first calibrates, the second is compensated; how much smaller the errors
become."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from psabench.campaign.sins_unit import Experiment, UnitErrors, draw_pair, run_unit
from psabench.procedures.head_bench import Progress
from psabench.quartz.draws import draw_source
from psabench.sins.secondary.estimate import Secondary, calibrate_outputs, compensate_outputs
from psabench.sins.secondary.outputs import Outputs
from psabench.sins.secondary.run import SecondaryParams


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """One unit, two experiments. Radial errors, the largest of each."""

    first_m: float
    second_m: float
    left_m: float
    nees: float  # of the estimates, over their number: 1 when the covariance is right

    @property
    def factor(self) -> float:
        """Before over after."""
        return self.second_m / self.left_m


def run_pair(e: Experiment, pair: int) -> tuple[Outputs, Outputs, UnitErrors]:
    """What the unit gives out in both experiments, and its errors in the first one."""
    first, second = draw_pair(e, pair)
    return (
        run_unit(e, first, draw_source(e.seed, f"noise {pair} 1")),
        run_unit(e, second, draw_source(e.seed, f"noise {pair} 2")),
        first,
    )


def estimate_pair(e: Experiment, pair: int) -> Pair:
    """As the procedure does it from files."""
    first, second, truth = run_pair(e, pair)
    found = calibrate_outputs(first, e.point, params_of(e).config(), where=f"pair {pair}")
    done = compensate_outputs(found, second, where=f"pair {pair}")
    return Pair(
        first_m=found.errors.radial_m,
        second_m=done.before.radial_m,
        left_m=done.after.radial_m,
        nees=nees_of(found, truth),
    )


def nees_of(found: Secondary, truth: UnitErrors) -> float:
    """Of the constants, over their number."""
    constants = slice(found.rows["nu"].start, len(found.x))
    off = found.x[constants] - truth.constants()
    return float(off @ np.linalg.solve(found.covariance[constants, constants], off) / len(off))


def params_of(e: Experiment) -> SecondaryParams:
    """What an operator of this experiment knows."""
    return SecondaryParams(
        latitude_deg=e.latitude_deg,
        longitude_deg=e.longitude_deg,
        height_m=e.height_m,
        alignment_s=e.alignment_s,
        gyro_noise_degph_rts=e.gyro_noise_degph_rts,
        accel_noise_mps2_rts=e.accel_noise_mps2_rts,
    )


def run_pairs(e: Experiment, count: int, progress: Progress) -> list[Pair]:
    """Pairs 0 to count - 1: each the same whichever others are run."""
    found = []
    with progress.step("pairs of experiments", count) as done:
        for k in range(count):
            found.append(estimate_pair(e, k))
            done()
    return found


def pair_table(pairs: Sequence[Pair]) -> list[list[str]]:
    """A row a pair."""
    rows = [
        [str(k), *(f"{x / 1000.0:.1f}" for x in (p.first_m, p.second_m, p.left_m)), f"{p.factor:.1f}"]
        for k, p in enumerate(pairs)
    ]
    return [["pair", "first, km", "second, km", "after, km", "times less"], *rows]


def pair_words(pairs: Sequence[Pair], repeatability: float) -> str:
    """One line."""
    factors = [p.factor for p in pairs]
    share = sum(f >= 3.0 for f in factors)
    median, percent = np.median(factors), 100.0 * repeatability
    return (
        f"{len(pairs)} pairs, {percent:g} % of change between experiments: {median:.1f} times less in the "
        f"median, at least 3 times in {share} of {len(pairs)}"
    )
