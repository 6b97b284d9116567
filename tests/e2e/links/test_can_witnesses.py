"""Every byte on the bus, as strangers saw it: the emulator's own log beside python-can's reader and candump, each frame
decoded by cantools and put together again, every object of every EDS read by python-canopen.

One run a board: boot-up, SDO with answers and aborts, NMT, SYNC, heartbeat, every PDO switched on, an emergency.
"""

from __future__ import annotations

import itertools
import re
import subprocess
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import can
import canopen
import pytest
from canopen.objectdictionary.datatypes import NUMBER_TYPES
from cantools.database import Database
from psabench.boards.gyro.device import Gyro
from psabench.boards.pik.device import Pik
from psabench.boards.pmka.device import Pmka
from psabench.boards.psa2.device import Psa2
from psabench.boards.psd1.device import Psd1
from psabench.boards.unit import NMT_PREOP, NMT_START, TPDO_OFF, Unit
from psabench.emulator import Emulator
from psabench.errors import DeviceError
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.control import Control
from psabench.link.protocol_files import database, dbc_node
from psabench.places import proto_file
from rig import HOST, TIMEOUT_S, VCAN, bus_spec, need, until

SENSOR = "axes: {x: {sensor: mems, u0_v: -3.0, kx_v_per_g: 1.0}}"  # a negative code uses every bit of a signal
PLATFORM = "site: {latitude_deg: 50}\nplatform: {}\n"
LEVEL = "{name: l, board: psa2, node: 5, on: platform}"
UNITS = {
    "psa2": (Psa2, f"units: [{{board: psa2, node: 5, {SENSOR}}}]"),
    "psa1": (Psa2, f"units: [{{board: psa2, profile: psa1, node: 5, {SENSOR}}}]"),
    "psd1": (Psd1, f"units: [{{board: psd1, node: 6, {SENSOR}}}]"),
    "pmka": (Pmka, f"units: [{{board: pmka, node: 7, {SENSOR}}}]"),
    "pik": (Pik, f"units: [{{board: pik, node: 8, {SENSOR}}}]"),
    "gyro": (Gyro, PLATFORM + f"units: [{LEVEL}, {{board: gyro, node: 9, level: l}}]"),
}  # fmt: skip
HEAD = "seed: 3\nbus: {bitrate_hz: 1000000, data_bitrate_hz: 5000000}\n"
HEARTBEAT_MS, FRAME_FORM, SYNC_ID, HELLO = 0x1017, 0x2020, 0x080, 0x7FF
# Of a PSA-2: pair, fast; frame, block are CAN FD, which socketcand does not carry.
CLASSIC, ALL_FORMS = (0, 1), (0, 1, 2, 3)
NOT_NOW = "0x08000022"
# Words that the host built into a PSD-1 takes itself.
TAKEN: dict[str, list[str]] = {"psd1": ["2002h:1", "2002h:2", "2002h:3"]}
SDO = re.compile(r"(?:\w+_)?SDO_[RT]X")
LINE = re.compile(r"\((\d+)\.(\d{6})\) \S+ ([0-9A-F]{3}|[0-9A-F]{8})(##[0-9A-F]|#)([0-9A-F]*)")

Seen = tuple[int, int, bytes]  # identifier, CAN FD or not, data


@dataclass(frozen=True, slots=True)
class Logged:
    """A line of candump's format."""

    t_us: int
    seen: Seen


def lines_of(text: str) -> list[Logged]:
    """Read by the rule of candump's manual, by no one else's reader."""
    found = []
    for line in text.splitlines():
        m = LINE.fullmatch(line.removesuffix(" R").removesuffix(" T"))
        assert m, line
        found.append(Logged(int(m[1]) * 10**6 + int(m[2]), (int(m[3], 16), int("##" in m[4]), bytes.fromhex(m[5]))))
    return found


def of(m: can.Message) -> Seen:
    return m.arbitration_id, int(m.is_fd), bytes(m.data)


@contextmanager
def bench(board: str, adapter: str, tmp_path: Path, pace: str = "step") -> Iterator[tuple[Emulator, str]]:
    """A unit of a board, its bus recorded by the emulator, and the bus' address."""
    scenario = tmp_path / "bench.yaml"
    scenario.write_text(HEAD + UNITS[board][1] + "\n")
    with Emulator(scenario, cans=[adapter, f"log:{tmp_path / 'emu.log'}"], pace=pace, seed=3) as emulator:
        yield emulator, bus_spec(emulator.endpoints[0])


def exercise(unit: Unit, host: CanHost, forms: Sequence[int]) -> None:
    """All that a bus of this board ever carries."""
    host.advance(0.3)
    unit.node.write(HEARTBEAT_MS, 0, 20)
    assert unit.node.read(0x1008)  # segmented
    with pytest.raises(DeviceError):
        unit.node.read_raw(0x1FFF, 0)
    for form in forms if isinstance(unit, Psa2) else [None]:
        if form is not None:
            unit.node.write(FRAME_FORM, 0, form)
        else:
            for index in (i for i in range(0x1800, 0x1808) if unit.node.has(i)):
                unit.node.write(index, 1, unit.node.read(index, 1) & ~TPDO_OFF)
        unit.node.nmt(NMT_START)
        host.advance(0.1)
        host.send(SYNC_ID, b"")
        host.advance(0.1)
        unit.node.nmt(NMT_PREOP)
        host.advance(0.05)


def everything(board: str, control: Control, host: CanHost, forms: Sequence[int]) -> None:
    exercise(UNITS[board][0](host), host, forms)
    name = control.call("units").result["units"][-1]["name"]
    control.call("fault.add", kind="link.bus_off", point=f"{name}.can")  # told in an emergency once it is back
    host.advance(0.1)
    control.call("unit.reset", unit=name)
    host.advance(0.3)


@HOST
@pytest.mark.parametrize("board", UNITS)
def test_the_log_and_python_can_have_the_same_frames_at_the_same_times(board: str, tmp_path: Path) -> None:
    heard: list[can.Message] = []
    with ExitStack() as stack:
        emulator, spec = stack.enter_context(bench(board, "socketcand:0", tmp_path))
        host = stack.enter_context(CanHost(open_bus(spec), WallClock()))
        witness = stack.enter_context(CanHost(open_bus(spec), WallClock()))
        witness.listeners.append(heard.append)
        assert emulator.control_path
        control = stack.enter_context(Control(emulator.control_path))
        host.clock = StepClock(control, [host, witness])
        everything(board, control, host, CLASSIC)
    logged = lines_of((tmp_path / "emu.log").read_text())
    assert len(logged) > 100
    assert [of(m) for m in heard] == [line.seen for line in logged]
    assert [round(m.timestamp * 1e6) for m in heard] == [line.t_us for line in logged]
    again = list(can.LogReader(tmp_path / "emu.log"))
    assert [of(m) for m in again] == [line.seen for line in logged]
    decodes(database(), [line.seen for line in logged], board, fd=False)


def decodes(db: Database, frames: list[Seen], board: str, *, fd: bool) -> None:
    """Every frame has a message of the DBC, its length, and comes out the same when put together again.

    SDO messages have bytes that the service leaves unused, which cantools does not keep."""
    names = set()
    for identifier, _, data in frames:
        message = db.get_message_by_frame_id(identifier)
        names.add(message.name)
        if message.name == "SYNC":
            assert data == b""
            continue
        assert len(data) == message.length, message.name
        values = message.decode(data, decode_choices=False, scaling=False)
        if not SDO.fullmatch(message.name):
            assert message.encode(values, scaling=False) == data, message.name
    own = {m.name for m in db.messages if m.senders == [board_node(board)] and (fd or m.length <= 8)}
    assert own - names == set(), "messages of the DBC that the run has not shown"


def board_node(board: str) -> str:
    return {"psa1": "PSA2"}.get(board, board.upper())


@VCAN
@pytest.mark.parametrize("board", UNITS)
def test_the_log_and_candump_have_the_same_frames(board: str, tmp_path: Path) -> None:
    """On a kernel's bus the host's frames and the unit's may pass each other; each side's are in order."""
    need("vcan")
    with ExitStack() as stack:
        argv = ["candump", "-L", "-r", "8000000", "vcan0"]
        dump = stack.enter_context(subprocess.Popen(argv, stdout=subprocess.PIPE, text=True))
        stack.callback(dump.terminate)
        assert dump.stdout
        bus = stack.enter_context(can.Bus(interface="socketcan", channel="vcan0", fd=True))
        hello = bus.send_periodic(can.Message(arbitration_id=HELLO, is_extended_id=False), 0.02)
        assert "7FF#" in dump.stdout.readline()  # candump says nothing when it is ready
        hello.stop()
        emulator, spec = stack.enter_context(bench(board, "socketcan:vcan0", tmp_path))
        host = stack.enter_context(CanHost(open_bus(spec), WallClock()))
        assert emulator.control_path
        control = stack.enter_context(Control(emulator.control_path))
        host.clock = StepClock(control)
        everything(board, control, host, ALL_FORMS)
        emulator.stop()
        logged = [line.seen for line in lines_of((tmp_path / "emu.log").read_text()) if line.seen[0] != HELLO]
        dumped = (line.seen for text in dump.stdout for line in lines_of(text) if line.seen[0] != HELLO)
        seen = list(itertools.islice(dumped, len(logged)))

    def host_s(frame: Seen) -> bool:
        return frame[0] in (0, SYNC_ID) or 0x600 <= frame[0] < 0x680

    assert len(logged) > 100
    decodes(database(), logged, board, fd=True)
    for mine in (True, False):
        assert [f for f in seen if host_s(f) == mine] == [f for f in logged if host_s(f) == mine]


@HOST
@pytest.mark.parametrize("board", UNITS)
def test_python_canopen_reads_every_object_of_the_eds(board: str, tmp_path: Path) -> None:
    kind = UNITS[board][0]
    with ExitStack() as stack:
        emulator, spec = stack.enter_context(bench(board, "socketcand:0", tmp_path, "wall"))
        del emulator
        _, channel = spec.split(",")[0].split(":", 1)
        address, port = channel.rsplit(":", 1)
        network = canopen.Network()
        network.connect(interface="socketcand", channel="can0", host=address, port=int(port), tcp_tune=True)
        stack.callback(network.disconnect)
        eds = proto_file(f"{kind.board}.eds")
        node: Any = network.add_node(dbc_node(kind.board), str(eds))
        node.sdo.RESPONSE_TIMEOUT = TIMEOUT_S
        until(lambda: node.nmt.state != "INITIALISING", "a heartbeat or a boot-up", TIMEOUT_S)
        read, taken = 0, []
        for obj in node.object_dictionary.values():
            parts = [obj] if isinstance(obj, canopen.objectdictionary.ODVariable) else list(obj.values())
            for part in parts:
                if not part.readable:
                    continue
                try:
                    with node.sdo.open(
                        part.index, part.subindex, buffering=0
                    ) as answer:  # upload() would cut it to size
                        data = answer.read()
                except canopen.SdoAbortedError as e:
                    if NOT_NOW not in str(e):
                        raise
                    taken.append(f"{part.index:04X}h:{part.subindex}")
                    continue
                assert len(data) * 8 == len(part) or part.data_type not in NUMBER_TYPES, part
                part.decode_raw(data)
                read += 1
        assert read > 30
        assert taken == TAKEN.get(board, [])
