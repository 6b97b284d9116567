"""One motion to all generations of converters at once, and what each makes of it. Wire only.

Every unit of the bench streams while the table moves as the scenario's timeline says; each generation's readings become
volt seconds at its load, by the article's formulas and the protocol page of its board, and these a velocity with
the scale Ma of its accelerometer. What the motion was this file does not know: `psabench.procedures.comparison` grades.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from psabench.bench import Bench
from psabench.boards.objects import PikObjects
from psabench.boards.pik import estimate as pik
from psabench.boards.pik.device import Pik
from psabench.boards.pmka import estimate as pmka
from psabench.boards.pmka.device import Pmka
from psabench.boards.psa2.device import CODE_V, Psa2
from psabench.boards.psd1.device import FULL_SCALE_V, OFFSET_BINARY, Psd1, volts
from psabench.boards.readings import Readings
from psabench.boards.unit import Unit
from psabench.errors import BadInput, LinkError, expected
from psabench.link.signals import Floats
from psabench.procedures.head_bench import Progress

NAME = "compare-converters"
SCENARIO = "converters"

AMPERE_PER_G = 1.28e-3  # of the accelerometers, from their passport
SETTLE_S = 4.0  # from power-on until every board of the scenario is set up
PLATE = PikObjects.PLATE  # of a PIK: type, K in 0.001 Hz/V


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareParams:
    """Parameters of `compare-converters`."""

    seconds: float = 70.0  # of recording, from SETTLE_S on
    rest_s: float = 24.0  # of them at the beginning the table rests
    slice_s: float = 5.0  # between looks at what has come

    def __post_init__(self) -> None:
        if not 0.0 < self.rest_s < self.seconds:
            raise ValueError(expected(f"0 to seconds, {self.seconds}", self.rest_s, "rest_s"))


@dataclass(frozen=True, slots=True, kw_only=True)
class Generation:
    """A generation as its unit is called in the scenario; load_ohm: of its accelerometers, which gives Ma."""

    title: str
    board: type[Unit]
    load_ohm: float

    @property
    def ma_v_per_g(self) -> float:
        return self.load_ohm * AMPERE_PER_G


GENERATIONS: Mapping[str, Generation] = {
    "pik": Generation(title="PIK", board=Pik, load_ohm=735.0),
    "pik5": Generation(title="PIK-5", board=Pik, load_ohm=735.0),
    "pik6": Generation(title="PIK-6", board=Pik, load_ohm=768.0),
    "pmka": Generation(title="PMKA", board=Pmka, load_ohm=937.5),
    "psd1": Generation(title="PSD-1", board=Psd1, load_ohm=937.5),
    "psa1": Generation(title="PSA-1", board=Psa2, load_ohm=937.5),
    "psa2": Generation(title="PSA-2", board=Psa2, load_ohm=937.5),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class OfGeneration:
    """What was found of a unit, in volts at its load; the generation gives the scale."""

    name: str  # of GENERATIONS
    quantum_vs: float  # smallest step of the integral

    @property
    def title(self) -> str:
        return GENERATIONS[self.name].title

    @property
    def ma_v_per_g(self) -> float:
        return GENERATIONS[self.name].ma_v_per_g

    def quantum_mps(self, g_mps2: float) -> float:
        return self.quantum_vs * g_mps2 / self.ma_v_per_g


@dataclass(frozen=True, slots=True, kw_only=True)
class Track(OfGeneration):
    """What a unit told of the motion: integral of each input over time, from its first reading on."""

    t_s: Floats  # (n,) of the readings, s of the bench; the first is where the integral is 0
    s_vs: Floats  # (n, 3) V s of X, Y, Z
    note: str = ""
    # Standard uncertainties from the scatter of the unit's own calibrations, 0: it makes none.
    gain_u: float = 0.0  # relative
    zero_u_v: float = 0.0  # at the load

    def velocity_mps(self, g_mps2: float) -> Floats:
        """Shape (n, 3)."""
        return self.s_vs * (g_mps2 / self.ma_v_per_g)


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Of one generation, from the wire alone."""

    track: Track
    step_mps: Floats  # (3,) smallest difference between two increments seen; inf: none, or no grid
    noise_mps: Floats  # (3,) rms about a straight line, first rest
    drift_mps2: Floats  # (3,) slope of it


# ---- from readings to volt seconds


def _bench_time_s(r: Readings) -> Floats:
    """Instants of the samples on the clock of the first arrival; a unit's own stamps where it sends them."""
    stamps = r.t_sample_s if np.all(np.isfinite(r.t_sample_s)) else r.t_rx_s
    return np.asarray(r.t_rx_s[0] + (stamps - stamps[0]))


def _pik(unit: Unit, r: Readings, name: str) -> Track:
    k_hz_per_v = float(unit.node.read(PLATE, 2)) * 1e-3
    totals = [r["PIK_TOTALS.X"], r["PIK_TOTALS.Y"], r["PIK_TOTAL_Z.Z"]]
    return Track(
        name=name,
        quantum_vs=pik.pulse_vs(k_hz_per_v),
        t_s=_bench_time_s(r),
        s_vs=np.stack([pik.integral_vs(t, k_hz_per_v) for t in totals], axis=1),
        note=f"K = {k_hz_per_v:g} Hz/V from the name plate",
    )


def _means(name: str, lsb_v: float, t_s: Floats, u_v: Floats, note: str) -> Track:
    """Of a converter that gives means over the time since the reading before."""
    dt_s = np.diff(t_s)
    s_vs = np.concatenate([np.zeros((1, 3)), np.cumsum(u_v[1:] * dt_s[:, None], axis=0)])
    return Track(
        name=name,
        quantum_vs=lsb_v * float(np.median(dt_s)),
        t_s=t_s,
        s_vs=s_vs,
        note=note,
    )


def _psd1(r: Readings, name: str) -> Track:
    lsb_v = FULL_SCALE_V / OFFSET_BINARY
    return _means(name, lsb_v, _bench_time_s(r), volts(r), "16-bit words of ±10 V, each the mean of a cycle")


def _psa2(unit: Psa2, name: str) -> Track:
    """Of frames on a whole number of periods: the converter's crystal is taken at its word."""
    frames, gain = unit.frames.take(), unit.filter_gain
    t_s = frames.t_rx_s[0] + np.arange(len(frames)) / unit.data_hz
    note = f"24-bit codes at the load, a mean of the filter each, less the filter's gain of {gain:.7g}"
    return _means(name, CODE_V / gain, t_s, frames.u_v / gain, note)


def _pmka(unit: Pmka, r: Readings, name: str) -> Track:
    """Raises LinkError where a reading is missing or an integrator was at its limit, or has not been calibrated."""
    rom = pmka.rom_of(unit.rom_words())
    try:
        periods = pmka.periods_of(r.columns)
        calibrations = [pmka.calibrate(periods, i) for i in range(len(pmka.INTEGRATORS))]
    except ValueError as e:
        raise LinkError(f"{name}: {e}") from e
    nr = float(np.mean([c.nr.mean() for c in calibrations]))
    gain_u, zero_u = (max(map(scatter_of, x)) for x in zip(*((c.nr / nr, c.zero) for c in calibrations), strict=True))
    return Track(
        name=name,
        quantum_vs=pmka.quantum_vs(nr, rom.ts_s),
        t_s=r.t_rx_s[0] + np.arange(len(periods)) * rom.ts_s,
        s_vs=pmka.integrals_vs(periods, rom, calibrations),
        note=f"eqs (1)-(7), {nr:.0f} codes a reset, corrections of the ROM",
        gain_u=gain_u,
        zero_u_v=zero_u / nr * pmka.UREF_V,
    )


def scatter_of(x: Floats) -> float:
    """Standard uncertainty of the mean of calibrations, shape (k, ...): of the column that scatters most."""
    return float(np.max(np.std(x, axis=0, ddof=1))) / len(x) ** 0.5 if len(x) > 1 else 0.0


def _track(unit: Unit, name: str) -> Track:
    lost = unit.frames.counters.lost + unit.frames.counters.torn
    if lost:
        raise LinkError(f"{name}: {lost} readings lost between the unit and this program")
    if isinstance(unit, Psa2):
        return _psa2(unit, name)
    readings = unit.frames.take()
    assert isinstance(readings, Readings)
    if isinstance(unit, Pmka):
        return _pmka(unit, readings, name)
    return _pik(unit, readings, name) if isinstance(unit, Pik) else _psd1(readings, name)


# ---- the run


@contextmanager
def _streaming(units: Mapping[str, Unit]) -> Iterator[None]:
    for unit in units.values():
        if isinstance(unit, Psd1):
            unit.also("PSD1_TIME")
        unit.frames.forget()
        unit.start()
    yield
    for unit in units.values():
        unit.stop()


def record(bench: Bench, p: CompareParams, progress: Progress) -> tuple[Track, ...]:
    """Record every unit of the bench through the motion.

    Raises BadInput for a bench without the units, LinkError where one of them lost something.
    """
    units = units_of(bench)
    bench.wait(max(0.0, SETTLE_S - bench.time_s))
    slices = max(1, round(p.seconds / p.slice_s))

    def pass_motion() -> None:
        for _ in range(slices):
            bench.wait(p.seconds / slices)
            done()

    with progress.step("one motion to all converters", slices) as done:
        return tracks_of(units, pass_motion)


def units_of(bench: Bench) -> dict[str, Unit]:
    """One of each generation, in the order of GENERATIONS. Raises BadInput for a bench without them."""
    missing = [name for name, gen in GENERATIONS.items() if not isinstance(bench.units.get(name), gen.board)]
    if missing:
        raise BadInput(expected(f"units {', '.join(missing)} as in {SCENARIO}.yaml", "none", "--scenario"))
    return {name: bench.units[name] for name in GENERATIONS}


def tracks_of(units: Mapping[str, Unit], pass_time: Callable[[], object]) -> tuple[Track, ...]:
    """What every unit tells while pass_time() lets time pass. Raises LinkError where one of them lost something."""
    with _streaming(units):
        pass_time()
    return tuple(_track(unit, name) for name, unit in units.items())


# ---- figures that need no truth


def _smallest_step(x: Floats, quantum: float) -> float:
    """Smallest difference between distinct values, inf where there is none or they lie on no grid of the quantum."""
    values = np.unique(x)
    steps = np.diff(values)
    steps = steps[steps > 1e-9 * float(np.abs(values).max(initial=0.0))]  # the others are roundings
    least = float(steps.min(initial=np.inf))
    return least if least > 0.5 * quantum else np.inf


def figures(track: Track, p: CompareParams, g_mps2: float) -> Figures:
    """Resolution as seen, noise and drift over the first rest. Pure."""
    v = track.velocity_mps(g_mps2)
    at_rest = track.t_s < track.t_s[0] + p.rest_s
    t_s = track.t_s[at_rest] - track.t_s[0]
    lines = np.stack([np.polyfit(t_s, v[at_rest, i], 1) for i in range(3)], axis=1)
    residual = v[at_rest] - (lines[0] * t_s[:, None] + lines[1])
    return Figures(
        track=track,
        step_mps=np.array([_smallest_step(np.diff(v[:, i]), track.quantum_mps(g_mps2)) for i in range(3)]),
        noise_mps=np.sqrt(np.mean(residual**2, axis=0)),
        drift_mps2=lines[0],
    )
