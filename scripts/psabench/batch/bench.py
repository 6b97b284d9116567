"""All channels of several units as one `procedures.head_bench.HeadBench`: one pass of the head for each sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.boards.psa2.device import SETTLE_PERIODS, Psa2
from psabench.estimate.face import Face
from psabench.instruments import Head
from psabench.procedures.head_bench import Reading
from psabench.procedures.result import Array

CHANNELS = "xyz"


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """Where a sensor is: unit by name, channel of its board."""

    unit: str
    channel: str

    def __str__(self) -> str:
        return f"{self.unit}-{self.channel}"


class BatchBench:
    """At each position every unit is read, one after the other: the bus has room for one at 1000 readings a second.

    A procedure gets the readings of the first sensor; `readings_of` has those of any, at the same positions.
    """

    def __init__(self, units: dict[str, Psa2], head: Head, *, average: int, g_mps2: float) -> None:
        self.g_mps2 = g_mps2
        self._units, self._head, self._average = units, head, average
        for unit in units.values():
            unit.wait_ready()
        first = next(iter(units.values()))
        self._host = first.host
        self._gain = {name: unit.filter_gain for name, unit in units.items()}
        self._settle_s = max(SETTLE_PERIODS / unit.data_hz for unit in units.values())
        self._settled_at_s = self.t_s
        self._taken: dict[Place, list[float]] = {Place(name, c): [] for name in units for c in CHANNELS}

    @property
    def places(self) -> tuple[Place, ...]:
        return tuple(self._taken)

    @property
    def t_s(self) -> float:
        return self._host.clock.now_s()

    def turn(self, angle_deg: float) -> float:
        """As `procedures.wire_bench.WireBench`."""
        return self._rested(self._head.turn(angle_deg))

    def mount(self, face: Face) -> None:
        """All units, with this face."""
        self._rested(self._head.mount(face))

    def _rested(self, scale_deg: float) -> float:
        self._settled_at_s = self.t_s + self._settle_s
        return scale_deg

    def wait(self, dwell_s: float) -> None:
        if dwell_s > 0.0:
            self._host.advance(dwell_s)

    def read(self, axis: str, readings: int) -> Array:
        """Of all sensors; those of the first unit's `axis` are returned."""
        self.wait(self._settled_at_s - self.t_s)
        for name, unit in self._units.items():
            u_v = unit.stream(readings * self._average).u_v[:, : len(CHANNELS)] / self._gain[name]
            means_v = u_v.reshape(readings, self._average, len(CHANNELS)).mean(axis=1)
            for k, channel in enumerate(CHANNELS):
                self._taken[Place(name, channel)] += means_v[:, k].tolist()
        first = Place(next(iter(self._units)), axis)
        return np.array(self._taken[first][-readings:])

    def readings_of(self, place: Place, of_first: Sequence[Reading]) -> list[Reading]:
        """The readings of a procedure on this bench, as the sensor at a place gave them."""
        return [replace(r, axis=place.channel, u_v=u) for r, u in zip(of_first, self._taken[place], strict=True)]
