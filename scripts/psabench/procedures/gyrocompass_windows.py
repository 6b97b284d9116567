"""From one window to numbers: its levelling rate, its gimbal angle, whether it counts."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from psabench.estimate.angles import wrapped
from psabench.native import nav
from psabench.procedures.gyrocompass_params import GyrocompassParams
from psabench.procedures.platform_bench import Floats, Window
from psabench.procedures.result import DEG

LEVEL_CODE_RAD = 1e-6  # of beta on the wire: codes of PSA-2, 0.99 urad
OFF_LIMIT_RAD = math.radians(1.0)  # encoder against the angle asked for: beyond it the sensor tells nothing


def s_of(w: Window, *, slope: bool, frozen: bool) -> float:
    """Levelling rate of a window, rad/s: the mean of -m1 beta, or the slope of beta less its integral.

    With the azimuth servo off the platform turns by what the encoder tells, and levelling takes it for a rate: (3).
    """
    s = w.levelling_radps
    rate = nav.window_slope(w.beta_rad, s, w.step_s) if slope else float(s.mean())
    if frozen and len(s) > 1:
        turn_radps = _slope(np.unwrap(w.encoder_rad), w.step_s)
        rate += turn_radps * math.sin(w.mean_gamma_rad)
    return rate


def _slope(x: Floats, step_s: float) -> float:
    """Of a straight line through values a step apart, per second."""
    t = (np.arange(len(x)) - (len(x) - 1) / 2.0) * step_s
    return float(t @ x / (t @ t))


def unsteady(w: Window, p: GyrocompassParams) -> tuple[float, float]:
    """What S errs by where it runs in its window, rad/s, and the standard deviation of that from noise and codes.

    A mean is held against the slope, which what a turn left of beta does not touch; a slope against those of its
    halves, which differ where the rate is not one. What the gimbal still turns, the encoder tells; frozen, S has it.
    """
    n_rad, length_s, count = _step_noise(w.beta_rad), w.length_s, len(w.beta_rad)
    used, steady = s_of(w, slope=p.slope, frozen=p.freeze), s_of(w, slope=True, frozen=True)
    variance = n_rad**2 * w.step_s * (w.m1_per_s + 24.0 / length_s)
    if p.slope:
        steady += float(np.mean([_half(w, k) for k in (0, 1)])) - s_of(w, slope=True, frozen=False)
        variance = n_rad**2 * 36.0 / count
    tilt, e_rad = abs(math.sin(w.mean_gamma_rad)), _step_noise(w.encoder_rad)
    variance += (
        (tilt * e_rad) ** 2 * 12.0 / count + (0.5 * tilt * _code(w.encoder_rad)) ** 2 + (0.3 * LEVEL_CODE_RAD) ** 2
    )
    return used - steady, math.sqrt(variance) / length_s


def _half(w: Window, k: int) -> float:
    """S of the first or the second half of a window, from the slope."""
    n = len(w.beta_rad) // 2
    part = slice(k * n, k * n + n)
    return nav.window_slope(w.beta_rad[part], w.levelling_radps[part], w.step_s)


def _step_noise(x: Floats) -> float:
    """Standard deviation of what is new in each step."""
    return float(np.std(np.diff(x)) / math.sqrt(2.0)) if len(x) > 2 else 0.0


def _code(x: Floats) -> float:
    """The smallest step that the values show, 0: they are all the same."""
    steps = np.abs(np.diff(x))
    return float(steps[steps > 0.0].min()) if steps.any() else 0.0


def s_sd(windows: Sequence[Window], slope: bool) -> float:
    """Standard deviation of S from the noise that the level angles show from step to step, rad/s.

    White noise n of a step leaves n sqrt(m1 dt)/T in the mean of the closed loop, n sqrt(12/N)/T in the slope.
    """
    of = []
    for w in windows:
        n = _step_noise(w.beta_rad)
        of.append(n * math.sqrt(12.0 / len(w.beta_rad) if slope else w.m1_per_s * w.step_s) / w.length_s)
    return float(np.mean(of))


def trusted(w: Window, p: GyrocompassParams) -> float:
    """The gimbal angle of a window, rad."""
    if p.angles == "set":
        return w.set_rad
    return w.set_rad + wrapped(w.mean_encoder_rad - w.set_rad)


def off(w: Window) -> str:
    """Why the encoder of a window contradicts the angle that was asked for, "": it does not."""
    off_rad = wrapped(w.mean_encoder_rad - w.set_rad)
    if abs(off_rad) <= OFF_LIMIT_RAD:
        return ""
    shown, asked = (w.set_rad + off_rad) * DEG, w.set_rad * DEG
    return f"the encoder shows {shown:.2f} deg, not {asked:g}: it is stuck, or the platform did not turn"


def why_not(w: Window) -> tuple[str, ...]:
    """Why a window does not count; (): it does."""
    return (*w.faults, *([off(w)] if off(w) else []))


def sorted_out(windows: Sequence[Window]) -> tuple[list[Window], list[str]]:
    """The windows that count, and a sentence for each of the others."""
    good = [w for w in windows if not why_not(w)]
    notes = [
        f"position {w.number + 1} ({w.set_rad * DEG:g} deg) does not count: {'; '.join(why_not(w))}"
        for w in windows
        if why_not(w)
    ]
    return good, notes


def good_calibration(windows: Sequence[Window], p: GyrocompassParams) -> list[Window]:
    """The window after the run, where there is one and it counts."""
    return sorted_out(windows[len(p.table.sequence_deg) :])[0]
