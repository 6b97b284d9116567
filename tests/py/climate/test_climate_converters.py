"""Drift of converters with temperature, without an emulator: lines, uncertainties, grading, page; what is refused."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from psabench import cli
from psabench.climate import converters as measured
from psabench.climate import converters_page
from psabench.climate import converters_result as result
from psabench.climate.converters import ANGLES_DEG, Drift, Position, Soak
from psabench.climate.converters_result import ChamberComparison, TrueDrift
from psabench.procedures.compare_converters import GENERATIONS, Track

DEGC = (25.0, -60.0, 0.0, 85.0)
ZERO_V_PER_K, SCALE_PER_K = (3e-6, -1e-6, 2e-6), (5e-6, -4e-6)


def soaks(name: str = "psa2", *, quantum_vs: float = 1e-12, noise_v: float = 0.0, seed: int = 1) -> list[Soak]:
    """What a unit with these coefficients, and 0.1 % of scale, would tell."""
    rng, ma = np.random.default_rng(seed), GENERATIONS[name].ma_v_per_g
    inputs_g = measured.inputs_g(ANGLES_DEG)
    found = []
    for degc in DEGC:
        dt_k = degc - 25.0
        scale = 1.001 + dt_k * np.array([SCALE_PER_K[0], 0.0, SCALE_PER_K[1]])
        told_v = ma * scale * inputs_g + 1e-4 + dt_k * np.array(ZERO_V_PER_K)
        positions = tuple(_position(v, quantum_vs, noise_v, rng) for v in told_v)
        found.append(Soak(degc=degc, angle_deg=ANGLES_DEG, positions={name: positions}))
    return found


def _position(mean_v: np.ndarray, quantum_vs: float, noise_v: float, rng: np.random.Generator) -> Position:
    blocks_v = noise_v * rng.standard_normal((measured.BLOCKS, 3))
    return Position(
        mean_v=mean_v + blocks_v.mean(axis=0),
        block_var_v2=blocks_v.var(axis=0, ddof=1),
        span_s=30.0,
        quantum_vs=quantum_vs,
        gain_u=0.0,
        zero_u_v=0.0,
    )


def of(found: list[Soak]) -> Drift:
    (drift,) = measured.estimate_drifts(found)
    return drift


def test_coefficients_come_out_as_they_went_in() -> None:
    d = of(soaks())
    assert [line.per_k for line in d.zero_v] == pytest.approx(list(ZERO_V_PER_K), rel=1e-9)
    assert [line.per_k for line in d.scale] == pytest.approx(list(SCALE_PER_K), rel=1e-9)
    assert d.zero_v[0].values == pytest.approx([1e-4 + ZERO_V_PER_K[0] * (t - 25.0) for t in DEGC], abs=1e-12)
    assert d.worst_zero is d.zero_v[0]
    assert d.worst_zero.worst == pytest.approx(-85.0 * ZERO_V_PER_K[0])
    assert d.worst_scale.worst == pytest.approx(-85.0 * SCALE_PER_K[0])


def test_what_a_table_misses_its_angle_by_is_known() -> None:
    found = soaks()
    turned = [Soak(degc=s.degc, angle_deg=tuple(a + 30.0 for a in s.angle_deg), positions=s.positions) for s in found]
    assert of(turned).scale[0].values[0] == pytest.approx(1.001 * np.cos(np.radians(30.0)), abs=1e-6)


def test_u_is_what_the_coefficients_scatter_by() -> None:
    errors, u = [], []
    for seed in range(60):
        d = of(soaks(noise_v=1e-4, seed=seed))
        errors.append([d.zero_v[0].per_k - ZERO_V_PER_K[0], d.scale[0].per_k - SCALE_PER_K[0]])
        u.append([d.zero_v[0].per_k_u, d.scale[0].per_k_u])
    ratio = np.std(errors, axis=0) / np.mean(u, axis=0)
    assert np.all((ratio > 0.75) & (ratio < 1.3)), ratio


def test_u_knows_the_pulses_and_the_codes() -> None:
    fine, pulses, codes = of(soaks()), of(soaks(quantum_vs=5.75e-3)), of(soaks("psd1"))
    end_v = 5.75e-3 / 30.0 / 6.0**0.5
    assert pulses.zero_v[0].u == pytest.approx(end_v / 2.0, rel=1e-6)  # four positions
    assert pulses.scale[0].u == pytest.approx(end_v / 2.0**0.5 / pulses.ma_v_per_g, rel=1e-2)  # two that count
    assert codes.zero_v[1].u > 10.0 / 2**15 / 12.0**0.5  # the same code at all four: no mean
    assert fine.zero_v[0].u < 1e-12


def test_a_recording_has_a_mean_and_a_scatter() -> None:
    t_s = np.linspace(5.0, 35.0, 3001)
    rng = np.random.default_rng(2)
    walk = np.cumsum(rng.standard_normal((3001, 3)) * 1e-6, axis=0)
    p = measured.position_of(Track(name="psa2", quantum_vs=1e-9, t_s=t_s, s_vs=walk + 0.5 * (t_s - 5.0)[:, None]))
    assert p.mean_v == pytest.approx([0.5] * 3, abs=1e-5)
    block_s = 3.0
    assert p.block_var_v2.mean() == pytest.approx(1e-12 * 300 / block_s**2, rel=0.5)


def comparison(truth: TrueDrift) -> ChamberComparison:
    found = soaks(noise_v=1e-6)
    return ChamberComparison(
        soaks=tuple(found),
        drifts=(of(found), of(soaks("pik6", quantum_vs=5e-4))),
        truths={"psa2": truth, "pik6": result.NO_LINE},
        facts={"seed": "1"},
    )


def test_a_coefficient_is_graded_against_the_true_one(tmp_path: Path) -> None:
    good = comparison(TrueDrift(zero_v_per_k=ZERO_V_PER_K, scale_per_k=SCALE_PER_K))
    assert good.within
    bad = comparison(TrueDrift(zero_v_per_k=(4e-6, *ZERO_V_PER_K[1:]), scale_per_k=SCALE_PER_K))
    assert not bad.within
    assert "1 of 5 temperature coefficients are not within 2 U" in result.verdict_of_drifts(bad)
    assert "All 5 temperature coefficients are within 2 U" in result.verdict_of_drifts(good)
    assert comparison(result.NO_LINE).ens == []
    exact = replace(good.drifts[0].zero_v[0], per_k_u=0.0)
    assert result.Compared(what="zero X", line=exact, truth_per_k=exact.per_k).en == 0.0
    assert result.Compared(what="zero X", line=exact, truth_per_k=0.0).en == math.inf
    page = converters_page.write_page(tmp_path, good)
    assert page.read_text(encoding="utf-8").count("<svg") == 1
    assert json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["within_limits"] is True


def test_the_truth_of_a_chain_is_load_less_divider() -> None:
    afe = {"load_tc_ppm_per_k": 5.0, "divider_tc_ppm_per_k": 2.0, "buffer_offset_tc_v_per_k": 1e-7}
    truth = result.true_drift("psa2", {"axes": {a: {"afe": afe} for a in "xyz"}})
    assert truth.scale_per_k == pytest.approx((3e-6, 3e-6))
    assert truth.zero_v_per_k == (1e-7,) * 3
    assert result.true_drift("pmka", {}) is result.NO_LINE


def test_a_recording_beside_the_chamber_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for option in ("--record", "--replay"):
        words = ["run", "compare-converters", "--chamber", option, "x.log", "--out", str(tmp_path)]
        assert cli.main(words) == 2
        assert f"expected no {option} beside --chamber, got x.log" in capsys.readouterr().err


def test_points_are_three_or_more() -> None:
    with pytest.raises(ValueError, match="expected three or more different temperatures"):
        measured.ChamberParams(points_degc=(25.0, 85.0))


def test_x_points_up_at_90_deg() -> None:
    """As psabench.procedures.compare_converters: an axis that points down reads +g."""
    assert measured.inputs_g((0.0, 90.0)) == pytest.approx(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]]), abs=1e-12)


def test_what_a_straight_line_leaves_of_a_ratio_is_in_u() -> None:
    assert of(soaks()).scale[0].u == pytest.approx((85.0 * SCALE_PER_K[0]) ** 2, rel=1e-3)


def test_rounding_of_blocks_is_no_noise() -> None:
    """A staircase of pulses: its mean is good to a pulse over the whole recording, not to that of a tenth of it."""
    t_s = np.linspace(0.0, 30.0, 3001)
    pulses = np.floor(np.outer(t_s, [30.3, 17.7, 23.1])) * 5.75e-3
    p = measured.position_of(Track(name="pik", quantum_vs=5.75e-3, t_s=t_s, s_vs=pulses))
    assert measured.mean_u_v([p]) < 1.5 * 5.75e-3 / 30.0 / 6.0**0.5
