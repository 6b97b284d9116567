"""tools/check_phrases.py: phrases are found wherever texts are, across line ends too, and a limit is a limit."""

from __future__ import annotations

import subprocess
from pathlib import Path

import check_phrases
import pytest
from check_phrases import PHRASES, Phrase, check, check_errors, files, main, python_errors

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    for folder in ("docs", "emu", "scripts"):
        (tmp_path / folder).mkdir()
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
        "make false-positives ARGS=--anew\n",
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


@pytest.mark.parametrize(
    "line",
    [
        'raise BadInput(f"no such board: {name}")',
        'raise ValueError("must be positive")',
        'raise errors.BadInput("which?")',
        'raise Wrong(f"{word}: one word too many", word.column)',
        'raise BadInput(f"{path}: wrong: {count}")',
    ],
)
def test_another_form_is_found(line: str, checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    add(checkout, "scripts/a.py", f"def f():\n    {line}\n")
    assert [p.line for p in python_errors(checkout)] == [2]
    assert main(["--root", str(checkout)]) == 1
    assert "scripts/a.py:2: expected a text made by errors.expected()" in capsys.readouterr().err


@pytest.mark.parametrize(
    "line",
    [
        'raise BadInput(expected("a board", name, "--board"))',
        'raise BadInput(f"{expected(what, got)}; make builds it")',
        'raise BadInput(f"{path}: {e.strerror}") from e',
        'raise ValueError(f"face {face}: {err}") from None',
        'raise LinkError(f"{name}: no answer within {limit_s:g} s")',
        "raise BadInput(text)",
        "raise",
    ],
)
def test_the_form_states_and_texts_of_other_errors_pass(line: str, checkout: Path) -> None:
    add(checkout, "scripts/a.py", f"def f():\n    {line}\n")
    assert not list(python_errors(checkout))


def test_c_texts_are_counted(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    passed = 'why_fail(why, cap, "%s");\nwhy_fail(why, cap, "expected 1 to "\n    "127, got %u", n);\n\n'
    add(checkout, "emu/a.c", passed + 'return api_fail(b, 1, "bad node %u", n);\n')
    assert check_errors(checkout, c_limit=1) == 0
    assert check_errors(checkout, c_limit=0) == 1
    assert 'emu/a.c:5: expected a text with "expected", got "bad node %u"' in capsys.readouterr().err
    assert check_errors(checkout, c_limit=3) == 0
    assert "lower the limit of emu from 3 to 1" in capsys.readouterr().out


def test_a_declared_exception_goes_with_its_text(
    checkout: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(check_phrases, "DECLARED", {("scripts/a.py", "odd"): "a state"})
    source = checkout / "scripts" / "a.py"
    source.write_text('raise BadInput("odd")\n')
    assert check_errors(checkout, c_limit=0) == 0
    source.write_text('raise BadInput("other")\n')
    assert check_errors(checkout, c_limit=0) == 2
    assert "remove the declared exception 'odd'" in capsys.readouterr().err
