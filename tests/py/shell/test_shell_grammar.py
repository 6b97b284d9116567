"""Lines of the shell: what they mean, and what is said of those that mean nothing."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from psabench.shell import units
from psabench.shell.grammar import parse
from psabench.shell.lexer import Word, Wrong, quote, split
from shell_bench import vocabulary

V = vocabulary()

RIGHT: list[tuple[str, str, dict[str, object]]] = [
    ("head.read", "head.read", {}),
    ("  head.read   # comment", "head.read", {}),
    ("head.turn 30", "head.turn", {"angle_deg": 30.0}),
    ("head.turn angle_deg=30deg", "head.turn", {"angle_deg": 30.0}),
    ("head.turn -90", "head.turn", {"angle_deg": -90.0}),
    ("head.turn 30arcmin", "head.turn", {"angle_deg": 0.5}),
    ("head.mount reversed", "head.mount", {"face": "reversed"}),
    ("table.rate 1 10", "table.rate", {"axis": 1, "rate_dps": 10.0}),
    ("table.rate rate_dps=10 axis=2", "table.rate", {"axis": 2, "rate_dps": 10.0}),
    ("table.rate rate_dps=10 2", "table.rate", {"axis": 2, "rate_dps": 10.0}),
    ("table.rate 1 360deg/h", "table.rate", {"axis": 1, "rate_dps": 0.1}),
    ("table.profile 1 0,0.5,1500ms", "table.profile", {"axis": 1, "times_s": [0.0, 0.5, 1.5]}),
    ("supply.output off", "supply.output", {"on": False}),
    ("probe.start run.vcd b", "probe.start", {"path": "run.vcd", "unit": "b"}),
    ('probe.start "my run.vcd"', "probe.start", {"path": "my run.vcd"}),
    ("probe.start path='a b'", "probe.start", {"path": "a b"}),
    ("probe.lines", "probe.lines", {}),
    ("faults.add stuck a.sensor.x at_s=63ms", "faults.add", {"kind": "stuck", "point": "a.sensor.x", "at_s": 0.063}),
    ("faults.add stuck z.sensor.x", "faults.add", {"kind": "stuck", "point": "z.sensor.x"}),  # the bench decides
    ("faults.add bias a.sensor.x 10mV", "faults.add", {"kind": "bias", "point": "a.sensor.x", "bias_v": 0.01}),
    ("faults.add point=b.adc.x kind=stuck", "faults.add", {"kind": "stuck", "point": "b.adc.x"}),
    ("wait 5ms", "wait", {"for_s": 0.005}),
    ('scpi.send table X "a b";*OPC? # x', "scpi.send", {"instrument": "table", "line": 'X "a b";*OPC? # x'}),
]  # fmt: skip

WRONG: list[tuple[str, int, str]] = [
    ("head.spin", 1, "head.spin: unknown command; did you mean head.turn"),
    ("heads.turn 1", 1, "did you mean head.turn"),
    ("chamber.set 20", 1, "chamber: not available: the scenario has no chamber"),
    ("xyzzy", 1, "help lists them"),
    ("run 1", 1, "run: unknown command"),
    ("head.turn", 10, "angle_deg: expected a value (on its scale, deg, -3600 to 3600), got none; usage: head"),
    ("head.turn abc", 11, "angle_deg: expected a number, got 'abc' (on its scale, deg, -3600 to 3600)"),
    ("head.turn 3601", 11, "angle_deg: expected a number in range, got 3601 (on its scale, deg, -3600 to 3600)"),
    ("head.turn 1e400", 11, "expected a number in range, got inf"),
    ("head.turn 1 2", 13, "head.turn: expected head.turn angle_deg, got one more argument, 2"),
    ("head.turn 5ms", 11, "unit: expected one of deg arcmin arcsec rad mrad, got 'ms'"),
    ("head.turn angle_deg=1 angle_deg=2", 23, "angle_deg: expected the argument once, got angle_deg=2 as well"),
    ("head.turn angel_deg=1", 11, "argument of head.turn: expected angle_deg, got angel_deg (did"),
    ("head.mount sid", 12, "face: expected direct, reversed, side, got 'sid' (did you mean side?)"),
    ("table.rate 1.5 10", 12, "axis: expected an integer, got 1.5 (outermost first, 1 to 3)"),
    ("table.rate 4 10", 12, "axis: expected a number in range, got 4"),
    ("table.rate 1 100.1", 14, "rate_dps: expected a number in range, got 100.1 (of the axis, deg/s, -100 to 100)"),
    ("table.profile 1 0,101", 17, "times_s: expected a number in range, got 101"),
    ("supply.output maybe", 15, "on: expected on or off, got 'maybe'"),
    ("probe.start run.vcd c", 21, "unit: expected a, b, got 'c'"),
    ("faults.add bias a.sensor.x", 27, "bias_v: expected a value (added, V, -15 to -2e-06 and 2e-06 to "),
    ("faults.add bias a.sensor.x -1uV", 28, "bias_v: expected a number in range, got -1e-06 (added, V, -15 to "),
    ("faults.add stack a.sensor.x", 12, "kind: expected stuck, bias, lost, got 'stack' (did you mean stuck?)"),
    ("faults.add stuck a.sensor.x bias_v=1", 29, "argument of faults.add: expected kind, point, at_s, for_s, "),
    ('probe.start "run', 13, "expected a closing quote, got \"run"),
    ("scpi.send tabel *IDN?", 11, "did you mean table?"),
    ("scpi.send table", 16, "line: expected a value (the rest of the line), got none"),
    ("head.turn 5\nbench.quit", 12, "line: expected one line, got a line break"),
    ("head.read # a\u2028bench.quit", 14, "line: expected one line, got a line break"),
]  # fmt: skip


@pytest.mark.parametrize(("line", "name", "args"), RIGHT, ids=[r[0] for r in RIGHT])
def test_a_line_means(line: str, name: str, args: dict[str, object]) -> None:
    call = parse(line, V)
    assert call is not None
    assert (call.command.name, call.args) == (name, args)


@pytest.mark.parametrize(("line", "name", "args"), RIGHT, ids=[r[0] for r in RIGHT])
def test_a_call_written_out_means_the_same(line: str, name: str, args: dict[str, object]) -> None:
    call = parse(line, V)
    assert call is not None
    assert parse(call.line, V) == call


@pytest.mark.parametrize(("line", "column", "words"), WRONG, ids=[w[0] for w in WRONG])
def test_a_wrong_line_is_told_where_and_what_would_be_right(line: str, column: int, words: str) -> None:
    with pytest.raises(Wrong) as e:
        parse(line, V)
    assert words in str(e.value)
    assert e.value.column == column
    assert e.value.exit_status == 2


@pytest.mark.parametrize("line", ["", "   ", "# all of it", "  # head.turn"])
def test_blanks_and_comments_mean_nothing(line: str) -> None:
    assert parse(line, V) is None


def test_the_bench_rows_have_the_names_of_the_shells_objects() -> None:
    assert {c.name: c.wire for c in V.commands.values() if c.name.startswith(("probe", "faults", "bench"))} == {
        "probe.start": "vcd.start",
        "probe.lines": "lines",
        "faults.add": "fault.add",
        "bench.counters": "counters",
    }


NUMBERS = [
    ("10", "deg", 10.0),
    ("1e-3", "s", 1e-3),
    (".5", "V", 0.5),
    ("63ms", "s", 0.063),
    ("1min", "s", 60.0),
    ("1h", "s", 3600.0),
    ("250us", "s", 250e-6),
    ("10ns", "s", 1e-8),
    ("1rad", "deg", 57.29577951308232),
    ("15.041067deg/h", "deg/s", 15.041067 / 3600),
    ("3300mV", "V", 3.3),
    ("1kHz", "Hz", 1000.0),
    ("56h", "", 86.0),
    ("0x56", "", 86.0),
    ("2g", "g", 2.0),  # a unit that only the bench knows
]


@pytest.mark.parametrize(("text", "unit", "value"), NUMBERS, ids=[f"{n[0]} in {n[1]}" for n in NUMBERS])
def test_a_number_with_a_unit(text: str, unit: str, value: float) -> None:
    assert units.number(text, unit) == value


@pytest.mark.parametrize(("text", "unit"), [("", "s"), ("s", "s"), ("1V", "s"), ("1x", ""), ("0x5G", ""), ("1 s", "s")])
def test_what_is_no_number_of_that_unit(text: str, unit: str) -> None:
    with pytest.raises(ValueError, match=r"expected a number|unit: expected"):
        units.number(text, unit)


def test_words_know_where_they_stand() -> None:
    assert split('a  "b c"d # e') == [Word("a", "a", 0), Word("b cd", '"b c"d', 3)]


@given(st.lists(st.text(st.characters(exclude_categories=("Cs", "Cc", "Z")) | st.just(" "), max_size=8), max_size=4))
def test_quoted_words_are_read_back(texts: list[str]) -> None:
    assert [w.text for w in split(" ".join(quote(t) for t in texts))] == texts


@given(st.text(max_size=40))
def test_any_line_is_a_call_nothing_or_wrong(line: str) -> None:
    column = 1
    try:
        parse(line, V)
    except Wrong as e:
        column = e.column
    assert 1 <= column <= len(line) + 1
