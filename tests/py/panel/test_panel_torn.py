"""Torn frames and torn reads, caused and seen in the panel by clicks alone, in a real browser."""

from __future__ import annotations

import re
from collections.abc import Iterator

import panel_run as run
import pytest
from panel_page import needs_browser, opened
from playwright.sync_api import Browser, Page, expect

pytestmark = needs_browser


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[run.Running]:
    with run.running("quiet", "--seed", "3", "--out", tmp_path_factory.mktemp("out")) as p:
        yield p


@pytest.fixture
def page(browser: Browser, panel: run.Running) -> Iterator[Page]:
    with opened(browser, panel) as p:
        yield p


def test_a_frame_torn_on_the_lines_is_drawn_and_counted_in_the_channels(page: Page, panel: run.Running) -> None:
    page.click("#start-stream")
    expect(page.locator("#health")).to_contain_text("torn 0")
    page.click("#frame")
    expect(page.locator("#frame-said")).to_contain_text("torn 0; drawn: a whole one")
    page.click("[data-tear='on the lines']")
    expect(page.locator("#faults tbody")).to_contain_text("active")
    page.click("#frame")
    expect(page.locator("#frame-said")).to_contain_text("drawn: a torn one, 127 bits")
    expect(page.locator("#health")).to_contain_text(re.compile(r"torn 0; on the lines \d+ frames drawn, torn [1-9]"))
    expect(page.locator("#frame-picture")).to_have_attribute("alt", re.compile("a torn one, 127 bits"))
    assert page.evaluate("document.querySelector('#frame-picture').naturalWidth") > 100
    with panel.socket() as socket:
        svg = run.asked(socket, 1, do="frame")["svg"]  # the page's policy forbids to look into its picture
    assert "127 bits, not 128" in svg
    assert "irregular" in svg
    page.click("#faults tbody button")
    page.click("#frame")
    expect(page.locator("#frame-said")).to_contain_text("drawn: a whole one")


def test_a_sample_torn_on_can_is_counted_in_the_channels(page: Page) -> None:
    page.click("#start-stream")
    page.click("[data-tear='on CAN']")
    expect(page.locator("#faults tbody")).to_contain_text("link.drop")
    expect(page.locator("#health")).to_contain_text(re.compile(r", torn [1-9]"))
