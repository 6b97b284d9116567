"""A unit over CAN, whatever its board: registers, bus cycles, counters, stream, state (docs/reference/protocol*.md).

`boards.registry` has a class for each board, and `identify` there finds which of them answers at a node.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import ClassVar

from psabench.boards.objects import BusObjects, Common, Psa2Objects
from psabench.boards.psa2.frames import FrameReader, Frames
from psabench.boards.readings import ReadingLayout, ReadingReader, Readings
from psabench.errors import CycleRefused, DeviceError, LinkError, expected
from psabench.link.can_host import CanHost
from psabench.link.canopen_host import CanopenNode
from psabench.link.protocol_files import dbc_node
from psabench.places import proto_file

NMT_START, NMT_PREOP, NMT_RESET_NODE = 0x01, 0x80, 0x81

# Objects that are registers, by what they are called here; sub-index = address + 1.
BANKS: Mapping[str, int] = {
    "x": Psa2Objects.REG_X,
    "y": Psa2Objects.REG_Y,
    "z": Psa2Objects.REG_Z,
    "t": Psa2Objects.REG_T,
    "bus": BusObjects.BUS,
}
ERROR_REGISTER, NAME, IDENTITY = Common.ERROR_REGISTER, Common.DEVICE_NAME, Common.IDENTITY
TPDO_OFF = 0x80000000  # bit 31 of 1800h..:1
COUNTERS, REFUSAL, STROBE_NS = Common.COUNTERS, Common.REFUSAL, BusObjects.STROBE_NS


class Unit:
    """One unit on the bus; a board's class says what its readings are.

    Raises DeviceError with the unit's abort code when it rejects, LinkError when it does not answer.
    """

    board: ClassVar[str]  # as the EDS and the emulator call it: "psd1"
    title: ClassVar[str]  # object 1008h: "PSD-1"
    layout: ClassVar[ReadingLayout]
    reading_s: ClassVar[float] = 0.01  # timeout for one reading, bench time

    def __init__(self, host: CanHost, node_id: int | None = None) -> None:
        """node_id: None for the board's default."""
        node_id = dbc_node(self.board) if node_id is None else node_id
        self.host = host
        self.node = CanopenNode(host, node_id, proto_file(f"{self.board}.eds"))
        self.frames: FrameReader | ReadingReader = self._reader(node_id)
        self.banks = {name: index for name, index in BANKS.items() if self.node.has(index)}
        host.listeners.append(self.frames.on_message, self.frames.ids)

    def _reader(self, node_id: int) -> FrameReader | ReadingReader:
        return ReadingReader(self.layout, node_id)

    # ---- registers

    def registers(self, bank: str) -> dict[int, str]:
        """Addresses and names of the registers of a bank, from the EDS. Raises ValueError for a bank it has not."""
        return {sub - 1: name for sub, name in self.node.names(self._bank(bank)).items()}

    def register(self, bank: str, register: int | str) -> int:
        """A register, by address or name: of converter "x", "y", "z" or "t", or by a read cycle on the board's "bus".

        Raises ValueError for a bank or a name it has not.
        """
        address = self._register_address(bank, register)
        if bank == "bus":
            return self.bus_read(address)
        return int(self.node.read(self._bank(bank), address + 1))

    def write_register(self, bank: str, register: int | str, value: int) -> None:
        """Write one register, by address or name. Raises ValueError as `register`."""
        address = self._register_address(bank, register)
        if bank == "bus":
            self.bus_write(address, value)
            return
        self.node.write(self._bank(bank), address + 1, value)

    def _register_address(self, bank: str, register: int | str) -> int:
        if isinstance(register, int):
            return register
        names = self.registers(bank)
        for address, name in names.items():
            if register.upper() == name.upper():
                return address
        raise ValueError(expected(", ".join(names.values()), repr(register), f"register of {bank}"))

    def _bank(self, bank: str) -> int:
        if bank not in self.banks:
            raise ValueError(expected(", ".join(self.banks) or "no bank", repr(bank), f"bank of a {self.title}"))
        return self.banks[bank]

    # ---- the parallel bus

    def bus_read(self, address: int, strobe_ns: int | None = None) -> int:
        """A read cycle on the board's parallel bus; strobe_ns: of this strobe and the next ones (0: the profile's).

        Raises CycleRefused with the board's own words (object 2031h).
        """
        with self._cycle(strobe_ns):
            return int.from_bytes(self.node.read_raw(self._bank("bus"), address + 1), "little")

    def bus_write(self, address: int, value: int, strobe_ns: int | None = None) -> None:
        """A write cycle. Raises CycleRefused."""
        with self._cycle(strobe_ns):
            if not 0 <= value <= 0xFFFF:
                raise ValueError(expected("a 16-bit word", value, "value"))
            self.node.write_raw(self._bank("bus"), address + 1, value.to_bytes(2, "little"))

    @contextmanager
    def _cycle(self, strobe_ns: int | None) -> Iterator[None]:
        """A cycle with this strobe; what the board rejects is raised in its own words."""
        if strobe_ns is not None:
            self.node.write(STROBE_NS, 0, strobe_ns)
        try:
            yield
        except DeviceError as e:
            raise CycleRefused(e.what, e.abort_code, self.refusal() or e.text) from e

    def refusal(self) -> str:
        """Object 2031h: why a bus cycle or a setting was rejected last, in words; "": nothing was."""
        return str(self.node.read(REFUSAL))

    # ---- as a whole

    def serial(self) -> int:
        """Of the specimen."""
        return int(self.node.read(IDENTITY, 4))

    def counters(self) -> dict[str, int]:
        """Object 2030h by name."""
        subs = self.node.names(COUNTERS)
        return {name: int(self.node.read(COUNTERS, sub)) for sub, name in subs.items()}

    def wait_ready(self, timeout_s: float = 5.0) -> None:
        """Until readings come. Raises LinkError when the unit is not ready after timeout_s of bench time."""
        self.stop()
        self.stream(1, timeout_s)

    def start(self) -> None:
        """Readings flow from now on."""
        self.node.nmt(NMT_START)

    def stop(self) -> None:
        """Readings stop; SDO still answers (NMT pre-operational). What was on its way has arrived afterwards."""
        self.node.nmt(NMT_PREOP)
        self.node.read(ERROR_REGISTER)  # readings go before SDO answers on the bus: this comes after the last of them

    def reset(self) -> None:
        """A pulse on the board's reset: everything falls back to its defaults and is set up again."""
        self.node.nmt(NMT_RESET_NODE)

    def stream(self, count: int, timeout_s: float = 5.0) -> Frames | Readings:
        """The next `count` readings; the stream runs only meanwhile. Raises LinkError when fewer come in timeout_s."""
        self._gather(count, timeout_s)
        return self.frames.take().head(count)

    def _gather(self, count: int, timeout_s: float) -> None:
        self.frames.forget()
        self.start()
        frames = self.frames
        limit_s = timeout_s + count * self.reading_s
        came = self.host.pump_until(lambda: len(frames) >= count, limit_s, lambda: frames.least(count))
        self.stop()
        if not came:
            raise LinkError(
                f"node {self.node.node_id}: {len(self.frames)} of {count} samples came in {timeout_s:g} s; "
                "is the board set up and the frame form one that this link carries?"
            )


def tpdo_numbers(node: CanopenNode) -> list[int]:
    """Of the TPDOs that the EDS has, from 0."""
    return [k for k in range(Common.TPDO_MAPPING - Common.TPDO) if node.has(Common.TPDO + k)]


def tpdos_of(node: CanopenNode) -> dict[str, int]:
    """Index of the communication parameters of each message."""
    return {node.title(Common.TPDO + k).partition(":")[0]: Common.TPDO + k for k in tpdo_numbers(node)}


class BusUnit(Unit):
    """A board of which a reading is a row of signals."""

    frames: ReadingReader

    def also(self, *messages: str) -> None:
        """Switch on messages that are off by default; they belong to each reading from now on, until a reset.

        Raises ValueError for one that the board has not.
        """
        tpdos = tpdos_of(self.node)
        for name in messages:
            if name not in tpdos:
                raise ValueError(expected(", ".join(tpdos), repr(name), f"message of a {self.title}"))
            self.node.write(tpdos[name], 1, int(self.node.read(tpdos[name], 1)) & ~TPDO_OFF)
        wanted = {*self.frames.layout.messages, *messages}
        self.host.listeners.remove(self.frames.on_message)
        in_order = tuple(name for name in tpdos if name in wanted)
        self.frames = ReadingReader(replace(self.frames.layout, messages=in_order), self.node.node_id)
        self.host.listeners.append(self.frames.on_message, self.frames.ids)

    def stream(self, count: int, timeout_s: float = 5.0) -> Readings:
        """The next `count` readings; the stream runs only meanwhile. Raises LinkError when fewer come in timeout_s."""
        self._gather(count, timeout_s)
        return self.frames.take().head(count)
