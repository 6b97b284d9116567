"""Comparison of converters without an emulator: integrals, grading, page; what is refused."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from psabench import cli
from psabench.errors import BenchError
from psabench.procedures import compare_converters as measured
from psabench.procedures import comparison
from psabench.procedures.compare_converters import GENERATIONS, CompareParams, Track
from psabench.procedures.comparison import ARTICLE, Comparison, Motion
from psabench.report import comparison_page

G_MPS2 = comparison.G_MPS2
PARAMS = CompareParams(seconds=60.0, rest_s=20.0)


def motion() -> Motion:
    """At rest 25 s, three swings of 10 s about the level axis, at rest."""
    t_s = np.arange(0.0, 80.0, 0.01)
    swing = np.where((t_s > 25.0) & (t_s < 55.0), np.sin(np.pi * (t_s - 25.0) / 5.0) ** 3, 0.0)
    a = G_MPS2 * np.stack([np.sin(swing), np.zeros_like(t_s), np.cos(swing)], axis=1)
    return Motion(t_s=t_s, a_mps2=a, v_mps=comparison.integrate(t_s, a))


def track(
    name: str, m: Motion, *, scale: float = 1.0, zero_v: float = 0.0, lag_s: float = 0.0, quantum_vs: float = 1e-9
) -> Track:
    """What a unit with these errors would tell."""
    ma = GENERATIONS[name].ma_v_per_g
    t_s = 5.0 + 0.02 * np.arange(3001, dtype=np.float64)
    v = m.at(t_s - lag_s, m.v_mps)
    s_vs = scale * (v - v[0]) * ma / G_MPS2 + zero_v * (t_s - t_s[0])[:, None]
    return Track(
        name=name,
        quantum_vs=quantum_vs,
        t_s=t_s,
        s_vs=np.round(s_vs / quantum_vs) * quantum_vs,
    )


def graded(t: Track, m: Motion) -> comparison.Graded:
    return comparison.grade(measured.figures(t, PARAMS, G_MPS2), m, PARAMS, G_MPS2)


def test_the_integral_is_of_fourth_order() -> None:
    t_s = np.linspace(0.0, 10.0, 1001)
    w = 2 * np.pi * 0.5
    v = comparison.integrate(t_s, np.cos(w * t_s)[:, None])[:, 0]
    assert np.abs(v - np.sin(w * t_s) / w).max() < 2e-7  # the trapezoids alone: 2.6e-6
    m = motion()
    fine = m.at(np.array([30.005, 41.3333]), m.v_mps)
    around = m.at(np.array([30.0, 41.33]), m.v_mps)
    a = m.at(np.array([30.0025, 41.33165]), m.a_mps2)
    assert fine - around == pytest.approx(a * np.array([[0.005], [0.00333]]), rel=1e-2, abs=1e-5)


def test_a_perfect_unit_has_no_error_whatever_its_delay() -> None:
    m = motion()
    for lag_s in (0.0, 0.006):
        g = graded(track("psa2", m, lag_s=lag_s), m)
        assert g.lag_s == pytest.approx(lag_s, abs=1e-5)
        assert np.abs(g.end_mps).max() < 1e-6
        assert g.swing_mps < 2e-4
        assert g.within
        assert comparison.zero_mps2(g, m, PARAMS) == pytest.approx(np.zeros(3), abs=1e-7)


def test_scale_and_zero_come_out_as_they_went_in() -> None:
    m = motion()
    span_s = 60.0
    g = graded(track("pik6", m, scale=1.0003, zero_v=50e-6), m)
    moved = m.at(np.array([5.0, 65.0]), m.v_mps)
    zero_mps2 = 50e-6 * G_MPS2 / GENERATIONS["pik6"].ma_v_per_g
    want = 3e-4 * (moved[1] - moved[0]) + zero_mps2 * span_s
    assert g.end_mps == pytest.approx(want, rel=1e-3, abs=1e-5)
    assert comparison.zero_mps2(g, m, PARAMS)[:2] == pytest.approx([zero_mps2] * 2, rel=1e-3)
    assert g.within


@pytest.mark.parametrize(
    ("name", "scale", "zero_v"),
    [
        ("pik6", 1.0013, 0.0),
        ("pik6", 1.0, 4e-4),
        ("pik", 0.996, 0.0),
        ("psa2", 1.0006, 0.0),
        ("psa2", 1.0, 6e-4),
        ("pmka", 1.000005, 0.0),
        ("pmka", 1.0, 1e-6),
    ],
)
def test_beyond_the_budget_of_its_board_is_out_of_limits(name: str, scale: float, zero_v: float) -> None:
    m = motion()
    good, bad = graded(track(name, m), m), graded(track(name, m, scale=scale, zero_v=zero_v), m)
    assert good.within
    assert not bad.within
    c = Comparison(graded=(good, bad), motion=m, params=PARAMS, g_mps2=G_MPS2, facts={})
    assert not c.within
    assert comparison.verdict(c).startswith(f"Not within 2 U of the exact integral: {GENERATIONS[name].title}; ")
    assert comparison.verdict(c).endswith(" of 6 end errors are beyond U.")


def test_resolution_and_noise_of_a_staircase() -> None:
    m = motion()
    quantum_vs = 1 / 174.0
    f = measured.figures(track("pik", m, quantum_vs=quantum_vs), PARAMS, G_MPS2)
    quantum_mps = quantum_vs * G_MPS2 / GENERATIONS["pik"].ma_v_per_g
    assert f.track.quantum_mps(G_MPS2) == pytest.approx(quantum_mps)
    assert f.step_mps[[0, 2]] == pytest.approx(quantum_mps, rel=1e-6)
    assert f.step_mps[1] == np.inf
    assert f.noise_mps[2] == pytest.approx(quantum_mps / np.sqrt(12.0), rel=0.1)
    assert f.noise_mps[1] < 1e-9
    shaken = track("psa2", m)
    wobble = np.random.default_rng(1).normal(0.0, 1e-7, shaken.s_vs.shape)
    f = measured.figures(replace(shaken, s_vs=shaken.s_vs + wobble), PARAMS, G_MPS2)
    assert np.all(f.step_mps == np.inf)  # no grid, no step


def test_truth_log_of_one_unit(tmp_path: Path) -> None:
    lines = []
    for k in range(5):
        for unit, f in (("a", [0.0, 1.0, -9.8]), ("ab", [5.0, 5.0, 5.0])):
            lines.append(json.dumps({"t_ns": k * 10**7, "unit": unit, "unit2": 0}, separators=(",", ":"))[:-1])
            lines[-1] += ',"unit":' + json.dumps({"name": unit, "f_mps2": f}) + "}"
    log = tmp_path / "truth.jsonl"
    log.write_text("\n".join(lines) + "\n")
    m = comparison.read_truth(log, "a")
    assert m.t_s == pytest.approx(0.01 * np.arange(5))
    assert m.a_mps2[0] == pytest.approx([0.0, -1.0, 9.8])
    assert m.v_mps[-1] == pytest.approx([0.0, -0.04, 0.392])
    with pytest.raises(BenchError, match="expected the truth of unit b"):
        comparison.read_truth(log, "b")


def test_page_and_data(tmp_path: Path) -> None:
    m = motion()
    both = tuple(graded(track(n, m, quantum_vs=q), m) for n, q in (("pik", 1 / 174.0), ("pik6", 1 / 2000.0)))
    c = Comparison(graded=both, motion=m, params=PARAMS, g_mps2=G_MPS2, facts={"seed": "<7>"})
    page = comparison_page.write(tmp_path, c)
    text = page.read_text(encoding="utf-8")
    assert text.count("<svg") == 3
    assert "&lt;7&gt;" in text
    assert "<7>" not in text
    assert not re.search(r"<script|src=|@import|url\((?!#)", text)  # nothing is loaded from elsewhere
    data = json.loads((tmp_path / "result.json").read_text())
    assert data["within_limits"] is True
    assert [g["title"] for g in data["generations"]] == ["PIK", "PIK-6"]
    assert data["generations"][0]["printed_quantum_mps"] == 0.06
    assert data["generations"][1]["step_seen_mps"][1] is None
    assert comparison.finer(c)[1][1] == pytest.approx(2000 / 174 * GENERATIONS["pik6"].load_ohm / 735.0)
    assert text.count("<h2>Beside the ") == 2
    assert "<td class='num'></td>" not in text, "every cell of a generation says something"
    assert all(g.article.why in text for g in both)


def test_tables_have_resolution_noise_drift_and_the_errors_beside_their_limits() -> None:
    m = motion()
    good, bad = graded(track("psd1", m, zero_v=100e-6), m), graded(track("pik6", m, scale=1.0012), m)
    c = Comparison(graded=(good, bad), motion=m, params=PARAMS, g_mps2=G_MPS2, facts={})
    head, units, psd1, pik6 = comparison.figures_table(c)
    zero_g = 100e-6 / GENERATIONS["psd1"].ma_v_per_g
    column = dict(zip(head, psd1, strict=True))
    assert float(column["as a zero"]) == pytest.approx(zero_g * 1e6, rel=0.01)
    assert float(column["drift at rest"]) == pytest.approx(zero_g * G_MPS2 * 60e3, rel=0.01)
    assert units[head.index("drift at rest")] == "mm/s a min"
    assert float(column["largest in motion"]) == pytest.approx(good.swing_mps, rel=0.1)
    assert column["printed"] == "–"
    assert pik6[head.index("printed")] == "5e-3"
    head, _units, psd1, pik6 = comparison.errors_table(c)
    assert all(x for row in (head, psd1, pik6) for x in row[1:])
    for i, axis in enumerate("XYZ"):
        assert float(psd1[head.index(f"end {axis}")]) == pytest.approx(good.end_mps[i], rel=0.1, abs=1e-9)
        assert float(psd1[head.index(f"U {axis}")]) == pytest.approx(good.u_mps[i], rel=0.1)
    assert (psd1[-1], pik6[-1]) == ("yes", "NO")
    assert pik6[head.index("printed")] == "0.05 %"
    assert "<td class='num bad'>NO</td>" in comparison_page.html_page(c)
    assert "words are cut off" in comparison_page.html_page(c)
    lines = comparison.console_table(c).splitlines()
    assert max(map(len, lines)) <= 100
    assert [x.split()[0] for x in lines if x.startswith(("  PS", "  PIK"))] == ["PSD-1", "PIK-6"] * 2


def test_every_generation_has_its_figures() -> None:
    assert list(GENERATIONS) == list(ARTICLE)
    for printed, name in ((60e-3, "pik"), (5e-3, "pik6"), (2.4e-5, "pmka")):
        assert ARTICLE[name].pulse_mps == printed == float(ARTICLE[name].pulse)


@pytest.mark.parametrize("option", [["--can", "slcan:x"], ["--head", "x"], ["--control", "x"], ["--realisations", "2"]])
def test_it_takes_no_addresses_and_no_parameters_of_others(
    option: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["run", "compare-converters", *option]) == 2
    assert (
        "compare-converters: expected --chamber, --scenario, --seed, --record, --replay, --out, --verbose, "
        f"--json, got {option[0]}" in capsys.readouterr().err
    )


def test_params() -> None:
    with pytest.raises(ValueError, match=r"rest_s: expected 0 to seconds, 70.0, got 80"):
        CompareParams(rest_s=80.0)
