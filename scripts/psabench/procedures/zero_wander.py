"""A zero that wanders: positions that are measured again and again tell it, and no interval of a fit contains it."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

import numpy as np

from psabench.estimate.wander import wander_p
from psabench.procedures.head_bench import Reading

FALSE_ALARM = 1e-3  # of a run where nothing is wrong


def wander_doubts(readings: Sequence[Reading], *, drift: bool) -> tuple[str, ...]:
    """Reason not to trust the intervals, (): none. drift: the procedure fits a zero that moves on a straight line."""
    found = {}
    for face, of_face in groupby(readings, key=lambda r: r.face):
        at = [list(g) for _, g in groupby(of_face, key=lambda r: (r.realisation, r.set_deg))]
        u_v, t_s = (np.array([np.mean([getattr(r, name) for r in g]) for g in at]) for name in ("u_v", "t_s"))
        _, position = np.unique([g[0].set_deg for g in at], return_inverse=True)
        p = wander_p(u_v, position, t_s if drift else None)
        if p is not None:
            found[face.value] = p
    low = [face for face, p in found.items() if p * len(found) < FALSE_ALARM]
    if not low:
        return ()
    return (
        f"the zero wanders on face {', '.join(low)}: positions that are measured again are off by more than noise "
        "(p < 0.001), and the intervals do not contain that",
    )
