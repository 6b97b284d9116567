"""Registers with their fields, results as text, expectations, the transcript."""

from __future__ import annotations

from typing import Any

import canopen
import pytest
from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import Form
from psabench.boards.psd1.device import Psd1
from psabench.boards.unit import BANKS, Unit
from psabench.places import proto_file
from psabench.shell import dut, registers, render
from psabench.shell.commands import Command, Vocabulary
from psabench.shell.complete import candidates
from psabench.shell.expect import Expectation
from psabench.shell.grammar import describe, parse
from psabench.shell.lexer import Wrong
from psabench.shell.registers import FIELDS
from psabench.shell.transcript import Transcript, seconds

EXPLAINED = [
    ("x", "CONFIG0", 0x56, "SYNC 0 pulse, DR 2 1000 /s, PHASE 1 minimum, FILTR 2 sinc + FIR"),
    ("x", "CONFIG0", 0xBB, "SYNC 1 continuous, DR 7 reserved, PHASE 0 linear, FILTR 3 sinc + FIR + high-pass"),
    ("z", "CONFIG1", 0x08, "MUX 0 AIN1, CHOP 1 on, PGA 0 gain 1"),
    ("t", "STATUS", 0x36, "ID 3, ORDER 0 most significant bit first, ACAL 1 on, BUFEN 1 on, DRDY 0 low: data ready"),
    ("t", "MUX", 0x18, "PSEL 1 AIN1, NSEL 8 AINCOM"),
    ("t", "DRATE", 0x82, "DR 82h 100 /s"),
    ("t", "ADCON", 0x27, "CLK 1 fCLKIN, SDCS 0 off, PGA 7 gain 64"),
    ("x", "OFC0", 0x12, ""),
    (
        "psd1", "STATUS", 0x0AB5,
        "FL2 1 a word waits, AXIS 2 Z, CYCLE 0 none, INT0 1 active, FL1 1 active, DR 0 inactive, READY 1 set up, "
        "COMMAND 0 none, COEF 1 known, OVERRUN 0 no, LATE 1 a strobe came late",
    ),
    ("psd1", "COMMAND", 0x8001, "RUNS 1 yes, FAILED 0 no, LATEST 01h send as UC1"),
    ("psd1", "COMMAND", 0x4032, "RUNS 0 no, FAILED 1 yes, LATEST 32h control word Z"),
    ("psd1", "TEMP", 0x2FF0, "CHANNEL 2 Z, CODE -16"),
    ("psd1", "SERVICE", 0x3A1F, "CHANNEL 3 self-test, CODE 2591"),
    ("psd1", "UC_LOW", 0x0013, ""),
    ("psd1", "FLAGS", 0x0002, "INT0 0 inactive, FL1 1 active"),
    ("psd1", "X", 0x8000, ""),
    ("pmka", "RESETS", 0x0D, "X 1 positive, Y 3 negative, Z 0 none, K 0 none"),
    ("pmka", "ROTATION", 0x24E4, "X SERVES 0 none, Y SERVES 1 X, Z SERVES 2 Y, K SERVES 3 Z, TAU 4, CAL 2 resets"),
    ("pmka", "STATUS", 0x11, "READING 1 waits, MISSED 0 none, SATURATED 0 no, CLIPPED 0 no, AUTONOMOUS 1 yes"),
    ("pik", "STATUS", 0x0A,
     "SATURATED_X 0 no, SATURATED_Y 1 could not keep up, SATURATED_Z 0 no, NEW 1 latched since the last look"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("converter", "name", "value", "text"), EXPLAINED, ids=[f"{e[1]} {e[2]:02X}h" for e in EXPLAINED]
)
def test_a_register_is_told_field_by_field(converter: str, name: str, value: int, text: str) -> None:
    assert registers.explain(converter, name, value) == text


def test_fields_do_not_overlap_and_shift_as_their_mask() -> None:
    for (group, _), rows in FIELDS.items():
        width = 0xFF if group in ("accel", "temp") else 0xFFFF
        assert sum(b.mask for b in rows) == sum(b.mask for b in rows) & width
        assert all(not a.mask & b.mask for a in rows for b in rows if a is not b)
        assert all(max(b.meaning, default=0) <= b.mask >> b.shift for b in rows)


def test_fields_are_of_registers_that_the_board_has() -> None:
    """Names as in the EDS; what a board tells of its state is reported field by field."""
    for board in ("psd1", "pmka", "pik"):
        od = canopen.import_od(str(proto_file(f"{board}.eds")), 1)
        bus: Any = od[BANKS["bus"]]
        names = {v.name for v in bus.values()}
        mine = {name for group, name in FIELDS if group == board}
        assert "STATUS" in mine
        assert mine <= names


def command(name: str) -> Command:
    return next(row.command for row in dut.ROWS if row.command.name == name)


def unit(kind: type[Unit], *banks: str) -> Unit:
    it = object.__new__(kind)
    it.banks = {name: BANKS[name] for name in banks}
    return it


def test_what_is_offered_is_what_the_unit_has() -> None:
    psd1, psa2 = unit(Psd1, "bus"), unit(Psa2, "x", "y", "z", "t")
    for name, what in (("dut.form", Form), ("dut.opcode", ("accel", "temp"))):
        one = dut.of_unit(command(name), psd1)
        assert one.what == "Not of a PSD-1: only a PSA-2 has this."
        vocabulary = Vocabulary({name: one})
        assert [c.text for c in candidates(f"{name} ", vocabulary) if "=" not in c.text] == []
        assert describe(one.args[0]) in ("frame form", "which converters")
        same = dut.of_unit(command(name), psa2)
        assert same == command(name)
        assert len(same.args[0].offers) == len(what)
    of_bus, of_psa2 = dut.of_unit(command("dut.write"), psd1), dut.of_unit(command("dut.write"), psa2)
    assert of_bus.args[0].offers == ("bus",)
    assert of_psa2.args[0].offers == ("x", "y", "z", "t")
    assert describe(of_bus.args[2]) == "a word, as A55Ah"
    assert "fields" in describe(of_psa2.args[2])
    # a script is read through before `dut.use` is carried out: what another unit has is no wrong line
    call = parse("dut.write x CONFIG0 56h", Vocabulary({"dut.write": of_bus}))
    assert call is not None
    assert call.args["converter"] == "x"
    assert dut.of_unit(command("dut.set"), psd1) == command("dut.set")


CHANGED = [("56h", 0x56), ("0x56", 0x56), ("86", 0x56), ("DR=3", 0x5E), ("DR=4,PHASE=0", 0x62), ("SYNC=1", 0xD6)]


@pytest.mark.parametrize(("text", "value"), CHANGED)
def test_a_register_is_written_whole_or_by_fields(text: str, value: int) -> None:
    assert registers.changed("x", "CONFIG0", 0x56, text) == value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("256", "expected a byte"),
        ("zz", "expected a byte"),
        ("DR=8", "CONFIG0.DR: expected 0 to 7, got '8'"),
        ("RATE=1", "field of CONFIG0: expected SYNC, DR, PHASE, FILTR, got RATE"),
    ],
)
def test_what_cannot_be_written(text: str, words: str) -> None:
    with pytest.raises(Wrong, match=words.replace("(", r"\(")):
        registers.changed("x", "CONFIG0", 0x52, text)


def test_a_result_as_text() -> None:
    result = {
        "angle_deg": 5.0,
        "face": "direct",
        "at_rest": True,
        "units": [{"name": "a", "node": 5}, {"name": "bb", "node": 16}],
    }
    assert render.text(result).splitlines() == [
        "angle_deg  5",
        "face       direct",
        "at_rest    true",
        "units",
        "  name  node",
        "  a     5",
        "  bb    16",
    ]
    assert render.text({}) == ""
    assert render.text({"kinds": [{"kind": "bias", "args": [{"name": "bias_v", "unit": "V"}]}]}).splitlines() == [
        "kinds",
        "  kind  args",
        "  bias  bias_v",
    ]
    long = render.text({"points": [f"a.line.{n}" for n in range(20)]}).splitlines()
    assert len(long) == 2
    assert all(len(line) < 120 for line in long)
    assert render.text({"a": {"b": 1.0 / 3.0}}).splitlines() == ["a", "  b  0.333333333"]


RESULT = {"angle_deg": 30.004, "at_rest": True, "face": "side", "clients": [{"lost": 3}], "none": {}, "value": "56h"}
HELD = [
    "angle_deg = 30 +- 0.01",
    "angle_deg > 30",
    "angle_deg = 30 +- 0.01  # about",
    'face = "side"  # as mounted',
    "angle_deg <= 30.004",
    "angle_deg != 31",
    "at_rest = true",
    "face = side",
    'face = "side"',
    "clients.0.lost = 3",
    "clients.0.lost < 10h",
    "value = 56h",
    "value > 55h",
]
FAILED = [
    ("angle_deg = 30", "angle_deg is 30.004, expected = 30"),
    ("angle_deg = 30 +- 0.001", "expected = 30 +- 0.001"),
    ("angle_deg < 30", "expected < 30"),
    ("at_rest = 1 +- 2", "at_rest is true"),
    ("face > 3", "face is side"),
    ("angel_deg = 3", "latest result: expected angle_deg, at_rest, face, clients, none, value, got angel_deg"),
    ("clients.1.lost = 3", "latest result: expected no further field, got 1"),
]


@pytest.mark.parametrize("text", HELD)
def test_what_holds(text: str) -> None:
    assert Expectation.parse(text).failure(RESULT) == ""


@pytest.mark.parametrize(("text", "words"), FAILED, ids=[f[0] for f in FAILED])
def test_what_does_not_hold(text: str, words: str) -> None:
    assert words in Expectation.parse(text).failure(RESULT)


@pytest.mark.parametrize(
    "text", ["", "angle_deg", "angle_deg 30", "a > b", "a > 3 +- 1", "a = b +- 1", "a = 1 +- b", "a < true"]
)
def test_what_is_no_expectation(text: str) -> None:
    with pytest.raises(Wrong, match="expect"):
        Expectation.parse(text)


def test_a_session_in_real_time_is_saved_with_its_instants() -> None:
    t = Transcript("start quiet", lockstep=False)
    t.add("head.turn 5", 1_000_000_000)
    t.add("head.read", 1_000_000_000)
    t.add("head.spin", 1_100_000_000, "head.spin: unknown command")
    t.add("head.spin\nbench.snapshot x", 1_100_000_000, "line: expected one line")  # stays a comment
    t.add("wait 1", 1_200_000_000)
    t.add("head.read", 2_250_000_001)
    assert t.script().splitlines()[1:] == [
        "start quiet",
        "at 1.0",
        "head.turn 5",
        "head.read",
        "# head.spin   error: head.spin: unknown command",
        "# head.spin bench.snapshot x   error: line: expected one line",
        "at 1.2",
        "wait 1",
        "at 2.250000001",
        "head.read",
    ]


def test_a_session_in_lockstep_needs_no_instants() -> None:
    t = Transcript("", lockstep=True)
    t.add("head.turn 5", 10)
    t.add("wait 1", 20)
    assert t.script().splitlines()[1:] == ["head.turn 5", "wait 1"]


@pytest.mark.parametrize(
    ("t_ns", "text"), [(0, "0.0"), (1, "0.000000001"), (10**9, "1.0"), (86_400_500_000_000, "86400.5")]
)
def test_seconds(t_ns: int, text: str) -> None:
    assert seconds(t_ns) == text
