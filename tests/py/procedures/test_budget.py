"""The uncertainty budget: the GUM's own example, sensitivities on paper, and how often U contains the truth."""

from __future__ import annotations

import math
from dataclasses import asdict, replace

import numpy as np
import pytest
from fake_bench import FakeBench, seeded
from psabench.budget import gum
from psabench.budget.accuracy import EXACT, BenchAccuracy
from psabench.budget.influences import expand_result
from psabench.estimate.uncertainty import Component, Estimate, estimate, t_quantile, within_limit
from psabench.procedures.fourier import FourierParams
from psabench.procedures.registry import PROCEDURES
from psabench.procedures.result import ProcedureResult
from psabench.procedures.reversal import ReversalParams
from psabench.procedures.turns import TurnsParams
from psabench.report.grading import Section, grade
from scipy import stats

from tests.coverage.table import Run, chance_band, pooled_share, rows_of

ARTICLE = {"u0_v": 2.5, "alpha0_deg": 0.1121, "kx_v_per_g": 1.0, "ky_v_per_g": 0.0098, "kz_v_per_g": 0.004}
ARTICLE |= {"kxy_v_per_g2": 0.001}
ARCSEC = 1.0 / 3600.0


def short_params(name: str) -> TurnsParams | FourierParams | ReversalParams:
    """A run of seconds in memory; the reversal without its side faces."""
    if name == "turns":
        return TurnsParams(readings=2)
    if name == "fourier":
        return FourierParams(realisations=1, positions=24, step_deg=15.0)
    return ReversalParams(realisations=1, positions=24, step_deg=15.0, side=False)


def measured(name: str, bench: FakeBench, accuracy: BenchAccuracy, step_v: float = 0.0) -> ProcedureResult:
    p, params = PROCEDURES[name], short_params(name)
    return expand_result(p.run(bench, params), p, params, accuracy, step_v)


def components(e: Estimate) -> dict[str, float]:
    return {c.name: c.u for c in e.budget}


def test_the_example_of_the_gum() -> None:
    """GUM G.4.1: 0.25, 0.57 and 0.82 % with 9, 4 and 14 degrees of freedom give 1.03 %, 19.0 degrees, t95 = 2.09."""
    each = [Component(name=str(u), u=u, dof=dof) for u, dof in ((0.25, 9), (0.57, 4), (0.82, 14))]
    assert gum.combined_u(each) == pytest.approx(1.03, abs=0.005)
    assert gum.effective_dof(each) == pytest.approx(19.0, abs=0.05)


@pytest.mark.parametrize(("dof", "k"), [(1, 13.97), (4, 2.87), (10, 2.28), (20, 2.13), (100, 2.025), (math.inf, 2.0)])
def test_k_is_that_of_the_gum(dof: float, k: float) -> None:
    """Table G.2, 95.45 %."""
    assert t_quantile(dof, gum.COVERAGE) == pytest.approx(k, abs=0.005)


def test_the_interval_is_k_times_u_with_k_of_the_degrees_of_freedom() -> None:
    few = gum.expand_estimate(estimate("a_v", "a", "V", 1.0, 3.0, 12), [Component(name="b", u=4.0)])
    assert few.sd == pytest.approx(5.0)
    assert few.dof == pytest.approx(12 * (5 / 3) ** 4)
    assert 5.0 * 2.025 < few.ci_half < 5.0 * 2.05  # between 100 and 50 degrees of freedom in GUM table G.2
    many = gum.expand_estimate(estimate("a_v", "a", "V", 1.0, 0.0, 12), [Component(name="b", u=4.0)])
    assert math.isinf(many.dof)
    assert many.ci_half == pytest.approx(8.0, rel=1e-5)


@pytest.mark.parametrize(("sd", "limit"), [(1.0, 0.1), (1.0, 1.0), (1.0, 5.0), (0.2, 3.0)])
def test_an_interval_with_a_limit_in_it_is_that_of_the_convolution(sd: float, limit: float) -> None:
    """k = 2 of the combined standard uncertainty would contain all of a number that a rectangle dominates."""
    each = [Component(name="noise", u=sd), within_limit("zero", limit)]
    half = gum.expanded_u(each)
    x = np.linspace(-limit, limit, 20001)
    inside = float(np.mean(stats.norm.cdf((half - x) / sd) - stats.norm.cdf((-half - x) / sd)))
    assert inside == pytest.approx(gum.COVERAGE, abs=1e-4)


def test_limits_alone_and_nothing_at_all() -> None:
    """Two equal rectangles make a triangle."""
    triangle = gum.expanded_u([within_limit("a", 1.0), within_limit("b", 1.0)])
    assert triangle == pytest.approx(2.0 * (1.0 - math.sqrt(1.0 - gum.COVERAGE)), rel=0.01)
    assert gum.expanded_u([within_limit("a", 1.0)]) == pytest.approx(gum.COVERAGE, rel=0.01)
    assert gum.expanded_u([Component(name="noise", u=0.0), within_limit("a", 0.0)]) == 0.0


def test_each_influence_reaches_the_estimates_that_it_moves_by_what_paper_says() -> None:
    a = BenchAccuracy()
    r = measured("reversal", FakeBench(noise_v=1e-5, rng=seeded("paper")), a)
    u0, kx, alpha0 = (components(r.get(n)) for n in ("u0_v", "kx_v_per_g", "alpha0_deg"))
    quad, kxy = (components(r.get(n)) for n in ("kxx_minus_kyy_v_per_g2", "kxy_v_per_g2"))
    assert kx["chain gain"] == pytest.approx(50e-6, rel=1e-3)
    assert u0["chain gain"] == pytest.approx(2.5 * 50e-6, rel=1e-3)
    assert u0["chain zero"] == pytest.approx(100e-6, rel=1e-6)
    assert kx.get("chain zero", 0.0) < 1e-12
    assert u0["temperature"] == pytest.approx(math.hypot(2.5 * 10e-6, 20e-6), rel=1e-3)
    assert alpha0["mounting"] == pytest.approx(3.0 * ARCSEC / math.sqrt(2.0), rel=1e-3)  # mean of two mountings
    # an error A sin(alpha + phi) of the circle puts kx A / 2 into the second harmonic, the same on both faces
    assert quad["circle"] == pytest.approx(math.radians(3.0 * ARCSEC) / math.sqrt(2.0), rel=2e-3)
    assert kxy["circle"] < 0.01 * quad["circle"]


def test_an_exact_bench_adds_nothing_but_its_resolution() -> None:
    rng = seeded("exact")
    exact = BenchAccuracy(**EXACT)
    plain = measured("fourier", FakeBench(noise_v=1e-3, rng=rng), exact, step_v=1e-9)
    assert all([c.name for c in e.budget] == ["scatter"] for e in plain.estimates)
    fine = measured("fourier", FakeBench(lsb_v=1e-6), exact, step_v=1e-6)
    assert [c.name for c in fine.get("c0_v").budget] == ["scatter", "resolution"]
    # 24 positions, each off by 1 uV / sqrt(12): their mean by that over sqrt(24); 16 patterns know it to 18 %
    assert components(fine.get("c0_v"))["resolution"] == pytest.approx(1e-6 / math.sqrt(12 * 24), rel=0.5)


def test_alpha0_that_the_whole_budget_does_not_determine_is_flagged() -> None:
    p = FourierParams(quadratic_bound_v_per_g2=1e-9)
    fourier = PROCEDURES["fourier"]
    result = fourier.run(FakeBench(noise_v=2e-9, rng=seeded("flag")), p)
    assert result.get("alpha0_deg").identifiable
    assert not expand_result(result, fourier, p, BenchAccuracy(), 0.0).get("alpha0_deg").identifiable


def drawn_bench(a: BenchAccuracy, rng: np.random.Generator, noise_v: float) -> FakeBench:
    """A bench whose hidden errors are draws of what `a` says of them."""
    gain_ppm = rng.normal(0.0, a.chain_gain_ppm) + rng.normal(0.0, a.chain_gain_tc_ppm_per_k) * a.chain_off_k
    zero_uv = rng.normal(0.0, a.chain_zero_uv) + rng.normal(0.0, a.chain_zero_tc_uv_per_k) * a.chain_off_k
    phase = rng.uniform(0.0, 2.0 * math.pi)
    return FakeBench(
        u0_v=U0_V,
        noise_v=noise_v,
        chain=(gain_ppm * 1e-6, zero_uv * 1e-6),
        circle_arcsec=(a.circle_arcsec * math.cos(phase), a.circle_arcsec * math.sin(phase)),
        remount_arcsec=a.mount_arcsec,
        rng=rng,
    )


def graded_run(result: ProcedureResult) -> Run:
    each = grade(Section(label="", result=result, truth={**ARTICLE, "u0_v": U0_V}))
    return {
        g.estimate.name: (g.z, g.en) for g in each if g.estimate.identifiable and g.z is not None and g.en is not None
    }


RUNS = 200
U0_V = 0.5  # less than the article's: the chain's zero is not lost beside its gain
NOISE_V = 3e-5  # of a reading: the components are all of one size


@pytest.mark.parametrize("name", ["turns", "reversal"])
def test_u_contains_the_truth_as_often_as_it_says(name: str) -> None:
    """Every quantity within the band of chance; with any line of the budget left out that moves it, not."""
    a, rng = BenchAccuracy(), seeded(f"coverage {name}")
    results = [measured(name, drawn_bench(a, rng, NOISE_V), a) for _ in range(RUNS)]
    rows = rows_of(graded_run(r) for r in results)
    assert not [r for r in rows if not r.within]
    assert 0.94 <= pooled_share(rows) <= 0.97
    assert all(0.8 < r.rms_z < 1.25 for r in rows)  # an interval that is too wide fills its band
    for line in ("chain gain", "chain zero", "mounting" if name == "reversal" else "scatter"):
        without = rows_of(graded_run(without_line(r, line)) for r in results)
        assert [r.quantity for r in without if not r.within], line


def without_line(result: ProcedureResult, name: str) -> ProcedureResult:
    """The result with one line of its budget struck out."""
    each = []
    for e in result.estimates:
        scatter, *others = [replace(c, u=0.0) if c.name == name else c for c in e.budget]
        each.append(gum.expand_estimate(replace(e, sd=scatter.u, dof=scatter.dof), others))
    return replace(result, estimates=tuple(each))


def test_intervals_that_are_scaled_fail_the_band() -> None:
    least, most = chance_band(RUNS, 10)
    from scipy.stats import norm

    for factor in (0.3, 0.7):
        hits = RUNS * (2.0 * norm.cdf(2.0 * factor) - 1.0)
        assert not least <= hits <= most, factor


def test_rounding_that_recurs_is_covered_only_with_its_line() -> None:
    """Without noise the scatter of repeated positions is the same rounding each turn."""
    rng, exact = seeded("rounding"), BenchAccuracy(**EXACT)
    hits = dict.fromkeys((0.0, 1e-6), 0)
    for _ in range(40):
        bench = FakeBench(u0_v=2.5 + rng.uniform(0, 1e-6), lsb_v=1e-6, setting_error_deg=0.0, rng=rng)
        p, params = PROCEDURES["turns"], TurnsParams(readings=1)
        result = p.run(bench, params)
        truth = {**ARTICLE, "u0_v": bench.u0_v}
        for step_v in hits:
            section = Section(label="", result=expand_result(result, p, params, exact, step_v), truth=truth)
            hits[step_v] += sum(abs(g.en or 0.0) <= 1.0 for g in grade(section) if g.estimate.name == "u0_v")
    assert hits[0.0] == 0
    assert hits[1e-6] >= 36


def test_an_accuracy_that_is_negative_is_refused() -> None:
    for name in asdict(BenchAccuracy()):
        with pytest.raises(ValueError, match=f"{name}: expected 0 or more, got -1"):
            BenchAccuracy(**{name: -1.0})
