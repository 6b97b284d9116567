"""The fidelity tables: every known fact of the chips has its row, every row its test, every test exists and runs."""

from __future__ import annotations

import sys
from collections import Counter
from functools import cache
from importlib import util
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from find_tests import collected_in_python, registered_in_c

ROOT = Path(__file__).resolve().parents[3]
PYTHON_FOLDERS = ("tests/py", "tests/golden", "tests/e2e")  # as pytest is reported in pyproject.toml


def load_generator() -> ModuleType:
    spec = util.spec_from_file_location("gen_docs", ROOT / "tools/gen_docs.py")
    assert spec
    assert spec.loader
    module = util.module_from_spec(spec)
    sys.modules["gen_docs"] = module
    spec.loader.exec_module(module)
    return module


gen_docs = load_generator()
CHIPS = list(gen_docs.PAGES.values())


@cache
def names_in(file: str) -> frozenset[str]:
    """Tests in a file of that name; empty when there is none where the runners look."""
    if file.endswith(".c"):
        found = list((ROOT / "tests/unit").rglob(file))
        return frozenset(registered_in_c(found[0].read_text()) if len(found) == 1 else ())
    paths = [p for folder in PYTHON_FOLDERS for p in (ROOT / folder).rglob(file)]
    return frozenset(collected_in_python(paths[0].read_text()) if len(paths) == 1 else ())


def rows_of(chip: str) -> Any:
    return gen_docs.load_rows(chip, gen_docs.load_facts())


def test_the_facts_are_well_formed() -> None:
    sections = gen_docs.load_facts()
    facts = [f for s in sections for f in s.facts]
    assert len({f.id for f in facts}) == len(facts)
    assert [f.id for s in sections for f in s.facts if not f.id.startswith(s.number + "-")] == []
    assert [f.id for f in facts if not gen_docs.ROW_ID.fullmatch(f.id) or not f.fact or f.rows < 1] == []
    assert [s.number for s in sections] == [
        *(f"1.{n}" for n in range(1, 10)),
        *(f"2.{n}" for n in range(1, 9)),
        *(f"3.{n}" for n in range(1, 7)),
    ]


@pytest.mark.parametrize("chip", CHIPS)
def test_every_named_test_exists_and_is_run(chip: str) -> None:
    named = {t for row in rows_of(chip) for t in row.tests}
    assert sorted(t for t in named if t.split(":")[1] not in names_in(t.split(":")[0])) == []


@pytest.mark.parametrize("chip", CHIPS)
def test_every_fact_has_a_row_with_a_test_or_the_reason_why_none_can_be(
    chip: str, capsys: pytest.CaptureFixture[str]
) -> None:
    facts = [f for s in gen_docs.sections_of(chip, gen_docs.load_facts()) for f in s.facts]
    rows = rows_of(chip)
    row_of = {i: row for row in rows for i in (row.id, *row.also)}
    proved = [f for f in facts if f.id in row_of and row_of[f.id].state != "absent"]
    reasoned = [f for f in facts if f.id in row_of and row_of[f.id].state == "absent"]
    states = Counter(row.state for row in rows)
    with capsys.disabled():
        print(
            f"\n{chip}: {len(facts)} facts ({sum(f.rows for f in facts)} printed rows): {len(proved)} proved by tests, "
            f"{len(reasoned)} analog and absent, {len(facts) - len(proved) - len(reasoned)} without a row; "
            f"{len(rows)} rows ({', '.join(f'{n} {states[n]}' for n in gen_docs.STATES)}), "
            f"{len({t for row in rows for t in row.tests})} tests"
        )
    assert " ".join(f.id for f in facts if f.id not in row_of) == ""


@pytest.mark.parametrize("chip", CHIPS)
def test_a_fact_is_absent_only_if_it_is_analog(chip: str) -> None:
    analog = {f.id for s in gen_docs.load_facts() for f in s.facts if f.analog}
    known = {f.id for s in gen_docs.load_facts() for f in s.facts}
    absent = {i for row in rows_of(chip) if row.state == "absent" for i in (row.id, *row.also)}
    assert " ".join(sorted((absent & known) - analog)) == ""


@pytest.mark.parametrize("chip", CHIPS)
def test_every_timing_figure_is_measured_in_a_recording(chip: str) -> None:
    row_of = {i: row for row in rows_of(chip) for i in (row.id, *row.also)}
    timed = [f.id for s in gen_docs.sections_of(chip, gen_docs.load_facts()) for f in s.facts if f.measured]
    assert len(timed) > 25
    assert " ".join(i for i in timed if not any(t.startswith("test_chip_timing_") for t in row_of[i].tests)) == ""


def test_the_pages_are_up_to_date(capsys: pytest.CaptureFixture[str]) -> None:
    assert gen_docs.main(["--check"]) == 0, capsys.readouterr().err


CMOCKA = """
/* cmocka_unit_test(in_a_comment), */
static void runs(void **state)
{
}
static void not_in_a_table(void **state) { }
static void in_a_table_that_is_not_run(void **state) { }
int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(runs),
        // cmocka_unit_test(not_in_a_table),
        cmocka_unit_test(not_defined_here),
    };
    const struct CMUnitTest other[] = {cmocka_unit_test(in_a_table_that_is_not_run)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
"""


def test_a_c_test_counts_only_when_cmocka_runs_it() -> None:
    assert registered_in_c(CMOCKA) == {"runs"}


def test_a_python_test_counts_only_when_pytest_collects_it() -> None:
    source = """
def test_runs(): ...
def helper(): ...
@pytest.mark.skip(reason="no")
def test_skipped(): ...
class TestGroup:
    def test_inside(self): ...
class Other:
    def test_not_collected(self): ...
TEXT = "def test_in_a_string(): ..."
"""
    assert collected_in_python(source) == {"test_runs", "test_inside"}


GOOD = {"id": "1.4-gap", "state": "modelled", "grade": "E2", "tests": ["test_ads1282.c:x"]}


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, ""),
        ({"id": "1.4-new", "fact": "ours"}, ""),
        ({"grade": "E0 M85"}, ""),
        ({"grade": "E2; rounding E0"}, ""),
        ({"also": ["1.4-order"]}, ""),
        ({"state": "absent", "tests": [], "note": "analog"}, ""),
        ({"id": "1.4-new"}, "needs `fact`"),
        ({"id": "2.4-t1"}, "sections here: 1.1, "),
        ({"id": "gap"}, "id is section, hyphen"),
        ({"state": "done"}, "state 'done' is none of modelled, simplified, absent"),
        ({"grade": "good"}, "grade 'good' is not like E2"),
        ({"state": "absent", "tests": []}, "needs `note`"),
        ({"tests": []}, "is modelled, so it needs `tests`"),
        ({"tests": ["test_ads1282:x"]}, "test 'test_ads1282:x' is not like"),
        ({"tests": "test_ads1282.c:x"}, "is no list of texts"),
        ({"value": 24}, "value: 24 is no text; put it in quotes"),
        ({"also": ["1.4-nothing"]}, "also: 1.4-nothing is not in facts.yaml"),
        ({"also": ["1.4-gap"]}, "1.4-gap is in two rows"),
        ({"proof": "x"}, "unknown proof; there are also, fact,"),
    ],
)
def test_a_bad_row_is_told_in_one_line(change: dict[str, Any], says: str, tmp_path: Path) -> None:
    path = tmp_path / "ads1282.yaml"
    path.write_text(gen_docs.yaml.safe_dump([GOOD | change]), encoding="utf-8")
    if not says:
        assert len(gen_docs.load_rows("ads1282", gen_docs.load_facts(), path)) == 1
        return
    with pytest.raises(gen_docs.FidelityError) as e:
        gen_docs.load_rows("ads1282", gen_docs.load_facts(), path)
    assert says in str(e.value)
    assert str(e.value).startswith("ads1282.yaml: row 1 (")
    assert "\n" not in str(e.value)


@pytest.mark.parametrize(("text", "says"), [("a: [", "ads1282.yaml: "), ("a: b", "is no list of rows")])
def test_a_file_that_is_no_list_is_told(text: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "ads1282.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(gen_docs.FidelityError, match=says):
        gen_docs.load_rows("ads1282", gen_docs.load_facts(), path)


def test_the_table_stands_between_its_marks_and_nothing_else_changes() -> None:
    begin, end = gen_docs.MARKS
    text = f"before\n{begin}\nold\n{end}\nafter\n"
    assert gen_docs.page(text, "new") == f"before\n{begin}\nnew\n{end}\nafter\n"
    with pytest.raises(gen_docs.FidelityError, match=r"page: expected one line <!-- fidelity:begin -->"):
        gen_docs.page("no marks", "new")


def test_a_test_name_in_the_table_can_be_found() -> None:
    assert gen_docs.short("short_name") == "short_name"
    long = "an_unread_word_pulses_drdy_for_4_tclk_and_is_an_overrun"
    assert long.startswith(gen_docs.short(long).rstrip("…"))
