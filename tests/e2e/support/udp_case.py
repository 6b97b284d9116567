"""Cases of CAN over UDP multicast, in a network namespace of the test's own: `udp_case.py CASE` prints JSON."""

from __future__ import annotations

import json
import socket
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import can
from can.interfaces.udp_multicast.utils import pack_message
from psabench.boards.psa2.device import Psa2
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost, StepClock, open_bus
from psabench.link.control import Control
from psabench.link.endpoints import bus_spec
from rig import BENCH, TIMEOUT_S

IP_RECVTTL = 12  # linux/in.h
GROUP, PORT = "239.74.163.2", 43113
IPV6 = "ff15:7079:7468:6f6e:6465:6d6f:6d63:6173"


@dataclass
class Case:
    emulator: Emulator
    control: Control
    bus: can.BusABC  # python-can's own, as it comes

    def counters(self) -> dict[str, Any]:
        (client,) = (c for c in self.control.call("frames").result["clients"] if c["adapter"] == "udp")
        return dict(client)

    def take(self, done: Callable[[can.Message], bool]) -> list[can.Message]:
        """All frames up to the first that is looked for."""
        deadline, got = time.monotonic() + TIMEOUT_S, []
        while time.monotonic() < deadline:
            if (m := self.bus.recv(1.0)) is not None:
                got.append(m)
                if done(m):
                    return got
        raise TimeoutError(f"got {got[-5:]}")

    def until(self, counter: str, value: int) -> None:
        """Asks for the counter until it has the value: a datagram and a command go separate ways."""
        deadline = time.monotonic() + TIMEOUT_S
        while self.counters()[counter] != value:
            if time.monotonic() > deadline:
                raise TimeoutError(f"{counter}: {self.counters()}")


@contextmanager
def case(group: str = GROUP, scenario: str = str(BENCH)) -> Iterator[Case]:
    with (
        Emulator(scenario, cans=[f"udp:{group}"], pace="step") as emulator,
        control_of(emulator) as control,
        can.Bus(interface="udp_multicast", channel=group, hop_limit=0) as bus,
    ):
        yield Case(emulator, control, bus)


def control_of(emulator: Emulator) -> Control:
    assert emulator.control_path is not None
    return Control(emulator.control_path)


def shape(m: can.Message) -> list[Any]:
    return [m.arbitration_id, m.is_extended_id, m.is_fd, m.bitrate_switch, m.is_remote_frame, m.dlc, m.data.hex()]


def frames_of_all_kinds() -> dict[str, Any]:
    """Each kind of frame from one python-can client: it goes over the bus once, and no echo of ours comes back."""
    sent = [
        can.Message(arbitration_id=0x123, is_extended_id=False, data=b"\x01\x02"),
        can.Message(arbitration_id=0x1ABCDEF0, data=bytes(8)),
        can.Message(arbitration_id=0x124, is_extended_id=False, is_remote_frame=True, dlc=4),
        can.Message(arbitration_id=0x125, is_extended_id=False, is_fd=True, bitrate_switch=True, data=bytes(range(64))),
        can.Message(arbitration_id=0x126, is_extended_id=False, is_fd=True, data=bytes(12)),
    ]
    with case() as c:
        for m in sent:
            c.bus.send(m)
        c.until("taken", len(sent))
        c.control.call("run", for_s=0.01)
        on_bus = int(c.control.call("counters").result["bus"]["frames"])
        counters = c.counters()
        # python-can shows a program its own frames: they come first, then what the bus sends
        got = c.take(lambda m: m.arbitration_id == 0x705)
        return {
            "same": [shape(m) for m in sent] == [shape(m) for m in got[: len(sent)]],
            "got": [m.arbitration_id for m in got],
            "counters": counters,
            "on_bus": on_bus,
        }


def datagrams() -> dict[str, Any]:
    """The bytes are those of python-can's pack_message()."""
    raw = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    raw.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    raw.bind((GROUP, PORT))
    raw.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, socket.inet_aton(GROUP) + bytes(4))
    raw.setsockopt(socket.IPPROTO_IP, IP_RECVTTL, 1)
    raw.settimeout(TIMEOUT_S)
    with raw, case() as c:
        c.control.call("run", for_s=0.01)
        data, control, _, source = raw.recvmsg(1000, 100)
        m = c.take(lambda m: m.arbitration_id == 0x705)[-1]
        m.timestamp = 0.000055  # the simulated time; python-can replaces it by the kernel's
        return {"equal": data == pack_message(m), "ttl": control[0][2][0], "own_port": source[1] != PORT}


def hostile() -> dict[str, Any]:
    """What is no CAN frame is counted and nothing else happens."""
    junk = [b"", b"\xc0", bytes(9000), b"\x81\xa4data\xc6\xff\xff\xff\xff\x00", b"\x8f" * 60]
    frame = pack_message(can.Message(arbitration_id=1, is_extended_id=False, data=b"1"))
    cut = [frame[:n] for n in range(len(frame))]
    with case() as c, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        for data in (*junk, *cut, frame):
            out.sendto(data, (GROUP, PORT))
        c.until("taken", 1)
        return {"sent": len(junk) + len(cut), "refused": int(c.counters()["refused"]), "log": c.emulator.messages()}


def host() -> dict[str, Any]:
    """Our own host over the group: SDO, PDOs, FD; its barrier holds, its echoes are passed over."""
    with Emulator(BENCH, cans=["udp"], pace="step") as emulator, control_of(emulator) as control:
        spec = bus_spec(emulator.endpoint(can="udp"))
        bus = open_bus(spec)
        clock = StepClock(control)
        with CanHost(bus, clock) as h:
            unit = Psa2(h)
            unit.wait_ready()
            unit.start()
            frames = len(unit.stream(100).t_sample_s)
            (client,) = control.call("frames").result["clients"]
            return {"spec": spec, "sent": h.sent, "received": h.received, "client": client, "frames": frames}


def flood() -> dict[str, Any]:
    """More datagrams than the kernel keeps: every one is on the bus, refused or counted as lost."""
    frame = pack_message(can.Message(arbitration_id=0x700, is_extended_id=False))
    with case() as c, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, 0)
        sent = 60_000
        for _ in range(sent):
            out.sendto(frame, (GROUP, PORT))
        for _ in range(600):
            c.control.call("run", for_s=1.0)
            k = c.counters()
            if int(k["taken"]) + int(k["overrun"]) == sent or int(k["taken"]) == sent:
                break
            out.sendto(frame, (GROUP, PORT))  # the kernel tells its losses with the next datagram
            sent += 1
        return {"sent": sent, **k}


def restored() -> dict[str, Any]:
    """A snapshot with input over the group in its journal makes the same bench again."""
    with case() as c:
        c.bus.send(can.Message(arbitration_id=0, is_extended_id=False, data=b"\x01\x00"))
        c.until("taken", 1)
        c.control.call("run", for_s=0.02)
        file = c.emulator.directory / "snapshot"
        c.control.call("snapshot", path=str(file))
        c.control.call("run", for_s=0.02)
        want = c.control.call("counters").result["bus"]
        with Emulator(extra=["--restore", file], cans=["none"]) as again, control_of(again) as control:
            control.call("run", for_s=0.02)
            return {"want": want, "got": control.call("counters").result["bus"]}


def ipv6() -> dict[str, Any]:
    with case(IPV6) as c:
        c.bus.send(
            can.Message(arbitration_id=0x605, is_extended_id=False, data=bytes((0x40, 0x18, 0x10, 1, 0, 0, 0, 0)))
        )
        c.until("taken", 1)
        c.control.call("run", for_s=0.02)
        return {"answer": c.take(lambda m: m.arbitration_id == 0x585)[-1].data[0], "counters": c.counters()}


if __name__ == "__main__":
    print(json.dumps(globals()[sys.argv[1]]()))
