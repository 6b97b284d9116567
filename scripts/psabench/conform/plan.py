"""How a test of the device suite is carried out: a scene gives evidence, a check judges it; a trial does both.

    @scene("stream", boards=("psa2",))
    def stream(s: Subject) -> Evidence: ...            # side effects, once a run, for all checks that want it

    @proves("PSA2-FRAME-01")
    @check("stream", needs={"line"})
    def int_is_low_for_long_enough(e: Evidence) -> str: ...   # pure: the same for a recording

    @proves("PSA2-REQ-04")
    @trial(needs={"can"})
    def a_write_to_id_is_refused(s: Subject) -> str: ...

The function's docstring says in its first line what is done. It returns in words what was seen, raises `Broken` where
that is not what is due and `TooLittle` where it cannot tell.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from psabench.conform.capture.log import Evidence

if TYPE_CHECKING:
    from psabench.conform.dut import Subject

Check = TypeVar("Check", bound=Callable[[Evidence], str])
Trial = TypeVar("Trial", bound="Callable[[Subject], str]")
SceneOf = Callable[["Subject"], Evidence]

WAYS = frozenset(
    {
        "can",
        "line",
        "pins",
        "bus",
        "supply",
        "chamber",
        "head",
        "table",
        "lockstep",
        "exact",
        "inputs",
        "fd",
        "rtr",
        "stamps",
        "errors",
        "slow",
        "port",
        "stream",
    }
)

# Parts of a recording: all of it; a Res or boot-up and what follows; the readings after the set-up; "": none of it.
PARTS = ("all", "boot", "stream", "")
# Scenes that a bench goes through by itself. Others are a stimulus: a recording has it only if somebody made it.
SCENE_ON_RECORDING: Mapping[str, str] = {
    "stream": "stream",
    "quiet": "stream",
    "starts": "stream",
    "power_on": "boot",
    "services": "all",
    "overload": "all",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """Of a test. scene "": a trial."""

    scene: str
    needs: frozenset[str]  # probes without which it is not observable
    on_recording: str = ""  # the part of a recording that it judges, one of PARTS; "": it wants its scene
    boards: frozenset[str] = frozenset()  # families that it is for; none: all that have its requirements

    @property
    def is_trial(self) -> bool:
        return not self.scene


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """A stimulus by name; the same name may stand for another one on another board."""

    name: str
    boards: tuple[str, ...]  # families
    make: SceneOf


_plans: dict[Callable[..., str], Plan] = {}
_scenes: list[Scene] = []


def check(
    scene: str, *, needs: Iterable[str] = ("can",), on_recording: str | None = None, boards: Iterable[str] = ()
) -> Callable[[Check], Check]:
    """A pure test of the evidence of this scene. Raises ValueError for a need or a part that there is not.

    on_recording: the part of a recording that it judges, that of its scene (SCENE_ON_RECORDING) where it is not said.
    boards: families that have the scene, where requirements of others, too, are proved, which have another test.
    """
    part = SCENE_ON_RECORDING.get(scene, "") if on_recording is None else on_recording
    if part not in PARTS:
        raise ValueError(f"on_recording is {part!r}; there are {', '.join(map(repr, PARTS))}")

    def register(test: Check) -> Check:
        _plans[test] = Plan(scene=scene, needs=_ways(needs), on_recording=part, boards=frozenset(boards))
        return test

    return register


def trial(*, needs: Iterable[str] = ("can",)) -> Callable[[Trial], Trial]:
    """A test that asks the board itself."""

    def register(test: Trial) -> Trial:
        _plans[test] = Plan(scene="", needs=_ways(needs))
        return test

    return register


def scene(name: str, *, boards: Iterable[str]) -> Callable[[SceneOf], SceneOf]:
    """A scene of these families of boards."""

    def register(make: SceneOf) -> SceneOf:
        _scenes.append(Scene(name=name, boards=tuple(boards), make=make))
        return make

    return register


def plan_of(test: Callable[..., str]) -> Plan:
    """Raises ValueError for a test that is neither check nor trial."""
    if test not in _plans:
        raise ValueError(f"{test.__name__} is neither @check nor @trial")
    return _plans[test]


def scenes(family: str) -> Mapping[str, Scene]:
    """The scenes of a family of boards by name, in the order in which a run plays them."""
    return {s.name: s for s in _scenes if family in s.boards}


def _ways(needs: Iterable[str]) -> frozenset[str]:
    found = frozenset(needs)
    if found - WAYS:
        raise ValueError(f"needs {', '.join(sorted(found - WAYS))}; there are {', '.join(sorted(WAYS))}")
    return found
