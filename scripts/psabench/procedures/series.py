"""What the Fourier procedure and the reversal share: a series of equal steps on one face, and its fit."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from psabench.errors import expected
from psabench.estimate import harmonics
from psabench.estimate.face import Face
from psabench.estimate.uncertainty import Estimate, lack_of_fit_p
from psabench.estimate.uncertainty import estimate as make_estimate
from psabench.estimate.wander import wander_p
from psabench.procedures.head_bench import HeadBench, Reading, Watch
from psabench.procedures.result import DEG, Array, FaceSeries, option

LACK_OF_FIT_P = 1e-3  # below this the report warns
WANDER_P = 1e-3  # below this the zero wanders
LOOKS = 8  # in a realisation


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesParams:
    """A series of the article: 5 realisations of 80 positions, 5 deg apart (400 deg of turn)."""

    axis: str = option("x", "", "channel of the board that the accelerometer is wired to: x, y or z")
    realisations: int = option(5, "", "repetitions of the whole series")
    positions: int = option(80, "", "positions in one series")
    step_deg: float = option(5.0, "deg", "turn of the head between positions")
    readings: int = option(1, "", "readings at each position")
    dwell_s: float = option(0.0, "s", "extra rest at each position before it is read")
    drift: bool = option(True, "", "fit a zero signal that drifts linearly in time")

    def __post_init__(self) -> None:
        if self.axis not in ("x", "y", "z"):
            raise ValueError(expected("x, y or z", repr(self.axis), "axis"))
        for name, least in (("realisations", 1), ("positions", 6), ("readings", 1)):
            if getattr(self, name) < least:
                raise ValueError(expected(f"at least {least}", getattr(self, name), name))
        if not 0.0 < abs(self.step_deg) < 180.0:
            raise ValueError(expected("0 to 180 deg, either way", self.step_deg, "step_deg"))
        if self.dwell_s < 0.0:
            raise ValueError(expected("0 or more", self.dwell_s, "dwell_s"))


EstimateRow = tuple[str, str, str, float]  # name, symbol, unit, scale from the core's unit
# What the harmonics of a face, or of a pair of them, are resolved into.
ONE_FACE: tuple[EstimateRow, ...] = (
    ("u0_v", "u_0", "V", 1.0),
    ("alpha0_deg", "α_0", "deg", DEG),
    ("kx_v_per_g", "k_x", "V/g", 1.0),
    ("ky_v_per_g", "k_y", "V/g", 1.0),
    ("kxy_v_per_g2", "k_xy", "V/g²", 1.0),
)


def estimates_of(table: Sequence[EstimateRow], values: Array, cov: Array, dof: int) -> list[Estimate]:
    """The estimates of a table from their values and covariance in the core's units."""
    rows = zip(table, values, np.diag(cov), strict=True)
    return [
        make_estimate(name, symbol, unit, v, math.sqrt(var), dof, scale) for (name, symbol, unit, scale), v, var in rows
    ]


def read_position(
    bench: HeadBench,
    watch: Watch,
    face: Face,
    set_deg: float,
    p_axis: str,
    count: int,
    dwell_s: float,
    realisation: int,
) -> list[Reading]:
    """Turn, rest, read; each reading is recorded before anything else happens."""
    alpha_deg = bench.turn(set_deg)
    if dwell_s > 0.0:
        bench.wait(dwell_s)
    start_s = bench.t_s
    u_v = bench.read(p_axis, count)
    each_s = (bench.t_s - start_s) / count
    taken = []
    for i, u in enumerate(u_v):
        r = Reading(
            t_s=start_s + (i + 0.5) * each_s,
            face=face,
            set_deg=set_deg,
            alpha_deg=alpha_deg,
            axis=p_axis,
            realisation=realisation,
            u_v=float(u),
        )
        watch.record(r)
        taken.append(r)
    return taken


def measure_face(
    bench: HeadBench,
    p: SeriesParams,
    face: Face,
    watch: Watch,
    look: Callable[[list[Reading]], None] = lambda _: None,
) -> list[Reading]:
    """All realisations on one face, eq. (16). look: gets what this face has, LOOKS times in each."""
    every = max(1, p.positions // LOOKS)
    bench.mount(face)
    taken: list[Reading] = []
    with watch.progress.step(f"series, face {face.value}", p.realisations * p.positions) as done:
        for realisation in range(p.realisations):
            for j in range(p.positions):
                set_deg = j * p.step_deg
                taken += read_position(bench, watch, face, set_deg, p.axis, p.readings, p.dwell_s, realisation)
                done()
                if (j + 1) % every == 0 or j + 1 == p.positions:
                    look(taken)
    return taken


@dataclass(frozen=True, slots=True, kw_only=True)
class FaceFit:
    """One face fitted: the numbers, and the series for the plots."""

    fit: harmonics.HarmonicFit
    series: FaceSeries
    lack_of_fit_p: float | None

    @property
    def drift(self) -> Estimate:
        """Linear drift of the zero signal, V/s."""
        f = self.fit
        return make_estimate(
            "drift_v_per_s", "du0/dt", "V/s", float(f.drift_vps), float(f.sigma_v) * f.drift_unit_sd_ps, f.dof
        )


def fit_face(readings: Sequence[Reading], face: Face, drift: bool) -> FaceFit:
    """Least squares over the positions of one face. Raises ValueError when they do not suffice.

    Readings of one position are averaged first: taken in a row they are correlated by the converter's filter, and as
    independent rows they would make the intervals too short.
    """
    at = [
        list(g) for _, g in groupby((r for r in readings if r.face is face), key=lambda r: (r.realisation, r.set_deg))
    ]
    alpha_deg = np.array([np.mean([r.alpha_deg for r in g]) for g in at], dtype=np.float64)
    u_v = np.array([np.mean([r.u_v for r in g]) for g in at], dtype=np.float64)
    t_s = np.array([np.mean([r.t_s for r in g]) for g in at], dtype=np.float64)
    set_deg = np.array([g[0].set_deg for g in at], dtype=np.float64)
    try:
        fit = harmonics.fit(np.radians(alpha_deg), u_v, t_s if drift else None)
    except ValueError as err:
        raise ValueError(f"face {face.value}: {err}") from err
    parameters = u_v.size - fit.dof
    series = FaceSeries(
        face=face,
        alpha_deg=alpha_deg,
        u_v=u_v,
        residual_v=fit.residual_v,
        realisation=np.array([g[0].realisation for g in at], dtype=np.int64),
        c_v=fit.c_v,
    )
    return FaceFit(fit=fit, series=series, lack_of_fit_p=lack_of_fit_p(fit.residual_v, set_deg, parameters))


def fit_notes(faces: Sequence[FaceFit]) -> list[str]:
    """Warnings that a reader needs whichever procedure the faces belong to."""
    low = {f.series.face.value: f.lack_of_fit_p for f in faces if f.lack_of_fit_p is not None}
    repeating = {name: p for name, p in low.items() if p < LACK_OF_FIT_P}
    if not repeating:
        return []
    return [
        f"face {', '.join(repeating)}: the residual repeats from turn to turn "
        f"(F test, p < {max(max(repeating.values()), 1e-15):.1e}); "
        "the model misses something that small, and the scatter does not contain it"
    ]


def wander_doubts(readings: Sequence[Reading], *, drift: bool) -> tuple[str, ...]:
    """Reason not to trust the intervals, (): none. drift: the procedure fits a zero that moves on a straight line."""
    found = {}
    for face, of_face in groupby(readings, key=lambda r: r.face):
        at = [list(g) for _, g in groupby(of_face, key=lambda r: (r.realisation, r.set_deg))]
        u_v, t_s = (np.array([np.mean([getattr(r, name) for r in g]) for g in at]) for name in ("u_v", "t_s"))
        _, position = np.unique([g[0].set_deg for g in at], return_inverse=True)
        p = wander_p(u_v, position, t_s if drift else None)
        if p is not None:
            found[face.value] = p
    low = [face for face, p in found.items() if p * len(found) < WANDER_P]
    if not low:
        return ()
    return (
        f"the zero wanders on face {', '.join(low)}: positions that are measured again are off by more than noise "
        "(p < 0.001), and the intervals do not contain that",
    )


def pooled_sigma_v(faces: Sequence[FaceFit]) -> tuple[float, int]:
    """Noise of one position (mean of its readings) over several faces, volts, and its degrees of freedom."""
    dof = sum(f.fit.dof for f in faces)
    return float(np.sqrt(sum(float((f.fit.residual_v**2).sum()) for f in faces) / dof)), dof


def residual_rms_v(faces: Sequence[FaceFit]) -> float:
    """Root mean square of all residuals, volts."""
    return float(np.sqrt(np.mean(np.concatenate([f.fit.residual_v for f in faces]) ** 2)))


def unit_cov(faces: Sequence[FaceFit]) -> Array:
    """Block diagonal of the faces' unit covariances: the faces share no reading."""
    n = harmonics.HARMONICS
    out = np.zeros((n * len(faces), n * len(faces)))
    for i, f in enumerate(faces):
        out[i * n : (i + 1) * n, i * n : (i + 1) * n] = f.fit.unit_cov
    return out
