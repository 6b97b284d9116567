"""What a calibration of an inertial unit is used for: corrected rates and specific forces, in Python, as C, as a file.

Model, error = measured less true (docs/procedures/sins.md): w' = w + nu + Theta w;
f' = f + df + Gamma f + q f^2 + L(w) r, and the accelerometers are later than the gyros by `delay_s`. Applied backwards,
in this order: delay, bias, lever arms and quadratic term, matrix.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from psabench.errors import BadInput, expected, input_error
from psabench.sins.increments import Floats, Increments

KIND, VERSION = "psabench sins correction", 1
SHAPES: Mapping[str, tuple[int, ...]] = {
    "nu_radps": (3,),
    "theta": (3, 3),
    "df_mps2": (3,),
    "gamma": (3, 3),
    "quadratic_s2pm": (3,),
    "lever_m": (3, 3),
    "delay_s": (),
}
MOST: Mapping[str, float] = {"theta": 0.5, "gamma": 0.5, "delay_s": 1.0}  # beyond it a correction is none
MOST_OTHERS = 1e3


@dataclass(frozen=True, slots=True, kw_only=True)
class Correction:
    """Parameters of one unit; what is not known is zero."""

    nu_radps: Floats = field(default_factory=lambda: np.zeros(3))
    theta: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    df_mps2: Floats = field(default_factory=lambda: np.zeros(3))
    gamma: Floats = field(default_factory=lambda: np.zeros((3, 3)))
    quadratic_s2pm: Floats = field(default_factory=lambda: np.zeros(3))  # q: m/s^2 of error for f^2 in (m/s^2)^2
    lever_m: Floats = field(default_factory=lambda: np.zeros((3, 3)))  # row i: place of accelerometer i
    delay_s: float = 0.0

    @property
    def gyro_matrix(self) -> Floats:
        """K of w = K (w' - nu), (3, 3)."""
        return np.asarray(np.linalg.inv(np.eye(3) + self.theta), np.float64)

    @property
    def accel_matrix(self) -> Floats:
        """K of f = K (f' - df), (3, 3)."""
        return np.asarray(np.linalg.inv(np.eye(3) + self.gamma), np.float64)

    def apply(self, raw: Increments) -> Increments:
        """Increments without the unit's errors, as many and at the same instants."""
        dtheta = (raw.dtheta_rad - self.nu_radps * raw.dt_s) @ self.gyro_matrix.T
        force = rows_later(raw.dv_mps / raw.dt_s, self.delay_s / raw.dt_s) - self.df_mps2
        force -= lever_mps2(dtheta / raw.dt_s, raw.dt_s, self.lever_m)
        true = force @ self.accel_matrix.T
        for _ in range(2):  # what is left is of the order of q^3 f^4
            true = (force - self.quadratic_s2pm * true**2) @ self.accel_matrix.T
        return replace(raw, dtheta_rad=dtheta, dv_mps=true * raw.dt_s)


def rows_later(x: Floats, intervals: float) -> Floats:
    """Rows as they were `intervals` later, by the line between neighbours: x(t + delay)."""
    if intervals == 0.0:
        return x
    at = np.clip(np.arange(len(x)) + intervals, 0, len(x) - 1)
    low = np.minimum(at.astype(np.int64), len(x) - 2)
    part = (at - low)[:, None]
    return np.asarray(x[low] * (1.0 - part) + x[low + 1] * part)


def lever_mps2(w_radps: Floats, dt_s: float, lever_m: Floats) -> Floats:
    """L r: what accelerometer i at r_i feels beyond the unit's centre, [w x (w x r_i) + dw/dt x r_i]_i, (n, 3)."""
    if not lever_m.any():
        return np.zeros_like(w_radps)
    slope = np.gradient(w_radps, dt_s, axis=0)
    felt = np.empty_like(w_radps)
    for i, r in enumerate(lever_m):
        felt[:, i] = (np.cross(w_radps, np.cross(w_radps, r)) + np.cross(slope, r))[:, i]
    return felt


# ---- files


def correction_dict(c: Correction) -> dict[str, Any]:
    """Of JSON's types."""
    return {"kind": KIND, "version": VERSION} | {f.name: np.asarray(getattr(c, f.name)).tolist() for f in fields(c)}


def read_correction(path: Path) -> Correction:
    """Of a file, or of a report's result.json with one. Raises BadInput with the file and the key."""
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
    except OSError as e:
        raise input_error(path, "a calibration in JSON", e) from e
    except (UnicodeDecodeError, ValueError, RecursionError) as e:
        raise BadInput(expected("JSON", " ".join(str(e).split())[:160], path)) from e
    inside = _found_inside(found)
    if inside is None:
        raise BadInput(expected(f"a correction, kind {KIND!r}", "none", path))
    try:
        return correction_of(inside)
    except ValueError as e:
        raise BadInput(f"{path}: {e}") from e


def _found_inside(found: object, depth: int = 6) -> Mapping[str, Any] | None:
    """The first correction in a tree of JSON."""
    if depth == 0 or not isinstance(found, Mapping | list):
        return None
    if isinstance(found, Mapping) and found.get("kind") == KIND:
        return found
    inside = found.values() if isinstance(found, Mapping) else found
    return next((c for x in inside if (c := _found_inside(x, depth - 1)) is not None), None)


def correction_of(found: Mapping[str, Any]) -> Correction:
    """Raises ValueError with the key."""
    if type(found.get("version")) is not int or found["version"] != VERSION:
        raise ValueError(expected(str(VERSION), found.get("version"), "version"))
    unknown = [k for k in found if k not in SHAPES and k not in ("kind", "version")]
    if unknown:
        raise ValueError(expected(", ".join(SHAPES), unknown[0], "correction"))
    values: dict[str, Any] = {}
    for name, shape in SHAPES.items():
        if name in found:
            values[name] = _array(found[name], shape, name)
    return Correction(**values)


def _are_numbers(given: object) -> bool:
    """A number or lists of numbers; true and false are none."""
    if isinstance(given, list):
        return all(map(_are_numbers, given))
    return isinstance(given, int | float) and not isinstance(given, bool)


def _array(given: object, shape: tuple[int, ...], name: str) -> Floats | float:
    if not _are_numbers(given):
        raise ValueError(expected(f"numbers of shape {shape}", given, name))
    try:
        x = np.array(given, np.float64)
    except (TypeError, ValueError) as e:
        raise ValueError(expected(f"numbers of shape {shape}", given, name)) from e
    if x.shape != shape or not np.isfinite(x).all():
        raise ValueError(expected(f"finite numbers of shape {shape}", given, name))
    most = MOST.get(name, MOST_OTHERS)
    if np.abs(x).max() > most:
        raise ValueError(expected(f"elements within {most:g}", f"{np.abs(x).max():g}", name))
    if name in ("theta", "gamma") and np.linalg.matrix_rank(np.eye(3) + x) < 3:
        raise ValueError(expected("a matrix that, added to the unit matrix, has an inverse", given, name))
    return x if shape else float(x)


# ---- C

_HEADER = """\
/* Errors of an inertial unit, to be taken out of what it measures. Made by psabench {version}.
 * Frame: right-handed axes of the unit; C_nb of the navigation takes them to the local level. SI units, rad.
 *   gyros:          w = K_G (w' - B_G)
 *   accelerometers: f = K_A (f' - B_A - Q f^2 - L), lever arms L_i = [w x (w x r_i) + dw/dt x r_i]_i
 * Of increments over T: subtract B_G T and B_A T. Accelerometers are {delay:.9g} s later than gyros. */
#ifndef {guard}
#define {guard}

static const double {name}_gyro_bias_radps[3] = {{{nu}}};
static const double {name}_gyro_matrix[3][3] = {{{kg}}};
static const double {name}_accel_bias_mps2[3] = {{{df}}};
static const double {name}_accel_matrix[3][3] = {{{ka}}};
static const double {name}_accel_quadratic_s2pm[3] = {{{q}}};
static const double {name}_lever_m[3][3] = {{{r}}}; /* row: of accelerometer */
static const double {name}_delay_s = {delay:.17g};

/* Corrected rate or increment of angle: dt_s is 1 for a rate, else the interval. */
static inline void {name}_gyros(const double measured[3], double dt_s, double out[3])
{{
    for (int i = 0; i < 3; i++) {{
        out[i] = 0.0;
        for (int j = 0; j < 3; j++)
            out[i] += {name}_gyro_matrix[i][j] * (measured[j] - {name}_gyro_bias_radps[j] * dt_s);
    }}
}}

/* Corrected specific force or increment of velocity; subtract L dt_s before, delay it yourself. */
static inline void {name}_accelerometers(const double measured[3], double dt_s, double out[3])
{{
    double first[3];
    for (int pass = 0; pass < 3; pass++) {{
        for (int i = 0; i < 3; i++) {{
            out[i] = 0.0;
            for (int j = 0; j < 3; j++) {{
                const double f = pass ? first[j] / dt_s : 0.0;
                const double bias = {name}_accel_bias_mps2[j] + {name}_accel_quadratic_s2pm[j] * f * f;
                out[i] += {name}_accel_matrix[i][j] * (measured[j] - bias * dt_s);
            }}
        }}
        for (int i = 0; i < 3; i++) first[i] = out[i];
    }}
}}

#endif
"""


def _numbers(x: Floats) -> str:
    if x.ndim == 2:
        return ", ".join(f"{{{_numbers(row)}}}" for row in x)
    return ", ".join(f"{v:.17g}" for v in x)


def c_header(c: Correction, name: str) -> str:
    """The header's text; its names begin with `name`. Raises BadInput for one that C does not take."""
    from importlib.metadata import version

    from psabench.thermal.fixed_point import C_WORDS

    if not (name.isidentifier() and name.isascii()) or name in C_WORDS:
        raise BadInput(expected("a name of C", name, "header"))
    return _HEADER.format(
        version=version("psabench"),
        name=name,
        guard=f"{name.upper()}_H",
        nu=_numbers(c.nu_radps),
        kg=_numbers(c.gyro_matrix),
        df=_numbers(c.df_mps2),
        ka=_numbers(c.accel_matrix),
        q=_numbers(c.quadratic_s2pm),
        r=_numbers(c.lever_m),
        delay=c.delay_s,
    )
