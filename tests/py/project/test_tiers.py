"""tests/tiers.toml: a row for each test file, and which tests the rows choose."""

from __future__ import annotations

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
    table = Table({"test_a.c": Row(), "test_b.c": Row(sanitizers="all"), "test_c.c": Row("all")}, {})

    def names(tier: str, sanitizers: bool) -> str:
        return " ".join(p.stem[-1] for p in tiers.c_tests(table, tier, sanitizers, tmp_path))

    assert [names(t, False) for t in tiers.CHOICES] == ["a b", "c", "a b c"]
    assert [names(t, True) for t in tiers.CHOICES] == ["a", "b c", "a b c"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("[c]\n", "x.toml: expected the tables c, python, got c"),
        ('[c]\n[python]\n"a.py" = "never"', "x.toml: a.py: tier: expected test or all, got 'never'"),
        ('[c]\n"a.c" = {sample = 2}\n[python]\n', "x.toml: a.c: expected a tier or a table of sanitizers, tier, got"),
        ('[c]\n[python]\n"a.py" = {sample = 0}', "x.toml: a.py: sample: expected a number of 1 or more, got 0"),
    ],
)
def test_a_wrong_row_is_an_error(text: str, says: str, tmp_path: Path) -> None:
    (tmp_path / "x.toml").write_text(text)
    with pytest.raises(ValueError, match="^" + says.replace("(", r"\(")):
        tiers.load(tmp_path / "x.toml")
