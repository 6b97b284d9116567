"""One unit flies flight after flight; the host does as the mode says. What is drawn is the same in all modes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from psabench.koi.autocal import Knowledge, nothing_known, update_knowledge
from psabench.koi.fleet.classes import CLASSES, Sizes
from psabench.koi.fleet.conditions import CONDITIONS, draw_episode
from psabench.koi.fleet.grade import COLUMNS, Against, grade_flight
from psabench.koi.fleet.receiver import Solutions, draw_heights, draw_solutions
from psabench.koi.fleet.routes import ROUTES, Journey, fly_route
from psabench.koi.fleet.unit import SECOND, Errors, Readings, draw_readings, draw_unit
from psabench.koi.flight_data import Fix, FlightFound, FlightSetup
from psabench.koi.host import FlightHost
from psabench.koi.sensors import instrument_class
from psabench.link.signals import Floats
from psabench.native.koi import KoiConfig, UnitClass, koi_default
from psabench.quartz.draws import draw_source

DAY_S = 86_400.0
PARKED_S = 600.0
VERTICAL_RATIO = 1.5  # as receivers of satellite navigation are (E0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Mode:
    """What the host does with its estimates."""

    title: str
    corrects: bool  # at take-off: довыставка
    learns: bool  # from flight to flight: автокалибровка


MODES: Mapping[str, Mode] = {
    "none": Mode(title="neither", corrects=False, learns=False),
    "dov": Mode(title="correction at take-off", corrects=True, learns=False),
    "auto": Mode(title="learning from flights", corrects=False, learns=True),
    "both": Mode(title="both", corrects=True, learns=True),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Season:
    """What determines the flights of each unit."""

    unit_class: str
    condition: str
    mode: str
    flights: int
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A flight as it comes to the host, and its truth."""

    journey: Journey
    readings: Readings
    solutions: Solutions
    heights_m: Floats
    stays: Errors

    @property
    def against(self) -> Against:
        return Against(journey=self.journey, readings=self.readings, delays_s=self.solutions.delays_s, stays=self.stays)


def host_config(unit_class: str) -> KoiConfig:
    """The host's own idea of the class; of its receiver it knows that the vertical velocity is worse."""
    cfg = koi_default(UnitClass[unit_class.upper()])
    cfg.velocity_sd_mps[2] *= VERTICAL_RATIO
    return cfg


def fly_season(s: Season, unit: int) -> Floats:
    """(flights, columns of grade.COLUMNS)."""
    cfg, mode, serial = host_config(s.unit_class), MODES[s.mode], f"unit {unit}"
    kind = instrument_class(cfg)
    known = nothing_known(kind, serial) if mode.learns else None
    rows = np.empty((s.flights, len(COLUMNS)))
    for k in range(s.flights):
        drawn = draw_flight(s, unit, k)
        found = fly_host(drawn, cfg, mode, known, serial, DAY_S * k)
        if known is not None:
            known = update_knowledge(known, kind, found.estimate)
        rows[k] = grade_flight(found, drawn.against, known)
    return rows


def draw_flight(s: Season, unit: int, flight: int) -> Drawn:
    """By class, condition and seed alone."""
    names = list(ROUTES)
    return draw_on(fly_route(names[flight % len(names)]), CLASSES[s.unit_class], s.condition, s.seed, unit, flight)


def draw_on(j: Journey, sizes: Sizes, condition: str, seed: int, unit: int, flight: int) -> Drawn:
    """The same on any journey."""
    c, name = CONDITIONS[condition], f"koi unit {unit} flight {flight}"
    stays = draw_unit(sizes.unit, seed, unit)
    episode = draw_episode(c, j, PARKED_S, draw_source(seed, f"{name} episode"))
    return Drawn(
        journey=j,
        readings=draw_readings(sizes.unit, stays, j.dtheta_rad, j.dv_mps, draw_source(seed, f"{name} unit")),
        solutions=draw_solutions(sizes.receiver, j, c, episode, draw_source(seed, f"{name} receiver")),
        heights_m=draw_heights(sizes.baro, j, draw_source(seed, f"{name} altimeter")),
        stays=stays,
    )


def fly_host(d: Drawn, cfg: KoiConfig, mode: Mode, known: Knowledge | None, serial: str, time_s: float) -> FlightFound:
    """The host is given what it would be given on board, and the place of the stand."""
    start = d.journey.path.states(np.zeros(1, np.int64))
    place = float(start.lat_rad[0]), float(start.lon_rad[0]), float(start.h_m[0])
    host = FlightHost(
        FlightSetup(
            cfg=cfg,
            serial=serial,
            time_s=time_s,
            known=known,
            corrects=mode.corrects,
            place_rad_m=place,
        )
    )
    r, s = d.readings, d.solutions
    for k in range(d.journey.seconds):
        part = slice(SECOND * k, SECOND * (k + 1))
        host.push(r.dtheta_rad[part], r.dv_mps[part])
        host.take_fix(fix_of(s, k))
        host.take_height(float(s.t_s[k]), float(d.heights_m[k]))
    return host.finish()


def fix_of(s: Solutions, k: int) -> Fix:
    """What the receiver puts out at its k-th second."""
    lat, lon, h = (float(x) for x in s.place_rad_m[k])
    east, north, up = (float(x) for x in s.v_enu_mps[k])
    return Fix(
        t_s=float(s.t_s[k]), lat_rad=lat, lon_rad=lon, h_m=h, v_enu_mps=(east, north, up), valid=bool(s.valid[k])
    )
