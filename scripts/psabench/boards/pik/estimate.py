"""Charge-balance converters PIK, PIK-5, PIK-6: from pulse counts to volt seconds and velocity (article, section 1).

    N = Ent[K integral(Ua dt)],    K = Rr / (RIN UREF TCLK),    Ma K SV = 1

so that a pulse is worth 1/K volt seconds at the input and SV = g/(Ma K) metres a second on an accelerometer with Ma
volts a g. (The article prints Ma K SV = 1 with Ma in V/g: SV is then in g s, and 9.8 m/s^2 a g makes it metres.)
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psabench.link.signals import Floats

COUNTER_BITS = 32  # of the totals in PIK_TOTALS and PIK_TOTAL_Z


def pulse_vs(k_hz_per_v: float) -> float:
    """What a pulse is worth at the input, V s."""
    return 1.0 / k_hz_per_v


def pulse_mps(k_hz_per_v: float, ma_v_per_g: float, g_mps2: float) -> float:
    """SV, what a pulse is worth as a velocity, m/s."""
    return g_mps2 / (ma_v_per_g * k_hz_per_v)


def unwrapped(totals: Sequence[float] | Floats, bits: int = COUNTER_BITS) -> Floats:
    """Totals of a counter that wraps, as if it did not; shape (n,). Steps beyond half its range mislead."""
    t = np.asarray(totals, dtype=np.float64)
    if len(t) == 0:
        return t
    half = 2.0 ** (bits - 1)
    steps = (np.diff(t) + half) % (2.0 * half) - half
    return np.concatenate([t[:1], t[0] + np.cumsum(steps)])


def integral_vs(totals: Sequence[float] | Floats, k_hz_per_v: float) -> Floats:
    """Integral of the input since the first reading, V s, shape (n,)."""
    t = unwrapped(totals)
    return (t - t[:1]) / k_hz_per_v


def velocity_mps(totals: Sequence[float] | Floats, *, k_hz_per_v: float, ma_v_per_g: float, g_mps2: float) -> Floats:
    """Velocity since the first reading, m/s, shape (n,)."""
    return integral_vs(totals, k_hz_per_v) * g_mps2 / ma_v_per_g
