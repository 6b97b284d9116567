"""What a navigating unit gives out ("secondary information"): time, place, velocity, attitude, body rates; CSV files
of it.

A row at equal intervals: place and velocity (east, north) by the unit's own navigation, its attitude as a quaternion
of C_nb (b to east, north, up) or as heading, pitch and roll of right, forward, up, and the mean body rates in
inertial space since the row before.
"""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psabench.errors import BadInput, expected, input_error
from psabench.link.own import replace_file
from psabench.native.strapdown import Floats
from psabench.sins.increments import Increments

PLAIN = ("t_s", "lat_deg", "lon_deg", "ve_mps", "vn_mps")
QUATERNION = ("q0", "q1", "q2", "q3")  # scalar first
ANGLES = ("heading_deg", "pitch_deg", "roll_deg")
RATES = ("wx_degps", "wy_degps", "wz_degps")
COLUMNS = (*PLAIN, *QUATERNION, *RATES)
FORMATS = ("%.3f", "%.10f", "%.10f", "%.5f", "%.5f", *["%.9f"] * 4, *["%.8f"] * 3)
MOST_TURN_RAD = 0.2  # between rows: beyond it coefficients are too coarse
NORM = 1e-3  # that a quaternion may be off unity
DISAGREE_RADPS = math.radians(
    0.1
)  # of attitude and rates, median: the Earth's rate is 0.004 deg/s, drifts are far less


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """Where the table is."""

    lat_rad: float
    lon_rad: float
    h_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Outputs:
    """n rows, one behind the other."""

    t_s: Floats
    dt_s: float
    lat_rad: Floats
    lon_rad: Floats
    v_mps: Floats  # (n, 2) east, north
    c_nb: Floats  # (n, 3, 3)
    w_b_radps: Floats  # (n, 3) means since the row before

    def __len__(self) -> int:
        return len(self.t_s)


def read_outputs(path: Path) -> Outputs:
    """A file of COLUMNS, or with ANGLES for the quaternion. Raises BadInput with the file, and the row or the
    column."""
    names, numbers = _read_table(path)
    columns = {name: numbers[:, k] for k, name in enumerate(names)}
    attitude = QUATERNION if set(QUATERNION) <= set(names) else ANGLES
    bad = [name for name, column in columns.items() if not np.isfinite(column).all()]
    if bad:
        raise BadInput(expected("finite numbers", f"others in column {bad[0]}", path))
    missing = [n for n in (*PLAIN, *attitude, *RATES) if n not in columns]
    if missing:
        raise BadInput(expected(f"columns {', '.join(COLUMNS)}", f"no {missing[0]}", path))
    turned = np.column_stack([columns[n] for n in attitude])
    rates = np.radians(np.column_stack([columns[n] for n in RATES]))
    v = np.column_stack([columns["ve_mps"], columns["vn_mps"]])
    grid = Increments.of(columns["t_s"], rates, np.column_stack([v, columns["lat_deg"]]), where=path)
    _check_turns(rates, grid.dt_s, path)
    return Outputs(
        t_s=grid.end_s,
        dt_s=grid.dt_s,
        lat_rad=np.radians(columns["lat_deg"]),
        lon_rad=np.radians(columns["lon_deg"]),
        v_mps=v,
        c_nb=_of_quaternions(turned, path) if attitude == QUATERNION else _of_angles(np.radians(turned)),
        w_b_radps=rates,
    )


def _read_table(path: Path) -> tuple[list[str], Floats]:
    try:
        with path.open(encoding="utf-8-sig") as file:
            names = [n.strip() for n in file.readline().split(",")]
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # of an empty file, which is refused below
                numbers = np.loadtxt(file, delimiter=",", ndmin=2)
    except OSError as e:
        raise input_error(path, "outputs of a unit in CSV", e) from e
    except (ValueError, UnicodeDecodeError) as e:
        raise BadInput(expected("a head of names and rows of numbers", " ".join(str(e).split())[:120], path)) from e
    if numbers.shape[0] < 2 or numbers.shape[1] != len(names):
        raise BadInput(expected(f"2 rows or more of {len(names)} numbers", f"{numbers.shape}", path))
    return names, numbers


def _check_turns(rates: Floats, dt_s: float, path: Path) -> None:
    most = float(np.linalg.norm(rates, axis=1).max()) * dt_s
    if most > MOST_TURN_RAD:
        got = f"{math.degrees(most):.0f} deg"
        raise BadInput(
            expected(f"rows that are {math.degrees(MOST_TURN_RAD):.0f} deg of a turn apart at most", got, path)
        )
    if most < math.radians(0.1) * dt_s:
        raise BadInput(
            expected("a unit that turns by more than 0.1 deg/s", f"{math.degrees(most / dt_s):.3f} deg/s", path)
        )


def check_axes(outputs: Outputs, where: object) -> None:
    """Raises BadInput where the rates do not turn the attitude: axes or signs in another order, attitude from n to
    b."""
    c = outputs.c_nb
    turn = np.swapaxes(c[:-1], 1, 2) @ c[1:]
    skew = 0.5 * np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], -1
    )
    off = float(np.median(np.linalg.norm(skew / outputs.dt_s - outputs.w_b_radps[1:], axis=1)))
    if off > DISAGREE_RADPS:
        got = f"a difference of {math.degrees(off):.2f} deg/s: axes in another order, or an attitude from n to b"
        raise BadInput(expected("body rates that turn the attitude", got, where))


def _of_quaternions(q: Floats, path: Path) -> Floats:
    norm = np.linalg.norm(q, axis=1)
    bad = np.flatnonzero(~(np.abs(norm - 1.0) < NORM))
    if len(bad):
        raise BadInput(expected("quaternions of length 1", f"{norm[bad[0]]:g} in row {bad[0] + 1}", path))
    return matrices_of(q / norm[:, None])


def matrices_of(q: Floats) -> Floats:
    """(n, 3, 3) of rows of unit quaternions, scalar first."""
    w, x, y, z = q.T
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
        [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
        [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(r, -1) for r in rows], -2)


def _of_angles(angles: Floats) -> Floats:
    h, p, r = angles.T
    sh, ch, sp, cp, sr, cr = np.sin(h), np.cos(h), np.sin(p), np.cos(p), np.sin(r), np.cos(r)
    rows = [
        [ch * cr + sh * sp * sr, sh * cp, ch * sr - sh * sp * cr],
        [ch * sp * sr - sh * cr, ch * cp, -sh * sr - ch * sp * cr],
        [-cp * sr, sp, cp * cr],
    ]
    return np.stack([np.stack(r, -1) for r in rows], -2)


def write_outputs(path: Path, outputs: Outputs) -> None:
    """A file of COLUMNS, whole or not at all. Raises OSError."""
    import io

    from scipy.spatial.transform import Rotation

    q = Rotation.from_matrix(outputs.c_nb).as_quat()[:, [3, 0, 1, 2]]
    place = np.degrees(np.column_stack([outputs.lat_rad, outputs.lon_rad]))
    rows = np.column_stack([outputs.t_s, place, outputs.v_mps, q, np.degrees(outputs.w_b_radps)])
    text = io.StringIO()
    np.savetxt(text, rows, fmt=list(FORMATS), delimiter=",", header=",".join(COLUMNS), comments="")
    replace_file(path, text.getvalue())
