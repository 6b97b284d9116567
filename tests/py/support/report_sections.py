"""Sections of a calibration's report, made on the fake bench."""

from __future__ import annotations

from collections.abc import Mapping

from fake_bench import FakeBench, seeded
from psabench.procedures.fourier import FourierParams, fourier
from psabench.procedures.reversal import ReversalParams, reversal
from psabench.procedures.turns import TurnsParams, turns
from psabench.report.grading import Section

TRUTH = {
    "u0_v": 2.5,
    "alpha0_deg": 0.1121,
    "kx_v_per_g": 1.0,
    "ky_v_per_g": 0.0098,
    "kz_v_per_g": 0.004,
    "kxy_v_per_g2": 0.001,
    "reading_noise_v": 1e-3,  # names of the scenario that are no business of the estimators
}
SHORT = FourierParams(realisations=2, positions=40, step_deg=10.0)
SHORT_PAIR = ReversalParams(realisations=2, positions=40, step_deg=10.0)


def sections(truth: Mapping[str, float] | None = None) -> list[Section]:
    """Quiet and realistic Fourier, test turns, reversal."""
    rng = seeded("report")
    return [
        Section(label="quiet", result=fourier(FakeBench(noise_v=2e-9, rng=rng), FourierParams()), truth=truth),
        Section(label="realistic", result=fourier(FakeBench(noise_v=1e-3, rng=rng), SHORT), truth=truth),
        Section(
            label="realistic", result=turns(FakeBench(noise_v=1e-3, rng=rng), TurnsParams(readings=2)), truth=truth
        ),
        Section(label="realistic", result=reversal(FakeBench(noise_v=1e-3, rng=rng), SHORT_PAIR), truth=truth),
    ]
