"""`psabench run compare-converters`: the run, its grading against the exact integral, result.json and report.html.

The truth is the specific force that the emulator wrote into its truth log, integrated here; the procedure has never
seen it. A velocity error is what a unit's velocity misses that integral by, between two rests in the same attitude,
where the delay of a converter's filter drops out.
"""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psabench.bench import Bench
from psabench.budget.accuracy import BenchAccuracy
from psabench.budget.gum import COVERAGE
from psabench.emulator import read_resolved
from psabench.errors import BadInput, BenchError, expected
from psabench.link.own import output_text
from psabench.link.signals import Floats
from psabench.logs.call_log import check_procedure
from psabench.procedures import compare_converters as measured
from psabench.procedures.compare_converters import CompareParams, Figures, Track
from psabench.procedures.head_bench import Progress
from psabench.procedures.recorded_bench import BenchRecorder, RecordedBench
from psabench.procedures.recording import SeriesFile
from psabench.procedures.result import LIMIT_CI
from psabench.report.grading import aligned

TRUTH_EVERY_S = 0.01
G_MPS2 = 9.8094  # of the scenario's site: an operator knows the gravity of the laboratory
MAX_LAG_S = 0.05
AXES = "XYZ"
COVERAGE_K = 2.0  # of U


@dataclass(frozen=True, slots=True, kw_only=True)
class Article:
    """What the article says of a generation, and the budget of its unit: standard uncertainties.

    printed: texts of the article (E1), "": nothing. gain_u: of the coefficient, relative, zero_u_v: of the zero at the
    load; k_source says whence the first, zero_source whence the second. error: of the coefficient as printed, "":
    nothing. why: what its figures come from, where the board's page has to be known to understand them. drift, size:
    what the article says of either; coefficients: the source of those that the model drifts by.
    """

    printed: str
    gain_u: float
    zero_u_v: float
    pulse: str = ""
    k_source: str = "E0"
    zero_source: str = "E0"
    error: str = ""
    why: str = ""
    drift: str = ""
    size: str = ""
    coefficients: str = "resistors, reference and zero E0"

    @property
    def pulse_mps(self) -> float | None:
        """The quantum as printed, m/s."""
        return float(self.pulse) if self.pulse else None


# PSD-1 of profile psd1_quiet, in V at the input. Self-calibration takes zero and full scale from one word each, with
# that word's noise (sources 3.2, 3.5): a word is off by -n0 - x (n1 - n0), x the fraction of full scale (E3).
PSD1_FULL_SCALE_V = 10.0
PSD1_NOISE_V = 4.0 * 13e-6  # rms of a word at 100 Hz and gain 1 (E2); four times that on AIN2 (E0)
PSD1_CODE_V = PSD1_FULL_SCALE_V / 2**15  # a word of 16 bits is cut off, not rounded: up to a code low (E0)
PSD1_REFERENCE = 2e-4  # standard deviation of the reference (E0)
PSD1_GAIN_U = (PSD1_REFERENCE**2 + 2.0 * (PSD1_NOISE_V / PSD1_FULL_SCALE_V) ** 2) ** 0.5
PSD1_ZERO_U_V = (PSD1_NOISE_V**2 + PSD1_CODE_V**2 / 3.0) ** 0.5  # anywhere from 0 to a code low: not corrected

RECTANGULAR = 3.0**0.5  # limits of a printed error to its standard uncertainty, GUM 4.3.7
PSA = BenchAccuracy()
ROM_U = 0.3e-6  # correction of PMKA's ROM: as the factory measured it (0.2 ppm), and its resolution (0.24 ppm)

ONE_PULSE = "a level axis gives a pulse or none in the whole rest: its drift is known to a quantum over the rest"

# Zeros are those of the profiles and chains (E0); the article gives none. PMKA measures its own.
ARTICLE: Mapping[str, Article] = {
    "pik": Article(
        printed="174 Hz/V within 0.15 %",
        pulse="60e-3",
        gain_u=1.5e-3 / RECTANGULAR,
        zero_u_v=2e-4,
        k_source="E1",
        error="0.15 %",
        why=ONE_PULSE,
    ),
    "pik5": Article(
        printed="no figures but those of PIK",
        gain_u=1.5e-3 / RECTANGULAR,
        zero_u_v=2e-4,
        k_source="E1",
        why=ONE_PULSE,
    ),
    "pik6": Article(
        printed="2000 Hz/V within 0.05 %",
        pulse="5e-3",
        gain_u=5e-4 / RECTANGULAR,
        zero_u_v=5e-5,
        k_source="E1",
        error="0.05 %",
        drift="much better than PIK in general",
    ),
    "pmka": Article(
        printed="16-bit converter, Ts = 4.8 ms",
        pulse="2.4e-5",
        gain_u=ROM_U,
        zero_u_v=0.0,
        zero_source="from the scatter of its calibrations",
        drift="taken out by ROM and thermometer",
        size="hard limits on it",
        coefficients="parts E0; correction E1, its points -40 to 80 degC E0",
    ),
    "psd1": Article(
        printed="16-bit words of a delta-sigma converter",
        gain_u=PSD1_GAIN_U,
        zero_u_v=PSD1_ZERO_U_V,
        k_source="E0 + E3",
        zero_source="E0 + E3",
        why=f"its drift is a zero: words are cut off, not rounded, up to a code ({PSD1_CODE_V * 1e6:.0f} µV) low, and "
        f"self-calibration takes the zero from one word, which has {PSD1_NOISE_V * 1e6:.0f} µV rms of noise",
        drift="it calibrates itself",
        size="better: demanded",
        coefficients="reference E0, none of the converter",
    ),
    **{
        name: Article(
            printed="resolution finer by more than an order",
            gain_u=PSA.chain_gain_ppm * 1e-6,
            zero_u_v=PSA.chain_zero_uv * 1e-6,
            drift="of the zero less than before",
            size="much smaller than before",
            coefficients="chain E0; its zero below the others by the article's words",
        )
        for name in ("psa1", "psa2")
    },
}


# ---- truth


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What the sensors felt: a = -f in the axes of the case, and its integral from the first instant on."""

    t_s: Floats  # (n,) evenly spaced
    a_mps2: Floats  # (n, 3)
    v_mps: Floats  # (n, 3)

    def at(self, t_s: Floats, of: Floats) -> Floats:
        """Rows of `of` (a_mps2 or v_mps) at other instants, shape (len(t_s), 3), cubic between the points."""
        h = self.t_s[1] - self.t_s[0]
        k = np.clip(((t_s - self.t_s[0]) / h).astype(np.int64), 0, len(self.t_s) - 2)
        x = ((t_s - self.t_s[k]) / h)[:, None]
        slope = np.gradient(of, h, axis=0, edge_order=2) if of is not self.v_mps else self.a_mps2
        p0, p1, m0, m1 = of[k], of[k + 1], slope[k] * h, slope[k + 1] * h
        return np.asarray(
            (1 + 2 * x) * (1 - x) ** 2 * p0 + x * (1 - x) ** 2 * m0 + x**2 * (3 - 2 * x) * p1 + x**2 * (x - 1) * m1
        )


def integrate(t_s: Floats, a_mps2: Floats) -> Floats:
    """Integral from the first instant on, shape like a: trapezoids with the correction of their ends (fourth order)."""
    h = float(t_s[1] - t_s[0])
    slope = np.gradient(a_mps2, h, axis=0, edge_order=2)
    steps = 0.5 * h * (a_mps2[1:] + a_mps2[:-1]) - h * h / 12.0 * (slope[1:] - slope[:-1])
    return np.concatenate([np.zeros((1, a_mps2.shape[1])), np.cumsum(steps, axis=0)])


def _unit_mark(unit: str) -> str:
    """What is near the begin of each line of a unit."""
    return f'"unit":"{unit}",'


def read_truth(path: Path, unit: str) -> Motion:
    """From a truth log, lines of one unit. Raises BenchError for a log without it."""
    t_s, a = [], []
    mark = _unit_mark(unit)
    with path.open(encoding="utf-8") as lines:
        for line in lines:
            if mark in line[:80]:
                state = json.loads(line)
                t_s.append(state["t_ns"] * 1e-9)
                a.append([-x for x in state["unit"]["f_mps2"]])
    if len(t_s) < 3:
        raise BenchError(expected(f"the truth of unit {unit}", "none", path))
    t, a_mps2 = np.array(t_s), np.array(a)
    return Motion(t_s=t, a_mps2=a_mps2, v_mps=integrate(t, a_mps2))


# ---- grading


@dataclass(frozen=True, slots=True, kw_only=True)
class Graded:
    """A generation beside the truth."""

    figures: Figures
    article: Article
    error_mps: Floats  # (n, 3) velocity minus truth, its lag taken out
    end_mps: Floats  # (3,) over the whole run
    u_mps: Floats  # (3,) expanded uncertainty U of end_mps, k = 2
    lag_s: float  # behind the truth: sensor, filter, period
    swing_mps: float  # largest |error| of any axis while the table moved, drift of the rests taken out

    @property
    def within(self) -> bool:
        return bool(np.all(np.abs(self.end_mps) <= LIMIT_CI * self.u_mps))


def _error(track: Track, motion: Motion, lag_s: float, g_mps2: float) -> Floats:
    v = motion.at(track.t_s - lag_s, motion.v_mps)
    return np.asarray(track.velocity_mps(g_mps2) - (v - v[0]))


def _lag_s(track: Track, motion: Motion, g_mps2: float) -> float:
    """Delay that the error calls for: it goes with the acceleration; zero and scale of each axis apart."""
    lag_s = 0.0
    for _ in range(2):
        error = _error(track, motion, lag_s, g_mps2)
        a = motion.at(track.t_s - lag_s, motion.a_mps2)
        v = motion.at(track.t_s - lag_s, motion.v_mps)
        t = track.t_s - track.t_s[0]
        columns = np.stack([np.ones_like(t), t, v[:, 0] - v[0, 0], a[:, 0]], axis=1)
        lag_s -= float(np.linalg.lstsq(columns, error[:, 0], rcond=None)[0][3])
    return float(np.clip(lag_s, -MAX_LAG_S, MAX_LAG_S))


def grade(f: Figures, motion: Motion, p: CompareParams, g_mps2: float) -> Graded:
    """Pure."""
    track, article = f.track, ARTICLE[f.track.name]
    lag_s = _lag_s(track, motion, g_mps2)
    error = _error(track, motion, lag_s, g_mps2)
    span_s = float(track.t_s[-1] - track.t_s[0])
    inside = (motion.t_s >= track.t_s[0]) & (motion.t_s <= track.t_s[-1])
    run_mps = np.trapezoid(np.abs(motion.a_mps2[inside]), motion.t_s[inside], axis=0)
    t = track.t_s - track.t_s[0]
    steady = error - t[:, None] * f.drift_mps2 + _drift_of_truth(motion, track, p) * t[:, None]
    moving = t >= p.rest_s
    return Graded(
        figures=f,
        article=article,
        error_mps=error,
        end_mps=error[-1] - error[0],
        u_mps=COVERAGE_K * _standard_u_mps(f, article, run_mps, span_s, g_mps2),
        lag_s=lag_s,
        swing_mps=float(np.abs(steady[moving]).max(initial=0.0)),
    )


def _standard_u_mps(f: Figures, article: Article, run_mps: Floats, span_s: float, g_mps2: float) -> Floats:
    """Combined standard uncertainty of the end error, (3,): gain over what the axis felt, zero, two ends."""
    track, zero_v = f.track, math.hypot(article.zero_u_v, f.track.zero_u_v)
    gain = np.hypot(article.gain_u, track.gain_u) * run_mps
    zero_mps = zero_v / track.ma_v_per_g * g_mps2 * span_s
    ends_mps = np.sqrt(2.0 * (track.quantum_mps(g_mps2) ** 2 / 12.0 + f.noise_mps**2))
    return np.asarray(np.sqrt(gain**2 + zero_mps**2 + ends_mps**2))


def _drift_of_truth(motion: Motion, track: Track, p: CompareParams) -> Floats:
    """Mean acceleration over the first rest."""
    rest = (motion.t_s >= track.t_s[0]) & (motion.t_s < track.t_s[0] + p.rest_s)
    return np.asarray(motion.a_mps2[rest].mean(axis=0))


def zero_mps2(g: Graded, motion: Motion, p: CompareParams) -> Floats:
    """What a unit shows at rest beyond what it feels, m/s^2 of each axis."""
    return np.asarray(g.figures.drift_mps2 - _drift_of_truth(motion, g.figures.track, p))


# ---- the run


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """All of a run."""

    graded: tuple[Graded, ...]
    motion: Motion
    params: CompareParams
    g_mps2: float
    facts: Mapping[str, str]

    @property
    def within(self) -> bool:
        return all(g.within for g in self.graded)


def compare(
    out: Path,
    p: CompareParams,
    progress: Progress,
    *,
    scenario: str | Path | None = None,
    seed: int | None = None,
    record: Path | None = None,
) -> Comparison:
    """Start an emulator with the scenario, measure, grade. record: a log of the run for `replay`. Raises BenchError."""
    out.mkdir(parents=True, exist_ok=True)
    name = scenario or measured.SCENARIO
    resolved = out / "scenario-converters.json"
    with tempfile.TemporaryDirectory(prefix="psabench-") as folder, ExitStack() as stack:
        log = Path(folder) / "truth.jsonl"
        extra: list[str | Path] = ["--truth-log", log, "--truth-every", f"{TRUTH_EVERY_S * 1e3:g}ms"]
        extra += ["--resolved", resolved]
        with Bench.start(name, seed=seed, extra=extra) as bench:
            facts = {"scenario": str(name), "seed": str(read_resolved(resolved)["seed"])}
            facts |= {"recorded": f"{p.seconds:g} s", "g": f"{G_MPS2} m/s²"}
            heard: Any = bench
            if record:
                setup = {"procedure": measured.NAME, "facts": facts}
                heard = stack.enter_context(BenchRecorder(bench, record, setup))
            tracks = measured.record(heard, p, progress)
            stack.close()
        _store_tracks(out, tracks)
        motion = read_truth(log, tracks[0].name)
        if record:
            _keep_truth(log, tracks[0].name, record)
    return _grade_tracks(tracks, motion, p, facts)


def replay_comparison(out: Path, p: CompareParams, progress: Progress, log: Path) -> Comparison:
    """The same from a recording. Raises BadInput."""
    bench: Any = RecordedBench(log)
    check_procedure(log, bench.setup, measured.NAME)
    truth = truth_path(log)
    if not truth.exists():
        raise BadInput(expected("the true motion, which psabench run --record writes", "no such file", truth))
    out.mkdir(parents=True, exist_ok=True)
    tracks = measured.record(bench, p, progress)
    bench.end_run()
    _store_tracks(out, tracks)
    facts = {str(k): str(v) for k, v in bench.setup["facts"].items()}
    return _grade_tracks(tracks, read_truth(truth, tracks[0].name), p, facts)


def _store_tracks(out: Path, tracks: Sequence[Track]) -> None:
    """A series of each unit: instants of its readings, integrals of its inputs."""
    for track in tracks:
        with SeriesFile(out / f"{measured.NAME}-{track.name}.csv", ("t_s", "x_vs", "y_vs", "z_vs")) as series:
            series.store_rows(np.column_stack([track.t_s, track.s_vs]).tolist())


def truth_path(log: Path) -> Path:
    """Where the true motion of a recording is; the procedure itself never reads it."""
    return log.with_name(log.name + ".truth.jsonl")


def _keep_truth(log: Path, unit: str, record: Path) -> None:
    """The lines of one unit: all were moved alike."""
    mark = _unit_mark(unit)
    with log.open(encoding="utf-8") as lines, output_text(truth_path(record)) as out:
        out.writelines(line for line in lines if mark in line[:80])


def _grade_tracks(tracks: Sequence[Track], motion: Motion, p: CompareParams, facts: Mapping[str, str]) -> Comparison:
    graded = tuple(grade(measured.figures(t, p, G_MPS2), motion, p, G_MPS2) for t in tracks)
    return Comparison(graded=graded, motion=motion, params=p, g_mps2=G_MPS2, facts=facts)


# ---- results as data and as text


def _numbers(x: Floats) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in x]


def result_dict(c: Comparison) -> dict[str, object]:
    """result.json: plain data, units in the names."""
    rows = []
    for g in c.graded:
        f, track = g.figures, g.figures.track
        rows.append(
            {
                "name": track.name,
                "title": track.title,
                "ma_v_per_g": track.ma_v_per_g,
                "readings": len(track.t_s),
                "quantum_mps": track.quantum_mps(c.g_mps2),
                "printed": g.article.printed,
                "gain_u": math.hypot(g.article.gain_u, track.gain_u),
                "gain_u_grade": g.article.k_source,
                "zero_u_v": math.hypot(g.article.zero_u_v, track.zero_u_v),
                "printed_quantum_mps": g.article.pulse_mps,
                "printed_error": g.article.error,
                "step_seen_mps": _numbers(f.step_mps),
                "noise_rms_mps": _numbers(f.noise_mps),
                "zero_mps2": _numbers(zero_mps2(g, c.motion, c.params)),
                "lag_s": g.lag_s,
                "swing_error_mps": g.swing_mps,
                "end_error_mps": _numbers(g.end_mps),
                "expanded_u_mps": _numbers(g.u_mps),
                "within_limits": g.within,
                "note": track.note,
                "why": g.article.why,
            }
        )
    return {
        "format": 1,
        "procedure": measured.NAME,
        "facts": dict(c.facts),
        "within_limits": c.within,
        "generations": rows,
    }


def drift_mps2(g: Graded, c: Comparison) -> float:
    """What the velocity of a level axis runs up by at rest, the worse of X and Y; m/s^2."""
    return float(np.abs(zero_mps2(g, c.motion, c.params)[:2]).max())


Table = list[tuple[str, ...]]


def figures_table(c: Comparison) -> Table:
    """Resolution, noise, drift and error in motion of each generation; head and units first."""
    rows: Table = [
        ("", "printed", "quantum", "step seen", "noise at rest", "drift at rest", "as a zero", "largest in motion"),
        ("", "m/s", "m/s", "m/s", "m/s rms", "mm/s a min", "µg", "m/s"),
    ]
    for g in c.graded:
        f, track, drift = g.figures, g.figures.track, drift_mps2(g, c)
        rows.append(
            (
                track.title,
                g.article.pulse or "–",
                f"{track.quantum_mps(c.g_mps2):.3g}",
                f"{f.step_mps.min():.3g}" if np.isfinite(f.step_mps.min()) else "–",
                f"{f.noise_mps.max():.2g}",
                f"{drift * 60e3:.3g}",
                f"{drift / c.g_mps2 * 1e6:.3g}",
                f"{g.swing_mps:.2g}",
            )
        )
    return rows


def errors_table(c: Comparison) -> Table:
    """Velocity error of each axis over the run beside its U, and the error of the coefficient as printed."""
    rows: Table = [
        ("", "printed", *(f"{what} {axis}" for axis in AXES for what in ("end", "U")), f"within {LIMIT_CI:g} U"),
        ("", "", *["m/s"] * 6, ""),
    ]
    for g in c.graded:
        ends = (x for end, u in zip(g.end_mps, g.u_mps, strict=True) for x in (f"{end:+.2g}", f"{u:.2g}"))
        rows.append((g.figures.track.title, g.article.error or "–", *ends, "yes" if g.within else "NO"))
    return rows


def console_table(c: Comparison) -> str:
    """What the terminal shows."""
    headed = (
        ("velocity at rest and in motion", figures_table(c)),
        ("velocity less the exact integral, from the first reading to the last", errors_table(c)),
    )
    return "\n\n".join("\n  ".join([head, *aligned(rows)]) for head, rows in headed)


def verdict(c: Comparison) -> str:
    """What was compared with what, and how it came out."""
    ends = [abs(end) / u for g in c.graded for end, u in zip(g.end_mps, g.u_mps, strict=True)]
    beyond = f"{sum(x > 1.0 for x in ends)} of {len(ends)} end errors are beyond U"
    out = [g.figures.track.title for g in c.graded if not g.within]
    if out:
        return f"Not within {LIMIT_CI:g} U of the exact integral: {', '.join(out)}; {beyond}."
    text = f"The velocities of all {len(c.graded)} generations are within {LIMIT_CI:g} U of the exact integral"
    return f"{text}; {beyond} (expected: {(1.0 - COVERAGE) * len(ends):.1f})."


def finer(c: Comparison) -> Sequence[tuple[str, float]]:
    """How many times finer the quantum of each generation is than that of the first."""
    first = c.graded[0].figures.track.quantum_mps(c.g_mps2)
    return [(g.figures.track.title, first / g.figures.track.quantum_mps(c.g_mps2)) for g in c.graded]
