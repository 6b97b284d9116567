"""What a thermal run asks of a bench: chamber and head over SCPI, the unit over CAN; nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from psabench.boards.psa2.device import CODE_V, CONFIG0, DATA_HZ, SETTLE_PERIODS, Psa2
from psabench.boards.psa2.frames import Frames
from psabench.errors import LinkError, expected
from psabench.instruments import Chamber, Head
from psabench.thermal.schedule import Position

Array = npt.NDArray[np.float64]

CASE_CHANNEL = 3  # temperature channel of the converter board, in the case (docs/boards/psa2.md); 0 to 2: the elements
CHANNELS = ("x", "y", "z", "case")
BLOCKS = 10  # means by which the scatter of a recording is estimated
LEAST_TEMPS = 40  # samples; the scan of the four channels returns to each within that
SENSOR_LOW_C, SENSOR_HIGH_C = -90.0, 130.0  # what a temperature sensor that works can show
DR_SHIFT, DR_MASK = 3, 0x38  # data rate, CONFIG0


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """A recording as the unit gives it."""

    t_s: float  # its middle
    u_v: Array  # (3,) means at the loads, the filter's gain and half a code taken out
    sd_v: Array  # (3,) of the means
    temps_degc: Array  # (4,) elements of X, Y, Z, case


class ThermalBench(Protocol):
    """A unit on a dividing head in a chamber."""

    @property
    def t_s(self) -> float:
        """Bench time, s, monotonic."""
        ...

    def wait_until(self, t_s: float) -> None:
        """Let the bench's time pass; returns at once when it has."""
        ...

    def set_chamber(self, temp_degc: float, ramp_k_per_min: float) -> None:
        """Set the ramp and the set point."""
        ...

    def chamber_degc(self) -> float:
        """What the chamber shows."""
        ...

    def turn(self, position: Position) -> float:
        """Set face and angle; returns the head's scale at rest, deg."""
        ...

    def record(self, seconds: float) -> Sample:
        """The unit's readings from now on. Raises LinkError for one that is at its limit or a sensor that is open."""
        ...


class WireThermal:
    """A `ThermalBench` over SCPI and CAN. samples_hz: data rate, set in the converters, by CONFIG0."""

    def __init__(self, unit: Psa2, head: Head, chamber: Chamber, samples_hz: int) -> None:
        self._unit, self._head, self._chamber = unit, head, chamber
        self._hz = samples_hz
        self._gain = 1.0

    def prepare(self) -> None:
        """Once a run: the unit is ready and has the data rate."""
        self._unit.wait_ready()
        code = next(code for code, hz in DATA_HZ.items() if hz == self._hz)
        config0 = self._unit.register("x", CONFIG0)
        wanted = config0 & ~DR_MASK | code << DR_SHIFT
        if config0 != wanted:
            self._unit.write_register("x", CONFIG0, wanted)  # one input line for all three
            self._unit.host.advance(2 * SETTLE_PERIODS / self._hz)
        self.resume()

    def resume(self) -> None:
        """The unit goes on as it was left: what is known of it is read again."""
        self._gain = self._unit.filter_gain

    @property
    def t_s(self) -> float:
        return self._unit.host.clock.now_s()

    def wait_until(self, t_s: float) -> None:
        left_s = round(t_s - self.t_s, 9)
        if left_s > 0.0:
            self._unit.host.advance(left_s)

    def set_chamber(self, temp_degc: float, ramp_k_per_min: float) -> None:
        self._chamber.ramp(ramp_k_per_min)
        self._chamber.set(temp_degc)

    def chamber_degc(self) -> float:
        return self._chamber.temp_degc

    def turn(self, position: Position) -> float:
        if self._head.face is not position.face:
            self._head.mount(position.face)
        return self._head.turn(position.set_deg)

    def record(self, seconds: float) -> Sample:
        begun_s, count = self.t_s, round(seconds * self._hz)
        return sample_of_frames(self._unit.stream(count), begun_s + seconds / 2.0, self._gain)


def sample_of_frames(frames: Frames, t_s: float, gain: float) -> Sample:
    """Means of the frames of one recording. Raises LinkError for what is no measurement, naming the channel."""
    for k, axis in enumerate("xyz"):
        if frames.clipped.any() and np.abs(frames.u_v[:, k]).max() > 0.99 * np.abs(frames.u_v).max():
            raise LinkError(expected("readings within its range", "one at its limit", f"channel {axis}"))
    if not frames.settled.all():
        raise LinkError(expected("settled readings", f"{int((~frames.settled).sum())} that are not", "unit"))
    return Sample(
        t_s=t_s,
        u_v=input_v(frames.u_v, gain).mean(axis=0),
        sd_v=scatter_of_means(frames.u_v) / gain,
        temps_degc=np.array([_channel_degc(frames, k) for k in range(len(CHANNELS))]),
    )


def input_v(u_v: Array, gain: float) -> Array:
    """What the readings mean: codes are cut off, half a code below the voltage on average; gain of the filter."""
    return np.asarray((u_v + CODE_V / 2.0) / gain)


def scatter_of_means(u_v: Array) -> Array:
    """Standard deviation of the means of columns, (n, 3) to (3,): of means of blocks, for neighbours are correlated."""
    each = len(u_v) // BLOCKS
    blocks = u_v[: each * BLOCKS].reshape(BLOCKS, each, -1).mean(axis=1)
    return np.asarray(blocks.std(axis=0, ddof=1) / np.sqrt(BLOCKS))


def _channel_degc(frames: Frames, k: int) -> float:
    """Mean of one temperature channel. Raises LinkError for a sensor that is open: its current is then 0, 0 K."""
    of_channel = frames.temp_channel == k
    name = f"temperature sensor of channel {CHANNELS[k]}"
    if not of_channel.any():
        raise LinkError(expected("readings", f"none in {len(frames)} samples", name))
    degc = frames.temp_degc[of_channel]
    mean = float(degc.mean())
    if not SENSOR_LOW_C <= mean <= SENSOR_HIGH_C:  # NaN is no number between
        got = "0 K: it is open" if np.isnan(mean) or mean < -200.0 else f"{mean:.1f} degC"
        raise LinkError(expected(f"{SENSOR_LOW_C:g} to {SENSOR_HIGH_C:g} degC", got, name))
    return mean
