"""Mutants for the unit tests: operators of Python, what is drawn, what is kept and told."""

from __future__ import annotations

import ast
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from between import MUTATED

from tests.mutants import unit_mutants as units
from tests.mutants.declared import Mutant
from tests.mutants.python_operators import python_places
from tests.mutants.unit_mutants import Verdict, changed_lines, draw_mutants, judge_all, rate_table

ROOT = Path(__file__).resolve().parents[3]


def wrongs(kind: str, line: str) -> list[str]:
    """What a line becomes by each place of a kind."""
    text = f"def f(x: int = 0) -> str:\n    {line}\n"
    made = [text[:begin] + new + text[end:] for k, begin, end, new in python_places(text) if k == kind]
    return [t.splitlines()[1].strip() for t in made if t.splitlines()[0] == text.splitlines()[0]]


@pytest.mark.parametrize(
    ("kind", "line", "want"),
    [
        ("relation", "return a <= b", ["return a < b"]),
        ("relation", "return a not in b", ["return a in b"]),
        ("relation", "return a < b < 3", ["return a <= b < 3", "return a < b <= 3"]),
        ("arithmetic", "return (a) + (b)", ["return (a) - (b)"]),
        ("operands", "return a - b.c", ["return b.c - a"]),
        ("operands", "return a + b", []),
        ("logic", "return a and b or c", ["return a and b and c", "return a or b or c"]),
        ("constant", 'return "é" * 3', ['return "é" * (3 + 1)']),
        ("constant-less", "return -0.5", ["return -(0.5 - 1)"]),
        ("constant", "return True", []),
        ("arguments", "return f(a, b)", ["return f(b, a)"]),
        ("index", "return a[0] + a[k]", ["return a[1] + a[k]", "return a[0] + a[0]"]),
        ("condition", "return 1 if a else 2", ["return 1 if (not (a)) else 2"]),
        ("call", "g(a)", ["pass"]),
        ("statement", "a.b = 3", ["pass"]),
        ("constant", 'return f"{3}"', []),
    ],
)
def test_each_operator_makes_its_wrong(kind: str, line: str, want: list[str]) -> None:
    assert sorted(wrongs(kind, line)) == sorted(want)


def test_what_is_no_code_of_a_function_is_left_alone() -> None:
    text = 'A = 1 + 2\n\n\n@mark(3)\ndef f(x: Array[4]) -> Array[5]:\n    """7 - 8"""\n    return x\n'
    assert list(python_places(text)) == []


def test_mutants_of_our_own_files_are_still_python() -> None:
    text = (ROOT / "scripts/psabench/estimate/angles.py").read_text(encoding="utf-8")
    for _, begin, end, new in python_places(text):
        ast.parse(text[:begin] + new + text[end:])


@pytest.mark.parametrize("folder", ["emu/chip/ads1256", "scripts/psabench/estimate"])
def test_the_same_ones_are_drawn_each_time_and_apply(folder: str) -> None:
    first, again = draw_mutants(folder, 6, 1), draw_mutants(folder, 6, 1)
    assert first == again
    assert draw_mutants(folder, 6, 2) != first
    for m in first:
        text = (ROOT / m.file).read_text(encoding="utf-8")
        was, now = changed_lines(m)
        assert m.applied(text) != text
        assert was != now


class Finds:
    """Tests that find every second mutant."""

    def __init__(self) -> None:
        self.results: Iterator[str] = iter(["killed", "survived", "not judged"] * 9)

    def judge(self, _: Mutant) -> str:
        return next(self.results)


def test_what_is_known_is_not_judged_again_and_the_time_is_kept() -> None:
    folder, tests = "scripts/psabench/estimate", Finds()
    mutants = [(folder, m) for m in draw_mutants(folder, 6, 1)]
    found = list(judge_all(mutants, {}, lambda _: tests, time.monotonic() + 60.0))
    assert [v.result for v in found] == ["killed", "survived", "not judged"] * 2
    known = {v.stamp: v for v in found[:4]}
    others = judge_all(mutants, known, lambda _: tests, time.monotonic() + 60.0)
    assert [v.id for v in others] == [v.id for v in found[4:]]
    assert list(judge_all(mutants, {}, lambda _: tests, time.monotonic() - 1.0)) == []


def test_a_folder_s_rate_counts_what_was_judged() -> None:
    def verdict(k: int, result: str) -> Verdict:
        return Verdict(id=str(k), kind="call", file="a.py", stamp=str(k), folder="scripts/a", result=result)

    rows = [*(verdict(k, "killed") for k in range(3)), verdict(3, "survived"), verdict(4, "not judged")]
    assert list(rate_table(rows))[-1] == "| scripts/a | 3 | 4 | 75.0 % | 19.4 to 99.4 % |"


def test_the_page_has_room_for_the_table() -> None:
    text = units.PAGE.read_text(encoding="utf-8")
    assert [text.count(mark) for mark in MUTATED] == [1, 1]
