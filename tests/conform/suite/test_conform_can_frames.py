"""Checks of any log of a board's frames, against logs made by hand: what is right passes, what is wrong does not."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from psabench.conform.capture.canbits import frame_bits
from psabench.conform.capture.log import CanFrame, CanLog, Capture
from psabench.conform.check import can_frames as c
from psabench.conform.profile import variant
from psabench.conform.verdict import Failed, Inconclusive

NODE = 5
BEAT, ANSWER, ASK, EMCY, XY, ZT = 0x705, 0x585, 0x605, 0x085, 0x185, 0x285


def frame(t_s: float, can_id: int, data: bytes = b"", **more: bool) -> CanFrame:
    return CanFrame(t_s=t_s, can_id=can_id, data=data, **more)


def pair(t_s: float, seq: int) -> list[CanFrame]:
    number = seq.to_bytes(2, "little")
    return [frame(t_s, XY, bytes(6) + number), frame(t_s + 1e-4, ZT, bytes(8))]


def emergency(t_s: float, code: int, register: int, source: int = 3) -> CanFrame:
    stamp = round(t_s * 1e6).to_bytes(4, "little")
    return frame(t_s, EMCY, code.to_bytes(2, "little") + bytes([register, source]) + stamp)


GOOD = [
    frame(0.0, BEAT, b"\0"),
    frame(1.0, BEAT, b"\x7f"),
    frame(2.0002, BEAT, b"\x7f"),
    frame(3.0, BEAT, b"\x7f"),
    frame(3.1, ASK, bytes.fromhex("4000100000000000"), sent=True),
    frame(3.1, ANSWER, bytes.fromhex("4300100094010000")),
    frame(3.2, ASK, bytes.fromhex("40ff5f0000000000"), sent=True),
    frame(3.2, ANSWER, bytes.fromhex("80ff5f0000000206")),
    *pair(3.3, 1),
    *pair(3.301, 2),
]
LOST = [
    *pair(1.0, 1),
    *pair(1.001, 2),
    *pair(1.05, 3),  # these three waited
    *pair(1.051, 4),
    emergency(1.06, 0x8110, 0x11),
    *pair(1.07, 24),
    *pair(1.071, 25),
    emergency(2.09, 0x0000, 0x00),
]


def capture(frames: list[CanFrame], stimulus: str = "services", **facts: object) -> Capture:
    return Capture(
        variant=variant("psa2"),
        node=NODE,
        stimulus=stimulus,
        can=CanLog(frames=tuple(frames)),
        marks={"flood": 4.0} if stimulus == "overload" else {"reset": 0.0},
        facts=facts,
    )


SERVICES = (
    c.frames_have_the_identifiers_of_the_node,
    c.no_remote_frames,
    c.identifiers_have_11_bits,
    c.services_are_classic,
    c.state_0_is_said_once,
    c.heartbeats_keep_their_period,
    c.requests_and_answers_take_turns,
)
OVERLOAD = (
    c.emergencies_have_their_form,
    c.a_condition_is_told_once,
    c.the_end_is_told_once,
    c.codes_are_of_the_table,
    c.lost_samples_are_told,
    c.frames_of_a_sample_keep_their_order,
    c.no_more_than_its_queue_waits,
)


@pytest.mark.parametrize("check", SERVICES)
def test_a_good_log_passes(check: Callable[[Capture], str]) -> None:
    assert check(capture(GOOD))


@pytest.mark.parametrize("check", OVERLOAD)
def test_a_good_overload_passes(check: Callable[[Capture], str]) -> None:
    assert check(capture(LOST, "overload", dropped=19))


def swapped(frames: list[CanFrame], at: int, **change: object) -> list[CanFrame]:
    return [f._replace(**change) if k == at else f for k, f in enumerate(frames)]  # type: ignore[arg-type]


BAD: list[tuple[Callable[[Capture], str], list[CanFrame]]] = [
    (c.frames_have_the_identifiers_of_the_node, [*GOOD, frame(4.0, 0x305, bytes(8))]),
    (c.frames_have_the_identifiers_of_the_node, [f for f in GOOD if f.can_id not in (XY, ZT)]),
    (c.no_remote_frames, swapped(GOOD, 8, remote=True)),
    (c.identifiers_have_11_bits, swapped(GOOD, 8, extended=True)),
    (c.services_are_classic, swapped(GOOD, 5, fd=True)),
    (c.state_0_is_said_once, [*GOOD, frame(4.0, BEAT, b"\0")]),
    (c.state_0_is_said_once, GOOD[1:]),
    (c.state_0_is_said_once, swapped(GOOD, 1, data=b"\x7f\0")),
    (c.heartbeats_keep_their_period, swapped(GOOD, 2, t_s=2.0013)),
    (c.requests_and_answers_take_turns, [*GOOD[:6], GOOD[5], *GOOD[6:]]),
    (c.requests_and_answers_take_turns, swapped(GOOD, 5, data=bytes.fromhex("4301100094010000"))),
    (c.requests_and_answers_take_turns, swapped(GOOD, 5, data=b"\x43")),
    (c.requests_and_answers_take_turns, [*GOOD, GOOD[4], GOOD[4]]),
]


@pytest.mark.parametrize(("check", "frames"), BAD)
def test_a_bad_log_does_not(check: Callable[[Capture], str], frames: list[CanFrame]) -> None:
    with pytest.raises(Failed):
        check(capture(frames))


def without(code: int) -> list[CanFrame]:
    return [f for f in LOST if f.can_id != EMCY or f.data[:2] != code.to_bytes(2, "little")]


BAD_OVERLOAD: list[tuple[Callable[[Capture], str], list[CanFrame]]] = [
    (c.emergencies_have_their_form, [*LOST, emergency(3.0, 0x8110, 0x00)]),
    (c.emergencies_have_their_form, [*LOST, frame(3.0, EMCY, bytes(7))]),
    (c.emergencies_have_their_form, [*LOST, emergency(0.5, 0x8110, 0x11)]),
    (c.a_condition_is_told_once, [*LOST[:9], emergency(1.065, 0x8110, 0x11), *LOST[9:]]),
    (c.the_end_is_told_once, without(0)),
    (c.the_end_is_told_once, [*LOST, emergency(3.0, 0, 0)]),
    (c.the_end_is_told_once, without(0x8110)),
    (c.codes_are_of_the_table, [*LOST, emergency(3.0, 0x8111, 0x11)]),
    (c.codes_are_of_the_table, [*LOST, emergency(3.0, 0x8110, 0x01)]),
    (c.codes_are_of_the_table, [*LOST, emergency(3.0, 0x8110, 0x91)]),
    (c.lost_samples_are_told, without(0x8110)),
    (c.lost_samples_are_told, without(0)),
    (c.lost_samples_are_told, [*LOST[:-1], emergency(2.0599, 0, 0)]),
    (c.lost_samples_are_told, [f for f in LOST if f not in LOST[4:6]]),
    (c.frames_of_a_sample_keep_their_order, [LOST[1], LOST[0], *LOST[2:]]),
    (c.frames_of_a_sample_keep_their_order, [*LOST[:4], *LOST[5:]]),
    (c.no_more_than_its_queue_waits, [*LOST[:4], *(f for k in range(3, 13) for f in pair(1.05, k)), *LOST[9:]]),
]


@pytest.mark.parametrize(("check", "frames"), BAD_OVERLOAD)
def test_a_bad_overload_does_not(check: Callable[[Capture], str], frames: list[CanFrame]) -> None:
    with pytest.raises(Failed):
        check(capture(frames, "overload", dropped=19))


@pytest.mark.parametrize("check", [*SERVICES, *OVERLOAD])
def test_an_empty_log_is_no_pass(check: Callable[[Capture], str]) -> None:
    with pytest.raises((Inconclusive, Failed)):
        check(capture([], check.__name__ and "overload"))


def destroyed(count: int, at_s: float = 1.0) -> list[CanFrame]:
    return [frame(at_s + k * 1e-4, 0, error=True) for k in range(count)]


PASSIVE = [*destroyed(16), emergency(1.01, 0x8120, 0x11), emergency(1.1, 0, 0)]
BACK_S = 1.0031 + (1408 + frame_bits(EMCY, emergency(1.0046, 0x8140, 0x11).data)) * 1e-6
AWAY = [*destroyed(32), emergency(1.0046, 0x8140, 0x11)._replace(t_s=BACK_S), emergency(1.0048, 0, 0)]


def test_a_controller_s_troubles() -> None:
    assert "16 error frames" in c.error_passive_is_told(capture(PASSIVE))
    assert "1408 bits" in c.coming_back_to_the_bus_is_told(capture(AWAY))
    for frames in (PASSIVE[1:], PASSIVE[:-1], PASSIVE[:-2]):
        with pytest.raises(Failed):
            c.error_passive_is_told(capture(frames))
    soon = [*AWAY[:-2], AWAY[-2]._replace(t_s=BACK_S - 3e-6), AWAY[-1]]
    for frames in (AWAY[:-1], AWAY[32:], soon):
        with pytest.raises(Failed):
            c.coming_back_to_the_bus_is_told(capture(frames))


def test_a_stream_that_does_not_fit() -> None:
    stopped = [emergency(1.0, 0xFF03, 0x81), emergency(2.0, 0, 0), *pair(2.1, 1)]
    assert c.a_stream_that_does_not_fit_stands(capture(stopped))
    with pytest.raises(Failed):
        c.a_stream_that_does_not_fit_stands(capture([stopped[0], *pair(1.5, 1), *stopped[1:]]))


def test_bits_of_a_frame() -> None:
    """Identifier 0, no data: 34 bits of which the zeros are stuffed, and ten more; by hand."""
    assert frame_bits(0x000, b"") == 34 + 6 + 10
    assert frame_bits(0x555, b"\x55" * 8) >= 8 + 64 + 36
