"""What no reading of a calibration shows, as components of its uncertainty budget (GUM, type B).

Each influence disturbs the readings by one standard uncertainty, the procedure's own estimator runs again, and the
difference is the component: numerical sensitivities, GUM 5.1.3 note 2. One way for every procedure and every estimate.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from psabench.budget.accuracy import EXACT, BenchAccuracy
from psabench.budget.gum import expand_estimate
from psabench.estimate.face import Face
from psabench.estimate.uncertainty import Component
from psabench.procedures.head_bench import Reading
from psabench.procedures.registry import Procedure
from psabench.procedures.result import ProcedureResult

Array = npt.NDArray[np.float64]
Disturb = Callable[[Reading], Reading]

PATTERNS = 16  # of signs, one sign a position: their mean square is the sum over as many positions, of more about so
ROUNDING = 1e-6  # a component below this part of the scatter is a rounding of the differences
NEGLIGIBLE = 0.01  # a step below this part of the scatter is in the scatter


@dataclass(frozen=True, slots=True, kw_only=True)
class Influence:
    """One line of the budget: independent disturbances, each of one standard uncertainty."""

    name: str
    disturbs: tuple[Disturb, ...]
    mean: bool = False  # the mean square of the differences, not their sum


def _scale_by(ppm: float) -> Disturb:
    return lambda r: replace(r, u_v=r.u_v * (1.0 + ppm * 1e-6))


def _shift_by(uv: float) -> Disturb:
    return lambda r: replace(r, u_v=r.u_v + uv * 1e-6)


def _turn_by(arcsec: float, of: Callable[[Reading], float]) -> Disturb:
    return lambda r: replace(r, alpha_deg=r.alpha_deg + arcsec / 3600.0 * of(r))


def _on_face(face: Face) -> Callable[[Reading], float]:
    return lambda r: float(r.face is face)


def _sine_of(r: Reading) -> float:
    return math.sin(math.radians(r.alpha_deg))


def _cosine_of(r: Reading) -> float:
    return math.cos(math.radians(r.alpha_deg))


def bench_influences(a: BenchAccuracy, faces: Sequence[Face]) -> tuple[Influence, ...]:
    """Chain, temperature, head, for a unit that was mounted with these faces."""
    circle_arcsec = a.circle_arcsec / math.sqrt(2.0)  # of the sine and of the cosine, at a phase that is not known
    warm = (_scale_by(a.chain_gain_tc_ppm_per_k * a.chain_off_k), _shift_by(a.chain_zero_tc_uv_per_k * a.chain_off_k))
    return (
        Influence(name="chain gain", disturbs=(_scale_by(a.chain_gain_ppm),)),
        Influence(name="chain zero", disturbs=(_shift_by(a.chain_zero_uv),)),
        Influence(name="temperature", disturbs=warm),
        Influence(name="circle", disturbs=(_turn_by(circle_arcsec, _sine_of), _turn_by(circle_arcsec, _cosine_of))),
        Influence(name="mounting", disturbs=tuple(_turn_by(a.mount_arcsec, _on_face(f)) for f in faces)),
    )


def resolution_influence(readings: Sequence[Reading], step_v: float) -> Influence:
    """Rounding to step_v, which recurs whenever the head comes back to a position: rectangular, GUM F.2.2.1."""
    positions = sorted({(r.face.value, r.set_deg) for r in readings})
    u_v = step_v / math.sqrt(12.0)
    each = (dict(zip(positions, row * u_v, strict=True)) for row in _sign_patterns(len(positions)))
    return Influence(name="resolution", disturbs=tuple(_move_by(by_v) for by_v in each), mean=True)


def _sign_patterns(positions: int) -> Array:
    """Signs, shape (PATTERNS, positions), the same for every run: any PATTERNS columns in a row are orthogonal."""
    from scipy.linalg import hadamard

    rng = np.random.default_rng(0)
    blocks = [hadamard(PATTERNS)[rng.permutation(PATTERNS)] for _ in range(-(-positions // PATTERNS))]
    signs: Array = np.concatenate(blocks, axis=1)[:, :positions] * rng.choice((-1.0, 1.0), size=positions)
    return signs


def _move_by(by_v: dict[tuple[str, float], float]) -> Disturb:
    return lambda r: replace(r, u_v=r.u_v + by_v[r.face.value, r.set_deg])


def expand_result(
    result: ProcedureResult, procedure: Procedure, params: Any, accuracy: BenchAccuracy, step_v: float
) -> ProcedureResult:
    """The result with a budget behind each estimate. `step_v`: resolution of one reading at the load."""

    def estimate_again(disturb: Disturb) -> Array:
        again = procedure.fit([disturb(r) for r in result.readings], params, result.g_mps2)
        return np.array([e.value for e in again.estimates])

    values = np.array([e.value for e in result.estimates])
    rows = [(i.name, _component_u(i, estimate_again, values)) for i in _influences_of(result, accuracy, step_v)]
    estimates = [
        expand_estimate(e, [Component(name=name, u=float(u[k])) for name, u in rows if u[k] > ROUNDING * e.sd])
        for k, e in enumerate(result.estimates)
    ]
    return replace(result, estimates=tuple(procedure.flag(estimates, params)))


def _influences_of(result: ProcedureResult, accuracy: BenchAccuracy, step_v: float) -> Iterator[Influence]:
    if step_v > NEGLIGIBLE * result.residual_rms_v:
        yield resolution_influence(result.readings, step_v)
    if accuracy != BenchAccuracy(**EXACT):
        yield from bench_influences(accuracy, sorted({r.face for r in result.readings}, key=lambda f: f.value))


def _component_u(i: Influence, estimate_again: Callable[[Disturb], Array], values: Array) -> Array:
    """Standard uncertainty that an influence gives each estimate, shape of values."""
    squares: Array = sum(((estimate_again(d) - values) ** 2 for d in i.disturbs), np.zeros_like(values))
    u: Array = np.sqrt(squares / (len(i.disturbs) if i.mean else 1))
    return u
