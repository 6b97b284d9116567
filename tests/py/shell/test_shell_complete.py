"""What the shell offers at the cursor: names, values, units and ranges."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from psabench.shell.complete import argument, candidates
from psabench.shell.grammar import parse
from psabench.shell.lexer import Wrong
from shell_bench import vocabulary

V = vocabulary()

OFFERED: list[tuple[str, list[str]]] = [
    ("", ["bench.", "faults.", "head.", "probe.", "scpi.", "supply.", "table.", "wait"]),
    ("h", ["head."]),
    ("head.", ["head.mount", "head.read", "head.turn"]),
    ("head.t", ["head.turn"]),
    ("w", ["wait"]),
    ("x", []),
    ("head.mount ", ["direct", "reversed", "side", "face="]),
    ("head.mount re", ["reversed"]),
    ("head.mount f", ["face="]),
    ("head.mount face=", ["direct", "reversed", "side"]),
    ("head.mount face=s", ["side"]),
    ("head.mount direct ", []),
    ("head.turn ", ["angle_deg="]),
    ("head.turn angle_deg=", []),
    ("table.rate 1 ", ["rate_dps="]),
    ("table.rate rate_dps=3 ", ["axis="]),
    ("supply.output o", ["on", "off", "on="]),
    ("probe.start run.vcd ", ["a", "b", "unit="]),
    ("faults.add ", ["stuck", "bias", "lost", "kind=", "point=", "at_s=", "for_s=", "bias_v=", "mask="]),
    ("faults.add s", ["stuck"]),
    ("faults.add stuck ", ["a.sensor.x", "a.sensor.z", "a.line.INT", "point=", "at_s=", "for_s="]),
    ("faults.add lost ", ["bus.can0", "supply", "point=", "for_s=", "at_s=", "mask="]),
    ("faults.add kind=bias point=a.sensor.x ", ["bias_v=", "at_s=", "for_s="]),
    ("faults.add bias point=", ["a.sensor.x", "a.sensor.z"]),
    ("faults.add point=a.line.INT kind=st", ["stuck"]),
    ("scpi.send t", ["table"]),
    ("nonsense ", []),
]


@pytest.mark.parametrize(("before", "texts"), OFFERED, ids=[repr(o[0]) for o in OFFERED])
def test_what_is_offered(before: str, texts: list[str]) -> None:
    assert [c.text for c in candidates(before, V)] == texts


def test_a_number_is_offered_with_its_unit_and_range() -> None:
    (c,) = candidates("head.turn ", V)
    assert c.about == "on its scale, deg, -3600 to 3600"


def test_an_object_that_is_not_here_says_why() -> None:
    (c,) = candidates("chamber.", V)
    assert (c.text, c.about) == ("chamber.", "chamber: not available: the scenario has no chamber")


ARGUMENTS: list[tuple[str, str | None]] = [
    ("table.rate", None),
    ("table.rate ", "axis"),
    ("table.rate 1", "axis"),
    ("table.rate 1 ", "rate_dps"),
    ("table.rate rate_dps=", "rate_dps"),
    ("table.rate rate_dps=3 ", "axis"),
    ("table.rate 1 2 ", None),
]


@pytest.mark.parametrize(("before", "name"), ARGUMENTS, ids=[repr(a[0]) for a in ARGUMENTS])
def test_the_argument_at_the_cursor(before: str, name: str | None) -> None:
    found = argument(before, V)
    assert found is not None
    assert (found[1].name if found[1] else None) == name


@given(st.sampled_from(sorted(V.commands)), st.text("abdefgnorstu_= 123", max_size=20))
def test_what_is_offered_ends_what_was_typed(name: str, more: str) -> None:
    """A candidate replaces what is at the cursor and nothing else, and makes no command unknown."""
    before = f"{name} {more}"
    for c in candidates(before, V):
        typed = before[len(before) - c.typed :]
        assert c.text.startswith(typed)
        try:
            parse(before[: len(before) - c.typed] + c.text, V)
            said = ""
        except Wrong as e:
            said = str(e)
        assert "unknown command" not in said
