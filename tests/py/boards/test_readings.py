"""Readings of any board as columns: cantools, which is not used for streams, is the independent encoder."""

from __future__ import annotations

import random
from collections.abc import Iterator

import can
import numpy as np
import pytest
from psabench.boards.devices import all_devices
from psabench.boards.psa2.device import Psa2
from psabench.boards.readings import ReadingLayout, ReadingReader
from psabench.link.protocol_files import dbc_node, message

from tests.py.boards.test_frames import nmt, seed

LAYOUTS = [kind.layout for kind in all_devices().values() if kind is not Psa2]
TWO = ReadingLayout(board="pmka", messages=("PMKA_CODES", "PMKA_STATE"), counter="SEQ")


def can_message(name: str, raw: dict[str, int], board: str, node: int, t_s: float = 0.0) -> can.Message:
    m = message(name)
    data = m.encode({s.name: 0 for s in m.signals} | raw, scaling=False, strict=False)
    at = m.frame_id - dbc_node(board) + node
    return can.Message(arbitration_id=at, data=data, is_extended_id=False, timestamp=t_s)


def reading(layout: ReadingLayout, raw: dict[str, int], node: int, t_s: float = 0.0) -> Iterator[can.Message]:
    """The messages of one reading; raw: by signal, 0 for the others."""
    for name in layout.messages:
        names = {s.name for s in message(name).signals}
        yield can_message(name, {k: v for k, v in raw.items() if k in names}, layout.board, node, t_s)


def two(seq: int, node: int = 7) -> list[can.Message]:
    return list(reading(TWO, {"SEQ": seq % 2**16, "X": seq - 100}, node, seq * 1e-3))


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.board)
def test_every_signal_of_a_board_comes_back(layout: ReadingLayout) -> None:
    """In the units of the DBC, for any values, at any node; a name that is taken has its message's before it."""
    rng = random.Random(seed())
    sent: dict[str, list[float]] = {}
    reader = ReadingReader(layout, 42)
    for k in range(50):
        seen: set[str] = set()
        for name in layout.messages:
            raw = {}
            for s in message(name).signals:
                low = -(1 << s.length - 1) if s.is_signed else 0
                raw[s.name] = rng.randrange(low, low + (1 << s.length))
                column = s.name if s.name not in seen else f"{name}.{s.name}"
                sent.setdefault(column, []).append(raw[s.name] * float(s.scale) + float(s.offset))
            seen |= set(raw)
            reader.on_message(can_message(name, raw, layout.board, 42, k * 0.5))
    assert len(reader) == 50
    taken = reader.take()
    assert len(reader) == 0
    assert set(taken.columns) == set(taken.units) == set(sent)
    for column, values in sent.items():
        assert np.array_equal(taken[column], values), column
    assert np.array_equal(taken.t_rx_s, np.arange(50) * 0.5)
    assert reader.counters.torn == 0


def test_columns_have_the_units_of_the_dbc() -> None:
    units = ReadingReader(TWO, 7).take().units
    assert (units["X"], units["SEQ"], units["T"]) == ("V", "", "degC")


def test_instants_go_on_over_a_wrap_and_from_one_take_to_the_next() -> None:
    layout = ReadingLayout(board="pik", messages=("PIK_TOTAL_Z",), stamp="TSTAMP")
    reader = ReadingReader(layout, 8)
    t_sample_s = []
    for us in (2**32 - 200, 2**32 - 100, 0, 100):
        reader.on_message(can_message("PIK_TOTAL_Z", {"TSTAMP": us}, "pik", 8))
        t_sample_s.append(float(reader.take().t_sample_s[0]))
    assert np.diff(t_sample_s) == pytest.approx([1e-4] * 3)


def test_overruns_that_the_board_tells_are_counted() -> None:
    layout = ReadingLayout(board="psd1", messages=("PSD1_CYCLE",), overrun="OVERRUN")
    reader = ReadingReader(layout, 6)
    for overrun in (0, 1, 1, 0):
        reader.on_message(can_message("PSD1_CYCLE", {"OVERRUN": overrun}, "psd1", 6))
    reader.take()
    assert reader.counters.overruns == 2


@pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.board)
def test_the_counter_of_a_board_tells_what_was_lost(layout: ReadingLayout) -> None:
    assert layout.counter, "a board whose losses no one would see"
    bits = next(s.length for name in layout.messages for s in message(name).signals if s.name == layout.counter)
    reader = ReadingReader(layout, 9)
    before_wrap = 2**bits - 3
    for k in (*range(5), 7, 8):  # 5 and 6 are missing, and it wraps
        for m in reading(layout, {layout.counter: (before_wrap + k) % 2**bits}, 9):
            reader.on_message(m)
        if k == 4:
            reader.take()  # the gap is found across two takes
    reader.take()
    assert (reader.counters.lost, reader.counters.torn, reader.counters.frames) == (2, 0, 7)


def test_other_nodes_and_services_are_let_by() -> None:
    reader = ReadingReader(TWO, 7)
    for m in (*two(1, node=8), can_message("PMKA_EMCY", {}, "pmka", 7), can_message("PSA2_XY", {}, "psa2", 7)):
        if m.arbitration_id == 0x187:
            continue  # a PSA-2 at this node would be one: two boards never share a node
        reader.on_message(m)
    assert (len(reader), reader.counters.torn) == (0, 0)


@pytest.mark.parametrize(
    ("what", "torn"),
    [
        pytest.param(lambda a, b: [*a, *b], 0, id="whole"),
        pytest.param(lambda a, b: [a[1], *b], 0, id="under way when we came"),
        pytest.param(lambda a, b: [a[0], *b], 1, id="the second is missing"),
        pytest.param(lambda a, b: [*a, b[1], *two(9)], 1, id="the first is missing"),
        pytest.param(lambda a, b: [a[0], a[0], a[1]], 1, id="the first twice"),
    ],
)
def test_half_a_reading_is_torn(what: object, torn: int) -> None:
    reader = ReadingReader(TWO, 7)
    assert callable(what)
    for m in what(two(1), two(2)):
        reader.on_message(m)
    assert reader.counters.torn == torn
    assert len(reader) >= 1


def test_a_message_of_the_wrong_length_is_torn() -> None:
    reader = ReadingReader(TWO, 7)
    first, second = two(1)
    reader.on_message(can.Message(arbitration_id=first.arbitration_id, data=bytes(7), is_extended_id=False))
    assert reader.counters.torn == 1
    reader.on_message(second)
    assert len(reader) == 0
    for m in two(2):
        reader.on_message(m)
    assert len(reader) == 1


def test_a_stop_in_the_middle_is_no_fault() -> None:
    reader = ReadingReader(TWO, 7)
    reader.on_message(two(1)[0])
    for m in (nmt(0x80, 7), nmt(0x01, 7), *two(2)):
        reader.on_message(m)
    assert (len(reader), reader.counters.torn) == (1, 0)


def test_the_first_of_many_and_a_column_that_is_not_there() -> None:
    reader = ReadingReader(TWO, 7)
    for k in range(5):
        for m in two(k):
            reader.on_message(m)
    taken = reader.take().head(2)
    assert len(taken) == 2
    assert np.array_equal(taken["SEQ"], [0, 1])
    with pytest.raises(KeyError, match="expected X, Y"):
        taken["W"]
    assert len(reader.take()) == 0
