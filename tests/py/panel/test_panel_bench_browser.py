"""The bench of a panel in a real browser: a long line stopped, another scenario, forks."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import panel_run as run
import pytest
from panel_page import needs_browser, opened, said, until
from playwright.sync_api import Browser, Page, expect

pytestmark = needs_browser


@pytest.fixture
def page(browser: Browser, tmp_path: Path) -> Iterator[Page]:
    with run.running("quiet", "--paused", "--out", tmp_path) as panel, opened(browser, panel) as p:
        yield p


@pytest.mark.parametrize("way", ["button", "key"])
def test_a_long_line_is_stopped_by_button_and_key(page: Page, way: str) -> None:
    expect(page.locator("#interrupt")).to_be_hidden()
    page.fill("#line input", "wait 80000")
    page.press("#line input", "Enter")
    expect(page.locator("#interrupt")).to_be_visible()
    begin = page.locator("#time").text_content()
    expect(page.locator("#time")).not_to_have_text(str(begin))
    if way == "key":
        page.press("#line input", "Escape")
    else:
        page.click("#interrupt")
    expect(page.locator("#log")).to_contain_text("wait 80000: stopped by a page")
    expect(page.locator("#interrupt")).to_be_hidden()
    said(page, "time")


def test_another_scenario_is_edited_and_a_wrong_line_selected(page: Page) -> None:
    page.click("#scenario summary")
    until(page, "document.querySelector('#scenario-text').value.includes('units:')")
    assert page.input_value("#scenario-name") == "quiet"
    page.select_option("#scenario-name", "multi")
    until(page, "document.querySelector('#scenario-text').value.includes('name: b')")
    right = page.input_value("#scenario-text")
    page.fill("#scenario-text", f"{right}\nfoo: 3\n")
    page.click("#begin")
    expect(page.locator("#scenario-error")).to_contain_text("foo: unknown key")
    assert page.evaluate("getSelection().toString()") == "foo: 3"
    page.fill("#scenario-text", "# " + "x" * 5000)
    page.click("#begin")
    expect(page.locator("#scenario-error")).to_contain_text("expected up to 4000 bytes")
    page.fill("#scenario-text", right)
    page.fill("#scenario-seed", "7")
    page.click("#begin")
    expect(page.locator("#units button")).to_have_count(2)
    expect(page.locator("#scenario-error")).to_have_text("")
    expect(page.locator("#log")).to_contain_text("(bench: scenario multi, seed 7)")


def test_a_fork_is_made_shown_and_ended(page: Page) -> None:
    said(page, "wait 0.5")
    page.click("#snapshot")
    page.fill("#fork-seed", "9")
    page.click("#fork")
    expect(page.locator("#shown")).to_have_text("fork 1 of 2")
    said(page, "wait 0.25")
    expect(page.locator("#time")).to_have_text("0.750 s")
    page.click("#show-bench")
    expect(page.locator("#time")).to_have_text("0.500 s")
    expect(page.locator("#shown")).to_have_text("first of 2")
    page.click("#drop-bench")
    expect(page.locator("#others")).to_be_hidden()
    said(page, "wait 0.5")
    expect(page.locator("#time")).to_have_text("1.000 s")
    page.click("#fork-from")
    expect(page.locator("#time")).to_have_text("0.500 s")
    expect(page.locator("#log")).to_contain_text("(bench: fork 1, of snapshot panel-0.500s.psasnap, seed 9)")
