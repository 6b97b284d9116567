"""Whether a unit corrects itself at take-off (довыставка, the article on a unit with a satellite receiver), and when.

The article says that an analysis of the estimates decides, not which: limits are ours (E0). Either all checks pass and
what has converged is corrected once, or nothing is touched and each reason is given.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from psabench.errors import expected
from psabench.link.signals import Floats

WHERE = "correction at take-off"


@dataclass(frozen=True, kw_only=True)
class TakeOffLimits:
    """When an aircraft takes off (E0)."""

    speed_mps: float = 40.0  # faster than it taxis
    rise_mps2: float = 1.5  # on average since it was slower than `slow_mps`
    slow_mps: float = 20.0
    samples: int = 3  # valid ones in a row, slow as well as fast: an outlier of the receiver is no take-off
    longest_s: float = 120.0  # since it was slow


@dataclass
class TakeOffDetector:
    """Fed with the ground speed of the receiver, sample by sample."""

    limits: TakeOffLimits = field(default_factory=TakeOffLimits)
    _slow: tuple[float, float] | None = None  # last time and speed below slow_mps, of enough samples in a row
    _slow_count: int = 0
    _fast_count: int = 0

    def take(self, t_s: float, speed_mps: float, *, valid: bool = True) -> bool:
        """Whether the aircraft takes off at this sample: true once a run."""
        if not valid or not math.isfinite(speed_mps):
            self._slow_count = self._fast_count = 0
            return False
        slow = speed_mps < self.limits.slow_mps
        self._slow_count = self._slow_count + 1 if slow else 0
        if self._slow_count >= self.limits.samples:
            self._slow = t_s, speed_mps
        self._fast_count = self._fast_count + 1 if self._is_running(t_s, speed_mps) else 0
        if self._fast_count < self.limits.samples:
            return False
        self._slow, self._fast_count = None, 0
        return True

    def _is_running(self, t_s: float, speed_mps: float) -> bool:
        """Fast, and by the acceleration of a run since it was slow."""
        if self._slow is None or speed_mps < self.limits.speed_mps:
            return False
        since_s, rise_mps = t_s - self._slow[0], speed_mps - self._slow[1]
        return 0.0 < since_s <= self.limits.longest_s and rise_mps >= self.limits.rise_mps2 * since_s


@dataclass(frozen=True, slots=True)
class Taxi:
    """What an aircraft did before take-off: that is what makes errors observable."""

    turns: int  # by 60 degrees or more, within 90 s
    stops: int  # of 5 s or more


TURN_RAD, TURN_S = math.radians(60.0), 90.0  # E0, as the next ones
STOP_MPS, STOP_S = 0.3, 5.0


def taxi_of(t_s: Floats, heading_rad: Floats, speed_mps: Floats) -> Taxi:
    """From series before take-off, (n,); samples that are not finite are left out."""
    finite = np.isfinite(t_s) & np.isfinite(heading_rad) & np.isfinite(speed_mps)
    t_s, heading, speed_mps = t_s[finite], np.unwrap(heading_rad[finite]), speed_mps[finite]
    turns, begin = 0, 0
    for k in range(len(t_s)):
        while t_s[k] - t_s[begin] > TURN_S:
            begin += 1
        if np.abs(heading[k] - heading[begin : k + 1]).max() >= TURN_RAD:
            turns, begin = turns + 1, k
    still = np.concatenate([[False], speed_mps < STOP_MPS, [False]])
    begins, ends = np.flatnonzero(still[1:] & ~still[:-1]), np.flatnonzero(~still[1:] & still[:-1]) - 1
    return Taxi(turns, int((t_s[ends] - t_s[begins] >= STOP_S).sum()))


@dataclass(frozen=True, slots=True, kw_only=True)
class Gate:
    """Of one kind of measurement since the filter began."""

    taken: int
    gated: int  # outliers and gated, not those that the device called invalid
    nis_sum: float  # normalised innovations squared of the taken ones
    nis_dof: int


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What the filter knows at take-off; vectors of the state, (n,)."""

    names: tuple[str, ...]
    x: Floats
    sd: Floats
    prior_sd: Floats  # 0: known
    gates: Mapping[str, Gate]  # by kind of measurement
    alone_s: float  # since one was taken
    taxi: Taxi


@dataclass(frozen=True, kw_only=True)
class DecisionLimits:
    """Of the analysis (E0)."""

    kinds: tuple[str, ...] = ("position", "velocity")  # measurements that there must be
    alone_s: float = 5.0
    taken: int = 60  # measurements of each kind
    gated_share: float = 0.05
    nis_chance: float = 1e-4  # of innovations as large or as small as these, if the filter is right
    sigmas: float = 4.0  # of an estimate by its prior
    turns: int = 1
    stops: int = 1
    heading_ratio: float = 0.7  # sd of the heading's error by the prior's
    converged: float = 0.7  # largest sd by the prior's of an estimate that is applied


@dataclass(frozen=True, kw_only=True, eq=False)
class Decision:
    """reasons: why nothing is corrected; none: the states in `take` are, (n,) bool."""

    reasons: tuple[str, ...]
    take: np.ndarray

    @property
    def passed(self) -> bool:
        return not self.reasons


NAVIGATION = ("dr", "dV", "alpha", "beta3")  # blocks that are corrected whole; the others where they have converged


def decide_correction(e: Evidence, limits: DecisionLimits | None = None, heading: str = "beta3") -> Decision:
    """The analysis at take-off. Raises ValueError where `heading` is not one of the names."""
    limits = limits or DecisionLimits()
    if heading not in e.names:
        raise ValueError(expected(", ".join(e.names), heading, "state of the heading"))
    reasons = (*_measurement_reasons(e, limits), *_estimate_reasons(e, limits, heading), *_taxi_reasons(e, limits))
    if reasons:
        return Decision(reasons=reasons, take=np.zeros(len(e.names), np.bool_))
    ratio = _sd_ratios(e)
    whole = np.array([name.startswith(NAVIGATION) for name in e.names])
    return Decision(reasons=(), take=whole | (ratio < limits.converged))


def _sd_ratios(e: Evidence) -> Floats:
    return np.where(e.prior_sd > 0.0, e.sd / np.where(e.prior_sd > 0.0, e.prior_sd, 1.0), 1.0)


def _measurement_reasons(e: Evidence, limits: DecisionLimits) -> Iterator[str]:
    from scipy.special import chdtr, chdtrc  # slow to import

    if not e.alone_s <= limits.alone_s:
        yield expected(f"a measurement in the last {limits.alone_s:g} s", f"the last {e.alone_s:.1f} s ago", WHERE)
    for kind in (k for k in limits.kinds if k not in e.gates):
        yield expected(f"{limits.taken} measurements of {kind} or more", "none", WHERE)
    for kind, gate in e.gates.items():
        if gate.taken < limits.taken:
            yield expected(f"{limits.taken} measurements of {kind} or more", gate.taken, WHERE)
        share = gate.gated / max(gate.taken + gate.gated, 1)
        if share > limits.gated_share:
            yield expected(f"at most {limits.gated_share:.0%} of {kind} outside its gate", f"{share:.1%}", WHERE)
        chance = 2.0 * min(chdtr(gate.nis_dof, gate.nis_sum), chdtrc(gate.nis_dof, gate.nis_sum))
        if not chance >= limits.nis_chance:
            mean = gate.nis_sum / gate.nis_dof if gate.nis_dof else math.nan
            yield expected(f"innovations of {kind} with a mean square near 1", f"{mean:.2f}", WHERE)


def _estimate_reasons(e: Evidence, limits: DecisionLimits, heading: str) -> Iterator[str]:
    finite = np.isfinite(e.x) & np.isfinite(e.sd) & np.isfinite(e.prior_sd)
    if not finite.all():
        yield expected("finite estimates", f"one that is not for {e.names[int(np.argmin(finite))]}", WHERE)
        return
    known = e.prior_sd <= 0.0
    sigmas = np.where(known, np.where(e.x == 0.0, 0.0, np.inf), np.abs(e.x) / np.where(known, 1.0, e.prior_sd))
    worst = int(np.argmax(sigmas))
    if sigmas[worst] > limits.sigmas:
        what = f"estimates within {limits.sigmas:g} standard deviations of their priors"
        yield expected(what, f"{sigmas[worst]:.1f} for {e.names[worst]}", WHERE)
    ratio = float(_sd_ratios(e)[e.names.index(heading)])
    if ratio > limits.heading_ratio:
        yield expected(f"a heading known to {limits.heading_ratio:g} of its prior", f"{ratio:.2f}", WHERE)


def _taxi_reasons(e: Evidence, limits: DecisionLimits) -> Iterator[str]:
    for what, count, least in (("turns", e.taxi.turns, limits.turns), ("stops", e.taxi.stops, limits.stops)):
        if count < least:
            yield expected(f"{what} during the taxi: {least} or more", count, WHERE)
