"""What a conformance report can say before a bench runs has a Russian text: each requirement, test, missing probe."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape

import psabench.conform.host.runner  # registers the cases
import pytest
from psabench.conform import suite
from psabench.conform.host.check import case_checks
from psabench.conform.proves import suite_tests
from psabench.conform.recording import NO_PART, UNRECORDED
from psabench.conform.requirements import requirements
from psabench.conform.runner import MISSING
from psabench.conform.verdict import Failed, Verdict, decide, not_decided
from psabench.report.language import Language
from russian_pages import catalogue, untranslated


def titles() -> Iterator[str]:
    suite.load()
    assert psabench.conform.host.runner.ALL
    for test in (*(t.test for t in suite_tests()), *(c.test for c in case_checks())):
        yield not_decided(test, (), "").title


TEXTS = {
    "requirements": [r.text for r in requirements()],
    "reasons why no wire shows one": [r.unobservable for r in requirements() if r.unobservable],
    "tests": list(titles()),
    "missing probes": [*MISSING.values(), *UNRECORDED.values(), *NO_PART.values()],
    "verdicts": [v.value for v in Verdict],
}


@pytest.mark.parametrize("of", TEXTS)
def test_each_text_has_its_entry(of: str) -> None:
    assert TEXTS[of]
    assert untranslated("".join(f"<td>{escape(text)}</td>" for text in TEXTS[of])) == []


def broken() -> str:
    raise Failed("CLK high between words", "low")


def test_a_failure_of_which_an_entry_is_missing_is_found() -> None:
    """The words of a failure are looked up by their parts, so that an entry can be taken away."""
    o = decide(not_decided(broken, ("PSA2-FRAME-12",), ""), broken, lambda _: ())
    page = f"<td>{o.saw}</td><td>{o.due}</td>"
    assert untranslated(page) == []
    less = {k: v for k, v in catalogue().texts.items() if k != "{} high between words"}
    ru = Language(name="ru", texts=less)
    ru.translate_page(page)
    assert ru.missing == {"CLK high between words"}
