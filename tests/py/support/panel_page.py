"""A page of a panel in a real browser, Debian's Chromium, driven by Playwright."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager

import panel_run as run
import pytest
from playwright.sync_api import Browser, Page, expect, sync_playwright

CHROMIUM = shutil.which("chromium")
WAIT_MS, LONG_MS = 60_000, 240_000  # a starved machine takes its time
REBOUND = "rebound.example"  # resolves to 127.0.0.1 for this browser: an attacker's name with a short-lived record

needs_browser = pytest.mark.skipif(not CHROMIUM, reason="no chromium: apt-get install chromium")
expect.set_options(timeout=WAIT_MS)


@contextmanager
def launched() -> Iterator[Browser]:
    with sync_playwright() as p:
        arguments = [f"--host-resolver-rules=MAP {REBOUND} 127.0.0.1"]
        chromium = p.chromium.launch(executable_path=str(CHROMIUM), args=arguments)
        yield chromium
        chromium.close()


@contextmanager
def opened(browser: Browser, panel: run.Running, **how: object) -> Iterator[Page]:
    """Its page; at its end nothing has gone to the console, and nothing was loaded from elsewhere."""
    page = browser.new_page(**{"viewport": {"width": 1280, "height": 900}, **how})  # type: ignore[arg-type]
    wrong: list[str] = []
    page.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    page.on("pageerror", lambda e: wrong.append(str(e)))
    page.on("request", lambda r: None if own(r.url, panel) else wrong.append(r.url))
    page.set_default_timeout(WAIT_MS)
    page.goto(panel.address)
    expect(page.locator("#link")).to_have_text("connected")
    until(page, "panel.counts.hello > 0")
    yield page
    page.close()
    assert wrong == []


def own(url: str, panel: run.Running) -> bool:
    return url.startswith((f"http://127.0.0.1:{panel.port}/", f"blob:http://127.0.0.1:{panel.port}/"))


def until(page: Page, expression: str, wait_ms: float = WAIT_MS) -> None:
    """Wait until it is true. Not wait_for_function, which evaluates in the page, where its own policy forbids that."""
    deadline_s = time.monotonic() + wait_ms / 1000
    while not page.evaluate(expression):
        assert time.monotonic() < deadline_s, expression
        page.wait_for_timeout(20)


def said(page: Page, line: str) -> None:
    page.fill("#line input", line)
    page.press("#line input", "Enter")
    expect(page.locator("#log")).to_contain_text(f"> {line}", timeout=LONG_MS)


def check_repaint(page: Page, canvases: str) -> None:
    """They have other colours after a change of the system's setting, and their own again by the page's button."""
    drawn = f"[...document.querySelectorAll('{canvases}')].map((c) => c.toDataURL())"
    assert page.evaluate(f"(self.light = {drawn}).length")
    page.emulate_media(color_scheme="dark")
    until(page, f"{drawn}.every((c, k) => c !== light[k])")
    page.click("#theme")
    expect(page.locator("#theme")).to_have_text("Theme: light")
    until(page, f"{drawn}.every((c, k) => c === light[k])")
