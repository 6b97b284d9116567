"""Allan deviation of a record, overlapping estimate, IEEE Std 952-1997, annex C.

    s^2(tau) = 1/2 <(m_(k+1) - m_k)^2>,   m_k: means over tau, one after the other

White noise of one-sided density S0 has sqrt(S0 / (2 tau)), a random walk of K per root second K sqrt(tau / 3), a sine
of amplitude A and frequency f A sin^2(pi f tau) / (pi f tau).
"""

from __future__ import annotations

import math

import numpy as np

from psabench.errors import expected
from psabench.link.signals import Floats


def allan_deviation(values: Floats, step_s: float, tau_s: float) -> float:
    """Over tau_s, a whole number of steps, from every pair of neighbouring means. Raises ValueError: too short."""
    m = round(tau_s / step_s)
    if not 1 <= m <= len(values) // 2:
        raise ValueError(expected(f"{step_s:g} to {len(values) // 2 * step_s:g} s", tau_s, "tau_s"))
    sums = np.concatenate([[0.0], np.cumsum(values - values.mean())])
    second = sums[2 * m :] - 2.0 * sums[m:-m] + sums[: -2 * m]
    return float(np.sqrt(np.mean(second**2) / 2.0) / m)


def of_white(density_v_rthz: float, tau_s: float) -> float:
    """Of white noise, one-sided density."""
    return density_v_rthz / math.sqrt(2.0 * tau_s)


def of_walk(walk_v_rts: float, tau_s: float) -> float:
    """Of a random walk."""
    return walk_v_rts * math.sqrt(tau_s / 3.0)


def of_sine(amplitude_v: float, hz: float, tau_s: float) -> float:
    """Of a sine, over all its phases."""
    x = math.pi * hz * tau_s
    return amplitude_v * math.sin(x) ** 2 / x
