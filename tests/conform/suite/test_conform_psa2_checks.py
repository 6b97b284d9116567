"""Every check of PSA-2 and PSA-1: it passes on what a board shows, and fails on each way of showing it wrongly.

The good capture is an emulator's, one stimulus each; the bad is made from it (psa2_bad.py), in the ways of
psa2_wrong_pins.py and psa2_wrong_can.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import pytest
from psa2_bad import REFUSED, Bad, still, told
from psa2_wrong_can import WRONG_CAN
from psa2_wrong_pins import WRONG_PINS
from psabench.boards.psa2.conform.stimulus_can import Answer
from psabench.conform import suite
from psabench.conform.capture.log import CanLog, Capture
from psabench.conform.dut import Addresses, Dut
from psabench.conform.plan import plan_of, stimuli
from psabench.conform.profile import variant
from psabench.conform.proves import suite_tests
from psabench.conform.requirements import requirements
from psabench.conform.verdict import Failed, Inconclusive

suite.load()

MODULES = ("psa2_setup", "psa2_serial", "psa2_parts", "psa2_stream", "psa2_words", "psa2_forms", "psa2_registers",
           "psa2_objects", "psa2_temps", "psa2_trouble", "psa2_analog", "psa2_frame", "psa2_pairs")  # fmt: skip
CHECKS = {
    p.test.__name__: p.test
    for p in suite_tests()
    if p.test.__module__.replace("boards.psa2.conform.check_", "psa2_").rpartition(".")[2] in MODULES
}
OTHER = {  # checks of rows that hold for another variant, or want another link
    "one_message_writes_bufen_and_acal": ("psa2", "intent"),
    "the_accelerometer_converters_get_one_message": ("psa1", None),
    "bursts_damage_words_where_nothing_gates_them": ("psa2", "ungated"),
    "clk_is_a_division_of_the_crystal": ("psa2", "w24"),
}
FD = ("form_2_is", "form_3_is", "a_block_begins", "the_stamp_of_a_block", "fd_frames_are")


class Stage:
    """Stimuli of several variants, each played once."""

    def __init__(self) -> None:
        self.duts: dict[tuple[str, str | None, str], Dut] = {}
        self.shown: dict[tuple[Any, str], Capture] = {}

    def capture(self, check: str) -> Capture:
        board, profile = OTHER.get(check, ("psa2", None))
        key = board, profile, "slcan" if check.startswith(FD) else "socketcand:0"
        if key not in self.duts:
            self.duts[key] = Dut.open(variant(board, profile), Addresses(adapter=key[2]), seed=3)
        name = plan_of(CHECKS[check]).stimulus
        if (key, name) not in self.shown:
            self.shown[key, name] = stimuli("psa2")[name].make(self.duts[key])
        return self.shown[key, name]

    def close(self) -> None:
        for s in self.duts.values():
            s.close()


@pytest.fixture(scope="module")
def stage() -> Iterator[Stage]:
    made = Stage()
    yield made
    made.close()


WRONG: Mapping[str, Sequence[Bad]] = {**WRONG_PINS, **WRONG_CAN}  # ways of showing it wrongly, by check


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_passes_on_good_evidence(name: str, stage: Stage) -> None:
    assert CHECKS[name](stage.capture(name))


@pytest.mark.parametrize(("name", "k"), [(n, k) for n, ways in WRONG.items() for k in range(len(ways))])
def test_a_check_sees_what_is_wrong(name: str, k: int, stage: Stage) -> None:
    with pytest.raises(Failed):
        CHECKS[name](WRONG[name][k](stage.capture(name)))


def test_every_check_has_bad_evidence() -> None:
    assert set(CHECKS) == set(WRONG)


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_says_broken_or_too_little_of_a_dead_board(name: str, stage: Stage) -> None:
    """No frame, no edge: an answer in words and never an exception of another kind."""
    e = stage.capture(name).with_can(CanLog())
    if e.lines is not None:
        for line in e.wires.recording.wires:
            e = still(line, 1)(e)
    try:
        CHECKS[name](e)
    except (Failed, Inconclusive):
        return
    assert set(e.facts) - {"cut"}, "it passes where nothing moves and nothing was answered"


@pytest.mark.parametrize("name", CHECKS)
def test_a_check_says_broken_or_too_little_of_wrong_lengths(name: str, stage: Stage) -> None:
    e = stage.capture(name)
    e = e.with_can(CanLog(frames=tuple(f._replace(data=f.data[: k % 3]) for k, f in enumerate(e.can.frames))))
    for fact in e.facts:
        if fact != "cut":
            e = told(fact, lambda _: REFUSED)(e) if isinstance(e.facts[fact], Answer) else e
    try:
        CHECKS[name](e)
    except (Failed, Inconclusive):
        return


@pytest.mark.parametrize("name", ["frames_are_counted", "overruns_are_counted"])
def test_a_counter_is_not_judged_without_its_answers(name: str, stage: Stage) -> None:
    """Frames of the whole log are none of those that it has counted."""
    e = stage.capture(name)
    streams = CanLog(frames=tuple(f for f in e.can.frames if f.can_id != 0x580 + e.node))
    with pytest.raises(Inconclusive, match="answers"):
        CHECKS[name](e.with_can(streams))


def test_every_observable_row_of_these_boards_has_a_check() -> None:
    proved = {i for p in suite_tests() for i in p.ids}
    rows = [r for r in requirements() if r.group == "psa2"]
    assert not [r.id for r in rows if not r.unobservable and r.id not in proved]
    assert not [r.id for r in rows if r.unobservable and r.id in proved]
