"""How often U of a thermal run contains the truth: fresh units through the wire (docs/procedures/thermal.md)."""

from __future__ import annotations

import pytest

from tests.coverage.thermal import runs_of, share_of

pytestmark = pytest.mark.host

SEEDS = range(101, 121)


def test_u_of_fresh_units_contains_the_truth_as_often_as_it_says() -> None:
    """Not less often, and hardly more: a U that counts the mounting twice, or for an axis that it does not move,
    contains every base error. The page has more units, and why U is a little too wide."""
    runs = runs_of("tolerances", SEEDS, 2)
    n, share, (low, high) = share_of(runs)
    print(f"{n} values, {share:.4f} within U, {low:.4f} to {high:.4f} by unit")
    assert n >= 800
    assert 0.94 <= share <= 0.975
    assert high >= 0.9545
    for kind in ("soak base", "sweep-1 base"):
        _, base, _ = share_of(runs, kind)
        assert 0.92 < base < 0.985, kind
