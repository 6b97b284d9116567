"""From recordings to scale factor, zero signal and base error of each axis at each temperature.

Along gravity and against it, half the difference of an axis's readings is its scale factor, half the sum its zero; with
another axis along gravity, half the difference over the scale is the component of the misalignment towards that axis.
During a sweep the positions are recorded one after the other, at different temperatures: each is interpolated to one
instant a round, by cubics through the four nearest of its recordings. How far off that may be is measured, by leaving
out recordings: `Points.left_out`. Where curves of the quantities are known already, only what the readings differ from
them by is interpolated (`refined_points`): the turns of a sweep, which a cubic misses, are in the curves.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected
from psabench.estimate.face import Face
from psabench.thermal.records import Recording
from psabench.thermal.schedule import POSITIONS, SOAK, Position

Array = npt.NDArray[np.float64]

AXES = "xyz"
ARCSEC = float(np.degrees(1.0)) * 3600.0
LEFT_OUT = 2.0  # a gap twice as long: twice the error where the sweep turns, elsewhere up to 7 times
SIGNAL = 10.0  # times the scatter of a recording that an axis's reading of 1 g has at least
LEAST_VISITS = 6  # of a position in a sweep
TOP_K = 0.1  # noise of the chamber's reading
SIDE_FACES = (Face.SIDE, Face.SIDE_REVERSED)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Quantities:
    """Of the three axes, at n instants."""

    zero_ug: Array  # (n, 3)
    scale_v_per_g: Array  # (n, 3)
    base_arcsec: Array  # (n, 3, 3): of the axis, towards the axis; 0 towards itself

    def readings_v(self, position: Position) -> Array:
        """Of the axes in a position, (n, 3)."""
        along = np.eye(3)[position.axis] + self.base_arcsec[:, :, position.axis] / ARCSEC
        return np.asarray(self.scale_v_per_g * (self.zero_ug * 1e-6 + position.sign * along))


Curves = Callable[[Array], Quantities]  # at instants, s, (n,)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LeftOut:
    """Guesses of a sweep's readings by their neighbours, less the readings: mean squares, V^2.

    The two positions of a pair are recorded one after the other, so their errors are nearly the same: they add up in
    half the sum and cancel in half the difference.
    """

    half_sum_v2: Array  # (3,) of an axis that is vertical
    half_diff_v2: Array  # (3, 3) of the axis, with the other one vertical
    most_v2: Array  # (3,) the largest of half_sum_v2
    noise_part: float  # of a reading's variance that is in a guess less the reading
    dof: float  # of these mean squares; neighbours share readings


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Points:
    """What one segment gives: n instants."""

    segment: str
    t_s: Array  # (n,)
    case_c: Array  # (n,)
    zero_ug: Array  # (n, 3)
    scale_v_per_g: Array  # (n, 3)
    base_arcsec: Array  # (n, 3, 3): of the axis, towards the axis; 0 towards itself
    scatter_v: Array  # (3,) standard deviation of one recording, rms over the segment
    left_out: LeftOut | None  # None: of a soak
    noise_covariance: Array  # (3, n, n) of the points for readings of variance 1, by the axis that is vertical
    history: tuple[Array, Array]  # t_s and case_c of all recordings, (m,) each
    samples: int  # of a recording
    turn_s: float  # when the chamber has reached the top of a sweep; the last instant of a soak
    notes: tuple[str, ...] = ()

    @property
    def interpolation_v(self) -> Array:
        """Of the half sum of an axis's two readings, rms, (3,)."""
        return self._interpolation(self.left_out.half_sum_v2) if self.left_out else np.zeros(3)

    @property
    def interpolation_most_v(self) -> Array:
        """The same, the largest, (3,)."""
        return self._interpolation(self.left_out.most_v2) if self.left_out else np.zeros(3)

    def _interpolation(self, squares_v2: Array) -> Array:
        assert self.left_out
        return left_out_error(squares_v2, self.scatter_v / 2.0**0.5, self.left_out.noise_part)

    @property
    def up(self) -> npt.NDArray[np.bool_]:
        """Which instants are on the way up, (n,)."""
        return np.asarray(self.t_s <= self.turn_s)

    def quantity(self, name: str) -> Array:
        """By the name of its estimate, (n,): zero_x_ug, scale_x_v_per_g, base_xy_arcsec."""
        kind, axes = name.split("_")[:2]
        i = AXES.index(axes[0])
        if kind == "base":
            return self.base_arcsec[:, i, AXES.index(axes[1])]
        return (self.zero_ug if kind == "zero" else self.scale_v_per_g)[:, i]


def quantity_names() -> list[str]:
    """Of the three axes."""
    base = [f"base_{a}{b}_arcsec" for a in AXES for b in AXES if a != b]
    return [f"zero_{a}_ug" for a in AXES] + [f"scale_{a}_v_per_g" for a in AXES] + base


def gravity_at(position: Position, alpha_deg: float) -> Array:
    """Projections of gravity on the axes of the case, g, (3,), at the angle that the head shows."""
    th = np.radians(alpha_deg)
    along, across = -np.sin(th), -np.cos(th)
    return np.array([along, 0.0, across] if position.face in SIDE_FACES else [along, across, 0.0])


def face_of(vertical: int) -> Face:
    """Of the mount, where this axis is vertical."""
    (face,) = {p.face for p in POSITIONS.values() if p.axis == vertical}
    return face


def turning_axes(vertical: int) -> tuple[int, ...]:
    """Axes in the plane in which the head turns the unit where this one is vertical; the other is along the head's."""
    return (0, 2) if face_of(vertical) in SIDE_FACES else (0, 1)


def refined_points(p: Points, recordings: Sequence[Recording], curves: Curves) -> Points:
    """The points of a sweep again, by curves that were fitted to them."""
    return replace(_sweep_points([r for r in recordings if r.segment == p.segment], curves), samples=p.samples)


def points_of(recordings: Sequence[Recording], samples: int = 1) -> dict[str, Points]:
    """By segment, in the order of the run. Raises BadInput where there are too few recordings."""
    segments: dict[str, list[Recording]] = {}
    for r in recordings:
        segments.setdefault(r.segment, []).append(r)
    of = {name: _soak_points if name == SOAK else _sweep_points for name in segments}
    found = {name: replace(of[name](rows), samples=samples) for name, rows in segments.items()}
    if not found:
        raise BadInput(expected("recordings", "none", "thermal run"))
    return found


# ---- positions


def _volts_of(r: Recording) -> Array:
    return np.array([r.x_v, r.y_v, r.z_v])


def _level_rows(rows: Sequence[Recording]) -> Array:
    """Readings as if the head had met each position, (n, 3): what its scale shows beside it is taken out."""
    u = np.array([_volts_of(r) for r in rows])
    at = [POSITIONS[r.position] for r in rows]
    scale = np.array([_rough_scale(u, at, i) for i in range(3)])
    _check_signal(u, at, scale, _scatter_of(rows))
    off = [gravity_at(p, r.alpha_deg) - p.sign * np.eye(3)[p.axis] for p, r in zip(at, rows, strict=True)]
    return np.asarray(u - np.array(off) * scale)


def _rough_scale(u: Array, at: Sequence[Position], i: int) -> float:
    rows = [(p.sign, v[i]) for p, v in zip(at, u, strict=True) if p.axis == i]
    down, up = ([v for sign, v in rows if sign == s] for s in (1.0, -1.0))
    if not down or not up:
        raise BadInput(expected(f"recordings with {AXES[i]} down and up", "one of them missing", "thermal run"))
    return float(np.mean(down) - np.mean(up)) / 2.0


def _check_signal(u: Array, at: Sequence[Position], scale: Array, scatter_v: Array) -> None:
    """Raises BadInput for an axis that does not see gravity: its readings change no more than they scatter."""
    here = np.array([[p.axis, p.sign] for p in at])
    for i, axis in enumerate(AXES):
        sd = max(float(np.std(u[(here == (i, sign)).all(axis=1), i])) for sign in (1.0, -1.0))
        least = sd + SIGNAL * float(scatter_v[i])
        if abs(scale[i]) <= least:
            wanted = f"more than {least:.2g} V/g, what its readings scatter by"
            raise BadInput(expected(wanted, f"{scale[i]:.2g} V/g", f"accelerometer {axis}"))


def _solve_positions(by: Mapping[str, Array]) -> tuple[Array, Array, Array]:
    """Readings (n, 3) of each position, of the same instants -> zero (ug), scale, base (arcsec)."""
    half_sum, half_diff = np.empty((3, *by["x_down"].shape)), np.empty((3, *by["x_down"].shape))
    for j, axis in enumerate(AXES):
        down, up = by[f"{axis}_down"], by[f"{axis}_up"]
        half_sum[j], half_diff[j] = (down + up) / 2.0, (down - up) / 2.0
    scale = np.stack([half_diff[i, :, i] for i in range(3)], axis=1)
    zero = np.stack([half_sum[i, :, i] for i in range(3)], axis=1) / scale * 1e6
    base = np.moveaxis(half_diff, 0, 2) / scale[:, :, None] * ARCSEC  # (n, axis, towards)
    base[:, range(3), range(3)] = 0.0
    return zero, scale, base


def _scatter_of(rows: Sequence[Recording]) -> Array:
    sd = np.array([(r.sd_x_v, r.sd_y_v, r.sd_z_v) for r in rows])
    return np.asarray(np.sqrt(np.mean(sd**2, axis=0)))


def _history_of(rows: Sequence[Recording]) -> tuple[Array, Array]:
    return np.array([r.t_s for r in rows]), np.array([r.case_degc for r in rows])


# ---- the two methods


def _soak_points(rows: Sequence[Recording]) -> Points:
    """A point a temperature; those that lack a position are left out, with a note."""
    level = _level_rows(rows)
    parts: dict[int, dict[str, int]] = {}
    for k, r in enumerate(rows):
        parts.setdefault(r.part, {})[r.position] = k
    whole = {part: at for part, at in parts.items() if len(at) == len(POSITIONS)}
    notes = [
        f"soak, temperature {part + 1}: no {', '.join(p for p in POSITIONS if p not in at)}; left out"
        for part, at in parts.items()
        if part not in whole
    ]
    if not whole:
        raise BadInput(expected("a temperature with all six positions", "none", SOAK))
    by = {p: np.array([level[at[p]] for at in whole.values()]) for p in POSITIONS}
    zero, scale, base = _solve_positions(by)
    t_s, case_c = _history_of(rows)
    each = [list(at.values()) for at in whole.values()]
    return Points(
        segment=SOAK,
        t_s=np.array([t_s[k].mean() for k in each]),
        case_c=np.array([case_c[k].mean() for k in each]),
        zero_ug=zero,
        scale_v_per_g=scale,
        base_arcsec=base,
        scatter_v=_scatter_of(rows),
        left_out=None,
        noise_covariance=np.stack([np.eye(len(whole))] * 3),
        history=(t_s, case_c),
        samples=1,
        turn_s=float(t_s[-1]),
        notes=tuple(notes),
    )


def _sweep_points(rows: Sequence[Recording], curves: Curves | None = None) -> Points:
    """A point a round, in its middle, where every position has been recorded before and after it."""
    level, (t_s, case_c) = _level_rows(rows), _history_of(rows)
    name = rows[0].segment
    visits = {p: [k for k, r in enumerate(rows) if r.position == p] for p in POSITIONS}
    few = [p for p, at in visits.items() if len(at) < LEAST_VISITS]
    if few:
        raise BadInput(expected(f"{LEAST_VISITS} recordings of each position", f"fewer of {', '.join(few)}", name))
    rounds: dict[int, list[int]] = {}
    for k, r in enumerate(rows):
        rounds.setdefault(r.part, []).append(k)
    middle = np.array([(t_s[at[0]] + t_s[at[-1]]) / 2.0 for at in rounds.values()])
    first, last = max(t_s[at[0]] for at in visits.values()), min(t_s[at[-1]] for at in visits.values())
    middle = middle[(middle >= first) & (middle <= last)]
    by, rest = {}, {}
    for p, at in visits.items():
        rest[p] = level[at] - (curves(t_s[at]).readings_v(POSITIONS[p]) if curves else 0.0)
        by[p] = interpolate_cubic(t_s[at], rest[p], middle)
        by[p] += curves(middle).readings_v(POSITIONS[p]) if curves else 0.0
    zero, scale, base = _solve_positions(by)
    return Points(
        segment=name,
        t_s=middle,
        case_c=np.interp(middle, t_s, case_c),
        zero_ug=zero,
        scale_v_per_g=scale,
        base_arcsec=base,
        scatter_v=_scatter_of(rows),
        left_out=_left_out({p: (left_out_weights(t_s[at]), rest[p]) for p, at in visits.items()}),
        noise_covariance=_noise_covariance({p: cubic_matrix(t_s[at], middle) for p, at in visits.items()}),
        history=(t_s, case_c),
        samples=1,
        turn_s=_turn_of(rows),
    )


def _turn_of(rows: Sequence[Recording]) -> float:
    shown = np.array([r.chamber_degc for r in rows])
    return rows[int(np.argmax(shown >= shown.max() - TOP_K))].t_s


def _noise_covariance(weights: Mapping[str, Array]) -> Array:
    """By each position's weights of interpolation, (n, m)."""
    each = {p: w @ w.T for p, w in weights.items()}
    return np.array([(each[f"{axis}_down"] + each[f"{axis}_up"]) / 2.0 for axis in AXES])


def _left_out(visits: Mapping[str, tuple[Array, Array]]) -> LeftOut:
    """By each position's weights, (m - 2, m), and readings, (m, 3); a round has both positions of a pair."""
    off = {p: weights @ u for p, (weights, u) in visits.items()}
    half_sum, half_diff, most = np.empty(3), np.empty((3, 3)), np.empty(3)
    for j, axis in enumerate(AXES):
        rounds = min(len(off[f"{axis}_down"]), len(off[f"{axis}_up"]))
        down, up = off[f"{axis}_down"][:rounds], off[f"{axis}_up"][:rounds]
        squares = ((down[:, j] + up[:, j]) / 2.0) ** 2
        half_sum[j], most[j] = squares.mean(), squares.max()
        half_diff[:, j] = (((down - up) / 2.0) ** 2).mean(axis=0)
    noise_part = float(np.mean([(weights**2).sum(axis=1).mean() for weights, _ in visits.values()]))
    dof = float(np.mean([_dof_of(weights @ weights.T) for weights, _ in visits.values()]))
    return LeftOut(half_sum_v2=half_sum, half_diff_v2=half_diff, most_v2=most, noise_part=noise_part, dof=dof)


def _dof_of(covariance: Array) -> float:
    """Of a sum of squares of numbers with that covariance, (n, n) (Satterthwaite)."""
    return float(np.trace(covariance) ** 2 / (covariance**2).sum())


def cubic_weights(t_s: Array, at_s: Array) -> tuple[npt.NDArray[np.int64], Array]:
    """The four nearest of the instants t_s (m,), and their weights at at_s (n,): (n, 4) each."""
    begin = np.clip(np.searchsorted(t_s, at_s) - 2, 0, len(t_s) - 4)
    near = begin[:, None] + np.arange(4)
    t = t_s[near]
    weights = np.ones_like(t)
    for j in range(4):
        for m in range(4):
            if m != j:
                weights[:, j] *= (at_s - t[:, m]) / (t[:, j] - t[:, m])
    return near, weights


def cubic_matrix(t_s: Array, at_s: Array) -> Array:
    """The same weights, of all of the instants, (n, m)."""
    near, weights = cubic_weights(t_s, at_s)
    found = np.zeros((len(at_s), len(t_s)))
    np.put_along_axis(found, near, weights, axis=1)
    return found


def interpolate_cubic(t_s: Array, u: Array, at_s: Array) -> Array:
    """Through the four nearest of the readings u (m, k) at t_s (m,); (n, k) at at_s (n,)."""
    near, weights = cubic_weights(t_s, at_s)
    return np.asarray(np.einsum("nj,njk->nk", weights, u[near]))


def left_out_weights(t_s: Array) -> Array:
    """Of the readings at t_s (m,), in what its neighbours give for each one less the reading, (m - 2, m): a gap twice
    as long."""
    found = -np.eye(len(t_s))[1:-1]
    for row, k in zip(found, range(1, len(t_s) - 1), strict=True):
        rest = np.flatnonzero(np.arange(len(t_s)) != k)
        near, weights = cubic_weights(t_s[rest], t_s[k : k + 1])
        row[rest[near[0]]] = weights[0]
    return found


def left_out_error(squares: npt.ArrayLike, noise: npt.ArrayLike, noise_part: float) -> Array:
    """How far off an interpolation may be, the same shape: without what noise of a reading does, over LEFT_OUT."""
    beyond = np.asarray(squares) - noise_part * np.asarray(noise) ** 2
    return np.asarray(np.sqrt(np.maximum(beyond, 0.0)) / LEFT_OUT)


def up_leg(p: Points) -> Points:
    """The part of a sweep on the way up."""
    cut = {n: getattr(p, n)[p.up] for n in ("t_s", "case_c", "zero_ug", "scale_v_per_g", "base_arcsec")}
    return replace(p, noise_covariance=p.noise_covariance[:, p.up][:, :, p.up], **cut)
