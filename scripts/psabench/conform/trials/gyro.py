"""The gyro unit asked over CAN: modes, turns, refusals, what never settles."""

from __future__ import annotations

import numpy as np

from psabench.conform.bus_host import refused
from psabench.conform.dictionary import as_the_dictionary_says
from psabench.conform.gyro_readings import columns, emergencies, vertical_degph, wrapped
from psabench.conform.outcome import Broken
from psabench.conform.plan import trial
from psabench.conform.proof import proves
from psabench.conform.requirements import requirements
from psabench.conform.scenes.gyro import LEVEL_S, calm, level_unit, unit
from psabench.conform.subject import Subject
from psabench.devices.gyro import ENCODER_DEG, LATEST_ENCODER, Mode, Phase

FRAMES = (0x2030, 14)  # level frames taken


def _levelled(s: Subject) -> None:
    calm(s)
    unit(s).mode = Mode.LEVEL
    s.run_for(LEVEL_S)


@proves("GYRO-MODE-02")
@trial(needs={"can"})
def a_turn_ends_at_its_angle_and_holds(s: Subject) -> str:
    """Slew to 45 deg, then ask for mode 2: the gimbal comes there and stays."""
    most = requirements()["GYRO-MODE-02"].limit("tolerance_arcmin") / 60
    _levelled(s)
    unit(s).set(slew_deg=45.0)
    unit(s).mode = Mode.SLEW
    s.run_for(22.0)
    there = _encoder_deg(s)
    unit(s).mode = Mode.HOLD
    s.run_for(3.0)
    held = _encoder_deg(s)
    calm(s)
    if abs(float(wrapped(np.array([there - 45.0]))[0])) > 4 * most or abs(held - there) > most:
        raise Broken(f"{there:.4f} deg, {held:.4f} deg in mode 2", "45 deg, and the same")
    return f"{there:.4f} deg, {held:.4f} deg in mode 2"


def _encoder_deg(s: Subject) -> float:
    return float(s.unit.node.read(*LATEST_ENCODER)) * ENCODER_DEG


@proves("GYRO-MODE-03")
@trial(needs={"can"})
def turns_take_the_shorter_way(s: Subject) -> str:
    """Slew to 90, 270, 200 and 100 deg; look at ENCODER on the way and where it ends."""
    row, most = requirements()["GYRO-MODE-03"], 4 * requirements()["GYRO-MODE-02"].limit("tolerance_arcmin") / 60
    _levelled(s)
    unit(s).set(slew_deg=0.0)
    unit(s).mode = Mode.SLEW
    s.run_for(25.0)
    at, seen = 0.0, []
    for to in (90.0, 270.0, 0.0, -100.0):
        unit(s).set(slew_deg=to)
        with s.take(lines=False) as take:
            s.unit.start()
            unit(s).mode = Mode.SLEW
            s.run_for(22.0)
            s.unit.stop()
        c = columns(s.evidence("turn", take))
        way = float((to - at + 180.0) % 360.0 - 180.0)
        way = 180.0 if way == -180.0 else way
        steps = wrapped(np.diff(c["ENCODER"]))
        made, fastest = float(steps.sum()), float(np.abs(steps).max()) / 0.01
        off = float(wrapped(np.array([c["ENCODER"][-1] - to]))[0])
        if abs(made - way) > 1.0 or abs(off) > most:
            raise Broken(f"{made:.2f} deg from {at:g} to {to:g}, {off:.4f} deg off at the end", f"{way:g} deg")
        if fastest > 1.1 * row.limit("rate_dps"):
            raise Broken(f"{fastest:.2f} deg/s", f"{row.limit('rate_dps'):g} deg/s")
        at = to
        seen.append(f"{made:.1f}")
    calm(s)
    return f"ways of {', '.join(seen)} deg"


@proves("GYRO-MODE-09")
@trial(needs={"can"})
def modes_that_cannot_be_are_refused(s: Subject) -> str:
    """Ask for a mode just after Res and look for the reason."""
    code = requirements()["GYRO-MODE-09"].limit("abort_code")
    s.reset()
    s.run_for(0.01)
    refused(lambda: s.unit.node.write(0x2100, 1, int(Mode.LEVEL)), code, "mode 1 just after Res")
    reason = s.unit.refusal()
    if not reason:
        raise Broken("no reason in 2031h", "one in words")
    calm(s)
    s.unit.node.write(0x2100, 1, int(Mode.LEVEL))
    calm(s)
    return f"refused: {reason}"


@proves("GYRO-MODE-10")
@trial(needs={"can"})
def a_run_s_settings_stand_while_it_runs(s: Subject) -> str:
    """Write 2102h and 2103h in a run."""
    code = requirements()["GYRO-MODE-10"].limit("abort_code")
    _levelled(s)
    unit(s).mode = Mode.GYROCOMPASS
    s.run_for(1.0)
    refused(lambda: s.unit.node.write(0x2103, 1, 5.0), code, "2103h sub 1 in a run")
    refused(lambda: s.unit.node.write(0x2102, 1, 2), code, "2102h sub 1 in a run")
    calm(s)
    s.unit.node.write(0x2103, 1, 5.0)
    calm(s)
    return "both refused"


@proves("GYRO-ERR-02")
@trial(needs={"can"})
def what_does_not_settle_is_told(s: Subject) -> str:
    """Allow a fiftieth of an arc minute and a second, and let a run begin."""
    code = int(requirements()["GYRO-ERR-02"].limit("emcy_code"))
    _levelled(s)
    unit(s).set(tolerance_arcmin=0.02, settle_s=0.0, settle_limit_s=1.0, latitude_deg=-60.0)
    with s.take(lines=False) as take:
        s.unit.start()
        unit(s).mode = Mode.GYROCOMPASS
        s.run_for(20.0)
        s.unit.stop()
    e = s.evidence("unsettled", take)
    c = columns(e)
    calm(s)
    if (c["PHASE"] == Phase.WINDOW).any() or c["MODE"][-1] != Mode.HOLD or c["NOT_SETTLED"][-1] != 1:
        raise Broken(
            f"mode {c['MODE'][-1]:g}, NOT_SETTLED {c['NOT_SETTLED'][-1]:g}", "no window, mode 2, NOT_SETTLED 1"
        )
    if code not in [k for k, _ in emergencies(e)]:
        raise Broken(f"emergencies {[f'{k:04X}h' for k, _ in emergencies(e)]}", f"{code:04X}h")
    return "no window, mode 2, NOT_SETTLED, FF23h"


@proves("GYRO-LEV-05")
@trial(needs={"can"})
def frames_of_others_are_not_taken(s: Subject) -> str:
    """Send frames of another node's PSA-2 while the level unit is silent."""
    calm(s)
    level_unit(s, False)
    node = int(s.unit.node.read(0x2109, 1))
    before = int(s.unit.node.read(*FRAMES))
    for k in range(20):
        s.host.send(0x180 + (node % 126 + 1 if node % 126 + 1 != s.node else node + 2), bytes([k] * 8))
    s.run_for(0.05)
    taken = int(s.unit.node.read(*FRAMES)) - before
    calm(s)
    if taken:
        raise Broken(f"{taken} frames of another node taken", "none")
    return "none of 20 frames taken"


@proves("GYRO-MODE-08")
@trial(needs={"can"})
def navigation_keeps_the_azimuth(s: Subject) -> str:
    """Measure the drift about z in a calibration, navigate with it, read the heading of a parked vehicle."""
    row = requirements()["GYRO-MODE-08"]
    _levelled(s)
    unit(s).set(calibration_s=10.0)
    with s.take(lines=False) as take:
        s.unit.start()
        unit(s).mode = Mode.CALIBRATE
        s.run_for(25.0)
        s.unit.stop()
    c = columns(s.evidence("calibration", take))
    window = c["PHASE"] == Phase.WINDOW
    if not window.any():
        raise Broken("no window in a calibration", "one of ten seconds")
    latitude = float(s.unit.node.read(0x2105, 1))
    drift = float(c["U2"][window].mean()) - vertical_degph(latitude)
    unit(s).set(drift2_degph=drift, azimuth_deg=float(c["ENCODER"][-1]))
    unit(s).mode = Mode.NAVIGATE
    s.run_for(5.0)
    first = float(s.unit.node.read(0x2106, 2))
    s.run_for(60.0)
    last = float(s.unit.node.read(0x2106, 2))
    calm(s)
    moved = abs(float(wrapped(np.array([last - first]))[0])) * 60.0
    saw = f"{moved:.3f} deg/h with a drift of {drift:.3f} deg/h"
    if moved > row.limit("drift_max_degph"):
        raise Broken(saw, f"{row.limit('drift_max_degph'):g} deg/h at most")
    return saw


@proves("GYRO-CAN-05")
@trial(needs={"can"})
def the_board_says_what_it_is(s: Subject) -> str:
    """Read 1008h and 1018h sub 2."""
    name, code = s.unit.node.read(0x1008), int(s.unit.node.read(0x1018, 2))
    due = int(requirements()["GYRO-CAN-05"].limit("product_code"))
    if (name, code) != ("GYRO", due):
        raise Broken(f"{name}, {code:08X}h", f"GYRO, {due:08X}h")
    return f"{name}, {code:08X}h"


@proves("GYRO-CAN-04")
@trial(needs={"can"})
def objects_are_as_the_dictionary_says(s: Subject) -> str:
    """Read every object of the EDS and write where nothing may be written."""
    calm(s)
    return as_the_dictionary_says(s, "gyro")
