"""Reversal: Fourier series on a face and on it turned by 180 deg about Ox, so that alpha0 and ky part.

Turning about Ox leaves a_x alone and changes the sign of a_y, so the sum of the two first harmonics holds kx
and alpha0, the difference ky; k_xx and k_yy sit in the zero and the second harmonic and cannot enter. A
second pair with the sensor on its side does the same for kz. What is called alpha0 is the angle of the axis
of that turn: see docs/procedures/reversal.md.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.estimate import model
from psabench.estimate.face import Face
from psabench.estimate.uncertainty import Correlation, Estimate, correlation, propagate
from psabench.procedures.head_bench import HeadBench, Reading, Watch
from psabench.procedures.result import DEG, ProcedureResult, option
from psabench.procedures.series import (
    ONE_FACE,
    EstimateRow,
    FaceFit,
    SeriesParams,
    estimates_of,
    fit_face,
    fit_notes,
    measure_face,
    pooled_sigma_v,
    residual_rms_v,
    unit_cov,
    wander_doubts,
)

_UPRIGHT = (Face.DIRECT, Face.REVERSED)
_SIDE = (Face.SIDE, Face.SIDE_REVERSED)
_PAIR = (*ONE_FACE, ("kxx_minus_kyy_v_per_g2", "k_xx − k_yy", "V/g²", 1.0))
_SIDE_PAIR = (
    ("u0_side_v", "u_0 (side)", "V", 1.0),
    ("alpha0_side_deg", "α_0 (side)", "deg", DEG),
    ("kx_side_v_per_g", "k_x (side)", "V/g", 1.0),
    ("kz_v_per_g", "k_z", "V/g", 1.0),
    ("kxz_v_per_g2", "k_xz", "V/g²", 1.0),
    ("kxx_minus_kzz_v_per_g2", "k_xx − k_zz", "V/g²", 1.0),
)
REMOUNT_SD = 4.0  # faces whose alpha0 differ by more than this many standard deviations were not mounted alike


@dataclass(frozen=True, slots=True, kw_only=True)
class ReversalParams(SeriesParams):
    """Parameters of `reversal`."""

    side: bool = option(True, "", "also measure the two side faces, for kz")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReversalResult(ProcedureResult):
    """Result of `reversal`."""

    @property
    def quadratic_bound_v_per_g2(self) -> float:
        """Bound on |k_xx - k_yy| for `FourierParams`: the far end of its 95 % interval."""
        quad = self.get("kxx_minus_kyy_v_per_g2")
        return abs(quad.value) + quad.ci_half


def reversal(bench: HeadBench, p: ReversalParams, watch: Watch | None = None) -> ReversalResult:
    """Measure the faces one after the other and estimate. Errors and Ctrl-C as in `fourier`."""
    readings: list[Reading] = []
    before: tuple[Reading, ...] = ()
    watch = watch or Watch()

    def look(new: Sequence[Reading]) -> None:
        both = [*before, *new]
        watch.estimate(both, lambda: fit_reversal(both, p, bench.g_mps2).estimates)

    for face in (*_UPRIGHT, *(_SIDE if p.side else ())):
        before = tuple(readings)
        readings += measure_face(bench, p, face, watch, look)
    return estimate_reversal(readings, p, bench.g_mps2)


def estimate_reversal(readings: Sequence[Reading], p: ReversalParams, g_mps2: float) -> ReversalResult:
    """The estimates of `reversal`. Pure.

    A side pair that is missing (interrupted run) is left out with a note; raises ValueError when DIRECT and
    REVERSED do not suffice.
    """
    return replace(fit_reversal(readings, p, g_mps2), doubts=wander_doubts(readings, drift=p.drift))


def fit_reversal(readings: Sequence[Reading], p: ReversalParams, g_mps2: float) -> ReversalResult:
    """The same without a look for a zero that wanders, which takes longer than all else."""
    upright = [fit_face(readings, face, p.drift) for face in _UPRIGHT]
    side, notes = _side_faces(readings, p)
    faces = [*upright, *side]
    sigma_v, dof = pooled_sigma_v(faces)
    estimates, corr = _pair(upright, _PAIR, sigma_v, dof)
    if side:
        side_estimates, _ = _pair(side, _SIDE_PAIR, sigma_v, dof)
        estimates += side_estimates
        notes += _remount_notes(estimates)
    return ReversalResult(
        procedure="reversal",
        axis=p.axis,
        g_mps2=g_mps2,
        readings=tuple(readings),
        series=tuple(f.series for f in faces),
        estimates=tuple(estimates),
        correlation=corr,
        residual_rms_v=residual_rms_v(faces),
        drift=upright[0].drift if p.drift else None,
        notes=(*notes, *fit_notes(faces)),
    )


def _side_faces(readings: Sequence[Reading], p: ReversalParams) -> tuple[list[FaceFit], list[str]]:
    if not p.side:
        return [], []
    try:
        return [fit_face(readings, face, p.drift) for face in _SIDE], []
    except ValueError as err:
        return [], [f"no kz: {err}"]


def _pair(
    faces: Sequence[FaceFit], table: Sequence[EstimateRow], sigma_v: float, dof: int
) -> tuple[list[Estimate], Correlation]:
    c = np.concatenate([f.fit.c_v for f in faces])
    cov = propagate(model.reversal_jacobian(c), unit_cov(faces) * sigma_v**2)
    return estimates_of(table, model.reversal(c), cov, dof), correlation([row[0] for row in table], cov)


def _remount_notes(estimates: Sequence[Estimate]) -> list[str]:
    by_name = {e.name: e for e in estimates}
    a, b = by_name["alpha0_deg"], by_name["alpha0_side_deg"]
    if abs(a.value - b.value) <= REMOUNT_SD * math.hypot(a.sd, b.sd):
        return []
    return [
        f"alpha0 of the side pair differs by {(b.value - a.value) * 3600:.1f} arcsec: "
        "the faces do not repeat that well, and the intervals of alpha0, ky and kz do not contain it"
    ]


def expected_reversal(truth: model.Sensor, at_side: model.Sensor) -> Mapping[str, float]:
    """What each estimate should have been; u0 with the quadratic terms that no turn in 1 g removes."""
    alpha0_deg = truth.alpha0_rad * DEG
    return {
        "u0_v": truth.u0_v + (truth.kxx_v_per_g2 + truth.kyy_v_per_g2) / 2,
        "alpha0_deg": alpha0_deg,
        "kx_v_per_g": truth.kx_v_per_g,
        "ky_v_per_g": truth.ky_v_per_g,
        "kxy_v_per_g2": truth.kxy_v_per_g2,
        "kxx_minus_kyy_v_per_g2": truth.kxx_v_per_g2 - truth.kyy_v_per_g2,
        "u0_side_v": at_side.u0_v + (truth.kxx_v_per_g2 + truth.kzz_v_per_g2) / 2,
        "alpha0_side_deg": alpha0_deg,
        "kx_side_v_per_g": truth.kx_v_per_g,
        "kz_v_per_g": truth.kz_v_per_g,
        "kxz_v_per_g2": truth.kxz_v_per_g2,
        "kxx_minus_kzz_v_per_g2": truth.kxx_v_per_g2 - truth.kzz_v_per_g2,
    }
