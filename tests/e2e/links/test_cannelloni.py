"""CAN through cannelloni's UDP tunnel. The other end is support/cannelloni_peer.py, written from the format alone."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from cannelloni_peer import BRS, EFF, ERR, ESI, RTR, Frame, Peer, pack
from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import Form
from psabench.emulator import Emulator
from psabench.errors import BadInput, LinkError
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.cannelloni_bus import CannelloniBus
from psabench.link.control import Control, Reply
from psabench.link.endpoints import bus_spec
from rig import BENCH, HOST, TIMEOUT_S, one_line, psa_emu, until

pytestmark = [HOST, pytest.mark.timeout(2 * TIMEOUT_S)]

NODE = 5
REQUEST, ANSWER = 0x600 + NODE, 0x580 + NODE
FRAME_FORM, FD_FORM = 0x2020, 2
LINE = re.compile(r"\S+ \S+ (?P<id>[0-9A-F]+)(?P<body>#.*)")  # of candump -L


@dataclass
class Tunnel:
    emulator: Emulator
    control: Control
    peer: Peer
    log: Path

    def counters(self) -> dict[str, Any]:
        (client,) = self.control.call("frames").result["clients"]
        return dict(client)

    def run(self, for_s: float) -> tuple[Reply, list[Frame]]:
        """Lets time pass once all that was sent is on the bus; what has come when the reply is there."""
        reply = self.control.call("run", for_s=for_s, after_tx=self.peer.sent)
        return reply, self.peer.take()

    def ask(self, command: int, index: int, sub: int = 0, value: int = 0) -> tuple[int, int]:
        """An SDO request of at most four bytes: the command byte and the value of the answer."""
        self.peer.send(Frame(REQUEST, struct.pack("<BHBI", command, index, sub, value)))
        (answer,) = (f for f in self.run(0.02)[1] if f.can_id == ANSWER)
        code, _, _, number = struct.unpack("<BHBI", answer.data)
        return code, number

    def on_bus(self) -> list[str]:
        """Frames of the log, as candump -L writes them. The emulator has ended, with its log."""
        self.emulator.stop()
        lines = (LINE.fullmatch(line) for line in self.log.read_text().splitlines())
        return [m["id"] + m["body"] for m in lines if m]


@contextmanager
def tunnel(directory: Path, scenario: str | Path = BENCH, address: str = "127.0.0.1") -> Iterator[Tunnel]:
    with ExitStack() as stack:
        peer = stack.enter_context(Peer(address))
        log = directory / "bus.log"
        cans = [f"cannelloni:0:{peer.port}", f"log:{log}"]
        emulator = stack.enter_context(Emulator(scenario, cans=cans, pace="step"))
        assert emulator.control_path
        peer.to = int(emulator.endpoint(can="cannelloni", host="127.0.0.1", peer_port=str(peer.port))["port"])
        yield Tunnel(emulator, stack.enter_context(Control(emulator.control_path)), peer, log)


def text(f: Frame) -> str:
    """As candump -L has it: what linux/can.h says of the flags and what can-utils writes."""
    number = f"{f.can_id & 0x1FFFFFFF:08X}" if f.can_id & EFF else f"{f.can_id & 0x7FF:03X}"
    if f.can_id & RTR:
        return f"{number}#R{f.dlc}"
    return f"{number}#{'' if f.fd_flags is None else f'#{f.fd_flags & BRS:X}'}{f.data.hex().upper()}"


def test_a_client_reads_an_object(tmp_path: Path) -> None:
    with tunnel(tmp_path) as t:
        code, device_type = t.ask(0x40, 0x1000)
        assert code == 0x43
        assert device_type & 0xFFFF == 404, "a measuring device of CiA 404"
        assert t.counters()["taken"] == 1


def test_a_stream_in_step_pace_is_there_with_the_reply_fd_frames_included(tmp_path: Path) -> None:
    with tunnel(tmp_path) as t:
        t.run(2.5)  # the set-up
        assert t.ask(0x2F, FRAME_FORM, value=FD_FORM) == (0x60, 0)
        t.peer.send(Frame(0, bytes((1, NODE))))
        frames, delivered = [], 0
        for _ in range(10):
            reply, got = t.run(0.1)
            frames += got
            delivered = reply.can_rx
            assert sum(len(d.frames) for d in t.peer.received) == delivered, "not one later, not one more"
        assert t.counters()["delivered"] == delivered
        fd = [f for f in frames if f.fd_flags is not None]
        assert len(fd) > 900
        assert {f.fd_flags for f in fd} == {BRS}
        everything = [text(f) for d in t.peer.received for f in d.frames]
        assert everything == [line for line in t.on_bus() if line[:4] not in ("605#", "000#")], "the log of the bus"
        assert [d.seq_no for d in t.peer.received] == [i & 0xFF for i in range(len(t.peer.received))]
        assert max(d.size for d in t.peer.received) <= 1472
        assert max(len(d.frames) for d in t.peer.received) > 1, "bundled"


def test_every_kind_of_frame_comes_to_the_bus(tmp_path: Path) -> None:
    lengths = (*range(9), 12, 16, 20, 24, 32, 48, 64)
    frames = [
        Frame(0x123, b"\1\2"),
        Frame(EFF | 0x1ABCDEF0, bytes(8)),
        Frame(RTR | 0x124, dlc=4),
        Frame(EFF | RTR | 0x124, dlc=8),
        *(Frame(0x200 + n, bytes(range(n)), n % 4) for n in lengths),  # with BRS and ESI and without
        Frame(EFF | 0x125, bytes(64), BRS | ESI),
    ]
    with tunnel(tmp_path) as t:
        t.peer.send(*frames)
        t.run(0.02)
        assert [line for line in t.on_bus() if not line.startswith("705#")] == [text(f) for f in frames]
        assert "refused 0" in t.emulator.messages()


def test_a_datagram_of_more_frames_than_a_queue_holds_is_taken_whole(tmp_path: Path) -> None:
    frames = [Frame(RTR | i) for i in range(1, 294)]
    with tunnel(tmp_path) as t:
        assert len(pack(frames, 0)) == 1470
        t.peer.send(*frames)
        t.peer.send(Frame(0x7F0))  # waits behind it
        t.run(0.1)
        assert t.counters()["taken"] == 294
        assert [line for line in t.on_bus() if line[:4] != "705#"] == [text(f) for f in (*frames, Frame(0x7F0))]


def test_a_snapshot_has_what_came_through_the_tunnel(tmp_path: Path) -> None:
    with tunnel(tmp_path) as t:
        t.peer.send(Frame(0, bytes((1, NODE))), *(Frame(RTR | 0x700 | i % 80) for i in range(250)))
        t.run(0.04)
        file = tmp_path / "snapshot"
        t.control.call("snapshot", path=str(file))
        t.run(0.02)
        want = t.control.call("counters").result["bus"]
        with Emulator(extra=["--restore", file], cans=["none"]) as again:
            assert again.control_path
            with Control(again.control_path) as control:
                control.call("run", for_s=0.02)
                assert control.call("counters").result["bus"] == want


@pytest.mark.parametrize(
    ("numbers", "lost"),
    [
        ((0, 1, 2), 0),
        ((7, 8, 9), 0),  # the first need not be 0
        ((0, 1, 4, 5, 7), 3),
        ((254, 255, 0, 1), 0),
        ((253, 255, 1), 2),
        ((0, 128), 127),
        ((200, 201, 0, 1), 0),  # another cannelloni on that port
        ((5, 5, 4, 5), 0),  # once more, and late
    ],
    ids=str,
)
def test_gaps_of_the_sequence_number_are_counted(tmp_path: Path, numbers: tuple[int, ...], lost: int) -> None:
    with tunnel(tmp_path) as t:
        for t.peer.seq_no in numbers:
            t.peer.send(Frame(0x7F0))
        t.run(0.01)
        assert t.counters()["overrun"] == lost
        assert t.counters()["taken"] == len(numbers)
        assert t.emulator.messages().count("datagrams were lost") == (1 if lost else 0)


def test_what_the_kernel_loses_is_counted_once(tmp_path: Path) -> None:
    with tunnel(tmp_path) as t:
        sent = 30_000
        for _ in range(sent):
            t.peer.send(Frame(0x700))
        for _ in range(600):
            t.control.call("run", for_s=1.0)
            k = t.counters()
            if int(k["taken"]) + int(k["overrun"]) >= sent:
                break
            t.peer.send(Frame(0x700))  # the next datagram tells what was lost before it
            sent += 1
        assert k["taken"] + k["overrun"] == sent
        assert k["overrun"] > 0


HEAD = struct.pack(">BBBH", 2, 0, 0, 1)
GOOD = pack([Frame(0x123, b"123"), Frame(0x124, bytes(12), BRS)], 0)
JUNK = {
    "nothing": b"",
    "zeros": bytes(100),
    "a byte too long": pack([*[Frame(1)] * 292, Frame(1, b"123")], 0),
    "a whole datagram of the loopback": b"\2\0\0\xff\xff" + bytes(60_000),
    "version 1": b"\1" + GOOD[1:],
    "version 3": b"\3" + GOOD[1:],
    "an acknowledgement": b"\2\1" + GOOD[2:],
    "65535 frames": GOOD[:3] + b"\xff\xff" + GOOD[5:],
    "a frame fewer than counted": GOOD[:3] + b"\0\3" + GOOD[5:],
    "a frame more than counted": GOOD[:3] + b"\0\1" + GOOD[5:],
    "bytes behind an empty one": GOOD[:3] + b"\0\0" + GOOD[5:],
    "65 bytes": HEAD + struct.pack(">IBB", 1, 0xC1, 0) + bytes(65),
}
NO_FRAMES = [
    Frame(ERR | 4, bytes(8)),  # no node can send one
    Frame(0x800),
    Frame(1, bytes(9)),
    Frame(1, bytes(9), 0),
    Frame(RTR | 1, b"", 0),
    Frame(RTR | 1, dlc=9),
]


def test_what_is_no_datagram_or_no_frame_is_counted_and_disturbs_nothing(tmp_path: Path) -> None:
    cut = [GOOD[:n] for n in range(len(GOOD))]
    with tunnel(tmp_path, "stream") as t, Peer("127.0.0.2") as stranger:
        stranger.to = t.peer.to
        refused = 0
        for data in (*JUNK.values(), *cut):
            t.peer.raw(data)
            refused += 1
        stranger.send(Frame(0x666))
        t.peer.send(*NO_FRAMES, Frame(0x123, b"good"))
        refused += 1 + len(NO_FRAMES)
        t.peer.sent -= len(NO_FRAMES)
        reply, got = t.run(0.5)
        k = t.counters()
        assert (k["refused"], k["taken"], k["overrun"], k["dropped"]) == (refused, 1, 0, 0)
        assert len(got) == reply.can_rx > 400, "the stream goes on"
        assert t.emulator.messages().count("is refused") == 1, "the first is reported"
        assert [line for line in t.on_bus() if line[:4] in ("123#", "666#")] == ["123#" + b"good".hex().upper()]
        assert f"refused {refused}" in t.emulator.messages()


def test_error_frames_of_the_bus_are_not_sent() -> None:
    with Peer() as peer, Emulator("stream", cans=[f"cannelloni:0:{peer.port}", "socketcand:0"]) as emulator:
        peer.to = int(emulator.endpoint(can="cannelloni")["port"])
        assert emulator.control_path
        with (
            Control(emulator.control_path) as control,
            CanHost(open_bus(bus_spec(emulator.endpoint(can="socketcand"))), WallClock()) as other,
        ):
            errors: list[bool] = []
            other.listeners.append(lambda m: errors.append(m.is_error_frame))
            control.call("fault.add", kind="link.error_frame", point="bus.can0", probability=0.2)
            reply = control.call("run", for_s=0.3)
            until(lambda: other.receive(1.0) and any(errors), "an error frame at another adapter")
            got = peer.take()
            assert not any(f.can_id & ERR for f in got)
            assert len(got) == reply.can_rx > 0


def test_in_wall_pace_frames_go_both_ways() -> None:
    with Peer() as peer, Emulator("stream", cans=[f"cannelloni:0:{peer.port}"], pace="wall", control=False) as emulator:
        peer.to = int(emulator.endpoint(can="cannelloni")["port"])
        peer.send(Frame(REQUEST, struct.pack("<BHBI", 0x40, 0x1000, 0, 0)))
        got: list[Frame] = []

        def come(done: Callable[[], bool]) -> bool:
            got.extend(peer.take())
            return done()

        until(lambda: come(lambda: any(f.can_id == ANSWER for f in got)), "the answer")
        until(lambda: come(lambda: len(got) > 100), "the stream")


def test_a_port_in_use_is_told() -> None:
    with Peer() as peer:
        done = psa_emu("stream", "--can", f"cannelloni:{peer.port}:1")
    assert done.returncode == 3
    expected = f"--can cannelloni:{peer.port}: expected a free port of 127.0.0.1 or 0 (any free port), got one in use"
    assert expected in one_line(done.stderr, "psa-emu")


def test_our_host_speaks_the_format_with_every_kind_of_frame() -> None:
    frames = [
        Frame(0x123, b"\1\2"),
        Frame(EFF | 0x1ABCDEF0, bytes(8)),
        Frame(RTR | 0x124, dlc=4),
        Frame(ERR | 4, bytes(8)),
        *(Frame(0x200 + n, bytes(range(n)), n & 3) for n in (0, 1, 2, 3, 64)),
    ]
    with Peer() as peer, Peer() as free:
        free.socket.close()
        bus = CannelloniBus(f"{peer.port}:{free.port}")
        peer.to = free.port
        peer.send(*frames)
        messages = [bus.recv(TIMEOUT_S) for _ in frames]
        for m in messages:
            assert m is not None
            bus.send(m)
        assert peer.take() == frames
        assert [(d.seq_no, len(d.frames)) for d in peer.received] == [(i, 1) for i in range(len(frames))]
        bus.shutdown()


def test_our_host_takes_the_other_end(tmp_path: Path) -> None:
    with Peer() as free:
        port = free.port
    with Emulator(BENCH, cans=[f"cannelloni:0:{port}"], pace="step") as emulator:
        assert emulator.control_path
        spec = bus_spec(emulator.endpoint(can="cannelloni"))
        with Control(emulator.control_path) as control, CanHost(open_bus(spec), StepClock(control)) as host:
            unit = Psa2(host)
            unit.wait_ready()
            unit.form = Form.FRAME
            unit.start()
            frames = unit.stream(100)
            (client,) = control.call("frames").result["clients"]
            assert len(frames.t_sample_s) == 100
            assert (client["taken"], client["delivered"]) == (host.sent, host.received)
            emulator.stop()
            host.send(0x700, b"")
            with pytest.raises(LinkError, match="gone away"):
                host.receive(TIMEOUT_S)


@pytest.mark.parametrize("channel", ["", "0", "65536", "1:1", "20001", "1:2:3", "host:1"])
def test_our_host_refuses_ports_that_cannot_be(channel: str) -> None:
    with pytest.raises(BadInput, match="INTERFACE:CHANNEL" if not channel else "cannelloni:PORT:OWN_PORT"):
        open_bus(f"cannelloni:{channel}")
