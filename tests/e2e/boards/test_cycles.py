"""Registers, bus cycles and refusals of every board over every adapter: by CAN and by the bus port."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import can
import canopen
import numpy as np
import pytest
from board_units import NODES, SCENARIO, SETUP_S
from canopen.objectdictionary import ODArray, ODRecord
from psabench.boards.pik.device import Pik
from psabench.boards.pmka.device import Pmka
from psabench.boards.psd1.device import Psd1
from psabench.boards.unit import BusUnit, Unit
from psabench.errors import CycleRefused, DeviceError, LinkError
from psabench.link.busport import BusPort, Cycle
from psabench.places import proto_file
from rig import HOST, MakeRig, Rig, over

SERIALS = {"psa2": 11, "psd1": 12, "pmka": 13, "pik": 14, "psd1_host": 15}
STATUS, UC_LOW, COMMAND, FLAGS = 3, 13, 14, 15  # of PSD-1
FL2, AXIS_SHIFT, INT0, FL1 = 0x01, 1, 0x01, 0x02  # bits of STATUS and FLAGS
ONE = over("socketcand")
LINKS = over("socketcand", "slcan", "vcan")


@pytest.fixture
def rig(transport: str, make_rig: MakeRig) -> Rig:
    rig = make_rig(transport, SCENARIO)
    rig.host.advance(SETUP_S)
    return rig


def unit_of(rig: Rig, name: str) -> Any:
    kind, node = NODES[name]
    return kind(rig.host, node)


def refused(action: Callable[[], object]) -> CycleRefused:
    with pytest.raises(CycleRefused) as e:
        action()
    return e.value


# ---- registers and streams


@LINKS
def test_every_unit_answers_as_its_own_class(rig: Rig) -> None:
    for name, (kind, _) in NODES.items():
        unit = unit_of(rig, name)
        assert unit.node.read(0x1008) == kind.title
        assert unit.serial() == SERIALS[name]
        assert unit.counters()["Malformed requests"] == 0
        for bank in unit.banks:
            assert unit.registers(bank)


@LINKS
def test_readings_of_every_board_are_complete(rig: Rig) -> None:
    for name in ("psd1", "pmka", "pik"):
        unit = unit_of(rig, name)
        assert isinstance(unit, BusUnit)
        unit.stop()
        before = unit.counters()
        readings = unit.stream(50)
        assert len(readings) == 50
        c = unit.frames.counters
        assert (c.lost, c.torn) == (0, 0), name
        assert np.array_equal(np.diff(readings[unit.layout.counter]) % 256, np.ones(49)), name
        after = unit.counters()
        assert after["Readings"] - before["Readings"] >= 50
        assert after["Dropped"] == before["Dropped"] == 0


@LINKS
def test_messages_that_are_off_come_when_the_host_wants_them(rig: Rig) -> None:
    unit: Psd1 = unit_of(rig, "psd1")
    assert np.isnan(unit.stream(3).t_sample_s).all()
    listeners = len(rig.host.listeners)
    unit.also("PSD1_TIME")
    assert len(rig.host.listeners) == listeners
    readings = unit.stream(20)
    assert np.array_equal(readings["PSD1_TIME.CNT"], readings["CNT"])
    assert np.diff(readings.t_sample_s) == pytest.approx([1 / 1028.0] * 19, rel=0.02)
    unit.reset()
    rig.host.advance(SETUP_S)
    with pytest.raises(LinkError, match="0 of 3"):
        unit.stream(3, timeout_s=0.2)  # a reset has switched it off again
    with pytest.raises(ValueError, match="PSD1_NEVER"):
        unit.also("PSD1_NEVER")


# ---- cycles


def wait_for_word(unit: Psd1, axis: int) -> None:
    """Until the status says that the word of this axis waits."""
    for _ in range(1000):
        status = unit.bus_read(STATUS)
        if status & FL2 and status >> AXIS_SHIFT & 3 == axis:
            return
    raise AssertionError(f"no word of axis {axis}: status {status:04X}h")


@LINKS
def test_a_host_reads_the_words_of_a_cycle_itself(rig: Rig) -> None:
    """INT0 and FL1 by a write cycle, each word when FL2 says so, and the same words go out as PSD1_CYCLE."""
    unit: Psd1 = unit_of(rig, "psd1_host")
    before = unit.counters()
    assert before["Cycles"] == 0, "no cycle before anybody asks for one"
    unit.frames.forget()
    unit.start()
    unit.bus_write(FLAGS, INT0 | FL1)
    words = []
    for axis in range(3):
        wait_for_word(unit, axis)
        words.append(unit.bus_read(axis))
    assert rig.host.pump_until(lambda: len(unit.frames) >= 1, 1.0)
    unit.stop()
    reading = unit.frames.take()
    assert [int(reading[s][0]) for s in "XYZ"] == words
    assert [int(reading[f"READ_{s}"][0]) for s in "XYZ"] == [1, 1, 1]
    level = 0x8000 + 0.2 / 10 * 0x8000  # 0.2 V of +-10 V: the sensor lies level; the other two have none
    assert words == pytest.approx([level, 0x8000, 0x8000], abs=1.5), "no noise in this unit: rounding, twice"
    after = unit.counters()
    assert after["Cycles"] - before["Cycles"] >= 1
    assert after["Bus cycles refused"] == before["Bus cycles refused"]
    assert after["Bus cycles"] - before["Bus cycles"] >= 3 + 3 + 1


@LINKS
def test_a_host_that_stays_away_stretches_the_cycle_and_loses_conversions(rig: Rig) -> None:
    unit: Psd1 = unit_of(rig, "psd1_host")
    unit.bus_write(FLAGS, INT0 | FL1)
    wait_for_word(unit, 0)
    rig.host.advance(0.05)  # about 51 conversions
    for axis in range(3):
        wait_for_word(unit, axis)
        unit.bus_read(axis)
    rig.host.advance(0.01)
    counters = unit.counters()
    assert counters["Late strobes"] >= 1
    assert counters["Stretched cycles"] >= 1
    assert counters["Lost X"] >= 40


@LINKS
def test_what_is_written_is_read_back(rig: Rig) -> None:
    pmka: Pmka = unit_of(rig, "pmka")
    beat = next(a for a, name in pmka.registers("bus").items() if name == "BEAT")
    pmka.write_register("bus", beat, 180)
    assert pmka.register("bus", beat) == 180
    psd1: Psd1 = unit_of(rig, "psd1_host")
    for word in (0x0000, 0xA55A, 0x5AA5):  # nothing is left of the word before
        psd1.bus_write(UC_LOW, word)
        assert psd1.bus_read(UC_LOW) == word
    for flags in (INT0, FL1, 0):  # both would begin a cycle
        psd1.bus_write(FLAGS, flags)
        assert psd1.bus_read(FLAGS) == flags


# ---- refusals

REFUSALS = [
    ("psd1", "a write to a word", lambda u: u.bus_write(0, 1), 0x06010002, "read-only"),
    ("psd1", "a write to the status", lambda u: u.bus_write(STATUS, 1), 0x06010002, "read-only"),
    ("pmka", "a read of what is only written", lambda u: u.bus_read(10), 0x06010001, "write-only"),
    ("pik", "a read of LATCH", lambda u: u.bus_read(11), 0x06010001, "write-only"),
    ("pik", "nothing there", lambda u: u.bus_read(14), 0x06090011, "nothing answers at this address"),
    ("pik", "nothing there to write", lambda u: u.bus_write(15, 0), 0x06090011, "write of 0 to address 0Fh (nothing)"),
    ("psd1_host", "a word before its time", lambda u: u.bus_read(1), 0x08000022, "too early"),
    ("psd1", "a word of the built-in host", lambda u: u.bus_read(1), 0x08000022, "profile psd1_host"),
    ("psd1", "a strobe too short", lambda u: u.bus_read(STATUS, strobe_ns=50), 0x06090030, "strobe 50 ns"),
    ("pmka", "a strobe too short", lambda u: u.bus_read(8, strobe_ns=1), 0x06090030, "shorter than the board needs"),
    ("pik", "a strobe too short", lambda u: u.bus_read(10, strobe_ns=50), 0x06090030, "shorter than the board needs"),
    ("psd1", "a command that is none", lambda u: u.bus_write(COMMAND, 0xFFFF), 0x06090030, "does not take this value"),
    ("pmka", "a mode that is none", lambda u: u.bus_write(9, 7), 0x06090030, "does not take this value"),
]


KEPT = {"psd1": "UC_LOW", "psd1_host": "UC_LOW", "pmka": "BEAT", "pik": "PERIOD"}  # what is written is read back


@LINKS
def test_refusals_have_their_code_and_words_are_counted_and_hang_nothing(rig: Rig) -> None:
    for name, what, action, code, words in REFUSALS:
        unit = unit_of(rig, name)
        unit.write_register("bus", KEPT[name], 0xA5)
        before = unit.counters()
        e = refused(lambda action=action, unit=unit: action(unit))  # type: ignore[misc]
        assert e.abort_code == code, what
        assert words in str(e), what
        after = unit.counters()
        assert after["Bus cycles refused"] == before["Bus cycles refused"] + 1, what
        assert after["Requests refused"] == before["Requests refused"] + 1, what
        assert after["Bus cycles"] == before["Bus cycles"], what
        unit.node.write(0x2051, 0, 0)  # the profile's strobe again
        assert unit.register("bus", KEPT[name]) == 0xA5, what


@LINKS
def test_a_strobe_that_no_board_could_make_is_refused_by_the_object(rig: Rig) -> None:
    unit = unit_of(rig, "psd1")
    with pytest.raises(DeviceError) as e:
        unit.node.write(0x2051, 0, 100_000_001)
    assert e.value.abort_code == 0x06090030
    assert unit.node.read(0x2051) == 0


@LINKS
def test_a_word_of_another_length_and_a_cut_frame_never_become_a_cycle(rig: Rig) -> None:
    unit = unit_of(rig, "psd1")
    flags = unit.bus_read(FLAGS)
    before = unit.counters()
    for data, code in ((b"\1", 0x06070013), (b"\1\2\3\4", 0x06070012)):
        with pytest.raises(DeviceError) as e:
            unit.node.write_raw(0x2002, FLAGS + 1, data)
        assert e.value.abort_code == code
    for length in range(8):
        rig.host.send(0x606, bytes([0x40, 0x02, 0x20, 0x04, 0, 0, 0, 0])[:length])
    after = unit.counters()
    assert after["Malformed requests"] == before["Malformed requests"] + 8
    assert after["Bus cycles"] == before["Bus cycles"]
    assert unit.bus_read(FLAGS) == flags


@LINKS
def test_a_client_that_gives_up_a_long_cycle_finds_the_bus_busy_then_free(rig: Rig) -> None:
    unit = unit_of(rig, "psd1")
    unit.node.write(0x2051, 0, 20_000_000)
    rig.host.send(0x606, bytes([0x40, 0x02, 0x20, STATUS + 1, 0, 0, 0, 0]))  # and its answer is not waited for
    e = refused(lambda: unit.bus_read(STATUS))
    assert e.abort_code == 0x08000022
    assert "another cycle is under way" in str(e)
    rig.host.advance(0.03)
    unit.node.write(0x2051, 0, 0)
    unit.bus_write(UC_LOW, 0xA5)
    assert unit.bus_read(UC_LOW) == 0xA5


# ---- objects, by the EDS


def entries(od: canopen.ObjectDictionary) -> Iterator[Any]:
    for o in od.values():
        yield from o.values() if isinstance(o, ODRecord | ODArray) else [o]


@ONE
def test_every_object_of_every_eds_is_there_with_its_rights(rig: Rig) -> None:
    for name, (kind, node) in NODES.items():
        unit = unit_of(rig, name)
        od = canopen.import_od(str(proto_file(f"{kind.board}.eds")), node)
        for v in entries(od):
            where = f"{name}: {v.index:04X}h:{v.subindex}"
            if (v.index == 0x2002 and v.subindex) or v.index in (0x2046,):
                continue  # cycles, which depend on the moment
            if "w" not in v.access_type or v.access_type == "rw":
                value = unit.node.read(v.index, v.subindex)
                if v.access_type == "const":
                    assert value == v.default, where
            if "w" not in v.access_type:
                with pytest.raises(DeviceError) as e:
                    unit.node.write_raw(v.index, v.subindex, b"\0")
                assert e.value.abort_code == 0x06010002, where
        for index in od:
            if isinstance(od[index], ODRecord | ODArray):
                with pytest.raises(DeviceError) as e:
                    unit.node.read_raw(index, 200)
                assert e.value.abort_code == 0x06090011, f"{name}: {index:04X}h"
        with pytest.raises(DeviceError) as e:
            unit.node.read_raw(0x2FFF, 0)
        assert e.value.abort_code == 0x06020000


class Mapped:
    """The TPDOs of a unit as python-canopen maps them from its EDS, and the frames that came."""

    def __init__(self, unit: Unit) -> None:
        node = unit.node.node_id
        remote = canopen.RemoteNode(node, canopen.import_od(str(proto_file(f"{unit.board}.eds")), node))
        canopen.Network().add_node(remote)
        remote.tpdo.read(from_od=True)  # type: ignore[no-untyped-call]
        self.unit, self.pdos = unit, list(remote.tpdo.values())
        self.came = 0
        unit.host.listeners.append(self._on_message)
        unit.start()

    def _on_message(self, m: can.Message) -> None:
        for pdo in self.pdos:
            if m.arbitration_id == pdo.cob_id:
                pdo.on_message(pdo.cob_id, bytearray(m.data), m.timestamp)
                self.came += 1

    def wait(self) -> None:
        """Until a frame of each has come."""
        assert self.unit.host.pump_until(lambda: self.came >= len(self.pdos), 1.0)

    def differing(self) -> list[str]:
        """Objects that do not say what the latest frame has in their place."""
        assert all(pdo.map for pdo in self.pdos)
        values = {(v.index, v.subindex): v.raw for pdo in self.pdos for v in pdo.map}
        return [f"{i:04X}h:{sub}" for (i, sub), v in values.items() if self.unit.node.read(i, sub) != v]


@ONE
def test_mapped_objects_say_what_the_frames_carried(rig: Rig) -> None:
    """Readings that stand: the next cycle waits for its host, the next latch for its strobe."""
    psd1: Psd1 = unit_of(rig, "psd1_host")
    psd1.also("PSD1_TIME", "PSD1_GYRO", "PSD1_RATE")
    mapped = Mapped(psd1)
    psd1.bus_write(FLAGS, INT0 | FL1)
    for axis in range(3):
        wait_for_word(psd1, axis)
        psd1.bus_read(axis)
    mapped.wait()
    assert mapped.differing() == []
    assert psd1.node.read(0x2202, 2) & 7 == 7, "three words answered"
    pik: Pik = unit_of(rig, "pik")
    address = {name: a for a, name in pik.registers("bus").items()}
    pik.bus_write(address["PERIOD"], 0)
    mapped = Mapped(pik)
    rig.host.advance(0.1)
    pik.bus_write(address["LATCH"], 1)
    mapped.wait()
    assert mapped.differing() == []
    assert pik.node.read(0x2201, 1) > 0, "0.2 V on X"


@ONE
def test_mapped_objects_of_a_pmka_say_what_its_frames_carried(rig: Rig) -> None:
    """Its readings never stand: each object at a time when the number of the reading is that of the frames."""
    pmka: Pmka = unit_of(rig, "pmka")
    mapped = Mapped(pmka)
    mapped.wait()
    for pdo in mapped.pdos:
        for v in pdo.map:
            for _ in range(100):
                seq = [mapped.pdos[1].map[0].raw]
                seq.append(pmka.node.read(0x2202, 1))
                value, want = pmka.node.read(v.index, v.subindex), v.raw
                seq += [pmka.node.read(0x2202, 1), mapped.pdos[1].map[0].raw]
                if len(set(seq)) == 1:
                    break
            else:
                raise AssertionError("the reading moves on at each look")
            assert value == want, v.name


# ---- the bus port


@pytest.fixture
def ported(make_rig: MakeRig) -> Iterator[tuple[Rig, BusPort]]:
    rig = make_rig("socketcand", SCENARIO, extra=("--bus-port", "psd1_host:-"))
    rig.host.advance(SETUP_S)
    assert rig.emulator.control_path is not None
    with BusPort(rig.emulator.endpoint(bus="pty")["pty"], rig.host.advance) as port:
        yield rig, port


@HOST
def test_the_bus_port_gives_the_same_cycles(ported: tuple[Rig, BusPort]) -> None:
    rig, port = ported
    who = port.who()
    unit: Psd1 = unit_of(rig, "psd1_host")
    assert (who.board, dict(who.names)) == ("psd1", unit.registers("bus"))
    assert port.write(FLAGS, INT0 | FL1).data == INT0 | FL1
    words = []
    for axis in range(3):
        for _ in range(1000):
            status = port.read(STATUS).data
            if status & FL2 and status >> AXIS_SHIFT & 3 == axis:
                break
        words.append(port.read(axis))
    rig.host.advance(0.01)
    assert [unit.node.read(0x2200, k + 1) for k in range(3)] == [w.data for w in words]
    assert words[0].t_s < words[1].t_s < words[2].t_s
    counters = unit.counters()
    assert counters["Strobes"] >= 7
    assert counters["Bus cycles"] == 0, "those of the CAN side alone"


@HOST
def test_the_bus_port_says_that_the_built_in_host_takes_the_words(make_rig: MakeRig) -> None:
    rig = make_rig("socketcand", SCENARIO, extra=("--bus-port", "psd1:-"))
    rig.host.advance(SETUP_S)
    with BusPort(rig.emulator.endpoint(bus="pty")["pty"], rig.host.advance) as port:
        e = refused(lambda: port.read(1))
    assert e.abort_code == 0x08000022
    assert "profile psd1_host" in str(e)


@HOST
def test_the_bus_port_refuses_with_the_codes_of_can(ported: tuple[Rig, BusPort]) -> None:
    rig, port = ported
    unit: Psd1 = unit_of(rig, "psd1_host")
    cases: list[tuple[Callable[[], object], Callable[[], object]]] = [
        (lambda: port.read(0), lambda: unit.bus_read(0)),
        (lambda: port.write(STATUS, 1), lambda: unit.bus_write(STATUS, 1)),
        (lambda: port.write(COMMAND, 0xFFFF), lambda: unit.bus_write(COMMAND, 0xFFFF)),
        (lambda: port.read(STATUS, 50), lambda: unit.bus_read(STATUS, 50)),
    ]
    for by_port, by_can in cases:
        assert refused(by_port).abort_code == refused(by_can).abort_code
    assert unit.counters()["Refused strobes"] == 2 * len(cases)
    for line in ("R", "X 1", "R 1 2 3", "R zz", "R 1" + " " * 100, "R 1 -5", "W 1", "W 1 10000"):
        port.ask(line)
        with pytest.raises(LinkError, match=r"rejected by the bus port: (syntax|number|overlong)$"):
            port.answer()
    port.ask("r f")
    answer = port.answer()
    assert isinstance(answer, Cycle)
    assert answer.address == FLAGS


@HOST
def test_bus_port_can_and_control_take_turns(ported: tuple[Rig, BusPort]) -> None:
    """Three ways to one bus: each cycle is answered, to who asked for it."""
    rig, port = ported
    unit: Psd1 = unit_of(rig, "psd1_host")
    for k in range(20):
        port.ask(f"W D {k:X}")
        unit.bus_write(12, k)
        answer = port.answer()
        assert isinstance(answer, Cycle)
        assert unit.bus_read(13) == k == port.read(12).data
