"""The same season from the filter's covariance alone: no units are drawn.

An ideal unit flies each route with an ideal receiver. The filter's own jacobians carry the covariance of the errors on
from the end of the alignment (nothing corrected) and from take-off (corrected); what a flight teaches is the filter's
covariance at its end. Left out: what is not linear, slow errors of the receiver, its delays beyond their prior, gates,
units that do not correct themselves, counts, the altimeter's scale; persistent and run-to-run parts are the filter's.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.metadata import version
from itertools import product
from pathlib import Path

import numpy as np

from psabench.campaign import builds
from psabench.campaign.store import CELL, Origin, Part, Store
from psabench.koi.autocal import Knowledge, nothing_known, update_knowledge
from psabench.koi.fleet.grade import MINUTES
from psabench.koi.fleet.routes import DT_S, ROUTES, Journey, fly_route
from psabench.koi.fleet.season import DAY_S, MODES, host_config
from psabench.koi.fleet.unit import SECOND
from psabench.koi.fleet.work import Fleet
from psabench.koi.flight_data import Fix, FlightSetup
from psabench.koi.host import FlightHost
from psabench.koi.sensors import instrument_class
from psabench.koi.take_off import NAVIGATION, DecisionLimits
from psabench.link.signals import Floats
from psabench.native import clib
from psabench.native.koi import Koi, KoiConfig
from psabench.procedures.head_bench import Progress

MINUTES_OF = range(MINUTES + 1)
Predicted = Mapping[tuple[str, str], Floats]  # by class and mode: (flights, minutes + 1, 2), north and east, rms, m


class IdealFeed:
    """Increments and measurements without errors."""

    def __init__(self, j: Journey) -> None:
        self.j, self.s = j, j.path.states(np.arange(j.seconds + 1, dtype=np.int64) * 10**9)

    def place_at(self, t: int) -> tuple[float, float, float]:
        return float(self.s.lat_rad[t]), float(self.s.lon_rad[t]), float(self.s.h_m[t])

    def push_second(self, host: FlightHost, t: int) -> None:
        """The second that ends at t."""
        for _ in self.push_steps(host, t, SECOND):
            pass

    def push_steps(self, host: FlightHost, t: int, each: int) -> Iterator[None]:
        """In pieces."""
        for begin in range(SECOND * (t - 1), SECOND * t, each):
            host.push(self.j.dtheta_rad[begin : begin + each], self.j.dv_mps[begin : begin + each])
            yield

    def give_measurements(self, host: FlightHost, t: int) -> None:
        lat, lon, h = self.place_at(t)
        east, north, up = (float(x) for x in self.s.v_enu_mps[t])
        host.take_fix(Fix(t_s=float(t), lat_rad=lat, lon_rad=lon, h_m=h, v_enu_mps=(east, north, up)))
        host.take_height(float(t), h)


@dataclass
class Track:
    """Covariance of the errors of an autonomous solution, (n, n), without measurements."""

    cfg: KoiConfig
    names: tuple[str, ...]
    p: Floats

    def predict_step(self, phi: Floats, q: Floats) -> None:
        """One step of the filter's: rows of what moves; the rest stays."""
        m = len(phi)
        moved = phi @ self.p
        self.p[:m] = moved
        self.p[:, :m] = moved.T
        self.p[:m, :m] = moved @ phi.T + q

    def damp_height(self, dt_s: float) -> None:
        """The altimeter's say in the autonomous height (koi.h)."""
        height, climb, baro = (self.names.index(name) for name in ("dr3", "dV3", "baro"))
        f = np.eye(len(self.p))
        for row, gain in ((height, self.cfg.damping_per_s), (climb, self.cfg.damping_per_s2)):
            f[row, height] -= gain * dt_s
            f[row, baro] += gain * dt_s
        self.p = f @ self.p @ f.T

    @property
    def place_m(self) -> Floats:
        """Standard deviations, north and east."""
        return np.asarray(np.sqrt(np.array([self.p[1, 1], self.p[0, 0]])))


@dataclass
class Tracks:
    """Both solutions of a flight, minute by minute from take-off."""

    untouched: Track
    corrected: Track | None = None
    rows: dict[bool, list[Floats]] = field(default_factory=lambda: {False: [], True: []})

    def leave_ground(self, koi: Koi) -> None:
        """After a correction: x less what was taken off, where x and its estimate share U - P."""
        u, p = self.untouched.p, koi.p
        ratio = np.sqrt(np.diag(p) / np.diag(u))
        whole = np.array([name.startswith(NAVIGATION) for name in self.untouched.names])
        s = np.diag((whole | (ratio < DecisionLimits().converged)).astype(float))
        shared = (u - p) @ s
        self.corrected = replace(self.untouched, p=u - shared - shared.T + s @ shared)

    def fly_second(self, host: FlightHost, koi: Koi, feed: IdealFeed, t: int) -> None:
        """On with both, up to time t."""
        for _ in feed.push_steps(host, t, round(float(host.cfg.step_s) / DT_S)):
            phi, q = koi.jacobians()
            for track in self._both():
                track.predict_step(phi, q)
        if self.corrected is None and host.events[-1].what == "not corrected":
            self.leave_ground(koi)
        for track in self._both():
            track.damp_height(1.0)

    def _both(self) -> list[Track]:
        return [t for t in (self.untouched, self.corrected) if t is not None]

    def note_minute(self) -> None:
        """At a minute of the flight."""
        for corrects, track in ((False, self.untouched), (True, self.corrected)):
            self.rows[corrects].append((track or self.untouched).place_m)


def predict_fleet(fleet: Fleet, store: Store, progress: Progress) -> Predicted:
    """Of every class and mode; the units' number does not matter. What the store lacks is computed and put there."""
    chains = [(name, learns) for name in fleet.classes for learns in (False, True)]
    wanted = [one for one in chains if not all(_is_there(fleet, store, one[0], mode) for mode in modes_of(one[1]))]
    if wanted:
        with progress.step("covariances, seasons", len(wanted)) as done:
            for name, learns in wanted:
                store.put(_season_parts(fleet, name, learns=learns))
                done()
    shape = fleet.flights, len(MINUTES_OF), 2
    return {
        (name, mode): store.rows(make_origin(fleet, name, mode), 1).astype(np.float64).reshape(shape)
        for name in fleet.classes
        for mode in MODES
    }


def modes_of(learns: bool) -> list[str]:
    """That a passport goes along with, or none."""
    return [mode for mode, m in MODES.items() if m.learns == learns]


def make_origin(fleet: Fleet, unit_class: str, mode: str) -> Origin:
    """Of the series of the store: one row."""
    return Origin(
        kind="koi fleet, covariance",
        input={"unit_class": unit_class, "mode": mode, "flights": fleet.flights},
        seed=0,
        version=f"psabench {version('psabench')}",
        build=own_digest(),
        columns=tuple(
            f"flight {k + 1} {i} min {a}" for k, i, a in product(range(fleet.flights), range(MINUTES + 1), "ne")
        ),
    )


@cache
def own_digest() -> str:
    """SHA-256 of both libraries and of the code that takes part."""
    return builds.digest([Path(clib.library().path), *builds.sources("psabench.koi.fleet.linear")]) + builds.algebra()


def _is_there(fleet: Fleet, store: Store, unit_class: str, mode: str) -> bool:
    return 0 in store.runs(make_origin(fleet, unit_class, mode))


def _season_parts(fleet: Fleet, unit_class: str, *, learns: bool) -> list[Part]:
    names = list(ROUTES)
    journeys = [fly_route(names[k % len(names)]) for k in range(fleet.flights)]
    rows = predict_season(unit_class, journeys, learns=learns)
    return [
        Part(
            origin=make_origin(fleet, unit_class, mode),
            first_run=0,
            rows=np.array([row[MODES[mode].corrects] for row in rows]).reshape(1, -1).astype(CELL),
        )
        for mode in modes_of(learns)
    ]


def predict_season(unit_class: str, journeys: list[Journey], *, learns: bool) -> list[Mapping[bool, Floats]]:
    """Of each flight: (minutes + 1, 2) without and with a correction at take-off."""
    cfg = host_config(unit_class)
    kind = instrument_class(cfg)
    known, rows = nothing_known(kind, "ideal"), list[Mapping[bool, Floats]]()
    flown: dict[int, Mapping[bool, Floats]] = {}  # what does not learn does on a route as it did before
    for k, journey in enumerate(journeys):
        if learns or id(journey) not in flown:
            tracks, host = fly_ideal(journey, cfg, known, DAY_S * k)
            flown[id(journey)] = {corrects: np.array(track) for corrects, track in tracks.rows.items()}
        rows.append(flown[id(journey)])
        if learns:
            known = update_knowledge(known, kind, replace(host.finish().estimate, weight=1.0))
    return rows


def fly_ideal(j: Journey, cfg: KoiConfig, known: Knowledge, time_s: float) -> tuple[Tracks, FlightHost]:
    """Step by step of the filter's. Raises BadInput for a journey that ends before its alignment."""
    feed = IdealFeed(j)
    setup = FlightSetup(
        cfg=cfg, serial="ideal", time_s=time_s, known=known, corrects=False, place_rad_m=feed.place_at(0)
    )
    host = FlightHost(setup)
    align_s = round(setup.align_s)
    for t in range(1, align_s + 1):
        feed.push_second(host, t)
        feed.give_measurements(host, t)
    assert host.koi is not None
    tracks = Tracks(Track(cfg=cfg, names=host.names, p=host.koi.p))
    up_s = int(np.ceil(j.take_off_s))
    minutes = {up_s + 60 * k for k in MINUTES_OF}
    for t in range(align_s + 1, j.seconds + 1):
        tracks.fly_second(host, host.koi, feed, t)
        if t in minutes:
            tracks.note_minute()
        feed.give_measurements(host, t)
    return tracks, host
