"""A plan of rotations as the search changes it: each draft is one that a table can make within its limits.

Axis 1 of the table is horizontal; axes 2 and 3 turn by whole quarters, so that an axis of the instrument always lies
along axis 1 (docs/instruments.md has the order of the axes). What the table lacks of axes 2 and 3 a person replaces by
mounting the unit again.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from psabench.sins.plan import RotationPlan, plan_of_dict
from psabench.sins.table import AXES, axis_directions

GRID_S = 0.1  # of durations: a step of the filter
LEAST_LEG_S = 5.0
MOST_LEGS = 40
QUARTER_DEG = 90.0
MOST_QUARTERS = 400
PlanDict = dict[str, Any]  # as a file has it


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """Of a table, and of the time that a calibration may take."""

    axes: int = 3
    max_rate_degps: float = 10.0
    azimuths_deg: tuple[float, ...] = (0.0,)
    budget_s: float = 2718.0
    remount_s: float = 300.0  # of a person, for each turn that the table cannot make


@dataclass(frozen=True, slots=True, kw_only=True)
class Leg:
    """A turn of one axis of the table."""

    axis: int  # from 1
    rate: float  # of the most that the table can, -1 to 1; 0: at rest, of axis 1 alone
    share: float = 1.0  # axis 1: of the time that the other axes leave
    quarters: int = 1  # axes 2 and 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """What the search changes."""

    azimuth_deg: float
    legs: tuple[Leg, ...]


def plan_dict(draft: Draft, limits: Limits) -> PlanDict | None:
    """As a file has it. None: the time does not suffice, or two axes of the table coincide."""
    spent_s = sum(_inner_s(leg, limits) for leg in draft.legs if leg.axis > 1)
    shares = [leg.share for leg in draft.legs if leg.axis == 1]
    left_s = limits.budget_s - spent_s
    if not shares or len(draft.legs) > MOST_LEGS or left_s * min(shares) / sum(shares) < LEAST_LEG_S:
        return None
    turns, at = [], [0] * AXES
    for leg in draft.legs:
        if leg.axis == AXES and at[1] % 2:  # it lies along axis 1, and sins.table gives the turn to that one
            return None
        turns.append(_turn_of(leg, at, left_s * leg.share / sum(shares), limits))
        if leg.axis > 1:
            at[leg.axis - 1] += leg.quarters * int(math.copysign(1, leg.rate))
    return {"axis_azimuth_deg": draft.azimuth_deg, "turns": turns}


def plan_of(draft: Draft, limits: Limits) -> RotationPlan | None:
    """None as for plan_dict."""
    found = plan_dict(draft, limits)
    return None if found is None else plan_of_dict(found, "search", "best")


def time_of(plan: RotationPlan, limits: Limits) -> float:
    """With the time of a person."""
    return plan.duration_s + limits.remount_s * sum(t.remount for t in plan.turns)


def _inner_s(leg: Leg, limits: Limits) -> float:
    if leg.axis > limits.axes:
        return limits.remount_s
    return _grid_up(QUARTER_DEG * leg.quarters / (abs(leg.rate) * limits.max_rate_degps))


def _grid_up(for_s: float) -> float:
    return round(math.ceil(for_s / GRID_S - 1e-9) * GRID_S, 1)


def _turn_of(leg: Leg, quarters_at: Sequence[int], for_s: float, limits: Limits) -> dict[str, object]:
    """As in a file; the sense is that of the instrument's axis."""
    axis, sense = _along(leg.axis, quarters_at)
    if leg.axis == 1:
        rate, for_s = leg.rate * limits.max_rate_degps, round(math.floor(for_s / GRID_S + 1e-9) * GRID_S, 1)
        return {"axis": axis, "rate_degps": sense * round(rate, 3), "for_s": for_s}
    remount = leg.axis > limits.axes  # in no time of the filter: rate and time give the angle alone
    for_s = _grid_up(QUARTER_DEG * leg.quarters / limits.max_rate_degps) if remount else _inner_s(leg, limits)
    rate = math.copysign(QUARTER_DEG * leg.quarters / for_s, leg.rate)
    return {"axis": axis, "rate_degps": sense * rate, "for_s": for_s} | ({"remount": True} if remount else {})


def _along(axis: int, quarters_at: Sequence[int]) -> tuple[str, int]:
    """Which axis of the instrument lies along this one of the table, and its sense."""
    direction = axis_directions(*(math.pi / 2 * quarters_at[k] for k in (1, 2)))[axis - 1]
    k = int(np.argmax(np.abs(direction)))
    return f"z{k + 1}", 1 if direction[k] > 0 else -1


# ---- where a search starts

ARTICLE_RATE_DEGPS = 10.0
TO_Z2, TO_Z3 = Leg(axis=3, rate=-1.0), Leg(axis=2, rate=1.0)


def article_draft(limits: Limits) -> Draft:
    """The article's three cycles in this time, at its rate or what the table can."""
    rate = min(1.0, ARTICLE_RATE_DEGPS / limits.max_rate_degps)
    cycle = (Leg(axis=1, rate=rate), Leg(axis=1, rate=-rate))
    between = (replace(TO_Z2, rate=-rate), replace(TO_Z3, rate=rate))
    return Draft(azimuth_deg=limits.azimuths_deg[0], legs=(*cycle, between[0], *cycle, between[1], *cycle))


def random_draft(rng: np.random.Generator, limits: Limits) -> Draft:
    """Three to six cycles of one to four legs, quarters between them."""
    legs: list[Leg] = []
    for _ in range(int(rng.integers(3, 7))):
        sense = _sense(rng)
        for k in range(int(rng.integers(1, 5))):
            legs.append(Leg(axis=1, rate=sense * (-1.0) ** k, share=float(rng.uniform(0.3, 1.0))))
        legs.append(Leg(axis=int(rng.integers(2, 4)), rate=_sense(rng), quarters=int(rng.integers(1, 3))))
    return Draft(azimuth_deg=float(rng.choice(limits.azimuths_deg)), legs=tuple(legs[:-1]))


def _sense(rng: np.random.Generator) -> float:
    return float(rng.choice((-1.0, 1.0)))


# ---- steps of a search


def changed_draft(draft: Draft, rng: np.random.Generator, limits: Limits) -> Draft:
    """One to three changes."""
    for _ in range(int(rng.integers(1, 4))):
        change = CHANGES[int(rng.integers(len(CHANGES)))]
        draft = change(draft, rng, limits)
    return draft


def _with(draft: Draft, at: int, *legs: Leg) -> Draft:
    return replace(draft, legs=(*draft.legs[:at], *legs, *draft.legs[at + 1 :]))


def _pick(draft: Draft, rng: np.random.Generator) -> int:
    return int(rng.integers(len(draft.legs)))


def _change_share(draft: Draft, rng: np.random.Generator, _: Limits) -> Draft:
    at = _pick(draft, rng)
    leg = draft.legs[at]
    return _with(draft, at, replace(leg, share=leg.share * math.exp(rng.normal(0.0, 0.4))))


def _change_quarters(draft: Draft, rng: np.random.Generator, limits: Limits) -> Draft:
    """Of axes 2 and 3: by one, or by many for a cycle about such an axis."""
    inner = [k for k, leg in enumerate(draft.legs) if 1 < leg.axis <= limits.axes]
    if not inner:
        return draft
    at = inner[int(rng.integers(len(inner)))]
    leg = draft.legs[at]
    step = int(rng.integers(-2, 3)) if rng.random() < 0.7 else int(rng.integers(-20, 40))
    return _with(draft, at, replace(leg, quarters=min(max(leg.quarters + step, 1), MOST_QUARTERS)))


def _change_rate(draft: Draft, rng: np.random.Generator, _: Limits) -> Draft:
    at = _pick(draft, rng)
    size = 1.0 if rng.random() < 0.5 else float(rng.uniform(0.05, 1.0))
    return _with(draft, at, replace(draft.legs[at], rate=math.copysign(size, draft.legs[at].rate)))


def _reverse(draft: Draft, rng: np.random.Generator, _: Limits) -> Draft:
    at = _pick(draft, rng)
    return _with(draft, at, replace(draft.legs[at], rate=-draft.legs[at].rate))


def _split(draft: Draft, rng: np.random.Generator, _: Limits) -> Draft:
    """A leg of axis 1 in two, the second in either sense."""
    at = _pick(draft, rng)
    leg = draft.legs[at]
    if leg.axis > 1:
        return draft
    part = float(rng.uniform(0.2, 0.8))
    second = leg.rate * _sense(rng)
    return _with(
        draft, at, replace(leg, share=leg.share * part), replace(leg, rate=second, share=leg.share * (1 - part))
    )


def _insert(draft: Draft, rng: np.random.Generator, _: Limits) -> Draft:
    at = _pick(draft, rng)
    new = Leg(axis=int(rng.integers(1, AXES + 1)), rate=_sense(rng), share=float(rng.uniform(0.1, 1.0)))
    return _with(draft, at, draft.legs[at], new)


def _remove(draft: Draft, rng: np.random.Generator, _: Limits) -> Draft:
    return _with(draft, _pick(draft, rng)) if len(draft.legs) > 1 else draft


def _swap(draft: Draft, rng: np.random.Generator, _: Limits) -> Draft:
    a, b = _pick(draft, rng), _pick(draft, rng)
    legs = list(draft.legs)
    legs[a], legs[b] = legs[b], legs[a]
    return replace(draft, legs=tuple(legs))


def _turn_table(draft: Draft, rng: np.random.Generator, limits: Limits) -> Draft:
    return replace(draft, azimuth_deg=float(rng.choice(limits.azimuths_deg)))


CHANGES = (
    _change_share,
    _change_share,
    _change_quarters,
    _change_rate,
    _reverse,
    _split,
    _insert,
    _remove,
    _swap,
    _turn_table,
)


# ---- a plan as a file


def plan_text(found: PlanDict, comments: Iterable[str]) -> str:
    """YAML that `--plan` reads: the same turns to the last bit."""
    lines = [*(f"# {c}" for c in comments), f"axis_azimuth_deg: {found['axis_azimuth_deg']!r}", "turns:"]
    return "\n".join([*lines, *(f"  - {{{_words(t)}}}" for t in found["turns"])]) + "\n"


def _words(turn: Mapping[str, object]) -> str:
    return ", ".join(f"{k}: {str(v).lower() if isinstance(v, bool) else v}" for k, v in turn.items())
