"""Instruments in SCPI, through PyVISA and PyVISA-py unmodified: over TCP and pseudo-terminals, several clients."""

from __future__ import annotations

import json
import socket
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest
import pyvisa
from psabench.emulator import Emulator
from psabench.errors import BadInput, ControlError
from psabench.link.control import Control
from psabench.link.vcd import read_vcd
from pyvisa.resources import MessageBasedResource
from rig import HOST, TIMEOUT_S, until

pytestmark = HOST

LAB = """\
head: {turn_s: 2}
table: {axes: 2}
chamber: {}
supply: {}
units: [{name: a, node: 5}]
"""
NO_ERROR = '0,"No error"'
KINDS = ("head", "table", "chamber", "supply")


class Lab:
    """An emulator with all four instruments, by VISA address."""

    def __init__(self, emulator: Emulator, control: Control) -> None:
        self.emulator = emulator
        self.control = control
        self._visa = pyvisa.ResourceManager("@py")

    def address(self, kind: str, over: str = "tcp") -> str:
        end = next(e for e in self.emulator.endpoints if e.get("scpi") == kind and ("pty" in e) == (over == "pty"))
        return f"ASRL{end['pty']}::INSTR" if over == "pty" else f"TCPIP::{end['host']}::{end['port']}::SOCKET"

    def open(self, kind: str, over: str = "tcp") -> Any:
        """A client of the instrument; answers end in LF, which is all that VISA has to be told."""
        resource: MessageBasedResource = self._visa.open_resource(self.address(kind, over))  # type: ignore[assignment]
        resource.read_termination = resource.write_termination = "\n"
        resource.timeout = round(TIMEOUT_S * 1000)
        return resource

    def run(self, for_s: float) -> None:
        self.control.call("run", for_s=for_s)


MakeLab = Callable[..., Lab]


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[Lab]:
    with opened(tmp_path) as made:
        yield made


@contextmanager
def opened(
    folder: Path, pace: str = "step", extra: Sequence[str] = ("--scpi", "all", "--scpi", "all:pty")
) -> Iterator[Lab]:
    (folder / "lab.yaml").write_text(LAB)
    with Emulator(folder / "lab.yaml", cans=["none"], pace=pace, truth=True, extra=extra) as emulator:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            yield Lab(emulator, control)


# ---- through VISA

# message (None: nothing is asked), answer; then SYST:ERR? says that there is no error
SESSIONS: dict[str, list[tuple[str, str | None]]] = {
    "head": [
        ("ANGLe?;FACE?;REST?", "0;DIRECT;1"),
        ("FACE SIDE", None),
        ("FACE?", "SIDE"),
        ("angle 90 deg", None),
        ("REST?", "0"),
        ("ANGL? MAX", "3600"),
    ],
    "table": [
        ("AXIS1:MODE?;REST?", "STOPPED;1"),
        ("AXIS2:RATE 10 DPS;ZERO 0", None),
        ("AXIS2:MODE?;REST?;:AXIS1:MODE?", "RATE;0;STOPPED"),
        ("*RST", None),
        ("AXIS2:MODE?", "STOPPED"),
    ],
    "chamber": [
        ("STABle?", "1"),
        ("RAMP 1 K/MIN;TEMPerature 303.15 K", None),
        ("STAB?;RAMP?", "0;1"),
        ("*RST", None),
        ("STAB?", "1"),
    ],
    "supply": [
        ("OUTPut?", "1"),
        ("VOLTage 11500 MV", None),
        ("VOLT?", "11.5"),
        ("OUTP OFF", None),
        ("OUTP?;:MEAS:VOLT?", "0;0"),
        ("*RST", None),
        ("OUTP?", "1"),
    ],
}


@pytest.mark.parametrize("over", ["tcp", "pty"])
@pytest.mark.parametrize("kind", KINDS)
def test_pyvisa_drives_each_instrument(lab: Lab, kind: str, over: str) -> None:
    with closing(lab.open(kind, over)) as it:
        maker, model, serial, version = it.query("*IDN?").split(",")
        assert (maker, serial) == ("psabench", "0")
        assert kind.upper() in model
        assert version[0].isdigit()
        assert it.query("*ESR?") == "128"  # power on: a session of its own
        for message, answer in SESSIONS[kind]:
            if answer is None:
                it.write(message)
            else:
                assert it.query(message) == answer, message
            assert it.query("SYST:ERR?") == NO_ERROR, message
        assert it.query("*TST?;*STB?;SYST:VERS?") == "0;16;1999.0"


def test_bad_messages_give_standard_errors_and_change_nothing(lab: Lab) -> None:
    with closing(lab.open("head")) as it:
        for message, number in [
            ("FLY", -113),
            ("ANGL", -109),
            ("ANGL 1,2", -108),
            ("ANGL 1 V", -131),
            ("ANGL 4000", -222),
            ("ANGL 'x", -151),
            ("FACE UP", -224),
            ("@", -101),
        ]:
            it.write(message)
            assert int(it.query("SYST:ERR?").split(",")[0]) == number, message
        assert it.query("ANGL?;FACE?;REST?;:SYST:ERR:COUN?") == "0;DIRECT;1;0"


def test_a_refusal_tells_the_permitted_range_as_json_does(lab: Lab) -> None:
    with closing(lab.open("table")) as it:
        it.write("AXIS2:RATE 1E4")
        _, text = it.query("SYST:ERR?").split(",", 1)
    with pytest.raises(ControlError) as refused:
        lab.control.call("table.rate", axis=2, rate_dps=1e4)
    why = text.strip('"').removeprefix("Data out of range;")
    assert "rate_dps: expected " in why
    assert why in str(refused.value)


def test_each_client_has_its_own_errors_and_all_see_the_same_instrument(lab: Lab) -> None:
    clients = [lab.open("head"), lab.open("head"), lab.open("head"), lab.open("head", "pty")]
    try:
        for n, it in enumerate(clients):
            for _ in range(n):
                it.write("FLY")
        assert [it.query("SYST:ERR:COUN?") for it in clients] == ["0", "1", "2", "3"]
        clients[0].write("FACE REVERSED")
        assert clients[0].query("SYST:ERR?") == NO_ERROR
        assert {it.query("FACE?") for it in clients} == {"REVERSED"}
    finally:
        for it in clients:
            it.close()


def test_a_terminal_that_is_opened_anew_has_a_new_queue(lab: Lab) -> None:
    for _ in range(2):
        with closing(lab.open("head", "pty")) as it:
            it.write("FLY;FLY")
            it.write("FLY")
            assert it.query("*ESR?;:SYST:ERR:COUN?") == "160;2"  # power on, command error


# ---- time


def test_opc_query_answers_at_the_end_of_the_motion(lab: Lab) -> None:
    with closing(lab.open("head")) as it, closing(lab.open("head", "pty")) as other:
        assert it.query("REST?") == "1"  # it is there: from now on its messages come in the order of sending
        it.write("ANGL 90;*OPC?;ANGL?")
        assert other.query("REST?") == "0"  # served meanwhile
        lab.run(1.9)
        assert other.query("REST?") == "0"
        lab.run(0.2)
        done, angle_deg = it.read().split(";")
        assert done == "1"
        assert float(angle_deg) == pytest.approx(90.0)


def test_opc_query_waits_in_real_time(tmp_path: Path) -> None:
    with opened(tmp_path, "wall") as lab, closing(lab.open("head")) as it:
        before_ns = lab.control.call("time").t_ns
        assert it.query("ANGL 10;*OPC?;REST?") == "1;1"
        assert lab.control.call("time").t_ns - before_ns >= 2_000_000_000


def test_what_was_sent_before_a_run_is_done_before_it(lab: Lab) -> None:
    """Nothing is asked in between: the order of service alone makes it so."""
    with closing(lab.open("head")) as head, closing(lab.open("table", "pty")) as table:
        for turn in range(1, 21):
            head.write(f"ANGL {turn}")
            table.write(f"AXIS1:ZERO {turn}")
            lab.run(2.5)
            assert head.query("REST?") == "1"
            assert float(head.query("ANGL?")) == pytest.approx(turn)
            assert float(table.query("AXIS1:POS?")) == pytest.approx(turn, abs=1e-3)


def script(folder: Path) -> list[str]:
    """All that four instruments say in a session of some minutes."""
    said: list[str] = []
    folder.mkdir()
    with opened(folder) as lab:
        its = {kind: lab.open(kind) for kind in KINDS}
        its["table"].write("AXIS1:SINE 10,0.5;:AXIS2:PROF 0,10, 2,-20, 5,0;*OPC")
        its["chamber"].write("RAMP 3;TEMP 40")
        its["supply"].write("RIPP 0.2,50")
        for step in range(30):
            its["head"].write(f"ANGL {12 * step}")
            lab.run(2.2503)
            said += [its["head"].query("ANGL?;REST?;:STAT:OPER?"), its["supply"].query("MEAS:VOLT?")]
            said += [its["table"].query("AXIS1:POS?;RATE?;:AXIS2:POS?;RATE?;:STAT:OPER:COND?;*ESR?")]
            said += [its["chamber"].query("TEMP?;STAB?")]
        for it in its.values():
            it.close()
    return said


def test_the_same_script_hears_the_same_answers(tmp_path: Path) -> None:
    assert script(tmp_path / "one") == script(tmp_path / "two")


# ---- sockets, without VISA


def raw(lab: Lab) -> socket.socket:
    host, port = lab.address("head").split("::")[1:3]
    return socket.create_connection((host, int(port)), TIMEOUT_S)


def test_messages_in_pieces_too_long_or_of_any_bytes_are_told_apart(lab: Lab) -> None:
    with raw(lab) as s, s.makefile("rb") as answers:
        s.sendall(b"*ID")
        s.sendall(b"N?\r\n")
        assert answers.readline().startswith(b"psabench,")
        s.sendall(b"ANGL " + b"1" * 5000 + b"\nSYST:ERR?\n")
        assert answers.readline().startswith(b"-363,")
        s.sendall(bytes(b for b in range(256) if b != 10) + b"\nSYST:ERR:ALL?;*TST?\n")
        assert answers.readline().endswith(b";0\n")
        s.sendall(b"REST?\n" * 1000)
        assert [answers.readline() for _ in range(1000)] == [b"1\n"] * 1000


def test_clients_may_vanish_in_a_wait_and_there_is_room_for_sixteen(lab: Lab) -> None:
    for _ in range(20):
        with raw(lab) as s:
            s.sendall(b"ANGL 5;*OPC?\n")
    many = [raw(lab) for _ in range(16)]
    for s in many:
        s.sendall(b"*TST?\n")
    assert [s.recv(10) for s in many] == [b"0\n"] * 16
    with raw(lab) as s:
        assert s.recv(10) == b""
    for s in many:
        s.close()
    until(lambda: answered(lab), "room for a client")


def answered(lab: Lab) -> bool:
    with raw(lab) as s:
        s.sendall(b"*TST?\n")
        return s.recv(10) == b"0\n"


# ---- options


@pytest.mark.parametrize(
    ("given", "want"),
    [
        ("fly", "--scpi: expected head, table, chamber, supply or all"),
        ("head:x", '--scpi: expected pty[:LINK] or a port from 0 (any free port) to 65535, got "head:x"'),
        ("head:70000", 'got "head:70000"'),
        ("", "--scpi: expected head, table"),
    ],
)
def test_a_wrong_option_is_one_line(tmp_path: Path, given: str, want: str) -> None:
    with pytest.raises(BadInput) as failed, opened(tmp_path, extra=["--scpi", given]):
        pass
    assert want in str(failed.value)


def test_an_instrument_that_the_scenario_lacks_is_refused(tmp_path: Path) -> None:
    with (
        pytest.raises(BadInput, match="expected a scenario with a table"),
        Emulator("quiet", cans=["none"], extra=["--scpi", "table"]),
    ):
        pass
    with Emulator("quiet", cans=["none"], extra=["--scpi", "all"]) as emulator:
        assert [e["scpi"] for e in emulator.endpoints if "scpi" in e] == ["head"]


def test_links_of_terminals_are_made_and_removed(tmp_path: Path) -> None:
    link = tmp_path / "lab"
    with opened(tmp_path, extra=["--scpi", f"all:pty:{link}"]):
        assert sorted(p.name for p in tmp_path.glob("lab.*") if p.is_symlink()) == sorted(f"lab.{k}" for k in KINDS)
    assert not [p for p in tmp_path.glob("lab.*") if p.is_symlink()]


# ---- the control socket's own commands that look on


def test_run_until_ends_at_the_event(lab: Lab) -> None:
    first = lab.control.call("run.until", event="DRD_A", limit_s=5)
    assert first.result == {"reached": True, "seen": 1}
    third = lab.control.call("run.until", event="DRD_A", count=2, limit_s=5)
    assert third.result["seen"] == 2
    assert third.t_ns > first.t_ns
    never = lab.control.call("run.until", event="POWER_DOWN", limit_s=0.5)
    assert never.result == {"reached": False, "seen": 0}
    assert never.t_ns - third.t_ns == 500_000_000


def test_subscribers_hear_events_and_status(lab: Lab) -> None:
    with socket.socket(socket.AF_UNIX) as s:
        s.connect(str(lab.control.path))
        s.sendall(b'{"id":1,"cmd":"subscribe","args":{"what":"events"}}\n')
        s.sendall(b'{"id":2,"cmd":"subscribe","args":{"what":"status","every_s":0.1}}\n')
        lines = s.makefile("rb")
        assert all(json.loads(lines.readline())["ok"] for _ in range(2))
        lab.run(0.35)
        s.sendall(b'{"id":3,"cmd":"unsubscribe"}\n')
        heard: list[dict[str, Any]] = []
        while not heard or "ok" not in heard[-1]:
            heard.append(json.loads(lines.readline()))
        lines.close()
    times_ns = [h["t_ns"] for h in heard]
    assert times_ns == sorted(times_ns)
    status = [h for h in heard if h.get("event") == "status"]
    assert [h["t_ns"] for h in status] == [100_000_000, 200_000_000, 300_000_000]
    assert {"pace", "frames", "head_deg", "angle_deg", "rate_dps", "temp_degc", "supply_v"} <= set(status[0])
    assert {"DRD_A", "SYNC_A"} <= {h["event"] for h in heard[:-1]}


def test_a_subscriber_that_does_not_read_stops_nobody_and_is_told_what_it_lost(lab: Lab) -> None:
    with socket.socket(socket.AF_UNIX) as s:
        s.connect(str(lab.control.path))
        s.sendall(b'{"id":1,"cmd":"subscribe","args":{"what":"status","every_s":0.001}}\n')
        with s.makefile("rb") as lines:
            assert json.loads(lines.readline())["ok"]
            lab.run(20)
            heard = [json.loads(lines.readline())]
            while heard[-1]["event"] != "lost" and heard[-1]["t_ns"] < 20_000_000_000:
                heard.append(json.loads(lines.readline()))
                if len(heard) == 3000:
                    lab.run(0.01)  # there is room again: the loss is reported
    assert heard[-1]["event"] == "lost"
    assert heard[-1]["lines"] + len(heard) - 1 >= 20_000


def test_a_recording_begins_and_ends_on_command(lab: Lab, tmp_path: Path) -> None:
    path = tmp_path / "part.vcd"
    lab.run(0.2)
    lab.control.call("vcd.start", path=str(path))
    with pytest.raises(ControlError, match="a recording is running"):
        lab.control.call("vcd.start", path=str(path))
    lab.run(0.05)
    lab.control.call("vcd.stop")
    with pytest.raises(ControlError, match="no recording"):
        lab.control.call("vcd.stop")
    recorded = read_vcd(path)
    assert recorded is not None
    size = path.stat().st_size
    lab.run(0.05)
    assert path.stat().st_size == size > 1000
    levels = lab.control.call("lines").result["lines"]
    assert len(levels) == 16
    assert levels["Res"] == 1


def test_the_true_state_follows_the_instruments(tmp_path: Path) -> None:
    with opened(tmp_path) as lab:
        with closing(lab.open("table")) as it:
            it.write("AXIS2:POS 30,10")
            assert it.query("SYST:ERR?") == NO_ERROR
        lab.run(10)
        assert lab.emulator.truth_path is not None
        with Control(lab.emulator.truth_path) as port:
            state = port.call("truth.state").result
        assert state["table"][1]["angle_deg"] == pytest.approx(30.0, abs=0.01)
        assert state["table"][0]["rate_dps"] == 0.0
        assert state["supply_v"] == pytest.approx(12.0, abs=0.1)
        assert len(state["unit"]["f_mps2"]) == len(state["unit"]["w_radps"]) == 3
