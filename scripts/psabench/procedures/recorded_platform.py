"""The bench of the gyrocompass procedures without a live link: the host's part is written down, the emulator runs alone
in free pace, and the host looks at the recording of the bus.

`RecordedPlatform` is `WirePlatform` on other units: what it sends and what it makes of the frames is the same code.
What cannot be done without watching is done by the clock: levelling takes a time that is looked at afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from psabench.boards.gyro.device import Flag, Gyro, Mode
from psabench.boards.psa2.device import Psa2
from psabench.boards.psa2.frames import Frames
from psabench.boards.readings import Readings
from psabench.boards.unit import NMT_PREOP
from psabench.errors import LinkError, expected
from psabench.link.can_log import Logged
from psabench.link.protocol_files import dbc_node, message
from psabench.link.signals import Floats, layout
from psabench.procedures.host_script import Plates, Scenario, ScriptedBench
from psabench.procedures.platform_bench import Compensation, Look, Table, Window
from psabench.procedures.wire_platform import WirePlatform

LEVEL_TIMES = 6.0  # time constants of levelling, from degrees to less than the tolerance
LEVEL_LOOK_S = 1.0  # beta must lie within the tolerance for so long before the run begins
MARGIN_S = 0.5  # of the time that a run is expected to take
STRIDE_S = 20.0  # between looks: the counter of the frames takes 262 s to wrap at 250 a second


class RecordedPlatform(WirePlatform):
    """A `PlatformBench` of a scenario with a gyro unit and its level unit on the first bus, from power-on."""

    def __init__(
        self,
        scenario: Scenario,
        *,
        signals: str = "frames",
        first_turn_deg: float = 180.0,
        plates: Plates | None = None,
    ) -> None:
        """signals: as of WirePlatform. first_turn_deg: from where the gimbal is to the first position, at most.

        plates: shared by runs with the same units, which then read them no second time.
        """
        self._first_turn_deg = first_turn_deg
        self._script = _Units(scenario, plates)
        super().__init__(self._script, signals=signals)  # type: ignore[arg-type]  # as much of a Bench as it asks for
        self._levelled: tuple[float, float] | None = None  # beta is looked at from here to there

    @property
    def emulator_s(self) -> float:
        """Processor time of the emulator, s."""
        return self._script.bench.emulator_s

    def wait(self, dwell_s: float) -> None:
        self._script.wait(max(dwell_s, STRIDE_S))

    def level(self, timeout_s: float) -> None:
        """Level for a time that is enough; whether it was, the recording tells later. Raises LinkError."""
        length_s = LEVEL_TIMES / self._m1_per_s + LEVEL_LOOK_S
        if length_s > timeout_s:
            raise LinkError(
                expected(f"levelling within {timeout_s:g} s", f"{length_s:.3g} s (m1 {self._m1_per_s:g} 1/s)")
            )
        self._begin(Mode.LEVEL)
        self.gyro.get("tolerance_arcmin")
        self._script.bench.wait(length_s - LEVEL_LOOK_S)
        self.gyro.start()
        begun_s = self._script.bench.now_s
        self._script.bench.wait(LEVEL_LOOK_S)
        self._levelled = (begun_s, self._script.bench.now_s)
        self.gyro.stop()

    def measure(self, table: Table, done: Callable[[Window], None]) -> Sequence[Window]:
        """See `PlatformBench`."""
        longest_s = _longest_s(table, self._first_turn_deg, self.gyro.get("slew_dps2"))
        self._script.expect(longest_s, len(table.sequence_deg) * table.settle_limit_s)
        windows = super().measure(table, done)
        self._was_level()
        return windows

    def calibrate(self, length_s: float, settle_s: float) -> Window:
        """See `PlatformBench`. All is run again, up to its end."""
        self._script.expect(length_s + settle_s + MARGIN_S, self.gyro.get("settle_limit_s"))
        return super().calibrate(length_s, settle_s)

    def _was_level(self) -> None:
        """Raises LinkError where levelling was not over in its time."""
        assert self._levelled is not None
        begun_s, ended_s = self._levelled
        r = self._script.readings(ended_s)
        seen = np.abs(r["BETA"][r.t_rx_s >= begun_s])
        if not seen.size or seen.max() >= self.gyro.get("tolerance_arcmin") / 60.0:
            raise LinkError(expected("a level platform at the beginning", "one that never settles"))

    def navigate(self, c: Compensation) -> None:
        raise LinkError("heading-hold needs a live bench: it reads the heading during the hold")

    def look(self) -> Look:
        raise LinkError("heading-hold needs a live bench: it reads the heading during the hold")


def _longest_s(table: Table, first_turn_deg: float, accel_dps2: float) -> float:
    """Of a run whose platform settles at once; a turn in which the torquers limit the rate takes longer."""
    turns = np.abs(np.diff(table.sequence_deg)) % 360.0
    turns = np.concatenate([[first_turn_deg], np.minimum(turns, 360.0 - turns)])
    turn_s = turns / table.slew_dps + table.slew_dps / accel_dps2
    return float(turn_s.sum()) + len(turns) * (table.settle_s + table.window_s) + MARGIN_S


# ---- the bench and its units, written down


class _Units:
    """As much of a `Bench` as a WirePlatform asks for."""

    def __init__(self, scenario: Scenario, plates: Plates | None) -> None:
        boards: Mapping[str, Any] = {"gyro": _Gyro, "psa2": _Level}
        listed = [(u, boards[u["board"]]) for u in scenario["units"] if u["board"] in boards]
        gyros = [u["bus"] for u, _ in listed if u["board"] == "gyro"]
        if not gyros:
            raise LinkError(expected("a gyro unit", "none", "scenario"))
        made = [(u["name"], make(self, int(u["node"]))) for u, make in listed if u["bus"] == gyros[0]]
        self.units: dict[str, Gyro | Psa2] = dict(made)
        heard = frozenset(i for u in self.units.values() for i in u.frames.ids)
        self.bench = ScriptedBench(scenario, listen_to=heard, bus=gyros[0], plates=plates)
        self._end_s = self._timeout_s = 0.0

    def board(self, kind: type[Gyro]) -> Gyro:
        """The first unit of that kind."""
        return next(u for u in self.units.values() if isinstance(u, kind))

    @property
    def time_s(self) -> float:
        return self.bench.now_s

    def expect(self, length_s: float, timeout_s: float) -> None:
        """What comes takes so long, or up to timeout_s more."""
        self._end_s, self._timeout_s = self.bench.now_s + length_s, timeout_s

    def wait(self, dwell_s: float) -> None:
        """Look at so much more of the recording, up to what is expected. Raises LinkError when there is no more."""
        if self.bench.now_s >= self._end_s:
            if self._timeout_s <= 0.0:
                raise LinkError("the run takes longer than its positions can")
            more_s = min(self._timeout_s, STRIDE_S)
            self._timeout_s -= more_s
            self._end_s += more_s
        self.bench.recording(self._end_s)
        self.bench.now_s = min(self.bench.now_s + dwell_s, self._end_s)

    def wait_away(self, dwell_s: float) -> None:
        """Every wait is one away from the bus."""
        self.wait(dwell_s)

    def readings(self, until_s: float) -> Readings:
        """All of the gyro unit up to then."""
        readings: Readings = self.board(Gyro).frames.until(until_s)  # type: ignore[attr-defined]
        return readings


class _Node:
    """Services of a node, written down. Values that change while it runs are not to be had."""

    def __init__(self, units: _Units, board: str, node_id: int) -> None:
        self._units, self._board, self.node_id = units, board, node_id

    def nmt(self, command: int) -> None:
        self._units.bench.nmt(self.node_id, command)

    def read(self, index: int, sub: int = 0) -> Any:
        return self._units.bench.read(self._board, (self.node_id, index, sub))

    def write(self, index: int, sub: int, value: float) -> None:
        self._units.bench.write(self._board, (self.node_id, index, sub), value)


class _Stream:
    """What a unit streamed, taken as time moves on."""

    def __init__(self, units: _Units, ids: Sequence[int]) -> None:
        self._units = units
        self.ids = tuple(ids)
        self._taken_s = 0.0
        self._of: Logged | None = None

    def forget(self) -> None:
        """Drop what has come up to now."""
        self._taken_s = self._units.bench.now_s

    def _new(self, t_s: Floats) -> slice:
        """Which of these instants have not been taken."""
        span = slice(int(np.searchsorted(t_s, self._taken_s)), int(np.searchsorted(t_s, self._units.bench.now_s)))
        self._taken_s = self._units.bench.now_s
        return span


class _Readings(_Stream):
    """Of a gyro unit, whole readings."""

    def until(self, until_s: float) -> Readings:
        r = self._all(until_s)
        return r.head(int(np.searchsorted(r.t_rx_s, until_s)))

    def take(self) -> Readings:
        r = self._all(self._units.bench.now_s)
        return r.part(self._new(r.t_rx_s))

    def _all(self, until_s: float) -> Readings:
        log = self._units.bench.recording(until_s)
        if log is not self._of:
            self._of, self._decoded = log, _readings(log.only(self.ids), self.ids)
        return self._decoded


def _readings(log: Logged, ids: Sequence[int]) -> Readings:
    """Readings whose messages all came, one after the other."""
    first = np.flatnonzero(log.can_id[: len(log) - len(ids) + 1] == ids[0])
    whole = np.all([log.can_id[first + k] == i for k, i in enumerate(ids)], axis=0)
    parts = [log.at(first[whole] + k) for k in range(len(ids))]
    columns: dict[str, Floats] = {}
    units: dict[str, str] = {}
    for name, part in zip(Gyro.layout.messages, parts, strict=True):
        for column, at in layout(message(name)).items():
            columns[column], units[column] = part.physical(at), at.unit
    t_s = parts[-1].t_s
    return Readings(t_rx_s=t_s, t_sample_s=np.full(len(t_s), np.nan), columns=columns, units=units)


class _Codes(_Stream):
    """Of a level unit: volts at X and Y, and their numbers."""

    def take(self) -> Frames:
        log = self._units.bench.recording(self._units.bench.now_s)
        if log is not self._of:
            at = layout(message("PSA2_XY"))
            self._of, self._xy = log, log.only(self.ids)
            self._seq = self._xy.raw(at["SEQ"])
            self._u_v = np.stack([self._xy.physical(at["X"]), self._xy.physical(at["Y"])], axis=1)
        span = self._new(self._xy.t_s)
        t_s = self._xy.t_s[span]
        none = np.full(len(t_s), np.nan)
        u_v = np.column_stack([self._u_v[span], none])  # without the half of the pair that has Z and temperature
        return Frames.of(t_s, none, u_v, {"SEQ": self._seq[span]})


class _Gyro(Gyro):
    """A gyro unit whose settings are written down, and whose state is that of its readings."""

    def __init__(self, units: _Units, node_id: int) -> None:  # no link: the base's is not made
        shift = node_id - dbc_node(self.board)
        self._units = units
        self.node = _Node(units, self.board, node_id)  # type: ignore[assignment]
        self.frames = _Readings(  # type: ignore[assignment]
            units, [int(message(name).frame_id) + shift for name in self.layout.messages]
        )

    def stop(self) -> None:
        self.node.nmt(NMT_PREOP)

    @property
    def flags(self) -> Flag:  # type: ignore[override]
        """Of the latest reading."""
        r = self._units.readings(self._units.time_s)
        raised = [f for f in Flag if len(r) and r[str(f.name)][-1]]
        return Flag(sum(raised))


class _Level(Psa2):
    """A level unit whose settings are written down."""

    def __init__(self, units: _Units, node_id: int) -> None:
        shift = node_id - dbc_node(self.board)
        self.node = _Node(units, self.board, node_id)  # type: ignore[assignment]
        self.frames = _Codes(units, [int(message("PSA2_XY").frame_id) + shift])  # type: ignore[assignment]

    def wait_ready(self, timeout_s: float = 5.0) -> None:
        """The script begins when it is."""

    def stop(self) -> None:
        self.node.nmt(NMT_PREOP)
