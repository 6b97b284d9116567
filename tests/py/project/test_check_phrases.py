"""tools/check_phrases.py: phrases are found wherever texts are, across line ends too, and a limit is a limit."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from check_phrases import PHRASES, Phrase, check, files, main

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    (tmp_path / "docs").mkdir()
    (tmp_path / "README.md").write_text("A board.\n")
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    return tmp_path


def add(root: Path, name: str, text: str) -> None:
    (root / name).write_text(text)
    subprocess.run(["git", "-C", str(root), "add", "-A"], check=True)


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("docs/a.md", "One.\n\nNobody reads it.\n", 3),
        ("a.c", "/* a time is\n * wanted here */\n", 1),
        ("a.c", 'fail("--pace %s: wall or step is wanted", arg);\n', 1),
        ("a.py", "# what is\n# told\n", 1),
        ("a.yaml", "note: done anew\n", 1),
        ("Makefile", "## likewise\n", 1),
        ("docs/b.md", "The name stands in the file.\n", 1),
    ],
)
def test_a_phrase_is_found_in_any_text(
    name: str, text: str, line: int, checkout: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    add(checkout, name, text)
    assert main(["--root", str(checkout)]) == 1
    assert f"  {name}:{line}: " in capsys.readouterr().err


@pytest.mark.parametrize(
    "text",
    [
        "Time stands still.\n",
        "assert stream_that_stands_is_seen()\n",
        "make alarms ALARMS=--anew\n",
        "an unwanted argument\n",
    ],
)
def test_names_and_ordinary_english_are_left_alone(text: str, checkout: Path) -> None:
    add(checkout, "docs/a.md", text)
    assert main(["--root", str(checkout)]) == 0


def test_a_limit_may_be_reached_and_not_passed(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    phrase = Phrase("likewise", r"\blikewise\b", "the same", limit=2)
    add(checkout, "a.md", "likewise\nlikewise\n")
    assert check(checkout, [phrase]) == 0
    add(checkout, "b.md", "Likewise.\n")
    assert check(checkout, [phrase]) == 1
    assert '"likewise": 3, limit 2; write instead: the same' in capsys.readouterr().err
    add(checkout, "a.md", "\n")
    add(checkout, "b.md", "likewise\n")
    assert check(checkout, [phrase]) == 0
    assert "lower the limit from 2 to 1" in capsys.readouterr().out


def test_the_list_of_phrases_is_no_place(checkout: Path) -> None:
    (checkout / "tools").mkdir()
    add(checkout, "docs/terms.md", "| likewise | the same |\n")
    add(checkout, "tools/check_phrases.py", '"likewise"\n')
    assert main(["--root", str(checkout)]) == 0


def test_list_names_every_place(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    add(checkout, "docs/a.md", "nobody\nanew\n")
    assert main(["--root", str(checkout), "--list", "anew"]) == 0
    assert capsys.readouterr().out == "docs/a.md:2: anew\n"


def test_no_phrase_has_a_limit() -> None:
    """The debt is paid: a phrase that comes back fails lint at once."""
    assert [p.name for p in PHRASES if p.limit] == []
    assert len({p.name for p in PHRASES}) == len(PHRASES)


def test_the_texts_of_the_project_are_looked_at() -> None:
    names = {str(p.relative_to(ROOT)) for p in files(ROOT)}
    assert {"README.md", "Makefile", "docs/design.md", "emu/app/options.c", "proto/psabench.yaml"} <= names
    assert "docs/terms.md" not in names
