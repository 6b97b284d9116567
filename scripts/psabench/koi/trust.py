"""Whether a filter's estimates may be believed: at take-off, and for the passport when the flight is over.

The article says that estimates are analysed and measurements are controlled, not how: limits are ours (E0).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from psabench.errors import expected
from psabench.link.signals import Floats


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """Of one kind of measurement since the filter began."""

    taken: int
    gated: int  # outliers and gated, not those that the device called invalid
    nis_sum: float  # normalised innovations squared of the taken ones
    nis_dof: int

    @property
    def gated_share(self) -> float:
        return self.gated / max(self.taken + self.gated, 1)

    @property
    def nis_mean(self) -> float:
        """By degree of freedom; not a number where none was taken."""
        return self.nis_sum / self.nis_dof if self.nis_dof else math.nan


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What the filter knows at take-off; vectors of the state, (n,)."""

    names: tuple[str, ...]
    x: Floats
    sd: Floats
    prior_sd: Floats  # 0: known
    gates: Mapping[str, Gate]  # by kind of measurement
    alone_s: float  # since one was taken

    def __post_init__(self) -> None:
        """Raises ValueError for vectors of other lengths than the names."""
        for vector in (self.x, self.sd, self.prior_sd):
            if vector.shape != (len(self.names),):
                raise ValueError(expected(f"{len(self.names)} numbers", vector.shape, "evidence of a filter"))


@dataclass(frozen=True, kw_only=True)
class TrustLimits:
    """Of the analysis (E0). Errors of a receiver are coloured: chi-square of their sum says too little."""

    kinds: tuple[str, ...] = ("position", "velocity")  # measurements that there must be
    alone_s: float = 5.0
    taken: int = 60  # measurements of each kind
    gated_share: float = 0.05
    nis_mean: tuple[float, float] = (0.02, 1.3)  # of the taken ones; a receiver may be better than it says
    sigmas: float = 4.0  # of an estimate by its prior


def find_doubts(e: Evidence, limits: TrustLimits, where: str) -> Iterator[str]:
    """Each reason not to believe, as `<where>: expected <what>, got <value>`."""
    yield from _measurement_doubts(e, limits, where)
    yield from _estimate_doubts(e, limits, where)


def sd_ratios(e: Evidence) -> Floats:
    """Standard deviations by those of the prior, (n,); 1 for what is known."""
    return np.where(e.prior_sd > 0.0, e.sd / np.where(e.prior_sd > 0.0, e.prior_sd, 1.0), 1.0)


def _measurement_doubts(e: Evidence, limits: TrustLimits, where: str) -> Iterator[str]:
    if not e.alone_s <= limits.alone_s:
        yield expected(f"a measurement in the last {limits.alone_s:g} s", f"the last {e.alone_s:.1f} s ago", where)
    for kind in limits.kinds:
        gate = e.gates.get(kind, Gate(taken=0, gated=0, nis_sum=0.0, nis_dof=0))
        if gate.taken < limits.taken:
            yield expected(f"{limits.taken} measurements of {kind} or more", gate.taken or "none", where)
        if gate.gated_share > limits.gated_share:
            what = f"at most {limits.gated_share:.0%} of {kind} outside its gate"
            yield expected(what, f"{gate.gated_share:.1%}", where)
        low, high = limits.nis_mean
        if gate.taken and not low <= gate.nis_mean <= high:
            what = f"innovations of {kind} with a mean square of {low:g} to {high:g}"
            yield expected(what, f"{gate.nis_mean:.2f}", where)


def _estimate_doubts(e: Evidence, limits: TrustLimits, where: str) -> Iterator[str]:
    finite = np.isfinite(e.x) & np.isfinite(e.sd) & np.isfinite(e.prior_sd)
    if not finite.all():
        yield expected("finite estimates", f"one that is not for {e.names[int(np.argmin(finite))]}", where)
        return
    known = e.prior_sd <= 0.0
    sigmas = np.where(known, np.where(e.x == 0.0, 0.0, np.inf), np.abs(e.x) / np.where(known, 1.0, e.prior_sd))
    worst = int(np.argmax(sigmas))
    if sigmas[worst] > limits.sigmas:
        what = f"estimates within {limits.sigmas:g} standard deviations of their priors"
        yield expected(what, f"{sigmas[worst]:.1f} for {e.names[worst]}", where)


def trust_weight(gates: Mapping[str, Gate], limits: TrustLimits) -> float:
    """Of a flight without doubts, above 0 to 1 (E0): less for a share outside the gates and for large innovations."""
    worth = [
        (1.0 - gate.gated_share / (2.0 * limits.gated_share)) / max(1.0, gate.nis_mean)
        for gate in (gates[kind] for kind in limits.kinds)
    ]
    return min(worth, default=1.0)
