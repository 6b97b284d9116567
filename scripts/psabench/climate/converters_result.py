"""`psabench run compare-converters --chamber`: the run, its drifts beside the true coefficients, as data and as text.

The truth is read after the run, for the grading alone: the coefficients of each unit's parts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psabench.bench import Bench
from psabench.boards.pik.device import Pik
from psabench.boards.psa2.device import Psa2
from psabench.boards.psd1.device import Psd1
from psabench.boards.unit import Unit
from psabench.budget.gum import COVERAGE
from psabench.climate import converters as measured
from psabench.climate.converters import SCALED, ChamberParams, Drift, Line, Soak
from psabench.emulator import read_resolved
from psabench.procedures.compare_converters import GENERATIONS, NAME
from psabench.procedures.comparison import ARTICLE, G_MPS2
from psabench.procedures.head_bench import Progress
from psabench.procedures.result import LIMIT_CI
from psabench.report.grading import aligned, finite_or_none, ratio_of

AXES = "XYZ"
Table = list[tuple[str, ...]]


# ---- the truth: what the straight lines should be, of each axis; None: no straight line


@dataclass(frozen=True, slots=True, kw_only=True)
class TrueDrift:
    """Of one unit, per K: zeros of X, Y, Z, V; scales of X, Z. None: the truth is no straight line."""

    zero_v_per_k: tuple[float | None, ...]
    scale_per_k: tuple[float | None, ...]


def _pik_truth(unit: Mapping[str, Any]) -> TrueDrift:
    of = unit["specimen"]
    return TrueDrift(
        zero_v_per_k=tuple(of[f"{a}_zero_tc_v_per_k"] for a in "xyz"),
        scale_per_k=tuple(of[f"{'xyz'[i]}_tc_ppm_per_k"] * 1e-6 for i in SCALED),
    )


def _psd1_truth(unit: Mapping[str, Any]) -> TrueDrift:
    """It calibrates itself at each temperature; the reference drifts."""
    return TrueDrift(zero_v_per_k=(0.0,) * 3, scale_per_k=(-float(unit["specimen"]["vref_tc_per_k"]),) * len(SCALED))


def _psa_truth(unit: Mapping[str, Any]) -> TrueDrift:
    chains = [unit["axes"][a]["afe"] for a in "xyz"]
    return TrueDrift(
        zero_v_per_k=tuple(c["buffer_offset_tc_v_per_k"] for c in chains),
        scale_per_k=tuple(1e-6 * (chains[i]["load_tc_ppm_per_k"] - chains[i]["divider_tc_ppm_per_k"]) for i in SCALED),
    )


TRUTHS: Mapping[type[Unit], Callable[[Mapping[str, Any]], TrueDrift]] = {
    Pik: _pik_truth,
    Psd1: _psd1_truth,
    Psa2: _psa_truth,
}
# What a ROM leaves of the drift, between its points and beyond them.
NO_LINE = TrueDrift(zero_v_per_k=(None,) * 3, scale_per_k=(None,) * len(SCALED))


def true_drift(name: str, unit: Mapping[str, Any]) -> TrueDrift:
    """Of a generation, from the truth of its unit."""
    find = TRUTHS.get(GENERATIONS[name].board)
    return find(unit) if find else NO_LINE


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """A line as found beside the true one."""

    what: str  # "zero X"
    line: Line
    truth_per_k: float | None

    @property
    def en(self) -> float | None:
        """Error over U."""
        if self.truth_per_k is None:
            return None
        return ratio_of(self.line.per_k - self.truth_per_k, self.line.per_k_expanded_u)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChamberComparison:
    """All of a run."""

    soaks: tuple[Soak, ...]
    drifts: tuple[Drift, ...]
    truths: Mapping[str, TrueDrift]
    facts: Mapping[str, str]

    def compared(self, d: Drift) -> list[Compared]:
        t = self.truths[d.name]
        zeros = zip(AXES, d.zero_v, t.zero_v_per_k, strict=True)
        scales = zip((AXES[i] for i in SCALED), d.scale, t.scale_per_k, strict=True)
        return [
            *(Compared(what=f"zero {a}", line=line, truth_per_k=v) for a, line, v in zeros),
            *(Compared(what=f"scale {a}", line=line, truth_per_k=v) for a, line, v in scales),
        ]

    @property
    def ens(self) -> list[float]:
        return [en for d in self.drifts for c in self.compared(d) if (en := c.en) is not None]

    @property
    def within(self) -> bool:
        return all(abs(en) <= LIMIT_CI for en in self.ens)


def compare_in_chamber(
    out: Path,
    p: ChamberParams,
    progress: Progress,
    *,
    scenario: str | Path | None = None,
    seed: int | None = None,
) -> ChamberComparison:
    """Start an emulator with the scenario, measure, estimate, grade. Raises BenchError."""
    out.mkdir(parents=True, exist_ok=True)
    name = scenario or measured.SCENARIO
    resolved = out / "scenario-converters.json"
    with Bench.start(name, seed=seed, extra=["--resolved", resolved]) as bench:
        soaks = measured.measure_soaks(bench, p, progress)
        truth = bench.truth()["units"]
    facts = {
        "scenario": str(name),
        "seed": str(read_resolved(resolved)["seed"]),
        "temperatures": ", ".join(f"{s.degc:g}" for s in soaks) + " degC",
        "recorded": f"{p.seconds:g} s at {len(measured.ANGLES_DEG)} positions each",
    }
    drifts = measured.estimate_drifts(soaks)
    truths = {d.name: true_drift(d.name, truth[d.name]) for d in drifts}
    return ChamberComparison(soaks=soaks, drifts=drifts, truths=truths, facts=facts)


# ---- as data


def _line_dict(c: Compared) -> dict[str, object]:
    return {
        "name": c.what,
        "values": [float(v) for v in c.line.values],
        "u": c.line.u,
        "per_k": c.line.per_k,
        "per_k_expanded_u": c.line.per_k_expanded_u,
        "truth_per_k": c.truth_per_k,
        "en": finite_or_none(c.en),
    }


def result_dict(c: ChamberComparison) -> dict[str, object]:
    """result.json: zeros in V at the load, scales as parts of the nominal one."""
    return {
        "format": 1,
        "procedure": f"{NAME} --chamber",
        "facts": dict(c.facts),
        "within_limits": c.within,
        "temperatures_degc": [s.degc for s in c.soaks],
        "generations": [
            {
                "name": d.name,
                "title": d.title,
                "ma_v_per_g": d.ma_v_per_g,
                "quantum_mps": d.quantum_mps(G_MPS2),
                "article": ARTICLE[d.name].drift,
                "size": ARTICLE[d.name].size,
                "coefficients": ARTICLE[d.name].coefficients,
                "lines": [_line_dict(x) for x in c.compared(d)],
            }
            for d in c.drifts
        ],
    }


# ---- as text


def _as_ug(volts: float, d: Drift) -> float:
    return volts / d.ma_v_per_g * 1e6


def drift_table(c: ChamberComparison) -> Table:
    """Of the axis that drifts most: greatest drift from the first temperature, and per kelvin; head and units first."""
    rows: Table = [
        ("", "resolution", "zero", "U", "zero", "U", "scale", "U", "scale", "U"),
        ("", "m/s", "µg", "µg", "µg/K", "µg/K", "ppm", "ppm", "ppm/K", "ppm/K"),
    ]
    for d in c.drifts:
        zero, scale = d.worst_zero, d.worst_scale
        figures = (
            *(_as_ug(x, d) for x in (zero.worst, zero.drift_expanded_u, zero.per_k, zero.per_k_expanded_u)),
            *(1e6 * x for x in (scale.worst, scale.drift_expanded_u, scale.per_k, scale.per_k_expanded_u)),
        )
        texts = (f"{x:.2g}" if k % 2 else f"{x:+.3g}" for k, x in enumerate(figures))
        rows.append((d.title, f"{d.quantum_mps(G_MPS2):.3g}", *texts))
    return rows


def course_table(c: ChamberComparison) -> Table:
    """Drift of the worst axis at each temperature: zero in µg, scale in ppm."""
    degc = [f"{s.degc:+.0f} °C" for s in c.soaks[1:]]
    rows: Table = [("", *degc, *degc), ("", *["µg"] * len(degc), *["ppm"] * len(degc))]
    for d in c.drifts:
        zeros = (f"{_as_ug(v, d):+.3g}" for v in d.worst_zero.drift[1:])
        rows.append((d.title, *zeros, *(f"{1e6 * v:+.3g}" for v in d.worst_scale.drift[1:])))
    return rows


def sources_table(c: ChamberComparison) -> Table:
    """What the article says, and whence the model's coefficients are."""
    rows: Table = [("", "the article on drift", "on size", "coefficients of the model")]
    for d in c.drifts:
        s = ARTICLE[d.name]
        rows.append((d.title, s.drift or "–", s.size or "–", s.coefficients))
    return rows


def console_table(c: ChamberComparison) -> str:
    """What the terminal shows."""
    headed = (
        (f"drift from {c.soaks[0].degc:g} degC on, of the axis that drifts most", drift_table(c)),
        ("zero and scale at each temperature, the same axes", course_table(c)),
    )
    tables = ["\n  ".join([head, *aligned(rows)]) for head, rows in headed]
    return "\n\n".join(
        [*tables, "\n  ".join(["what the drift is made of", *aligned(sources_table(c), left=(0, 1, 2, 3))])]
    )


def times_finer(drifts: Sequence[Drift]) -> float:
    """How many times finer PSA-2 is than the finest before it."""
    of = {d.name: d.quantum_mps(G_MPS2) for d in drifts}
    return min(v for k, v in of.items() if k not in ("psa1", "psa2")) / of["psa2"]


def verdict_of_drifts(c: ChamberComparison) -> str:
    """What was compared with what, and how it came out."""
    ens = c.ens
    beyond = f"{sum(abs(en) > 1.0 for en in ens)} are beyond U (expected: {(1.0 - COVERAGE) * len(ens):.1f})"
    out = sum(abs(en) > LIMIT_CI for en in ens)
    if out:
        return f"{out} of {len(ens)} temperature coefficients are not within {LIMIT_CI:g} U of the true ones; {beyond}."
    return (
        f"All {len(ens)} temperature coefficients are within {LIMIT_CI:g} U of the true ones, {beyond}. "
        f"PSA-2 resolves {times_finer(c.drifts):.0f} times finer than all before it."
    )
