"""From the store to what a report shows."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence

import numpy as np
import numpy.typing as npt

from psabench.campaign import builds, chains, page, plots
from psabench.campaign.cases import STUDIES
from psabench.campaign.chains import CHAINS
from psabench.campaign.claims import Figures, HoldFigures, checks, claims
from psabench.campaign.page import Campaign
from psabench.campaign.runner import Plan
from psabench.campaign.setup import Setup
from psabench.campaign.store import Rows, Store

REASONS_TOLD = 20  # runs of a case: each is run again for its words
SHOWN = ("R0", "R5n", "R11+", "improved")  # of the readings, in the picture of distributions


def gather(plans: Sequence[Plan], store: Store) -> Campaign:
    """Of plans that are complete: the last is the one asked for, one before it what it is compared with."""
    plan = plans[-1]
    found = {}
    curves: dict[str, Rows] = {}
    for case in plan.cases:
        rows = plan.rows(store, case)
        found[case.study, case.name] = Figures.of(rows) if case.hold is None else HoldFigures.of(rows)
        if case.study == "readings" and case.name in SHOWN:
            curves[case.name] = rows
    # The limits are for the error set as it is, and for chains that compute all of it.
    usual = not CHAINS[plan.chain].emulates and _plain(plan)
    return Campaign(
        facts=_facts(plan),
        cases=plan.cases,
        found=found,
        claims=claims(found) if usual else [],
        checks=checks(found) if usual else [],
        agreements=_agreements(plans, store),
        distribution=plots.distribution(curves) if curves else "",
        refusals=_reasons(plan, store, lambda rows: ~np.isfinite(rows[:, 1])),
        doubts=_reasons(plan, store, lambda rows: rows[:, 4] > 0.0),
    )


def _reasons(plan: Plan, store: Store, chosen: Callable[[Rows], npt.NDArray[np.bool_]]) -> dict[str, int]:
    """In words, with how many runs each: of the first runs of each case that are chosen."""
    found = Counter[str]()
    for case in plan.cases if CHAINS[plan.chain].emulates else ():
        runs = np.flatnonzero(chosen(plan.rows(store, case)))[:REASONS_TOLD].tolist()
        found.update(chains.reasons(plan.wanted(case), runs))
    return dict(found.most_common())


def _plain(plan: Plan) -> bool:
    """Whether the cases are those of the article's error set, without --set."""
    usual = [c for s in {c.study for c in plan.cases} for c in STUDIES[s].cases(Setup())]
    return all(c in usual for c in plan.cases)


def _agreements(plans: Sequence[Plan], store: Store) -> list[page.Agreement]:
    if len(plans) < 2:
        return []
    reference, plan = plans
    compared = [c for c in plan.cases if c.hold is None]
    return [page.agree(c, plan.chain, plan.rows(store, c), reference.rows(store, c)) for c in compared]


def _facts(plan: Plan) -> dict[str, str]:
    chain = CHAINS[plan.chain]
    code = f"{chains.versions()}, build {builds.short(chain.build())}"
    return {"chain": chain.title, "runs": f"{plan.runs} a case", "seed": str(plan.seed), "code": code}
