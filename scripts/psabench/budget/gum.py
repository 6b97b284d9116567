"""Uncertainty budget of an estimate after the GUM (JCGM 100:2008): its components, combined and expanded.

Where limits are among the components the interval is that of their distributions' convolution (JCGM 101, 5.2.2): k = 2
would be too much for one that a rectangle dominates.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from psabench.estimate.uncertainty import Component, Estimate, t_quantile

COVERAGE = 0.9545  # probability of the expanded uncertainty: k = 2 for a normal distribution (GUM G.6.6)
LEAST_NORMAL = 0.05  # of the sum of all limits: a normal part below that is taken as that
POINTS = 400  # of the integral over the characteristic function
STEPS = 30  # of Newton's method, at most


def combined_u(components: Iterable[Component]) -> float:
    """Combined standard uncertainty of components that are independent, GUM eq. (10)."""
    return math.sqrt(sum(c.u**2 for c in components))


def effective_dof(components: Iterable[Component]) -> float:
    """Welch-Satterthwaite, GUM eq. (G.2b); inf where every component is of type B."""
    each = tuple(components)
    spread = sum((c.u**4 / c.dof for c in each if math.isfinite(c.dof)), 0.0)
    return combined_u(each) ** 4 / spread if spread > 0.0 else math.inf


def expanded_u(components: Iterable[Component]) -> float:
    """Half width of the interval that contains the value with probability COVERAGE."""
    each = tuple(components)
    limits = [math.sqrt(3.0) * c.u for c in each if c.rectangular and c.u > 0.0]
    bell = [c for c in each if not c.rectangular]
    bell_u = t_quantile(effective_dof(bell), COVERAGE) * combined_u(bell)
    return _convolved_half_width(bell_u / t_quantile(math.inf, COVERAGE), limits) if limits else bell_u


def _convolved_half_width(sd: float, limits: Sequence[float]) -> float:
    """Of COVERAGE for a normal number and numbers within +- limits: P(|x| < U) = 2/pi int sin(U w)/w phi(w) dw."""
    sd = max(sd, LEAST_NORMAL * sum(limits))
    dw = 8.0 / sd / POINTS
    w = (np.arange(POINTS) + 0.5) * dw
    phi = np.exp(-0.5 * (sd * w) ** 2) * np.prod([np.sinc(a * w / np.pi) for a in limits], axis=0)
    half = math.hypot(sd, *(a / math.sqrt(3.0) for a in limits))  # one standard uncertainty: below the half width
    for _ in range(STEPS):  # P is concave: Newton's steps never pass the solution
        missing = COVERAGE - 2.0 / math.pi * dw * float(np.sin(half * w) / w @ phi)
        step = missing / (2.0 / math.pi * dw * float(np.cos(half * w) @ phi))
        half += step
        if abs(step) < 1e-6 * half:
            break
    return half


def expand_estimate(e: Estimate, added: Iterable[Component]) -> Estimate:
    """The estimate with its scatter (type A) and the components added: its interval becomes +- U = k u_c."""
    components = (Component(name="scatter", u=e.sd, dof=e.dof), *added)
    u_c, dof = combined_u(components), effective_dof(components)
    return replace(e, sd=u_c, dof=dof, ci_half=expanded_u(components), budget=components)
