"""Modes of the gyro unit: turns, runs from position to position, calibration, navigation (protocol_gyro.md)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from psabench.boards.gyro.conform.capture_readings import columns, setting
from psabench.boards.gyro.device import Mode, Phase
from psabench.conform.capture.intervals import fact
from psabench.conform.capture.log import CanLog, Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect
from psabench.estimate.angles import wrapped_deg
from psabench.link.signals import Floats

LEAST = 20  # readings that a judgement needs
ACCEL_OVER_S = 0.3  # rates so far apart give an acceleration: the encoder has an error that goes with its angle


@check("power_on", "GYRO-MODE-01", needs={"can"})
def in_mode_0_the_torquers_are_left_alone(e: Capture) -> str:
    """Look at U1 and U2 of the readings with mode 0."""
    c = columns(e)
    mine = c["MODE"] == Mode.OFF
    conclusive(mine.sum() >= LEAST, f"{int(mine.sum())} readings of mode 0")
    if c["U1"][mine].any() or c["U2"][mine].any():
        raise Failed(f"U1 {np.abs(c['U1'][mine]).max():g}, U2 {np.abs(c['U2'][mine]).max():g} deg/h", "0")
    return f"{int(mine.sum())} readings of mode 0, U1 and U2 0"


@check("level", "GYRO-MODE-11", needs={"can"})
def mode_1_levels(e: Capture, row: Requirement) -> str:
    """Look at BETA of the last readings, the platform having had its time."""
    c, most = columns(e), row.limit("level_max_arcmin")
    beta_arcmin = c["BETA"][c["MODE"] == Mode.LEVEL] * 60
    conclusive(len(beta_arcmin) >= 2 * LEAST, f"{len(beta_arcmin)} readings of mode 1")
    left = float(np.abs(beta_arcmin[-LEAST:]).max())
    saw = f"beta {beta_arcmin[0]:.2f} arc minutes, at last {left:.2f}"
    return expect(left <= most, saw, f"{most:g} at most")


@check("run", "GYRO-MODE-04", needs={"can"})
def a_run_goes_through_its_positions(e: Capture) -> str:
    """Follow MODE, PHASE and POSITION."""
    c = columns(e)
    here = np.flatnonzero(c["MODE"] == Mode.GYROCOMPASS)
    conclusive(len(here) >= 100, "no run in the recording")
    pairs = np.stack([c["POSITION"][here], c["PHASE"][here]], axis=1)
    order = [tuple(int(v) for v in p) for k, p in enumerate(pairs) if k == 0 or (p != pairs[k - 1]).any()]
    count = len(fact(e, "positions", "the positions are not known"))
    due = [(k, p) for k in range(1, count + 1) for p in (1, 2, 3)]
    due_still = [p for p in due if p != (1, 1)] if order[:1] == [(1, 2)] else due
    expect(order in (due, due_still), f"positions and phases {order}", f"{due}")
    after = c["MODE"][here[-1] + 1 :]
    expect(len(after) and after[0] == Mode.HOLD, "another mode than 2 after the run", "2")
    return f"{len(order)} phases in their order, then mode 2"


@check("run", "GYRO-MODE-05", needs={"can"})
def windows_have_their_length(e: Capture, row: Requirement) -> str:
    """Count the readings of each window."""
    c = columns(e)
    due = round(row.limit("window_s") / (row_for(e, "GYRO-CAN-02").limit("period_us") * 1e-6))
    count = int(c["POSITION"].max())
    seen = [int(((c["PHASE"] == Phase.WINDOW) & (c["POSITION"] == k)).sum()) for k in range(1, count + 1)]
    if not seen or any(abs(n - due) > row.limit("tolerance_steps") for n in seen):
        raise Failed(f"{seen} readings", f"{due} each")
    return f"{seen} readings"


@check("run", "GYRO-MODE-06", needs={"can"})
def windows_begin_settled(e: Capture, row: Requirement) -> str:
    """Look at BETA and ENCODER as a window begins, and how long it has settled."""
    c = columns(e)
    positions = fact(e, "positions", "no window in the recording")
    begins = np.flatnonzero((np.diff(c["PHASE"]) != 0) & (c["PHASE"][1:] == Phase.WINDOW)) + 1
    conclusive(len(begins), "no window in the recording")
    most, shown = row.limit("tolerance_arcmin") / 60, row.limit("encoder_off_max_arcmin") / 60
    least = round(row.limit("settling_s") / (row_for(e, "GYRO-CAN-02").limit("period_us") * 1e-6))
    for k in begins:
        off = wrapped_deg(float(c["ENCODER"][k]) - positions[int(c["POSITION"][k]) - 1])
        settling = int((c["PHASE"][max(0, k - least) : k] == Phase.SETTLING).sum())
        if abs(c["BETA"][k]) > most or abs(off) > shown or settling < least - 1:
            raise Failed(
                f"beta {c['BETA'][k]:.4f} deg, {off:.4f} deg off, {settling} steps settled",
                f"{most:.4f} deg, {least} steps",
            )
    return f"{len(begins)} windows, settled for {least} steps and more"


@check("tilted", "GYRO-MODE-06", needs={"can"})
def a_window_waits_for_the_level(e: Capture, row: Requirement) -> str:
    """Look at BETA from the begin of settling to the first window of a run that begins half a degree off."""
    c = columns(e)
    most = row.limit("tolerance_arcmin") / 60
    settling = np.flatnonzero((c["MODE"] == Mode.GYROCOMPASS) & (c["PHASE"] == Phase.SETTLING))
    window = np.flatnonzero(c["PHASE"] == Phase.WINDOW)
    if not len(settling) or abs(c["BETA"][settling[0]]) < 2 * most:
        raise Inconclusive("the run does not begin far enough off the level")
    if not len(window) or abs(c["BETA"][window[0]]) > most:
        saw = f"beta {c['BETA'][window[0]]:.4f} deg" if len(window) else "no window"
        raise Failed(saw, f"one that begins within {most:.4f} deg")
    return f"beta {c['BETA'][settling[0]]:.4f} deg as settling begins, {c['BETA'][window[0]]:.4f} deg in the window"


@check("navigation", "GYRO-MODE-08", needs={"can"})
def navigation_keeps_the_azimuth(e: Capture, row: Requirement) -> str:
    """Compare the heading of a parked vehicle before and after some time of mode 6, its drift being compensated."""
    most = row.limit("drift_max_degph")
    moved_degph = abs(setting(e, "moved_deg")) / setting(e, "moved_s") * 3600
    drift_degph, free_degph = setting(e, "drift_degph"), setting(e, "free_deg") / setting(e, "free_s") * 3600
    saw = f"{moved_degph:.3f} deg/h in {setting(e, 'moved_s'):.1f} s, {free_degph:.3f} without what cancels the drift"
    expect(moved_degph <= most, saw, f"{most:g} deg/h at most")
    if abs(abs(free_degph) - abs(drift_degph)) > row.limit("free_tolerance_pct") / 100 * abs(drift_degph):
        raise Failed(saw, f"the drift of {abs(drift_degph):.3f} deg/h where nothing cancels it")
    return saw


def _turns(e: Capture) -> list[tuple[float, float, Mapping[str, Floats]]]:
    """From, to, deg, and the readings of each turn by mode 3. Raises Inconclusive."""
    parts = fact(e, "turns", "no turns in the recording")
    logs = [columns(e.with_can(CanLog(frames=e.can.frames[a:b]))) for _, a, b in parts]
    ends = [float(logs[0]["ENCODER"][0])] + [float(to) for to, _, _ in parts]
    return list(zip(ends[:-1], ends[1:], logs, strict=True))


@check("turns", "GYRO-MODE-02", needs={"can"})
def a_turn_ends_at_its_angle_and_holds(e: Capture, row: Requirement) -> str:
    """Look where ENCODER ends in each turn by mode 3, and whether it stays there in mode 2."""
    turns, worst = _turns(e), 0.0
    for _, to, c in turns:
        off = abs(wrapped_deg(float(c["ENCODER"][-1]) - to))
        expect(off <= row.limit("encoder_off_max_arcmin") / 60, f"{c['ENCODER'][-1]:.4f} deg", f"{to:g} deg")
        worst = max(worst, off)
    begin, end = fact(e, "held", "mode 2 is not in the recording")
    c = columns(e.with_can(CanLog(frames=e.can.frames[begin:end])))
    mine = c["MODE"] == Mode.HOLD
    moved = np.abs(wrapped_deg(c["ENCODER"][mine] - turns[-1][2]["ENCODER"][-1]))
    if mine.sum() < LEAST or moved.max() > row.limit("tolerance_arcmin") / 60:
        raise Failed(f"{int(mine.sum())} readings of mode 2", "the angle that the gimbal has")
    return f"{len(turns)} turns, {worst:.4f} deg off at the end; {moved.max():.4f} deg in mode 2"


@check("turns", "GYRO-MODE-03", needs={"can"})
def turns_take_the_shorter_way(e: Capture, row: Requirement) -> str:
    """Look at ENCODER on the way: where it turns, how far and how fast."""
    seen = []
    period_s = row_for(e, "GYRO-CAN-02").limit("period_us") * 1e-6
    allowed = 1 + row.limit("tolerance_pct") / 100
    for at, to, c in _turns(e):
        way = wrapped_deg(to - at)  # of two alike the positive one
        steps = wrapped_deg(np.diff(c["ENCODER"]))
        made = float(steps.sum())
        rates = np.median([steps[:-2], steps[1:-1], steps[2:]], axis=0) / period_s  # a new setting may jump: its errors
        if abs(made - way) > row.limit("way_tolerance_deg"):
            raise Failed(f"{made:.2f} deg from {at:g} to {to:g}", f"{way:g} deg")
        fastest = float(np.abs(rates).max())
        expect(fastest <= allowed * row.limit("rate_dps"), f"{fastest:.2f} deg/s", f"{row.limit('rate_dps'):g} deg/s")
        over = round(ACCEL_OVER_S / period_s)
        pushed = float(np.abs(rates[over:] - rates[:-over]).max()) / ACCEL_OVER_S
        if pushed > allowed * row.limit("accel_dps2"):
            raise Failed(f"{pushed:.2f} deg/s2", f"{row.limit('accel_dps2'):g} deg/s2")
        seen.append(f"{made:.1f} deg with {fastest:.2f} deg/s and {pushed:.1f} deg/s2")
    return "; ".join(seen)


@check("navigation", "GYRO-MODE-07", needs={"can"})
def a_calibration_measures_one_window(e: Capture) -> str:
    """Follow PHASE in mode 5 and count the readings of its window."""
    c = columns(e)
    here = np.flatnonzero(c["MODE"] == Mode.CALIBRATE)
    conclusive(len(here) >= 100, "no calibration in the recording")
    phases = c["PHASE"][here].astype(np.int64)
    order = [int(p) for k, p in enumerate(phases) if k == 0 or p != phases[k - 1]]
    window = int((phases == Phase.WINDOW).sum())
    due = round(setting(e, "calibration_s") / (row_for(e, "GYRO-CAN-02").limit("period_us") * 1e-6))
    if order != [Phase.SETTLING, Phase.WINDOW] or window != due:
        raise Failed(f"phases {order}, {window} readings of its window", f"2, 3 and {due}")
    after = c["MODE"][here[-1] + 1 :]
    if len(after) and after[0] != Mode.HOLD:
        raise Failed(f"mode {after[0]:g} afterwards", "2")
    return f"settling, then a window of {window} readings"
