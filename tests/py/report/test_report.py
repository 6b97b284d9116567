"""The report: one file, same bytes, the article beside ours, truth graded, nothing flagged counted as wrong."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from fake_bench import FakeBench, seeded
from psabench.budget.accuracy import BenchAccuracy
from psabench.budget.influences import expand_result
from psabench.procedures.fourier import FourierParams
from psabench.procedures.registry import PROCEDURES
from psabench.procedures.reversal import reversal
from psabench.report import calibration as report
from psabench.report.grading import (
    Graded,
    Section,
    aligned,
    console_table,
    grade,
    sensor_of,
    verdict,
    with_ci,
    within_limits,
)
from psabench.report.nominal import ARTICLE, as_printed, console_nominal
from psabench.report.page import table
from psabench.report.quantities import page_words, symbol_html
from report_sections import SHORT_PAIR, TRUTH, sections


class Tags(HTMLParser):
    """Collects what a page would load and whether its elements close."""

    VOID = frozenset({"meta", "br", "path", "use", "rect", "circle"})

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.loads: list[str] = []
        self.ids: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in self.VOID:
            self.open.append(tag)
        self._look(attrs)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self._look(attrs)

    def handle_endtag(self, tag: str) -> None:
        if tag not in self.VOID:
            assert self.open.pop() == tag

    def _look(self, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name in ("src", "href", "xlink:href") and not (value or "").startswith("#"):
                self.loads.append(value or "")
            if name == "id":
                self.ids.append(value or "")


def test_page_is_one_file_that_loads_nothing_and_is_well_formed() -> None:
    page = report.html_page(sections(TRUTH), {"seed": "7", "profile": "<psa2>"})
    tags = Tags()
    tags.feed(page)
    assert tags.open == []
    assert tags.loads == []
    assert len(tags.ids) == len(set(tags.ids))  # ids of several pictures must not meet
    assert "url(http" not in page
    assert "@import" not in page
    assert "&lt;psa2&gt;" in page
    assert not re.search(r"#0102[01][0-9]", page)  # every stand-in colour became a variable
    assert page.count("<svg") == 7  # alpha0; turn and second harmonic of two; turn of two


def test_same_results_give_the_same_bytes() -> None:
    assert report.html_page(sections(TRUTH), {}) == report.html_page(sections(TRUTH), {})


def test_quiet_column_shows_the_five_printed_values() -> None:
    page = report.html_page(sections()[:1], {}, ARTICLE)
    shown = re.findall(r"<span class=(same|other)>([^<]*)</span>", page)
    assert shown == [("same", v) for v in ("2.50", "0.1121", "1.0", "0.0098", "0.0010")]


def test_result_json_holds_every_number_with_its_interval_and_grade(tmp_path: Path) -> None:
    given = sections(TRUTH)
    page = report.write(tmp_path / "new" / "run", given, {"seed": "7"}, ARTICLE)
    assert page.read_text(encoding="utf-8").startswith("<!doctype html>")
    assert sorted(p.name for p in page.parent.iterdir()) == ["report.html", "result.json"]  # no draft left
    data = json.loads((page.parent / "result.json").read_text(encoding="utf-8"))
    assert data["facts"] == {"seed": "7"}
    assert (data["nominal"]["source"], data["nominal"]["values"]["alpha0_deg"]) == ("the article", "0.1121")
    assert data["within_limits"] is True
    for s, section in zip(data["sections"], given, strict=True):
        assert [e["name"] for e in s["estimates"]] == [e.name for e in section.result.estimates]
        for e, g in zip(s["estimates"], grade(section), strict=True):
            assert e["ci95"][0] <= e["value"] <= e["ci95"][1]
            assert e["error"] == pytest.approx(e["value"] - e["truth"])
            assert (e["within_limits"] is None) == (not g.estimate.identifiable)


def test_a_measured_number_off_its_interval_is_out_of_limits_and_a_flagged_one_is_not() -> None:
    quiet = sections({**TRUTH, "u0_v": 2.4999})[:1]
    assert not within_limits(quiet)
    assert "OUT OF LIMITS" in console_table(quiet[0])
    assert "are not within 2 U" in report.html_page(quiet, {})
    words = "2 of 10 numbers are not within 2 U of the sensor's true parameters, 2 are beyond U (expected: 0.5)."
    assert verdict(quiet).startswith(words)  # u0 and c0
    twisted = sections({**TRUTH, "alpha0_deg": 0.1121, "kxy_v_per_g2": 0.001})[2:3]  # turns: ky misses by 2 mV, flagged
    assert within_limits(twisted)
    ky = next(g for g in grade(twisted[0]) if g.estimate.name == "ky_v_per_g")
    assert ky.within is None
    assert ky.z is not None
    assert abs(ky.z) > 10


def test_the_terminal_shows_the_articles_digits_beside_ours() -> None:
    given = sections(TRUTH)
    title, procedures, labels, *rows = console_nominal([given[0], given[-1]], ARTICLE).splitlines()
    assert "?: not identifiable" in title
    assert procedures.split() == ["fourier", "reversal"]
    assert labels.split()[:2] == ["printed", "quiet"]
    assert [row.split()[:3] for row in rows] == [
        ["u0_v", "2.50", "2.50"],
        ["alpha0_deg", "0.1121", "0.1121?"],
        ["kx_v_per_g", "1.0", "1.0?"],
        ["ky_v_per_g", "0.0098", "0.0098?"],
        ["kxy_v_per_g2", "0.0010", "0.0010?"],
    ]
    assert "?" not in "".join(row.split()[3] for row in rows)  # the reversal knows


def test_the_budget_is_the_limit_and_every_component_is_shown(tmp_path: Path) -> None:
    off = sections({**TRUTH, "u0_v": 2.5003})[0]
    assert not within_limits([off])
    budgeted = expand_result(
        off.result, PROCEDURES["fourier"], FourierParams(), BenchAccuracy(chain_zero_uv=160.0), 0.0
    )
    wide = replace(off, result=budgeted)
    assert within_limits([wide])
    data = json.loads((report.write(tmp_path, [wide]).parent / "result.json").read_text(encoding="utf-8"))
    u0 = next(e for e in data["sections"][0]["estimates"] if e["name"] == "u0_v")
    assert u0["budget"]["chain zero"] == pytest.approx(160e-6)
    assert u0["sd"] == pytest.approx(math.hypot(*u0["budget"].values()))
    assert u0["en"] == pytest.approx(u0["error"] / u0["expanded_u"])
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert all(f"<th>{name}</th>" in page for name in u0["budget"])


def test_z_is_shown_whatever_its_size() -> None:
    for g in grade(sections({**TRUTH, "kx_v_per_g": 0.5})[0]):
        assert g.z is not None
        assert g.en is not None
    exact = replace(sections(TRUTH)[0].result.estimates[0], sd=0.0, ci_half=0.0)
    assert math.isinf(Graded(estimate=exact, truth=0.0, error=-1e-9, within=False).z or 0.0)
    assert Graded(estimate=exact, truth=0.0, error=0.0, within=True).en == 0.0


def test_the_zero_is_compared_as_it_was_while_it_was_measured() -> None:
    """10 nV a second over a run: without the drift of the truth u0 is out of its limits."""
    bench = FakeBench(noise_v=2e-9, drift_v_per_s=1e-8, rng=seeded("drifting"))
    result = reversal(bench, SHORT_PAIR)
    assert within_limits([Section(label="", result=result, truth={**TRUTH, "drift_v_per_s": 1e-8})])
    assert not within_limits([Section(label="", result=result, truth=TRUTH)])


def test_console_names_every_estimate_and_says_why_a_flag_is_down() -> None:
    for section in sections(TRUTH):
        text = console_table(section)
        assert all(f"  {e.name} " in text for e in section.result.estimates)
        assert all(e.reason in text for e in section.result.estimates if not e.identifiable)
        assert max(len(line) for line in text.splitlines()[:12]) <= 120


@pytest.mark.parametrize(
    ("value", "ci", "want"),
    [
        (0.1113213, 0.00561, ("0.1113", "0.0056")),
        (-1.58143, 7.316, ("-1.6", "7.3")),
        (2.499985123, 7.1e-5, ("2.499985", "0.000071")),
        (1.0, 0.0, ("1.000000000", "0")),
        (1.957e-6, 2.8e-10, ("1.957e-06", "2.8e-10")),
        (123.4, 99.0, ("123", "99")),
    ],
)
def test_a_value_has_the_decimals_that_its_interval_deserves(value: float, ci: float, want: tuple[str, str]) -> None:
    assert with_ci(value, ci) == want


@pytest.mark.parametrize(
    ("value", "printed", "want"), [(2.4999, "2.50", "2.50"), (1.04, "1.0", "1.0"), (0.00986, "0.0098", "0.0099")]
)
def test_as_printed_keeps_the_decimals_of_the_article(value: float, printed: str, want: str) -> None:
    assert as_printed(value, printed) == want


def test_truth_without_its_main_names_is_refused_with_what_it_has() -> None:
    with pytest.raises(ValueError, match=r"expected truth with kx_v_per_g, got alpha0_deg, u0_v"):
        sensor_of({"u0_v": 1.0, "alpha0_deg": 0.0})


def test_a_report_of_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="at least one"):
        report.write(tmp_path, [])


def test_all_pages_write_quantities_alike() -> None:
    """Symbols with their indices and signs of print, where the console has names and ASCII."""
    rows = [("", "found", "+- 95 %", "unit"), ("drift2_degph", "1", "2", "V/g^2"), ("noise", "3", "4", "uV rms")]
    assert "+- 95 %" in aligned(rows)[0]
    page = table(rows, symbols={"drift2_degph": "ω_d2"})
    assert "<th title='drift2_degph'>ω<sub>d2</sub></th>" in page
    assert all(f">{words}</t" in page for words in ("± 95 %", "V/g²", "µV rms"))
    assert symbol_html("alpha0 and k_xy of ϑ_1") == "α<sub>0</sub> and k<sub>xy</sub> of ϑ<sub>1</sub>"
    assert "±" not in page_words("a+-b")  # no sign of an interval
