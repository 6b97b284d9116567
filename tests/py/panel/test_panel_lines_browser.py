"""Recorded lines in a real browser: moved, zoomed, gone through frame by frame; a recording that is being opened."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import panel_run as run
import pytest
from page_picture import looks_as
from panel_page import needs_browser, opened, said, until
from playwright.sync_api import Browser, Page, expect
from recorded_lines import record_psa2

pytestmark = needs_browser
SPAN = "(panel.lines().to - panel.lines().from)"


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[run.Running]:
    folder = tmp_path_factory.mktemp("lines")
    record_psa2(folder / "a.vcd")
    (folder / "b.vcd").write_text("nothing of the kind\n")
    with run.running("--recording", folder, "--out", tmp_path_factory.mktemp("out")) as p:
        yield p


@pytest.fixture
def page(browser: Browser, panel: run.Running) -> Iterator[Page]:
    with opened(browser, panel) as p:
        until(p, "panel.lines().seen > 0")
        yield p


def test_frames_are_gone_through_with_their_words(page: Page) -> None:
    expect(page.locator("#recording-about")).to_contain_text("PSA-2: 16 lines")
    expect(page.locator("#play")).to_have_text("Run")  # else the window would be at the end of it
    expect(page.locator("#lines-said")).to_have_text("100 frames, errors 30, torn 30")
    expect(page.locator("#lines-at")).to_contain_text("frame 1 of 100")
    picture = page.locator("#lines-picture")
    expect(picture).to_contain_text(re.compile(r"X = \d+.*T = "))
    expect(picture).to_contain_text(re.compile(r"\+\d+ us"))
    expect(page.locator("[data-line=CLK]")).to_have_attribute("data-edges", "256")
    page.click("#frame-on")
    expect(page.locator("#lines-at")).to_contain_text("frame 2 of 100")
    page.click("#torn-on")
    expect(page.locator("#lines-at")).to_contain_text("torn: 127 bits, not 128")
    expect(picture).to_contain_text("torn: 127 bits, not 128")
    expect(page.locator("[data-line=CLK]")).to_have_attribute("data-edges", "254")
    torn = page.inner_text("#lines-at")
    page.click("#error-on")
    expect(page.locator("#lines-at")).not_to_have_text(torn)
    picture.press("p")
    expect(page.locator("#lines-at")).to_have_text(torn)


def test_a_code_has_all_its_digits_and_a_later_page_its_channels(page: Page) -> None:
    said(page, "at 0")
    said(page, "wait 1")
    expect(page.locator("#recording-ended")).to_have_text("end")
    page.reload()
    until(page, "panel.shown().points > 0")
    expect(page.locator("#channel option")).to_have_text(["x", "y", "z", "t"])
    code = round(page.evaluate("panel.shown().last[0]"))
    expect(page.locator("#plots")).to_contain_text(f"x  {code} LSB")
    assert page.evaluate("import('/static/page.js').then((m) => m.digits(534436974))") == "534436974"


def test_at_the_end_it_pauses(page: Page) -> None:
    said(page, "at 0")
    expect(page.locator("#recording-ended")).to_have_text("")
    page.click("#play")
    expect(page.locator("#recording-ended")).to_have_text("end")
    expect(page.locator("#play")).to_have_text("Run")
    example, length = page.get_attribute("#line input", "placeholder"), page.inner_text("#recording-about")
    length_s, end_s = float(length.split()[0]), float(page.inner_text("#time").split()[0])
    assert example is not None
    assert end_s - length_s < float(example.removeprefix("at ")) < end_s


def test_the_window_is_moved_and_zoomed(page: Page) -> None:
    page.click("#lines-all")
    until(page, "panel.lines().seen === 100")
    expect(page.locator("#lines-picture")).to_contain_text("100: zoom in to read them")
    assert "V" in (page.get_attribute("[data-line=CLK]", "d") or "")
    assert page.get_attribute("[data-line=CLK]", "class") == "wave dense"
    span = page.evaluate(SPAN)
    page.click("#lines-in")
    until(page, f"{SPAN} === {span / 2:.0f}")
    begin = page.evaluate("panel.lines().from")
    page.locator("#lines-picture").press("ArrowRight")
    until(page, f"panel.lines().from > {begin}")
    page.hover("#lines-picture")
    page.mouse.wheel(0, -100)
    until(page, f"{SPAN} < {span / 2 - 1}")
    before = page.evaluate("panel.lines().from")
    box = page.locator("#lines-picture").bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + 300, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 500, box["y"] + 60)
    page.mouse.up()
    until(page, f"panel.lines().from < {before}")
    page.click("summary:text-is('Lines that are drawn')")
    page.check("#lines-names input[value=DRD_A]")
    expect(page.locator("[data-line=DRD_A]")).to_be_attached()


def test_values_are_plotted_as_time_goes_and_a_bad_file_is_a_line(page: Page) -> None:
    said(page, "at 0.3")
    until(page, "panel.shown().points >= 2")
    assert page.locator("#plots canvas").count() == 4
    expect(page.locator("#health")).to_contain_text("PSA-2: 60 samples, lost 0, torn 30")
    page.click("#lines-now")
    expect(page.locator("#lines-picture .now")).to_be_attached()
    expect(page.locator("#can")).to_be_hidden()
    page.select_option("#recording-file", "b.vcd")
    expect(page.locator("#message")).to_contain_text("b.vcd: expected a VCD file")
    expect(page.locator("#recording-file")).to_have_value("a.vcd")
    expect(page.locator("#link")).to_have_text("connected")


def test_a_torn_frame_looks_as_in_its_picture(browser: Browser, panel: run.Running, tmp_path: Path) -> None:
    """PSABENCH_PICTURES=1 draws docs/img/panel_lines.png."""
    with opened(browser, panel, viewport={"width": 1280, "height": 900}, color_scheme="light") as page:
        until(page, "panel.lines().seen > 0")
        page.click("#torn-on")
        expect(page.locator("#lines-picture")).to_contain_text("torn: 127 bits, not 128")
        page.evaluate("document.activeElement.blur()")
        page.mouse.move(0, 0)
        page.locator("#recorded-lines").screenshot(path=tmp_path / "lines.png")
    looks_as(tmp_path / "lines.png", "panel_lines.png")


# What the page says of its link, each text once.
NOTES_LINK = """() => {
  const box = document.querySelector("#link");
  window.texts = new Set();
  new MutationObserver(() => texts.add(box.textContent)).observe(box, { childList: true, subtree: true });
}"""


def test_a_recording_says_how_much_of_it_is_read(browser: Browser, tmp_path: Path) -> None:
    line = "(%.6f) can0 185#0102030405060708\n"
    folder = tmp_path / "logs"
    folder.mkdir()
    for name, count in (("a.log", 10), ("big.log", 250_000)):
        (folder / name).write_text("".join(line % (k * 1e-4) for k in range(count)))
    with run.running("--recording", folder, "--paused", "--out", tmp_path / "out") as panel:
        page = browser.new_page()
        page.goto(panel.address)
        expect(page.locator("#link")).to_have_text("connected")
        page.evaluate(NOTES_LINK)
        page.select_option("#recording-file", "big.log")
        expect(page.locator("#recording-about")).to_contain_text("more than")
        texts = page.evaluate("[...texts]")
        assert any(re.fullmatch(r"opening big.log: \d+ %", text) for text in texts), texts
        page.close()
