"""Figures of a sensing element with their tolerances, each with its source and grade; the elements of a Monte Carlo.

The article has no dimension, no tolerance and no coefficient of E(T): but for the temperatures all figures are ours.
Those that a pendulum of the emulator has, too, are the same there (docs/instruments.md, instruments 3.1).
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.errors import BadInput, expected
from psabench.quartz.draws import draw_source
from psabench.quartz.plate import NORMAL_DEGC, Array, Material, Plate

COLD_DEGC, HOT_DEGC = -60.0, 85.0  # the article's thermal cycle
G_MPS2 = 9.80665


@dataclass(frozen=True, slots=True, kw_only=True)
class Figure:
    """A figure of an element: value and half the width of its tolerance, uniform; `normal`: its standard deviation."""

    name: str
    value: float
    tolerance: float
    unit: str
    about: str
    source: str
    grade: str
    low: float = 0.0  # the value may be nothing below, and the tolerance not reach it
    high: float = math.inf
    normal: bool = False


_ARTICLE_NAMES = "the article names it, without a figure"
_PENDULUM = "pendulum of the emulator, instruments 3.1"
_SPINNER = "Spinner 1962, +11 % between room and about 1100 degC on a parabola; slope at room from it"

FIGURES: tuple[Figure, ...] = (
    Figure(
        name="hinge_mm", value=1.0, tolerance=0.02, unit="mm", about="length of the hinges, tolerance D1",
        source=_ARTICLE_NAMES, grade="E0", high=5.0,
    ),
    Figure(
        name="width_mm", value=4.0, tolerance=0.02, unit="mm", about="sum of the hinges' widths, tolerance D2",
        source=_ARTICLE_NAMES, grade="E0", high=20.0,
    ),
    Figure(
        name="thickness_um", value=50.0, tolerance=2.0, unit="um", about="thickness of the hinges, tolerance D3",
        source="gives the pendulum's hinge, 3e-3 N m/rad", grade="E0", high=1000.0,
    ),
    Figure(
        name="arm_mm", value=8.5, tolerance=0.02, unit="mm",
        about="root of the hinges to the centre of mass, tolerance D4",
        source=f"{_PENDULUM}: 8 mm from their middle", grade="E0", high=50.0,
    ),
    Figure(
        name="neck_mm", value=2.0, tolerance=0.02, unit="mm", about="hinges to metal layer, tolerance D5",
        source=f"{_PENDULUM}: electrode at 8 mm", grade="E0", high=50.0,
    ),
    Figure(
        name="layer_mm", value=11.0, tolerance=0.02, unit="mm", about="length of the metal layer, tolerance D6",
        source=f"{_PENDULUM}: electrode at 8 mm", grade="E0", high=50.0,
    ),
    Figure(
        name="gap_um", value=20.0, tolerance=0.0, unit="um", about="gap of the pickoff", source=_PENDULUM, grade="E0",
        high=1000.0,
    ),
    Figure(
        name="mass_g", value=0.8, tolerance=0.0, unit="g", about="mass of the pendulum", source=_PENDULUM, grade="E0",
        high=100.0,
    ),
    Figure(
        name="spring_n_m_per_rad", value=0.334, tolerance=0.0, unit="N m/rad", about="electrical spring of (2)",
        source=_PENDULUM, grade="E0", high=100.0,
    ),
    Figure(
        name="modulus_gpa", value=72.0, tolerance=1.0, unit="GPa", about="Young's modulus at 30 degC",
        source="usual figure of fused quartz", grade="E0", low=1.0, high=1000.0,
    ),
    Figure(
        name="modulus_per_k", value=2.0e-4, tolerance=0.5e-4, unit="1/K",
        about="a / E(30) of E = a t + b: quartz glass stiffens with heat", source=_SPINNER, grade="derived",
        low=-1e-2, high=1e-2,
    ),
    Figure(
        name="expansion_per_k", value=0.5e-6, tolerance=0.1e-6, unit="1/K", about="linear expansion",
        source="usual figure of fused quartz", grade="E0", low=-1e-4, high=1e-4,
    ),
    Figure(
        name="position_urad", value=0.0, tolerance=2.0, unit="urad",
        about="position after sealing; the tolerance is a standard deviation", source="proto/batches/serial.yaml",
        grade="E0", low=-1000.0, high=1000.0, normal=True,
    ),
)  # fmt: skip

Figures = Mapping[str, Figure]


def change_figures(words: Sequence[str] = ()) -> Figures:
    """The figures with NAME=VALUE or NAME=VALUE:TOLERANCE of a command line. Raises BadInput that names the word."""
    found = {f.name: f for f in FIGURES}
    for word in words:
        name, _, text = word.partition("=")
        if name not in found:
            near = difflib.get_close_matches(name, found, 3)
            names = ", ".join(near or found)
            raise BadInput(expected(f"NAME=VALUE[:TOLERANCE] with a name of {names}", repr(word), "--set"))
        found[name] = _change_figure(found[name], text, f"--set {word}")
    return found


def _change_figure(f: Figure, text: str, where: str) -> Figure:
    value, _, tolerance = text.partition(":")
    try:
        new = replace(f, value=float(value), tolerance=float(tolerance) if tolerance else f.tolerance)
    except ValueError:
        raise BadInput(expected("a number, or two with a colon between them", repr(text), where)) from None
    if not (f.low <= new.value <= f.high and math.isfinite(new.value)):
        raise BadInput(expected(f"{f.low:g} to {f.high:g} {f.unit}", value, where))
    if not 0.0 <= new.tolerance < math.inf or (not f.normal and new.value - new.tolerance <= f.low):
        raise BadInput(expected(f"a tolerance that leaves the value above {f.low:g} {f.unit}", text, where))
    return new


def figure_lines(figures: Figures) -> Iterator[str]:
    """Of --list: value with tolerance, meaning, source, grade."""
    shown = {n: f"{n}={f.value:g}:{f.tolerance:g}" for n, f in figures.items()}
    width = max(map(len, shown.values()))
    for name, f in figures.items():
        yield f"  {shown[name]:{width}}  {f.unit}; {f.about} ({f.grade}: {f.source})"


# ---- drawn elements


@dataclass(frozen=True, slots=True, kw_only=True)
class Elements:
    """Elements in a column: every array is (elements, 1), so that temperatures broadcast along the rows."""

    plate: Plate  # at 30 degC
    material: Material
    position_rad: Array
    weight_n: Array
    spring_n_m_per_rad: Array

    def __len__(self) -> int:
        return len(self.position_rad)


def drawn_value(f: Figure, seed: int, count: int) -> Array:
    """One figure of `count` elements, (count, 1). Each figure has draws of its own, and element k is the same however
    many are drawn: a tolerance that changes shifts no other figure."""
    rng = draw_source(seed, f"element {f.name}")
    unit = rng.standard_normal(count) if f.normal else rng.uniform(-1.0, 1.0, count)
    return np.asarray(f.value + f.tolerance * unit)[:, None]


def draw_elements(figures: Figures, seed: int, count: int) -> Elements:
    """Elements with their tolerances."""
    return _elements_of({name: drawn_value(f, seed, count) for name, f in figures.items()})


def nominal_element(figures: Figures) -> Elements:
    """The one element without tolerances; its position off the null is one standard deviation."""
    values = {name: np.array([[f.value]]) for name, f in figures.items()}
    values["position_urad"] = values["position_urad"] + figures["position_urad"].tolerance
    return _elements_of(values)


def _elements_of(v: Mapping[str, Array]) -> Elements:
    modulus_pa = v["modulus_gpa"] * 1e9
    slope_pa_per_k = v["modulus_per_k"] * modulus_pa
    lengths = {name: v[f"{name}_mm"] * 1e-3 for name in ("hinge", "width", "arm", "neck", "layer")}
    lengths |= {name: v[f"{name}_um"] * 1e-6 for name in ("thickness", "gap")}
    return Elements(
        plate=Plate(**{f"{name}_m": value for name, value in lengths.items()}),
        material=Material(
            modulus_slope_pa_per_k=slope_pa_per_k,
            modulus_0_pa=modulus_pa - slope_pa_per_k * NORMAL_DEGC,
            expansion_per_k=v["expansion_per_k"],
        ),
        position_rad=v["position_urad"] * 1e-6,
        weight_n=v["mass_g"] * 1e-3 * G_MPS2,
        spring_n_m_per_rad=v["spring_n_m_per_rad"],
    )


def part_of(e: Elements, at: slice) -> Elements:
    """Some of them."""
    own = {n: getattr(e, n)[at] for n in ("position_rad", "weight_n", "spring_n_m_per_rad")}
    plate = Plate(**{n: getattr(e.plate, n)[at] for n in Plate.__dataclass_fields__})
    material = Material(**{n: getattr(e.material, n)[at] for n in Material.__dataclass_fields__})
    return Elements(plate=plate, material=material, **own)
