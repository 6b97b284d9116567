"""The ledger of evidence: what is a change of a model, what the gate says, what proving writes, what is counted."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import evidence
import gen_fidelity
import pytest
import yaml

ROOT = Path(__file__).resolve().parents[3]

SOURCE = """
#define F(x) ((x) + 1) // a macro
#define G (2)
static const char text[] = "/* no comment */ // nor this";
int f(int a)
{
    return a /* b */ + F(a) + '"'; // "
}
"""


def same(other: str) -> bool:
    return evidence.normalised("a.c", other) == evidence.normalised("a.c", SOURCE)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("// a macro", ""),
        ("/* b */ ", ""),
        ("    return a", "\treturn\n a"),
        ("int f(int a)\n{", "int f( int a ) {"),
        ("#define G (2)", "#  define  G  /* two */ (2)"),
        ("((x) + 1)", "((x) + \\\n 1)"),
        ("\n", "\r\n"),
        ("int f", "/* int g(void);\n // */ int f"),
    ],
)
def test_comments_blanks_and_lines_are_no_change(old: str, new: str) -> None:
    assert old in SOURCE
    assert same(SOURCE.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("+ F(a)", "- F(a)"),
        ("#define G (2)", "#define G(2)"),
        ("#define G (2)\n", ""),
        ("#define G (2)", "#define GG (2)"),
        ("#define G (2)", "#undef G (2)"),
        ("/* no comment */", "/* other */"),
        ("// nor this", ""),
        ("'\"'", "'\\''"),
        ("int f", "in tf"),
        ("return a", "return // a"),
        ("#define G (2)\n", "#define G (2) "),
        ("+ F(a)", "+ + F(a)"),
    ],
)
def test_anything_else_is(old: str, new: str) -> None:
    assert old in SOURCE
    assert not same(SOURCE.replace(old, new))


def test_signs_that_belong_together_are_not_torn_apart_in_silence() -> None:
    assert evidence.normalised("a.c", "a+++b;") != evidence.normalised("a.c", "a--+b;")
    assert evidence.normalised("a.c", "x = 1e-3;") != evidence.normalised("a.c", "x = 1e - 3;")
    assert evidence.normalised("a.c", "a + ++b;") != evidence.normalised("a.c", "a++ + b;")


def test_of_a_profile_the_values_count() -> None:
    assert evidence.normalised("p.yaml", "a: 1 # one\nb: 2\n") == evidence.normalised("p.yaml", "b: 2\na: 1\n")
    assert evidence.normalised("p.yaml", "a: 1\n") != evidence.normalised("p.yaml", "a: 2\n")


# ---- the gate, in a tree of two models

C_FILE, PY_FILE = "tests/unit/test_chip.c", "tests/py/test_chip.py"
LEDGER: dict[str, Any] = {
    "ladder": {"E0": "ours"},
    "groups": {
        "chip": {"title": "Chip", "files": ["emu/chip/*.[ch]"], "tests": [C_FILE, PY_FILE]},
        "board": {"title": "Board", "files": ["emu/board/*.c"], "tests": [PY_FILE, "conform psa2 article"]},
    },
    "rungs": {"E3": {"tests/py/test_chip.py": "computed"}},
    "claims": [{"subject": "chip", "claim": "it counts", "rung": "E3", "tests": ["tests/py/test_chip.py:test_it"]}],
}  # fmt: skip
C_TEST = """static void t(void **state)
{
}
int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(t)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
"""
FILES = {
    "emu/chip/chip.c": "int a;\n",
    "emu/chip/chip.h": "extern int a;\n",
    "emu/board/board.c": "int b;\n",
    "tests/unit/test_chip.c": C_TEST,
    "tests/py/test_chip.py": "def test_it(): ...\n",
}


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    (tmp_path / "docs").mkdir()
    return write(tmp_path, LEDGER)


def write(root: Path, ledger: dict[str, Any]) -> Path:
    (root / evidence.LEDGER).write_text(yaml.safe_dump(ledger, sort_keys=False))
    return root


def test_a_board_that_the_ledger_does_not_name_has_a_group(tree: Path) -> None:
    files = ("emu/board/toy/toy.c", "proto/toy.yaml", "proto/profiles/toy.yaml", "proto/profiles/toy2.yaml")
    for name in (*files, "emu/board/toy/notes.txt", "tests/unit/board/toy/test_toy.c"):
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).write_text("")
    ledger = evidence.load(tree)
    found = {g.name: g for g in ledger.groups}["toy"]
    assert (found.files, found.tests) == (files, ("tests/unit/board/toy/test_toy.c", "conform toy toy"))
    assert not list(evidence.faults(tree, ledger))


def passes(_root: Path, _tests: list[str]) -> str:
    return ""


def prove(root: Path, *names: str, run: Callable[[Path, list[str]], str] = passes) -> dict[str, str]:
    return evidence.prove(root, evidence.load(root), names or ("chip", "board"), run)


def says(root: Path) -> list[str]:
    return evidence.report(root, evidence.load(root))


def test_what_was_never_proved_is_stale_and_proving_ends_it(tree: Path) -> None:
    assert [line.split(" is stale")[0] for line in says(tree)] == ["chip", "board"]
    assert prove(tree) == {}
    assert says(tree) == []
    assert (tree / evidence.LOCK).read_text().count("\n") == 4


def test_a_changed_file_is_named_with_its_group_and_what_proves_it(tree: Path) -> None:
    prove(tree)
    (tree / "emu/chip/chip.c").write_text("/* the same */ int\na ;\n")
    assert says(tree) == []
    (tree / "emu/chip/chip.c").write_text("long a;\n")
    (line,) = says(tree)
    assert line == (
        "chip is stale, its evidence is of other sources: emu/chip/chip.c changed. `make prove GROUP=chip` proves it "
        "again by 1 files of C tests, test_chip.py"
    )
    assert prove(tree, "chip") == {}
    assert says(tree) == []


def test_files_that_come_and_go_are_changes(tree: Path) -> None:
    prove(tree)
    (tree / "emu/chip/chip.h").unlink()
    (tree / "emu/chip/other.c").write_text("int c;\n")
    (line,) = says(tree)
    assert "emu/chip/other.c is new, emu/chip/chip.h is gone" in line


def test_a_group_is_proved_only_if_all_its_tests_pass(tree: Path) -> None:
    ran: list[list[str]] = []

    def fails(_: Path, tests: list[str]) -> str:
        ran.append(tests)
        return "status 1" if any(t.startswith("conform") for t in tests) else ""

    assert prove(tree, run=fails) == {"board": "conform psa2 article: status 1"}
    assert ran == [["tests/unit/test_chip.c"], ["tests/py/test_chip.py"], ["conform psa2 article"]]
    assert [line.split(" is stale")[0] for line in says(tree)] == ["board"]


def test_a_failure_among_many_costs_only_the_groups_that_rest_on_it(tree: Path) -> None:
    ledger = yaml.safe_load(yaml.safe_dump(LEDGER))
    (tree / "tests/py/test_board.py").write_text("def test_it(): ...\n")
    ledger["groups"]["board"]["tests"] = ["tests/py/test_board.py"]
    write(tree, ledger)
    assert prove(tree, run=lambda _, tests: "status 1" if "tests/py/test_board.py" in tests else "") == {
        "board": "tests/py/test_board.py: status 1"
    }


def test_a_file_that_changes_while_its_tests_run_is_not_proved(tree: Path) -> None:
    def meddles(root: Path, _: list[str]) -> str:
        (root / "emu/chip/chip.c").write_text("short a;\n")
        return ""

    assert prove(tree, "chip", run=meddles) == {"chip": "its files changed while the tests ran"}
    assert len(says(tree)) == 2


def test_a_skipped_test_proves_nothing(tree: Path) -> None:
    (tree / ".venv").symlink_to(ROOT / ".venv")
    (tree / "pytest.ini").write_text("[pytest]\nmarkers = vcan\n slc0\n soak\n")
    test = tree / "tests/py/test_chip.py"
    assert evidence.run_tests(tree, ["tests/py/test_chip.py"]) == ""
    test.write_text("import pytest\ndef test_it(): pytest.skip('no probe')\n")
    assert evidence.run_tests(tree, ["tests/py/test_chip.py"]) == "1 skipped: no probe"
    test.write_text("def test_it(): assert False\n")
    assert evidence.run_tests(tree, ["tests/py/test_chip.py"]) == "status 1"


# ---- recordings of silicon, which are not in the repository

RECORDED = "tests/py/test_recorded.py"


@pytest.fixture
def recorded(tree: Path) -> Path:
    """The chip is compared with a recording, too."""
    (tree / RECORDED).write_text("def test_silicon(): ...\n")
    chip = LEDGER["groups"]["chip"] | {"recordings": [RECORDED]}
    return write(tree, LEDGER | {"groups": LEDGER["groups"] | {"chip": chip}})


def old(root: Path) -> dict[str, list[str]]:
    return evidence.not_judged_again(root, evidence.load(root))


def without_recordings(_root: Path, tests: list[str]) -> str:
    return "1 skipped: no recordings: PSABENCH_RECORDINGS is not set" if RECORDED in tests else ""


def test_without_recordings_the_rest_is_proved_and_they_are_not_judged_again(
    recorded: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert prove(recorded) == {}
    assert (says(recorded), old(recorded)) == ([], {})
    (recorded / "emu/chip/chip.c").write_text("long a;\n")
    assert prove(recorded, run=without_recordings) == {}
    assert says(recorded) == []
    assert old(recorded) == {"chip": ["emu/chip/chip.c changed"]}
    assert evidence.main(["--check", "--root", str(recorded)]) == 0
    assert "chip: E5 not judged again, its recordings: emu/chip/chip.c changed" in capsys.readouterr().out
    assert prove(recorded) == {}
    assert old(recorded) == {}


def test_a_recording_that_was_never_judged_counts_as_that(recorded: Path) -> None:
    assert prove(recorded, run=without_recordings) == {}
    assert old(recorded) == {"chip": ["no evidence has been recorded"]}


def test_a_recording_that_contradicts_is_a_failure(recorded: Path) -> None:
    assert prove(recorded, run=lambda _, tests: "status 1" if RECORDED in tests else "") == {
        "chip+E5": f"{RECORDED}: status 1"
    }
    assert "chip" in old(recorded)


def test_another_reason_to_skip_does_not_pass_for_missing_recordings(recorded: Path) -> None:
    assert "chip+E5" in prove(recorded, run=lambda _, tests: "1 skipped: no probe" if RECORDED in tests else "")


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"nav/north/new.cpp": "int n;\n"}, "nav/north/new.cpp is in no group"),
        ({"emu/board/b.h": "int n;\n"}, "emu/board/b.h is in no group"),
        ({"tests/py/test_chip.py": "def test_other(): ...\n"}, "tests/py/test_chip.py:test_it is no test that is run"),
    ],
)
def test_what_the_ledger_does_not_cover_is_told(change: dict[str, str], complaint: str, tree: Path) -> None:
    prove(tree)
    for name, text in change.items():
        (tree / name).parent.mkdir(parents=True, exist_ok=True)
        (tree / name).write_text(text)
    assert [line for line in says(tree) if complaint in line]


@pytest.mark.parametrize(
    ("claim", "complaint"),
    [
        ({"rung": "E4"}, "none of its tests is on rung E4"),
        ({"rung": "E1"}, "none of its tests is on rung E1"),
        ({"subject": "moon"}, "moon is no group"),
        ({"tests": ["tests/unit/test_chip.c:t"]}, "none of its tests is on rung E3"),
    ],
)
def test_a_claim_stands_on_a_test_of_its_rung(claim: dict[str, Any], complaint: str, tree: Path) -> None:
    write(tree, LEDGER | {"claims": [LEDGER["claims"][0] | claim]})
    assert [line for line in says(tree) if complaint in line]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [("a: [", "docs/evidence.yaml: "), ("ladder: {}\n", "'groups'"), (None, "No such file")],
)
def test_a_ledger_that_cannot_be_read_is_one_line(
    text: str | None, complaint: str, tree: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tree / evidence.LEDGER
    path.write_text(text) if text is not None else path.unlink()
    assert evidence.main(["--check", "--root", str(tree)]) == 1
    said = capsys.readouterr().err
    assert said.startswith("evidence: ")
    assert said.count("\n") == 1
    assert complaint in said


def test_an_unknown_group_is_refused_with_those_there_are(tree: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert evidence.main(["--root", str(tree), "--prove", "ship"]) == 1
    assert "no group ship; there are chip, board" in capsys.readouterr().err


def test_a_lock_with_marks_of_a_merge_is_refused(tree: Path) -> None:
    prove(tree)
    lock = tree / evidence.LOCK
    lock.write_text(lock.read_text() + "<<<<<<< HEAD\n")
    with pytest.raises(evidence.EvidenceError, match="a line is group, file, digest"):
        says(tree)


# ---- the shipped ledger and page


def test_every_model_file_is_in_a_group_and_every_claim_has_its_test() -> None:
    assert list(evidence.faults(ROOT, evidence.load(ROOT))) == []


def test_rows_count_by_their_highest_test() -> None:
    ledger = evidence.load(ROOT)
    own, timed, driver = (
        "tests/unit/chip/ads1256/test_ads1256.c:x",
        "tests/py/chips/test_chip_timing_ads1256.py:y",
        "tests/py/chips/test_pipyadc.py:z",
    )
    for tests, suite, rung in [
        ((), False, "none"),
        ((), True, "own"),
        ((own,), False, "own"),
        ((own, timed), False, "E2"),
        ((driver, timed), True, "E4"),
    ]:
        assert gen_fidelity.reached(gen_fidelity.Row("E2", tests, suite), ledger) == rung


def test_what_is_not_modelled_is_read_off_tables_columns_and_sentences() -> None:
    text = """
| clause | state | grade |
|---|---|---|
| bits | modelled | E1 |
| jitter | absent: clocks are exact | |
| leakage | absent | |

| what | how | not modelled |
|---|---|---|
| noise | white | 1/f |
| sign | exact | |

Not modelled: skew, delays (data are there, with CS).
"""
    assert list(gen_fidelity.not_modelled(text)) == [
        "jitter (clocks are exact)",
        "leakage",
        "noise: 1/f",
        "skew",
        "delays (data are there, with CS)",
    ]


def test_a_stale_group_is_marked_on_the_page(tmp_path: Path) -> None:
    """In a copy: a changed model, an unchanged one."""
    for name in ("docs", "proto", "tests", "emu", "nav", "scripts"):
        ignore = shutil.ignore_patterns("__pycache__", "img", "*.vcd")
        shutil.copytree(ROOT / name, tmp_path / name, ignore=ignore)
    ledger = evidence.load(tmp_path)
    evidence.prove(tmp_path, ledger, [g.name for g in ledger.groups], passes)
    assert {row[-1] for row in gen_fidelity.group_rows(tmp_path, ledger)} == {"as proved"}
    path = tmp_path / "emu/chip/ad7712/control.c"
    path.write_text(path.read_text() + "\nint more;\n")
    (row,) = [line for line in gen_fidelity.page(tmp_path).splitlines() if "**stale**" in line]
    assert row.startswith("| `ad7712` |")
    assert row.endswith("| **stale**: emu/chip/ad7712/control.c changed |")
