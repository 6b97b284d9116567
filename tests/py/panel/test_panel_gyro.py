"""The gyro unit on the page in a real browser: platform, heading and drift by what the unit says, the truth apart."""

from __future__ import annotations

import re
from collections.abc import Iterator

import panel_run as run
import pytest
from panel_page import check_repaint, needs_browser, opened, said, until
from playwright.sync_api import Browser, Page, expect

pytestmark = needs_browser

HEADING_DEG, ALPHA_DEG, DRIFT_DEGPH = 40.0, -33.0, 25.0  # of the scenario gyrocompass


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[run.Running]:
    with run.running("gyrocompass", "--out", tmp_path_factory.mktemp("out")) as p:
        yield p


@pytest.fixture
def page(browser: Browser, panel: run.Running) -> Iterator[Page]:
    with opened(browser, panel) as p:
        p.click("[data-unit='gyro']")
        expect(p.locator("#gyro")).to_be_visible()
        p.click("#start-stream")
        yield p


def figure(page: Page, selector: str, pattern: str) -> float:
    """The number in what it says."""
    expect(page.locator(selector)).to_contain_text(re.compile(pattern))
    found = re.search(pattern, page.inner_text(selector))
    assert found is not None
    return float(found[1])


def navigate(page: Page, azimuth_deg: float, drift2_degph: float) -> None:
    """Give the unit what a host found out, let it navigate, and ask it; then a minute goes by."""
    said(page, f"dut.set 2106h 1 {azimuth_deg}")
    said(page, f"dut.set 2107h 2 {drift2_degph}")
    page.click("#instruments summary:text('gyro')")
    page.select_option("[aria-label='gyro.mode unit']", "gyro")
    page.select_option("[aria-label='gyro.mode mode']", "navigate")
    page.click("form[data-command='gyro.mode'] button")
    expect(page.locator("#gyro-state")).to_contain_text("mode navigate")
    page.click("#instruments summary:text('gyro')")
    said(page, "wait 30")  # the platform comes to its level
    page.click("#gyro-ask")
    expect(page.locator("#gyro-heading")).to_contain_text("drift 2")
    said(page, "wait 60")


def test_heading_and_drift_are_those_that_the_unit_reports(page: Page) -> None:
    navigate(page, ALPHA_DEG, 0.0)
    asked_deg = figure(page, "#gyro-heading", r"azimuth angle -33 deg, heading ([\d.]+) deg")
    shown_deg = figure(page, "#gyro-heading", r"^heading ([\d.]+) deg")
    assert asked_deg == pytest.approx(HEADING_DEG, abs=0.5)
    assert shown_deg == pytest.approx(asked_deg - DRIFT_DEGPH / 60, abs=0.1)
    assert figure(page, "#gyro-heading", r"drift (-?[\d.]+) deg/h over [6-9]\d") == pytest.approx(-DRIFT_DEGPH, abs=4)
    heading = page.get_attribute("#gyro-pictures svg:nth-of-type(3)", "aria-label") or ""
    assert float(heading.split()[1]) == pytest.approx(shown_deg, abs=0.05)
    assert page.locator("#gyro-drift canvas").count() == 1
    page.click("#play")
    expect(page.locator("#play")).to_have_text("Run")  # the plot stays as it is
    check_repaint(page, "#gyro-drift canvas")
    page.click("#play")


def test_a_drift_that_the_unit_compensates_is_gone(page: Page) -> None:
    navigate(page, 0.0, DRIFT_DEGPH)
    assert abs(figure(page, "#gyro-heading", r"drift (-?[\d.e-]+) deg/h over [6-9]\d")) < 4


def test_the_platform_turns_and_the_truth_needs_its_switch(page: Page) -> None:
    plate = "document.querySelector('#gyro-pictures .turning').getAttribute('transform')"
    until(page, f"{plate} !== null")
    expect(page.locator("#gyro-pictures svg:nth-of-type(2)")).to_have_attribute(
        "aria-label", re.compile("^level: beta")
    )
    said(page, "dut.set 2101h 1 90")
    said(page, "dut.set 2100h 1 3")  # slew
    said(page, "wait 40")
    until(page, f"{plate}.startsWith('rotate(-90') || {plate}.startsWith('rotate(-89.9')")
    expect(page.locator("#gyro-truth")).to_be_hidden()
    page.check("#truth-switch")
    expect(page.locator("#gyro-truth")).to_contain_text("heading of the vehicle 40 deg, azimuth angle")
    page.uncheck("#truth-switch")
    expect(page.locator("#gyro-truth")).to_be_hidden()
