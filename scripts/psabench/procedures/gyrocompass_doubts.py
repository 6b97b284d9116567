"""Reasons not to trust a heading, and what a reader should know of it."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from psabench.nav import DEGPH, EARTH_RADPS, Flag
from psabench.procedures.gyrocompass_fit import Fit
from psabench.procedures.gyrocompass_windows import good_calibration
from psabench.procedures.platform_bench import Window

RESIDUAL_LIMIT = 4.0  # residuals may be so many times what noise and drift explain
RATE_STEP = 1e-3 * DEGPH  # resolution of a rate on the wire, generously


def doubts_of(f: Fit) -> tuple[str, ...]:
    """Reasons not to trust the heading."""
    c, rows, noise, p = f.compass, f.rows, f.noise, f.params
    found = []
    if Flag.POOR_QUALITY in c.flags:
        seen = math.hypot(c.s, c.c)
        cosine = seen * math.cos(p.latitude_rad)
        would = (
            f"it would be right at latitude {math.degrees(math.acos(cosine)):.2f} deg"
            if cosine <= 1.0
            else "no latitude fits"
        )
        found.append(
            f"the horizontal Earth rate found is {seen:.4f} of U cos({p.latitude_deg:g} deg): {would}, "
            "or rates of different windows do not belong together"
        )
    left = float(np.sqrt(np.mean([r.residual_radps**2 for r in rows])))
    angle = EARTH_RADPS * math.cos(p.latitude_rad) * noise.angle_sd_rad
    expected = math.hypot(noise.gm_sigma_radps, noise.window_sd_radps, angle, EARTH_RADPS * noise.level_sd_rad)
    if len(rows) > 3 and left > RESIDUAL_LIMIT * expected + RATE_STEP:
        found.append(
            f"the rates miss the model by {left / DEGPH:.3g} deg/h rms where {expected / DEGPH:.2g} is expected: "
            "the drift jumped, the vehicle moved, or an angle is wrong"
        )
    if Flag.NOT_CONVERGED in c.flags:
        found.append("the constrained fit did not converge")
    return tuple(found)


def notes_of(f: Fit, windows: Sequence[Window]) -> list[str]:
    """What a reader should know; windows: all of them."""
    c, p = f.compass, f.params
    said = Flag.POOR_QUALITY | Flag.NOT_CONVERGED | Flag.SIMPLIFIED
    raised = [f for f in Flag if f in c.flags]
    notes = [text for f, text in zip(raised, c.warnings, strict=True) if f not in said]
    if p.calibrate_s and not good_calibration(windows, p):
        notes.append(f"the calibration does not count: {'; '.join(windows[-1].faults)}")
    return notes
