"""Frames go to who has named their identifier, in order; a full bus keeps no other waiting."""

from __future__ import annotations

from collections.abc import Container, Iterator
from contextlib import suppress
from typing import Any

import can
import pytest
from psabench.link.can_host import NMT, TURN, CanHost, WallClock
from psabench.link.listeners import KNOWN, Listeners

from tests.py.link.test_host import FakeBus

ALL = None


def frame(can_id: int) -> can.Message:
    return can.Message(arbitration_id=can_id, is_extended_id=can_id > 0x7FF)


class Rig:
    """Listeners with names, and what they have heard: the name and the identifier."""

    def __init__(self, **ids: Container[int] | None) -> None:
        self.heard: list[tuple[str, int]] = []
        self.listeners = Listeners()
        self.by_name = {name: self._listener(name) for name in ids}
        for name, wanted in ids.items():
            self.listeners.append(self.by_name[name], wanted)

    def _listener(self, name: str) -> Any:
        return lambda m: self.heard.append((name, m.arbitration_id))

    def who_hears(self, can_id: int) -> list[str]:
        self.heard.clear()
        self.listeners.hand_on(frame(can_id))
        return [name for name, _ in self.heard]


def test_a_frame_goes_to_who_wants_it_in_the_order_in_which_they_came() -> None:
    rig = Rig(one={0x185}, all=ALL, span=range(0x180, 0x200), other={0x186})
    assert rig.who_hears(0x185) == ["one", "all", "span"]
    assert rig.who_hears(0x186) == ["all", "span", "other"]
    assert rig.who_hears(0x200) == ["all"]
    assert rig.who_hears(0x185) == ["one", "all", "span"]


def test_who_comes_or_goes_counts_from_the_next_frame_on() -> None:
    rig = Rig(one={0x185}, all=ALL)
    assert rig.who_hears(0x185) == ["one", "all"]
    late = rig._listener("late")
    rig.listeners.append(late, {0x185})
    assert rig.who_hears(0x185) == ["one", "all", "late"]
    rig.listeners.remove(rig.by_name["one"])
    assert rig.who_hears(0x185) == ["all", "late"]
    assert len(rig.listeners) == 2
    with pytest.raises(ValueError, match="not in list"):
        rig.listeners.remove(rig.by_name["one"])


def test_a_listener_that_goes_while_it_hears_takes_no_frame_from_another() -> None:
    listeners, heard = Listeners(), []

    def once(m: can.Message) -> None:
        heard.append("once")
        listeners.remove(once)

    listeners.append(once, {1})
    listeners.append(lambda _: heard.append("always"), {1})
    for _ in range(2):
        listeners.hand_on(frame(1))
    assert heard == ["once", "always", "always"]


def test_a_block_alone_and_what_comes_in_a_block_goes_with_it() -> None:
    rig = Rig(one={0x185}, all=ALL)
    guest = rig._listener("guest")
    with rig.listeners.only(guest):
        assert rig.who_hears(0x185) == ["guest"]
    with suppress(KeyError), rig.listeners.restored():
        rig.listeners.append(guest)
        assert rig.who_hears(0x185) == ["one", "all", "guest"]
        raise KeyError
    assert rig.who_hears(0x185) == ["one", "all"]


def test_a_frame_asks_no_listener_of_another_identifier_and_the_table_is_bounded() -> None:
    asked: list[int] = []

    class Ids:
        def __contains__(self, can_id: object) -> bool:
            asked.append(int(str(can_id)))
            return can_id == 5

    rig = Rig(one=Ids())
    for _ in range(100):
        rig.who_hears(5)
        rig.who_hears(6)
    assert asked == [5, 6], "looked up once for each identifier"
    for can_id in range(3 * KNOWN):
        rig.who_hears(can_id)
    assert len(rig.listeners._by_id) <= KNOWN


class Stream(FakeBus):
    """Frames that come from an iterator."""

    def __init__(self, frames: Iterator[can.Message]) -> None:
        super().__init__()
        self.frames = frames

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return next(self.frames, None), False


def test_our_own_nmt_commands_are_heard_by_who_has_named_them_and_recorded_by_none() -> None:
    heard: list[tuple[str, bytes, bool]] = []
    with CanHost(FakeBus(), WallClock()) as host:
        host.listeners.append(lambda m: heard.append(("state", bytes(m.data), m.is_rx)), {NMT, 0x185})
        host.listeners.append(lambda m: heard.append(("record", bytes(m.data), m.is_rx)))
        host.send(NMT, b"\x80\x05")
        host.send(0x185, b"\x01")
        assert heard == [("state", b"\x80\x05", False)]
        assert (host.sent, host.received) == (2, 0)


def test_a_bus_that_is_never_empty_keeps_no_other_waiting() -> None:
    """The wall clock's wait ends in time, and the bus that it is for gets its turns as the others do."""
    came = {"own": 0, "full": 0}

    def stream(name: str, most: int) -> Iterator[can.Message]:
        while came[name] < most:
            came[name] += 1
            assert came["full"] <= TURN * (came["own"] + 1), "one bus alone is received from"
            yield frame(0x185)

    full, own = (CanHost(Stream(stream(name, 20_000)), WallClock()) for name in ("full", "own"))
    with full, own:
        clock = WallClock([full, own])
        clock.advance(own, 0.05)
        assert came["own"] > 0
        assert came["full"] > 0
        assert came["full"] < 20_000, "longer than it was to wait"
