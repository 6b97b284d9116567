"""What a thermal run does, as data: temperatures, dwell, rates, positions of a YAML file (docs/procedures/thermal.md).

`planned_actions` turns a schedule into a list of settings of the chamber and of recordings, each with its time, so a
run that was interrupted continues where it was.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, TypeVar

import numpy as np

from psabench.errors import BadInput, expected
from psabench.estimate.face import Face
from psabench.named_yaml import read_named
from psabench.thermal.compensation import DEGREE, MOST_DEGREE

Part = TypeVar("Part")

SOAK = "soak"  # segment of a run; the others are sweeps
NAMED = ("quick", "full")  # of proto/schedules
LOWEST_C, HIGHEST_C = -60.0, 85.0
LEAST_RATE, MOST_RATE = 0.05, 60.0  # K/min; a chamber rejects what it cannot do
HEAD_S = 5.0  # for a turn of the head and the converter's filter, before a recording
READY_S = 1.0  # from the origin of a run to its first setting
DATA_HZ = (250, 500, 1000)
ENDS = 5  # rounds of a leg more than the degree: the ends have incomplete ones, and what is left out has neighbours
RISE = (0.1, 0.9)  # part of a warm-up in which its mean rate is taken


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """How the unit lies: the face of the mount and the angle of the head; an axis along gravity (down) or against."""

    name: str
    axis: int  # that is vertical
    sign: float  # of gravity on it
    face: Face
    set_deg: float


POSITIONS: Mapping[str, Position] = {
    p.name: p
    for p in (
        Position(name="x_down", axis=0, sign=1.0, face=Face.DIRECT, set_deg=270.0),
        Position(name="x_up", axis=0, sign=-1.0, face=Face.DIRECT, set_deg=90.0),
        Position(name="y_down", axis=1, sign=1.0, face=Face.DIRECT, set_deg=180.0),
        Position(name="y_up", axis=1, sign=-1.0, face=Face.DIRECT, set_deg=0.0),
        Position(name="z_down", axis=2, sign=1.0, face=Face.SIDE, set_deg=180.0),
        Position(name="z_up", axis=2, sign=-1.0, face=Face.SIDE, set_deg=0.0),
    )
}


def _check_between(name: str, value: float, low: float, high: float, unit: str) -> None:
    """Raises ValueError; a number that is not finite is not between."""
    if not low <= value <= high:
        raise ValueError(expected(f"{low:g} to {high:g} {unit}", f"{value:g}", name))


@dataclass(frozen=True, slots=True, kw_only=True)
class WarmUp:
    """Temperature of a unit's case after it is switched on in service: (n,) each."""

    times_s: tuple[float, ...]
    temps_degc: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.times_s) != len(self.temps_degc) or len(self.times_s) < 2:
            got = f"{len(self.times_s)} and {len(self.temps_degc)}"
            raise ValueError(expected("as many times as temperatures, 2 or more", got, "warm_up"))
        if not all(map(math.isfinite, (*self.times_s, *self.temps_degc))) or min(np.diff(self.times_s)) <= 0:
            raise ValueError(expected("finite numbers, times that ascend", "others", "warm_up"))
        if self.temps_degc[-1] == self.temps_degc[0]:
            raise ValueError(expected("a temperature that changes", "the same at both ends", "warm_up"))

    @property
    def mean_rate(self) -> float:
        """K/min, from 10 to 90 % of the way from the first temperature to the last."""
        rise = (np.array(self.temps_degc) - self.temps_degc[0]) / (self.temps_degc[-1] - self.temps_degc[0])
        ahead = np.maximum.accumulate(rise)
        begin_s, end_s = (self._time_of(ahead, part) for part in RISE)
        return abs(self.temps_degc[-1] - self.temps_degc[0]) * (RISE[1] - RISE[0]) / (end_s - begin_s) * 60.0

    @property
    def most_rate(self) -> float:
        """K/min, of the fastest part."""
        return float(np.abs(np.diff(self.temps_degc) / np.diff(self.times_s)).max() * 60.0)

    def _time_of(self, ahead: Any, part: float) -> float:
        k = int(np.argmax(ahead >= part))
        t = np.interp(part, ahead[k - 1 : k + 1], self.times_s[k - 1 : k + 1])
        return float(t)


@dataclass(frozen=True, slots=True, kw_only=True)
class Soak:
    """Method of points: at each temperature the chamber waits, then every position is recorded."""

    temperatures_c: tuple[float, ...]
    ramp_k_per_min: float = 2.0
    dwell_s: float = 3600.0

    def __post_init__(self) -> None:
        for t in self.temperatures_c:
            _check_between("soak: temperatures_c", t, LOWEST_C, HIGHEST_C, "degC")
        if len(set(self.temperatures_c)) != len(self.temperatures_c) or not self.temperatures_c:
            raise ValueError(expected("temperatures, each once", list(self.temperatures_c), "soak: temperatures_c"))
        _check_between("soak: ramp_k_per_min", self.ramp_k_per_min, LEAST_RATE, MOST_RATE, "K/min")
        _check_between("soak: dwell_s", self.dwell_s, 1.0, 86400.0, "s")


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """Continuous method: low to high and back, a recording every so often, each in the next position."""

    rates_k_per_min: tuple[float, ...] = ()
    every_s: float = 60.0
    rest_s: float = 3600.0  # at the low end before it begins
    turn_s: float = 0.0  # at the end of each leg: the element reaches the end of the range
    legs: str = "both"
    ramp_k_per_min: float = 2.0  # on the way to the low end
    warm_up: WarmUp | None = None  # gives the rate where none is given

    def __post_init__(self) -> None:
        if self.legs not in ("both", "up"):
            raise ValueError(expected("both or up", self.legs, "sweep: legs"))
        if not self.rates_k_per_min and self.warm_up is None:
            raise ValueError(expected("rates_k_per_min, or a warm_up that gives one", "none", "sweep"))
        for rate in self.rates():
            _check_between("sweep: rates_k_per_min", rate, LEAST_RATE, MOST_RATE, "K/min")
        if len(set(self.rates())) != len(self.rates()):
            raise ValueError(expected("rates, each once", list(self.rates()), "sweep: rates_k_per_min"))
        _check_between("sweep: ramp_k_per_min", self.ramp_k_per_min, LEAST_RATE, MOST_RATE, "K/min")
        _check_between("sweep: rest_s", self.rest_s, 1.0, 86400.0, "s")
        _check_between("sweep: turn_s", self.turn_s, 0.0, 86400.0, "s")

    def rates(self) -> tuple[float, ...]:
        """Of the sweeps, one after the other, K/min: as given, else the mean one of the warm-up."""
        if self.rates_k_per_min or self.warm_up is None:
            return self.rates_k_per_min
        return (round(self.warm_up.mean_rate, 2),)


@dataclass(frozen=True, slots=True, kw_only=True)
class Schedule:
    """A thermal run."""

    low_c: float = LOWEST_C
    high_c: float = HIGHEST_C
    degree: int = DEGREE
    positions: tuple[str, ...] = tuple(POSITIONS)
    record_s: float = 1.0
    samples_hz: int = 250
    soak: Soak | None = None
    sweep: Sweep | None = None
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        for name, t in (("low_c", self.low_c), ("high_c", self.high_c)):
            _check_between(name, t, LOWEST_C, HIGHEST_C, "degC")
        if self.high_c - self.low_c < 10.0:
            raise ValueError(expected("10 K or more above low_c", f"{self.high_c:g} for {self.low_c:g}", "high_c"))
        if not 1 <= self.degree <= MOST_DEGREE:
            raise ValueError(expected(f"1 to {MOST_DEGREE}", self.degree, "degree"))
        if self.samples_hz not in DATA_HZ:
            raise ValueError(expected(" or ".join(map(str, DATA_HZ)), self.samples_hz, "samples_hz"))
        _check_between("record_s", self.record_s, 40 / self.samples_hz, 60.0, "s")
        self._check_positions()
        self._check_methods()

    def _check_positions(self) -> None:
        missing = [p for p in POSITIONS if p not in self.positions]
        if missing:
            raise ValueError(expected("all six positions", f"none of {', '.join(missing)}", "positions"))
        unknown = [p for p in self.positions if p not in POSITIONS]
        if unknown or len(self.positions) != len(POSITIONS):
            raise ValueError(expected(f"{', '.join(POSITIONS)}, each once", ", ".join(self.positions), "positions"))

    def _check_methods(self) -> None:
        if self.soak is None and self.sweep is None:
            raise ValueError(expected("soak, sweep or both", "none", "schedule"))
        if self.soak and not all(self.low_c <= t <= self.high_c for t in self.soak.temperatures_c):
            got = f"{min(self.soak.temperatures_c):g} to {max(self.soak.temperatures_c):g}"
            raise ValueError(expected(f"within {self.low_c:g} to {self.high_c:g} degC", got, "soak: temperatures_c"))
        if self.soak and len(self.soak.temperatures_c) < self.degree + 2:
            least = f"{self.degree + 2} temperatures for degree {self.degree}"
            raise ValueError(expected(least, len(self.soak.temperatures_c), "soak: temperatures_c"))
        if self.sweep:
            least_s = HEAD_S + self.record_s
            _check_between("sweep: every_s", self.sweep.every_s, least_s, 3600.0, "s")
            for rate in self.sweep.rates():
                cycles = self._leg_s(rate) / self.sweep.every_s / len(POSITIONS)
                if cycles < self.degree + ENDS:
                    least = f"{self.degree + ENDS} rounds of the positions a leg for degree {self.degree}"
                    raise ValueError(expected(least, f"{cycles:.1f} at {rate:g} K/min", "sweep: every_s"))

    def _leg_s(self, rate: float) -> float:
        return (self.high_c - self.low_c) / rate * 60.0


# ---- what is done, and when


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """The chamber goes somewhere. at_s: s from the origin of the run."""

    at_s: float
    temp_degc: float
    ramp_k_per_min: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Take:
    """A recording that begins at at_s."""

    at_s: float
    segment: str  # soak; sweep-1, ...
    part: int  # of it: the temperature's number, the round of the positions
    position: Position


Action = Setting | Take


def sweep_names(s: Schedule) -> dict[str, float]:
    """Segments of the sweeps with their rates, K/min."""
    return {f"sweep-{k}": rate for k, rate in enumerate(s.sweep.rates(), start=1)} if s.sweep else {}


def planned_actions(s: Schedule, start_c: float) -> list[Action]:
    """Everything in order. start_c: what the chamber shows before the first setting."""
    plan = _Plan(s, start_c)
    made = [*(plan.soak_actions(s.soak) if s.soak else ())]
    for name, rate in sweep_names(s).items():
        made += plan.sweep_actions(name, rate)
    return made


class _Plan:
    """Time and temperature as the actions of a schedule pass."""

    def __init__(self, schedule: Schedule, start_c: float) -> None:
        self._schedule = schedule
        self._positions = [POSITIONS[name] for name in schedule.positions]
        self._t_s, self._temp_c = READY_S, start_c

    def _go_to(self, temp_c: float, ramp: float) -> Setting:
        made = Setting(at_s=self._t_s, temp_degc=temp_c, ramp_k_per_min=ramp)
        self._t_s = math.ceil(self._t_s + abs(temp_c - self._temp_c) / ramp * 60.0)
        self._temp_c = temp_c
        return made

    def soak_actions(self, soak: Soak) -> Iterator[Action]:
        each_s = math.ceil(HEAD_S + self._schedule.record_s)
        for part, temp_c in enumerate(soak.temperatures_c):
            yield self._go_to(temp_c, soak.ramp_k_per_min)
            self._t_s += math.ceil(soak.dwell_s)
            for position in self._positions:
                yield Take(at_s=self._t_s, segment=SOAK, part=part, position=position)
                self._t_s += each_s

    def sweep_actions(self, name: str, rate: float) -> Iterator[Action]:
        s, sweep = self._schedule, self._schedule.sweep
        assert sweep
        yield self._go_to(s.low_c, sweep.ramp_k_per_min)
        self._t_s += math.ceil(sweep.rest_s)
        begun_s, taken = self._t_s, 0
        for target_c in (s.high_c, s.low_c)[: 2 if sweep.legs == "both" else 1]:
            yield self._go_to(target_c, rate)
            self._t_s += math.ceil(sweep.turn_s)
            while begun_s + (taken + 1) * sweep.every_s <= self._t_s:
                at_s = begun_s + taken * sweep.every_s + HEAD_S
                part, k = divmod(taken, len(self._positions))
                yield Take(at_s=at_s, segment=name, part=part, position=self._positions[k])
                taken += 1


# ---- files


def read_schedule(name: str) -> Schedule:
    """Of this name (quick, full) or a YAML file. Raises BadInput with the file and the key."""
    found, path = read_named(name, NAMED, "schedules", "--schedule", "a schedule")
    return schedule_of_dict(found, str(path), path.stem)


def schedule_of_dict(found: object, where: str, name: str = "") -> Schedule:
    """Raises BadInput for what is no schedule."""
    try:
        top = _checked_keys(found, Schedule, "schedule") | {"name": name}
        soak, sweep = top.get("soak"), top.get("sweep")
        if sweep is not None:
            sweep = _checked_keys(sweep, Sweep, "sweep")
            if sweep.get("warm_up") is not None:
                sweep["warm_up"] = _made_part(WarmUp, _checked_keys(sweep["warm_up"], WarmUp, "warm_up"))
            top["sweep"] = _made_part(Sweep, sweep)
        if soak is not None:
            top["soak"] = _made_part(Soak, _checked_keys(soak, Soak, "soak"))
        return _made_part(Schedule, top)
    except (TypeError, ValueError, OverflowError) as e:
        raise BadInput(f"{where}: {e}") from e


def schedule_dict(s: Schedule) -> dict[str, Any]:
    """Of JSON's types; `schedule_of_dict` is the reverse."""
    return asdict(s)


def _checked_keys(found: object, kind: type[Any], where: str) -> dict[str, Any]:
    if not isinstance(found, Mapping):
        raise ValueError(expected("keys and values", found, where))
    unknown = [str(k) for k in found if k not in kind.__dataclass_fields__]
    if unknown:
        raise ValueError(expected(", ".join(k for k in kind.__dataclass_fields__ if k != "name"), unknown[0], where))
    return dict(found)


_CONVERTERS: Mapping[str, Callable[[Any], Any]] = {"float": float, "int": int, "str": str}


def _made_part(kind: type[Part], values: Mapping[str, Any]) -> Part:
    """The dataclass, with numbers as numbers. Raises ValueError with the key."""
    made = {}
    for name, value in values.items():
        declared = str(kind.__dataclass_fields__[name].type)  # type: ignore[attr-defined]
        made[name] = _convert_value(name, value, declared)
    missing = [n for n, f in kind.__dataclass_fields__.items() if n not in made and _has_no_default(f)]  # type: ignore[attr-defined]
    if missing:
        raise ValueError(expected(", ".join(missing), "none", kind.__name__.lower()))
    return kind(**made)


def _has_no_default(f: Any) -> bool:
    from dataclasses import MISSING

    return f.default is MISSING and f.default_factory is MISSING


def _convert_value(name: str, value: Any, declared: str) -> Any:
    if declared.startswith("tuple"):
        if not isinstance(value, Sequence) or isinstance(value, str):
            raise ValueError(expected("a list", value, name))
        each = _CONVERTERS["str" if "str" in declared else "float"]
        return tuple(_number_of(name, v, each) for v in value)
    return _number_of(name, value, _CONVERTERS[declared]) if declared in _CONVERTERS else value


def _number_of(name: str, value: Any, convert: Callable[[Any], Any]) -> Any:
    if convert is not str and (isinstance(value, bool) or not isinstance(value, int | float)):
        raise ValueError(expected("a number", value, name))
    if convert is int and not (math.isfinite(value) and value == int(value)):
        raise ValueError(expected("a whole number", value, name))
    return convert(value)
