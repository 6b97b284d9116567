"""Whether a unit corrects itself at take-off (довыставка, the article on a unit with a satellite receiver), and when.

The article says that an analysis of the estimates decides, not which: limits are ours (E0). Either all checks pass and
what has converged is corrected once, or nothing is touched and each reason is given.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from psabench.errors import expected
from psabench.koi.trust import Evidence, TrustLimits, find_doubts, sd_ratios
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
    climb_mps: float = 2.0  # of an aircraft that has left the ground: the run shows the heading, so it is waited for
    climb_samples: int = 2  # in a row
    wait_s: float = 40.0  # longest, for that


@dataclass
class TakeOffDetector:
    """Fed with ground speed and rate of climb, sample by sample."""

    limits: TakeOffLimits = field(default_factory=TakeOffLimits)
    _slow: tuple[float, float] | None = None  # last time and speed below slow_mps, of enough samples in a row
    _slow_count: int = 0
    _fast_count: int = 0
    _run_s: float | None = None  # since when it is a run
    _climb_count: int = 0

    def take(self, t_s: float, speed_mps: float, climb_mps: float, *, valid: bool = True) -> bool:
        """Whether the aircraft has left the ground at this sample: true once a run."""
        if self._runs(t_s, speed_mps, valid=valid):
            self._run_s, self._climb_count = t_s, 0
        if self._run_s is None:
            return False
        if valid and speed_mps < self.limits.slow_mps:
            self._run_s = None  # it has stopped again
            return False
        self._climb_count = self._climb_count + 1 if valid and climb_mps >= self.limits.climb_mps else 0
        if self._climb_count < self.limits.climb_samples and t_s - self._run_s < self.limits.wait_s:
            return False
        self._run_s = None
        return True

    def _runs(self, t_s: float, speed_mps: float, *, valid: bool) -> bool:
        """Whether a run is seen at this sample: true once a run."""
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


@dataclass(frozen=True, kw_only=True)
class DecisionLimits(TrustLimits):
    """Of the analysis at take-off (E0)."""

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


def decide_correction(
    e: Evidence, taxi: Taxi, limits: DecisionLimits | None = None, heading: str = "beta3"
) -> Decision:
    """The analysis at take-off. Raises ValueError where `heading` is not one of the names."""
    limits = limits or DecisionLimits()
    if heading not in e.names:
        raise ValueError(expected(", ".join(e.names), heading, "state of the heading"))
    ratio = sd_ratios(e)
    reasons = (
        *find_doubts(e, limits, WHERE),
        *_heading_reasons(float(ratio[e.names.index(heading)]), limits),
        *_taxi_reasons(taxi, limits),
    )
    if reasons:
        return Decision(reasons=reasons, take=np.zeros(len(e.names), np.bool_))
    whole = np.array([name.startswith(NAVIGATION) for name in e.names])
    return Decision(reasons=(), take=whole | (ratio < limits.converged))


def _heading_reasons(ratio: float, limits: DecisionLimits) -> Iterator[str]:
    if ratio > limits.heading_ratio:
        yield expected(f"a heading known to {limits.heading_ratio:g} of its prior", f"{ratio:.2f}", WHERE)


def _taxi_reasons(taxi: Taxi, limits: DecisionLimits) -> Iterator[str]:
    for what, count, least in (("turns", taxi.turns, limits.turns), ("stops", taxi.stops, limits.stops)):
        if count < least:
            yield expected(f"{what} during the taxi: {least} or more", count, WHERE)
