"""A gyro unit over CAN: the controller of a two-axis gyro-stabilised platform (docs/reference/protocol_gyro.md).

    gyro = bench.board(Gyro)
    gyro.set(latitude_deg=50.0, window_s=10.0, count=3)
    gyro.positions_deg = (0.0, 90.0, 180.0)
    gyro.mode = Mode.GYROCOMPASS
    gyro.stream(10)["U1"]          # deg/h, the rate asked of the torquer of the suspension axis

Angles and rates are as in the protocol: degrees, degrees an hour.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Any, Generic, TypeVar

from psabench.boards.objects import GyroObjects as OD
from psabench.boards.readings import ReadingLayout
from psabench.boards.unit import BusUnit
from psabench.errors import BadInput, DeviceError, expected

Value = TypeVar("Value")


class Mode(IntEnum):
    """Object 2100h:1."""

    OFF = 0
    LEVEL = 1
    HOLD = 2
    SLEW = 3
    GYROCOMPASS = 4
    CALIBRATE = 5
    NAVIGATE = 6


class Phase(IntEnum):
    """Object 2100h:2, of a run or a turn."""

    IDLE = 0
    SLEWING = 1
    SETTLING = 2
    WINDOW = 3


class Flag(IntFlag):
    """Object 2100h:4."""

    SATURATED = 1
    LEVEL_LOST = 2
    ENCODER_FAULT = 4
    NOT_SETTLED = 8


class SelfTest(IntEnum):
    """Object 210Bh:2."""

    NONE = 0
    PASSED = 1
    FAILED = 2
    UNCLEAR = 3


@dataclass(frozen=True, slots=True)
class Began:
    """A flag since the mode began, object 2108h."""

    count: int  # how often it began
    step: int  # in which it did last, as `Gyro.steps`


MODE = (OD.CONTROL, 1)
POSITIONS, POSITIONS_MAX = OD.POSITIONS, 32
BEGAN, SELF_TEST, SELF_TEST_RESULT = OD.PAST, (OD.SELF_TEST, 1), (OD.SELF_TEST, 2)
ENCODER_DEG, LEVEL_DEG = 180.0 / 2**31, 2e-6

# Settings by the names that this package gives them: those of an object stand at its sub-indices from the first on.
_OBJECTS = (
    (OD.SLEW, 1, ("slew_deg", "slew_dps", "slew_dps2", "settle_s", "settle_limit_s", "tolerance_arcmin")),
    (OD.RUN, 1, ("count", "repeat", "window_s", "calibration_s", "freeze")),
    (OD.LOOPS, 1, ("m1_per_s", "m2_per_s")),
    (OD.PLACE, 1, ("latitude_deg", "speed_mps", "track_deg")),
    (OD.HEADING, 1, ("azimuth_deg",)),
    (OD.DRIFT, 1, ("drift1_degph", "drift2_degph")),
    (OD.LEVEL, 2, ("zero_x_v", "zero_y_v", "scale_x_v_per_g", "scale_y_v_per_g")),
)
SETTINGS: Mapping[str, tuple[int, int]] = {
    name: (index, sub) for index, first, names in _OBJECTS for sub, name in enumerate(names, first)
}
ABORT_RANGE = {0x06090030, 0x06090031, 0x06090032}  # CiA 301, 7.2.4.3.17: value range, too high, too low


class _Latest(Generic[Value]):
    """An attribute that asks the unit each time: an object, and what its value is here."""

    def __init__(self, index: int, sub: int, value: Callable[[Any], Value]) -> None:
        self._where, self._value = (index, sub), value

    def __get__(self, gyro: Gyro, _: type[Gyro] | None = None) -> Value:
        return self._value(gyro.node.read(*self._where))


class Gyro(BusUnit):
    """One unit on the bus. What it rejects raises with its own words (object 2031h)."""

    board = "gyro"
    title = "GYRO"
    layout = ReadingLayout(board="gyro", messages=("GYRO_RATES", "GYRO_ANGLES", "GYRO_LEVEL"), counter="STEP")

    phase = _Latest(OD.CONTROL, 2, Phase)
    position = _Latest(OD.CONTROL, 3, int)  # of the run, from 1; 0: none
    flags = _Latest(OD.CONTROL, 4, Flag)
    encoder_deg = _Latest(OD.LATEST, 3, lambda code: int(code) * ENCODER_DEG)  # of the outer gimbal
    beta_deg = _Latest(OD.LATEST, 6, lambda code: int(code) * LEVEL_DEG)  # level angle about the axis of suspension
    heading_deg = _Latest(OD.HEADING, 2, float)  # as the unit itself has it in mode 6, of a level vehicle, 0 to 360
    has_magnetic = _Latest(OD.MAGNETIC, 1, bool)  # an induction sensor is fitted
    magnetic_deg = _Latest(OD.MAGNETIC, 2, float)  # heading by it, 0 to 360
    step_s = _Latest(OD.CLOCK, 1, lambda ns: int(ns) * 1e-9)  # period of the controller's steps, and of the readings
    steps = _Latest(OD.CLOCK, 2, int)  # of the controller since its last reset
    level_node = _Latest(OD.LEVEL, 1, int)  # CANopen node of the unit that reads the level sensors; 0: none is fitted

    def get(self, name: str) -> float:
        """A setting by its name here."""
        return float(self.node.read(*SETTINGS[name]))

    def set(self, **settings: float) -> None:
        """Settings by their names here, in the order given. Raises BadInput for a value that the unit does not take."""
        for name, value in settings.items():
            self._write(name, *SETTINGS[name], value)

    def _write(self, name: str, index: int, sub: int, value: float) -> None:
        try:
            self.node.write(index, sub, value)
        except DeviceError as e:
            words = self.refusal() or e.text
            if e.abort_code in ABORT_RANGE:
                raise BadInput(f"{name}: {value:g} rejected by the unit: {words}") from e
            raise DeviceError(e.what, e.abort_code, words) from e

    @property
    def positions_deg(self) -> tuple[float, ...]:
        """The positions of a run, as many as there are in use."""
        return tuple(float(self.node.read(POSITIONS, 1 + k)) for k in range(int(self.get("count"))))

    @positions_deg.setter
    def positions_deg(self, angles_deg: Sequence[float]) -> None:
        if not 1 <= len(angles_deg) <= POSITIONS_MAX:
            raise BadInput(expected(f"1 to {POSITIONS_MAX} positions", len(angles_deg), "positions"))
        for k, angle_deg in enumerate(angles_deg):
            self._write(f"position {k + 1}", POSITIONS, 1 + k, angle_deg)
        self.set(count=len(angles_deg))

    @property
    def mode(self) -> Mode:
        return Mode(int(self.node.read(*MODE)))

    @mode.setter
    def mode(self, mode: Mode) -> None:
        self._write(f"mode {mode.name.lower()}", *MODE, int(mode))

    def began(self) -> dict[Flag, Began]:
        """What came since the mode began, gone or not."""
        return {
            flag: Began(int(self.node.read(BEGAN, 1 + k)), int(self.node.read(BEGAN, 1 + len(Flag) + k)))
            for k, flag in enumerate(Flag)
        }

    def begin_self_test(self) -> None:
        """In navigation the platform nods by 0.1 deg for a second: does the angle sensor follow?"""
        self._write("self test", *SELF_TEST, 1)

    @property
    def self_test(self) -> SelfTest | None:
        """What came of it; None: it is under way."""
        if int(self.node.read(*SELF_TEST)):
            return None
        return SelfTest(int(self.node.read(*SELF_TEST_RESULT)))
