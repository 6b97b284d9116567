"""Intervals of a procedure that runs: what it writes down, what the panel keeps, what the page draws."""

from __future__ import annotations

import json
import re
from pathlib import Path

import panel_run as run
import pytest
from fake_bench import FakeBench
from panel_page import LONG_MS, check_repaint, needs_browser, opened
from playwright.sync_api import Browser, expect
from psabench.panel.intervals import MOST, SHOWN, Intervals
from psabench.procedures.fourier import FourierParams, fourier
from psabench.procedures.head_bench import Watch
from psabench.procedures.result import ProcedureResult
from psabench.procedures.reversal import ReversalParams, reversal
from psabench.procedures.turns import TurnsParams, turns
from psabench.progress import INTERVALS, interval_log

NOISE_V = 1e-3


def measured(name: str, watch: Watch) -> ProcedureResult:
    bench = FakeBench(noise_v=NOISE_V)
    if name == "turns":
        return turns(bench, TurnsParams(), watch)
    if name == "fourier":
        return fourier(bench, FourierParams(realisations=2, positions=75), watch)  # no multiple of the looks
    return reversal(bench, ReversalParams(realisations=2), watch)


@pytest.mark.parametrize("name", ["turns", "fourier", "reversal"])
def test_the_last_line_is_what_the_result_says(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    texts = []
    for k in range(2):
        monkeypatch.setenv(INTERVALS, str(tmp_path / f"{k}.jsonl"))
        result = measured(name, Watch(estimated=interval_log()))
        texts.append((tmp_path / f"{k}.jsonl").read_text())
    assert texts[0] == texts[1]
    lines = [json.loads(line) for line in texts[0].splitlines()]
    readings = [line["readings"] for line in lines]
    assert readings == sorted(set(readings))
    assert readings[-1] == len(result.readings)
    last = {e["name"]: e for e in lines[-1]["estimates"]}
    assert {"u0_v", "kx_v_per_g", "ky_v_per_g"} <= last.keys()
    for known, e in last.items():
        assert (e["value"], e["half"]) == (result.get(known).value, result.get(known).ci_half)
    first = {e["name"]: e for e in lines[0]["estimates"]}
    assert last["u0_v"]["half"] < first["u0_v"]["half"]  # it has become tighter


def test_no_one_asks_and_nothing_is_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(INTERVALS, raising=False)
    assert interval_log() is None
    monkeypatch.chdir(tmp_path)
    measured("turns", Watch(estimated=interval_log()))
    assert not list(tmp_path.iterdir())


def line(readings: int, value: float = 1.0) -> str:
    return (
        json.dumps({"readings": readings, "estimates": [{"name": "u0_v", "value": value, "half": 0.1, "unit": "V"}]})
        + "\n"
    )


def test_a_line_is_taken_when_it_is_whole_and_another_bench_begins_again(tmp_path: Path) -> None:
    known = Intervals(tmp_path / "it.jsonl")
    known.forget()
    known.follow()
    assert known.message() == []
    known.path.write_text(line(10) + line(20)[:9])
    known.follow()
    assert known.message() == [{"name": "u0_v", "unit": "V", "columns": [[10], [1.0], [0.1]]}]
    known.path.write_text(line(10) + line(20))
    known.follow()
    assert known.message()[0]["columns"][0] == [10, 20]
    with known.path.open("a") as file:
        file.write(line(5))
    known.follow()
    assert known.message()[0]["columns"][0] == [5]
    known.forget()
    assert known.message() == []
    assert not known.path.exists()


def test_a_long_run_is_thinned_and_ends_with_its_latest(tmp_path: Path) -> None:
    known = Intervals(tmp_path / "it.jsonl")
    known.path.write_text("".join(line(k + 1, float(k)) for k in range(1000)))
    known.follow()
    readings, values, _ = known.message()[0]["columns"]
    assert len(readings) <= MOST
    assert (readings[-1], values[-1]) == (1000, 999.0)
    assert readings == sorted(readings)


@needs_browser
def test_intervals_are_drawn_while_they_tighten(browser: Browser, tmp_path: Path) -> None:
    with run.running("quiet", "--paused", "--out", tmp_path) as panel, opened(browser, panel) as page:
        page.select_option("#procedure", "turns")
        page.click("#run")
        box = page.locator("[data-estimate='kx_v_per_g']")
        expect(box).to_contain_text(re.compile(r"kx_v_per_g 0\.999\d* \u00b1 \S+ V/g, \d+ readings"), timeout=LONG_MS)
        assert box.locator("canvas").count() == 1
        expect(page.locator("#procedure-step")).to_contain_text("done", timeout=LONG_MS)
        expect(box).to_contain_text("480 readings")
        found = re.search(r"kx_v_per_g (\S+) \u00b1 (\S+) V/g", box.inner_text())
        assert found is not None
        value, half = float(found[1]), float(found[2])
        k = (
            page.locator("[data-estimate]")
            .evaluate_all("(all) => all.map((e) => e.dataset.estimate)")
            .index("kx_v_per_g")
        )
        low, high = page.evaluate(f"import('/static/intervals.js').then((m) => m.scales()[{k}])")
        assert high - low == pytest.approx(8 * half, rel=0.1)  # the latest interval is a quarter of the plot
        assert (low + high) / 2 == pytest.approx(value, abs=half)
        assert page.locator("#intervals canvas").count() == SHOWN
        check_repaint(page, "#intervals canvas")
