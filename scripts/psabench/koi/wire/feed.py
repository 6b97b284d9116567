"""From frames and bytes to the host of a flight: the same from a bench and from its recording.

What is lost, late or wrong on either line is named here; the host gets increments on an even grid, solutions on their
clock, heights once a second.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from psabench.boards.bins.device import MESSAGES, Weights, increments_of
from psabench.boards.readings import ReadingLayout, ReadingReader, Readings
from psabench.errors import expected
from psabench.koi.flight_data import Fix, FlightFound
from psabench.koi.wire.clock import ReceiverClock
from psabench.koi.wire.increments import SAMPLE_S, GridRows, IncrementGrid
from psabench.koi.wire.nav_pvt import PvtStream, Solution
from psabench.koi.wire.recording import Frame, Look
from psabench.link.can_host import Message
from psabench.link.protocol_files import dbc_node, message
from psabench.link.signals import Floats

INCREMENTS = ReadingLayout(board="bins", messages=MESSAGES, counter="SEQ", stamp="TSTAMP", overrun="INCOMPLETE")
BARO = ReadingLayout(board="bins", messages=("BINS_BARO",))
HEIGHT_ROWS = 100  # between two heights
SILENT_S = 5.0  # without a solution: the receiver is silent (E0)


class Host(Protocol):
    """`psabench.koi.host.FlightHost`, as far as it is fed."""

    def push(self, dtheta_rad: Floats, dv_mps: Floats) -> None: ...

    def take_fix(self, fix: Fix) -> None: ...

    def take_height(self, t_s: float, h_m: float) -> None: ...

    def doubt(self, text: str) -> None: ...

    def finish(self) -> FlightFound: ...


@dataclass(frozen=True, slots=True)
class Silence:
    """Of the receiver."""

    from_s: float
    to_s: float
    size: int  # bytes that came meanwhile, no solution among them


@dataclass
class _Silent:
    """Since the last solution."""

    since_s: float = 0.0
    size: int = 0
    found: list[Silence] = field(default_factory=list)

    def take(self, now_s: float, data: bytes, solutions: int) -> None:
        self.size += len(data)
        if solutions:
            self.end(now_s)

    def end(self, now_s: float) -> None:
        if now_s - self.since_s > SILENT_S:
            self.found.append(Silence(self.since_s, now_s, self.size))
        self.since_s, self.size = now_s, 0


class FlightFeed:
    """Frames go to `on_message`, looks at the port to `look`, in the order in which they came."""

    def __init__(self, host: Host, weights: Weights, node_id: int, clock: ReceiverClock | None = None) -> None:
        self.host, self.grid, self.stream = host, IncrementGrid(), PvtStream()
        self.clock = clock or ReceiverClock()
        self._weights = weights
        self._readings, self._baro = (ReadingReader(layout, node_id) for layout in (INCREMENTS, BARO))
        self._baro_id = int(message(BARO.messages[0]).frame_id) + node_id - dbc_node(BARO.board)
        self._silent = _Silent()
        self._height_row = 0  # the next height is of this row or a later one
        self._doubted = 0

    @property
    def silences(self) -> list[Silence]:
        return self._silent.found

    def on_message(self, m: Message | Frame) -> None:
        """A CAN frame: a listener of the bus."""
        if m.arbitration_id == self._baro_id:
            self._baro.on_message(m)  # type: ignore[arg-type]
        else:
            self._readings.on_message(m)  # type: ignore[arg-type]

    def look(self, look: Look, found: list[Solution] | None = None) -> None:
        """What the port had, after the frames before it. found: by `stream` already."""
        solutions = self.stream.take(look.data) if found is None else found
        if solutions or not look.data:
            self._drain()
        self._silent.take(self.grid.now_s, look.data, len(solutions))
        for s in solutions:
            self._take_solution(s, look)

    def finish(self) -> FlightFound:
        """After the last frame. Raises BadInput for a flight that ended before its alignment."""
        self._drain()
        self._silent.end(self.grid.now_s)
        return self.host.finish()

    def _drain(self) -> None:
        readings, baro = self._readings.take(), self._baro.take()
        got = increments_of(readings, self._weights)
        rows = self.grid.take(got, readings.t_rx_s)
        heights = self._heights(rows, readings, baro)
        begin = 0
        for row, h_m in heights:
            end = row - rows.first + 1
            self._push(rows, begin, end)
            self.host.take_height((row + 1) * SAMPLE_S, h_m)
            begin = end
        self._push(rows, begin, len(rows.dtheta_rad))
        for text in self.grid.counts.doubts[self._doubted :]:
            self.host.doubt(text)
        self._doubted = len(self.grid.counts.doubts)

    def _push(self, rows: GridRows, begin: int, end: int) -> None:
        if end > begin:
            self.host.push(rows.dtheta_rad[begin:end], rows.dv_mps[begin:end])

    def _heights(self, rows: GridRows, readings: Readings, baro: Readings) -> list[tuple[int, float]]:
        """Numbers of rows and heights, one of each HEIGHT_ROWS. A height belongs to the reading before it."""
        known = rows.source >= 0
        if not known.any() or not len(baro):
            return []
        numbers, source = rows.first + np.flatnonzero(known), rows.source[known]
        came = readings.t_rx_s[source]
        after = np.searchsorted(baro.t_rx_s, came, side="left")
        until = np.append(came[1:], np.inf)
        there = after < len(baro)
        there &= baro.t_rx_s[np.minimum(after, len(baro) - 1)] < until
        found = []
        for i in np.flatnonzero(there & (numbers >= self._height_row)).tolist():
            if numbers[i] >= self._height_row:
                found.append((int(numbers[i]), float(baro["HBARO"][after[i]])))
                self._height_row = (int(numbers[i]) // HEIGHT_ROWS + 1) * HEIGHT_ROWS
        return found

    def _take_solution(self, s: Solution, look: Look) -> None:
        width_s = max(look.t_s - look.begin_s, 0.0)
        t_s = self.clock.take(s.tow_s, self.grid.now_s - width_s / 2.0, width_s)
        if t_s is None:
            return
        fix = Fix(t_s=t_s, lat_rad=s.lat_rad, lon_rad=s.lon_rad, h_m=s.h_m, v_enu_mps=s.v_enu_mps, valid=s.valid)
        self.host.take_fix(fix)

    def notes(self) -> list[str]:
        """What was wrong on the lines and has been survived, one line each."""
        g, c, r = self.grid.counts, self.clock, self._readings.counters
        said = list(self.stream.counts.words())
        if g.gaps:
            said.append(expected("no gaps in the increments", f"{g.gaps}, {g.filled} rows filled", "increments"))
        for what, count in (
            ("whole readings", g.not_whole),
            ("readings of an aircraft's motion", g.impossible),
            ("readings once", g.repeated),
            ("readings in the order of their time", g.backwards),
            ("readings whose frames come together", r.torn),
        ):
            if count:
                said.append(expected(what, f"{count} that are not", "increments"))
        for what, count in (
            ("solutions in the order of their time", c.backwards),
            ("solutions that come when their time says", c.stray),
        ):
            if count:
                said.append(expected(what, f"{count} that do not", "receiver"))
        if c.jumps:
            said.append(expected("a time of week without jumps", f"{c.jumps}", "receiver"))
        for s in self.silences:
            got = f"none from {s.from_s:.0f} to {s.to_s:.0f} s, {s.size} bytes"
            said.append(expected(f"a solution within {SILENT_S:g} s", got, "receiver"))
        return said
