"""Uncertainty budget of an estimate after the GUM (JCGM 100:2008): its components, combined and expanded."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace

from psabench.estimate.uncertainty import Component, Estimate, t_quantile

COVERAGE = 0.9545  # probability of the expanded uncertainty: k = 2 for a normal distribution (GUM G.6.6)


def combined_u(components: Iterable[Component]) -> float:
    """Combined standard uncertainty of components that are independent, GUM eq. (10)."""
    return math.sqrt(sum(c.u**2 for c in components))


def effective_dof(components: Iterable[Component]) -> float:
    """Welch-Satterthwaite, GUM eq. (G.2b); inf where every component is of type B."""
    each = tuple(components)
    spread = sum((c.u**4 / c.dof for c in each if math.isfinite(c.dof)), 0.0)
    return combined_u(each) ** 4 / spread if spread > 0.0 else math.inf


def expand_estimate(e: Estimate, added: Iterable[Component]) -> Estimate:
    """The estimate with its scatter (type A) and the components added: its interval becomes +- U = k u_c."""
    components = (Component(name="scatter", u=e.sd, dof=e.dof), *added)
    u_c, dof = combined_u(components), effective_dof(components)
    return replace(e, sd=u_c, dof=dof, ci_half=t_quantile(dof, COVERAGE) * u_c, budget=components)
