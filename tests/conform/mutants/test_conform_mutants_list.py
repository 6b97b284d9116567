"""The list of mutants fits the sources and the requirements; the runner's own arithmetic."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest
from psabench.conform.profile import variant
from psabench.conform.requirements import requirements

from tests.false_positives import report as false_report
from tests.false_positives import run as false_run
from tests.mutants import random_mutants as chance
from tests.mutants import report
from tests.mutants import run as mutants_run
from tests.mutants.declared import ListError, Mutant, Target, load, problems
from tests.mutants.folder_tests import TESTS, find_files, folder_of
from tests.mutants.operators import PATTERNS, places
from tests.mutants.results import Book
from tests.mutants.run import sample, status
from tests.mutants.suite import Run
from tests.mutants.verdict import Result

ROOT = Path(__file__).resolve().parents[3]
LEAST = 120  # declared mutants that there must be


def mutant(old: str, new: str = "x", *, after: str = "", file: str = "a.c", name: str = "a") -> Mutant:
    return Mutant(id=name, kind="value", file=file, old=old, new=new, after=after, on=(Target.of("psa2"),))


def result(name: str, what: str, breaks: list[str] | None = None) -> Result:
    return Result(id=name, kind="value", file="a.c", stamp="", result=what, breaks=breaks or [])


def test_every_row_fits_its_source_and_names_requirements_that_there_are() -> None:
    assert problems(load(), ROOT, requirements().rows) == []


def test_there_are_enough_of_every_family() -> None:
    rows = load()
    boards = Counter(t.board for m in rows for t in m.on[:1])
    assert len(rows) >= LEAST
    assert min(boards[b] for b in ("psa2", "psd1", "pmka", "pik", "gyro")) >= 10
    assert len({m.kind for m in rows}) >= 12


def test_every_target_is_a_board_with_that_profile_and_the_requirement_holds_for_it() -> None:
    rows = requirements().rows
    for m in load():
        for t in m.on:
            v = variant(t.board, t.profile)
            assert any(rows[i].applies(v.board, v.profile) for i in m.breaks), f"{m.id} on {t}"


def test_the_old_text_stands_once_or_behind_what_is_named() -> None:
    assert mutant("b", "c").applied("a b d") == "a c d"
    assert mutant("b", "c", after="d").applied("a b d b e b") == "a b d c e b"
    for text in ("a d", "b b"):
        with pytest.raises(ListError):
            mutant("b", "c").applied(text)


def test_what_is_wrong_with_a_row_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.c").write_text("one two two")
    rows = [mutant("two", name="twice"), mutant("one", "one", name="nothing"), mutant("one", file="b.c", name="Away")]
    told = "\n".join(problems([*rows, rows[1]], tmp_path, []))
    for words in (
        "twice: a.c has the old text 2 times",
        "nothing: changes nothing",
        "no file b.c",
        "twice in the list",
    ):
        assert words in told
    assert "small letters" in told


def test_only_a_verdict_that_is_worse_than_before_kills() -> None:
    before = Run(how="judged", verdicts={"A": "passed", "B": "failed", "C": "inconclusive", "D": "passed"})
    after = Run(how="judged", verdicts={"A": "inconclusive", "B": "failed", "C": "failed", "D": "not observable"})
    assert after.worse_than(before) == ["C", "A"]


def test_rates_leave_out_what_nobody_can_see_or_nobody_knows() -> None:
    rows = [result("a", "killed"), result("b", "crashed"), result("c", "survived"), result("d", "excused")]
    assert report.rate([*rows, result("e", "equivalent"), result("f", "does not compile")]) == (2, 4)


def test_exit_status_wants_the_rate_and_a_list_that_compiles() -> None:
    good = [result(str(k), "killed") for k in range(19)]
    assert status([*good, result("x", "survived")], random=False) == 0
    assert status([*good[:18], result("x", "survived"), result("y", "excused")], random=False) == 1
    assert status([*good, result("x", "does not compile")], random=False) == 1
    assert status([*good, result("x", "does not compile")], random=True) == 0


def test_a_sample_is_the_same_each_time_and_of_many_kinds() -> None:
    first, again = (sample(load(), 8, 1) for _ in range(2))
    assert [m.id for m in first] == [m.id for m in again]
    assert len({m.kind for m in first}) == 8
    assert not any(m.reason for m in first)


def c_file(body: str) -> str:
    return f"int a = 1 + 2;\n\nint f(int x)\n{{\n    {body}\n}}\n"


def wrongs(kind: str, body: str) -> list[str]:
    """What a body becomes by each place of a kind."""
    text = c_file(body)
    made = [text[:begin] + new + text[end:] for k, begin, end, new in places(text) if k == kind]
    return [text.removeprefix(c_file("@").partition("@")[0]).removesuffix("\n}\n") for text in made]


def test_random_mutants_leave_comments_texts_and_tables_alone() -> None:
    text = c_file('/* x + 1 */\n    g("x + 1");\n    if (x < 3) return x + 7;\n    return 0;')
    kinds = {(kind, text[b:e].strip()) for kind, b, e, _ in places(text)}
    assert ("relation", "<") in kinds
    assert ("condition", "if (x < 3)") in kinds
    assert ("arithmetic", "+") in kinds
    assert sum(kind == "arithmetic" for kind, *_ in places(text)) == 1


@pytest.mark.parametrize(
    ("kind", "body", "want"),
    [
        ("constant", "x = 7;", ["x = (7 + 1);"]),
        ("constant-less", "x = 0x40u;", ["x = (0x40u - 1);"]),
        ("operands", "x = y->a - 3;", ["x = 3 - y->a;"]),
        ("operands", "x = y - y;", []),
        ("operands", "if (b[1] < x) x = 1;", ["if (x < b[1]) x = 1;"]),
        ("arguments", "x = g(a, b.c, 3);", ["x = g(b.c, a, 3);"]),
        ("index", "x = y[i];", ["x = y[0];"]),
        ("index", "x = y[0];", ["x = y[1];"]),
        ("condition", "while (x > 0) x--;", ["while (!(x > 0)) x--;"]),
        ("call", "g(x);", [";"]),
        ("call", "x = g(y);", []),
        ("statement", "x = g(y);", [";"]),
        ("statement", "g(x);", []),
        ("relation", "if (a != x) x = 1;", ["if (a == x) x = 1;"]),
    ],
)
def test_each_operator_makes_its_wrong(kind: str, body: str, want: list[str]) -> None:
    assert wrongs(kind, body) == want


def test_each_operator_has_places_and_each_folder_has_tests() -> None:
    paths = chance.mutated_files(ROOT)
    assert {kind for path in paths for kind, *_ in places((ROOT / path).read_text())} == set(PATTERNS)
    assert {folder_of(path) for path in paths} == set(TESTS)
    for c, python in TESTS.values():
        assert find_files(ROOT / "tests/unit", c)
        assert find_files(ROOT, python)


def test_the_interval_is_that_of_clopper_and_pearson() -> None:
    """The closed forms at the ends: (alpha/2)^(1/n) of n."""
    assert report.interval(0, 0) == "-"
    assert report.interval(20, 20) == f"{100 * 0.025 ** (1 / 20):.1f} to 100.0 %"
    assert report.interval(0, 20) == f"0.0 to {100 * (1 - 0.025 ** (1 / 20)):.1f} %"


def test_random_mutants_are_the_same_for_one_seed_and_apply() -> None:
    first, again = (chance.random_mutants(ROOT, 40, 5) for _ in range(2))
    assert [m.id for m in first] == [m.id for m in again]
    assert [m.id for m in chance.random_mutants(ROOT, 80, 5)][:40] == [m.id for m in first]
    for m in first:
        text = (ROOT / m.file).read_text(encoding="utf-8")
        assert m.applied(text) != text


def test_results_stand_as_long_as_their_row_is_the_same(tmp_path: Path) -> None:
    rows = [mutant("a", name=i) for i in "abc"]
    book = Book(tmp_path / "m.json", "declared", rows)
    for m, what in zip(rows, ("killed", "survived", "killed"), strict=True):
        book.keep(replace(result(m.id, what), stamp=m.stamp()))
    drawn = mutant("a", name="r")
    Book(tmp_path / "m.json", "random", [drawn]).keep(replace(result("r", "killed"), stamp=drawn.stamp()))
    changed = [rows[0], rows[1], mutant("other", name="c")]

    def todo(again: str | None) -> list[str]:
        return [m.id for m in Book(tmp_path / "m.json", "declared", changed).todo(changed, again)]

    assert (todo(None), todo("survived"), todo("unknown")) == (["a", "b", "c"], ["b", "c"], ["c"])
    again = Book(tmp_path / "m.json", "declared", changed)
    again.todo(changed[1:2], None)
    assert [r.id for r in again.of(changed)] == ["a"]
    assert [r.id for r in again.parts()["random"]] == ["r"]


def test_the_page_has_the_tables_between_its_marks(tmp_path: Path) -> None:
    page = tmp_path / "p.md"
    page.write_text("before\n{}\nold\n{}\nafter\n".format(*report.MARKS))
    report.page(page, {"declared": [result("a", "killed"), result("b", "survived", ["X-1"])], "random": []}, {})
    text = page.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "1 of 2 killed, 50.0 %" in text
    assert "| b | survived | X-1 |" in text
    assert "old" not in text


def test_a_part_that_has_no_results_here_keeps_its_tables(tmp_path: Path) -> None:
    page = tmp_path / "p.md"
    page.write_text("{}\n{}\n".format(*report.MARKS))
    drawn = replace(result("r", "killed"), by="C tests", file="emu/link/lines.c")
    report.page(page, {"declared": [result("a", "survived", ["X-1"])], "random": []}, {})
    report.page(page, {"declared": [], "random": [drawn]}, {"random_seed": 5})
    both = page.read_text()
    assert "| a | survived | X-1 |" in both
    assert "### Random mutants, seed 5" in both
    assert "| emu/link | 1 | 1 | 1 | 100.0 % |" in both
    assert "Device conformance killed 0, 0.0 %; of the others 1 by C tests of their folder." in both
    report.page(page, {"declared": [], "random": []}, {})
    assert page.read_text() == both


@pytest.mark.parametrize(
    ("text", "board", "profile", "adapter"),
    [("psa2", "psa2", None, ""), ("psa2:w24", "psa2", "w24", ""), ("psa2@slcan", "psa2", None, "slcan")],
)
def test_a_target_is_read_and_written(text: str, board: str, profile: str | None, adapter: str) -> None:
    target = Target.of(text)
    assert (target.board, target.profile, target.adapter) == (board, profile, adapter)
    assert str(target) == text


@pytest.mark.parametrize(("page", "marks"), [(mutants_run.PAGE, report.MARKS), (false_run.PAGE, false_report.MARKS)])
def test_the_page_that_a_run_writes_has_room_for_its_tables(page: Path, marks: tuple[str, str]) -> None:
    text = page.read_text(encoding="utf-8")
    assert [text.count(mark) for mark in marks] == [1, 1]
