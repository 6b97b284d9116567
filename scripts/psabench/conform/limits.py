"""Figures that a test compares with: always those of a requirement, never a test's own."""

from __future__ import annotations

from psabench.conform.capture.log import Evidence
from psabench.conform.requirements import Requirement, requirements


def row_for(e: Evidence, *ids: str) -> Requirement:
    """The one of these requirements that holds for the variant. Raises ValueError when none does."""
    v = e.variant
    for i in ids:
        row = requirements().rows[i]
        if row.applies(v.board, v.profile):
            return row
    raise ValueError(f"none of {', '.join(ids)} holds for {v.name}")
