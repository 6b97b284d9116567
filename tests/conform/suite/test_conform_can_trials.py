"""Active tests of the services on CAN against an emulator whose frames are altered on their way: each must notice."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from types import ModuleType

import can
import pytest
from psabench.conform.active import bus_port, can_cycles, can_nmt, can_objects, can_pdo, can_sdo
from psabench.conform.dut import Addresses, Dut
from psabench.conform.plan import plan_of
from psabench.conform.profile import variant
from psabench.conform.proves import suite_tests
from psabench.conform.raw_can import Talk
from psabench.conform.requirements import requirements
from psabench.conform.verdict import Failed, Inconclusive
from psabench.errors import BenchError

Rule = Callable[[can.Message, Talk], list[can.Message]]
Active = Callable[[Dut], str]
MODULES = (can_nmt, can_sdo, can_objects, can_pdo, can_cycles)
SLOW = ("the_history_holds_eight",)
SEED = 20


@pytest.fixture(scope="module", params=["psa2", "pik"])
def board(request: pytest.FixtureRequest) -> Iterator[Dut]:
    with Dut.open(variant(request.param), Addresses()) as s:
        yield s


@pytest.fixture(scope="module")
def bus_board() -> Iterator[Dut]:
    with Dut.open(variant("pik"), Addresses()) as s:
        yield s


def changed(m: can.Message, data: bytes, t_s: float = 0.0) -> can.Message:
    return can.Message(
        arbitration_id=m.arbitration_id, data=data, is_extended_id=False, timestamp=m.timestamp + t_s, check=True
    )


def trials(modules: tuple[ModuleType, ...], s: Dut) -> list[Active]:
    """Those of these modules that can be carried out on this board."""
    rows, v = requirements().rows, s.variant
    names = {m.__name__ for m in modules}
    return [
        p.test
        for p in suite_tests()
        if p.test.__module__ in names
        and plan_of(p.test).is_active
        and not plan_of(p.test).needs - s.probes
        and any(rows[i].applies(v.board, v.profile) for i in p.ids)
    ]


def tampered(monkeypatch: pytest.MonkeyPatch, rule: Rule) -> None:
    heard = Talk.on_message

    def on_message(t: Talk, m: can.Message) -> None:
        for found in rule(m, t):
            heard(t, found)

    monkeypatch.setattr(Talk, "on_message", on_message)


# ---- every active test, on a badly broken board


def mute(m: can.Message, t: Talk) -> list[can.Message]:
    return []


def short(m: can.Message, t: Talk) -> list[can.Message]:
    return [changed(m, bytes(m.data)[:-1])]


def empty(m: can.Message, t: Talk) -> list[can.Message]:
    return [changed(m, b"")]


def noise() -> Rule:
    rng = random.Random(SEED)
    return lambda m, t: [changed(m, rng.randbytes(rng.randrange(9)))]


@pytest.mark.parametrize("how", ["mute", "short", "empty", "noise"])
def test_no_trial_passes_on_a_badly_broken_board(board: Dut, monkeypatch: pytest.MonkeyPatch, how: str) -> None:
    rules: dict[str, Rule] = {"mute": mute, "short": short, "empty": empty, "noise": noise()}
    tampered(monkeypatch, rules[how])
    ways = (can_nmt, can_sdo, can_objects, can_pdo)
    for active in trials(ways, board):
        with pytest.raises((Failed, Inconclusive, BenchError)):
            print(active.__name__, active(board))


def test_all_pass_as_it_is(board: Dut) -> None:
    for active in trials(MODULES, board):
        if active.__name__ not in SLOW:
            assert active(board), active.__name__


def test_a_board_that_beats_on_is_noticed(board: Dut, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(Talk, "beat", lambda t, period_ms: None)  # the write never reaches it
    with pytest.raises(Failed, match="heartbeats with 1017h = 0"):
        can_nmt.no_heartbeat_where_the_period_is_0(board)


# ---- a fault for each


def answers(index: int, change: Callable[[bytes], bytes], sub: int | None = None) -> Rule:
    """The SDO answers that name an object."""

    def rule(m: can.Message, t: Talk) -> list[can.Message]:
        d = bytes(m.data)
        mine = m.arbitration_id == t.sdo_tx and d[1:3] == index.to_bytes(2, "little") and sub in (None, d[3])
        return [changed(m, change(d))] if mine else [m]

    return rule


def aborts(change: Callable[[bytes], bytes]) -> Rule:
    """All aborts."""

    def rule(m: can.Message, t: Talk) -> list[can.Message]:
        d = bytes(m.data)
        return [changed(m, change(d))] if m.arbitration_id == t.sdo_tx and d[0] == 0x80 else [m]

    return rule


def other_code(d: bytes) -> bytes:
    return d[:4] + bytes([d[4] ^ 1]) + d[5:]


def of(which: str, change: Callable[[can.Message], list[can.Message]]) -> Rule:
    """Frames of a service: heartbeat, emcy, sdo_tx, or pdo."""

    def rule(m: can.Message, t: Talk) -> list[can.Message]:
        ids = t.pdos.values() if which == "pdo" else [getattr(t, which)]
        return change(m) if m.arbitration_id in ids else [m]

    return rule


def twice(m: can.Message) -> list[can.Message]:
    return [m, m]


def gone(m: can.Message) -> list[can.Message]:
    return []


def always(state: int) -> Rule:
    return of("heartbeat", lambda m: [m if not m.data[0] else changed(m, bytes([state]))])


def late(t_s: float) -> Callable[[can.Message], list[can.Message]]:
    """Every second frame later."""
    count = iter(range(1 << 30))
    return lambda m: [changed(m, bytes(m.data), t_s * (next(count) % 2))]


def plus_one(d: bytes) -> bytes:
    return d[:4] + (int.from_bytes(d[4:], "little") + 1 & 0xFFFFFFFF).to_bytes(4, "little") if d[0] == 0x43 else d


def last(when: Callable[[int], bool], bit: int) -> Callable[[can.Message], list[can.Message]]:
    """The bit that ends an upload in segments, where a segment has so many bytes without data."""

    def change(m: can.Message) -> list[can.Message]:
        command = m.data[0]
        mine = command & 0xE0 == 0 and when(command >> 1 & 7)
        return [changed(m, bytes([command & 0xFE | bit, *m.data[1:]]))] if mine else [m]

    return change


def frozen(d: bytes) -> bytes:
    return d[:4] + bytes([1, 0, 0, 0]) if d[0] == 0x43 else d


FAULTS: list[tuple[Active, Rule]] = [
    (can_nmt.it_listens_at_the_identifiers_of_its_node, answers(0x2030, frozen)),
    (can_nmt.boot_up_is_the_first_frame, of("heartbeat", twice)),
    (can_nmt.boot_up_is_the_first_frame, of("heartbeat", lambda m: [changed(m, b"\1")])),
    (can_nmt.it_waits_pre_operational, always(5)),
    (can_nmt.start_makes_it_operational, always(0x7F)),
    (can_nmt.start_makes_it_operational, of("pdo", gone)),
    (can_nmt.stop_stops_it, always(5)),
    (can_nmt.pre_operational_ends_its_pdos, always(5)),
    (can_nmt.reset_node_restores_the_defaults, answers(0x1017, lambda d: d.replace(b"\xe8\3", b"\xe9\3"))),
    (can_nmt.reset_communication_leaves_the_board_alone, answers(0x1800, lambda d: d[:4] + b"\7\0\0\0")),
    (can_nmt.node_0_is_everybody, always(0x7F)),
    (can_nmt.unknown_commands_change_nothing, always(0x7F)),
    (can_nmt.stopped_it_only_beats, always(0x7F)),
    (can_nmt.a_stop_ends_a_transfer, aborts(other_code)),
    (can_nmt.a_new_period_holds_at_once, of("heartbeat", late(0.002))),
    (can_sdo.short_values_come_expedited, of("sdo_tx", lambda m: [changed(m, bytes([m.data[0] ^ 4, *m.data[1:]]))])),
    (
        can_sdo.long_values_come_in_segments,
        of("sdo_tx", last(lambda empty: empty == 0, 0)),
    ),  # after a full segment more
    (
        can_sdo.long_values_come_in_segments,
        of("sdo_tx", last(lambda empty: empty == 0, 1)),
    ),  # ends at the first full one
    (can_sdo.long_values_come_in_segments, of("sdo_tx", last(lambda empty: empty > 0, 0))),
    (can_sdo.a_write_is_confirmed, answers(0x1017, lambda d: b"\x61" + d[1:] if d[0] == 0x60 else d)),
    (can_sdo.a_silent_client_is_given_up, of("sdo_tx", late(0.002))),
    (can_sdo.a_silent_client_is_given_up, aborts(other_code)),
    (can_sdo.a_wrong_toggle_bit_is_refused, aborts(other_code)),
    (can_sdo.unknown_commands_are_refused, aborts(other_code)),
    (can_sdo.no_such_object, aborts(other_code)),
    (can_sdo.no_such_sub_index, aborts(other_code)),
    (can_sdo.rights_are_kept, aborts(other_code)),
    (can_sdo.the_wrong_length_is_refused, aborts(other_code)),
    (can_sdo.other_than_announced_is_refused, aborts(other_code)),
    (can_sdo.limits_are_kept, aborts(other_code)),
    (can_sdo.requests_of_the_wrong_length_are_counted, answers(0x2030, frozen)),
    (can_sdo.each_request_has_one_answer, of("sdo_tx", twice)),
    (can_sdo.refusals_are_counted, answers(0x2030, frozen)),
    (can_sdo.an_abort_of_the_client_ends_it, aborts(lambda d: b"\1" + d[1:])),
    (can_objects.the_common_objects_are_there, answers(0x1005, plus_one)),
    (can_objects.device_type, answers(0x1000, lambda d: d[:4] + b"\x95\1\0\0")),
    (can_objects.constants_name_the_node, answers(0x1200, plus_one)),
    (can_objects.mappings_lay_out_the_messages, answers(0x1A00, lambda d: d[:4] + bytes([d[4] ^ 8]) + d[5:], 1)),
    (can_objects.mapped_objects_read_as_the_frames, of("pdo", lambda m: [changed(m, bytes(m.data)[::-1])])),
    (can_objects.counters_outlive_a_reset, answers(0x2030, lambda d: d[:4] + bytes(4))),
    (
        can_objects.the_load_is_the_share_of_the_bus,
        answers(0x2030, lambda d: d[:4] + b"\xff" + d[5:] if d[0] == 0x4B else d),
    ),
    (can_objects.an_answer_waits_for_the_interframe_space, of("sdo_tx", lambda m: [changed(m, bytes(m.data), -3e-6)])),
    (can_pdo.syncs_are_counted, answers(0x2030, frozen)),
    (can_pdo.event_types_send_each_reading, of("pdo", twice)),
    (can_pdo.type_0_sends_new_readings_at_sync, of("pdo", twice)),
    (can_pdo.type_n_sends_at_every_nth_sync, of("pdo", twice)),
    (can_pdo.reserved_types_are_refused, aborts(other_code)),
    (can_pdo.the_identifier_of_a_tpdo, aborts(other_code)),
    (can_pdo.the_inhibit_time_keeps_tpdos_apart, of("pdo", late(-0.002))),
    (can_pdo.the_history_of_errors, answers(0x1003, lambda d: d[:4] + b"\x20" + d[5:] if d[0] == 0x43 else d)),
    (can_pdo.the_history_of_errors, of("emcy", gone)),
]


@pytest.mark.parametrize(("active", "rule"), FAULTS, ids=[f"{k}-{t.__name__}" for k, (t, _) in enumerate(FAULTS)])
def test_a_trial_notices_its_fault(board: Dut, monkeypatch: pytest.MonkeyPatch, active: Active, rule: Rule) -> None:
    tampered(monkeypatch, rule)
    with pytest.raises((Failed, Inconclusive)):
        print(active(board))


def early_cycles(m: can.Message) -> list[can.Message]:
    return [changed(m, bytes(m.data), -0.0008 if m.data[1:3] == b"\2\x20" else 0.0)]


OFF: list[tuple[Active, Rule]] = [
    (can_nmt.a_new_period_holds_at_once, of("heartbeat", late(0.002))),
    (can_sdo.a_silent_client_is_given_up, of("sdo_tx", late(0.002))),
    (can_pdo.the_inhibit_time_keeps_tpdos_apart, of("pdo", late(-0.002))),
    (can_cycles.the_answer_waits_for_the_strobe, of("sdo_tx", early_cycles)),
]


@pytest.mark.parametrize(("active", "rule"), OFF, ids=[t.__name__ for t, _ in OFF])
def test_clocks_may_lie_as_far_apart_as_the_run_allows(
    bus_board: Dut, monkeypatch: pytest.MonkeyPatch, active: Active, rule: Rule
) -> None:
    tampered(monkeypatch, rule)
    with pytest.raises(Failed):
        active(bus_board)
    monkeypatch.setattr(bus_board, "allowed_ppm", 50_000.0)
    assert active(bus_board)


CYCLES: list[tuple[Active, Rule]] = [
    (can_cycles.an_object_is_a_cycle, answers(0x2002, lambda d: d[:4] + bytes([d[4] ^ 1]) + d[5:])),
    (can_cycles.the_answer_waits_for_the_strobe, answers(0x2002, lambda d: b"\x80" + d[1:])),
    (can_cycles.refusals_have_their_codes, aborts(other_code)),
    (can_cycles.refusals_have_their_codes, answers(0x2030, frozen)),
    (can_cycles.a_short_strobe_is_refused, aborts(other_code)),
    (can_cycles.a_second_cycle_is_refused, aborts(other_code)),
    (can_cycles.other_lengths_are_no_cycle, aborts(other_code)),
    (can_cycles.cycles_are_counted, answers(0x2030, frozen)),
    (can_cycles.a_strobe_that_is_too_long_is_refused, aborts(other_code)),
    (can_cycles.who_gives_up_finds_the_bus_busy, aborts(other_code)),
    (bus_port.the_port_reads_what_can_reads, answers(0x2002, lambda d: d[:4] + bytes([d[4] ^ 1]) + d[5:])),
]


@pytest.mark.parametrize(("active", "rule"), CYCLES, ids=[f"{k}-{t.__name__}" for k, (t, _) in enumerate(CYCLES)])
def test_a_trial_of_cycles_notices(bus_board: Dut, monkeypatch: pytest.MonkeyPatch, active: Active, rule: Rule) -> None:
    tampered(monkeypatch, rule)
    with pytest.raises((Failed, Inconclusive)):
        print(active(bus_board))


PORT: list[tuple[Active, str, str]] = [
    (bus_port.each_line_has_its_answer_in_turn, "E syntax", "E number"),
    (bus_port.a_read_cycle_and_its_answer, "h ", " "),
    (bus_port.a_write_cycle_and_its_answer, "W ", "R "),
    (bus_port.refused_lines_say_why, "E no-address", "E read-only"),
    (bus_port.it_says_who_is_there, "00h=", "01h="),
    (bus_port.a_long_line_is_refused, "E overlong", "E syntax"),
    (bus_port.spelling_makes_no_difference, "R 0", "E 0"),
    (bus_port.times_go_on_by_the_strobe, " t=", " t=0"),
    (bus_port.times_are_those_of_cs, " t=", " t=1"),
    (can_cycles.a_short_strobe_is_refused_by_the_port, "too-short", "busy"),
    (can_cycles.a_reset_cuts_a_cycle, "E off", "E busy"),
]


@pytest.mark.parametrize(("active", "old", "new"), PORT, ids=[t.__name__ for t, *_ in PORT])
def test_a_trial_of_the_port_notices(
    bus_board: Dut, monkeypatch: pytest.MonkeyPatch, active: Active, old: str, new: str
) -> None:
    port = bus_board.port
    assert port is not None
    assert active(bus_board)
    answered = port.answered
    monkeypatch.setattr(port, "answered", lambda *a: answered(*a).replace(old, new))
    with pytest.raises((Failed, Inconclusive)):
        print(active(bus_board))
