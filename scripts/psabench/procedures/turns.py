"""Test turns, eqs (1)-(11) of the article: each axis of the sensor along gravity and against it.

Half the sum of the two readings is the zero signal, half the difference the coefficient. What comes out is
referred to the head: with a mounting error alpha0 eq. (8) returns ky cos alpha0 + kx sin alpha0, which for
the article's sensor is 0.0118 and not 0.0098 V/g.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.errors import expected
from psabench.estimate import model
from psabench.estimate.angles import wrapped_deg
from psabench.estimate.face import Face
from psabench.estimate.uncertainty import Correlation, Estimate, estimate, not_identifiable
from psabench.procedures.head_bench import HeadBench, Reading, Watch
from psabench.procedures.result import Array, FaceSeries, ProcedureResult, option
from psabench.procedures.series import read_position, wander_doubts


@dataclass(frozen=True, slots=True, kw_only=True)
class Pair:
    """Two positions 180 deg apart: the axis along gravity (reads +g), then against it."""

    axis: str  # of the sensor
    face: Face
    along_deg: float
    against_deg: float
    moved: str  # axis of the sensor that a small turn of the head moves out of the horizontal
    tilt: int  # +1: towards gravity where the axis is along it, -1: away from it


PAIRS = (
    # fig. 2; the text prints a_x = -g twice
    Pair(axis="x", face=Face.DIRECT, along_deg=270.0, against_deg=90.0, moved="y", tilt=-1),
    Pair(axis="y", face=Face.DIRECT, along_deg=180.0, against_deg=0.0, moved="x", tilt=1),  # fig. 3
    # fig. 4: about Oy, which then lies along the head
    Pair(axis="z", face=Face.SIDE, along_deg=180.0, against_deg=0.0, moved="x", tilt=1),
)


def pairs_of_channel(channel: str) -> tuple[Pair, ...]:
    """Of a sensor of a triad: its x is the case's axis of that name, its y and z are the next ones in turn.

    The same six positions, so that one pass measures all three: each is along gravity once and against it once.
    """
    shift = "xyz".index(channel)

    def named(axis: str) -> str:
        return "xyz"[("xyz".index(axis) - shift) % 3]

    by_axis = [replace(p, axis=named(p.axis), moved=named(p.moved)) for p in PAIRS]
    return tuple(sorted(by_axis, key=lambda p: p.axis))


SEARCH_POINTS = 5


@dataclass(frozen=True, slots=True, kw_only=True)
class TurnsParams:
    """Parameters of `turns`."""

    axis: str = option("x", "", "channel of the board that the accelerometer is wired to: x, y or z")
    realisations: int = option(5, "", "repetitions, n of eqs (4), (5), (8), (11)")
    readings: int = option(16, "", "readings at each position, averaged")
    search_deg: float = option(0.0, "deg", "search range about the vertical for the extreme output of Ox; 0: no search")
    dwell_s: float = option(0.0, "s", "extra rest at each position before it is read")

    def __post_init__(self) -> None:
        if self.axis not in ("x", "y", "z"):
            raise ValueError(expected("x, y or z", repr(self.axis), "axis"))
        if self.realisations < 2:
            raise ValueError(expected("at least 2 (for an interval)", self.realisations, "realisations"))
        if self.readings < 1:
            raise ValueError(expected("at least 1", self.readings, "readings"))
        if not 0.0 <= self.search_deg <= 10.0:
            raise ValueError(expected("0 to 10 deg (a parabola is fitted)", self.search_deg, "search_deg"))
        if self.dwell_s < 0.0:
            raise ValueError(expected("0 or more", self.dwell_s, "dwell_s"))


def turns(bench: HeadBench, p: TurnsParams, watch: Watch | None = None) -> ProcedureResult:
    """Measure the six positions p.realisations times and estimate. Errors and Ctrl-C as in `fourier`."""
    watch = watch or Watch()
    readings: list[Reading] = []

    def fit() -> Sequence[Estimate]:
        return fit_turns(readings, p, bench.g_mps2).estimates

    for face in (Face.DIRECT, Face.SIDE):
        angles = [a for pair in PAIRS if pair.face is face for a in _angles(pair, p.search_deg)]
        bench.mount(face)
        with watch.progress.step(f"test turns, face {face.value}", p.realisations * len(angles)) as done:
            for realisation in range(p.realisations):
                for set_deg in angles:
                    readings += read_position(bench, watch, face, set_deg, p.axis, p.readings, p.dwell_s, realisation)
                    done()
                watch.estimate(readings, fit)
    return estimate_turns(readings, p, bench.g_mps2)


def _angles(pair: Pair, search_deg: float) -> list[float]:
    offsets = np.linspace(-search_deg, search_deg, SEARCH_POINTS) if _searched(pair, search_deg) else [0.0]
    return [centre + float(d) for centre in (pair.along_deg, pair.against_deg) for d in offsets]


def _searched(pair: Pair, search_deg: float) -> bool:
    return pair.axis == "x" and search_deg > 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class _Halves:
    """One pair over its n complete realisations, each array of shape (n,)."""

    sum_v: Array  # half the sum: zero signal
    diff_v: Array  # half the difference: coefficient x g


def estimate_turns(readings: Sequence[Reading], p: TurnsParams, g_mps2: float) -> ProcedureResult:
    """The estimates of `turns`. Pure.

    Pairs that are missing (interrupted run) are left out with a note; raises ValueError when Ox has fewer
    than two complete realisations.
    """
    return replace(fit_turns(readings, p, g_mps2), doubts=wander_doubts(readings, drift=False))


def fit_turns(
    readings: Sequence[Reading], p: TurnsParams, g_mps2: float, pairs: Sequence[Pair] = PAIRS
) -> ProcedureResult:
    """The same without a look for a zero that wanders, which takes longer than all else."""
    halves: dict[str, _Halves] = {}
    notes: list[str] = []
    for pair in pairs:
        kx_v_per_g = pair.tilt * float(halves["x"].diff_v.mean()) if pair.moved == "x" else 0.0
        h = _halves(readings, pair, p.search_deg, kx_v_per_g)
        if h.sum_v.size >= 2:
            halves[pair.axis] = h
        elif pair.axis == "x":
            raise ValueError(expected("at least 2 complete realisations of the x pair", h.sum_v.size))
        else:
            notes.append(f"no k{pair.axis}: {h.sum_v.size} complete realisations of its pair")
    estimates = _estimates(halves, pairs)
    series = tuple(
        _series(readings, face) for face in (Face.DIRECT, Face.SIDE) if any(r.face is face for r in readings)
    )
    names = tuple(e.name for e in estimates if e.name in ("u0_v", "kx_v_per_g", "ky_v_per_g", "kz_v_per_g"))
    return ProcedureResult(
        procedure="turns",
        axis=p.axis,
        g_mps2=g_mps2,
        readings=tuple(readings),
        series=series,
        estimates=tuple(estimates),
        correlation=Correlation(names=names, matrix=np.eye(len(names))),  # sums and differences share no noise
        residual_rms_v=float(np.sqrt(np.mean(np.concatenate([s.residual_v for s in series]) ** 2))),
        drift=None,
        notes=tuple(notes),
    )


def _halves(readings: Sequence[Reading], pair: Pair, search_deg: float, kx_v_per_g: float) -> _Halves:
    """Half sums and half differences of each realisation in which both positions were read.

    What the head says it missed the position by is taken out to first order: across gravity it enters times
    kx (with Ox along gravity not at all, and kx is 0 here for that pair).
    """
    reach_deg = (search_deg if _searched(pair, search_deg) else 0.0) + 1e-6
    at: dict[tuple[bool, int], list[Reading]] = {}
    for r in readings:
        for along, centre in ((True, pair.along_deg), (False, pair.against_deg)):
            if r.face is pair.face and abs(r.set_deg - centre) <= reach_deg:
                at.setdefault((along, r.realisation), []).append(r)
    complete = sorted({i for _, i in at if (True, i) in at and (False, i) in at})
    rows = []
    for i in complete:
        u1, e1 = _position(at[True, i], pair.along_deg, _searched(pair, search_deg))
        u2, e2 = _position(at[False, i], pair.against_deg, _searched(pair, search_deg))
        along_v, against_v = u1 - kx_v_per_g * e1, u2 + kx_v_per_g * e2
        rows.append(((along_v + against_v) / 2, (along_v - against_v) / 2))
    table = np.array(rows, dtype=np.float64).reshape(-1, 2)
    return _Halves(sum_v=table[:, 0], diff_v=table[:, 1])


def _position(readings: Sequence[Reading], centre_deg: float, searched: bool) -> tuple[float, float]:
    """Voltage of a position and how far off nominal it was, rad. When searched: the extreme of a parabola."""
    u_v = np.array([r.u_v for r in readings])
    off_rad = np.radians([wrapped_deg(r.alpha_deg - centre_deg) for r in readings])
    if not searched:
        return float(u_v.mean()), float(off_rad.mean())
    if np.unique(off_rad).size < SEARCH_POINTS:  # cut short: the nominal position alone
        near = np.abs(off_rad) == np.abs(off_rad).min()
        return float(u_v[near].mean()), float(off_rad[near].mean())
    scale = float(np.abs(off_rad).max())
    c2, c1, c0 = np.polyfit(off_rad / scale, u_v, 2)
    return float(c0 - c1 * c1 / (4 * c2)), 0.0


def _estimates(halves: Mapping[str, _Halves], pairs: Sequence[Pair]) -> list[Estimate]:
    """Eqs (4), (5), (8), (11); sd from the scatter of the realisations, pooled over the pairs."""
    x = halves["x"]
    u0_sd, k_sd, dof = _pooled_sd(halves, "sum_v"), _pooled_sd(halves, "diff_v"), _dof(halves)
    out = [estimate("u0_v", "u_0", "V", float(x.sum_v.mean()), u0_sd / math.sqrt(x.sum_v.size), dof)]
    sums, of_axis = [], {pair.axis: pair for pair in pairs}
    for axis, h in halves.items():
        other, sign = of_axis[axis].moved, of_axis[axis].tilt
        value, sd = float(h.diff_v.mean()), k_sd / math.sqrt(h.diff_v.size)
        e = estimate(f"k{axis}_v_per_g", f"k_{axis}", "V/g", value, sd, dof)
        what = f"k{axis} cos alpha0 {'+' if sign > 0 else '-'} k{other} sin alpha0"
        out.append(not_identifiable(e, f"this is {what}: test turns do not know alpha0"))
        symbol = f"k_{axis} cos α_0 {'+' if sign > 0 else '−'} k_{other} sin α_0"
        sums.append(estimate(f"k{axis}_sum_v_per_g", symbol, "V/g", value, sd, dof))
    for axis in ("y", "z"):
        if axis in halves:
            h = halves[axis]
            gap = float(h.sum_v.mean() - x.sum_v.mean())
            sd = u0_sd * math.sqrt(1 / h.sum_v.size + 1 / x.sum_v.size)
            sums.append(estimate(f"closure_{axis}_v", f"u_0({axis}) − u_0(x)", "V", gap, sd, dof))
    return out + sums


def _dof(halves: Mapping[str, _Halves]) -> int:
    return sum(h.sum_v.size - 1 for h in halves.values())


def _pooled_sd(halves: Mapping[str, _Halves], name: str) -> float:
    squares = sum(float(((v := getattr(h, name)) - v.mean()) @ (v - v.mean())) for h in halves.values())
    return math.sqrt(squares / _dof(halves))


def _series(readings: Sequence[Reading], face: Face) -> FaceSeries:
    """Readings of a face; the residual is against the mean of the position."""
    mine = [r for r in readings if r.face is face]
    u_v = np.array([r.u_v for r in mine])
    _, index, count = np.unique([r.set_deg for r in mine], return_inverse=True, return_counts=True)
    return FaceSeries(
        face=face,
        alpha_deg=np.array([r.alpha_deg for r in mine]),
        u_v=u_v,
        residual_v=u_v - (np.bincount(index, u_v) / count)[index],
        realisation=np.array([r.realisation for r in mine], dtype=np.int64),
        c_v=None,
    )


def expected_turns(truth: model.Sensor, at_side: model.Sensor) -> Mapping[str, float]:
    """What each estimate should have been: the harmonics at 0, 90, 180, 270 deg of the head (no search)."""
    c, side = model.harmonics_of(truth), model.harmonics_of(at_side, Face.SIDE)
    return {
        "u0_v": c[0] - c[4],  # holds kxx, as every turn in 1 g does
        "kx_v_per_g": truth.kx_v_per_g,
        "ky_v_per_g": truth.ky_v_per_g,
        "kz_v_per_g": truth.kz_v_per_g,
        "kx_sum_v_per_g": -c[1],
        "ky_sum_v_per_g": -c[2],
        "kz_sum_v_per_g": -side[2],
        "closure_y_v": 2 * c[4],
        "closure_z_v": side[0] + side[4] - (c[0] - c[4]),
    }


def expected_of_pairs(pairs: Sequence[Pair], truth: model.Sensor, at_side: model.Sensor) -> Mapping[str, float]:
    """The same of any sensor of a triad: model (1) at the two positions of each pair, turned by alpha0."""
    halves = {}
    for pair in pairs:
        sensor = truth if pair.face is Face.DIRECT else at_side
        along = {pair.axis: math.cos(sensor.alpha0_rad), pair.moved: pair.tilt * math.sin(sensor.alpha0_rad)}
        u1, u2 = (_output_v(sensor, {axis: sign * a for axis, a in along.items()}) for sign in (1.0, -1.0))
        halves[pair.axis] = ((u1 + u2) / 2, (u1 - u2) / 2)
    return {
        "u0_v": halves["x"][0],
        **{f"k{axis}_v_per_g": getattr(truth, f"k{axis}_v_per_g") for axis in halves},
        **{f"k{axis}_sum_v_per_g": half for axis, (_, half) in halves.items()},
        **{f"closure_{axis}_v": halves[axis][0] - halves["x"][0] for axis in halves if axis != "x"},
    }


def _output_v(s: model.Sensor, a_g: Mapping[str, float]) -> float:
    """Model (1) with its quadratic terms, inputs in g."""
    x, y, z = (a_g.get(axis, 0.0) for axis in "xyz")
    linear_v = s.kx_v_per_g * x + s.ky_v_per_g * y + s.kz_v_per_g * z
    squares_v = s.kxx_v_per_g2 * x * x + s.kyy_v_per_g2 * y * y + s.kzz_v_per_g2 * z * z
    return s.u0_v + linear_v + squares_v + s.kxy_v_per_g2 * x * y + s.kxz_v_per_g2 * x * z
