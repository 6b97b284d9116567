"""Computes what the store lacks of a campaign. Interrupted, it goes on where it was; nothing is computed twice.

The numbers depend on the cases, the seed and the number of runs; not on who computes them, how many at once, or how
often the work was interrupted.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from psabench.campaign import chains
from psabench.campaign.cases import Case
from psabench.campaign.chains import CHAINS, Wanted
from psabench.campaign.store import Origin, Part, Rows, Store
from psabench.campaign.workers import Workers, spread
from psabench.errors import BenchError
from psabench.procedures.head_bench import Progress

TASK_S = 0.4  # of one core: long beside the 2 ms that a Dask task costs, short for a person who waits
ALONE_S = 4.0  # of one core: starting a cluster takes about as long


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Which cases through which chain, how often."""

    cases: Sequence[Case]
    chain: str
    runs: int
    seed: int

    def origin(self, case: Case) -> Origin:
        return chains.origin(self.chain, case.setup, case.hold, self.seed)

    def wanted(self, case: Case, first_run: int = 0, runs: int = 0) -> Wanted:
        """Some runs of a case."""
        part = {"first_run": first_run, "runs": runs}
        return Wanted(chain=self.chain, setup=case.setup, hold=case.hold, seed=self.seed, **part)

    def rows(self, store: Store, case: Case) -> Rows:
        """Of a case that is complete."""
        return store.rows(self.origin(case), self.runs)


def missing(plan: Plan, store: Store) -> list[Wanted]:
    """Parts that the store lacks, each case once however many studies it is in."""
    chain = CHAINS[plan.chain]
    seen: set[str] = set()
    wanted = []
    for case in plan.cases:
        o = plan.origin(case)
        if o.key in seen:
            continue
        seen.add(o.key)
        there = store.runs(o)
        for first in range(0, plan.runs, chain.part_runs):
            runs = min(chain.part_runs, plan.runs - first)
            if there.get(first, 0) < runs:
                wanted.append(plan.wanted(case, first, runs))
    return wanted


def duration_s(wanted: Sequence[Wanted]) -> float:
    """About what they take on one core."""
    return sum(map(_weight_s, wanted))


def _weight_s(w: Wanted) -> float:
    return w.runs * CHAINS[w.chain].run_s


def tasks(wanted: Sequence[Wanted]) -> Iterator[Sequence[Wanted]]:
    """Parts together, so that each task is worth sending."""
    for piece in spread([_weight_s(w) for w in wanted], TASK_S):
        yield wanted[piece]


def run(wanted: Sequence[Wanted], store: Store, workers: Workers, progress: Progress) -> None:
    """Compute and store; what is stored stays, whatever ends it."""
    if not wanted:
        return
    with progress.step(f"{CHAINS[wanted[0].chain].title}, {workers.count} at once", len(wanted)) as done:
        for parts in workers.map(chains.compute, tasks(wanted)):
            _of_this_build(parts, wanted[0])
            store.put(parts)
            for _ in parts:
                done()


def _of_this_build(parts: Sequence[Part], wanted: Wanted) -> None:
    """A part's origin is what its worker says: where the code changed under a campaign, no one would find it again."""
    if any(p.origin.build != wanted.origin.build for p in parts):
        raise BenchError(
            "campaign: psabench was rebuilt during the run, so the workers disagree; start the campaign again"
        )
