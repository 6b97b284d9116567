"""What counts as lost: gaps within a stretch of the stream, and nothing that was not to be heard (boards.stream)."""

from __future__ import annotations

from collections.abc import Callable

import can
import pytest
from psabench.boards.psa2.frames import Form, FrameReader
from psabench.boards.readings import ReadingReader
from psabench.boards.stream import FrameCounters

from tests.py.boards.test_frames import boot_up, feed, frame, nmt, pair
from tests.py.boards.test_readings import TWO, two

STOP, PREOP, START, RESET, RESET_COMM = 0x02, 0x80, 0x01, 0x81, 0x82
NODE, OTHER = 5, 6


def samples(*numbers: int) -> list[can.Message]:
    """Of a PSA-2 that counts by SEQ."""
    return [m for n in numbers for m in pair((n, n, n), n, 250 * n)]


def counted(*messages: can.Message, takes: bool = False) -> FrameCounters:
    """By a reader that hears them; takes: after each message what has come is taken."""
    reader = FrameReader(NODE)
    for m in messages:
        reader.on_message(m)
        if takes:
            reader.take()
    reader.take()
    return reader.counters


def lost_and_stretches(c: FrameCounters) -> tuple[int, int]:
    assert c.torn == 0
    return c.lost, c.stretches


STATES = [
    pytest.param([nmt(PREOP, NODE), nmt(START, NODE)], 0, 2, id="pre-operational and start"),
    pytest.param([nmt(STOP, NODE), nmt(START, NODE)], 0, 2, id="stop and start"),
    pytest.param([nmt(STOP, 0), nmt(START, 0)], 0, 2, id="of all nodes"),
    pytest.param([nmt(PREOP, NODE), nmt(START, NODE)] * 2, 0, 2, id="twice, and nothing came between"),
    pytest.param([nmt(PREOP, NODE), nmt(START, NODE), nmt(START, NODE)], 0, 2, id="a second start"),
    pytest.param([nmt(RESET_COMM, NODE), nmt(START, NODE)], 0, 2, id="a reset whose boot-up is not heard"),
    pytest.param([boot_up(NODE)], 0, 2, id="boot-up"),
    pytest.param([], 96, 1, id="nothing"),
    pytest.param([nmt(START, NODE)], 96, 1, id="a start of a stream that runs"),
    pytest.param([nmt(PREOP, NODE)], 96, 1, id="a stop that the board has not heard"),
    pytest.param([nmt(PREOP, OTHER), nmt(START, OTHER)], 96, 1, id="stop and start of another node"),
    pytest.param([boot_up(OTHER)], 96, 1, id="boot-up of another node"),
    pytest.param([boot_up(NODE, 5)], 96, 1, id="heartbeat, operational"),
]


@pytest.mark.parametrize(("between", "lost", "stretches"), STATES)
@pytest.mark.parametrize("takes", [False, True])
def test_a_stretch_begins_where_the_stream_does(
    between: list[can.Message], lost: int, stretches: int, takes: bool
) -> None:
    heard = [*samples(1, 2, 3), *between, *samples(100, 101)]
    assert lost_and_stretches(counted(*heard, takes=takes)) == (lost, stretches)


@pytest.mark.parametrize("takes", [False, True])
def test_losses_within_a_stretch_count_whatever_was_before(takes: bool) -> None:
    again = [nmt(PREOP, NODE), nmt(START, NODE)]
    heard = [*samples(1, 3), *again, *samples(100), nmt(START, NODE), *samples(104), *again, *samples(90, 91, 93)]
    assert lost_and_stretches(counted(*heard, takes=takes)) == (1 + 3 + 1, 3)


def test_a_board_that_begins_at_0_after_its_reset_has_lost_nothing() -> None:
    heard = [*samples(380, 381), nmt(RESET, NODE), boot_up(NODE), nmt(START, NODE), *samples(0, 1, 3)]
    assert lost_and_stretches(counted(*heard)) == (1, 2)


def test_what_is_on_its_way_at_a_stop_belongs_to_the_old_stretch() -> None:
    """Its numbers go on, so a gap before it is a loss."""
    heard = [*samples(1), nmt(PREOP, NODE), *samples(3), nmt(START, NODE), *samples(20)]
    assert lost_and_stretches(counted(*heard)) == (1, 2)


def test_a_half_that_a_stop_cuts_off_is_not_torn_and_one_without_its_first_half_is() -> None:
    again = [nmt(PREOP, NODE), nmt(START, NODE)]
    assert counted(*samples(1), samples(2)[0], *again, *samples(9)).torn == 0
    assert counted(*samples(1), *again, samples(9)[1], *samples(10)).torn == 1


def test_one_take_gives_the_samples_of_all_stretches_in_order() -> None:
    reader = FrameReader(NODE)
    feed(reader, [*samples(1, 2), nmt(PREOP, NODE), nmt(START, NODE), *samples(40), boot_up(NODE), *samples(0, 1)])
    taken = reader.take()
    assert taken.seq.tolist() == [1, 2, 40, 0, 1]
    assert len(taken.u_v) == len(taken.t_sample_s) == 5
    assert reader.counters.frames == 5


def test_a_reader_that_forgets_begins_a_stretch() -> None:
    """A pair may be under way then: its second half is no fault."""
    reader = FrameReader(NODE)
    feed(reader, [*samples(1, 2), samples(3)[0]])
    reader.take()
    reader.forget()
    feed(reader, [samples(3)[1], *samples(7, 9)])
    reader.take()
    assert lost_and_stretches(reader.counters) == (1, 2)


def single(form: Form) -> Callable[[int], list[can.Message]]:
    """A message of this form with a number."""
    if form is Form.FAST:
        return lambda n: [frame("PSA2_FAST", {"TOG": n & 1})]
    return lambda n: [frame(f"PSA2_{form.name}", {"TSTAMP": n * (5000 if form is Form.BLOCK else 1000)})]


@pytest.mark.parametrize("form", [Form.FAST, Form.FRAME, Form.BLOCK])
@pytest.mark.parametrize("takes", [False, True])
def test_forms_of_one_message_count_by_stretches_too(form: Form, takes: bool) -> None:
    """A frame is lost in each of two stretches, and 20 times what it takes to stop; a block has five samples."""
    numbered = single(form)
    runs = [[0, 1, 2, 3, 5, 6, 7], [28, 29, 31, 32, 33]]
    first, second = ([m for n in run for m in numbered(n)] for run in runs)
    c = counted(*first, nmt(PREOP, NODE), nmt(START, NODE), *second, takes=takes)
    assert lost_and_stretches(c) == (10 if form is Form.BLOCK else 2, 2)


def test_readings_of_other_boards_count_by_the_same_rule() -> None:
    reader = ReadingReader(TWO, 7)
    again = [nmt(PREOP, 7), nmt(START, 7)]
    for m in [*two(1), *two(3), *again, *two(100), *two(104), boot_up(7), *two(0), *two(1)]:
        reader.on_message(m)
    assert reader.take()["SEQ"].tolist() == [1, 3, 100, 104, 0, 1]
    assert (reader.counters.lost, reader.counters.stretches, reader.counters.torn) == (1 + 3, 3, 0)
    for m in [*again, *two(50)]:
        reader.on_message(m)
        reader.take()
    assert (reader.counters.lost, reader.counters.stretches) == (4, 4)


def test_a_reading_that_comes_twice_is_no_loss() -> None:
    """CAN repeats a frame whose acknowledgement it has not understood."""
    reader = ReadingReader(TWO, 7)
    for m in [*two(1), *two(2), *two(2), *two(3)]:
        reader.on_message(m)
    reader.take()
    assert (reader.counters.lost, reader.counters.torn) == (0, 0)
