"""Each report that a test of ours writes has a Russian text for each of its texts.

Registered by tests/py/conftest.py. Reports of other tests and of users say it themselves: --lang ru.
"""

from __future__ import annotations

import functools
import re

import pytest
from psabench.report.language import Language, load_language, localised_page

NO_REPORTS = {"A page", "p", "Conformance of it"}  # of tests of the frame around a report
TITLE = re.compile(r"<title>(.*?)</title>")
TEXT = re.compile(r">([^<>]+)<")
HEAD = re.compile(r"<style>.*?</style>|<title>.*?</title>|<(?:defs|metadata)>.*?</(?:defs|metadata)>", re.DOTALL)
QUOTED = re.compile(r"<(\w+)\b[^>]* lang=en>.*?</\1>", re.DOTALL)
FACTS = re.compile(r"<p class=facts>.*?</p>", re.DOTALL)  # values may be names of the user's
ENGLISH = re.compile(r"\b(?:the|of|and|is|are|no|not|in|with|from|at|by|to|all|each|it|its|error|run|time|unit)\b(?!-)")


@functools.cache
def catalogue() -> Language:
    found = load_language("ru")
    assert found is not None
    return found


def untranslated(page: str) -> list[str]:
    """Texts of a page that are English in Russian."""
    ru = catalogue()  # one for all pages: it remembers what it has looked up
    ru.missing.clear()
    shown = ru.translate_page(page).partition("<footer>")[0]
    texts = TEXT.findall(FACTS.sub("", QUOTED.sub("", HEAD.sub("", shown))))
    return sorted(ru.missing) + [text for text in texts if ENGLISH.search(text)]


@pytest.fixture(autouse=True)
def reports_have_russian_texts(monkeypatch: pytest.MonkeyPatch) -> None:
    """A test that writes a report with an English text fails."""

    def checked(page: str) -> str:
        title = TITLE.search(page)
        if title is None or title[1] not in NO_REPORTS:
            left = untranslated(page)
            assert not left, f"English in {title and title[1]}:\n" + "\n".join(left)
        return localised_page(page)

    monkeypatch.setattr("psabench.report.page.localised_page", checked)
