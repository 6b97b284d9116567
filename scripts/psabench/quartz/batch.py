"""The law of a production batch, in NumPy and apart from the emulator's code: curves of the zero signal (fig. 2) and
instability from start to start over run-in (figs 5 and 8). Figures from a file of proto/batches.

The article gives two groups, ratios of 3 to 16 and the effect of run-in. Shares, sizes, tolerances: E0; form of the
curve and law of run-in: instruments 3.2 and 3.5, docs/instruments.md. A test compares this with the emulator's draws.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from psabench.errors import BadInput, expected, input_error
from psabench.places import proto_file
from psabench.quartz.draws import draw_source
from psabench.quartz.plate import NORMAL_DEGC, Array

Batch = Mapping[str, float]  # the numbers of a file, by key

SERIAL = "serial"
TRIES = 1000
RATIO_DEGC = np.arange(-60.0, 86.0)  # at which the ratio is taken
QUANTITIES = ("zero", "scale", "base")
UNITS = {"zero": "ug", "scale": "ppm", "base": "arcsec"}
GROUPS = ("a", "b", "rest")


def load_batch(name: str = SERIAL) -> Batch:
    """A batch of proto/batches by its name, or a file of the same keys. Raises BadInput."""
    import yaml

    shipped = not {"/", "."} & set(name)
    path = proto_file(f"batches/{name}.yaml") if shipped else Path(name)
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as e:
        raise input_error(path, "a batch of accelerometers", e) from None
    return _checked_numbers(found, None if shipped and name == SERIAL else list(load_batch()), path)


def _checked_numbers(found: Any, serial_keys: Sequence[str] | None, path: Path) -> Batch:
    """In the order of serial, which is that of the emulator's struct."""
    if not isinstance(found, dict):
        raise BadInput(expected("a mapping of keys to numbers", type(found).__name__, path))
    numbers = {k: v for k, v in found.items() if k != "name"}
    for key, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise BadInput(expected("a number", repr(value), f"{path}: {key}"))
    keys = list(numbers) if serial_keys is None else serial_keys
    for key in sorted(set(keys) ^ set(numbers), key=str):
        what = "no other keys than those of serial" if key in numbers else "a value"
        raise BadInput(expected(what, key if key in numbers else "none", f"{path}: {key}"))
    return {k: float(numbers[k]) for k in keys}


# ---- the zero signal against temperature: fig. 2


@dataclass(frozen=True, slots=True, kw_only=True)
class Curves:
    """Zero signals of settled units, run in: one row a unit in every array."""

    group: npt.NDArray[np.int_]  # index of GROUPS
    zero_ug: Array  # at 30 degC
    curve_ug: Array
    centre_degc: Array
    width_k: Array
    slope_ug_per_k: Array

    def at(self, degc: npt.ArrayLike) -> Array:
        """y(T) in ug, (units, temperatures): y(30) + A (x e(x) - x30 e(x30)) + k (T - 30), e(x) = exp((1 - x^2) / 2), x
        the distance from the centre in widths (instruments 3.2)."""
        degc = np.atleast_1d(np.asarray(degc, float))
        column = (self.curve_ug, self.centre_degc, self.width_k, self.zero_ug, self.slope_ug_per_k)
        curve_ug, centre_degc, width_k, zero_ug, slope = (c[:, None] for c in column)
        shape = _hump_at((degc - centre_degc) / width_k) - _hump_at((NORMAL_DEGC - centre_degc) / width_k)
        return np.asarray(zero_ug + curve_ug * shape + slope * (degc - NORMAL_DEGC))

    def ratio(self) -> Array:
        """Greatest size over the cycle to that at 30 degC: the article's 3 to 16."""
        return np.asarray(np.abs(self.at(RATIO_DEGC)).max(axis=1) / np.abs(self.zero_ug))


def _hump_at(x: Array) -> Array:
    return np.asarray(x * np.exp(0.5 * (1.0 - x * x)))


def draw_curves(b: Batch, seed: int, units: int) -> Curves:
    """Units of the batch; what lies beside its ratios is drawn again. Unit k is the same however many are drawn."""
    at = draw_source(seed, "batch group").random(units)
    group = np.where(at < b["share_a"], 0, np.where(at < b["share_a"] + b["share_b"], 1, 2))
    found = _tried_curves(b, seed, group, 0)
    for k in range(1, TRIES):
        ratio = found.ratio()
        outside = (ratio < b["ratio_min"]) | (ratio > b["ratio_max"])
        if not outside.any():
            return found
        found = _merge_curves(outside, _tried_curves(b, seed, group, k), found)
    raise BadInput(expected(f"curves with ratios of {b['ratio_min']:g} to {b['ratio_max']:g}", "none", "batch"))


def _merge_curves(where: npt.NDArray[np.bool_], new: Curves, old: Curves) -> Curves:
    return Curves(**{n: np.where(where, getattr(new, n), getattr(old, n)) for n in Curves.__dataclass_fields__})


def _tried_curves(b: Batch, seed: int, group: npt.NDArray[np.int_], number: int) -> Curves:
    units = len(group)

    def between(what: str, low: str, high: str) -> Array:
        return draw_source(seed, f"batch {what} {number}").uniform(b[low], b[high], units)

    def either_sign(what: str, size: Array) -> Array:
        return np.where(draw_source(seed, f"batch {what} sign {number}").random(units) < 0.5, size, -size)

    curve_ug = between("curve", "curve_min_ug", "curve_max_ug")
    line = either_sign("line", between("line", "rest_slope_min_ug_per_k", "rest_slope_max_ug_per_k"))
    slope = b["slope_ug_per_k"] * draw_source(seed, f"batch slope {number}").standard_normal(units)
    return Curves(
        group=group,
        zero_ug=either_sign("zero", between("zero", "zero_min_ug", "zero_max_ug")),
        curve_ug=curve_ug * np.array([1.0, -1.0, 0.0])[group],
        centre_degc=between("centre", "centre_min_degc", "centre_max_degc"),
        width_k=between("width", "width_min_k", "width_max_k"),
        slope_ug_per_k=np.where(group == 2, line, slope),
    )


# ---- instability from start to start: figs 5 and 8

_STRESS = {"zero": ("glue_ug", "start_ug"), "scale": ("glue_ppm", "start_ppm"), "base": ("glue_arcsec", "start_arcsec")}


def draw_instability(b: Batch, seed: int, units: int, cycles: int) -> Mapping[str, Array]:
    """|reading n - reading n-1| for n = 1 ... cycles, a thermal cycle and a start between two readings: (units, cycles)
    of each quantity, in its unit. The stress of the glue decays as q^n, a start scatters (instruments 3.5)."""
    shared = draw_source(seed, "batch glue").standard_normal(units)
    spread = b["glue_keep_spread"] * draw_source(seed, "batch keep").standard_normal(units)
    keep = np.minimum(b["glue_keep"] * np.exp(spread), 1.0)
    left = keep[:, None] ** np.arange(cycles + 1)
    found = {}
    for name, (glue, start) in _STRESS.items():
        own = draw_source(seed, f"batch glue {name}").standard_normal(units)
        z = np.sqrt(b["glue_correlation"]) * shared + np.sqrt(1.0 - b["glue_correlation"]) * own
        stress = b[glue] * np.exp(b["glue_spread"] * (z - 0.5 * b["glue_spread"]))
        # Each start from a source of its own: one more cycle shifts no other number.
        scatter = [draw_source(seed, f"batch start {name} {n}").standard_normal(units) for n in range(cycles + 1)]
        readings = stress[:, None] * left + b[start] * np.stack(scatter, axis=1)
        found[name] = np.abs(np.diff(readings, axis=1))
    return found
