"""Search for the plan of rotations that determines a unit best, within a table's limits and a time.

Several lines of descent at once: each generation changes a line's best plan at random and keeps the best of parent
and children; a line that no longer improves starts again elsewhere. No gradients: the number of turns changes, too.
The same seed gives the same plan on any machine, with any number of processes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from psabench.campaign.workers import Workers
from psabench.native.nav import Floats
from psabench.native.sins import SinsConfig
from psabench.sins.covariance import predict_accuracy
from psabench.sins.plan import RotationPlan
from psabench.sins.planner.draft import Draft, Limits, article_draft, changed_draft, plan_of, random_draft

LINES = 4
CHILDREN = 6  # of each line in a generation
PATIENCE = 15  # generations without a better plan, then a line starts again
FROM_BEST = 0.5  # probability that a line starts again at the best plan so far
TRIES = 200  # of a draft that fits the time
BETTER = 1e-4  # of the score
LONG_STEP_S = (
    0.5  # plans are screened in these: a third of the time, scores shift by 0.0003 without the stand, 0.08 with
)
NEAR = 0.03  # of the best plan's score in long steps: computed again in the filter's own
BLOCKS = ("nu", "theta", "df", "gamma")  # 21 parameters


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """A covariance to compute."""

    number: int
    plan: RotationPlan
    cfg: SinsConfig


def sigmas(plan: RotationPlan, cfg: SinsConfig) -> Floats:
    """Standard deviations of the 21 parameters. Raises Refused."""
    sd = predict_accuracy(plan, cfg).sd
    return np.concatenate([sd[block] for block in BLOCKS])


def compute(task: Task) -> tuple[int, Floats]:
    """The work of a worker."""
    return task.number, sigmas(task.plan, task.cfg)


def score_of(sd: Floats, reference: Floats) -> float:
    """Mean of ln(sigma / sigma of the article's plan): -0.1 is 10 % better in the geometric mean."""
    return float(np.mean(np.log(sd / reference)))


@dataclass(frozen=True, slots=True)
class Scored:
    """A draft and what it is worth in long steps."""

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
    reference: Floats = field(init=False)  # of the article's plan
    best: Draft = field(init=False)
    score: float = 0.0  # of best, in the filter's own steps
    history: list[tuple[int, float]] = field(init=False)  # plans computed and score, after generations that improved it
    computed: int = 0
    _screened: Scored = field(init=False)  # best
    _long: SinsConfig = field(init=False)
    _long_reference: Floats = field(init=False)

    def __post_init__(self) -> None:
        plan = plan_of(article_draft(self.limits), self.limits)
        assert plan is not None  # the command has checked the time
        self._long = replace(self.cfg, step_s=LONG_STEP_S)
        self.reference, self._long_reference = sigmas(plan, self.cfg), sigmas(plan, self._long)
        self.best = article_draft(self.limits)
        self._screened = Scored(0.0, self.best)
        self.history = [(0, 0.0)]

    def run(self, plans: int, workers: Workers, advance: Callable[[], None]) -> None:
        """At least so many plans, in whole generations. What is found stays, whatever ends it."""
        lines = [Line(self._screened)]
        for generation in range(whole_plans(plans) // (LINES * CHILDREN)):
            rng = np.random.default_rng((self.seed, generation))
            self._fill_lines(lines, rng)
            drafts = [self._child(line, rng) for line in lines for _ in range(CHILDREN)]
            scores = self._screen(drafts, workers, advance)
            better = [_select(line, drafts, scores, k * CHILDREN) for k, line in enumerate(lines)]
            self._confirm([line.best for line, b in zip(lines, better, strict=True) if b], workers)
            lines = [line for line in lines if line.idle < PATIENCE]

    def _fill_lines(self, lines: list[Line], rng: np.random.Generator) -> None:
        """A new line starts at the best plan, or at none: its first generation is drawn."""
        while len(lines) < LINES:
            lines.append(Line(self._screened if rng.random() < FROM_BEST else Scored(math.inf, self.best)))

    def _child(self, line: Line, rng: np.random.Generator) -> Draft:
        for _ in range(TRIES):
            drawn = math.isinf(line.best.score)
            draft = random_draft(rng, self.limits) if drawn else changed_draft(line.best.draft, rng, self.limits)
            if plan_of(draft, self.limits) is not None:
                return draft
        return line.best.draft

    def _screen(self, drafts: Sequence[Draft], workers: Workers, advance: Callable[[], None]) -> list[float]:
        """In long steps."""
        scores = [math.inf] * len(drafts)
        for k, sd in workers.map(compute, self._tasks(drafts, self._long)):
            scores[k] = score_of(sd, self._long_reference)
            self.computed += 1
            advance()
        return scores

    def _confirm(self, found: Sequence[Scored], workers: Workers) -> None:
        """Those that may be the best of all, in the filter's own steps."""
        near = [f for f in found if f.score < self._screened.score + NEAR]
        scores = dict(workers.map(compute, self._tasks([f.draft for f in near], self.cfg)))
        for k, f in enumerate(near):
            score = score_of(scores[k], self.reference)
            if score < self.score:
                self.best, self.score, self._screened = f.draft, score, f
        if self.score < self.history[-1][1]:
            self.history.append((self.computed, self.score))

    def _tasks(self, drafts: Sequence[Draft], cfg: SinsConfig) -> list[Task]:
        plans = [plan_of(d, self.limits) for d in drafts]
        return [Task(number=k, plan=p, cfg=cfg) for k, p in enumerate(plans) if p is not None]


def _select(line: Line, drafts: Sequence[Draft], scores: Sequence[float], first: int) -> bool:
    """The best of a parent and its children; whether that is a child."""
    k = first + int(np.argmin(scores[first : first + CHILDREN]))
    line.idle = 0 if scores[k] < line.best.score - BETTER else line.idle + 1
    if scores[k] >= line.best.score:
        return False
    line.best = Scored(scores[k], drafts[k])
    return True


def whole_plans(plans: int) -> int:
    """In whole generations."""
    return math.ceil(plans / (LINES * CHILDREN)) * LINES * CHILDREN
