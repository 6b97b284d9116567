"""Reports on paper: Chromium prints to PDF; no picture is on two pages, no word runs out of its page."""

from __future__ import annotations

import dataclasses
import re
import shutil
import subprocess
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from psabench.conform import suite
from psabench.conform.profile import variant
from psabench.conform.report import Run, html_page
from psabench.conform.runner import wanted
from psabench.conform.selection import requirements_of
from psabench.conform.verdict import Verdict, not_decided
from psabench.report import calibration
from psabench.report.language import localised_page, reports_in
from psabench.report.nominal import ARTICLE
from report_sections import TRUTH, sections
from russian_pages import untranslated

TOOLS = {name: shutil.which(name) for name in ("chromium", "pdftotext")}
MISSING = [name for name, path in TOOLS.items() if path is None]
FIGURE = re.compile(r"<figure\b[^>]*>|</figure>")
MARK = re.compile(r"figure(\d+)(begins|ends)")
XHTML = "{http://www.w3.org/1999/xhtml}"
PRINT_S = 60.0

pytestmark = pytest.mark.skipif(
    bool(MISSING), reason=f"not there: {', '.join(MISSING)} (Debian: chromium, poppler-utils)"
)


@dataclass(frozen=True, slots=True)
class Word:
    """A word on paper."""

    text: str
    page: int
    is_inside: bool


def marked(page: str) -> str:
    """A word as the first and the last thing of each figure, as small as it is allowed to be."""
    count = iter(range(2 * len(FIGURE.findall(page))))

    def mark(found: re.Match[str]) -> str:
        k = next(count)
        word = f"<div style='font-size:1px;line-height:1px'>figure{k // 2}{'ends' if k % 2 else 'begins'}</div>"
        return word + found[0] if k % 2 else found[0] + word

    return FIGURE.sub(mark, page)


def words_on_paper(page: str, folder: Path) -> Iterator[Word]:
    source, pdf = folder / "report.html", folder / "report.pdf"
    source.write_text(page, encoding="utf-8")
    chromium = [TOOLS["chromium"], "--headless", "--no-sandbox", f"--user-data-dir={folder / 'profile'}"]
    options = ["--no-pdf-header-footer", f"--print-to-pdf={pdf}", source.as_uri()]
    subprocess.run([*map(str, chromium), *options], check=True, capture_output=True, timeout=PRINT_S)
    boxes = subprocess.run([str(TOOLS["pdftotext"]), "-bbox", pdf, "-"], check=True, capture_output=True).stdout
    for number, sheet in enumerate(ET.fromstring(boxes).iter(f"{XHTML}page")):
        width_pt, height_pt = float(sheet.attrib["width"]), float(sheet.attrib["height"])
        for word in sheet.iter(f"{XHTML}word"):
            low_x, low_y, high_x, high_y = (float(word.attrib[k]) for k in ("xMin", "yMin", "xMax", "yMax"))
            inside = low_x >= 0.0 and low_y >= 0.0 and high_x <= width_pt and high_y <= height_pt
            yield Word(word.text or "", number, inside)


@pytest.mark.parametrize("language", ["en", "ru"])
def test_no_picture_is_cut_and_no_word_runs_out_of_its_page(language: str, tmp_path: Path) -> None:
    with reports_in(language):
        page = localised_page(calibration.html_page(sections(TRUTH), {"seed": "7", "procedure": "reversal"}, ARTICLE))
    words = list(words_on_paper(marked(page.replace("<details", "<details open")), tmp_path))
    pages: dict[str, set[int]] = {}
    for word in words:
        for k, _ in MARK.findall(word.text):
            pages.setdefault(k, set()).add(word.page)
    ends = [kind for word in words for _, kind in MARK.findall(word.text)]
    assert len(pages) == page.count("</figure>") >= 4
    assert ends.count("begins") == ends.count("ends") == len(pages)
    assert {k: sorted(at) for k, at in pages.items() if len(at) > 1} == {}
    assert max(word.page for word in words) >= 3  # long enough that pictures come to the end of a page
    assert [word.text for word in words if not word.is_inside] == []
    assert any(("погрешность" if language == "ru" else "error") in word.text for word in words)


def conformance(folder: Path) -> str:
    """A page with each requirement of a PSA-2: the first test fails, the others saw the same."""
    suite.load()
    board = variant("psa2", "article")
    outcomes = [
        dataclasses.replace(
            not_decided(proof.test, [r.id for r in rows], ""),
            verdict=Verdict.PASSED,
            saw="low in 719 pauses and after 240 transfers",
        )
        for proof, rows in wanted(board)
    ]
    failed = dataclasses.replace(
        outcomes[0], verdict=Verdict.FAILED, saw="CLK high between words", due="low", at_ns=1.5e6
    )
    rows = requirements_of(board)
    run = Run(
        suite="device", subject=board.name, facts={"board": board.name}, outcomes=[failed, *outcomes[1:]], rows=rows
    )
    return html_page(run, folder)


@pytest.mark.parametrize("language", ["en", "ru"])
def test_no_word_of_a_conformance_report_runs_out_of_its_page(language: str, tmp_path: Path) -> None:
    english = conformance(tmp_path)
    assert untranslated(english) == []
    with reports_in(language):
        words = list(words_on_paper(localised_page(english), tmp_path))
    assert max(word.page for word in words) >= 10
    assert [word.text for word in words if not word.is_inside] == []
    assert any(("Требования" if language == "ru" else "Requirements") in word.text for word in words)
