"""The panel in a real browser, Debian's Chromium: clicked through, other origins, rebinding, zoom, themes, keyboard."""

from __future__ import annotations

import http.server
import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import panel_run as run
import pytest
from page_picture import looks_as
from panel_page import LONG_MS, REBOUND, WAIT_MS, check_repaint, needs_browser, opened, said, until
from playwright.sync_api import Browser, Page, expect

UPDATES = "panel.counts.update"

pytestmark = needs_browser


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Iterator[run.Running]:
    with run.running("calibrate", "--seed", "3", "--out", tmp_path_factory.mktemp("out")) as p:
        yield p


@pytest.fixture
def page(browser: Browser, panel: run.Running) -> Iterator[Page]:
    """Our page, open; at its end nothing has gone to the console, and nothing was loaded from elsewhere."""
    with opened(browser, panel) as p:
        yield p


def test_a_fault_is_injected_and_seen_on_the_plot(page: Page) -> None:
    assert "token" not in page.url
    page.click("#start-stream")
    until(page, "panel.shown().points > 10")
    assert page.locator("#plots canvas").count() == 4
    before = page.evaluate("panel.shown().last[0]")
    page.select_option("[aria-label='faults.add kind']", "sensor.bias")
    page.fill("[aria-label='faults.add bias_v']", "-0.5")
    page.click("#add-fault button")
    expect(page.locator("#faults tbody")).to_contain_text("active")
    until(page, f"panel.shown().last[0] < {before - 0.4}")
    page.click("#faults tbody button")
    until(page, f"panel.shown().last[0] > {before - 0.1}")
    expect(page.locator("#can tbody")).to_contain_text("PSA2_XY")
    expect(page.locator("#bus-load")).to_contain_text("load")


def test_a_torn_frame_is_caused_and_seen(page: Page) -> None:
    page.click("#start-stream")
    page.select_option("[aria-label='faults.add kind']", "link.drop")
    page.fill("[aria-label='faults.add can_id']", str(0x285))  # the second half of every sample
    page.click("#add-fault button")
    expect(page.locator("#faults tbody")).to_contain_text("link.drop")
    expect(page.locator("#health")).to_contain_text(re.compile("torn [1-9]"))
    said(page, "faults.clear")


def test_registers_are_read_written_and_protected(page: Page) -> None:
    page.click("#read-registers")
    expect(page.locator("#registers tbody")).to_contain_text("CONFIG0")
    page.select_option("#write-register select[name=register]", "CONFIG0")
    page.select_option("[aria-label='field DR']", "2")
    page.click("#write-register button")
    expect(page.locator("#registers tbody")).to_contain_text("DR 2 1000 /s")
    page.select_option("#write-register select[name=register]", "ID")
    page.fill("#write-register input[name=value]", "05h")
    page.click("#write-register button")
    expect(page.locator("#message")).to_be_visible()


def test_instruments_time_and_the_frame(page: Page, panel: run.Running) -> None:
    page.fill("[aria-label='head.turn angle_deg']", "30")
    page.click("form[data-command='head.turn'] button")
    expect(page.locator("#read-head")).to_contain_text(
        re.compile(r"angle_deg (29\.99|30).*at_rest true"), timeout=WAIT_MS
    )
    page.click("#play")
    expect(page.locator("#play")).to_have_text("Run")
    t_s = page.inner_text("#time")
    page.click(".step[data-for='10ms']")
    expect(page.locator("#time")).not_to_have_text(t_s)
    assert float(page.inner_text("#time").split()[0]) - float(t_s.split()[0]) == pytest.approx(0.01)
    page.select_option("#event", "INT_FALL")
    page.click("#until")
    expect(page.locator("#log")).to_contain_text("until INT_FALL")
    page.click("#snapshot")
    expect(page.locator("#log")).to_contain_text("bench.snapshot panel-")
    t_s = page.inner_text("#time")
    page.click(".step[data-for='10ms']")
    expect(page.locator("#time")).not_to_have_text(t_s)
    page.click("#restore")
    expect(page.locator("#time")).to_have_text(t_s)
    expect(page.locator("#read-head")).to_contain_text("angle_deg 29.99")
    page.click("#frame")
    expect(page.locator("#frame-picture")).to_be_visible()
    assert page.evaluate("document.querySelector('#frame-picture').naturalWidth") > 100
    page.click("#show-lines summary")
    expect(page.locator("#lines")).to_contain_text("Int")
    page.click("#play")


def test_truth_is_behind_its_switch(page: Page) -> None:
    expect(page.locator("#truth-state")).to_be_hidden()
    assert page.evaluate("panel.counts.truth") is None
    page.check("#truth-switch")
    expect(page.locator("#truth-state")).to_contain_text("f_mps2")
    page.uncheck("#truth-switch")
    expect(page.locator("#truth-state")).to_be_hidden()


def test_keys_alone_run_the_bench(page: Page) -> None:
    page.locator("body").press(" ")
    expect(page.locator("#play")).to_have_text("Run")
    page.locator("body").press(".")
    expect(page.locator("#log")).to_contain_text("> wait 1ms")
    page.locator("body").press("/")
    page.keyboard.type("head.read\n")
    expect(page.locator("#log")).to_contain_text("angle_deg")
    reached = set()
    for _ in range(80):
        page.keyboard.press("Tab")
        reached.add(page.evaluate("document.activeElement.id || document.activeElement.className"))
    assert {"play", "until", "snapshot", "theme", "start-stream", "read-registers"} <= reached
    page.focus("#play")
    page.keyboard.press("Enter")
    expect(page.locator("#play")).to_have_text("Pause")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_both_themes_have_contrast_and_200_percent_fits(browser: Browser, panel: run.Running, scheme: str) -> None:
    with opened(browser, panel, color_scheme=scheme, viewport={"width": 640, "height": 450}) as page:
        # 1280 px at 200 % are 640 CSS px; WCAG 2.2, 1.4.10 and 1.4.3
        assert page.evaluate("document.documentElement.scrollWidth") <= 640
        for selector in ("h2", "#time", ".quiet", "#link", "button"):
            assert contrast(page, selector) >= 4.5, selector
        for name in ("light", "dark", "system"):
            page.click("#theme")
            expect(page.locator("#theme")).to_have_text(f"Theme: {name}")


def contrast(page: Page, selector: str) -> float:
    """Contrast of the text of the first such element to what is behind it (WCAG 2.2, relative luminance)."""
    script = """(selector) => {
      const parts = (c) => c.match(/[\\d.]+/g).map(Number);
      let e = document.querySelector(selector);
      const text = parts(getComputedStyle(e).color);
      while (parts(getComputedStyle(e).backgroundColor)[3] === 0) e = e.parentElement;
      return [text, parts(getComputedStyle(e).backgroundColor)];
    }"""
    one, two = (luminance(c) for c in page.evaluate(script, selector))
    return (max(one, two) + 0.05) / (min(one, two) + 0.05)


def luminance(colour: list[float]) -> float:
    linear = [c / 255 / 12.92 if c / 255 <= 0.04045 else ((c / 255 + 0.055) / 1.055) ** 2.4 for c in colour[:3]]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@contextmanager
def hostile_page() -> Iterator[str]:
    """A page of another origin on this machine."""

    class Empty(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<title>hostile</title>")

        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Empty) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_address[1]}/"
        server.shutdown()


OPENS = """(url) => new Promise((done) => {
  const socket = new WebSocket(url);
  socket.onopen = () => done("open");
  socket.onerror = () => done("refused");
})"""
FETCHES = """(url) => fetch(url, { mode: "no-cors", credentials: "include" }).then((r) => r.type, () => "refused")"""
POSTS = """(url) => fetch(url, { method: "POST", body: "x" }).then((r) => r.status, () => "refused")"""


def test_other_origins_and_rebound_names_get_nothing(browser: Browser, tmp_path: Path) -> None:
    with run.running("quiet", "--paused", "--out", tmp_path) as panel, hostile_page() as elsewhere:
        context = browser.new_context()
        page = context.new_page()
        page.goto(panel.address)  # the browser has the cookie now
        expect(page.locator("#link")).to_have_text("connected")
        assert page.evaluate(POSTS, "/") == 405
        hostile = context.new_page()
        hostile.goto(elsewhere)
        assert hostile.evaluate(OPENS, f"ws://127.0.0.1:{panel.port}/ws") == "refused"
        assert hostile.evaluate(OPENS, f"ws://{REBOUND}:{panel.port}/ws") == "refused"
        hostile.evaluate(FETCHES, f"http://127.0.0.1:{panel.port}/")
        rebound = context.new_page()
        for query in ("", f"?token={panel.token}"):  # even one who has the token
            answer = rebound.goto(f"http://{REBOUND}:{panel.port}/{query}")
            assert answer is not None
            assert answer.status == 421
        assert rebound.evaluate(OPENS, f"ws://{REBOUND}:{panel.port}/ws") == "refused"
        said(page, "time")
        expect(page.locator("#log")).to_contain_text("t_s   0")
        context.close()
        lines = panel.end().splitlines()
    assert len(lines) == len(set(lines)), lines
    assert any("expected Host" in line for line in lines)
    assert any("expected Origin" in line for line in lines)


def test_a_hidden_page_comes_back_to_the_present(browser: Browser, panel: run.Running) -> None:
    with opened(browser, panel) as page:
        page.evaluate("panel.link.sendWatch({ live: false })")
        until(page, f"new Promise((d) => {{ const n = {UPDATES}; setTimeout(() => d({UPDATES} === n), 300); }})")
        hellos = page.evaluate("panel.counts.hello")
        page.evaluate("panel.link.sendWatch({ live: true })")
        until(page, f"panel.counts.hello > {hellos}")
        updates = page.evaluate("panel.counts.update")
        until(page, f"panel.counts.update > {updates + 10}")


def test_statistics_of_a_channel_are_drawn(page: Page) -> None:
    page.click("#start-stream")
    until(page, "panel.shown().points > 30")
    page.select_option("#channel", "x")
    page.click("#compute")
    expect(page.locator("#moments")).to_contain_text("standard deviation")
    assert page.locator("#charts canvas").count() == 3
    check_repaint(page, "#charts canvas")


def test_a_calibration_is_followed_to_its_report(page: Page) -> None:
    page.select_option("#procedure", "turns")
    page.click("#run")
    expect(page.locator("#procedure-step")).to_contain_text(
        re.compile(r"running, test turns.* \d+/20"), timeout=WAIT_MS
    )
    expect(page.locator("#procedure-step")).to_contain_text("done", timeout=LONG_MS)
    with page.context.expect_page() as opening:
        page.click("#report")
    report = opening.value
    expect(report.locator("h1").first).to_be_visible()
    assert report.evaluate("self.origin") == "null"  # a sandbox
    report.close()


def test_the_page_looks_as_in_its_picture(browser: Browser, tmp_path: Path) -> None:
    """PSABENCH_PICTURES=1 draws docs/img/panel.png; 10 s of simulated time, so the curves are always the same."""
    options = "calibrate", "--seed", "3", "--paused", "--out", tmp_path
    view = {"width": 1280, "height": 1240}
    with run.running(*options) as panel, opened(browser, panel, viewport=view, color_scheme="light") as page:
        for line in (
            "dut.ready",
            "dut.start",
            "wait 8",
            "faults.add sensor.bias a.sensor.x bias_v=-0.005 for_s=1",
            "wait 2",
        ):
            said(page, line)
        page.select_option("#channel", "x")
        page.click("#compute")
        page.click("#read-registers")
        expect(page.locator("#faults tbody")).to_contain_text("over")
        expect(page.locator("#registers tbody")).to_contain_text("CONFIG0")
        expect(page.locator("#moments")).to_contain_text("mean")
        end_s = float(page.inner_text("#time").split()[0])
        until(page, f"panel.shown().t_s > {end_s - 0.1}")  # means of 1/30 s
        for kind in ("state", "can"):
            until(page, f"panel.counts.{kind} > {page.evaluate(f'panel.counts.{kind}')}")
        page.evaluate("scrollTo(0, 0); document.activeElement.blur()")
        page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        page.screenshot(path=tmp_path / "panel.png")
    looks_as(tmp_path / "panel.png", "panel.png")
