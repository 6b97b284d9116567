"""Search for the plan of rotations that determines a unit best, within a table's limits and a time.

Several lines of descent at once: each generation changes a line's best plan at random and keeps the best of parent and
children; a line that no longer improves starts again elsewhere. No gradients: the number and order of turns change as well.
The same seed gives the same plan whoever computes, and however many at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from psabench.campaign.workers import Workers
from psabench.native.nav import Floats
from psabench.native.sins import SinsConfig
from psabench.sins.covariance import GAMMA_AT, predict
from psabench.sins.plan import RotationPlan
from psabench.sins.plan_draft import Draft, Limits, article_draft, changed_draft, plan_of, random_draft

LINES = 4
CHILDREN = 6  # of each line in a generation
PATIENCE = 15  # generations without a better plan, then a line starts again
TRIES = 200  # of a draft that fits the time
BETTER = 1e-4  # of the score
BLOCKS = ("nu", "theta", "df", "gamma")  # 21 parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A covariance to compute."""

    number: int
    plan: RotationPlan
    cfg: SinsConfig


def sigmas(plan: RotationPlan, cfg: SinsConfig) -> Floats:
    """Standard deviations of the 21 parameters. Raises Refused."""
    sd = predict(plan, cfg).sd
    return np.concatenate([sd[block] for block in BLOCKS])


def compute(task: Task) -> tuple[int, Floats]:
    """The work of a worker."""
    return task.number, sigmas(task.plan, task.cfg)


def score_of(sd: Floats, reference: Floats) -> float:
    """Mean of ln(sigma / sigma of the article's plan): -0.1 is 10 % better in the geometric mean."""
    return float(np.mean(np.log(sd / reference)))


@dataclass(frozen=True, slots=True)
class Scored:
    """A draft and what it is worth."""

    score: float
    draft: Draft


@dataclass(slots=True)
class Line:
    """A line of descent."""

    best: Scored
    idle: int = 0


@dataclass(slots=True, kw_only=True)
class Search:
    """State of a search; `best` is there from the start, and never gets worse."""

    limits: Limits
    cfg: SinsConfig
    seed: int
    reference: Floats = field(init=False)
    best: Scored = field(init=False)
    history: list[tuple[int, float]] = field(init=False)  # plans computed, score: after each generation with a better one
    computed: int = 0

    def __post_init__(self) -> None:
        assert len(GAMMA_AT[self.cfg.gauge]) == 6
        start = article_draft(self.limits)
        plan = plan_of(start, self.limits)
        assert plan is not None  # the command has checked the time
        self.reference = sigmas(plan, self.cfg)
        self.best = Scored(0.0, start)
        self.history = [(0, 0.0)]

    def run(self, plans: int, workers: Workers, advance: Callable[[], None]) -> None:
        """At least so many plans, in whole generations. What is found stays, whatever ends it."""
        lines: list[Line] = [Line(self.best)]
        generation = 0
        while self.computed < plans:
            rng = np.random.default_rng((self.seed, generation))
            self._fill_lines(lines, rng)
            drafts = [self._child(line, rng) for line in lines for _ in range(CHILDREN)]
            scores = self._scores(drafts, workers, advance)
            for k, line in enumerate(lines):
                self._select(line, drafts[k * CHILDREN :][:CHILDREN], scores[k * CHILDREN :][:CHILDREN])
            lines[:] = [line for line in lines if line.idle < PATIENCE]
            generation += 1
            if self.best.score < self.history[-1][1]:
                self.history.append((self.computed, self.best.score))

    def _fill_lines(self, lines: list[Line], rng: np.random.Generator) -> None:
        """A new line starts at a random plan, which the first generation scores."""
        while len(lines) < LINES:
            lines.append(Line(Scored(math.inf, self._fitting(lambda: random_draft(rng, self.limits)))))

    def _child(self, line: Line, rng: np.random.Generator) -> Draft:
        if math.isinf(line.best.score):
            return self._fitting(lambda: random_draft(rng, self.limits))
        return self._fitting(lambda: changed_draft(line.best.draft, rng, self.limits), line.best.draft)

    def _fitting(self, make: Callable[[], Draft], otherwise: Draft | None = None) -> Draft:
        for _ in range(TRIES):
            if plan_of(draft := make(), self.limits) is not None:
                return draft
        return otherwise or self.best.draft

    def _scores(self, drafts: Sequence[Draft], workers: Workers, advance: Callable[[], None]) -> list[float]:
        """In the order of the drafts, whatever the order in which they come."""
        plans = [plan_of(d, self.limits) for d in drafts]
        tasks = [Task(number=k, plan=p, cfg=self.cfg) for k, p in enumerate(plans) if p is not None]
        scores = [math.inf] * len(drafts)
        for k, sd in workers.map(compute, tasks):
            scores[k] = score_of(sd, self.reference)
            self._keep(Scored(scores[k], drafts[k]))
            advance()
        return scores

    def _keep(self, found: Scored) -> None:
        self.computed += 1
        if (found.score, repr(found.draft)) < (self.best.score, repr(self.best.draft)):
            self.best = found

    def _select(self, line: Line, drafts: Sequence[Draft], scores: Sequence[float]) -> None:
        k = int(np.argmin(scores))
        better = scores[k] < line.best.score - BETTER
        line.idle = 0 if better else line.idle + 1
        if scores[k] < line.best.score:
            line.best = Scored(scores[k], drafts[k])


def whole_plans(plans: int) -> int:
    """In whole generations."""
    return math.ceil(plans / (LINES * CHILDREN)) * LINES * CHILDREN
