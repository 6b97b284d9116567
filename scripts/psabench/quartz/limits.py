"""Limits of the quartz campaigns as their reports show them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from psabench.campaign.claims import Check
from psabench.report.page import section, table

# Mean instability at the first cycle over that at the fifth: what the batch is tuned to (instruments 3.5), of 1000
# units and more; and what the article says.
LAW_GAINS = {"zero": (2.2, 0.15), "scale": (1.65, 0.12), "base": (3.2, 0.25)}
ARTICLE = {"zero": ("more than 2", 2.0), "scale": ("1.6", 1.6), "base": ("more than 3", 3.0)}


def verdict_words(found: Sequence[Check], no_limits: str) -> str:
    """One line; no_limits: to what none apply."""
    if not found:
        return f"no limits apply to {no_limits}."
    return f"{sum(c.within for c in found)} of {len(found)} figures lie within their limits."


def outside_lines(found: Sequence[Check]) -> Iterator[str]:
    """For the console, one for each limit that is not kept."""
    for c in found:
        if not c.within:
            yield f"out of limits: {c.what}: expected {c.low:.4g} to {c.high:.4g}, got {c.value:.4g}"


def limits_section(found: Sequence[Check]) -> str:
    """For the page; empty where there are none."""
    if not found:
        return ""
    rows = [[c.what, f"{c.value:.4g}", f"{c.low:.4g}", f"{c.high:.4g}", "" if c.within else "out"] for c in found]
    return section("Limits", table([["", "value", "from", "to", ""], *rows]))
