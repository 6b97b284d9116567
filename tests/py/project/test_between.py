"""tools/between.py: the text between a page's marks, and nothing else, is written."""

from __future__ import annotations

from pathlib import Path

import between
import pytest

A = between.marks("a")
PAGE = "before\n<!-- a:begin -->\nold\n<!-- a:end -->\nafter\n<!-- b:begin -->\nother\n<!-- b:end -->\n"


def test_what_stands_between_the_marks_is_written_and_nothing_else(tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(PAGE)
    between.write(page, A, "new\nlines")
    assert page.read_text() == PAGE.replace("old", "new\nlines")


@pytest.mark.parametrize(
    "text",
    [
        "no marks\n",
        "<!-- a:begin -->\nold\n",
        "<!-- a:end -->\nold\n<!-- a:begin -->\n",
        "<!-- a:begin --> old <!-- a:end -->\n",
        PAGE.replace("old", "<!-- a:begin -->"),
        PAGE + PAGE,
    ],
)
def test_marks_that_are_not_there_once_are_told(text: str, tmp_path: Path) -> None:
    page = tmp_path / "page.md"
    page.write_text(text)
    with pytest.raises(
        ValueError,
        match=r"^page\.md: expected one line <!-- a:begin --> and after it <!-- a:end -->, got none or several$",
    ):
        between.write(page, A, "new")
    assert page.read_text() == text
