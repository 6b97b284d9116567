"""Four pages for ten minutes in Debian's Chromium: nothing grows, nothing stands still, no sample is missing.

PSABENCH_PANEL_SOAK_S and PSABENCH_PANEL_SOAK_PAGES make it longer and wider: an hour with eight pages is run by hand.
As the tabs of a window, the pages take turns: one is in front and the others are hidden; all are in front at the
beginning and at the end. One is frozen; the whole browser is stopped for longer than the panel waits for an answer to
its ping; the emulator is killed; a page is loaded again. What all that costs is printed.
"""

from __future__ import annotations

import os
import shutil
import signal
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import panel_run as run
import pytest
from playwright.sync_api import Browser, CDPSession, Page, expect, sync_playwright

CHROMIUM = shutil.which("chromium")
SOAK_S = float(os.environ.get("PSABENCH_PANEL_SOAK_S", "600"))
PAGES = int(os.environ.get("PSABENCH_PANEL_SOAK_PAGES", "4"))
TURN_S = 10.0  # that a page is in front
ALL_S = 5.0  # with all pages in front, at the beginning and at the end
BUCKET_S = 1 / 30  # of the plots, docs/tools/panel.md
STOPPED_S = 50.0  # uvicorn pings each 20 s and waits 20 s
LOOKS, LOOK_S = 3, 0.5  # at what a page holds
TAIL = 0.4  # of the time at the end, in which nothing may grow
GREW = {"panel_kb": 4_000.0, "heap_kb": 1_500.0, "nodes": 300.0}
WAIT_MS = 60_000
NOTHING_LOST = ["lost 0, torn 0"] * PAGES

pytestmark = [
    pytest.mark.skipif(not CHROMIUM, reason="no chromium: apt-get install chromium"),
    pytest.mark.soak,
    pytest.mark.timeout(300 + 2 * SOAK_S),
]
expect.set_options(timeout=WAIT_MS)

# Playwright keeps every page visible. A hidden one gets no frames to draw, and knows it.
HIDING = """
  let hidden = false;
  const parked = [], draw = window.requestAnimationFrame.bind(window);
  Object.defineProperty(document, "hidden", { get: () => hidden });
  window.requestAnimationFrame = (f) => hidden ? parked.push(f) : draw(f);
  window.hide = (on) => {
    hidden = on;
    document.dispatchEvent(new Event("visibilitychange"));
    if (!on) parked.splice(0).forEach((f) => draw(f));
  };
"""
# The instants of the points that a page gets, since the panel sent the whole state; when the page asks for the state,
# they are compared with those of the panel.
WATCHING = """() => {
  const take = panel.link.onMessage;
  let own = [];
  window.watched = { points: 0, missing: 0, compared: 0 };
  panel.link.onMessage = (m) => {
    const sent = m.new?.t || [];
    own.push(...sent);
    watched.points += sent.length;
    if (m.kind === "hello") {
      const got = new Set(own);
      const due = m.id && own.length ? m.history.t.filter((t) => t >= own[0]) : [];
      watched.compared += due.length;
      watched.missing += due.filter((t) => !got.has(t)).length;
      own = [];
    }
    take(m);
  };
}"""


@dataclass(slots=True)
class Tab:
    """A page and its debugger."""

    page: Page
    cdp: CDPSession

    def load(self, address: str) -> None:
        self.page.goto(address)
        self.watch()

    def watch(self) -> None:
        until(self.page, "window.panel && panel.counts.hello > 0")
        self.page.evaluate(WATCHING)

    def hide(self, on: bool) -> None:
        self.page.evaluate("(on) => hide(on)", on)

    def compare(self) -> None:
        self.page.evaluate("panel.link.ask({ do: 'hello' }).then(() => 0)")

    def sizes(self) -> dict[str, float]:
        """After what nothing uses is gone; the least of some looks, for a busy browser clears up later."""
        looks = [self._look() for _ in range(LOOKS)]
        return {key: min(look[key] for look in looks) for key in looks[0]}

    def _look(self) -> dict[str, float]:
        self.page.wait_for_timeout(1000 * LOOK_S)
        self.cdp.send("HeapProfiler.collectGarbage")
        used = self.cdp.send("Runtime.getHeapUsage")["usedSize"]
        return {"heap_kb": used / 1024, "nodes": float(self.cdp.send("Memory.getDOMCounters")["nodes"])}


def until(page: Page, expression: str) -> None:
    deadline_s = time.monotonic() + WAIT_MS / 1000
    while not page.evaluate(expression):
        assert time.monotonic() < deadline_s, expression
        page.wait_for_timeout(100)


def opened(browser: Browser, panel: run.Running, wrong: list[str]) -> list[Tab]:
    context = browser.new_context(viewport={"width": 800, "height": 600})
    context.add_init_script(HIDING)
    context.on("console", lambda m: wrong.append(m.text) if m.type in ("error", "warning") else None)
    context.on("weberror", lambda e: wrong.append(str(e.error)))
    tabs = []
    for _ in range(PAGES):
        page = context.new_page()
        page.set_default_timeout(WAIT_MS)
        tabs.append(Tab(page, context.new_cdp_session(page)))
        tabs[-1].load(panel.address)
    return tabs


def take_turns(tabs: list[Tab], end_s: float) -> None:
    """One tab in front, each for a while."""
    k = 0
    while time.monotonic() < end_s:
        front = tabs[k % len(tabs)]
        for tab in tabs:
            tab.hide(tab is not front)
        front.page.wait_for_timeout(1000 * min(TURN_S, max(0.0, end_s - time.monotonic())))
        front.compare()
        k += 1


def all_in_front(tabs: list[Tab]) -> None:
    for tab in tabs:
        tab.hide(False)
    tabs[0].page.wait_for_timeout(1000 * ALL_S)


def freeze_a_tab(tabs: list[Tab]) -> None:
    """As a browser does with tabs that were long in the background: no script runs in it."""
    frozen, awake = tabs[0], tabs[1:]
    frozen.hide(False)
    frozen.cdp.send("Page.setWebLifecycleState", {"state": "frozen"})
    take_turns(awake, time.monotonic() + SOAK_S / 10)
    frozen.cdp.send("Page.setWebLifecycleState", {"state": "active"})
    all_in_front(tabs)
    until(frozen.page, f"panel.shown().t_s > {awake[0].page.evaluate('panel.shown().t_s')}")


def stop_the_browser(tabs: list[Tab]) -> None:
    """As a machine that sleeps: nothing answers, the panel closes the connections, the pages open new ones."""
    all_in_front(tabs)
    hellos = [tab.page.evaluate("panel.counts.hello") for tab in tabs]
    stopped = [pid for pid, name in descendants(os.getpid()) if name.startswith("chrom")]
    assert stopped
    for pid in stopped:
        os.kill(pid, signal.SIGSTOP)
    time.sleep(STOPPED_S)
    for pid in stopped:
        os.kill(pid, signal.SIGCONT)
    for tab, n in zip(tabs, hellos, strict=True):
        until(tab.page, f"panel.counts.hello > {n}")


def kill_the_emulator(panel: run.Running, tabs: list[Tab]) -> None:
    hellos = [tab.page.evaluate("panel.counts.hello") for tab in tabs]
    (emulator,) = [pid for pid, name in descendants(panel.process.pid) if name == "psa-emu"]
    os.kill(emulator, signal.SIGKILL)
    for tab, n in zip(tabs, hellos, strict=True):
        until(tab.page, f"panel.counts.hello > {n}")
    start_stream(tabs[0])


def start_stream(tab: Tab) -> None:
    for line in ("dut.ready", "dut.start"):
        assert tab.page.evaluate("(line) => panel.link.say(line).then((a) => a.failed || false)", line) is False


def load_again(tabs: list[Tab]) -> None:
    tabs[-1].hide(False)
    tabs[-1].page.reload()
    tabs[-1].watch()


def descendants(pid: int) -> list[tuple[int, str]]:
    """Processes that this one has started, and those that they have."""
    found = []
    for path in Path(f"/proc/{pid}/task").glob("*/children"):
        for child in map(int, path.read_text().split()):
            found += [(child, Path(f"/proc/{child}/comm").read_text().strip()), *descendants(child)]
    return found


def cpu_s() -> Counter[str]:
    """By name of the process: user and system time, that of ended children too."""
    tick, spent = os.sysconf("SC_CLK_TCK"), Counter[str]()
    for pid, name in descendants(os.getpid()):
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        spent[name] += sum(map(int, fields[11:15])) / tick  # type: ignore[assignment]
    return spent


def sizes(panel: run.Running, tabs: list[Tab]) -> dict[str, float]:
    """Of the panel, and of the largest page; all in front, so that all have drawn what they know."""
    all_in_front(tabs)
    rss = int(Path(f"/proc/{panel.process.pid}/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1024
    pages = [tab.sizes() for tab in tabs]
    return {"panel_kb": rss} | {key: max(p[key] for p in pages) for key in pages[0]}


def lost_of(tabs: list[Tab]) -> list[str]:
    """The words of each page, as: lost 0, torn 0."""
    found = []
    for tab in tabs:
        tab.hide(False)
        until(tab.page, "document.getElementById('health').textContent.includes('lost')")
        found.append(tab.page.locator("#health").inner_text().partition(", ")[2].partition(";")[0])
    return found


def test_pages_for_minutes_leak_nothing_and_go_on(tmp_path: Path) -> None:
    wrong: list[str] = []
    begun_s = time.monotonic()
    with run.running("calibrate", "--seed", "3", "--out", tmp_path) as panel, sync_playwright() as p:
        browser = p.chromium.launch(executable_path=str(CHROMIUM))
        tabs = opened(browser, panel, wrong)
        start_stream(tabs[0])
        all_in_front(tabs)
        freeze_a_tab(tabs)
        stop_the_browser(tabs)
        assert lost_of(tabs) == NOTHING_LOST
        kill_the_emulator(panel, tabs)
        load_again(tabs)
        take_turns(tabs, begun_s + (1 - TAIL) * SOAK_S)
        before = sizes(panel, tabs)
        take_turns(tabs, begun_s + SOAK_S)
        after = sizes(panel, tabs)
        print(f"\n{PAGES} pages, {time.monotonic() - begun_s:.0f} s; CPU s:", dict(cpu_s()))
        print(f"before the last {TAIL:.0%} and after:", before, after)
        points = [tab.page.evaluate("watched.points") for tab in tabs]
        all_in_front(tabs)
        for tab, n in zip(tabs, points, strict=True):
            until(tab.page, f"watched.points > {n + ALL_S / BUCKET_S / 2}")
            tab.compare()
            seen = tab.page.evaluate("watched")
            assert seen["missing"] == 0, seen
            assert seen["compared"] > ALL_S / BUCKET_S / 2, seen
            expect(tab.page.locator("#link")).to_have_text("connected")
        assert lost_of(tabs) == NOTHING_LOST
        browser.close()
        assert panel.end() == ""
    assert wrong == []
    assert {k for k, bound in GREW.items() if after[k] > before[k] + bound} == set(), (before, after)
