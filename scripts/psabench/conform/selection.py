"""Which requirements a run checks, and what it must reach: --only, --min-judged, --require."""

from __future__ import annotations

import argparse
from collections.abc import Sequence

from psabench.conform.coverage import COMPLETE, Goal, Least
from psabench.conform.profile import Variant
from psabench.conform.requirements import Requirement, requirements
from psabench.errors import BadInput, expected


def requirements_of(v: Variant) -> list[Requirement]:
    """Those of a board in a profile, without those of its hosts."""
    return [r for r in requirements() if r.group != "host" and r.applies(v.board, v.profile)]


def selected(v: Variant, only: Sequence[str]) -> list[Requirement]:
    """Those with these ids or prefixes, all without any. Raises BadInput for none."""
    rows = [r for r in requirements_of(v) if not only or r.id.startswith(tuple(only))]
    if not rows:
        raise BadInput(expected(f"ids or prefixes of {v.name} (psabench conform list)", " ".join(only), "--only"))
    return rows


def goal_of(args: argparse.Namespace, rows: Sequence[Requirement]) -> Goal:
    """--min-judged and --require, of these requirements. Raises BadInput."""
    try:
        least = COMPLETE if args.min_judged is None else Least.parse(args.min_judged)
    except ValueError as e:
        raise BadInput(expected("a number of requirements, or 0% to 100%", args.min_judged, "--min-judged")) from e
    goal = Goal(least=least, require=tuple(args.require))
    goal.check_ids([r.id for r in rows])
    return goal


def selection_of(*options: tuple[str, Sequence[str]]) -> str:
    """Options that left requirements out, as they were given."""
    return " ".join(f"{name} {' '.join(words)}" for name, words in options if words)
