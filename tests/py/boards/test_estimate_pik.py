"""Pulses to velocity: the article's figures, and counters that wrap."""

from __future__ import annotations

import numpy as np
import pytest
from psabench.boards.pik import estimate as pik

G_MPS2 = 9.8  # as the article has it


@pytest.mark.parametrize(
    ("tclk_s", "k_hz_per_v", "sv_mps", "ma_v_per_g"),
    [(1 / 3480, 174.0, 60e-3, 0.9387), (25e-6, 2000.0, 5e-3, 0.98)],
    ids=["PIK", "PIK-6"],
)
def test_figures_of_the_article(tclk_s: float, k_hz_per_v: float, sv_mps: float, ma_v_per_g: float) -> None:
    k = 10e3 / (20e3 * 10.0 * tclk_s)  # Rr / (RIN UREF TCLK)
    assert k == pytest.approx(k_hz_per_v, rel=1e-12)
    ma = G_MPS2 / (sv_mps * k)  # of which the article's printed weight speaks
    assert ma == pytest.approx(ma_v_per_g, rel=1e-4)
    assert pik.pulse_mps(k, ma, G_MPS2) == pytest.approx(sv_mps, rel=1e-12)
    assert pik.pulse_vs(k) * k == pytest.approx(1.0)


def test_one_scale_cannot_give_both_printed_weights() -> None:
    """0.96 V/g gives 58.7 and 5.10: the printed 60 and 5 are roundings, or the accelerometers were two."""
    assert pik.pulse_mps(174.0, 0.96, G_MPS2) * 1e3 == pytest.approx(58.7, abs=0.05)
    assert pik.pulse_mps(2000.0, 0.96, G_MPS2) * 1e3 == pytest.approx(5.10, abs=0.005)


def test_a_second_at_one_g() -> None:
    totals = [100, 100 + 982]  # 0.982 V/g, 1000 Hz/V
    v = pik.velocity_mps(totals, k_hz_per_v=1000.0, ma_v_per_g=0.982, g_mps2=9.81)
    assert v == pytest.approx([0.0, 9.81])


def test_counters_wrap_both_ways() -> None:
    top = 2**31 - 10
    counts = np.array([top, top + 15, top + 40, top - 5], dtype=np.int64)
    wrapped = (counts + 2**31) % 2**32 - 2**31
    assert wrapped.min() < 0
    totals = wrapped.astype(np.float64)
    assert pik.unwrapped(totals) == pytest.approx(counts.astype(float))
    assert pik.integral_vs(totals, 2000.0) == pytest.approx((counts - top) / 2000.0)
    assert pik.unwrapped([]).shape == (0,)
    small = np.array([30000, -30000, 29000], dtype=float)
    assert pik.unwrapped(small, bits=16) == pytest.approx([30000, 35536, 29000])
