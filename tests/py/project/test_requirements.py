"""The requirements: files are read to the letter, the page tells what proves them, and nothing cited is missing."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gen_requirements
import pytest
import yaml
from psabench.conform.requirements import Requirements, RequirementsError, load, requirements
from psabench.errors import BadInput

ROOT = Path(__file__).resolve().parents[3]

INDEX: dict[str, Any] = {
    "version": 1,
    "grades": {"E0": "ours", "E1": "article"},
    "observe": {"can": "frames", "line": "samples"},
    "kinds": {"value": "a number", "edge": "an edge"},
    "groups": ["psa2"],
    "retired": [],
}
GROUP: dict[str, Any] = {"title": "PSA-2", "prefixes": ["PSA2"], "boards": {"psa2": "one"}}
ROW: dict[str, Any] = {
    "id": "PSA2-FRAME-03",
    "text": "Int shall be low for 74 us.",
    "source": "docs/boards/psa2.md#Output frame",
    "grade": "E0",
    "kind": "value",
    "observe": {"line": "fall to rise"},
}


HEAD = yaml.safe_dump(GROUP)
OTHER_GROUP: dict[str, Any] = {
    "title": "PSD-1",
    "prefixes": ["PSD1"],
    "boards": {"psd1": "another"},
    "traits": "parallel_bus",
    "rows": [ROW | {"id": "PSD1-CYC-01"}],
}


def write(folder: Path, rows: list[Any], index: dict[str, Any] | None = None, **group: Any) -> Path:
    """A folder as proto is, with two profiles; the path of its index."""
    (folder / "requirements").mkdir(exist_ok=True)
    (folder / "profiles").mkdir(exist_ok=True)
    (folder / "profiles/article.yaml").write_text("name: article\n")
    (folder / "profiles/psd1.yaml").write_text("board: psd1\n")
    (folder / "requirements/psd1.yaml").write_text(yaml.safe_dump(OTHER_GROUP))
    data = GROUP | {"rows": rows} | group
    (folder / "requirements/psa2.yaml").write_text(yaml.safe_dump(data, allow_unicode=True), encoding="utf-8")
    path = folder / "requirements.yaml"
    path.write_text(yaml.safe_dump(index or INDEX), encoding="utf-8")
    return path


def test_a_row_has_what_its_file_says(tmp_path: Path) -> None:
    more = {
        "limits": {"int_low_min_us": 74.0},
        "original": "не менее  74 мкс",
        "source": ["article, section 5"],
        "grade": "E1",
    }
    reqs = load(
        write(tmp_path, [ROW | more, ROW | {"id": "PSA2-FRAME-04", "boards": ["psa2", "psd1"], "profiles": "psd1"}])
    )
    first, second, other = reqs
    assert len(reqs) == 3
    assert (other.group, other.boards) == ("psd1", ("psd1",))
    assert reqs["PSA2-FRAME-03"] is first
    assert (first.group, first.boards, first.profiles, first.grade) == ("psa2", ("psa2",), (), "E1")
    assert first.original == "не менее 74 мкс"
    assert first.source == ("article, section 5",)
    assert dict(first.observe) == {"line": "fall to rise"}
    assert first.limit("int_low_min_us") == 74.0
    assert (second.boards, second.profiles) == (("psa2", "psd1"), ("psd1",))


def test_a_requirement_applies_to_its_boards_and_profiles(tmp_path: Path) -> None:
    every, one, _ = load(write(tmp_path, [ROW, ROW | {"id": "PSA2-FRAME-04", "profiles": ["article"]}]))
    assert every.applies("psa2", "article")
    assert every.applies("psa2", "a_profile_of_tomorrow")
    assert not every.applies("psd1", "psd1")
    assert one.applies("psa2", "article")
    assert not one.applies("psa2", "w24")
    assert not one.applies("psd1", "article")


def test_those_of_a_board_and_a_profile(tmp_path: Path) -> None:
    reqs = load(write(tmp_path, [ROW, ROW | {"id": "PSA2-FRAME-04", "boards": ["psd1"]}]))
    assert [r.id for r in reqs.of("psa2", "article")] == ["PSA2-FRAME-03"]
    assert [r.id for r in reqs.of("psd1", "psd1")] == ["PSA2-FRAME-04", "PSD1-CYC-01"]
    with pytest.raises(ValueError, match="profile of psa2: expected article, got 'psd1'"):
        reqs.of("psa2", "psd1")


def test_a_limit_that_is_not_there_is_named_beside_those_that_are(tmp_path: Path) -> None:
    row = next(iter(load(write(tmp_path, [ROW | {"limits": {"a_us": 1, "b_us": 2}}]))))
    assert row.limit("b_us") == 2
    with pytest.raises(KeyError, match=r"PSA2-FRAME-03: limit: expected a_us, b_us, got .*c_us"):
        row.limit("c_us")


def test_what_was_read_cannot_be_changed(tmp_path: Path) -> None:
    reqs = load(write(tmp_path, [ROW | {"limits": {"a_us": 1}}]))
    row = reqs["PSA2-FRAME-03"]
    with pytest.raises(TypeError):
        row.limits["a_us"] = 2  # type: ignore[index]
    with pytest.raises(TypeError):
        reqs.rows["PSA2-FRAME-03"] = row  # type: ignore[index]
    with pytest.raises(AttributeError):
        row.text = "else"  # type: ignore[misc]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, ""),
        ({"note": "n", "table": "proto/psd1.yaml#bus", "proved_by": "tests/unit/test_a.c:b"}, ""),
        ({"observe": {}, "unobservable": "inside"}, ""),
        ({"proof": "x"}, "expected boards, grade, id"),
        ({"id": "PSA2-FRAME-3"}, "expected PSA2, a topic, two digits"),
        ({"id": "PSD1-FRAME-03"}, "expected PSA2, a topic"),
        ({"id": 5}, "expected PSA2, a topic"),
        ({"text": "Int is low."}, "expected a sentence with shall"),
        ({"text": "Int shall be low"}, "expected a sentence with shall"),
        ({"text": ""}, "text: expected a text, got ''"),
        ({"source": []}, "expected a source"),
        ({"source": "hearsay"}, "source: expected the form article"),
        ({"source": "see ISO 11898-1"}, "|ISO 11898-1, got 'see ISO 11898-1'"),
        ({"source": ["CiA 301 7.2.4", "CiA 301 7.2.4"]}, "source: expected each item once"),
        ({"grade": "E9"}, "grade: expected E0, E1, got 'E9'"),
        ({"grade": "E1"}, "expected the article's sentence"),
        ({"original": "слово"}, "expected the article among the sources"),
        ({"kind": "mood"}, "kind: expected edge, value, got 'mood'"),
        ({"boards": ["pig"]}, "boards: expected all, parallel_bus, psa2, psd1, got 'pig'"),
        ({"profiles": ["w99"]}, "profiles: expected article, psd1, got 'w99'"),
        ({"profiles": ["psd1"]}, "profiles: expected profiles of psa2, got psd1"),
        ({"observe": {"nose": "smell"}}, "observe: expected can, line, got 'nose'"),
        ({"observe": {"can": ""}}, "observe: can: expected a text, got ''"),
        ({"observe": ["can"]}, "observe: expected a mapping"),
        ({"observe": {}}, "either `observe` or the reason `unobservable`"),
        ({"unobservable": "inside"}, "either `observe` or the reason `unobservable`"),
        ({"limits": {"Low": 1}}, "limits: expected a name like int_low_min_us, got 'Low'"),
        ({"limits": {"low_us": "74"}}, "limits: low_us: expected a number, got '74'"),
        ({"limits": {"low_us": True}}, "limits: low_us: expected a number, got True"),
        ({"limits": [1]}, "limits: expected a mapping"),
        ({"table": "the table"}, "expected a table like proto/psd1.yaml#bus"),
        ({"proved_by": ["tests/unit/test_a.c"]}, "got 'tests/unit/test_a.c'"),
        ({"proved_by": ["tests/py/test_a.py:helper"]}, "got 'tests/py/test_a.py:helper'"),
    ],
)
def test_a_bad_row_is_told_in_one_line_with_its_file_and_id(change: dict[str, Any], says: str, tmp_path: Path) -> None:
    path = write(tmp_path, [ROW | change])
    if not says:
        assert len(load(path)) == 2
        return
    with pytest.raises(RequirementsError) as e:
        load(path)
    assert says in str(e.value)
    assert str(e.value).startswith(f"psa2.yaml: {change.get('id', 'PSA2-FRAME-03')}: ")
    assert "\n" not in str(e.value)
    assert isinstance(e.value, BadInput)


@pytest.mark.parametrize("key", ["text", "source", "grade", "kind"])
def test_a_row_without_what_it_needs_is_told(key: str, tmp_path: Path) -> None:
    with pytest.raises(RequirementsError, match=f"PSA2-FRAME-03: expected {key}, got none"):
        load(write(tmp_path, [{k: v for k, v in ROW.items() if k != key}]))


def test_an_id_stands_once_and_does_not_come_back(tmp_path: Path) -> None:
    with pytest.raises(RequirementsError, match="expected each id once, got PSA2-FRAME-03 twice"):
        load(write(tmp_path, [ROW, ROW]))
    with pytest.raises(RequirementsError, match=r"got PSA2-FRAME-03 .retired."):
        load(write(tmp_path, [ROW], INDEX | {"retired": ["PSA2-FRAME-03"]}))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"version": 0}, "version: expected a number from 1 on"),
        ({"version": True}, "version: expected a number"),
        ({"grades": []}, "grades: expected a mapping of words"),
        ({"groups": [5]}, "groups: expected a text, got 5"),
        ({"groups": ["gone"]}, "gone.yaml: expected requirements in YAML, got no such file"),
        ({"colour": "red"}, ", got colour"),
    ],
)
def test_a_bad_index_is_told(change: dict[str, Any], says: str, tmp_path: Path) -> None:
    with pytest.raises(RequirementsError) as e:
        load(write(tmp_path, [ROW], INDEX | change))
    assert says in str(e.value)


def test_a_list_of_boards_names_all_a_trait_and_exceptions(tmp_path: Path) -> None:
    lists = ["all", ["all", "!psa2"], "parallel_bus", ["parallel_bus", "psa2"], ["psd1", "psa2"]]
    rows = [ROW | {"id": f"PSA2-FRAME-1{k}", "boards": boards} for k, boards in enumerate(lists)]
    found = [r.boards for r in load(write(tmp_path, rows)) if r.group == "psa2"]
    assert found == [("psa2", "psd1"), ("psd1",), ("psd1",), ("psa2", "psd1"), ("psd1", "psa2")]


def test_a_group_that_the_index_does_not_name_follows_those_that_it_names(tmp_path: Path) -> None:
    path = write(tmp_path, [ROW])
    assert [g.name for g in load(path).groups] == ["psa2", "psd1"]
    path.write_text(yaml.safe_dump(INDEX | {"groups": ["psd1"]}))
    assert [g.name for g in load(path).groups] == ["psd1", "psa2"]


@pytest.mark.parametrize(
    ("group", "says"),
    [
        ({"prefixes": "PSD1"}, "psd1.yaml: prefixes: expected prefixes of no other group, got PSD1"),
        ({"boards": {"psd1": "once more"}}, "psd1.yaml: boards: expected boards of no other group, got psd1"),
        ({"boards": {"psa1": "one"}}, "profiles/article.yaml: board: expected psa1, psd1, got 'psa2'"),
        ({"traits": "wings"}, "psa2.yaml: traits: expected parallel_bus, got 'wings'"),
        ({"colour": "red"}, "psa2.yaml: expected boards, prefixes, rows, title, traits, got colour"),
    ],
)
def test_a_bad_group_is_reported(group: dict[str, Any], says: str, tmp_path: Path) -> None:
    with pytest.raises(RequirementsError) as e:
        load(write(tmp_path, [ROW], **group))
    assert says in str(e.value)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("boards: [psa2]\nboards: [psa2]\nrows: []\n", "psa2.yaml: line 1: expected each key once, got boards twice"),
        (HEAD + "rows: []\n", "psa2.yaml: rows: expected a list"),
        (HEAD + "rows: [5]\n", "psa2.yaml: row 1: expected a mapping"),
        ("rows: [5]\n", "psa2.yaml: expected boards, prefixes, title, got none"),
        ("boards: [\n", "psa2.yaml: "),
        ("5\n", "psa2.yaml: expected a mapping"),
        ("boards: [psa2]\nrows:\n- {id: A, id: B}\n", "line 3: expected each key once, got id twice"),
    ],
)
def test_a_file_that_is_none_is_told(text: str, says: str, tmp_path: Path) -> None:
    path = write(tmp_path, [ROW])
    (tmp_path / "requirements/psa2.yaml").write_text(text)
    with pytest.raises(RequirementsError) as e:
        load(path)
    assert says in str(e.value)
    assert "\n" not in str(e.value)


# What is shipped


def test_every_shipped_profile_has_requirements_and_every_requirement_a_profile() -> None:
    reqs = requirements()
    assert sorted(reqs.profiles) == sorted(p.stem for p in (ROOT / "proto/profiles").glob("*.yaml"))
    meant = {p: {r.id for r in reqs.of(board, p)} for p, board in reqs.profiles.items()}
    assert all(meant.values())
    assert {r.id for r in reqs} - set().union(*meant.values()) == set()


def test_words_that_no_row_uses_are_grades_alone() -> None:
    reqs = requirements()
    assert {w for r in reqs for w in r.observe} == set(reqs.ways)
    assert {r.kind for r in reqs} == set(reqs.kinds)
    assert {b for r in reqs for b in r.boards} == set(reqs.boards)
    assert {r.id.split("-")[0] for r in reqs} == {p for g in reqs.groups for p in g.prefixes}


def test_pairs_of_limits_are_in_order() -> None:
    for row in requirements():
        for name, low in row.limits.items():
            high = row.limits.get(name.replace("_min", "_max"))
            assert high is None or low <= high, (row.id, name)


def test_the_figures_of_a_frame_agree_with_each_other() -> None:
    """INT low = (lead-in + 4 words + 3 pauses) / f_CLK, for the three formats that are shipped."""
    reqs = requirements()
    words, pause = reqs["PSA2-FRAME-01"].limit("words_count"), reqs["PSA2-FRAME-02"].limit("pause_clk")
    for form, low in (("06", "04"), ("07", "05"), ("08", "06")):
        frame, int_low = reqs[f"PSA2-FRAME-{form}"], reqs[f"PSA2-INT-{low}"]
        assert frame.profiles == int_low.profiles
        periods = int_low.limit("lead_in_clk") + words * frame.limit("word_bits") + (words - 1) * pause
        assert periods == int_low.limit("int_low_clk")
        assert int_low.limit("int_low_us") == pytest.approx(periods / frame.limit("clk_hz") * 1e6, rel=1e-9)
        assert int_low.limit("int_low_us") >= reqs["PSA2-INT-02"].limit("int_low_min_us")


def test_the_figures_of_a_psd1_transfer_agree_with_each_other() -> None:
    reqs = requirements()
    period = reqs["PSD1-CYC-07"].limit("period_ns")
    first, shift = reqs["PSD1-SER-03"].limit("first_rise_ns"), reqs["PSD1-SER-04"].limit("shift_ns")
    assert shift == period * 3 / 8
    assert first == period / 2 + shift
    end = first + reqs["PSD1-SER-05"].limit("pulses_count") * period - period / 2  # the last fall of SCLK
    low = reqs["PSD1-SER-07"].limit("rfx_low_ns")
    assert end < low <= end + period
    assert low % period == 0


# The page and its check


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A small checkout whose page is up to date: one row with a test in C, one with one of the suite."""
    proto = tmp_path / "proto"
    proto.mkdir()
    rows = [
        ROW
        | {
            "proved_by": ["tests/unit/test_a.c:runs"],
            "source": ["sources 4.4", "docs/a.md#Heading"],
            "table": "proto/t.yaml#key",
        },
        ROW | {"id": "PSA2-FRAME-04", "source": "docs/a.md", "limits": {"code": 0x400000}},
        ROW | {"id": "PSA2-FRAME-05", "source": "docs/a.md", "observe": {}, "unobservable": "inside"},
    ]
    write(proto, rows)
    for name in ("requirements/psd1.yaml", "profiles/psd1.yaml"):
        (proto / name).unlink()
    (proto / "t.yaml").write_text("key: 1\n")
    files = {
        "docs/a.md": "# A\n\n## Heading\n",
        "docs/sources.md": "| 4.4 | topic |\n",
        "tests/unit/test_a.c": (
            "static void runs(void **state)\n{\n}\nint main(void)\n{\n    const struct CMUnitTest tests[] = {\n"
            "        cmocka_unit_test(runs),\n    };\n    return cmocka_run_group_tests(tests, NULL, NULL);\n}\n"
        ),
        "tests/py/test_b.py": '"""The node is a stand-in."""\ndef test_b(): ...\n',
        "tests/py/project/test_c.py": '"""Files."""\ndef test_c(): ...\n',
        "docs/reference/a.md": "",
        "scripts/psabench/conform/device.py": '@proves("PSA2-FRAME-04")\ndef frame_is_whole(): ...\n',
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    assert gen(tmp_path) == 0
    return tmp_path


def gen(root: Path, *options: str) -> int:
    gen_requirements.text_of.cache_clear()
    gen_requirements.names_in.cache_clear()
    gen_requirements.headings.cache_clear()
    gen_requirements.parts.cache_clear()
    return gen_requirements.main([*options, "--root", str(root)])


def test_a_page_that_was_just_made_passes(checkout: Path) -> None:
    assert gen(checkout, "--check") == 0
    assert gen(checkout, "--complete") == 0


def test_the_page_has_each_row_with_its_tests(checkout: Path) -> None:
    text = (checkout / "docs/reference/requirements.md").read_text()
    lines = {line.split(" | ")[0]: line for line in text.splitlines() if line.startswith("| PSA2-")}
    assert list(lines) == ["| PSA2-FRAME-03", "| PSA2-FRAME-04", "| PSA2-FRAME-05"]
    assert "| a: runs |" in lines["| PSA2-FRAME-03"]
    assert "Table: proto/t.yaml#key" in lines["| PSA2-FRAME-03"]
    assert "| **frame_is_whole** |" in lines["| PSA2-FRAME-04"]
    assert "`code` 400000h" in lines["| PSA2-FRAME-04"]
    assert "**not observable**: inside | none yet |" in lines["| PSA2-FRAME-05"]
    assert "| **all** | 3 | 3 | 1 | 1 | 1 | 0 |" in text


def replace(name: str, was: str, now: str) -> Callable[[Path], None]:
    def change(root: Path) -> None:
        path = root / name
        assert was in path.read_text()
        path.write_text(path.read_text().replace(was, now))

    return change


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (replace("docs/reference/requirements.md", "74 us", "75 us"), "docs/reference/requirements.md is out of date"),
        (
            replace("tests/unit/test_a.c", "cmocka_unit_test(runs)", "/* runs */"),
            "test_a.c:runs is no test that is run",
        ),
        (
            replace("proto/requirements/psa2.yaml", "tests/unit/test_a.c:runs", "tests/py/test_b.py:test_b"),
            "FRAME-03: tests/py/test_b.py:test_b: expected a test of the board, got one of a stand-in",
        ),
        (
            replace("proto/requirements/psa2.yaml", "tests/unit/test_a.c:runs", "tests/py/project/test_c.py:test_c"),
            "FRAME-03: expected a test that runs the board, got tests/py/project/test_c.py:test_c, which reads files",
        ),
        (
            replace("scripts/psabench/conform/device.py", "FRAME-04", "FRAME-99"),
            "conform/device:frame_is_whole: @proves names no",
        ),
        (
            replace("scripts/psabench/conform/device.py", '"PSA2-FRAME-04"', "ID"),
            "device.py: line 1: @proves of frame_is",
        ),
        (replace("docs/a.md", "## Heading", "## Other"), "PSA2-FRAME-03: there is no docs/a.md#Heading"),
        (replace("docs/sources.md", "4.4", "4.5"), "PSA2-FRAME-03: there is no sources 4.4"),
        (replace("proto/t.yaml", "key", "lock"), "PSA2-FRAME-03: there is no proto/t.yaml#key"),
        (replace("proto/t.yaml", "key: 1", "- section: lock"), "PSA2-FRAME-03: there is no proto/t.yaml#key"),
        (lambda root: (root / "proto/t.yaml").unlink(), "PSA2-FRAME-03: there is no proto/t.yaml#key"),
        (lambda root: (root / "docs/reference/requirements.md").unlink(), "reference/requirements.md is out of date"),
        (replace("proto/requirements/psa2.yaml", "E0", "E9"), "psa2.yaml: PSA2-FRAME-03: grade"),
    ],
)
def test_what_is_stale_or_missing_is_told(
    change: Callable[[Path], None], says: str, checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change(checkout)
    assert gen(checkout, "--check") == 1
    assert says in capsys.readouterr().err


def test_a_table_may_be_a_section_of_a_list(checkout: Path) -> None:
    replace("proto/t.yaml", "key: 1", "- section: key")(checkout)
    assert gen(checkout, "--check") == 0


def test_a_page_is_not_written_over_what_is_missing(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = (checkout / "docs/reference/requirements.md").read_text()
    replace("docs/a.md", "## Heading", "## Other")(checkout)
    replace("proto/requirements/psa2.yaml", "74 us", "75 us")(checkout)
    assert gen(checkout) == 1
    assert (checkout / "docs/reference/requirements.md").read_text() == kept
    assert "there is no docs/a.md#Heading" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--check", "--complete"])
def test_a_check_leaves_a_stale_page_alone(option: str, checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = (checkout / "docs/reference/requirements.md").read_text()
    replace("proto/requirements/psa2.yaml", "74 us", "75 us")(checkout)
    assert gen(checkout, option) == 1
    assert (checkout / "docs/reference/requirements.md").read_text() == kept
    assert "out of date" in capsys.readouterr().err


def test_complete_wants_a_test_for_all_that_can_be_observed(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    replace("scripts/psabench/conform/device.py", '@proves("PSA2-FRAME-04")\n', "")(checkout)
    assert gen(checkout) == 0
    assert gen(checkout, "--check") == 0
    assert gen(checkout, "--complete") == 1
    assert capsys.readouterr().err == "gen_requirements: PSA2-FRAME-04: no test proves it\n"


def test_the_files_are_where_an_installation_looks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shutil.copytree(ROOT / "proto", tmp_path / "elsewhere")
    monkeypatch.setenv("PSABENCH_PROTO", str(tmp_path / "elsewhere"))
    requirements.cache_clear()
    try:
        moved = requirements()
    finally:
        requirements.cache_clear()
    monkeypatch.delenv("PSABENCH_PROTO")
    assert isinstance(moved, Requirements)
    assert list(moved.rows) == list(requirements().rows)
