"""The host's link layer against stand-ins: a control socket, a bus and an emulator that say what the test wants."""

from __future__ import annotations

import json
import os
import socket
import struct
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import can
import pytest
from psabench import emulator
from psabench.emulator import Emulator
from psabench.errors import BadInput, BenchError, ControlError, DeviceError, LinkError
from psabench.link import can_host
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.canopen_host import CanopenNode
from psabench.link.control import Control
from psabench.link.endpoints import emulator_buses
from psabench.places import find_emulator, proto_file

IDLE = {"clients": [{"taken": 3}], "gone": {"taken": 4}}


class FakeControl:
    """A control socket that gives prepared replies in order and remembers the requests."""

    def __init__(self, path: Path, replies: Sequence[dict[str, Any] | bytes]) -> None:
        self.requests: list[dict[str, Any]] = []
        self._replies = replies
        self._listen = socket.socket(socket.AF_UNIX)
        self._listen.bind(str(path))
        self._listen.listen()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def _serve(self) -> None:
        peer, _ = self._listen.accept()
        with peer, peer.makefile("rwb") as lines:
            for reply in self._replies:
                request = json.loads(lines.readline())
                self.requests.append(request)
                if isinstance(reply, dict):
                    reply = (
                        json.dumps({"id": request["id"], "t_ns": 0, "can_rx": 0, "ok": True} | reply).encode() + b"\n"
                    )
                lines.write(reply)
                lines.flush()

    def close(self) -> None:
        self._thread.join(10)
        assert not self._thread.is_alive(), "the host asked for less than the test expects"
        self._listen.close()


@contextmanager
def control(tmp_path: Path, *replies: dict[str, Any] | bytes) -> Iterator[tuple[Control, FakeControl]]:
    path = tmp_path / "control"
    with closing(FakeControl(path, replies)) as fake, Control(path) as port:
        yield port, fake


class FakeBus(can.BusABC):
    """A bus that hands out prepared messages; None is silence."""

    def __init__(self, messages: Sequence[can.Message | Exception | None] = ()) -> None:
        super().__init__(channel="fake")
        self.waiting = list(messages)
        self.sent: list[can.Message] = []

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        first = self.waiting.pop(0) if self.waiting else None
        if isinstance(first, Exception):
            raise first
        return first, False

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append(msg)


def frame(can_id: int, **flags: bool) -> can.Message:
    return can.Message(arbitration_id=can_id, is_extended_id=False, **flags)


# ---- control socket


def test_a_command_is_one_object_a_line_and_its_reply_comes_back(tmp_path: Path) -> None:
    with control(tmp_path, {"t_ns": 5, "can_rx": 7, "result": {"angle_deg": 1.5}}) as (port, fake):
        reply = port.call("head.turn", angle_deg=1.5)
    assert fake.requests == [{"id": 1, "cmd": "head.turn", "args": {"angle_deg": 1.5}}]
    assert (reply.t_ns, reply.can_rx, reply.result) == (5, 7, {"angle_deg": 1.5})


def test_a_refusal_carries_code_and_text(tmp_path: Path) -> None:
    with (
        control(tmp_path, {"ok": False, "error": {"code": "range", "text": "too far"}}) as (port, _),
        pytest.raises(ControlError, match=r"head\.turn: too far") as refused,
    ):
        port.call("head.turn", angle_deg=1e9)
    assert refused.value.code == "range"


@pytest.mark.parametrize(
    ("reply", "says"),
    [
        (b"", "time: connection closed by the emulator"),
        (b'{"id": 99, "ok": true}\n', "expected the reply to request 1, got 99"),
        (b"nonsense\n", "time: expected a reply"),
        (b"[]\n", "time: expected a reply"),
        (b'{"id": 1, "ok": true}\n', "time: expected a reply"),
    ],
)
def test_what_is_no_reply_is_a_broken_link(tmp_path: Path, reply: bytes, says: str) -> None:
    with control(tmp_path, reply) as (port, _), pytest.raises(LinkError, match=says):
        port.call("time")


def test_a_control_socket_that_is_not_there_is_named(tmp_path: Path) -> None:
    absent = r"no/control: expected the control .*, got no such file; is psa-emu running with --control\?"
    with pytest.raises(LinkError, match=absent):
        Control(tmp_path / "no/control")


def test_what_was_subscribed_stands_between_replies_and_waits(tmp_path: Path) -> None:
    news = b'{"event": "DRD_A", "unit": "a", "t_ns": 1}\n'
    with control(tmp_path, news + b'{"id": 1, "ok": true, "t_ns": 2}\n' + news[:9], news[9:]) as (port, _):
        assert port.call("time").t_ns == 2
        assert [e["t_ns"] for e in port.events] == [1]
        assert port.next_event(10.0) == {"event": "DRD_A", "unit": "a", "t_ns": 1}
        assert port.next_event(0.01) is None  # half a line has come
        with pytest.raises(LinkError, match="time: connection closed by the emulator"):
            port.call("time")  # the other half, and the end
        assert len(port.events) == 1


def test_the_reply_to_a_call_that_was_interrupted_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with control(tmp_path, {"t_ns": 1}, {"t_ns": 2}) as (port, _):
        with monkeypatch.context() as m:
            m.setattr(port, "_line", lambda *_: (_ for _ in ()).throw(KeyboardInterrupt))
            with pytest.raises(KeyboardInterrupt):
                port.call("run", for_s=1.0)
        assert port.call("time").t_ns == 2


def test_each_bus_with_units_is_opened_where_it_is_served(tmp_path: Path) -> None:
    units = {"units": [{"name": n, "bus": bus} for n, bus in (("a", "can1"), ("b", "can0"), ("c", "can1"))]}
    slcan = {"can": "slcan", "pty": "/dev/pts/7"}
    server = {"can": "socketcand", "host": "127.0.0.1", "port": "1"}
    cases: list[tuple[list[dict[str, str]], dict[str, str]]] = [
        ([slcan | {"bus": "can0"}], {"can0": "slcan:/dev/pts/7"}),
        ([slcan], {"can1": "slcan:/dev/pts/7"}),  # the first of them
        ([server], {b: f"socketcand:127.0.0.1:1,channel={b}" for b in ("can1", "can0")}),
        (
            [{"scpi": "head"}, slcan | {"bus": "can0"}, server],
            {"can0": "slcan:/dev/pts/7", "can1": "socketcand:127.0.0.1:1,channel=can1"},
        ),
        ([{"control": "x"}], {}),
    ]
    for k, (endpoints, want) in enumerate(cases):
        path = tmp_path / str(k)
        with closing(FakeControl(path, [{"result": units}])):
            assert emulator_buses(endpoints, path) == want
    assert emulator_buses([server], None) == {"can0": "socketcand:127.0.0.1:1"}


# ---- clocks


def test_a_step_waits_for_what_was_sent_and_ends_when_all_frames_have_come(tmp_path: Path) -> None:
    bus = FakeBus([frame(0x185), None, frame(0x285), frame(0x705)])
    replies = ({"can_rx": 10, "t_ns": 2_000_000_000, "result": IDLE}, {"can_rx": 12, "t_ns": 2_500_000_000})
    with control(tmp_path, *replies) as (port, fake), CanHost(bus, StepClock(port)) as host:
        host.send(0x605, b"\x40")
        host.advance(0.5)
        assert host.clock.now_s() == 2.5
    assert fake.requests[1]["args"] == {"for_s": 0.5, "after_tx": 3 + 4 + 1}  # taken by then, from all, and ours
    assert host.received == 2  # 12 less the 10 of before; the third frame waits for its own step
    assert len(bus.waiting) == 1


def test_a_step_whose_frames_do_not_come_is_a_broken_link(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_host, "BARRIER_S", 0.01)
    replies = ({"result": IDLE}, {"can_rx": 3})
    with (
        control(tmp_path, *replies) as (port, _),
        CanHost(FakeBus([frame(1)]), StepClock(port)) as host,
        pytest.raises(LinkError, match="2 frames sent by the emulator did not arrive"),
    ):
        host.advance(0.001)


def test_a_refusal_that_socketcand_shows_as_an_error_frame_is_heard_and_not_counted(tmp_path: Path) -> None:
    heard: list[bool] = []
    bus = FakeBus([frame(8, is_error_frame=True), frame(0x185)])
    with control(tmp_path, {"result": IDLE}, {"can_rx": 1}) as (port, _), CanHost(bus, StepClock(port)) as host:
        host.listeners.append(lambda m: heard.append(m.is_error_frame))
        host.advance(0.001)
    assert heard == [True, False]


def test_on_a_shared_interface_frames_of_others_do_not_hold_ours_back(tmp_path: Path) -> None:
    bus = FakeBus([frame(0x7FF), frame(0x185), frame(0x285)])
    with control(tmp_path, {"result": IDLE}, {"can_rx": 2}) as (port, _), CanHost(bus, StepClock(port)) as host:
        host.shared = True
        host.advance(0.001)
    assert host.received == 3


def test_a_step_waits_for_each_bus_of_ours_and_for_nobody_elses(tmp_path: Path) -> None:
    buses = FakeBus([frame(1), frame(2)]), FakeBus([frame(3), frame(4)])
    replies = (
        {"rx": {"1": 5, "2": 7, "10": 9}, "result": IDLE},
        {"rx": {"1": 9, "2": 8, "10": 10}},
        {"rx": {"2": 9, "10": 11, "11": 3}},  # the first has gone
    )
    with (
        control(tmp_path, *replies) as (port, fake),
        CanHost(buses[0], WallClock()) as a,
        CanHost(buses[1], a.clock) as b,
    ):
        clock = StepClock(port, [a, b])  # the second and the third client; the first is another program's
        b.send(0x605, b"")
        clock.command(None, "run", for_s=0.1)
        assert (a.received, b.received) == (1, 1)
        clock.advance(a, 0.1)
        assert (a.received, b.received) == (2, 2)
    assert [r["args"]["after_tx"] for r in fake.requests[1:]] == [3 + 4 + 1] * 2


def test_a_serial_client_is_waited_for_until_the_emulator_knows_it(tmp_path: Path) -> None:
    """Without it the frames of that bus would never be taken: which client is whose is by their number."""
    one, both = {"rx": {"1": 0}, "result": IDLE}, {"rx": {"1": 0, "2": 0}, "result": IDLE}
    serial = FakeBus([frame(1)])
    with (
        control(tmp_path, one, one, both, {"rx": {"1": 0, "2": 1}}) as (port, _),
        CanHost(FakeBus(), WallClock()) as a,
        CanHost(serial, a.clock) as b,
    ):
        b.joins_later = True
        StepClock(port, [a, b]).command(None, "run", for_s=0.1)
        assert (a.received, b.received) == (0, 1)


def test_in_real_time_the_other_buses_are_received_from_as_well() -> None:
    with CanHost(FakeBus(), WallClock()) as a, CanHost(FakeBus([frame(1), frame(2)]), WallClock()) as b:
        WallClock([a, b]).advance(a, 0.02)
        assert b.received == 2


def test_in_real_time_a_wait_is_spent_receiving() -> None:
    bus = FakeBus([frame(1), frame(2), frame(3)])
    with CanHost(bus, WallClock()) as host:
        host.advance(0.02)
    assert host.received == 3


def test_timeout_is_counted_in_time_of_the_bench(tmp_path: Path) -> None:
    replies: list[dict[str, Any]] = [{"result": IDLE}, *({"t_ns": k * 1_000_000} for k in range(1, 6))]
    with control(tmp_path, *replies) as (port, _), CanHost(FakeBus(), StepClock(port)) as host:
        assert not host.pump_until(lambda: False, 0.005)


def test_a_bus_that_breaks_is_a_broken_link() -> None:
    with (
        CanHost(FakeBus([can.CanOperationError("gone\nTraceback: ...")]), WallClock()) as host,
        pytest.raises(LinkError, match=r"^CAN: gone; the emulator or adapter has gone away$"),
    ):
        host.receive(0.1)


# ---- SDO

OLD = [
    pytest.param(0x585, "43 01 22 03 2A 00 00 00", id="another object's value"),
    pytest.param(0x585, "60 20 20 00 00 00 00 00", id="a write's acknowledgement"),
    pytest.param(0x585, "80 01 22 03 00 00 04 05", id="another transfer's time-out"),
    pytest.param(0x585, "00 61 62 63 64 65 66 67", id="a segment"),
    pytest.param(0x586, "4F 01 10 00 2A 00 00 00", id="another node's value"),
]


class Server(FakeBus):
    """After each request come the frames that the test wants."""

    def __init__(self, *answers: Sequence[tuple[int, str]]) -> None:
        super().__init__()
        self._answers = list(answers)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        super().send(msg, timeout)
        for can_id, data in self._answers.pop(0):
            self.waiting.append(can.Message(arbitration_id=can_id, is_extended_id=False, data=bytes.fromhex(data)))


@pytest.mark.parametrize(("can_id", "data"), OLD)
def test_an_answer_to_somebody_who_has_gone_is_not_taken_for_ours(can_id: int, data: str) -> None:
    bus = Server([(can_id, data), (0x585, "4F 01 10 00 05 00 00 00")])
    with CanHost(bus, WallClock()) as host:
        assert CanopenNode(host, 5, proto_file("psa2.eds")).read(0x1001) == 5
    assert len(bus.sent) == 1


def test_an_abort_of_our_transfer_is_a_refusal() -> None:
    bus = Server([(0x585, "80 01 22 03 00 00 04 05"), (0x585, "80 01 10 00 01 00 02 06")])
    with CanHost(bus, WallClock()) as host, pytest.raises(DeviceError) as refused:
        CanopenNode(host, 5, proto_file("psa2.eds")).read(0x1001)
    assert refused.value.abort_code == 0x06020001


def test_an_old_answer_between_the_segments_of_a_string_is_left_out() -> None:
    old = (0x585, "43 01 22 03 2A 00 00 00")
    bus = Server([(0x585, "41 08 10 00 05 00 00 00")], [old, (0x585, "05 50 53 41 2D 32 00 00")])
    with CanHost(bus, WallClock()) as host:
        assert CanopenNode(host, 5, proto_file("psa2.eds")).read(0x1008) == "PSA-2"


# ---- opening a bus


def test_no_bus_says_where_one_could_be_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))  # no ~/.canrc
    monkeypatch.delenv("CAN_INTERFACE", raising=False)
    with pytest.raises(BadInput, match=r"^--can: expected INTERFACE:CHANNEL.*\$CAN_INTERFACE.*, got none"):
        open_bus(None)


@pytest.mark.parametrize(
    "spec", ["", "socketcand", "socketcand:", "socketcand:127.0.0.1", "slcan:/dev/x,fd", "frobnicate:x", "socketcan:"]
)
def test_a_bus_that_nobody_could_open_is_bad_input(spec: str) -> None:
    with pytest.raises(BadInput, match=r"--can"):
        open_bus(spec)


def test_frames_of_an_slcan_adapter_are_read_at_once_cut_anywhere_and_forgotten_on_request() -> None:
    adapter, theirs = os.openpty()
    try:
        with CanHost(open_bus(f"slcan:{os.ttyname(theirs)}"), WallClock()) as host:
            got: list[bytes] = []
            host.listeners.append(lambda m: got.append(bytes(m.data)))
            os.write(adapter, b"t18520102\rt18530102")
            assert host.receive(5.0)
            assert not host.receive(0.0)  # half of the second one
            os.write(adapter, b"03\rt185104\r")
            assert host.receive(5.0)
            assert host.receive(0.0)  # with what came before it
            assert got == [b"\1\2", b"\1\2\3", b"\4"]
            os.write(adapter, b"t185105\rt185106\r")
            assert host.receive(5.0)
            host.bus.flush()  # type: ignore[attr-defined]
            assert not host.receive(0.0)
            assert got[3:] == [b"\5"]
    finally:
        os.close(adapter)
        os.close(theirs)


@contextmanager
def listener(*say: bytes) -> Iterator[int]:
    """A TCP server that says something to its first connections, each time one sentence, and hangs up."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            for words in say:
                peer, _ = server.accept()
                with peer:
                    peer.sendall(words)

        thread = threading.Thread(target=serve)
        thread.start()
        yield server.getsockname()[1]
        thread.join(10)


@pytest.mark.parametrize("words", [b"220 mail ready\r\n", b"", b"< hi ><"])
def test_what_is_no_socketcand_server_is_refused_at_once(words: bytes) -> None:
    with listener(words) as port, pytest.raises(LinkError, match="expected a socketcand server"):
        open_bus(f"socketcand:127.0.0.1:{port}")


def test_a_port_where_nobody_listens_is_refused_at_once() -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        unserved = r"expected a socketcand server, got one that no process serves; is psa-emu running there\?"
        with pytest.raises(LinkError, match=unserved):
            open_bus(f"socketcand:127.0.0.1:{unused.getsockname()[1]}")


def test_a_server_that_says_nothing_is_given_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(can_host, "GREETING_S", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as silent, pytest.raises(LinkError, match="timed out"):
        open_bus(f"socketcand:127.0.0.1:{silent.getsockname()[1]}")


@pytest.mark.parametrize(
    ("how", "says"),
    [("close", "connection closed by the emulator"), ("reset", r"^CAN: Connection reset by peer; [^\n]*$")],
)
def test_a_server_that_leaves_is_noticed_after_its_last_frame(how: str, says: str) -> None:
    """python-can's own client takes the end of a connection for silence."""
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve() -> None:
            server.accept()[0].sendall(b"< hi >")  # the greeting that open_bus wants to hear first
            peer, _ = server.accept()
            with peer:
                for words, want in ((b"< hi >", b"< open can0 >"), (b"< ok >", b"< rawmode >"), (b"< ok >", b"<")):
                    peer.sendall(words)
                    assert peer.recv(64).startswith(want)
                peer.sendall(b"< frame 123 1.000000 11 >")
                assert peer.recv(64)  # it has the frame
                if how == "reset":
                    peer.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))

        thread = threading.Thread(target=serve)
        thread.start()
        with CanHost(open_bus(f"socketcand:127.0.0.1:{server.getsockname()[1]}"), WallClock()) as host:
            host.send(0x7FF, b"")
            assert host.receive(10.0)
            host.send(0x7FF, b"")
            thread.join(10)
            with pytest.raises(LinkError, match=says):
                host.receive(10.0)


# ---- the emulator's process


@pytest.fixture
def program(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Path of a shell script that replaces psa-emu; the test writes it."""
    path = tmp_path / "psa-emu"
    monkeypatch.setenv("PSA_EMU", str(path))
    return path


def write(program: Path, script: str) -> None:
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o755)


def test_ready_lines_become_endpoints(program: Path) -> None:
    write(
        program,
        "trap 'exit 0' TERM; echo ready can=socketcand host=127.0.0.1 port=4711\n"
        "echo ready can=slcan pty=/dev/pts/9 link=/tmp/x; echo ready all; while :; do sleep 0.1; done",
    )
    with Emulator(cans=["socketcand:0", "slcan"]) as emu:
        assert emu.endpoint(can="socketcand")["port"] == "4711"
        assert emu.endpoint(can="slcan") == {"can": "slcan", "pty": "/dev/pts/9", "link": "/tmp/x"}
        with pytest.raises(BenchError, match="no endpoint"):
            emu.endpoint(can="socketcan")
        assert emu.stop() == 0


def test_the_arguments_are_what_was_asked_for(program: Path, tmp_path: Path) -> None:
    write(program, f'echo "$@" > {tmp_path}/args; echo ready all')
    with Emulator("quiet", cans=["none"], pace="free", seed=7, control=False, extra=("--for", "1s")) as emu:
        assert emu.wait(10.0) == 0
    wanted = "quiet --pace free --until-eof --can none --seed 7 --for 1s"
    assert (tmp_path / "args").read_text().split() == wanted.split()


def test_what_the_emulator_complains_of_is_the_message(program: Path) -> None:
    write(program, "echo 'psa-emu: --can socketcand:1: the port is taken' >&2; exit 3")
    with pytest.raises(BenchError, match=r"^psa-emu: --can socketcand:1: the port is taken$"), Emulator():
        pass


def test_an_emulator_that_is_never_ready_is_ended(
    program: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(emulator, "START_S", 0.5)
    write(program, f"echo $$ > {tmp_path}/pid; echo ready can=none; exec sleep 600")
    with pytest.raises(BenchError, match=r"not ready after 0\.5 s"), Emulator():
        pass
    assert not Path(f"/proc/{(tmp_path / 'pid').read_text().strip()}").exists()


def test_one_that_does_not_listen_to_a_request_is_ended_by_force(
    program: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(emulator, "STOP_S", 0.2)
    write(program, "trap '' TERM; echo ready all; while :; do sleep 0.1; done")
    with Emulator() as emu:
        assert emu.stop() == -9


def test_an_emulator_that_was_named_and_is_not_there_is_bad_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PSA_EMU", "/nowhere/psa-emu")
    with pytest.raises(BadInput, match=r"expected a file at PSA_EMU=/nowhere/psa-emu \(make builds it\), got none"):
        find_emulator()
