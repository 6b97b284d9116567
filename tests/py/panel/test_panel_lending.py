"""A procedure on the bench of the page: which fit, what is held meanwhile, the bench afterwards."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import panel_run as run
import pytest
from panel_page import LONG_MS, needs_browser, opened, said, until
from playwright.sync_api import Browser, expect
from psabench.bench import Bench
from psabench.emulator import Emulator
from psabench.errors import BenchError
from psabench.panel.bench_view import BenchView
from psabench.panel.lending import check_free, fitting_procedures, options_of
from psabench.panel.procedures import OFFERED
from psabench.procedures.command_line.commands import COMMANDS
from psabench.procedures.command_line.offered import ON_THE_HEAD, ON_THE_PLATFORM

ON_HEAD = [*ON_THE_HEAD, "all"]

FITTING = {
    "quiet": ON_HEAD,
    "climate": [*ON_HEAD, "thermal"],
    "quartz_run_in": [*ON_HEAD, "thermal"],
    "gyrocompass": list(ON_THE_PLATFORM),
    "sins_table": ["sins-calibration"],
    "mems_gyro": ["mems-gyro"],
    "table_rate": [],  # a PSA-2 on a table of one axis
    "converters": [],
}


@pytest.mark.parametrize("scenario", FITTING)
def test_a_bench_is_offered_what_fits_its_boards_and_instruments(scenario: str, tmp_path: Path) -> None:
    with Bench.start(scenario) as bench:
        assert sorted(fitting_procedures(BenchView(bench, tmp_path))) == sorted(FITTING[scenario])


def test_options_lead_to_the_bench_and_its_chosen_unit(tmp_path: Path) -> None:
    with Bench.start("multi") as bench:
        view = BenchView(bench, tmp_path)
        second = list(bench.units)[1]
        view.line(f"dut.use {second}")
        words = list(options_of("turns", view))
        assert words[words.index("--control") + 1] == str(bench.control.path)
        assert words[words.index("--node") + 1] == str(bench.units[second].node.node_id)
        assert words[words.index("--truth") + 1] == str(bench.truth_path)
        with pytest.raises(BenchError, match=r"expected .*turns.*, got 'gyrocompass'"):
            options_of("gyrocompass", view)


def test_those_that_start_benches_of_their_own_take_none() -> None:
    assert {n for n in OFFERED if not COMMANDS[n].takes_bench} == {
        "compare-converters",
        "sins-covariance",
        "sins-snake",
    }


def test_a_bench_in_a_procedures_hands_is_only_looked_at() -> None:
    for what in ("line", "play", "frame", "restore", "fork", "begin", "show", "drop"):
        with pytest.raises(BenchError, match="the procedure turns has it; Stop"):
            check_free(what, "turns")
        check_free(what, "")
    for what in ("hello", "statistics", "stop"):
        check_free(what, "turns")


@pytest.fixture
def panel(tmp_path: Path) -> Iterator[run.Running]:
    with run.running("quiet", "--paused", "--out", tmp_path) as p:
        yield p


def followed(socket: Any, state: str) -> dict[str, Any]:
    """The procedure's message when it is in this state."""
    while (message := run.received(socket, "procedure"))["state"] != state:
        pass
    return message


def test_stopped_midway_it_gives_the_bench_back(panel: run.Running, tmp_path: Path) -> None:
    with panel.socket() as socket, panel.socket() as other:
        assert "turns" in run.received(socket, "hello")["fits"]
        assert "error" in run.asked(socket, 1, do="run", name="gyrocompass", here=True)
        assert run.asked(socket, 2, do="run", name="reversal", here=True)["time"]["lent"] == "reversal"
        run.received(other, "hello")
        requests: list[dict[str, Any]] = [{"do": "line", "line": "head.turn 5"}, {"do": "play", "on": True}]
        for number, request in enumerate(requests, 3):
            assert "the procedure reversal has it" in run.asked(other, number, **request)["error"]
        while run.received(socket, "procedure")["done"] < 2:
            pass
        assert run.received(other, "update")["time"]["lent"] == "reversal"
        run.asked(other, 5, do="stop")
        followed(socket, "stopped")
        while run.received(other, "hello")["time"]["lent"]:
            pass
        t_s = run.said(socket, 6, "time")["result"]["t_s"]
        assert t_s > 0.1  # the page had stood still at 0
        assert "error" not in run.said(socket, 7, "head.turn 30")
        assert "error" not in run.said(socket, 8, "dut.ready")
        assert "error" not in run.said(socket, 9, "dut.stream 10")
        (unit,) = run.received(socket, "state")["overview"]
        assert unit["torn"] == 0
        run.said(socket, 10, "save s.psa")
    script = (tmp_path / "s.psa").read_text()
    assert "# the procedure reversal had this bench until here" in script


def test_the_same_bench_gives_the_same_result_as_the_command(panel: run.Running, tmp_path: Path) -> None:
    """No frame of the page's own and no look at the instruments moves a reading."""
    with panel.socket() as socket:
        run.asked(socket, 1, do="run", name="turns", here=True)
        done = followed(socket, "done")
        assert done["report"]
    with Emulator("quiet", scpi=True) as emulator:
        words = ["run", "turns", "--control", str(emulator.control_path), "--out", str(tmp_path / "own")]
        assert run.command(*words) == 0
    readings = [next(p.glob("turns*.csv")).read_text() for p in (tmp_path / "procedures/turns", tmp_path / "own")]
    assert readings[0] == readings[1]


@pytest.mark.parametrize(("scenario", "name"), [("gyrocompass", "gyrocompass"), ("quartz_run_in", "thermal")])
def test_a_platform_and_a_chamber_are_lent_and_given_back(scenario: str, name: str, tmp_path: Path) -> None:
    with run.running(scenario, "--paused", "--out", tmp_path) as panel, panel.socket() as socket:
        run.asked(socket, 1, do="run", name=name, here=True)
        while (message := run.received(socket, "procedure"))["state"] == "running":
            pass
        assert (message["state"], message["report"]) == ("done", f"/reports/{name}/report.html"), message["lines"]
        while run.received(socket, "hello")["time"]["lent"]:
            pass
        before_s = run.said(socket, 2, "time")["result"]["t_s"]
        assert before_s > 60.0
        run.said(socket, 3, "wait 1s")
        assert run.said(socket, 4, "time")["result"]["t_s"] == pytest.approx(before_s + 1.0)


# What the head of the page shows while a procedure has the bench: four readings a second, of a run of some seconds.
NOTES_HEAD = """() => {
  const [box, lent] = ["#read-head", "#lent"].map((name) => document.querySelector(name));
  window.readings = new Set();
  const observer = new MutationObserver(() => { if (!lent.hidden) readings.add(box.textContent); });
  observer.observe(box, { childList: true, characterData: true, subtree: true });
}"""


@needs_browser
def test_a_calibration_runs_on_the_bench_of_the_page_to_its_report(browser: Browser, panel: run.Running) -> None:
    with opened(browser, panel) as page:
        page.check("#procedure-here")
        expect(page.locator("#procedure option")).to_have_text(ON_HEAD)
        page.select_option("#procedure", "turns")
        page.evaluate(NOTES_HEAD)
        page.click("#run")
        expect(page.locator("#lent")).to_contain_text("The procedure turns has this bench")
        assert page.evaluate("document.querySelector('#controls').inert")
        expect(page.locator("[data-estimate='kx_v_per_g']")).to_contain_text("readings", timeout=LONG_MS)
        until(page, "readings.size >= 2", LONG_MS)  # the head of the page turns
        expect(page.locator("#lent")).to_be_hidden(timeout=LONG_MS)
        assert page.evaluate("panel.shown().points") > 3
        expect(page.locator("#procedure-step")).to_contain_text("done", timeout=LONG_MS)
        with page.context.expect_page() as opening:
            page.click("#report")
        expect(opening.value.locator("h1").first).to_be_visible()
        opening.value.close()
        assert not page.evaluate("document.querySelector('#controls').inert")
        said(page, "head.turn 30")
        page.click("#start-stream")
        page.click(".step[data-for='10ms']")
        expect(page.locator("#log")).to_contain_text("> wait 10ms")
        expect(page.locator("#health")).to_contain_text("torn 0")
