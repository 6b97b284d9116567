"""What is wrong with a recording before anything is estimated from it, judged by the data alone.

Sensors that stick or saturate, axes in another order, a unit that does not turn.
"""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from psabench.sins.increments import Floats, Increments

Ints = npt.NDArray[np.int64]

CHANNELS = ("gyro x", "gyro y", "gyro z", "accelerometer x", "accelerometer y", "accelerometer z")
STUCK_S = 1.0  # of equal values where neighbours differ elsewhere
NOISY = 0.9  # share of neighbours that differ: from it on any such run says something
OUTSTANDS = 5  # else those that are this many times as long as the longest elsewhere: of counts with noise of one count
SATURATED = 5  # equal values in a row at the extreme of a channel
STILL_RADPS = np.radians(0.1)  # 24 times the Earth's rate
TURN_RAD = np.radians(30.0)  # that a recording needs before axes can be compared
LOOK_S = 600.0  # of the recording that axes are compared in: a drift of 0.5 deg/h is 5' then
WINDOW_RAD = np.radians(360.0)  # of turning that directions are compared in: errors of scale of 3e-3 are 1 deg
WRONG_RAD, RIGHT_RAD = np.radians(5.0), np.radians(2.5)
LEAST_MPS2 = 1.0  # of a mean of one second
LEAST_ROWS = 100


def findings(data: Increments) -> list[str]:
    """What makes an estimate from this recording wrong: a text each, none for a good one."""
    return [*_equal_values(data), *_no_turn(data), *_axes(data)]


def _runs(x: Floats) -> tuple[Ints, Ints]:
    """First row and length of each run of equal values."""
    first = np.flatnonzero(np.append(True, np.diff(x) != 0.0))
    return first.astype(np.int64), np.diff(np.append(first, len(x))).astype(np.int64)


def _equal_values(data: Increments) -> list[str]:
    found = []
    for name, x in zip(CHANNELS, np.hstack([data.dtheta_rad, data.dv_mps]).T, strict=True):
        first, length = _runs(x)
        if len(x) < LEAST_ROWS:
            continue
        extreme = np.abs(x[first]) == np.abs(x).max()
        limited = extreme & (length >= max(SATURATED, _least_run(length[~extreme], len(x))))
        if limited.any():
            count, at_s = int(length[limited].sum()), data.end_s[first[limited][0]]
            what = f"{name} is at its limit for {count} intervals, the first at {at_s:.2f} s: saturated"
            found.append(what)
            continue
        k = int(length.argmax())
        if length[k] * data.dt_s >= STUCK_S and length[k] >= _least_run(np.delete(length, k), len(x)):
            what = f"{name} sticks for {length[k] * data.dt_s:.2f} s from {data.end_s[first[k]]:.2f} s on"
            found.append(what)
    return found


def _least_run(length: Ints, rows: int) -> int:
    """Equal values in a row that say something where the runs elsewhere have these lengths; none do without noise."""
    if len(length) < rows / 10:
        return rows + 1
    return 1 if len(length) >= NOISY * int(length.sum()) else OUTSTANDS * int(length.max())


def _no_turn(data: Increments) -> list[str]:
    second = max(1, round(1.0 / data.dt_s))
    rows = len(data) // second * second
    if rows == 0:
        return [f"the recording has {len(data) * data.dt_s:.2f} s: expected 1 s or more"]
    rate = np.linalg.norm(data.dtheta_rad[:rows].reshape(-1, second, 3).mean(axis=1), axis=1) / data.dt_s
    if rate.max() >= STILL_RADPS:
        return []
    return [f"the unit does not turn: {np.degrees(rate.max()) * 3600:.0f} deg/h at most"]


def _product(turns: Rotation) -> Rotation:
    """Of all, in their order, in a tree."""
    while len(turns) > 1:
        odd = turns[-1:] if len(turns) % 2 else None
        turns = turns[0 : len(turns) - len(turns) % 2 : 2] * turns[1::2]
        turns = Rotation.concatenate([turns, odd]) if odd is not None else turns
    return turns[0]


def _attitudes(data: Increments) -> tuple[list[Rotation], Floats, Floats]:
    """By the gyros, at the middle of each second: against the beginning; how far it has turned, all turns added, (n,);
    and the mean specific force there, (n, 3)."""
    half = max(1, round(0.5 / data.dt_s))
    n = int(min(len(data), LOOK_S / data.dt_s)) // (2 * half)
    at, found, turned = Rotation.identity(), [], []
    so_far = 0.0
    for k in range(n):
        halves = [Rotation.from_rotvec(data.dtheta_rad[i * half : (i + 1) * half]) for i in (2 * k, 2 * k + 1)]
        products = [_product(x) for x in halves]
        at = at * products[0]
        found.append(at)
        at = at * products[1]
        so_far += sum(x.magnitude() for x in products)
        turned.append(so_far)
    force = data.dv_mps[: n * 2 * half].reshape(n, 2 * half, 3).mean(axis=1) / data.dt_s
    return found, np.array(turned), force


def _axes(data: Increments) -> list[str]:
    """At rest on the Earth the specific force keeps its direction in space: axes in another order break it.

    Looked at turn by turn: a scale error of 1e-3 is 4.5 deg after a cycle of 4500 deg, and no fault.
    """
    at, turned, force = _attitudes(data)
    if not at or max(x.magnitude() for x in at) < TURN_RAD:
        return []
    if np.linalg.norm(force, axis=1).min() < LEAST_MPS2:
        return [f"the accelerometers show less than {LEAST_MPS2:g} m/s^2: no gravity"]
    C = np.array([x.as_matrix() for x in at])
    turns = [np.flatnonzero(turned // WINDOW_RAD == k) for k in np.unique(turned // WINDOW_RAD)]
    error = {name: max(_wander_rad(C[k], force[k] @ matrix.T) for k in turns) for name, matrix in signed_axes()}
    as_given = error["+x +y +z"]
    best = min(error, key=lambda name: error[name])
    if as_given < WRONG_RAD:
        return []
    wander = f"the force wanders by {np.degrees(as_given):.0f} deg against the gyros' attitude"
    if error[best] > RIGHT_RAD:
        return [f"{wander}: the unit does not rest on a table"]
    return [f"{wander}: axes in another order; as {best} of the accelerometers they agree"]


def _wander_rad(C: Floats, force: Floats) -> float:
    """Largest angle between the force's direction, turned back, and its mean."""
    back = np.einsum("nij,nj->ni", C, force)
    back /= np.linalg.norm(back, axis=1)[:, None]
    mean = back.mean(axis=0)
    size = np.linalg.norm(mean)
    if size < 0.5:
        return float(np.pi)
    return float(np.arccos(np.clip(back @ mean / size, -1.0, 1.0)).max())


def signed_axes() -> list[tuple[str, Floats]]:
    """All 48 orders and signs of three axes: name as in a layout, (3, 3)."""
    found = []
    for order in itertools.permutations(range(3)):
        for signs in itertools.product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            found.append((" ".join(f"{'-+'[s > 0]}{'xyz'[i]}" for s, i in zip(signs, order, strict=True)), matrix))
    return found
