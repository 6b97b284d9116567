"""tests/tiers.toml: a row for each test file, and which tests the rows choose."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import tiers
from tiers import Row, Table

HERE = Path("tests/py/test_a.py")


def test_every_test_file_has_a_row_and_every_row_a_file() -> None:
    assert tiers.unmatched(tiers.load(), tiers.files_of_tests()) == []


def test_a_file_without_a_row_and_a_row_without_a_file_are_named() -> None:
    table = Table(c={"test_a.c": Row()}, python={"test_a.py": Row(), "x/test_gone.py": Row()})
    files = [Path("tests/unit/base/test_a.c"), HERE, Path("tests/e2e/test_new.py"), Path("tests/py/test_gone.py")]
    assert tiers.unmatched(table, files) == [
        "tests/e2e/test_new.py: expected a row in tests/tiers.toml",
        "tests/py/test_gone.py: expected a row in tests/tiers.toml",
        "tests/tiers.toml: [python] x/test_gone.py: expected a file of this name",
    ]


def test_the_longest_name_that_fits_counts() -> None:
    table = Table(c={}, python={"test_*.py": Row("all"), "py/test_a.py": Row(sample=3)})
    assert table.row(HERE) == Row(sample=3)
    assert table.row(Path("tests/e2e/test_a.py")) == Row("all")


def chosen(row: Row, *names: str, group: str = "") -> list[str]:
    """Names of those tests, function[case], that make test runs."""
    tests = [(HERE, *name.rstrip("]").partition("[")[::2], group) for name in names]
    return [n for n, one in zip(names, tiers.in_test(Table({}, {"test_a.py": row}), tests), strict=True) if one]


CASES = [f"test_f[{n}]" for n in range(7)]


@pytest.mark.parametrize(
    ("row", "runs"),
    [
        (Row(), ["test_g", *CASES]),
        (Row("all"), []),
        (Row(sample=3), ["test_g", "test_f[0]", "test_f[3]", "test_f[6]"]),
        (Row(all=("test_f",)), ["test_g"]),
        (Row(sample=3, all=("test_f[0]",)), ["test_g", "test_f[1]", "test_f[4]"]),
        (Row(all=("test_f[[]?]", "test_g*")), CASES),  # a bracket is a bracket
        (Row(all=("test_f[?]",)), ["test_g"]),
    ],
)
def test_what_a_row_chooses(row: Row, runs: list[str]) -> None:
    assert chosen(row, "test_g", *CASES) == runs


def test_each_place_has_its_own_sample() -> None:
    table = Table({}, {"test_a.py": Row(sample=2)})
    tests = [(HERE, "test_f", case, place) for case in "ab" for place in ("host", "vcan")]
    assert tiers.in_test(table, tests) == [True, True, False, False]


def test_c_tests_of_a_tier(tmp_path: Path) -> None:
    for name in ("base/test_a", "test_b", "test_c"):
        (tmp_path / f"tests/unit/{name}.c").parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / f"tests/unit/{name}.c").touch()
    table = Table({"test_a.c": Row(), "test_b.c": Row(long=True), "test_c.c": Row("all")}, {})

    def names(tier: str) -> str:
        return " ".join(p.stem[-1] for p in tiers.c_tests(table, tier, tmp_path))

    assert [names(t) for t in tiers.CHOICES] == ["b a", "c", "b c a"]


@pytest.mark.parametrize("row", [Row(), Row("all"), Row(sample=2), Row(all=("test_g",)), None])
def test_a_file_is_left_out_where_none_of_its_tests_is_chosen(row: Row | None) -> None:
    names = ["test_g", *CASES]
    runs = chosen(row or Row(), *names)
    if row is None:  # test_every_test_file_has_a_row… says so
        assert not any(tiers.has_none(row, tier) for tier in tiers.CHOICES)
        return
    assert [tiers.has_none(row, tier) for tier in tiers.CHOICES] == [not runs, runs == names, False]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[c]\n", "x.toml: expected the tables c, python, got c"),
        ('[c]\n[python]\n"a.py" = "never"', "x.toml: a.py: tier: expected test or all, got 'never'"),
        ('[c]\n"a.c" = {sample = 2}\n[python]\n', "x.toml: a.c: expected a tier or a table of long, tier, got"),
        ('[c]\n[python]\n"a.py" = {sample = 0}', "x.toml: a.py: sample: expected a number of 1 or more, got 0"),
    ],
)
def test_a_wrong_row_is_an_error(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(text)
    with pytest.raises(ValueError, match="^" + says.replace("(", r"\(")):
        tiers.load(tmp_path / "x.toml")


def test_an_entry_that_fits_no_test_is_named() -> None:
    table = Table({}, {"test_a.py": Row(all=("test_f", "test_g[1]", "test_g[[]1[]]", "test_h"))})
    tests = [(HERE, "test_f", "", ""), (HERE, "test_g", "1", "")]
    assert tiers.unused(table, tests) == [
        f"tests/tiers.toml: test_a.py: expected a test named {name}" for name in ("test_g[[]1[]]", "test_h")
    ]


def test_a_run_of_whole_files_refuses_it(tmp_path: Path) -> None:
    """A file of a table's name with other tests, as after a test was renamed."""
    folder = tmp_path / "tests"
    folder.mkdir()
    (folder / "conftest.py").write_bytes((tiers.ROOT / "tests/conftest.py").read_bytes())
    (folder / "test_logic.py").write_text("def test_other(): pass\n", encoding="utf-8")
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-c",
        str(tiers.ROOT / "pyproject.toml"),
        "--rootdir",
        str(tmp_path),
    ]
    whole, one = (
        subprocess.run([*command, str(what)], cwd=tmp_path, capture_output=True, text=True, check=False)
        for what in (folder / "test_logic.py", f"{folder / 'test_logic.py'}::test_other")
    )
    assert whole.returncode == pytest.ExitCode.USAGE_ERROR
    assert "test_logic.py: expected a test named test_sigrok_decodes" in whole.stderr
    assert one.returncode == 0, one.stdout + one.stderr
