"""The deformation study: its verdicts, its batch, its command and its page."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import QUIET, mistake_line
from psabench import cli
from psabench.campaign.procedures import CAMPAIGNS, split_name
from psabench.quartz import batch, deformation, deformation_claims, element, limits
from psabench.quartz import deformation_page as page
from psabench.quartz.deformation import Study
from psabench.report.page import page_without_foot

ROOT = Path(__file__).resolve().parents[3]


def a_study(*words: str, elements: int = 2000, seed: int = 1) -> Study:
    return deformation.run_study(
        element.change_figures(words), "serial", elements=elements, units=2000, seed=seed, progress=QUIET
    )


@pytest.fixture(scope="module")
def usual() -> Study:
    return a_study()


def test_the_articles_two_verdicts(usual: Study) -> None:
    gap = usual.deformation.gap_percent
    assert 0.004 < gap["held"].max() < gap["held, tolerances"].max() < 0.5
    assert gap["free"].min() > 5.0  # on the hinges alone: another reading, another result
    assert usual.deformation.turns.max() == 0.0
    assert deformation.grouped_turns(usual).min() >= 1.0
    assert deformation.hinge_ratio(usual.deformation).max() < 1.03
    assert deformation.needed_factor(usual) > 5.0
    assert page.is_within(usual)
    assert len(deformation_claims.limit_checks(usual)) == 15


@pytest.mark.parametrize(
    ("word", "what"),
    [
        ("expansion_per_k=1e-4", "gap, held, largest, %"),
        ("position_urad=0:90", "least swing of a unit over largest of the hinges"),
    ],
)
def test_an_element_that_contradicts_the_article_is_out_of_limits(word: str, what: str, usual: Study) -> None:
    other = replace(a_study(word), figures=usual.figures)  # as if those were the usual ones
    assert what in [c.what for c in deformation_claims.limit_checks(other) if not c.within]
    assert not page.is_within(other)


def test_the_thickness_that_keeps_the_claim_keeps_it(usual: Study) -> None:
    thick = a_study(f"thickness_um={usual.stiff_um}:0", "modulus_gpa=72:0", "modulus_per_k=2e-4:0")
    assert 0.4 < np.median(thick.deformation.gap_percent["free"]) < 0.6


def test_the_batch_gains_by_run_in_what_it_was_made_for(usual: Study) -> None:
    b = usual.batch
    d = batch.draw_instability(b, 5, 20000, 5)
    for q, (times, by) in limits.LAW_GAINS.items():
        assert float(d[q][:, 0].mean() / d[q][:, 4].mean()) == pytest.approx(times, abs=by)
    relaxed = batch.draw_instability({**b, "glue_ug": 0.0, "glue_ppm": 0.0, "glue_arcsec": 0.0}, 5, 20000, 5)
    # Two starts of rms s: mean size of their difference 2 s / sqrt(pi).
    assert float(relaxed["zero"].mean()) == pytest.approx(2.0 * b["start_ug"] / np.sqrt(np.pi), rel=0.02)
    sizes = np.log(np.abs(batch.draw_instability({**b, "start_ug": 0.0, "start_ppm": 0.0}, 5, 20000, 1)["zero"]))
    assert float(sizes.std()) > 0.4  # spread of the glue


def test_units_lie_within_the_articles_ratios_and_groups(usual: Study) -> None:
    curves = batch.draw_curves(usual.batch, 3, 5000)
    assert curves.ratio().min() >= 3.0
    assert curves.ratio().max() <= 16.0
    share = np.bincount(curves.group) / 5000
    np.testing.assert_allclose(share, [0.45, 0.40, 0.15], atol=0.03)
    np.testing.assert_allclose(curves.at(30.0)[:, 0], curves.zero_ug, atol=1e-9)
    few = batch.draw_curves(usual.batch, 3, 5)
    np.testing.assert_array_equal(few.curve_ug, curves.curve_ug[:5])
    hot, cold = (curves.at(t)[:, 0] - curves.zero_ug for t in (65.0, -45.0))
    assert (hot - cold)[curves.group == 0].min() > 0.0 > (hot - cold)[curves.group == 1].max()


def test_the_report_is_the_same_each_time_and_whole(tmp_path: Path) -> None:
    words = ["campaign", "quartz-deformation", "--elements", "1500", "--units", "2000", "--out", str(tmp_path)]
    assert cli.main(words) == 0
    text = page_without_foot((tmp_path / "report.html").read_text(encoding="utf-8"))
    assert text.rstrip() == page.html_page(a_study(elements=1500)).rstrip()
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["within_limits"]
    assert {f["grade"] for f in result["figures"]} == {"E0", "derived"}
    assert all(f["source"] for f in result["figures"])
    assert result["provenance"]["scenarios"][0]["name"] == "quartz-deformation"
    for part in ("figcaption", "lost", "Spinner", "E0"):
        assert part in text
    assert page.gap_table(a_study(elements=1500, seed=2)) != page.gap_table(a_study(elements=1500))


MISTAKES = [
    ("--elements 0", "--elements: expected 1 to 10000000, got 0"),
    ("--units 99999999", "--units: expected 1 to 10000000, got 99999999"),
    ("--seed 99999999999999999999", "--seed: expected 0 to "),
    ("--set hinge=1", "--set: expected NAME=VALUE[:TOLERANCE] with a name of hinge_mm, got 'hinge=1'"),
    ("--set hinge_mm=x", "--set hinge_mm=x: expected a number, or two with a colon between them, got 'x'"),
    ("--set hinge_mm=nan", "--set hinge_mm=nan: expected 0 to 5 mm, got nan"),
    ("--set thickness_um=2", "--set thickness_um=2: expected a tolerance that leaves the value above 0 um, got 2"),
    ("--batch README.md", "README.md: expected a batch of accelerometers, got "),
    ("--batch stars", "batches/stars.yaml: expected a file in "),
    ("--batch short.yaml", "short.yaml: base_curve_arcsec: expected a value, got none"),
    ("--batch more.yaml", "more.yaml: moons: expected no other keys than those of serial, got moons"),
    ("--batch text.yaml", "text.yaml: glue_ug: expected a number, got 'much'"),
    ("--studies 3", "campaign quartz-deformation: expected "),
]


@pytest.mark.parametrize(("line", "words"), MISTAKES, ids=[m[0] for m in MISTAKES])
def test_a_mistake_gets_one_line_and_status_2(
    line: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    serial = (ROOT / "proto/batches/serial.yaml").read_text(encoding="utf-8")
    (tmp_path / "README.md").write_text("# a page\n\nsome: text\n- and: more\n")
    (tmp_path / "short.yaml").write_text(re.sub(r"base_curve_arcsec.*\n", "", serial))
    (tmp_path / "more.yaml").write_text(f"{serial}moons: 3\n")
    (tmp_path / "text.yaml").write_text(re.sub(r"glue_ug: \S+", "glue_ug: much", serial))
    monkeypatch.chdir(tmp_path)
    assert words in mistake_line(["campaign", "quartz-deformation", *line.split()], capsys)


def test_the_list_names_every_figure_with_its_source(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["campaign", "quartz-deformation", "--list", "--set", "hinge_mm=2:0.5"]) == 0
    out = capsys.readouterr().out
    assert len(out.splitlines()) == len(element.FIGURES)
    assert "hinge_mm=2:0.5" in out
    assert all(f.source in out and f.name in out for f in element.FIGURES)


def test_campaigns_are_a_table_and_gyrocompass_keeps_its_words(capsys: pytest.CaptureFixture[str]) -> None:
    assert split_name(["gyrocompass", "--runs", "3"]) == ("gyrocompass", ["--runs", "3"])
    assert split_name(["--runs", "3", "gyrocompass", "--list"]) == ("gyrocompass", ["--runs", "3", "--list"])
    with pytest.raises(SystemExit):
        cli.main(["campaign", "--help"])
    out = capsys.readouterr().out
    assert all(name in out for name in CAMPAIGNS)
    assert cli.main(["campaign", "stars"]) == 2
    assert f"expected {', '.join(CAMPAIGNS)}, got 'stars'" in capsys.readouterr().err
