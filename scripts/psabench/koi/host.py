"""The navigation computer's side of a flight: alignment, taxi, take-off, flight, and what the passport gets.

It takes raw increments, solutions of a receiver and barometric heights, and knows nothing else: the same from the wire,
from recordings and in campaigns. The filter is nav/koi.h; what is done with its estimates is here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from psabench.errors import BadInput, expected
from psabench.koi.autocal import FlightEstimate, filter_prior, nothing_known
from psabench.koi.flight_data import Event, Fix, FlightFound, FlightSetup
from psabench.koi.flight_series import FlightSeries
from psabench.koi.sensors import (
    instrument_class,
    sensor_names,
    sensor_rows,
    sensors_of_vector,
    state_names,
    vector_of_sensors,
)
from psabench.koi.stops import StopDetector
from psabench.koi.take_off import Decision, TakeOffDetector, decide_correction, taxi_of
from psabench.koi.trust import Evidence, Gate, find_doubts, trust_weight
from psabench.link.signals import Floats
from psabench.native.koi import Integrated, Kind, Koi, KoiConfig, Reason, Taken, coarse_alignment, koi_prior
from psabench.native.nav import ARCMIN
from psabench.native.strapdown import State

COARSE_LEVEL_RAD, COARSE_HEADING_RAD = 2.0 * ARCMIN, math.radians(1.5)  # of the coarse alignment (E0)
PARKED_SD_M, PARKED_SD_MPS = 5.0, 0.02  # of the place and of the velocity of rest (E0)
STOPS_REFUSED = 0.05  # during the alignment: more, and it has moved (E0)
NAVIGATION_STATES = 9
WHERE = "flight"


class FlightHost:
    """One flight. Raises BadInput, Refused."""

    def __init__(self, setup: FlightSetup) -> None:
        self.setup, self.cfg = setup, _alignment_config(setup.cfg)
        self.kind, self.names = instrument_class(setup.cfg), state_names(setup.cfg)
        known = setup.known or nothing_known(self.kind, setup.serial)
        self._p, self._prior = filter_prior(known, self.kind, setup.time_s)  # of the sensors
        self.events, self.doubts = list[Event](), list[str]()
        self.koi: Koi | None = None
        self._untouched: Koi | None = None  # beside it until take-off: without the receiver and stops
        self._parked, self._fixes = _Second(), list[Fix]()
        self._second, self._samples = _Second(), 0
        self._stop, self._take_off = StopDetector(setup.stop), TakeOffDetector(setup.take_off)
        self._at_rest = True
        self._series = FlightSeries()
        self._take_off_s: float | None = None
        self._decision: Decision | None = None
        self._x_take_off: Floats | None = None
        self._corrected = False

    @property
    def t_s(self) -> float:
        """Of the last increment."""
        return self._samples * float(self.cfg.sample_s)

    def push(self, dtheta_rad: Floats, dv_mps: Floats) -> None:
        """Raw increments (n, 3) each, any number."""
        for angle, speed in self._whole_seconds(dtheta_rad, dv_mps):
            self._samples += len(angle)
            self._second.add(angle, speed)
            if self.koi is None:
                self._parked.add(angle, speed)
                if self.t_s >= self.setup.align_s - 0.5 * self.cfg.sample_s:
                    self._align()
            else:
                self._fly(self.koi, angle, speed)
            if self._samples % self._per_second == 0:
                self._second = _Second()

    def take_fix(self, fix: Fix) -> None:
        """A solution of the receiver, after the increments up to its time."""
        if self.koi is None:
            self._fixes.append(fix)
            return
        place = [fix.lat_rad, fix.lon_rad, fix.h_m]
        reasons = (
            self.koi.take(Kind.POSITION, fix.t_s, place, valid=fix.valid),
            self.koi.take(Kind.VELOCITY, fix.t_s, fix.v_enu_mps, valid=fix.valid),
        )
        if Reason.REOPENED in reasons:
            self.doubt(expected("a filter whose gates stay open", "one that has reopened", WHERE))

    def take_height(self, t_s: float, h_m: float) -> None:
        """Of the barometer, after the increments up to its time."""
        for koi in (self.koi, self._untouched):
            if koi is not None:
                koi.take(Kind.HEIGHT, t_s, [h_m])

    def doubt(self, text: str) -> None:
        """The flight is not for the passport: what the feeder saw, such as increments that were lost."""
        self.doubts.append(text)
        self.events.append(Event(self.t_s, "doubt", text))

    def finish(self) -> FlightFound:
        """After the last increment. Raises BadInput for a flight that ended before its alignment."""
        if self.koi is None:
            raise BadInput(expected(f"{self.setup.align_s:g} s of increments at rest", f"{self.t_s:.2f} s", WHERE))
        koi, state = self.koi, self.koi.state
        estimate, verdict = self._estimate(koi, state)
        return FlightFound(
            names=self.names,
            **self._series.arrays(),
            events=tuple(self.events),
            take_off_s=self._take_off_s,
            decision=self._decision,
            x_take_off=self._x_take_off,
            x=koi.x,
            p=koi.p,
            taken=state.taken,
            estimate=estimate,
            verdict=verdict,
            corrected=self._corrected,
        )

    # ---- increments

    @property
    def _per_second(self) -> int:
        return round(1.0 / float(self.cfg.sample_s))

    def _whole_seconds(self, dtheta_rad: Floats, dv_mps: Floats) -> Iterator[tuple[Floats, Floats]]:
        """Cut where a second ends."""
        done, count = 0, len(dtheta_rad)
        while done < count:
            end = min(count, done + self._per_second - self._samples % self._per_second)
            yield dtheta_rad[done:end], dv_mps[done:end]
            done = end

    def _fly(self, koi: Koi, angle: Floats, speed: Floats) -> None:
        koi.push(angle, speed)
        if self._untouched is not None:
            self._untouched.push(angle, speed)
        if self._samples % self._per_second == 0:
            self._end_second(koi)

    def _end_second(self, koi: Koi) -> None:
        autonomous, hybrid = koi.solutions()
        speed_mps = math.hypot(hybrid[3], hybrid[4])
        at_rest = self._stop.take(*self._second.arrays(), self.cfg.sample_s, speed_mps)
        if at_rest != self._at_rest:
            self.events.append(Event(self.t_s, "stop" if at_rest else "moves"))
            self._at_rest = at_rest
        if at_rest:
            koi.take(Kind.STOP, self.t_s)
        self._series.add(self.t_s, autonomous, hybrid, koi)
        if self._take_off_s is None and self._take_off.take(self.t_s, speed_mps, float(hybrid[5])):
            self._leave_ground(koi)

    # ---- alignment

    def _align(self) -> None:
        angle, speed = self._parked.arrays()
        lat_rad, lon_rad, h_m = self.setup.place_rad_m or _median_place(self._fixes)
        coarse = round(self.setup.coarse_s * self._per_second)
        found = coarse_alignment(angle[:coarse], speed[:coarse], self.cfg.sample_s, lat_rad)
        at = State(lat_rad=lat_rad, lon_rad=lon_rad, h_m=h_m, v_n_mps=np.zeros(3), C_nb=found.begin_C_nb)
        sensors = sensors_of_vector(self.cfg, self._p)
        koi = Koi(self.cfg, 0.0, at, p=self._prior_at(at), sensors=sensors)
        for begin in range(0, len(angle), self._per_second):
            end = begin + self._per_second
            koi.push(angle[begin:end], speed[begin:end])
            koi.take(Kind.STOP, end * self.cfg.sample_s)
        take = np.zeros(koi.n, np.bool_)
        take[:NAVIGATION_STATES] = True
        koi.correct(take)
        self.koi, self._parked = koi, _Second()
        self._stop.take(angle[-self._per_second :], speed[-self._per_second :], self.cfg.sample_s, 0.0)
        self._untouched = Koi(self.cfg, self.t_s, koi.state.autonomous, x=koi.x, p=koi.p, sensors=sensors)
        self._say_alignment(koi, found.ratio)

    def _prior_at(self, at: State) -> Floats:
        """Covariance at the beginning, the sensors' part by what is known of the unit."""
        p, rows = koi_prior(self.cfg, at), sensor_rows(self.cfg)
        p[rows, rows] = self._prior
        return p

    def _say_alignment(self, koi: Koi, ratio: float) -> None:
        sd = koi.sd[4:7] / ARCMIN
        text = f"levels {sd[0]:.2f}', {sd[1]:.2f}', heading {sd[2]:.1f}' (1 sd); Earth's rate {ratio:.3f} of 1"
        self.events.append(Event(self.t_s, "aligned", text))
        counts = koi.state.taken[Kind.STOP].counts
        refused = 1.0 - counts[Reason.ACCEPTED] / max(1, sum(counts.values()))
        if refused > STOPS_REFUSED:
            what = f"at most {STOPS_REFUSED:.0%} of the seconds in motion"
            self.doubt(expected(what, f"{refused:.1%}", "alignment"))

    # ---- take-off

    def _leave_ground(self, koi: Koi) -> None:
        self._take_off_s, self._x_take_off = self.t_s, koi.x
        self.events.append(Event(self.t_s, "take-off"))
        t_s, speed_mps, heading_rad = self._series.ground()
        taxi = taxi_of(t_s, heading_rad, speed_mps)
        untouched = koi if self._untouched is None else self._untouched
        self._decision = decide_correction(self._evidence(koi, untouched), taxi, self.setup.decision)
        self._untouched = None
        self._corrected = self.setup.corrects and self._decision.passed and not self.doubts
        if self._corrected:
            koi.correct(self._decision.take)
            taken = [name for name, one in zip(self.names, self._decision.take, strict=True) if one]
            self.events.append(Event(self.t_s, "corrected", " ".join(taken)))
        else:
            why = "; ".join((*self._decision.reasons, *self.doubts)) or "not asked for"
            self.events.append(Event(self.t_s, "not corrected", why))

    def _evidence(self, koi: Koi, untouched: Koi) -> Evidence:
        """By what would be known without the receiver and stops."""
        state = koi.state
        return Evidence(
            names=self.names,
            x=koi.x - untouched.x,
            sd=koi.sd,
            prior_sd=untouched.sd,
            gates=_gates_of(state.taken),
            alone_s=state.alone_s,
        )

    # ---- the passport

    def _estimate(self, koi: Koi, state: Integrated) -> tuple[FlightEstimate, str]:
        rows, limits = sensor_rows(self.cfg), self.setup.trust
        x = vector_of_sensors(self.cfg, state.total)
        covariance = np.ascontiguousarray(koi.p[rows, rows])
        sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        evidence = Evidence(
            names=sensor_names(self.cfg),
            x=x - self._p,
            sd=sd,
            prior_sd=np.sqrt(np.diag(self._prior)),
            gates=_gates_of(state.taken),
            alone_s=state.alone_s,
        )
        verdict = "; ".join((*find_doubts(evidence, limits, "passport"), *self.doubts))
        weight = 0.0 if verdict else trust_weight(evidence.gates, limits)
        estimate = FlightEstimate(
            serial=self.setup.serial,
            names=evidence.names,
            time_s=self.setup.time_s,
            x=x if np.isfinite(x).all() else self._p,
            covariance=covariance if np.isfinite(covariance).all() else self._prior,
            weight=weight,
        )
        return estimate, verdict


class _Second:
    """Increments that are collected."""

    def __init__(self) -> None:
        self._parts: list[tuple[Floats, Floats]] = []

    def add(self, angle: Floats, speed: Floats) -> None:
        self._parts.append((angle, speed))

    def arrays(self) -> tuple[Floats, Floats]:
        angle, speed = (np.concatenate(parts) for parts in zip(*self._parts, strict=True))
        return angle, speed


def _alignment_config(cfg: KoiConfig) -> KoiConfig:
    """The filter's beginning: by the coarse alignment, at rest."""
    own = KoiConfig.from_buffer_copy(cfg)
    own.alignment_s, own.alpha_sd_rad, own.beta3_sd_rad = 0.0, COARSE_LEVEL_RAD, COARSE_HEADING_RAD
    own.dr_sd_m[:], own.dv_sd_mps[:] = [PARKED_SD_M] * 3, [PARKED_SD_MPS] * 3
    return own


def _median_place(fixes: list[Fix]) -> tuple[float, float, float]:
    rows = np.array([(f.lat_rad, f.lon_rad, f.h_m) for f in fixes if f.valid]).reshape(-1, 3)
    rows = rows[np.isfinite(rows).all(axis=1)]
    if not len(rows):
        raise BadInput(expected("a place, or valid solutions of the receiver", "none", "alignment"))
    lat_rad, lon_rad, h_m = (float(x) for x in np.median(rows, axis=0))
    return lat_rad, lon_rad, h_m


def _gates_of(taken: dict[Kind, Taken]) -> dict[str, Gate]:
    return {kind.name.lower(): _gate_of(t) for kind, t in taken.items() if sum(t.counts.values())}


def _gate_of(t: Taken) -> Gate:
    gated = t.counts[Reason.GATED] + t.counts[Reason.OUTLIER]
    return Gate(taken=t.counts[Reason.ACCEPTED], gated=gated, nis_sum=t.nis_sum, nis_dof=t.nis_dof)
