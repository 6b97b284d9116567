"""Fourier calibration on a dividing head, eqs (12)-(18) of the article, as printed but for three repairs.

It measures u0, alpha0, kx, ky, kxy of model (1) from one face. What it measures well is C0..C4; alpha0 and ky
separately hang on C4, two microvolts for the article's sensor, and on k_xx = k_yy. docs/procedures/fourier.md
has the arithmetic; `reversal` is the procedure to trust.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.estimate import model
from psabench.estimate.face import Face
from psabench.estimate.uncertainty import Estimate, alpha0_doubt, correlation, not_identifiable, propagate
from psabench.procedures.head_bench import HeadBench, Reading, Watch
from psabench.procedures.result import DEG, ProcedureResult, option
from psabench.procedures.series import (
    ONE_FACE,
    FaceFit,
    SeriesParams,
    estimates_of,
    fit_face,
    fit_notes,
    measure_face,
    residual_rms_v,
    wander_doubts,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FourierParams(SeriesParams):
    """Parameters of `fourier`."""

    quadratic_bound_v_per_g2: float | None = option(
        None,
        "V/g^2",
        "known bound on |k_xx - k_yy| (the reversal measures it); without one alpha0 stays flagged",
    )


_MEASURED = (
    ("kx_eff_v_per_g", "√(k_x² + k_y²)", "V/g", 1.0),
    ("angle_deg", "α_0 + atan(k_y/k_x)", "deg", DEG),
    ("ky_sum_v_per_g", "k_y cos α_0 + k_x sin α_0", "V/g", 1.0),
    ("second_v_per_g2", "2√(C_3² + C_4²)", "V/g²", 1.0),
)
_COEFFICIENTS = tuple((f"c{i}_v", f"C_{i}", "V", 1.0) for i in range(5))


def fourier(bench: HeadBench, p: FourierParams, watch: Watch | None = None) -> ProcedureResult:
    """Measure p.realisations x p.positions on the direct face and estimate by eqs (14)-(18).

    Raises ValueError when the readings do not suffice, and lets through what the bench raises and
    KeyboardInterrupt: the readings taken until then have gone to `watch.record`.
    """
    watch = watch or Watch()

    def look(readings: Sequence[Reading]) -> None:
        watch.estimate(readings, lambda: fit_fourier(readings, p, bench.g_mps2).estimates[: len(ONE_FACE)])

    readings = measure_face(bench, p, Face.DIRECT, watch, look)
    return estimate_fourier(readings, p, bench.g_mps2)


def estimate_fourier(readings: Sequence[Reading], p: FourierParams, g_mps2: float) -> ProcedureResult:
    """The estimates of `fourier` from its readings. Pure; raises ValueError when they do not suffice."""
    return replace(fit_fourier(readings, p, g_mps2), doubts=wander_doubts(readings, drift=p.drift))


def fit_fourier(readings: Sequence[Reading], p: FourierParams, g_mps2: float) -> ProcedureResult:
    """The same without a look for a zero that wanders, which takes longer than all else."""
    face = fit_face(readings, Face.DIRECT, p.drift)
    c = face.fit.c_v
    values = np.concatenate([model.one_face(c), model.measured(c)[:4], c])
    jacobian = np.concatenate([model.one_face_jacobian(c), model.measured_jacobian(c)[:4], np.eye(5)])
    cov = propagate(jacobian, face.fit.unit_cov * float(face.fit.sigma_v) ** 2)
    table = (*ONE_FACE, *_MEASURED, *_COEFFICIENTS)
    flagged = flag_fourier(estimates_of(table, values, cov, face.fit.dof), p)
    shown = len(ONE_FACE)
    return ProcedureResult(
        procedure="fourier",
        axis=p.axis,
        g_mps2=g_mps2,
        readings=tuple(readings),
        series=(face.series,),
        estimates=tuple(flagged),
        correlation=correlation([row[0] for row in ONE_FACE], cov[:shown, :shown]),
        residual_rms_v=residual_rms_v([face]),
        drift=face.drift if p.drift else None,
        notes=tuple(_notes(face)),
    )


def flag_fourier(estimates: Sequence[Estimate], p: FourierParams) -> list[Estimate]:
    """What one face does not determine, by the interval of alpha0 and the known bound on k_xx - k_yy."""
    by_name = {e.name: e for e in estimates}
    doubt = alpha0_doubt(by_name["alpha0_deg"], by_name["kxy_v_per_g2"].value, p.quadratic_bound_v_per_g2)
    if not doubt:
        return list(estimates)
    reasons = {
        "alpha0_deg": doubt,
        "kx_v_per_g": "follows alpha0 through (18); sqrt(kx^2 + ky^2) is measured",
        "ky_v_per_g": "follows alpha0 through (18); ky cos alpha0 + kx sin alpha0 is measured",
        "kxy_v_per_g2": "hypot(kxy, k_xx - k_yy) is what one face measures",
    }
    return [not_identifiable(e, reasons[e.name]) if e.name in reasons else e for e in estimates]


def _notes(face: FaceFit) -> list[str]:
    c3, c4 = face.fit.c_v[3], face.fit.c_v[4]
    sd4 = float(face.fit.sigma_v) * math.sqrt(face.fit.unit_cov[4, 4])
    return [
        f"alpha0 is half the angle of C4 = {c4 * 1e6:.4g} uV (sd {sd4 * 1e6:.2g} uV) against C3 = {c3 * 1e3:.4g} mV",
        *fit_notes([face]),
    ]


def expected_fourier(truth: model.Sensor, _: model.Sensor) -> Mapping[str, float]:
    """What each estimate should have been: hidden parameters, and the combinations one face measures."""
    c = model.harmonics_of(truth)
    kx_eff, angle, ky_sum, second, _ = model.measured(c)
    return {
        "u0_v": c[0],  # u0 + (k_xx + k_yy)/2: no turn in 1 g can tell them apart
        "alpha0_deg": truth.alpha0_rad * DEG,
        "kx_v_per_g": truth.kx_v_per_g,
        "ky_v_per_g": truth.ky_v_per_g,
        "kxy_v_per_g2": truth.kxy_v_per_g2,
        "kx_eff_v_per_g": float(kx_eff),
        "angle_deg": float(angle) * DEG,
        "ky_sum_v_per_g": float(ky_sum),
        "second_v_per_g2": float(second),
        **{f"c{i}_v": float(c[i]) for i in range(5)},
    }
