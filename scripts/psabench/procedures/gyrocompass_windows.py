"""From one window to numbers: its levelling rate, its gimbal angle, whether it counts."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from psabench import nav
from psabench.angles import wrapped
from psabench.procedures.gyrocompass_params import GyrocompassParams
from psabench.procedures.platform_bench import Floats, Window
from psabench.procedures.result import DEG

OFF_LIMIT_RAD = math.radians(1.0)  # encoder against the angle asked for: beyond it the sensor tells nothing


def s_of(w: Window, *, slope: bool, frozen: bool) -> float:
    """Levelling rate of a window, rad/s: the mean of -m1 beta, or the slope of beta less its integral.

    With the azimuth servo off the platform turns by what the encoder tells, and levelling takes it for a rate: (3).
    """
    s = w.levelling_radps
    rate = nav.window_slope(w.beta_rad, s, w.step_s) if slope else float(s.mean())
    if frozen and len(s) > 1:
        turn_radps = _slope(np.unwrap(w.encoder_rad), w.step_s)
        rate += turn_radps * math.sin(float(w.gamma_rad.mean()))
    return rate


def _slope(x: Floats, step_s: float) -> float:
    """Of a straight line through values a step apart, per second."""
    t = (np.arange(len(x)) - (len(x) - 1) / 2.0) * step_s
    return float(t @ x / (t @ t))


def s_sd(windows: Sequence[Window], slope: bool) -> float:
    """Standard deviation of S from the noise that the level angles show from step to step, rad/s.

    White noise n of a step leaves n sqrt(m1 dt)/T in the mean of the closed loop, n sqrt(12/N)/T in the slope.
    """
    of = []
    for w in windows:
        n = float(np.std(np.diff(w.beta_rad)) / math.sqrt(2.0)) if len(w.beta_rad) > 2 else 0.0
        of.append(n * math.sqrt(12.0 / len(w.beta_rad) if slope else w.m1_per_s * w.step_s) / w.length_s)
    return float(np.mean(of))


def trusted(w: Window, p: GyrocompassParams) -> float:
    """The gimbal angle of a window, rad."""
    if p.angles == "set":
        return w.set_rad
    return w.set_rad + wrapped(float(np.unwrap(w.encoder_rad).mean()) - w.set_rad)


def off(w: Window) -> str:
    """Why the encoder of a window contradicts the angle that was asked for, "": it does not."""
    off_rad = wrapped(float(np.unwrap(w.encoder_rad).mean()) - w.set_rad)
    if abs(off_rad) <= OFF_LIMIT_RAD:
        return ""
    shown, asked = (w.set_rad + off_rad) * DEG, w.set_rad * DEG
    return f"the encoder shows {shown:.2f} deg, not {asked:g}: it is stuck, or the platform did not turn"


def sorted_out(windows: Sequence[Window]) -> tuple[list[Window], list[str]]:
    """The windows that count, and a sentence for each of the others."""
    good, notes = [], []
    for w in windows:
        why = [*w.faults, *([off(w)] if off(w) else [])]
        if why:
            notes.append(f"position {w.number + 1} ({w.set_rad * DEG:g} deg) does not count: {'; '.join(why)}")
        else:
            good.append(w)
    return good, notes


def good_calibration(windows: Sequence[Window], p: GyrocompassParams) -> list[Window]:
    """The window after the run, where there is one and it counts."""
    return [w for w in windows[len(p.table.sequence_deg) :] if not w.faults]
