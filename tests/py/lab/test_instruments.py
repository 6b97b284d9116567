"""Instruments over SCPI, against one written here: what goes over the wire, in which order, and what is raised."""

from __future__ import annotations

import os
import socket
import socketserver
import threading
import tty
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

import pytest
from psabench import instruments
from psabench.errors import BadInput, InstrumentError, LinkError, TimeOut
from psabench.estimate.face import Face
from psabench.instruments import KINDS, Chamber, Head, Instrument, Supply, Table, open_instrument, visa_address

NO_ERROR = '0,"No error"'
Answers = Mapping[str, "str | list[str] | None"]


class Wire:
    """What an instrument received, a program message a line, and what it answers; a list is used up, its last stays."""

    def __init__(self, answers: Answers) -> None:
        self.told: list[str] = []
        self._answers = {k: list(v) if isinstance(v, list) else v for k, v in answers.items()}

    def answer(self, line: str) -> str | None:
        self.told.append(line)
        if line not in self._answers:
            return NO_ERROR if line == "SYST:ERR?" else None
        found = self._answers[line]
        return (found.pop(0) if len(found) > 1 else found[0]) if isinstance(found, list) else found

    @property
    def commands(self) -> list[str]:
        """Without the questions after errors."""
        return [t for t in self.told if t != "SYST:ERR?"]


@contextmanager
def listening(answers: Answers) -> Iterator[tuple[Wire, str]]:
    """An instrument on a TCP port; yields what it received and its VISA address."""
    wire = Wire(answers)

    class Session(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            for line in self.rfile:
                reply = wire.answer(line.decode().rstrip("\n"))
                if reply is not None:
                    self.wfile.write(reply.encode() + b"\n")

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Session) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01}, daemon=True).start()
        try:
            yield wire, f"TCPIP::127.0.0.1::{server.server_address[1]}::SOCKET"
        finally:
            server.shutdown()


@contextmanager
def instrument(kind: str, answers: Answers) -> Iterator[tuple[Instrument, Wire, list[float]]]:
    """The instrument, its wire, and the waits it has asked for."""
    waits: list[float] = []
    with listening(answers) as (wire, address):
        it = open_instrument(kind, address, KINDS[kind], waits.append)
        try:
            yield it, wire, waits
        finally:
            it.close()


SETTINGS: list[tuple[str, Callable[..., object], str]] = [
    ("table", lambda t: t.position(10.0, wait=False), "AXIS1:POS 10.0"),
    ("table", lambda t: t.position(-0.1, 5.0, axis=2, wait=False), "AXIS2:POS -0.1,5.0"),
    ("table", lambda t: t.rate(15.041067 / 3600, axis=3), "AXIS3:RATE 0.004178074166666667"),
    ("table", lambda t: t.sine(2.0, 0.5), "AXIS1:SINE 2.0,0.5"),
    ("table", lambda t: t.stop(wait=False), "AXIS1:STOP"),
    ("table", lambda t: t.zero(12.5), "AXIS1:ZERO 12.5"),
    ("chamber", lambda c: c.set(-60.0), "TEMP -60.0"),
    ("chamber", lambda c: c.ramp(2.0), "RAMP 2.0"),
    ("supply", lambda s: s.set(27.0), "VOLT 27.0"),
    ("supply", lambda s: s.output(True), "OUTP ON"),
    ("supply", lambda s: s.output(False), "OUTP OFF"),
    ("supply", lambda s: s.ripple(0.1, 400.0), "RIPP 0.1,400.0"),
    ("supply", lambda s: s.reset(), "*RST"),
]


@pytest.mark.parametrize(("kind", "call", "sent"), SETTINGS, ids=[s[2] for s in SETTINGS])
def test_a_setting_is_one_command_and_a_look_at_the_error_queue(
    kind: str, call: Callable[..., object], sent: str
) -> None:
    with instrument(kind, {}) as (it, wire, waits):
        call(it)
    assert wire.told == [sent, "SYST:ERR?"]
    assert waits == []


READINGS: list[tuple[str, Callable[..., object], Answers, object]] = [
    ("head", lambda h: h.angle_deg, {"ANGL?": "12.345678901234567"}, 12.345678901234567),
    ("head", lambda h: h.face, {"FACE?": "SIDE_REVERSED"}, Face.SIDE_REVERSED),
    ("head", lambda h: h.at_rest, {"REST?": "0"}, False),
    ("table", lambda t: t.angle_deg(axis=2), {"AXIS2:POS?": "-3.5"}, -3.5),
    ("table", lambda t: t.rate_dps(), {"AXIS1:RATE?": "1E-3"}, 0.001),
    (
        "table",
        lambda t: t.read(axis=1),
        {"AXIS1:POS?;:AXIS1:RATE?;:AXIS1:MODE?;:AXIS1:REST?": "1.5;0.0;POSITION;1"},
        instruments.AxisState(angle_deg=1.5, rate_dps=0.0, mode="position", at_rest=True),
    ),
    ("chamber", lambda c: c.temp_degc, {"TEMP?": "+24.9"}, 24.9),
    ("chamber", lambda c: c.setpoint_degc, {"TEMP:SETP?": "85"}, 85.0),
    ("chamber", lambda c: c.ramp_k_per_min, {"RAMP?": "2"}, 2.0),
    ("chamber", lambda c: c.stable, {"STAB?": "1"}, True),
    ("supply", lambda s: s.volt_v, {"VOLT?": "27"}, 27.0),
    ("supply", lambda s: s.measured_v, {"MEAS:VOLT?": "26.98"}, 26.98),
    ("supply", lambda s: s.is_on, {"OUTP?": "1"}, True),
    ("supply", lambda s: s.identity, {"*IDN?": "psabench,supply,0,0.1.0"}, "psabench,supply,0,0.1.0"),
    ("supply", lambda s: s.numbers("VOLT?;:OUTP?"), {"VOLT?;:OUTP?": "27;1"}, (27.0, 1.0)),
]


@pytest.mark.parametrize(("kind", "call", "answers", "value"), READINGS, ids=[next(iter(r[2])) for r in READINGS])
def test_a_reading_is_one_question(kind: str, call: Callable[..., object], answers: Answers, value: object) -> None:
    with instrument(kind, answers) as (it, wire, _):
        assert call(it) == value
    assert wire.told == list(answers)


def test_the_head_returns_its_scale_when_it_stands_still() -> None:
    with instrument("head", {"REST?": ["0", "0", "1"], "ANGL?": "90.0001"}) as (head, wire, waits):
        assert isinstance(head, Head)
        assert head.turn(90.0) == 90.0001
    assert wire.told == ["ANGL 90.0", "SYST:ERR?", "REST?", "REST?", "REST?", "ANGL?"]
    assert waits == [Head.poll_s] * 2  # time of the bench passes between the looks, and only there


@pytest.mark.parametrize(("lasts_s", "waits_s"), [(1.95, [2.0]), (2.0, [2.0]), (0.0, []), (None, [])])
def test_looks_before_the_end_of_a_motion_are_left_out(lasts_s: float | None, waits_s: list[float]) -> None:
    asked = []
    with instrument("head", {"REST?": ["0", "1"] if not waits_s else ["1"], "ANGL?": "9"}) as (head, wire, waits):
        assert isinstance(head, Head)
        head.lasts = lambda command, **args: asked.append((command, args)) or lasts_s  # type: ignore[func-returns-value]
        assert head.turn(9.0) == 9.0
    assert asked == [("head.read", {})]
    assert wire.told == ["ANGL 9.0", "SYST:ERR?", *["REST?"] * (1 if waits_s else 2), "ANGL?"]
    assert waits == (waits_s or [Head.poll_s])  # a motion that lasts longer than was said is watched to its end


def test_a_face_is_a_word() -> None:
    with instrument("head", {"REST?": "1", "ANGL?": "0"}) as (head, wire, _):
        assert isinstance(head, Head)
        head.mount(Face.SIDE_REVERSED)
        head.mount("direct")
        with pytest.raises(ValueError, match="up"):
            head.mount("up")
    assert [c for c in wire.commands if c.startswith("FACE")] == ["FACE SIDE_REVERSED", "FACE DIRECT"]


def test_what_does_not_come_to_rest_is_told() -> None:
    with instrument("table", {"AXIS1:REST?": "0"}) as (table, _, waits):
        assert isinstance(table, Table)
        with pytest.raises(TimeOut, match=r"table: rest of axis 1 not reached within 0\.5 s"):
            table.wait_rest(limit_s=0.5)
    assert sum(waits) == pytest.approx(0.5)


def test_a_chamber_is_waited_for() -> None:
    with instrument("chamber", {"STAB?": ["0", "1"]}) as (chamber, wire, waits):
        assert isinstance(chamber, Chamber)
        chamber.set(85.0, wait=True)
    assert wire.commands == ["TEMP 85.0", "STAB?", "STAB?"]
    assert waits == [Chamber.poll_s]


def test_a_refusal_has_number_and_text_and_empties_the_queue() -> None:
    errors = [
        '-222,"Data out of range;VOLT 99: 0 ... 36"',
        '-113,"Undefined header"',
        '-350,"Queue overflow"',
        NO_ERROR,
    ]
    with instrument("supply", {"SYST:ERR?": errors}) as (supply, wire, _):
        assert isinstance(supply, Supply)
        with pytest.raises(
            InstrumentError, match=r"^supply: VOLT 99.0: Data out of range;VOLT 99: 0 ... 36 \(-222\)$"
        ) as refused:
            supply.set(99.0)
        assert refused.value.number == -222
        supply.set(9.0)
    assert wire.commands == ["VOLT 99.0", "VOLT 9.0"]


def test_a_profile_needs_as_many_times_as_rates() -> None:
    with instrument("table", {}) as (table, wire, _):
        assert isinstance(table, Table)
        with pytest.raises(ValueError, match="expected as many times as rates, got 2 and 1"):
            table.profile([0.0, 1.0], [1.0])
    assert wire.told == []


def test_a_question_without_an_answer_tells_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(instruments, "REPLY_S", 0.2)
    errors = ['-113,"Undefined header"', NO_ERROR]
    with (
        instrument("supply", {"SYST:ERR?": errors}) as (supply, _, _),
        pytest.raises(InstrumentError, match=r"supply: FOO\?: Undefined header \(-113\)"),
    ):
        supply.query("FOO?")


def test_a_mute_instrument_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(instruments, "REPLY_S", 0.2)
    with (
        instrument("supply", {"SYST:ERR?": None}) as (supply, _, _),
        pytest.raises(TimeOut, match=r"supply at TCPIP::.*: VOLT 5.0: no answer within 0.2 s"),
    ):
        supply.write("VOLT 5.0")


@pytest.mark.parametrize(
    ("answers", "says"),
    [({"VOLT?": "lots"}, "expected numbers"), ({"SYST:ERR?": "fine"}, "expected a number and a text")],
)
def test_an_answer_that_makes_no_sense_is_a_broken_link(answers: Answers, says: str) -> None:
    with instrument("supply", answers) as (supply, _, _), pytest.raises(LinkError, match=says):
        supply.write("VOLT 5") if "SYST:ERR?" in answers else supply.numbers("VOLT?")


def test_an_instrument_that_is_not_there_is_told_at_once() -> None:
    with socket.create_server(("127.0.0.1", 0)) as s:
        port = s.getsockname()[1]
    with pytest.raises(LinkError, match=rf"head at TCPIP::127.0.0.1::{port}::SOCKET: .*is the instrument switched on"):
        open_instrument("head", f"TCPIP::127.0.0.1::{port}::SOCKET", Head, lambda _: None)


@pytest.mark.parametrize("address", ["", "localhost:5025", "TCPIP::127.0.0.1::x::SOCKET", "FOO::1::INSTR"])
def test_what_is_no_address_is_bad_input(address: str) -> None:
    with pytest.raises(BadInput, match=r"expected a VISA address as TCPIP::127\.0\.0\.1::5025::SOCKET"):
        open_instrument("head", address, Head, lambda _: None)


def test_a_serial_instrument_speaks_the_same() -> None:
    ours, theirs = os.openpty()
    tty.setraw(ours)
    tty.setraw(theirs)

    def serve() -> None:
        for answer in (b'0,"No error"\n', b"5.0\n"):
            line = b""
            while not line.endswith(b"?\n"):
                line += os.read(ours, 100)
            os.write(ours, answer)

    server = threading.Thread(target=serve, daemon=True)
    server.start()
    supply = open_instrument("supply", visa_address({"pty": os.ttyname(theirs)}), Supply, lambda _: None)
    supply.set(5.0)
    assert supply.volt_v == 5.0
    supply.close()
    server.join(10)
    os.close(ours)
    os.close(theirs)
