"""The bench of the gyrocompass procedures over the wire: a gyro unit, and the PSA-2 that reads its level sensors.

The frames of the PSA-2 flow all the time: the gyro unit lives on them. Level angles of a window come from these frames,
averaged over the same ones as the controller's own (LEVEL_SEQ), or from the readings of the gyro unit.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from psabench.bench import Bench
from psabench.boards.gyro.device import Flag, Gyro, Mode, Phase
from psabench.boards.gyro.watch import FLAG_WORDS, NavigationWatch
from psabench.boards.psa2.device import Psa2
from psabench.boards.readings import Readings
from psabench.errors import BenchError, LinkError, expected
from psabench.estimate.angles import wrapped_deg
from psabench.link import signals as bits
from psabench.native.nav import DEGPH
from psabench.procedures.platform_bench import Compensation, Floats, Look, Table, Window

SLICE_S = 0.5  # between looks at what has come
TURN_SLACK_S = 10.0  # beyond what a turn takes at its rate: it accelerates, and may be slower than asked
AWAY_S = 10.0  # waits from here on are spent away from the bus
SEQ_BITS = 16
SEQ_MODULUS = 1 << SEQ_BITS
READY_S = 60.0  # timeout for the run-up of the gyroscope
BUSY_ABORT = 0x08000022  # CiA 301: not in the present state of the device
DEG = 180.0 / math.pi

LEVEL_SPANS, LEVEL_REST_S = 15.0, 10.0  # timeout of levelling: time constants of the loop, and the torquer's own time
LEVEL_LOOKS, LEVEL_LOOK_S = 10, 0.1  # at beta, before the platform counts as level
SELF_TEST_S, SELF_TEST_LOOK_S = 10.0, 1.2  # the unit nods for 1 to 5 s


@dataclass(frozen=True, slots=True, kw_only=True)
class _LevelScale:
    """What volts of the level sensors mean; docs/reference/protocol_gyro.md, object 2109h."""

    zero_x_v: float
    zero_y_v: float
    scale_x_v_per_g: float
    scale_y_v_per_g: float

    def angles(self, x_v: Floats, y_v: Floats) -> tuple[Floats, Floats]:
        """(beta, gamma), rad."""
        beta = np.arcsin(np.clip((y_v - self.zero_y_v) / self.scale_y_v_per_g, -1.0, 1.0))
        g = -(x_v - self.zero_x_v) / (self.scale_x_v_per_g * np.cos(beta))
        return beta, np.arcsin(np.clip(g, -1.0, 1.0))


class WirePlatform:
    """A `procedures.platform_bench.PlatformBench` of a bench with a gyro unit."""

    def __init__(
        self, bench: Bench, *, signals: str = "frames", watch: Callable[[float], None] = lambda _: None
    ) -> None:
        """signals: where the level angles of a window come from, "frames" or "readings".

        watch: called every SLICE_S of a run, with the time of the newest reading.
        """
        self._bench, self._watch_run = bench, watch
        self.gyro = bench.board(Gyro)
        self.level_unit = self._find_level_unit()
        self._from_frames = signals == "frames"
        self._scale = _LevelScale(
            **{n: self.gyro.get(n) for n in ("zero_x_v", "zero_y_v", "scale_x_v_per_g", "scale_y_v_per_g")}
        )
        self.step_s = self.gyro.step_s  # of the controller, and of the readings
        self._m1_per_s = self._latitude_rad = 0.0
        self._set_rad = 0.0
        self._watch: NavigationWatch | None = None  # it was commanded to navigate, and nothing else since

    def _find_level_unit(self) -> Psa2:
        node = self.gyro.level_node
        for unit in self._bench.units.values():
            if isinstance(unit, Psa2) and unit.node.node_id == node:
                return unit
        raise LinkError(expected(f"a PSA-2 at node {node} that reads the level sensors", "none", "platform"))

    # ---- PlatformBench

    @property
    def t_s(self) -> float:
        return self._bench.time_s

    def wait(self, dwell_s: float) -> None:
        if dwell_s >= AWAY_S:
            self._bench.wait_away(dwell_s)
        else:
            self._bench.wait(max(0.0, dwell_s))

    def prepare(self, *, latitude_rad: float, m1_per_s: float, m2_per_s: float) -> None:
        """Settings of the loops; compensations, speed and streams off."""
        self.level_unit.wait_ready()
        self.level_unit.start()  # the gyro unit hears its frames, too
        self.gyro.stop()
        self.gyro.set(latitude_deg=latitude_rad * DEG, speed_mps=0.0, drift1_degph=0.0, drift2_degph=0.0)
        self.gyro.set(m1_per_s=m1_per_s, m2_per_s=m2_per_s)
        self._m1_per_s, self._latitude_rad = self.gyro.get("m1_per_s"), latitude_rad

    def level(self, timeout_s: float) -> None:
        """Level; beta must lie within the unit's own tolerance for a second.

        It may take 15 time constants of the loop, or timeout_s: what is not level by then never is.
        """
        limit_s = min(timeout_s, LEVEL_SPANS / self._m1_per_s + LEVEL_REST_S) if self._m1_per_s else timeout_s
        self._begin(Mode.LEVEL)
        tolerance_deg = self.gyro.get("tolerance_arcmin") / 60.0
        deadline_s = self.t_s + limit_s
        looks = 0
        while looks < LEVEL_LOOKS:
            if self.t_s >= deadline_s:
                off_arcmin = 60.0 * abs(self.gyro.beta_deg)
                raise LinkError(expected(f"a level platform within {limit_s:g} s", f"{off_arcmin:.1f}' off"))
            self.wait(LEVEL_LOOK_S)
            self._raise_for(self.gyro.flags & ~Flag.SATURATED, "levelling")
            looks = looks + 1 if abs(self.gyro.beta_deg) < tolerance_deg else 0

    def measure(self, table: Table, done: Callable[[Window], None]) -> Sequence[Window]:
        """See `PlatformBench`."""
        self.gyro.positions_deg = table.angles_deg
        self.gyro.set(repeat=table.repeat, window_s=table.window_s, slew_dps=table.slew_dps, freeze=table.freeze)
        self.gyro.set(settle_s=table.settle_s, settle_limit_s=table.settle_limit_s)
        self._begin(Mode.GYROCOMPASS)
        windows = []
        turn_s = 360.0 / table.slew_dps + TURN_SLACK_S
        timeout_s = turn_s + table.settle_s + table.settle_limit_s + table.window_s
        for w in self._windows(table.sequence_deg, timeout_s):
            windows.append(w)
            done(w)
        self._set_rad = windows[-1].set_rad
        return windows

    def calibrate(self, length_s: float, settle_s: float) -> Window:
        """See `PlatformBench`."""
        self.gyro.set(calibration_s=length_s, settle_s=settle_s)
        self._begin(Mode.CALIBRATE)
        timeout_s = TURN_SLACK_S + settle_s + self.gyro.get("settle_limit_s") + length_s
        return next(iter(self._windows([self._set_rad * DEG], timeout_s)))

    def navigate(self, c: Compensation) -> None:
        """See `PlatformBench`."""
        self.gyro.set(azimuth_deg=wrapped_deg(c.azimuth_rad * DEG))
        self.gyro.set(drift1_degph=c.drift1_radps / DEGPH, drift2_degph=c.drift2_radps / DEGPH)
        self._begin(Mode.NAVIGATE)

    def moved(self, *, latitude_rad: float, speed_mps: float, track_rad: float) -> None:
        self._latitude_rad = latitude_rad
        self.gyro.set(latitude_deg=latitude_rad * DEG, speed_mps=speed_mps, track_deg=wrapped_deg(track_rad * DEG))

    def look(self) -> Look:
        """Heading first; in navigation then a self test, which turns it for a second, and what became of the unit."""
        t_s = self.t_s
        encoder_rad, heading_rad = math.radians(self.gyro.encoder_deg), math.radians(self.gyro.heading_deg)
        if self._watch:
            self._self_test()
            faults = self._watch.faults(self.t_s)
        else:
            faults = self._in_words(self.gyro.flags)
        return Look(t_s=t_s, encoder_rad=encoder_rad, heading_rad=heading_rad, faults=faults)

    # ---- beside the platform, for `heading_modes`

    def encoder_rad(self) -> float:
        """Of the outer gimbal, now."""
        return math.radians(self.gyro.encoder_deg)

    def magnetic_rad(self) -> float:
        """Heading by the induction sensor, now. Raises LinkError where none is fitted."""
        if not self.gyro.has_magnetic:
            raise LinkError(expected("an induction sensor (section magnetic of the scenario)", "none", "gyro unit"))
        return math.radians(self.gyro.magnetic_deg)

    def _self_test(self) -> None:
        """What it finds is among the flags. A unit that has left navigation has none."""
        if self.gyro.mode is not Mode.NAVIGATE:
            return
        self.gyro.begin_self_test()
        deadline_s = self.t_s + SELF_TEST_S
        self.wait(SELF_TEST_LOOK_S)
        while self.gyro.self_test is None:
            if self.t_s >= deadline_s:
                raise LinkError(f"the self test of the gyro unit has not ended after {SELF_TEST_S:g} s")
            self.wait(SLICE_S)

    # ---- a run

    def _begin(self, mode: Mode) -> None:
        """Into a mode; while the gyroscope runs up the unit rejects, and this waits."""
        deadline_s = self.t_s + READY_S
        while True:
            try:
                self.gyro.mode = mode
                self._watch = NavigationWatch(self.gyro, self.t_s) if mode is Mode.NAVIGATE else None
                return
            except BenchError as e:
                if getattr(e, "abort_code", 0) != BUSY_ABORT or self.t_s >= deadline_s:
                    raise
                self.wait(1.0)

    @staticmethod
    def _in_words(flags: Flag) -> tuple[str, ...]:
        return tuple(words for flag, words in FLAG_WORDS.items() if flag in flags)

    def _raise_for(self, flags: Flag, doing: str) -> None:
        if words := self._in_words(flags):
            raise LinkError(f"{doing}: {'; '.join(words)}")

    def _windows(self, angles_deg: Sequence[float], timeout_s: float) -> Iterator[Window]:
        """Those of the run under way, each when it is over. Raises LinkError when the run ends before the last, or one
        does not come within timeout_s.
        """
        tape = _Tape(self.step_s)
        self.gyro.frames.forget()
        self.level_unit.frames.forget()
        self.gyro.start()
        try:
            for number, angle_deg in enumerate(angles_deg):
                deadline_s = self.t_s + timeout_s
                while (span := tape.window()) is None:
                    self._still_running(tape, number + 1)
                    if self.t_s > deadline_s:
                        raise LinkError(f"position {number + 1} was not measured in {timeout_s:.0f} s: {tape.state}")
                    self.wait(SLICE_S)
                    if tape.add(self.gyro, self.level_unit):
                        self._watch_run(tape.newest_s)
                yield self._of(tape, span, number, math.radians(angle_deg))
                tape.drop(span.stop)
        finally:
            self.gyro.stop()

    def _still_running(self, tape: _Tape, wanted: int) -> None:
        """Raises LinkError where the unit has left the run."""
        if tape.latest("MODE", Mode.GYROCOMPASS) in (Mode.GYROCOMPASS, Mode.CALIBRATE):
            return
        words = "; ".join(self._in_words(self.gyro.flags)) or "it does not say why"
        raise LinkError(f"the run ended before position {wanted} was measured: {words}")

    def _of(self, tape: _Tape, span: slice, number: int, set_rad: float) -> Window:
        """A window of what the streams brought."""
        r = {name: tape.readings[name][span] for name in tape.readings}
        beta, gamma = np.radians(r["BETA"]), np.radians(r["GAMMA"])
        lost = int((np.diff(r["STEP"]) % SEQ_MODULUS - 1).sum())
        if self._from_frames:
            x_v, y_v, missing = tape.means(span)
            lost += missing
            beta, gamma = self._scale.angles(x_v, y_v)
        return Window(
            number=number,
            set_rad=set_rad,
            t_mid_s=float(r["t_rx_s"][0] + r["t_rx_s"][-1]) / 2.0,
            beta_rad=beta,
            gamma_rad=gamma,
            u1_radps=r["U1"] * DEGPH,
            u2_radps=r["U2"] * DEGPH,
            encoder_rad=np.radians(r["ENCODER"]),
            turned_rad=r["turned_rad"],
            missed=int(r["missed"][-1]),
            step_s=self.step_s,
            m1_per_s=self._m1_per_s,
            latitude_rad=self._latitude_rad,
            lost=lost,
            **{str(f.name).lower(): bool(r[str(f.name)].any()) for f in Flag},
        )


class _Tape:
    """Readings of the gyro unit and frames of the level unit, as far as they are not used up."""

    def __init__(self, step_s: float) -> None:
        self._step_s = step_s
        self.readings: dict[str, Floats] = {}  # columns, t_rx_s, turned_rad, missed
        self._before = (-1, 0.0, 0.0, 0)  # STEP of the last reading, its rate, turned_rad and missed
        self._seq: bits.Ints = np.zeros(0, dtype=np.int64)
        self._u_v: Floats = np.zeros((0, 3))
        self.newest_s = 0.0  # when the newest reading came

    def add(self, gyro: Gyro, level_unit: Psa2) -> bool:
        """What has come since. False: no reading."""
        r, f = gyro.frames.take(), level_unit.frames.take()
        assert isinstance(r, Readings)
        new = {**r.columns, "t_rx_s": r.t_rx_s, **self._turned(r.columns)}
        self.readings = {k: np.concatenate([self.readings[k], v]) if k in self.readings else v for k, v in new.items()}
        self._seq, self._u_v = np.concatenate([self._seq, f.seq]), np.concatenate([self._u_v, f.u_v])
        if len(self.readings["PHASE"]) and not np.any(self.readings["PHASE"] == Phase.WINDOW):
            self.drop(len(self.readings["PHASE"]))  # turns may take longer than the counter of the frames takes to wrap
        if len(r):
            self.newest_s = float(r.t_rx_s[-1])
        return bool(len(r))

    def _turned(self, r: Mapping[str, Floats]) -> dict[str, Floats]:
        """What the torquers turned the platform by about the vertical since the first reading, and readings missed.

        alpha' without drifts and Earth, from (3): (u2 cos gamma - u1 sin gamma)/cos beta; rates last a step.
        """
        beta, gamma = np.radians(r["BETA"]), np.radians(r["GAMMA"])
        rate = (r["U2"] * np.cos(gamma) - r["U1"] * np.sin(gamma)) / np.cos(beta) * DEGPH
        step, last_rate, turned_rad, missed = self._before
        if not len(rate):
            return {"turned_rad": rate, "missed": rate}
        first = int(r["STEP"][0]) - 1 if step < 0 else step
        steps = np.diff(np.concatenate([[first], r["STEP"]])) % SEQ_MODULUS
        turned = turned_rad + np.cumsum(np.concatenate([[last_rate], rate[:-1]]) * steps) * self._step_s
        gone = missed + np.cumsum(steps - 1)
        self._before = (int(r["STEP"][-1]), float(rate[-1]), float(turned[-1]), int(gone[-1]))
        return {"turned_rad": turned, "missed": gone}

    def latest(self, name: str, default: float) -> float:
        """Of the newest reading."""
        column = self.readings.get(name, np.zeros(0))
        return float(column[-1]) if len(column) else default

    @property
    def state(self) -> str:
        """What the unit was last seen to do."""
        if not len(self.readings.get("PHASE", ())):
            return "no reading of the gyro unit came"
        return f"the gyro unit stays in phase {Phase(int(self.latest('PHASE', 0.0))).name.lower()}"

    def window(self) -> slice | None:
        """The readings of the first window that is over; None: there is none yet."""
        if not self.readings:
            return None
        inside = self.readings["PHASE"] == Phase.WINDOW
        starts = np.flatnonzero(inside)
        if not starts.size:
            return None
        same = inside & (self.readings["POSITION"] == self.readings["POSITION"][starts[0]])
        after = np.flatnonzero(~same[starts[0] :])
        return slice(int(starts[0]), int(starts[0] + after[0])) if after.size else None

    def drop(self, count: int) -> None:
        """Forget the first readings, and the frames that belong to them; the last of them stays as the one before."""
        last = int(self.readings["LEVEL_SEQ"][count - 1])
        self.readings = {k: v[count - 1 :] for k, v in self.readings.items()}
        self.readings["PHASE"] = np.concatenate([[Phase.IDLE], self.readings["PHASE"][1:]])
        keep = _ahead(self._seq, last) > 0
        self._seq, self._u_v = self._seq[keep], self._u_v[keep]

    def means(self, span: slice) -> tuple[Floats, Floats, int]:
        """Mean volts of X and Y of the frames of each step, and how many frames are missing. Raises LinkError.

        Those of a step follow the last frame of the step before it (LEVEL_SEQ) up to its own.
        """
        first = max(span.start - 1, 0)
        steps = self.readings["LEVEL_SEQ"][first : span.stop].astype(np.int64)
        steps = steps if span.start else np.concatenate([steps[:1], steps])
        edges = np.concatenate([[0], np.cumsum(np.diff(steps) % SEQ_MODULUS)])  # frames since the first of them
        at = _ahead(self._seq, int(steps[0]))
        ours = (at > 0) & (at <= edges[-1])
        step_of = np.searchsorted(edges, at[ours]) - 1
        count = np.bincount(step_of, minlength=len(edges) - 1)
        empty = count == 0
        if empty.all():
            raise LinkError(expected("frames of the level unit in the window", "none"))
        sums = [np.bincount(step_of, self._u_v[ours, k], minlength=len(count)) for k in (0, 1)]
        x_v, y_v = (s / np.maximum(count, 1) for s in sums)
        x_v[empty], y_v[empty] = x_v[~empty].mean(), y_v[~empty].mean()
        return x_v, y_v, int(edges[-1] - ours.sum())


def _ahead(seq: bits.Ints, of: int) -> bits.Ints:
    """How many frames after number `of` each of consecutive frames is; the first within half a turn of the counter."""
    if not seq.size:
        return seq
    first = (int(seq[0]) - of + SEQ_MODULUS // 2) % SEQ_MODULUS - SEQ_MODULUS // 2
    return np.asarray(first + bits.unwrap(seq, SEQ_BITS) - seq[0])
