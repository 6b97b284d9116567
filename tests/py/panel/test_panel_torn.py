"""Torn frames and torn reads, caused and seen in the panel by clicks alone, in a real browser."""

from __future__ import annotations

import re
from collections.abc import Iterator

import panel_run as run
import pytest
from panel_page import needs_browser, opened
from playwright.sync_api import Browser, Page, expect
from psabench.errors import BenchError
from psabench.panel.converter import CONVERTERS, read_converter

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


@pytest.mark.parametrize("part", CONVERTERS)
def test_a_torn_read_of_a_bare_converter_is_caused_and_seen(page: Page, part: str) -> None:
    page.select_option("#read-converter select", part)
    page.click("#read-converter button:text-is('Read')")
    expect(page.locator("#converter-said")).to_contain_text(
        re.compile(r"^read (\w+)h, whole: in time \1h.*no violation")
    )
    page.click("#read-across")
    expect(page.locator("#converter-said")).to_contain_text(re.compile(r", torn: .*torn_reads 1"))
    expect(page.locator("#converter-picture")).to_have_attribute("alt", f"edges of {part}: a torn read")
    assert page.evaluate("document.querySelector('#converter-picture').naturalWidth") > 100
    found = re.match(r"read (\w+)h, torn: in time (\w+)h, next word (\w+)h", page.inner_text("#converter-said"))
    assert found is not None
    read, own, following = found.groups()
    assert own.startswith(read[:2])  # the first byte of its own word
    assert read not in (own, following)


def test_a_torn_read_s_picture_says_which_bits_are_whose() -> None:
    answer = read_converter({"part": "ads1282", "sclk_hz": 1e6, "across": True})
    assert "16 bits of the word" in answer["svg"]
    assert "16 bits of the next word" in answer["svg"]
    assert (answer["read"][:4], answer["read"][4:]) == (answer["in_time"][:4], answer["next"][4:])


@pytest.mark.parametrize(
    "request_",
    [
        {"part": "ad7190"},
        {"part": "ads1256", "sclk_hz": 1},
        {"part": "ads1256", "sclk_hz": True},
        {"part": "ads1281", "sclk_hz": 1e6, "late_us": -1},
    ],
)
def test_a_read_that_cannot_be_is_refused(request_: dict[str, object]) -> None:
    with pytest.raises(BenchError, match="expected"):
        read_converter(request_)
