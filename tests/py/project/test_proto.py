"""The protocol's files against their source and against the tools that read them."""

import configparser
import re
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

import canopen
import cantools
import gen_proto
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from protogen import c_tables, page, source
from protogen.model import TYPES

ROOT = Path(__file__).resolve().parents[3]
DBC = ROOT / "proto/psabench.dbc"
EDS = ROOT / "proto/psa2.eds"
VOLT_PER_LSB = 10 / 2**23


def load_database() -> cantools.database.can.Database:
    database = cantools.database.load_file(DBC)
    assert isinstance(database, cantools.database.can.Database)
    return database


PROTOCOL = source.load()
PROTOCOLS = source.load_all()
UNITS = PROTOCOLS[1:]
EACH = pytest.mark.parametrize("protocol", PROTOCOLS, ids=lambda p: p.key)
EACH_UNIT = pytest.mark.parametrize("protocol", UNITS, ids=lambda p: p.key)
WITH_BUS = [p for p in UNITS if any(o.const == "BUS" for o in p.objects)]
EACH_WITH_BUS = pytest.mark.parametrize("protocol", WITH_BUS, ids=lambda p: p.key)
DATABASE = load_database()
XY = DATABASE.get_message_by_name("PSA2_XY")


@pytest.fixture(scope="module")
def db() -> cantools.database.can.Database:
    return load_database()


@pytest.fixture(scope="module")
def od() -> Any:
    return canopen.import_od(str(EDS), PROTOCOL.device["node"])


def eds(protocol: Any) -> Path:
    return ROOT / f"proto/{protocol.key}.eds"


def od_of(protocol: Any) -> Any:
    return canopen.import_od(str(eds(protocol)), protocol.device["node"])


def test_check_names_a_file_that_differs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stale = {ROOT / "proto/psabench.dbc": "something else"}
    monkeypatch.setattr(gen_proto, "kept_files", lambda _protocol: stale)
    assert gen_proto.main(["--check"]) == 1


def test_c_tables_are_the_same_twice() -> None:
    """No date, no dictionary order: the same source gives the same bytes."""
    assert c_tables.c_files(PROTOCOLS) == c_tables.c_files(source.load_all())


def test_identifiers_of_node_5(db: cantools.database.can.Database) -> None:
    """Sources can 3.3, PSA2_FRAME at 200h + node."""
    want = {
        "NMT": 0x000, "SYNC": 0x080, "EMCY": 0x085, "PSA2_XY": 0x185, "PSA2_FRAME": 0x205, "PSA2_ZT": 0x285,
        "PSA2_FAST": 0x385, "PSA2_BLOCK": 0x485, "SDO_TX": 0x585, "SDO_RX": 0x605, "HEARTBEAT": 0x705,
    }  # fmt: skip
    others = tuple(f"{p.nodes[0]}_" for p in UNITS)
    mine = [m for m in db.messages if not m.name.startswith(others)]
    assert {m.name: m.frame_id for m in mine} == want
    assert {m.name for m in db.messages if m.is_fd} == {"PSA2_FRAME", "PSA2_BLOCK"}
    assert {m.name: m.length for m in mine if m.length != 8} == {
        "NMT": 2, "SYNC": 1, "HEARTBEAT": 1, "PSA2_FRAME": 16, "PSA2_BLOCK": 64,
    }  # fmt: skip


def test_devices_have_their_default_nodes() -> None:
    """Sources can 3.3."""
    nodes = {p.key: p.device["node"] for p in PROTOCOLS}
    assert nodes | {"psa2": 5, "psd1": 6, "pmka": 7, "pik": 8, "gyro": 9} == nodes
    assert len(set(nodes.values())) == len(nodes)
    assert len({p.device["product_code"] for p in PROTOCOLS}) == len(PROTOCOLS)


@EACH_UNIT
def test_services_of_a_unit_stand_where_the_predefined_connection_set_has_them(
    protocol: Any, db: cantools.database.can.Database
) -> None:
    node, name = protocol.device["node"], protocol.nodes[0]
    services = {"EMCY": (0x80, 8), "SDO_TX": (0x580, 8), "SDO_RX": (0x600, 8), "HEARTBEAT": (0x700, 1)}
    for service, (base, length) in services.items():
        m = db.get_message_by_name(f"{name}_{service}")
        assert (m.frame_id, m.length) == (base + node, length)
        assert m.senders == (["HOST"] if service == "SDO_RX" else [name])
        assert {r for s in m.signals for r in s.receivers} == ({name} if service == "SDO_RX" else {"HOST"})
        assert [s.name for s in m.signals] == [s.name for s in db.get_message_by_name(service).signals]


def test_everybody_hears_network_management(db: cantools.database.can.Database) -> None:
    for name in ("NMT", "SYNC"):
        assert set(db.get_message_by_name(name).signals[0].receivers) == {p.nodes[0] for p in PROTOCOLS}


@EACH
def test_no_identifier_of_one_node_is_another_s(protocol: Any) -> None:
    """For any two nodes; a PSA-2 uses its own RPDO1 identifier, which a node without RPDOs leaves free."""
    bases = [m.id - protocol.device["node"] for m in protocol.messages if m.node]
    used = [base + node for base in bases for node in range(1, 128)]
    assert len(used) == len(set(used))
    fixed = [m.id for m in PROTOCOL.messages if not m.node]
    assert not set(used) & set(fixed)


@EACH_UNIT
def test_every_message_of_a_unit_decodes_to_what_was_encoded(protocol: Any, db: cantools.database.can.Database) -> None:
    """At both ends of each signal's range; no two signals share a bit."""
    for message in protocol.messages:
        m = db.get_message_by_name(message.name)
        bits = [s.start + k for s in message.signals for k in range(s.bits)]
        assert len(bits) == len(set(bits)), message.name
        assert max(bits) < 8 * message.len
        for end in (0, 1):
            raw = {s.name: s.raw_range[end] for s in message.signals}
            data = m.encode(raw, scaling=False)
            assert m.decode(data, scaling=False, decode_choices=False) == raw
            for s in message.signals:
                assert m.decode(data, decode_choices=False)[s.name] == pytest.approx(raw[s.name] * s.scale)


@EACH_UNIT
def test_names_and_ids_of_a_unit_s_own_messages(protocol: Any) -> None:
    tpdos = {t["message"]: t["cob"] for t in protocol.tpdos}
    own = {m.name: m for m in protocol.messages if m.name in tpdos}
    assert set(own) == set(tpdos)
    for name, cob in tpdos.items():
        assert name.startswith(f"{protocol.nodes[0]}_")
        assert own[name].id == cob + protocol.device["node"]


@given(st.integers(-(2**23), 2**23 - 1), st.integers(-(2**23), 2**23 - 1), st.integers(0, 65535))
def test_codes_survive_the_volts(x: int, y: int, seq: int) -> None:
    """The scale is a power of two times 10: a code goes to volts and back without loss."""
    data = x.to_bytes(3, "little", signed=True) + y.to_bytes(3, "little", signed=True) + seq.to_bytes(2, "little")
    volts = XY.decode(data)
    assert volts == {"X": x * VOLT_PER_LSB, "Y": y * VOLT_PER_LSB, "SEQ": seq}
    assert XY.decode(data, scaling=False) == {"X": x, "Y": y, "SEQ": seq}
    assert XY.encode(volts) == data


def test_scales_and_units(db: cantools.database.can.Database) -> None:
    for m in db.messages:
        for s in m.signals:
            if m.name.startswith("PSA2_") and s.name[0] in "XYZ" and m.name != "PSA2_FAST":
                assert (s.scale, s.unit) == (VOLT_PER_LSB, "V")
    fast = db.get_message_by_name("PSA2_FAST").get_signal_by_name("X")
    assert (fast.length, fast.scale, fast.is_signed) == (21, 8 * VOLT_PER_LSB, True)
    stamps = {
        m: db.get_message_by_name(m).get_signal_by_name("TSTAMP") for m in ("PSA2_ZT", "PSA2_FRAME", "PSA2_BLOCK")
    }
    assert {m: (s.length, s.scale, s.unit) for m, s in stamps.items()} == {
        "PSA2_ZT": (16, 4e-6, "s"), "PSA2_FRAME": (32, 1e-6, "s"), "PSA2_BLOCK": (32, 1e-6, "s"),
    }  # fmt: skip


def test_every_signal_and_message_is_explained(db: cantools.database.can.Database) -> None:
    assert [m.name for m in db.messages if not m.comment] == []
    assert [f"{m.name}.{s.name}" for m in db.messages for s in m.signals if not s.comment] == []


@EACH
def test_eds_has_every_entry_of_the_source(protocol: Any) -> None:
    od = od_of(protocol)
    for o in protocol.objects:
        for e in o.entries:
            entry = od[o.index] if o.var else od[o.index][e.sub]
            assert entry.data_type == TYPES[e.type][0], hex(o.index)
            assert entry.access_type == e.access, hex(o.index)
            assert entry.pdo_mappable == e.map
    assert set(od) == {o.index for o in protocol.objects}
    assert od[0x1008].default == protocol.device["name"]


@EACH_UNIT
def test_a_unit_has_the_objects_of_every_unit(protocol: Any) -> None:
    """As the host's classes use them, and with its counters at the end of 2030h."""
    od = od_of(protocol)
    bus = {0x2002, 0x2051}
    assert {0x1001, 0x1008, 0x1018, 0x2030, 0x2031, 0x2040} | (bus if protocol in WITH_BUS else set()) <= set(od)
    assert protocol in WITH_BUS or not bus & set(od)
    common = [v.name for sub, v in od[0x2030].items() if 0 < sub < 12]
    assert common == [
        "Readings", "Dropped", "Bus load", "Transmit errors", "Receive errors", "PDOs inhibited", "SYNCs",
        "Requests refused", "Malformed requests", "Bus cycles", "Bus cycles refused",
    ]  # fmt: skip
    assert len(od[0x2030]) == 12 + len(protocol.counters)
    assert od[0x2030][0].default == 11 + len(protocol.counters)
    assert od[0x1014].default == 0x80 + protocol.device["node"]
    names = [v.name for sub, v in od[0x2030].items() if sub]
    assert len(set(names)) == len(names), "the host tells counters by name"


@EACH_WITH_BUS
def test_the_bus_of_a_unit_has_its_registers_at_their_addresses(protocol: Any) -> None:
    bus = od_of(protocol)[0x2002]
    registers = {sub: v for sub, v in bus.items() if sub}
    assert bus[0].default == max(registers) <= 16
    assert all(v.data_type == TYPES["UNSIGNED16"][0] for v in registers.values())
    assert len({v.name for v in registers.values()}) == len(registers)


@EACH_WITH_BUS
def test_the_sdo_server_lets_every_cycle_through_to_the_board(protocol: Any) -> None:
    """Who may do what is for the board to refuse: all 16 addresses, both ways."""
    rows = re.findall(r"\{0x2002, (\d+), (\w+), (\w+)", c_tables.od_source(protocol))
    assert [(int(sub), kind, access) for sub, kind, access in rows] == [
        (0, "CO_UNSIGNED8", "CO_CONST"), *((k, "CO_UNSIGNED16", "CO_RW") for k in range(1, 17)),
    ]  # fmt: skip


@EACH_UNIT
def test_the_c_tables_of_a_unit_say_what_its_source_says(protocol: Any) -> None:
    text = c_tables.od_source(protocol)
    assert f"counter[] = {{{', '.join(f'{chr(34)}{c}{chr(34)}' for c in protocol.counters)}}}" in text
    off = sum(1 << k for k, t in enumerate(protocol.tpdos) if t.get("optional"))
    assert f".tpdo_off = {off}u," in text
    assert f".counter_count = {len(protocol.counters)}," in text
    assert ".counter_sub = 12," in text


def test_an_optional_tpdo_is_off_in_the_eds() -> None:
    on, off = ({"message": "M", "cob": 0x180, "optional": o} for o in (False, True))
    for t, cob in ((on, 0x40000180), (off, 0xC0000180)):
        assert source.tpdo_objects([t], [])[0].entries[1].value == cob


UNIT = """
device: {name: TEST, node: 9, vendor_id: 0, product_code: 1, revision: 1}
messages:
  - {name: TEST_A, id: 0x180, len: 8, comment: c, signals: [{name: X, start: 0, bits: 16, comment: c}]}
counters: [{name: Two words}]
"""


def unit_of(monkeypatch: pytest.MonkeyPatch, folder: Path, more: str) -> Any:
    monkeypatch.setattr(source, "ROOT", folder)
    return source.load_unit(folder / "proto/test.yaml", yaml.safe_load(UNIT + more), PROTOCOL)


def test_the_least_that_a_unit_needs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    unit = unit_of(monkeypatch, tmp_path, "tpdos: [{message: TEST_A, cob: 0x180}]")
    assert unit.counters == ("two_words",)
    assert {m.name: m.id for m in unit.messages} == {
        "TEST_EMCY": 0x89, "TEST_A": 0x189, "TEST_SDO_TX": 0x589, "TEST_SDO_RX": 0x609, "TEST_HEARTBEAT": 0x709,
    }  # fmt: skip
    assert not {0x2002, 0x2051} & {o.index for o in unit.objects}, "no bus"
    assert [e["name"] for e in unit.emcy] == [
        "NONE", "CAN_OVERRUN", "CAN_PASSIVE", "CAN_RECOVERED", "STREAM_REFUSED",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("more", "why"),
    [
        ("tpdos: [{message: TEST_A, cob: 0x180, off: true}]", "TPDO TEST_A: no such key"),  # YAML reads off as False
        ("tpdos: []\nobjects: [{index: 0x2030, name: N, type: UNSIGNED8, access: ro}]", "an object occurs twice"),
    ],
)
def test_a_unit_that_cannot_be_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path, more: str, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        unit_of(monkeypatch, tmp_path, more)


BUS_ROW = {"name": "X", "access": "ro"}


@pytest.mark.parametrize(
    "rows", [[{**BUS_ROW, "address": 16}], [BUS_ROW, {**BUS_ROW, "address": 0}], [{**BUS_ROW, "address": -1}]]
)
def test_an_address_that_the_bus_has_not_is_refused(rows: list[dict[str, Any]]) -> None:
    with pytest.raises(ValueError, match="bus: X: address"):
        source.bus_object(rows)


def test_addresses_of_the_bus_may_leave_gaps() -> None:
    o = source.bus_object([BUS_ROW, {**BUS_ROW, "name": "Y", "address": 5}, {"name": "Z"}])
    assert [(e.sub, e.name, e.access) for e in o.entries[1:]] == [(1, "X", "ro"), (6, "Y", "ro"), (7, "Z", "rw")]
    assert o.entries[0].value == 7


def test_eds_values_that_name_the_node(od: Any) -> None:
    node = PROTOCOL.device["node"]
    assert od[0x1014].default == 0x80 + node
    assert od[0x1200][1].default == 0x600 + node
    assert [od[0x1800 + k][1].default for k in range(5)] == [
        0x40000180 + node, 0x40000280 + node, 0xC0000380 + node, 0xC0000480 + node, 0xC0000200 + node,
    ]  # fmt: skip


@EACH
def test_eds_sections_are_complete(protocol: Any) -> None:
    """CiA 306-1: the three lists name every object once, and each object has its section."""
    sheet = configparser.ConfigParser(strict=True)
    sheet.optionxform = str  # type: ignore[assignment, method-assign]
    sheet.read(eds(protocol))
    listed = []
    for name in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects"):
        section = sheet[name]
        listed += [int(section[str(k)], 16) for k in range(1, int(section["SupportedObjects"]) + 1)]
    assert sorted(listed) == [o.index for o in protocol.objects]
    assert all(sheet.has_section(f"{index:X}") for index in listed)


@EACH
def test_mappings_lay_out_their_messages(protocol: Any, db: cantools.database.can.Database) -> None:
    """Bits of 1A00h.. add up to the message, and stand where the DBC has its signals."""
    od = od_of(protocol)
    for k, tpdo in enumerate(protocol.tpdos):
        entries = [od[0x1A00 + k][sub + 1].default for sub in range(od[0x1A00 + k][0].default)]
        message = db.get_message_by_name(tpdo["message"])
        if not entries:
            continue
        bits = [value & 0xFF for value in entries]
        assert sum(bits) == 8 * message.length
        starts = {sum(bits[:i]): od[v >> 16][v >> 8 & 0xFF] for i, v in enumerate(entries)}
        filled = {s.start + k for s in message.signals for k in range(s.length)}
        for start, variable in starts.items():
            assert variable.pdo_mappable
            fills = not filled & set(range(start, start + len(variable)))
            assert start in {s.start for s in message.signals} or (variable.name == "Reserved" and fills)
        assert [len(variable) for variable in starts.values()] == bits, "each object whole"


@EACH_UNIT
def test_every_message_of_a_unit_is_mapped(protocol: Any) -> None:
    od = od_of(protocol)
    assert all(od[0x1A00 + k][0].default for k in range(len(protocol.tpdos)))


@cache
def mapped(key: str) -> Any:
    """The TPDOs of a device as python-canopen maps them from its EDS."""
    protocol = next(p for p in PROTOCOLS if p.key == key)
    node = canopen.RemoteNode(protocol.device["node"], od_of(protocol))
    canopen.Network().add_node(node)
    node.tpdo.read(from_od=True)  # type: ignore[no-untyped-call]
    return node.tpdo


@EACH_UNIT
@settings(deadline=None)
@given(data=st.binary(min_size=8, max_size=8))
def test_python_canopen_decodes_a_frame_by_the_mapping_as_cantools_does(protocol: Any, data: bytes) -> None:
    """Each signal, found in the object that lies over it; an object that is one signal has its very value."""
    tpdos = mapped(protocol.key)
    for k, tpdo in enumerate(protocol.tpdos):
        pdo, message = tpdos[k + 1], DATABASE.get_message_by_name(tpdo["message"])
        pdo.on_message(pdo.cob_id, bytearray(data), 0.0)
        want: Any = message.decode(data, scaling=False, decode_choices=False)
        for s in message.signals:
            v = next(v for v in pdo.map if v.offset <= s.start < v.offset + v.length)
            if (v.offset, v.length) == (s.start, s.length):
                assert v.raw == want[s.name], s.name
            else:
                bits = v.raw >> s.start - v.offset & (1 << s.length) - 1
                assert bits == want[s.name] & (1 << s.length) - 1, s.name


@pytest.mark.parametrize(
    ("message", "least_us", "worst_us"),
    [("PSA2_XY", 111, 135), ("PSA2_FRAME", 62, 73), ("PSA2_BLOCK", 140, 170), ("PSA2_FAST", 111, 135)],
)
def test_worst_case_of_the_page_is_that_of_the_facts(message: str, least_us: int, worst_us: int) -> None:
    """Sources can 3.1 at 1/5 Mbit/s."""
    nominal, data = page.worst_bits(next(m for m in PROTOCOL.messages if m.name == message))
    assert least_us < nominal + data / 5 <= worst_us
    assert round(nominal + data / 5) == worst_us


@EACH
def test_page_has_every_message_object_and_code(protocol: Any) -> None:
    page = (
        ROOT / "docs/reference" / ("protocol.md" if protocol.key == "psa2" else f"protocol_{protocol.key}.md")
    ).read_text()
    for left in ("messages", "load", "objects", "emcy", "about"):
        assert f"<!-- {left} -->" not in page
    assert not re.search(r"\{(name|key|KEY|node)\}", page)
    for m in protocol.messages:
        assert f"### {m.name}" in page
    for o in protocol.objects:
        assert f"| {o.index:04X}h |" in page
    for e in protocol.emcy:
        assert f"| {e['code']:04X}h |" in page
    for e in (e for o in protocol.objects for e in o.entries if e.comment):
        assert e.comment in page
    assert ("108.0 % **refused**" in page) == (protocol.key == "psa2")


def test_generated_c_compiles_without_a_warning(tmp_path: Path) -> None:
    for name, text in c_tables.c_files(PROTOCOLS).items():
        (tmp_path / "gen").mkdir(exist_ok=True)
        (tmp_path / "gen" / name).write_text(text)
    flags = "-std=c11 -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror -fsyntax-only".split()
    for name in ("psabench_can.c", *(f"{p.key}_od.c" for p in PROTOCOLS)):
        subprocess.run(["cc", *flags, f"-I{ROOT}/emu", f"-I{tmp_path}", str(tmp_path / "gen" / name)], check=True)
