"""The protocol's files against their source and against the tools that read them."""

import configparser
import subprocess
import sys
from importlib import util
from pathlib import Path
from types import ModuleType
from typing import Any

import canopen
import cantools
import pytest
from hypothesis import given
from hypothesis import strategies as st

ROOT = Path(__file__).resolve().parents[2]
DBC = ROOT / "proto/psabench.dbc"
EDS = ROOT / "proto/psa2.eds"
VOLT_PER_LSB = 10 / 2**23


def load_generator() -> ModuleType:
    spec = util.spec_from_file_location("gen_proto", ROOT / "tools/gen_proto.py")
    assert spec
    assert spec.loader
    module = util.module_from_spec(spec)
    sys.modules["gen_proto"] = module
    spec.loader.exec_module(module)
    return module


def load_database() -> cantools.database.can.Database:
    database = cantools.database.load_file(DBC)
    assert isinstance(database, cantools.database.can.Database)
    return database


gen_proto = load_generator()
PROTOCOL = gen_proto.load()
XY = load_database().get_message_by_name("PSA2_XY")


@pytest.fixture(scope="module")
def db() -> cantools.database.can.Database:
    return load_database()


@pytest.fixture(scope="module")
def od() -> Any:
    return canopen.import_od(str(EDS), PROTOCOL.device["node"])


def test_files_in_git_are_up_to_date() -> None:
    run = subprocess.run([sys.executable, str(ROOT / "tools/gen_proto.py"), "--check"], capture_output=True, text=True)
    assert run.returncode == 0, run.stderr


def test_check_names_a_file_that_differs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stale = {ROOT / "proto/psabench.dbc": "something else"}
    monkeypatch.setattr(gen_proto, "kept_files", lambda _protocol: stale)
    assert gen_proto.main(["--check"]) == 1


def test_c_tables_are_the_same_twice() -> None:
    """No date, no dictionary order: the same source gives the same bytes."""
    assert gen_proto.c_files(PROTOCOL) == gen_proto.c_files(gen_proto.load())


def test_identifiers_of_node_5(db: cantools.database.can.Database) -> None:
    """Sources can 3.3, PSA2_FRAME at 200h + node."""
    want = {
        "NMT": 0x000, "SYNC": 0x080, "EMCY": 0x085, "PSA2_XY": 0x185, "PSA2_FRAME": 0x205, "PSA2_ZT": 0x285,
        "PSA2_FAST": 0x385, "PSA2_BLOCK": 0x485, "SDO_TX": 0x585, "SDO_RX": 0x605, "HEARTBEAT": 0x705,
    }  # fmt: skip
    assert {m.name: m.frame_id for m in db.messages} == want
    assert {m.name for m in db.messages if m.is_fd} == {"PSA2_FRAME", "PSA2_BLOCK"}
    assert {m.name: m.length for m in db.messages if m.length != 8} == {
        "NMT": 2, "SYNC": 1, "HEARTBEAT": 1, "PSA2_FRAME": 16, "PSA2_BLOCK": 64,
    }  # fmt: skip


def test_no_identifier_of_one_node_is_another_s() -> None:
    """For any two nodes; a PSA-2 uses its own RPDO1 identifier, which a node without RPDOs leaves free."""
    bases = [m.id - PROTOCOL.device["node"] for m in PROTOCOL.messages if m.node]
    used = [base + node for base in bases for node in range(1, 128)]
    assert len(used) == len(set(used))
    fixed = [m.id for m in PROTOCOL.messages if not m.node]
    assert not set(used) & set(fixed)


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
            if s.name[0] in "XYZ" and m.name != "PSA2_FAST":
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


def test_eds_has_every_entry_of_the_source(od: Any) -> None:
    for o in PROTOCOL.objects:
        for e in o.entries:
            entry = od[o.index] if o.var else od[o.index][e.sub]
            assert entry.data_type == gen_proto.TYPES[e.type][0], hex(o.index)
            assert entry.access_type == e.access, hex(o.index)
            assert entry.pdo_mappable == e.map
    assert set(od) == {o.index for o in PROTOCOL.objects}


def test_eds_values_that_name_the_node(od: Any) -> None:
    node = PROTOCOL.device["node"]
    assert od[0x1014].default == 0x80 + node
    assert od[0x1200][1].default == 0x600 + node
    assert [od[0x1800 + k][1].default for k in range(5)] == [
        0x40000180 + node, 0x40000280 + node, 0xC0000380 + node, 0xC0000480 + node, 0xC0000200 + node,
    ]  # fmt: skip


def test_eds_sections_are_complete() -> None:
    """CiA 306-1: the three lists name every object once, and each object has its section."""
    eds = configparser.ConfigParser(strict=True)
    eds.optionxform = str  # type: ignore[assignment, method-assign]
    eds.read(EDS)
    listed = []
    for name in ("MandatoryObjects", "OptionalObjects", "ManufacturerObjects"):
        section = eds[name]
        listed += [int(section[str(k)], 16) for k in range(1, int(section["SupportedObjects"]) + 1)]
    assert sorted(listed) == [o.index for o in PROTOCOL.objects]
    assert all(eds.has_section(f"{index:X}") for index in listed)


def test_mappings_lay_out_their_messages(od: Any, db: cantools.database.can.Database) -> None:
    """Bits of 1A00h.. add up to the message, and stand where the DBC has its signals."""
    for k, tpdo in enumerate(PROTOCOL.tpdos):
        entries = [od[0x1A00 + k][sub + 1].default for sub in range(od[0x1A00 + k][0].default)]
        message = db.get_message_by_name(tpdo["message"])
        if not entries:
            continue
        bits = [value & 0xFF for value in entries]
        assert sum(bits) == 8 * message.length
        starts = {sum(bits[:i]) for i in range(len(bits))}
        assert starts <= {s.start for s in message.signals}
        for value in entries:
            assert od[value >> 16][value >> 8 & 0xFF].pdo_mappable


@pytest.mark.parametrize(
    ("message", "least_us", "worst_us"),
    [("PSA2_XY", 111, 135), ("PSA2_FRAME", 62, 73), ("PSA2_BLOCK", 140, 170), ("PSA2_FAST", 111, 135)],
)
def test_worst_case_of_the_page_is_that_of_the_facts(message: str, least_us: int, worst_us: int) -> None:
    """Sources can 3.1 at 1/5 Mbit/s."""
    nominal, data = gen_proto.worst_bits(next(m for m in PROTOCOL.messages if m.name == message))
    assert least_us < nominal + data / 5 <= worst_us
    assert round(nominal + data / 5) == worst_us


def test_page_has_every_message_object_and_code() -> None:
    page = (ROOT / "docs/protocol.md").read_text()
    assert "<!-- messages -->" not in page
    for m in PROTOCOL.messages:
        assert f"### {m.name}" in page
    for o in PROTOCOL.objects:
        assert f"| {o.index:04X}h |" in page
    assert "108.0 % **refused**" in page


def test_generated_c_compiles_without_a_warning(tmp_path: Path) -> None:
    for name, text in gen_proto.c_files(PROTOCOL).items():
        (tmp_path / "gen").mkdir(exist_ok=True)
        (tmp_path / "gen" / name).write_text(text)
    flags = "-std=c11 -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Werror -fsyntax-only".split()
    for name in ("psabench_can.c", "psa2_od.c"):
        subprocess.run(["cc", *flags, f"-I{ROOT}/emu", f"-I{tmp_path}", str(tmp_path / "gen" / name)], check=True)
