"""Which class a unit gets, and what all of them share; the node is a stand-in that says what the test wants."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import can
import numpy as np
import pytest
from psabench.boards import devices, unit
from psabench.boards.devices import all_devices, identify, of_board
from psabench.boards.gyro.device import Gyro
from psabench.boards.pik.device import Pik
from psabench.boards.pmka.device import Pmka
from psabench.boards.psa2.device import Psa2
from psabench.boards.psd1.device import Psd1, volts
from psabench.boards.readings import Readings
from psabench.boards.unit import Unit
from psabench.errors import CycleRefused, DeviceError
from psabench.link.can_host import CanHost, WallClock
from psabench.link.protocol_files import dbc_node, message_name

from tests.py.link.test_host import FakeBus

ABORT, UPLOAD, DOWNLOAD = 0x80, 0x40, 0x60


class Node(FakeBus):
    """An SDO server: values by (index, sub), refused where they are an abort code below 0."""

    def __init__(self, node_id: int, values: Mapping[tuple[int, int], int | str]) -> None:
        super().__init__()
        self.node_id, self.values = node_id, values
        self.wrote: list[tuple[int, int, bytes]] = []
        self._text = b""

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        super().send(msg, timeout)
        if msg.arbitration_id != 0x600 + self.node_id:
            return
        answer = self._answer(bytes(msg.data))
        m = can.Message(arbitration_id=0x580 + self.node_id, is_extended_id=False, data=answer)
        self.waiting.append(m)

    def _answer(self, request: bytes) -> bytes:
        if request[0] & 0xE0 == 0x60:  # the next segment
            toggle, part, self._text = request[0] & 0x10, self._text[:7], self._text[7:]
            return bytes([toggle | (7 - len(part)) << 1 | (not self._text)]) + part.ljust(7, b"\0")
        at = int.from_bytes(request[1:3], "little"), request[3]
        value = self.values.get(at, -0x06020000)
        if isinstance(value, int) and value < 0:
            return bytes([ABORT]) + request[1:4] + (-value).to_bytes(4, "little")
        if request[0] & 0xE0 == 0x20:
            self.wrote.append((*at, request[4 : 8 - (request[0] >> 2 & 3)]))
            return bytes([DOWNLOAD]) + request[1:4] + bytes(4)
        if isinstance(value, str):
            self._text = value.encode()
            return bytes([UPLOAD | 1]) + request[1:4] + len(self._text).to_bytes(4, "little")
        sized = 3 | 2 << 2 if at[0] == 0x2002 else 2  # two bytes, or as many as the client knows of
        return bytes([UPLOAD | sized]) + request[1:4] + value.to_bytes(4, "little")


@pytest.fixture(autouse=True)
def hosts_are_closed(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    hosts: list[CanHost] = []
    init = CanHost.__init__

    def remember(self: CanHost, *args: Any) -> None:
        init(self, *args)
        hosts.append(self)

    monkeypatch.setattr(CanHost, "__init__", remember)
    yield
    for host in hosts:
        host.close()


def at_node(kind: type[Unit], node_id: int, values: Mapping[tuple[int, int], int | str]) -> tuple[Any, Node]:
    node = Node(node_id, values)
    return kind(CanHost(node, WallClock()), node_id), node


@pytest.mark.parametrize("kind", all_devices().values(), ids=lambda kind: kind.board)
def test_a_unit_says_itself_what_it_is(kind: type[Unit]) -> None:
    host = CanHost(Node(33, {(0x1008, 0): kind.title}), WallClock())
    assert identify(host, 33) is kind
    assert len(host.listeners) == 0, "who only asked for a name listens no more"


def test_where_nobody_answers_it_is_a_psa_2_as_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(devices, "NAME_S", 0.05)
    assert identify(CanHost(FakeBus(), WallClock()), 5) is Psa2
    assert identify(CanHost(Node(5, {(0x1008, 0): "PSA-9"}), WallClock()), 5) is Psa2


@pytest.mark.parametrize(
    ("board", "kind"),
    [
        ("psa2", Psa2),
        ("psa1", Psa2),
        ("psd1", Psd1),
        ("pmka", Pmka),
        ("pik", Pik),
        ("pik5", Pik),
        ("pik6", Pik),
        ("gyro", Gyro),
    ],
)
def test_boards_and_their_other_names(board: str, kind: type[Unit]) -> None:
    assert of_board(board) is kind


def test_a_board_that_nobody_knows_is_a_bad_argument() -> None:
    with pytest.raises(ValueError, match="board: expected psa2, psd1, pmka, pik, gyro, bins, receiver, got 'psa3'"):
        of_board("psa3")


def test_default_nodes() -> None:
    nodes = {board: dbc_node(board) for board in all_devices()}
    assert nodes | {"psa2": 5, "psd1": 6, "pmka": 7, "pik": 8, "gyro": 9} == nodes
    assert len(set(nodes.values())) == len(nodes)
    for board, kind in all_devices().items():
        assert kind(CanHost(FakeBus(), WallClock())).node.node_id == nodes[board]


def test_registers_by_the_names_of_the_eds() -> None:
    psd1, _ = at_node(Psd1, 6, {})
    assert psd1.registers("bus")[0] == "X"
    with pytest.raises(ValueError, match="bank of a PSD-1: expected bus"):
        psd1.registers("w")
    psa2, node = at_node(Psa2, 5, {(0x2000, 2): 0x56})
    assert set(psa2.banks) == {"x", "y", "z", "t"}
    assert psa2.registers("x")[1] == "CONFIG0"
    with pytest.raises(ValueError, match="bank of a PSA-2: expected x, y, z, t"):
        psa2.register("bus", 0)
    assert psa2.register("x", "config0") == psa2.register("x", "CONFIG0") == psa2.register("x", 1) == 0x56
    with pytest.raises(ValueError, match=r"register of x: expected ID, CONFIG0.*, got 'CONFIG9'"):
        psa2.write_register("x", "CONFIG9", 0)
    assert node.wrote == []
    psa2.write_register("x", "CONFIG0", 0x52)
    assert node.wrote == [(0x2000, 2, b"\x52")]


def test_words_of_a_psd1_as_volts() -> None:
    """docs/reference/protocol_psd1.md: U = (word - 32768) / 32768 times full scale, 10 V in the profiles."""
    words = {"X": [0x0000, 0x8000], "Y": [0x8001, 0xFFFF], "Z": [0x4000, 0xA000], "CNT": [1, 2]}
    columns = {k: np.array(v, dtype=np.float64) for k, v in words.items()}
    r = Readings(t_rx_s=np.zeros(2), t_sample_s=np.zeros(2), columns=columns, units=dict.fromkeys(words, "LSB"))
    want = np.array([[-10.0, 305.17578125e-6, -5.0], [0.0, 10.0 - 305.17578125e-6, 2.5]])
    assert volts(r) == pytest.approx(want, rel=1e-12)
    assert volts(r, 2.5 / 128) == pytest.approx(want / 512, rel=1e-12)


def test_cycles_with_and_without_a_strobe() -> None:
    psd1, node = at_node(Psd1, 6, {(0x2002, 4): 0xBEEF, (0x2002, 16): 0, (0x2051, 0): 0})
    assert psd1.bus_read(3) == 0xBEEF
    assert node.wrote == []
    assert psd1.register("bus", 3) == 0xBEEF
    psd1.bus_write(15, 0x1234, strobe_ns=1600)
    assert node.wrote == [(0x2051, 0, (1600).to_bytes(4, "little")), (0x2002, 16, b"\x34\x12")]
    psd1.write_register("bus", 15, 3)
    assert psd1.register("bus", psd1.registers("bus")[3]) == 0xBEEF
    assert node.wrote[-1] == (0x2002, 16, b"\x03\x00")
    with pytest.raises(ValueError, match="expected a 16-bit word"):
        psd1.bus_write(0, -1)


def test_a_refused_cycle_tells_the_board_s_own_words() -> None:
    """Also of an address that no EDS has: whether it is there, the board says."""
    words = "refused: read of address 9 (nothing): nothing answers at this address"
    psd1, _ = at_node(Psd1, 6, {(0x2002, 10): -0x06090011, (0x2031, 0): words})
    with pytest.raises(CycleRefused) as refused:
        psd1.bus_read(9)
    assert refused.value.abort_code == 0x06090011
    assert words in str(refused.value)
    with pytest.raises(CycleRefused):
        psd1.bus_write(9, 0)
    with pytest.raises(DeviceError):
        psd1.node.read(0x2051)


def test_counters_and_serial() -> None:
    psd1, _ = at_node(Psd1, 6, {(unit.COUNTERS, sub): 10 + sub for sub in range(1, 64)} | {(0x1018, 4): 77})
    counters = psd1.counters()
    assert counters["Readings"] == 11
    assert counters["Bus cycles refused"] == 10 + list(counters).index("Bus cycles refused") + 1
    assert psd1.serial() == 77


@pytest.mark.parametrize(
    ("can_id", "name"),
    [
        (0x000, "NMT"), (0x080, "SYNC"), (0x185, "PSA2_XY"), (0x205, "PSA2_FRAME"), (0x705, "HEARTBEAT"),
        (0x583, "PSD1_SDO_TX"), (0x183, "PSD1_CYCLE"), (0x083, "PSD1_EMCY"), (0x186, ""), (0x7FF, ""),
    ],
)  # fmt: skip
def test_names_of_frames_follow_the_boards_on_the_bus(can_id: int, name: str) -> None:
    assert message_name(can_id, {5: "psa2", 3: "psd1"}) == name


@pytest.mark.parametrize(("kind", "node"), [(Psd1, 6), (Pmka, 7)])
def test_registers_of_a_bus_by_name(kind: type[Unit], node: int) -> None:
    """No board's own look-up of names is in the way."""
    unit, _ = at_node(kind, node, {(0x2002, a + 1): 100 + a for a in range(8)})
    names = unit.registers("bus")
    assert {name: unit.register("bus", name) for a, name in names.items() if a < 8} == {
        name: 100 + a for a, name in names.items() if a < 8
    }
