"""The shortest list that still fails: delta debugging (A. Zeller, R. Hildebrandt, "Simplifying and isolating
failure-inducing input", IEEE Trans. Software Eng. 28 (2002) 2, algorithm ddmin). Pure."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

Item = TypeVar("Item")


def shrink_list(items: Sequence[Item], fails: Callable[[Sequence[Item]], bool]) -> tuple[Item, ...]:
    """A part of the items, in their order, that fails, and none of whose items can be left out.

    fails: of the whole list it must be true. Called at most about len(items)**2 times, usually a few times its
    logarithm for each item that stays.
    """
    kept, parts = tuple(items), 2
    while len(kept) > 1:
        size = max(1, len(kept) // parts)
        shorter = next((less for less in _leave_out_each(kept, size) if fails(less)), None)
        if shorter is not None:
            kept, parts = shorter, max(2, parts - 1)
        elif size == 1:
            break
        else:
            parts = min(len(kept), 2 * parts)
    return kept


def _leave_out_each(items: tuple[Item, ...], size: int) -> list[tuple[Item, ...]]:
    """The items without each of their stretches of this size, the first left out first."""
    return [items[:k] + items[k + size :] for k in range(0, len(items), size)]
