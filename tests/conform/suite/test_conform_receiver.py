"""Checks of the receiver on frames and lines made by hand, good and bad."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from psabench.boards.receiver.conform import check as receiver
from psabench.boards.receiver.device import MESSAGES
from psabench.conform.capture.log import CanFrame, CanLog, Capture, LineLog
from psabench.conform.profile import variant
from psabench.conform.verdict import Failed, Inconclusive
from psabench.link.protocol_files import dbc_node, message
from psabench.link.vcd import Vcd, Wire

SECOND_NS, PULSE_NS = 1_000_000_000, 100_000_000
Values = dict[str, int]


def readings(n: int = 20, change: Callable[[int, Values], None] = lambda *_: None, order: str = "0123") -> Capture:
    """n readings, 100 ms apart, of a receiver at rest."""
    frames: list[CanFrame] = []
    for k in range(n):
        values = {"LAT": 557500000, "LON": 376100000, "H": 150000, "TOW": 86418100 + 100 * k, "WEEK": 2400, "FIX": 3}
        values |= {"SEQ": (250 + k) % 256}  # over the wrap
        change(k, values)
        for name in (MESSAGES[int(i)] for i in order):
            m = message(name)
            raw = {s.name: values.get(s.name, 0) for s in m.signals}
            data = bytes(m.encode(raw, scaling=False, strict=False))
            frames.append(CanFrame(t_s=0.1 * k + 1e-4 * len(frames), can_id=int(m.frame_id), data=data))
    return Capture(
        variant=variant("receiver"), node=dbc_node("receiver"), stimulus="", can=CanLog(frames=tuple(frames))
    )


def pulses(line: str, high_ns: int, period_ns: int, n: int = 12) -> Capture:
    moves = [(0, 0)] + [(t, x) for k in range(1, n) for t, x in ((k * period_ns, 1), (k * period_ns + high_ns, 0))]
    wire = Wire(np.array([t for t, _ in moves], np.int64), np.array([x for _, x in moves], np.uint8))
    lines = LineLog(recording=Vcd(1, 0, n * period_ns, {line: wire}))
    return Capture(variant=variant("receiver"), node=dbc_node("receiver"), stimulus="", lines=lines)


def set_at(at: int, **values: int) -> Callable[[int, Values], None]:
    """These values in one reading."""
    return lambda k, v: v.update(values) if k == at else None


CHECKS = (
    receiver.four_messages_make_a_reading,
    receiver.readings_are_counted,
    receiver.messages_have_their_lengths,
    receiver.time_goes_on_by_the_period,
    receiver.a_fix_is_on_the_earth,
)


@pytest.mark.parametrize("check", CHECKS, ids=lambda c: c.__name__)
def test_good_readings_pass(check: Callable[[Capture], str]) -> None:
    assert check(readings())


def test_time_goes_over_the_end_of_a_week() -> None:
    def wrap(k: int, v: Values) -> None:
        tow = 604_799_500 + 100 * k
        v.update(WEEK=2400 + tow // 604_800_000, TOW=tow % 604_800_000)

    assert receiver.time_goes_on_by_the_period(readings(change=wrap))


def test_a_place_without_a_fix_means_nothing() -> None:
    assert receiver.a_fix_is_on_the_earth(readings(change=set_at(4, LAT=2_000_000_000, FIX=0)))


@pytest.mark.parametrize(
    ("check", "bad"),
    [
        (receiver.four_messages_make_a_reading, readings(order="0213")),
        (receiver.readings_are_counted, readings(change=set_at(5, SEQ=254))),
        (receiver.time_goes_on_by_the_period, readings(change=set_at(5, TOW=86418500))),
        (receiver.time_goes_on_by_the_period, readings(change=set_at(5, WEEK=1376))),
        (receiver.a_fix_is_on_the_earth, readings(change=set_at(5, LAT=900_000_001))),
        (receiver.a_fix_is_on_the_earth, readings(change=set_at(5, LON=1_800_000_001))),
        (receiver.a_fix_is_on_the_earth, readings(change=set_at(5, LON=-1_800_000_000))),
    ],
)
def test_bad_readings_fail(check: Callable[[Capture], str], bad: Capture) -> None:
    with pytest.raises(Failed):
        check(bad)


def test_too_few_readings_are_inconclusive() -> None:
    with pytest.raises(Inconclusive):
        receiver.readings_are_counted(readings(7))


def test_lines() -> None:
    assert receiver.pps_is_a_pulse(pulses("PPS", PULSE_NS, SECOND_NS))
    assert receiver.solutions_come_at_their_rate(pulses("SOL", 1_000_000, PULSE_NS))
    with pytest.raises(Failed):
        receiver.pps_is_a_pulse(pulses("PPS", PULSE_NS + 50_000, SECOND_NS))
    with pytest.raises(Failed):
        receiver.solutions_come_at_their_rate(pulses("SOL", 1_000_000, PULSE_NS + 50_000))
