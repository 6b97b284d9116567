"""Stimuli of the gyro unit: from Res, a run of positions, a calibration and navigation, trouble that settings make."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from psabench.boards.gyro.conform.capture_readings import columns, vertical_degph
from psabench.boards.gyro.device import SETTINGS, Gyro, Mode, Phase
from psabench.boards.objects import GyroObjects as OD
from psabench.boards.objects import Psa2Objects
from psabench.boards.unit import NMT_PREOP, NMT_START
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut, Take
from psabench.conform.plan import stimulus
from psabench.conform.requirements import requirements
from psabench.conform.stimulus.streamed import from_res, recorded, while_streaming
from psabench.conform.verdict import conclusive, known
from psabench.estimate.angles import wrapped_deg
from psabench.link.canopen_host import CanopenNode
from psabench.places import proto_file

READY_S = 0.4
EVERY_NTH = 2  # sample mode of a PSA-2
REST_S = 2.0  # from there to what the Earth and the drift leave, nearly: two time constants
WAIT_S = 0.5
RUN_LIMIT_S = 150.0
TURN_LIMIT_S = 30.0  # half a turn takes 21 s
TURNS_DEG = (90.0, 270.0, 0.0, -100.0)  # from where it is, a half, one over 360, one the other way
CALIBRATION_S, NAVIGATION_S, FREE_S = 30.0, 30.0, 5.0
POWER_ON_S = 1.0  # of readings after Res
LEVEL_S = 3.0  # of readings in mode 1
TILT_G, SLOW_PER_S = 0.0087, 0.15  # half a degree; 12 s from there to the tolerance of 5 arc minutes
FACTS = ("m1_per_s", "m2_per_s", "latitude_deg", "zero_x_v", "zero_y_v", "scale_x_v_per_g", "scale_y_v_per_g")


def unit(s: Dut) -> Gyro:
    """Raises Inconclusive where it is none."""
    return known(s.unit if isinstance(s.unit, Gyro) else None, "no gyro unit")


def calm(s: Dut) -> None:
    """As after power-on, ready, its level unit streaming."""
    s.reset()
    s.run_for(READY_S)
    level_unit(s, True)


def level_unit(s: Dut, on: bool) -> None:
    """Let the level unit stream, or keep it silent."""
    node = int(s.unit.node.read(OD.LEVEL, 1))
    s.host.send(0x000, bytes([NMT_START if on else NMT_PREOP, node]))
    s.run_for(0.2 if on else 0.02)


@contextmanager
def level_client(s: Dut) -> Iterator[CanopenNode]:
    """SDOs of the level unit."""
    with s.host.listeners.restored():
        yield CanopenNode(s.host, int(s.unit.node.read(OD.LEVEL, 1)), proto_file("psa2.eds"), timeout_s=1.0)


def settings(s: Dut) -> dict[str, object]:
    """What the laws of the controller want to know."""
    return {name: float(s.unit.node.read(*SETTINGS[name])) for name in FACTS} | {
        "level_node": int(s.unit.node.read(OD.LEVEL, 1)),
        "positions": [float(s.unit.node.read(OD.POSITIONS, k)) for k in range(1, 4)],
    }


def _wait_until(s: Dut, met: Callable[[], bool], limit_s: float, why: str) -> None:
    """Let time pass until it is met. Raises Inconclusive, in these words, where it is not within the limit."""
    while not met():
        conclusive(limit_s > 0, why)
        s.run_for(WAIT_S)
        limit_s -= WAIT_S


def until_mode(s: Dut, mode: Mode, limit_s: float) -> None:
    """Raises Inconclusive where the unit does not come to that mode."""
    why = f"the unit does not come to mode {int(mode)} within {limit_s:g} s"
    _wait_until(s, lambda: int(s.unit.node.read(OD.CONTROL, 1)) == mode, limit_s, why)


def levelled(s: Dut) -> None:
    """As after power-on, and level. Raises Inconclusive where it does not get so."""
    row = requirements()["GYRO-MODE-11"]
    calm(s)
    unit(s).mode = Mode.LEVEL
    limit_s, most = row.limit("limit_s"), row.limit("level_max_arcmin")
    s.run_for(WAIT_S)
    why = f"the platform is not level after {limit_s:g} s"
    _wait_until(s, lambda: abs(unit(s).beta_deg) * 60 <= most, limit_s, why)
    s.run_for(REST_S)


def slew(s: Dut, to_deg: float) -> None:
    """Turn there and stand for a second. Raises Inconclusive where the turn does not end."""
    unit(s).set(slew_deg=to_deg)
    unit(s).mode = Mode.SLEW
    s.run_for(0.1)
    why = f"a turn to {to_deg:g} deg does not end within {TURN_LIMIT_S:g} s"
    _wait_until(s, lambda: unit(s).phase != Phase.SLEWING, TURN_LIMIT_S, why)
    s.run_for(1.0)


@stimulus("power_on", boards=("gyro",))
def power_on(s: Dut) -> Capture:
    """From Res on while it levels, streaming as soon as it has booted."""
    calm(s)
    unit(s).mode = Mode.LEVEL
    s.run_for(0.5)
    return from_res(s, POWER_ON_S)


@recorded("level", boards=("gyro",), before=calm, lines=False, streaming=True)
def level(s: Dut, take: Take) -> None:
    """Mode 1, for as long as the platform may take to get level from where it is."""
    unit(s).mode = Mode.LEVEL
    s.run_for(requirements()["GYRO-MODE-11"].limit("limit_s"))


@recorded("run", boards=("gyro",), before=levelled, streaming=True, facts=settings)
def run(s: Dut, take: Take) -> None:
    """Levelling, then a run of three positions with the settings of power-on, on the lines and on CAN."""
    s.run_for(LEVEL_S)
    unit(s).mode = Mode.GYROCOMPASS
    until_mode(s, Mode.HOLD, RUN_LIMIT_S)
    s.run_for(2.0)


@stimulus("navigation", boards=("gyro",))
def navigation(s: Dut) -> Capture:
    """A calibration, then the drift about z that it gave, navigation with it, and the heading of a parked vehicle."""
    levelled(s)
    facts = settings(s) | {"calibration_s": CALIBRATION_S}
    unit(s).set(calibration_s=CALIBRATION_S)
    with s.take(lines=False) as take, while_streaming(s):
        unit(s).mode = Mode.CALIBRATE
        until_mode(s, Mode.HOLD, RUN_LIMIT_S)
    take.facts |= facts
    e = s.capture("navigation", take)
    c = columns(e)
    window = c["PHASE"] == Phase.WINDOW
    if not window.any():
        return e
    drift = float(c["U2"][window].mean()) - vertical_degph(unit(s).get("latitude_deg"))
    unit(s).set(drift2_degph=drift, azimuth_deg=float(c["ENCODER"][-1]))
    unit(s).mode = Mode.NAVIGATE
    s.run_for(5.0)
    take.facts["drift_degph"] = drift
    take.facts["moved_deg"], take.facts["moved_s"] = _moved(s, NAVIGATION_S)
    unit(s).set(drift2_degph=0.0)  # the heading is alive: it shows the drift that nothing cancels
    take.facts["free_deg"], take.facts["free_s"] = _moved(s, FREE_S)
    calm(s)
    return s.capture("navigation", take)


def _moved(s: Dut, dwell_s: float) -> tuple[float, float]:
    """How far the heading moves, deg, and in how many seconds of the bench."""
    first_deg, begun_s = unit(s).heading_deg, s.bench.time_s
    s.run_for(dwell_s)
    return wrapped_deg(unit(s).heading_deg - first_deg), s.bench.time_s - begun_s


@recorded("turns", boards=("gyro",), before=levelled, after=calm, lines=False, streaming=True)
def turns(s: Dut, take: Take) -> None:
    """Turns of all kinds by mode 3, then mode 2."""
    parts: list[tuple[float, int, int]] = []  # angle, first and last frame
    s.run_for(0.1)
    for to_deg in TURNS_DEG:
        begin = len(take.frames)
        slew(s, to_deg)
        parts.append((to_deg, begin, len(take.frames)))
    begin = len(take.frames)
    unit(s).mode = Mode.HOLD
    s.run_for(3.0)
    take.facts |= {"turns": parts, "held": (begin, len(take.frames))}


@stimulus("hold", boards=("gyro",))
def hold(s: Dut) -> Capture:
    """Mode 2 with one latitude, then with that of the other hemisphere, which turns Wz round."""
    levelled(s)
    facts = settings(s)
    latitude_deg = unit(s).get("latitude_deg")
    unit(s).mode = Mode.HOLD
    s.run_for(1.0)
    parts: list[tuple[float, int, int]] = []  # latitude, first and last frame
    with s.take(lines=False) as take, while_streaming(s):
        for told_deg in (latitude_deg, -latitude_deg):
            unit(s).set(latitude_deg=told_deg)
            s.run_for(0.1)
            begin = len(take.frames)
            s.run_for(2.0)
            parts.append((told_deg, begin, len(take.frames)))
    take.facts |= facts | {"latitudes": parts}
    calm(s)
    return s.capture("hold", take)


def _tilted(s: Dut) -> None:
    """Half a degree off the level, with a slow loop and no settling time."""
    levelled(s)
    zero_v, scale_v = unit(s).get("zero_y_v"), unit(s).get("scale_y_v_per_g")
    unit(s).set(zero_y_v=zero_v + scale_v * TILT_G)
    s.run_for(5.0)
    unit(s).set(m1_per_s=SLOW_PER_S, zero_y_v=zero_v, settle_s=0.0, settle_limit_s=60.0, count=1, window_s=1.0)
    unit(s).positions_deg = (round(unit(s).encoder_deg),)


@recorded("tilted", boards=("gyro",), before=_tilted, after=calm, lines=False, streaming=True)
def tilted(s: Dut, take: Take) -> None:
    """A run that begins half a degree off the level, with a slow loop and no settling time: its first window."""
    unit(s).mode = Mode.GYROCOMPASS
    until_mode(s, Mode.HOLD, RUN_LIMIT_S)


@recorded("limits", boards=("gyro",), before=levelled, after=calm, lines=False, streaming=True)
def limits(s: Dut, take: Take) -> None:
    """A zero of the level sensors that is suddenly told wrongly, with a stiff loop: rates at their limits."""
    s.run_for(0.3)
    unit(s).set(m1_per_s=20.0)
    unit(s).set(zero_y_v=0.3)
    s.run_for(0.2)
    unit(s).set(m1_per_s=1.0, zero_y_v=0.0)
    s.run_for(8.0)


@recorded("silence", boards=("gyro",), before=levelled, after=calm, streaming=True, facts=settings)
def silence(s: Dut, take: Take) -> None:
    """The level unit silent for a while, twice: shorter and longer than the unit waits."""
    s.run_for(0.3)
    level_unit(s, False)
    s.run_for(0.5)
    level_unit(s, True)
    s.run_for(2.5)


@recorded("gaps", boards=("gyro",), before=levelled, after=calm, lines=False, streaming=True)
def level_gaps(s: Dut, take: Take) -> None:
    """Every second frame of the level unit left out, by its sample mode 2; before and after all of them.

    facts: gaps, first and last frame of the while in which each frame lacks the one before.
    """
    with level_client(s) as level:
        s.run_for(0.3)
        level.write(Psa2Objects.SAMPLE_NTH, 0, 2)
        level.write(Psa2Objects.SAMPLE_MODE, 0, EVERY_NTH)
        s.run_for(0.1)
        begin = len(take.frames)
        s.run_for(1.0)
        take.facts["gaps"] = begin, len(take.frames)
        level.write(Psa2Objects.SAMPLE_MODE, 0, 0)
        level.write(Psa2Objects.SAMPLE_NTH, 0, 1)
    s.run_for(2.0)
