"""All channels of several units as one `procedures.head_bench.HeadBench`: one pass of the head for each sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from psabench.boards.psa2.device import Psa2
from psabench.instruments import Head
from psabench.procedures.head_bench import Reading
from psabench.procedures.result import Array
from psabench.procedures.wire_bench import WireHead

CHANNELS = "xyz"


@dataclass(frozen=True, slots=True, order=True)
class Place:
    """Where a sensor is: unit by name, channel of its board."""

    unit: str
    channel: str

    def __str__(self) -> str:
        return f"{self.unit}-{self.channel}"


class BatchBench(WireHead):
    """At each position every unit is read, one after the other: the bus has room for one at 1000 readings a second.

    A procedure gets the readings of the first sensor; `readings_of` has those of any, at the same positions.
    """

    def __init__(self, units: dict[str, Psa2], head: Head, *, average: int, g_mps2: float) -> None:
        super().__init__(list(units.values()), head, g_mps2=g_mps2)
        self._units, self._average = units, average
        self._gain = {name: unit.filter_gain for name, unit in units.items()}
        self._taken: dict[Place, list[float]] = {Place(name, c): [] for name in units for c in CHANNELS}

    @property
    def places(self) -> tuple[Place, ...]:
        return tuple(self._taken)

    def read(self, axis: str, readings: int) -> Array:
        """Of all sensors; those of the first unit's `axis` are returned."""
        self.wait_settled()
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
