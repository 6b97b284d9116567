"""A schedule: what the host does and which faults come, as data. Pure: the same seed and number give the same one.

An action is one of ACTIONS with its arguments, of JSON's types:

    frame   text: a frame as can-utils write it, "605#4000100000000000"
    wait    s: simulated time that passes
    power   off_s: the supply is off so long
    fault   kind, point, values, for_s: from now on, so long; fresh: after a reset
    look    name: a dialogue of the suite or a stimulus with its checks; under: while faults are on, else after a reset

Every part of a schedule is a schedule: before a look the player brings the board back to its defaults by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from random import Random
from typing import Any

from psabench.errors import BadInput, expected
from psabench.explore.fault_rules import RULES, drawn_values
from psabench.explore.host_frames import Entry, drawn_frames

ACTIONS = ("frame", "wait", "power", "fault", "look")
LOOKS = 4  # at most
STORM = 12  # things that the host does at random, at most
QUIET_SHARE, FAULT_SHARE, UNDER_SHARE = 0.35, 0.5, 0.3  # schedules without a storm; with faults; looks while one is on
WAITS_S = (0.0, 0.0002, 0.001, 0.003, 0.01, 0.03)
OFFS_S = (0.0005, 0.003, 0.02)
LASTS_S = (0.001, 0.005, 0.02, 0.08)
UNDER_S = 10.0  # of a fault that a look is to meet: until the schedule ends


@dataclass(frozen=True, slots=True)
class Action:
    """See the module."""

    do: str
    args: Mapping[str, Any]

    def words(self) -> str:
        """On one line, for people."""
        return " ".join([self.do, *(f"{k}={v}" for k, v in self.args.items())])


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """seed: of the emulator's noise. number: which of a search it is."""

    board: str
    profile: str
    seed: int
    number: int
    length_s: float  # of simulated time at most, from the ready board on
    actions: tuple[Action, ...]

    def data(self) -> dict[str, Any]:
        """As `of_data` takes it."""
        rest = {k: getattr(self, k) for k in ("board", "profile", "seed", "number", "length_s")}
        return rest | {"actions": [{"do": a.do, **a.args} for a in self.actions]}


def of_data(found: Any) -> Schedule:
    """From JSON. Raises BadInput."""
    try:
        rows = [dict(row) for row in found["actions"]]
        actions = tuple(Action(row.pop("do"), row) for row in rows)
        rest = {k: found[k] for k in ("board", "profile", "seed", "number", "length_s")}
    except (KeyError, TypeError, ValueError) as e:
        raise BadInput(expected("a schedule", f"{type(e).__name__}: {e}", "explore")) from e
    if unknown := [a.do for a in actions if a.do not in ACTIONS]:
        raise BadInput(expected(", ".join(ACTIONS), unknown[0], "explore: actions"))
    return Schedule(actions=actions, **rest)


@dataclass(frozen=True, slots=True, kw_only=True)
class Catalogue:
    """What a schedule of a board can consist of. points: of each kind of fault."""

    board: str
    profile: str
    node: int
    entries: Sequence[Entry]
    points: Mapping[str, Sequence[str]]
    looks: Sequence[str]


def draw_schedule(c: Catalogue, seed: int, number: int, length_s: float) -> Schedule:
    """The schedule of that number: perhaps a storm of frames, perhaps faults in it, and looks at the board."""
    rng = Random(f"{c.board} {c.profile} {seed} {number}")
    actions: list[Action] = []
    if rng.random() >= QUIET_SHARE:
        actions += _drawn_storm(c, rng)
    if rng.random() < FAULT_SHARE:
        at = rng.randint(0, len(actions))
        actions[at:at] = [_drawn_fault(c, rng, rng.choice(LASTS_S), fresh=False) for _ in range(rng.randint(1, 2))]
    looks = [_look_at(rng.choice(c.looks), under=False) for _ in range(rng.randint(1, LOOKS))]
    if rng.random() < UNDER_SHARE:
        looks[:1] = [_drawn_fault(c, rng, UNDER_S, fresh=True), _look_at(str(looks[0].args["name"]), under=True)]
    return Schedule(
        board=c.board,
        profile=c.profile,
        seed=rng.getrandbits(31),
        number=number,
        length_s=length_s,
        actions=(*actions, *looks),
    )


def _look_at(name: str, *, under: bool) -> Action:
    return Action("look", {"name": name, "under": under})


def _drawn_storm(c: Catalogue, rng: Random) -> list[Action]:
    found: list[Action] = []
    for _ in range(rng.randint(1, STORM)):
        if rng.random() < 0.04:
            found.append(Action("power", {"off_s": rng.choice(OFFS_S)}))
        else:
            found += [Action("frame", {"text": text}) for text in drawn_frames(rng, c.node, c.entries)]
        found.append(Action("wait", {"s": rng.choice(WAITS_S)}))
    return found


def _drawn_fault(c: Catalogue, rng: Random, for_s: float, *, fresh: bool) -> Action:
    kind = rng.choice([k for k in RULES if c.points.get(k)])
    point = rng.choice(c.points[kind])
    values = drawn_values(rng, kind)
    return Action("fault", {"kind": kind, "point": point, "values": values, "for_s": for_s, "fresh": fresh})
