"""Why a calibration is in doubt: innovations, parameters, attitude at the start, against what the filter expects."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from scipy.spatial.transform import Rotation

from psabench.errors import expected
from psabench.native.nav import Floats
from psabench.native.sins import SinsConfig, State
from psabench.sins.parameters import Parameter

WHITE = 3.3  # standard deviations of a correlation between innovations of neighbouring seconds, 1 in 1000
NIS_SPAN = 3.3  # the same of the mean of value^2/variance
NIS_LEAST = 0.02  # what noise that is given to one part in a hundred does
FAR = 5.0  # standard deviations of its prior that a parameter may be from zero


def doubts_of(
    state: State, innovations: Floats, parameters: Sequence[Parameter], start_c_nb: Floats, cfg: SinsConfig
) -> Iterator[str]:
    """innovations: (seconds, 6), the last of each second, in standard deviations. start_c_nb: the attitude given."""
    yield from _noise_doubts(state.nis_accel, state.nis_stand, len(innovations), cfg)
    yield from _colour_doubts(neighbour_correlation(innovations), len(innovations))
    yield from _parameter_doubts(parameters)
    yield from _attitude_doubts(state.c0_nb @ start_c_nb.T, cfg)


def neighbour_correlation(innovations: Floats) -> Floats:
    """Correlation of each channel with itself a second later; NaN where there is none."""
    found = np.full(innovations.shape[1], np.nan)
    for k, x in enumerate(innovations.T):
        x = x[np.isfinite(x)]
        if len(x) > 2 and x.std() > 0.0:
            found[k] = np.corrcoef(x[:-1], x[1:])[0, 1]
    return found


def _noise_doubts(nis_accel: float, nis_stand: float, seconds: int, cfg: SinsConfig) -> Iterator[str]:
    """Innovations of another size than the filter expects. The table's may be smaller: their noise holds its wobble."""
    span = max(NIS_SPAN * math.sqrt(2.0 / (3 * seconds / cfg.step_s)), NIS_LEAST)
    if abs(nis_accel - 1.0) > span:
        what = "mean of innovation²/variance of the accelerometers"
        yield expected(f"1 ± {span:.3f}", f"{nis_accel:.3f}", what)
    if nis_stand > 1.0 + span:
        yield expected(f"1 ± {span:.3f} or less", f"{nis_stand:.3f}", "the same of the table's angles")


def _colour_doubts(correlation: Floats, seconds: int) -> Iterator[str]:
    limit = WHITE / math.sqrt(seconds)
    for name, x in zip("xyz", correlation[:3], strict=True):
        if abs(x) > limit:
            what = f"innovations of {name} of the accelerometers, a second apart"
            yield expected(f"a correlation within {limit:.3f}", f"{x:.3f}", what)


def _attitude_doubts(turn: Floats, cfg: SinsConfig) -> Iterator[str]:
    """Between the attitude that was given for the start and the one found: about east, north, up."""
    found = Rotation.from_matrix(turn).as_rotvec()
    for name, x, sd in zip(("east", "north", "up: its azimuth"), found, cfg.beta_sd_rad, strict=True):
        if abs(x) > FAR * sd:
            limit, got = f"within {math.degrees(FAR * sd):.1f} deg", f"{math.degrees(x):.1f} deg"
            yield expected(limit, got, f"attitude at the start, error about {name}")


def _parameter_doubts(parameters: Sequence[Parameter]) -> Iterator[str]:
    loose = [p.symbol for p in parameters if not p.determined and p.name != "tau"]
    if loose:
        yield f"not determined by this run: {', '.join(loose)}"
    for p in parameters:
        if abs(p.value) > FAR * p.prior_sd:
            yield expected(f"within {FAR:g} of its prior's {p.prior_sd:.4g} {p.unit}", f"{p.value:.4g}", p.symbol)
