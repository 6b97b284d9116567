"""Instruments on the page in a real browser: drawn as they read, moved by their forms, in words for a screen reader."""

from __future__ import annotations

import re
from collections.abc import Iterator

import panel_run as run
import pytest
from panel_page import needs_browser, opened, until
from playwright.sync_api import Browser, Page, expect

pytestmark = needs_browser

BENCH = """
seed: 1
site: {g_mps2: 9.8094}
head: {turn_s: 1}
table: {axes: [{along: x}, {along: y}]}
chamber: {min_degc: -40, max_degc: 140, ramp_k_per_min: 10}
supply: {volt_v: 12, volt_max_v: 15, brownout_v: 9, hysteresis_v: 0.5}
units:
  - {name: a, axes: {x: {sensor: mems, u0_v: 2.5, kx_v_per_g: 1.0}}}
"""


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[run.Running]:
    folder = tmp_path_factory.mktemp("out")
    (folder / "bench.yaml").write_text(BENCH)
    with run.running(folder / "bench.yaml", "--out", folder) as p:
        yield p


@pytest.fixture
def page(browser: Browser, panel: run.Running) -> Iterator[Page]:
    with opened(browser, panel) as p:
        yield p


def order(page: Page, command: str, **values: str) -> None:
    """Fill in a form and send it."""
    for name, value in values.items():
        page.fill(f"[aria-label='{command} {name}']", value)
    page.click(f"form[data-command='{command}'] button")


def drawing(page: Page, name: str) -> str:
    return f".instrument:has(#read-{name}) svg"


def turned_deg(page: Page, part: str) -> float:
    """By how much a part of a drawing is turned."""
    found = re.search(r"rotate\((-?[\d.]+)", page.get_attribute(part, "transform") or "")
    return float(found[1]) if found else 0.0


def test_the_hand_of_the_head_stands_where_the_head_does(page: Page) -> None:
    head = drawing(page, "head")
    order(page, "head.turn", angle_deg="120")
    expect(page.locator(head)).to_have_attribute("aria-label", re.compile(r"at (119\.9|120).* deg, at rest"))
    assert turned_deg(page, f"{head} .hand") == pytest.approx(120, abs=0.1)


def test_the_plate_of_each_axis_turns_by_itself_and_between_readings(page: Page) -> None:
    first, second = drawing(page, "table"), drawing(page, "table2")
    expect(page.locator(second)).to_have_attribute("aria-label", re.compile("rate table, axis 2"))
    assert page.locator(drawing(page, "table3")).count() == 0
    order(page, "table.rate", axis="1", rate_dps="30")
    expect(page.locator(f"{first} .name").last).to_have_text("30 deg/s")
    until(page, "panel.counts.state > 0")
    page.evaluate("panel.counts.turned = new Set()")
    sets = f"document.querySelector(\"{first} .turning\").getAttribute('transform')"
    states = page.evaluate("panel.counts.state")
    until(page, f"panel.counts.turned.add({sets}) && panel.counts.state >= {states + 4}")
    assert page.evaluate("panel.counts.turned.size") > 6  # four readings alone would be four places
    assert turned_deg(page, f"{second} .turning") == 0.0
    order(page, "table.stop", axis="1")
    expect(page.locator(first)).to_have_attribute("aria-label", re.compile("at rest"))


def test_the_thermometer_has_set_point_and_ramp(page: Page) -> None:
    chamber = drawing(page, "chamber")
    column = f"document.querySelector(\"{chamber} .column\").getAttribute('y2')"
    before = float(page.evaluate(column))
    order(page, "chamber.set", temp_degc="80")
    expect(page.locator(chamber)).to_have_attribute("aria-label", re.compile("set point 80 degC, on its way, 10 K/min"))
    expect(page.locator(f"{chamber} .name").last).to_have_text("80 degC")
    assert page.get_attribute(f"{chamber} .way", "d")
    page.select_option("#speed", "100")
    expect(page.locator(chamber)).to_have_attribute("aria-label", re.compile("at 80 degC.*stable"))
    assert float(page.evaluate(column)) < before - 25
    assert page.get_attribute(f"{chamber} .way", "d") == ""
    order(page, "chamber.set", temp_degc="130")  # beyond the scale, which grows
    expect(page.locator(chamber)).to_have_attribute("aria-label", re.compile("set point 130 degC"))
    found = re.search(r"translate\(0 ([\d.]+)", page.get_attribute(f"{chamber} .mark", "transform") or "")
    assert found is not None
    assert 10 <= float(found[1]) < 20
    page.select_option("#speed", "1")


def test_a_dip_shorter_than_a_reading_is_seen_on_the_meter(page: Page) -> None:
    supply = drawing(page, "supply")
    page.click("form[data-command='supply.reset'] button")
    expect(page.locator(supply)).to_have_attribute("aria-label", "supply at 12 V, set to 12 V")
    page.select_option("[aria-label='faults.add kind']", "supply.brownout")
    page.fill("[aria-label='faults.add for_s']", "0.02")
    page.fill("[aria-label='faults.add drop_v']", "7")
    page.click("#add-fault button")
    expect(page.locator(f"{supply} .name").last).to_have_text("dip to 5 V")
    order(page, "supply.set", volt_v="14")
    expect(page.locator(supply)).to_have_attribute("aria-label", re.compile("set to 14 V"))
    hand, mark = turned_deg(page, f"{supply} .hand"), turned_deg(page, f"{supply} .mark")
    assert hand == pytest.approx(mark, abs=0.5)
    assert mark == pytest.approx(-70 + 140 * 14 / 15)


def test_drawings_grow_with_the_page_and_have_the_theme_s_colours(page: Page) -> None:
    page.set_viewport_size({"width": 640, "height": 450})  # 1280 px at 200 %
    assert page.evaluate("document.documentElement.scrollWidth") <= 640
    colours = []
    for name in ("light", "dark"):
        page.click("#theme")
        expect(page.locator("#theme")).to_have_text(f"Theme: {name}")
        fill = f'getComputedStyle(document.querySelector("{drawing(page, "head")} .hand")).fill'
        colours.append(page.evaluate(fill))
    assert colours[0] != colours[1]
