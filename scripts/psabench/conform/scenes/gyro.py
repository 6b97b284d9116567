"""Scenes of the gyro unit: from Res, a run of positions, a calibration and navigation, trouble that settings make."""

from __future__ import annotations

from psabench.conform.evidence import Evidence
from psabench.conform.outcome import TooLittle
from psabench.conform.plan import scene
from psabench.conform.subject import Subject
from psabench.devices.gyro import SETTINGS, Gyro, Mode
from psabench.unit import NMT_PREOP, NMT_START

READY_S = 0.4
STEP_S = 0.01
LEVEL_S = 12.0  # from half a degree to seconds of arc, with m1 = 1/s
WAIT_S = 1.0
RUN_LIMIT_S = 150.0
FACTS = ("m1_per_s", "m2_per_s", "latitude_deg", "zero_x_v", "zero_y_v", "scale_x_v_per_g", "scale_y_v_per_g")


def unit(s: Subject) -> Gyro:
    """Raises TooLittle where it is none."""
    if not isinstance(s.unit, Gyro):
        raise TooLittle("no gyro unit")
    return s.unit


def calm(s: Subject) -> None:
    """As after power-on, ready, its level unit streaming."""
    s.reset()
    s.run_for(READY_S)
    level_unit(s, True)


def level_unit(s: Subject, on: bool) -> None:
    """Let the level unit stream, or keep it silent."""
    node = int(s.unit.node.read(0x2109, 1))
    s.host.send(0x000, bytes([NMT_START if on else NMT_PREOP, node]))
    s.run_for(0.2 if on else 0.02)


def settings(s: Subject) -> dict[str, object]:
    """What the laws of the controller want to know."""
    return {name: float(s.unit.node.read(*SETTINGS[name])) for name in FACTS} | {
        "level_node": int(s.unit.node.read(0x2109, 1)),
        "positions": [float(s.unit.node.read(0x2103, k)) for k in range(1, 4)],
    }


def until_mode(s: Subject, mode: Mode, limit_s: float) -> None:
    """Raises TooLittle where the unit does not come to that mode."""
    left_s = limit_s
    while int(s.unit.node.read(0x2100, 1)) != mode:
        if left_s <= 0:
            raise TooLittle(f"the unit does not come to mode {int(mode)} within {limit_s:g} s")
        s.run_for(WAIT_S)
        left_s -= WAIT_S


@scene("power_on", boards=("gyro",))
def power_on(s: Subject) -> Evidence:
    """From Res on while it levels, streaming as soon as it has booted."""
    calm(s)
    unit(s).mode = Mode.LEVEL
    s.run_for(0.5)
    with s.take() as take:
        s.reset()
        s.run_for(0.002)
        s.unit.start()
        s.run_for(1.0)
        s.unit.stop()
    return s.evidence("power_on", take)


@scene("run", boards=("gyro",))
def run(s: Subject) -> Evidence:
    """Levelling, then a run of three positions with the settings of power-on, on the lines and on CAN."""
    calm(s)
    facts = settings(s)
    with s.take() as take:
        s.unit.start()
        unit(s).mode = Mode.LEVEL
        s.run_for(LEVEL_S)
        unit(s).mode = Mode.GYROCOMPASS
        until_mode(s, Mode.HOLD, RUN_LIMIT_S)
        s.run_for(2.0)
        s.unit.stop()
    take.facts |= facts
    return s.evidence("run", take)


@scene("navigation", boards=("gyro",))
def navigation(s: Subject) -> Evidence:
    """Levelling, a calibration, then navigation with what it gave."""
    calm(s)
    facts = settings(s)
    unit(s).mode = Mode.LEVEL
    s.run_for(LEVEL_S)
    with s.take(lines=False) as take:
        s.unit.start()
        unit(s).mode = Mode.CALIBRATE
        until_mode(s, Mode.HOLD, RUN_LIMIT_S)
        s.unit.stop()
    take.facts |= facts
    return s.evidence("navigation", take)


@scene("limits", boards=("gyro",))
def limits(s: Subject) -> Evidence:
    """A zero of the level sensors that is suddenly told wrongly, with a stiff loop: rates at their limits."""
    calm(s)
    unit(s).mode = Mode.LEVEL
    s.run_for(LEVEL_S)
    with s.take(lines=False) as take:
        s.unit.start()
        s.run_for(0.3)
        unit(s).set(m1_per_s=20.0)
        unit(s).set(zero_y_v=0.3)
        s.run_for(0.2)
        unit(s).set(m1_per_s=1.0, zero_y_v=0.0)
        s.run_for(8.0)
        s.unit.stop()
    calm(s)
    return s.evidence("limits", take)


@scene("silence", boards=("gyro",))
def silence(s: Subject) -> Evidence:
    """The level unit silent for a while, twice: shorter and longer than the unit waits."""
    calm(s)
    unit(s).mode = Mode.LEVEL
    s.run_for(LEVEL_S)
    facts = settings(s)
    with s.take(lines=False) as take:
        s.unit.start()
        s.run_for(0.3)
        level_unit(s, False)
        s.run_for(0.5)
        level_unit(s, True)
        s.run_for(2.5)
        s.unit.stop()
    take.facts |= facts
    calm(s)
    return s.evidence("silence", take)
