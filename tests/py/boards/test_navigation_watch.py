"""What a host makes of a gyro unit's counts between two looks; the unit is a stand-in."""

from __future__ import annotations

from typing import cast

import pytest
from psabench.boards.gyro.device import Began, Flag, Gyro, Mode
from psabench.boards.gyro.watch import FLAG_WORDS, NavigationWatch

STEP_S = 0.02
LOST, STUCK = FLAG_WORDS[Flag.LEVEL_LOST], FLAG_WORDS[Flag.ENCODER_FAULT]


class Unit:
    """As much of a `Gyro` as is asked."""

    def __init__(self) -> None:
        self.step_s = STEP_S
        self.steps, self.mode, self.flags = 5000, Mode.NAVIGATE, Flag(0)
        self.counts = dict.fromkeys(Flag, Began(0, 0))

    def began(self) -> dict[Flag, Began]:
        return dict(self.counts)

    def passes(self, span_s: float) -> None:
        self.steps += round(span_s / STEP_S)

    def counted(self, flag: Flag, count: int) -> None:
        """Up to now."""
        self.counts[flag] = Began(count, self.steps)

    def reset(self) -> None:
        self.steps, self.mode, self.flags = 0, Mode.OFF, Flag(0)
        self.counts = dict.fromkeys(Flag, Began(0, 0))


def watched() -> tuple[Unit, NavigationWatch]:
    unit = Unit()
    return unit, NavigationWatch(cast("Gyro", unit), 1000.0)


def test_nothing_happens() -> None:
    unit, watch = watched()
    unit.passes(300.0)
    assert watch.faults(1300.0) == ()
    unit.passes(299.0)  # the clocks of unit and bench are not one
    assert watch.faults(1600.0) == ()


def test_a_fault_that_came_and_went_is_told_once_with_its_time() -> None:
    unit, watch = watched()
    unit.passes(123.0)
    unit.counted(Flag.LEVEL_LOST, 1)
    unit.passes(177.0)
    assert watch.faults(1300.0) == (f"{LOST}, 123 s into navigation",)
    unit.passes(300.0)
    assert watch.faults(1600.0) == ()
    unit.counted(Flag.LEVEL_LOST, 4)
    assert watch.faults(1600.0) == (f"{LOST}, 3 times, the last 600 s into navigation",)


def test_one_that_stands_is_told_in_the_same_words_at_each_look() -> None:
    unit, watch = watched()
    unit.passes(50.0)
    unit.counted(Flag.ENCODER_FAULT, 1)
    unit.flags = Flag.ENCODER_FAULT
    words = (f"{STUCK}, 50 s into navigation",)
    assert watch.faults(1050.0) == words
    unit.passes(300.0)
    assert watch.faults(1350.0) == words


def test_one_that_stood_before_navigation_is_told() -> None:
    unit = Unit()
    unit.counted(Flag.SATURATED, 1)
    watch = NavigationWatch(cast("Gyro", unit), 0.0)
    assert watch.faults(0.0) == ()
    unit.flags = Flag.SATURATED
    assert watch.faults(0.0) == (FLAG_WORDS[Flag.SATURATED],)


def test_a_reset_is_told_with_its_time_whatever_the_mode_is_now() -> None:
    unit, watch = watched()
    unit.passes(100.0)
    unit.counted(Flag.LEVEL_LOST, 9)
    unit.reset()
    unit.passes(200.0)
    when = "reset, or without power for a while, 100 s into navigation"
    assert watch.faults(1300.0) == (f"the unit left navigation, its mode is off: {when}",)
    unit.mode = Mode.NAVIGATE
    unit.passes(300.0)
    assert watch.faults(1600.0) == (f"the unit was {when}: what it was given is lost",)
    unit.counted(Flag.LEVEL_LOST, 1)  # since: fewer than before, and told all the same
    assert watch.faults(1600.0) == (f"the unit was {when}: what it was given is lost", LOST)


@pytest.mark.parametrize("after_s", [50.0, 200.0])
def test_a_reset_long_ago_is_none_of_this_navigation(after_s: float) -> None:
    """Its steps are those since a reset before; only what is missing since navigation began counts."""
    unit = Unit()
    unit.steps = round(3.0 / STEP_S)
    watch = NavigationWatch(cast("Gyro", unit), 4000.0)
    unit.passes(after_s)
    assert watch.faults(4000.0 + after_s) == ()


def test_another_host_may_take_it_out_of_navigation() -> None:
    unit, watch = watched()
    unit.passes(10.0)
    unit.mode = Mode.HOLD
    assert watch.faults(1010.0) == ("the unit left navigation, its mode is hold: another client set it",)
    unit.counts = dict.fromkeys(Flag, Began(0, 0))
    unit.mode = Mode.NAVIGATE
    assert watch.faults(1010.0) == ()
