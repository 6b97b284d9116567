"""Registers with their fields, results as text, expectations, the transcript."""

from __future__ import annotations

import pytest
from psabench.shell import registers, render
from psabench.shell.expect import Expectation
from psabench.shell.transcript import Transcript, seconds
from psabench.shell.words import Wrong

EXPLAINED = [
    ("x", "CONFIG0", 0x56, "SYNC 0 pulse, DR 2 1000 /s, PHASE 1 minimum, FILTR 2 sinc + FIR"),
    ("x", "CONFIG0", 0xBB, "SYNC 1 continuous, DR 7 reserved, PHASE 0 linear, FILTR 3 sinc + FIR + high-pass"),
    ("z", "CONFIG1", 0x08, "MUX 0 AIN1, CHOP 1 on, PGA 0 gain 1"),
    ("t", "STATUS", 0x36, "ID 3, ORDER 0 most significant bit first, ACAL 1 on, BUFEN 1 on, DRDY 0 low: data ready"),
    ("t", "MUX", 0x18, "PSEL 1 AIN1, NSEL 8 AINCOM"),
    ("t", "DRATE", 0x82, "DR 82h 100 /s"),
    ("t", "ADCON", 0x27, "CLK 1 fCLKIN, SDCS 0 off, PGA 7 gain 64"),
    ("x", "OFC0", 0x12, ""),
]


@pytest.mark.parametrize(
    ("converter", "name", "value", "text"), EXPLAINED, ids=[f"{e[1]} {e[2]:02X}h" for e in EXPLAINED]
)
def test_a_register_is_told_field_by_field(converter: str, name: str, value: int, text: str) -> None:
    assert registers.explain(converter, name, value) == text


def test_fields_do_not_overlap_and_shift_as_their_mask() -> None:
    for rows in registers.FIELDS.values():
        assert sum(b.mask for b in rows) == sum(b.mask for b in rows) & 0xFF
        assert all(not a.mask & b.mask for a in rows for b in rows if a is not b)
        assert all(max(b.meaning, default=0) <= b.mask >> b.shift for b in rows)


CHANGED = [("56h", 0x56), ("0x56", 0x56), ("86", 0x56), ("DR=3", 0x5E), ("DR=4,PHASE=0", 0x62), ("SYNC=1", 0xD6)]


@pytest.mark.parametrize(("text", "value"), CHANGED)
def test_a_register_is_written_whole_or_by_fields(text: str, value: int) -> None:
    assert registers.changed("x", "CONFIG0", 0x56, text) == value


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("256", "a byte is wanted"),
        ("zz", "a byte is wanted"),
        ("DR=8", "CONFIG0.DR: '8'; 0 to 7 is right"),
        ("RATE=1", "CONFIG0 has no field RATE; it has SYNC, DR, PHASE, FILTR"),
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
    ("angel_deg = 3", "the latest result has no angel_deg; it has angle_deg, at_rest, face, clients, none, value"),
    ("clients.1.lost = 3", "the latest result has no 1 there"),
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
    t.add("wait 1", 1_200_000_000)
    t.add("head.read", 2_250_000_001)
    assert t.script().splitlines()[1:] == [
        "start quiet",
        "at 1.0",
        "head.turn 5",
        "head.read",
        "# head.spin   refused: head.spin: unknown command",
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
