"""The gyro unit: readings, level angles, laws of its loops, flags, lines (docs/reference/protocol_gyro.md)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from psabench.boards.gyro.conform.capture_readings import EARTH_DEGPH, EMCY, MESSAGES, columns, setting, vertical_degph
from psabench.boards.gyro.device import Mode, Phase
from psabench.conform.capture.intervals import counted, fact, interval, rises_at_rate
from psabench.conform.capture.log import CanLog, Capture
from psabench.conform.capture.messages import as_laid_out, emergencies, in_turn, late_readings
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive, conclusive, damaged_data_are, expect
from psabench.estimate.angles import wrapped_deg
from psabench.link.protocol_files import dbc_node, message
from psabench.link.signals import Floats, layout

LINES = ("STEP", "READY", "SLEW", "SETTLE", "WINDOW", "FAULT")
FLAGS = ("SATURATED", "LEVEL_LOST", "ENCODER_FAULT", "NOT_SETTLED")
PHASES = {"SLEW": Phase.SLEWING, "SETTLE": Phase.SETTLING, "WINDOW": Phase.WINDOW}
US = 1e3
LEAST = 20  # readings that lack a frame of the level unit
LIMITS = ("GYRO-LAW-05", "GYRO-LAW-06")


@check("run", "GYRO-CAN-01", needs={"can"})
def three_messages_make_a_reading(e: Capture) -> str:
    """Follow the messages of each step."""
    return in_turn(e, MESSAGES)


@check("run", "GYRO-CAN-02", needs={"can"})
def steps_are_counted(e: Capture, row: Requirement) -> str:
    """Look at STEP from reading to reading."""
    return counted(columns(e)["STEP"], int(row.limit("modulo")), "STEP")


@check("run", "GYRO-CAN-02", needs={"line"}, wires=("STEP",))
def steps_come_at_their_rate(e: Capture, row: Requirement) -> str:
    """Measure from one rise of STEP to the next."""
    return rises_at_rate(e, row, "STEP", "from step to step")


@check("run", "GYRO-CAN-03", needs={"can"})
def messages_have_their_lengths(e: Capture) -> str:
    """Look at the lengths of the three messages, and at bits that have no signal."""
    return as_laid_out(e, MESSAGES)


def _codes(e: Capture) -> tuple[np.ndarray, Floats]:
    """SEQ (n,) and volts X, Y (n, 2) of the level unit's frames."""
    node = int(setting(e, "level_node"))
    log = e.can.of_id(int(message("PSA2_XY").frame_id) - dbc_node("psa2") + node)
    conclusive(len(log) >= 20, f"{len(log)} frames of the level unit came")
    with damaged_data_are(Inconclusive):
        raw = log.raw("PSA2_XY")
    scales = layout(message("PSA2_XY"))
    volts = np.stack([raw[a] * scales[a].scale for a in "XY"], axis=1)
    return raw["SEQ"], volts


@check("run", "GYRO-LEV-01", needs={"can"})
def level_angles_follow_from_the_codes(e: Capture, row: Requirement) -> str:
    """Compute BETA and GAMMA from the mean codes of the level unit's frames of each step."""
    c = columns(e)
    seq, volts = _codes(e)
    place = {int(s): k for k, s in enumerate(seq)}
    zero = np.array([setting(e, "zero_x_v"), setting(e, "zero_y_v")])
    scale = np.array([setting(e, "scale_x_v_per_g"), setting(e, "scale_y_v_per_g")])
    last, worst, count = c["LEVEL_SEQ"].astype(np.int64), 0.0, 0
    for k in range(1, len(last)):
        a, b = place.get(int(last[k - 1])), place.get(int(last[k]))
        if a is None or b is None or not 0 < b - a < 8 or (last[k] - last[k - 1]) % 0x10000 != b - a:
            continue
        g = (volts[a + 1 : b + 1].mean(axis=0) - zero) / scale
        beta = np.arcsin(np.clip(g[1], -1, 1))
        gamma = -np.arcsin(np.clip(g[0] / np.cos(beta), -1, 1))
        off = max(abs(np.degrees(beta) - c["BETA"][k]), abs(np.degrees(gamma) - c["GAMMA"][k])) * 1e6
        saw = f"BETA {c['BETA'][k]:.6f}, GAMMA {c['GAMMA'][k]:.6f} deg"
        expect(off <= row.limit("tolerance_udeg"), saw, f"{np.degrees(beta):.6f}, {np.degrees(gamma):.6f}")
        worst, count = max(worst, off), count + 1
    conclusive(count >= 20, f"{count} readings whose frames of the level unit are known")
    return f"{count} readings, {worst:.2f} udeg off at most"


@check("run", "GYRO-LEV-02", needs={"can"})
def level_seq_is_that_of_the_last_frame(e: Capture) -> str:
    """Compare LEVEL_SEQ with the frames of the level unit that passed before the reading."""
    node = int(setting(e, "level_node"))
    theirs = int(message("PSA2_XY").frame_id) - dbc_node("psa2") + node
    mine = int(message("GYRO_LEVEL").frame_id) - dbc_node("gyro") + e.node
    scale, latest, count = layout(message("PSA2_XY"))["SEQ"], None, 0
    for f in e.can.frames:
        if f.can_id == theirs and len(f.data) == 8:
            latest = int.from_bytes(f.data, "little") >> scale.start_bit & (1 << scale.bits) - 1
        elif f.can_id == mine and latest is not None and len(f.data) == 8:
            told = int.from_bytes(f.data[6:], "little")
            expect((latest - told) & 0xFFFF <= 1, f"LEVEL_SEQ {told}", f"{latest}, the last that passed", frames=(f,))
            count += 1
    conclusive(count >= 20, f"{count} readings with frames of the level unit")
    return f"{count} readings"


def _steady(c: Mapping[str, Floats], mode: Mode, phases: tuple[Phase, ...]) -> np.ndarray:
    """Readings well inside a mode and phase, where nothing turns."""
    here = (c["MODE"] == mode) & np.isin(c["PHASE"], phases)
    inside = here.copy()
    for k in range(1, 4):
        inside[k:] &= here[:-k]
        inside[:k] = False
    return np.asarray(inside, bool)


def _runs(rows: np.ndarray) -> list[tuple[int, ...]]:
    """Rows (n, m) with repetitions left out."""
    found = [tuple(int(v) for v in r) for r in rows]
    return [r for k, r in enumerate(found) if k == 0 or r != found[k - 1]]


@check("run", "GYRO-LAW-01", needs={"can"})
def u1_levels(e: Capture, row: Requirement) -> str:
    """Compute U1 of readings in which nothing turns from BETA and GAMMA of the same step."""
    c = columns(e)
    mine = _steady(c, Mode.GYROCOMPASS, (Phase.SETTLING, Phase.WINDOW)) | _steady(c, Mode.LEVEL, (Phase.IDLE,))
    b, g = np.radians(c["BETA"]), np.radians(c["GAMMA"])
    due = -setting(e, "m1_per_s") * c["BETA"] * 3600 - vertical_degph(setting(e, "latitude_deg")) * np.cos(b) * np.sin(
        g
    )
    return _as_the_law(c["U1"], due, mine & (c["SATURATED"] == 0), row.limit("tolerance_degph"))


@check("run", "GYRO-LAW-02", needs={"can"})
def u2_holds_the_gimbal(e: Capture, row: Requirement) -> str:
    """Compute U2 at each position of a run from ENCODER, BETA and GAMMA; what the sensor is off there is a constant."""
    c, positions = columns(e), fact(e, "positions", "the positions are not known")
    mine = _steady(c, Mode.GYROCOMPASS, (Phase.WINDOW,)) & (c["SATURATED"] == 0)
    k = np.clip(c["POSITION"].astype(np.int64) - 1, 0, len(positions) - 1)
    b, g = np.radians(c["BETA"]), np.radians(c["GAMMA"])
    wz, m2 = vertical_degph(setting(e, "latitude_deg")), setting(e, "m2_per_s")
    due = -m2 * wrapped_deg(c["ENCODER"] - np.array(positions)[k]) * 3600 + wz * np.cos(b) * np.cos(g)
    for at in range(len(positions)):
        here = mine & (k == at)
        if here.any():
            due[here] += np.median((c["U2"] - due)[here])
    return _as_the_law(c["U2"], due, mine, row.limit("tolerance_degph"))


@check("hold", "GYRO-LAW-02", needs={"can"})
def u2_turns_with_the_earth(e: Capture, row: Requirement) -> str:
    """Turn Wz round by the latitude in mode 2, and compute U2 before and after with one constant for the sensor."""
    parts = fact(e, "latitudes", "no latitudes in the recording")
    logs = [columns(e.with_can(CanLog(frames=e.can.frames[a:b]))) for _, a, b in parts]
    c = {name: np.concatenate([log[name] for log in logs]) for name in logs[0]}
    wz = np.repeat([vertical_degph(d) for d, _, _ in parts], [len(log["U2"]) for log in logs])
    conclusive(not (c["MODE"] != Mode.HOLD).any(), "another mode than 2")
    b, g = np.radians(c["BETA"]), np.radians(c["GAMMA"])
    moved = wrapped_deg(c["ENCODER"] - c["ENCODER"][0])
    m2 = setting(e, "m2_per_s")
    law = -m2 * moved * 3600 + wz * np.cos(b) * np.cos(g)
    most = row.limit("tolerance_degph") + m2 * row.limit("encoder_step_arcsec")
    return _as_the_law(c["U2"], law + np.median(c["U2"] - law), np.ones(len(law), bool), most)


@check("run", "GYRO-LAW-03", needs={"can"})
def u2_runs_free_when_it_levels(e: Capture, row: Requirement) -> str:
    """Compute U2 of readings in mode 1."""
    c = columns(e)
    b, g = np.radians(c["BETA"]), np.radians(c["GAMMA"])
    due = vertical_degph(setting(e, "latitude_deg")) * np.cos(b) * np.cos(g)
    return _as_the_law(c["U2"], due, _steady(c, Mode.LEVEL, (Phase.IDLE,)), row.limit("tolerance_degph"))


def _as_the_law(saw: Floats, due: Floats, mine: np.ndarray, most: float) -> str:
    conclusive(mine.sum() >= 20, f"{int(mine.sum())} readings in which nothing turns")
    off = np.abs(saw - due)[mine]
    if off.max() > most:
        k = int(np.flatnonzero(mine)[int(off.argmax())])
        raise Failed(f"{saw[k]:.3f} deg/h", f"{due[k]:.3f} +- {most:g} deg/h")
    return f"{len(off)} readings, {off.max():.3f} deg/h off at most"


@check("run", "GYRO-LAW-04", needs={"can"})
def windows_show_the_rate_of_the_earth(e: Capture, row: Requirement) -> str:
    """Take the means of -m1 beta over the windows; the Earth's part of them goes as the sine of the angle."""
    c = columns(e)
    count = int(c["POSITION"].max())
    conclusive(count >= 3, f"{count} positions")
    rows, s = [], []
    for k in range(1, count + 1):
        mine = (c["PHASE"] == Phase.WINDOW) & (c["POSITION"] == k) & (c["MODE"] == Mode.GYROCOMPASS)
        conclusive(mine.sum() >= 100, f"no window at position {k}")
        q = np.radians(float(c["ENCODER"][mine].mean()))
        rows.append([np.sin(q), np.cos(q), 1.0])
        s.append(-setting(e, "m1_per_s") * float(c["BETA"][mine].mean()) * 3600)
    a, b, _ = np.linalg.lstsq(np.array(rows), np.array(s), rcond=None)[0]
    saw, due = float(np.hypot(a, b)), EARTH_DEGPH * float(np.cos(np.radians(setting(e, "latitude_deg"))))
    if abs(saw - due) > row.limit("tolerance_degph"):
        raise Failed(f"{saw:.4f} deg/h", f"{due:.4f} +- {row.limit('tolerance_degph'):g} deg/h, We")
    return f"{saw:.4f} deg/h, We is {due:.4f}"


@check("limits", "GYRO-LAW-05", "GYRO-LAW-06", needs={"can"})
def rates_are_limited_and_say_so(e: Capture) -> str:
    """Look at U1, U2 and SATURATED when the level is reported wrongly and the loop is stiff."""
    c, most = columns(e), row_for(e, *LIMITS).limit("rate_max_dps") * 3600
    top = np.maximum(np.abs(c["U1"]), np.abs(c["U2"]))
    near = row_for(e, *LIMITS).limit("tolerance_degph")
    expect(top.max() <= most + near, f"{top.max() / 3600:.3f} deg/s", f"{most / 3600:g} deg/s at most")
    at_limit = top > most - near
    conclusive(at_limit.any(), f"{top.max() / 3600:.3f} deg/s at most: nothing was limited")
    saw = f"{int((c['SATURATED'] == 1).sum())} readings with SATURATED"
    expect(not (at_limit != (c["SATURATED"] == 1)).any(), saw, f"{int(at_limit.sum())} at the limit")
    return f"{int(at_limit.sum())} readings at {most / 3600:g} deg/s, as many with SATURATED"


@check("limits", "GYRO-ERR-03", needs={"can"})
def a_limited_rate_is_an_emergency(e: Capture, row: Requirement) -> str:
    """Look for EMCY FF24h and for its end a second after the last limited rate."""
    c = columns(e)
    found = emergencies(e, EMCY)
    code = int(row.limit("emcy_code"))
    begun = [t for k, t in found if k == code]
    ended = [t for k, t in found if k == 0]
    steps = c["STEP"][c["SATURATED"] == 1]
    conclusive(len(steps), "no rate was limited")
    expect(len(begun) == 1 and ended, f"emergencies {[f'{k:04X}h' for k, _ in found]}", f"{code:04X}h once, then 0000h")
    period_s = row_for(e, "GYRO-CAN-02").limit("period_us") * 1e-6
    due = float(steps[-1] - steps[0]) * period_s + row.limit("ends_s")
    if abs(ended[-1] - begun[0] - due) > 2 * period_s:
        raise Failed(f"ended {ended[-1] - begun[0]:.3f} s after it began", f"{due:.3f} s")
    return f"FF24h once, ended {ended[-1] - begun[0]:.3f} s later"


@check("silence", "GYRO-LEV-03", needs={"can"})
def missing_frames_are_told(e: Capture, row: Requirement) -> str:
    """Look for LEVEL_LOST and EMCY FF21h while the level unit is silent, and for their end."""
    c = columns(e)
    lost = c["LEVEL_LOST"] == 1
    code = int(row.limit("emcy_code"))
    found = emergencies(e, EMCY)
    begun, ended = [t for k, t in found if k == code], [t for k, t in found if k == 0]
    saw = f"LEVEL_LOST in {int(lost.sum())} readings, {[f'{k:04X}h' for k, _ in found]}"
    expect(lost.any() and not lost.all() and begun and ended, saw, f"{code:04X}h, then 0000h")
    steps = c["STEP"][lost]
    period_s = row_for(e, "GYRO-CAN-02").limit("period_us") * 1e-6
    due = float(steps[-1] - steps[0]) * period_s + row.limit("ends_s")
    took = ended[-1] - begun[0]
    expect(abs(took - due) <= row.limit("tolerance_s"), f"ended {took:.3f} s after it began", f"{due:.3f} s")
    return f"LEVEL_LOST in {int(lost.sum())} readings, FF21h ended {took:.3f} s after it began"


@check("gaps", "GYRO-LEV-03", needs={"can"})
def a_single_missing_frame_is_told(e: Capture) -> str:
    """Look for LEVEL_LOST in the readings while each frame of the level unit lacks the one before it."""
    part = slice(*fact(e, "gaps"))
    c = columns(e.with_can(CanLog(frames=e.can.frames[part])))
    lost, fresh = c["LEVEL_LOST"] == 1, np.diff(c["LEVEL_SEQ"], prepend=c["LEVEL_SEQ"][0]) != 0
    conclusive(fresh.sum() >= LEAST, f"{fresh.sum()} readings with a new frame of the level unit")
    missed = int((fresh & ~lost).sum())
    expect(not missed, f"{missed} of {fresh.sum()} readings that lack a frame without LEVEL_LOST", "LEVEL_LOST in each")
    return f"LEVEL_LOST in {fresh.sum()} readings that lack one frame each"


@check("silence", "GYRO-LEV-04", needs={"can"})
def angles_stay_without_the_level_unit(e: Capture, row: Requirement) -> str:
    """Look at BETA, GAMMA and U1 while the level unit is silent."""
    c = columns(e)
    lost = np.flatnonzero(c["LEVEL_LOST"] == 1)
    silent = round(row.limit("silent_ms") * 1e3 / row_for(e, "GYRO-CAN-02").limit("period_us"))
    conclusive(len(lost) >= 2 * silent, f"{len(lost)} readings without the level unit")
    mine = lost[silent:-silent]
    for name in ("BETA", "GAMMA", "U1"):
        expect(np.ptp(c[name][mine]) <= 0, f"{name} moves by {np.ptp(c[name][mine]):g}", "it stays")
    begun = [k for k, _ in emergencies(e, EMCY) if k == int(row.limit("emcy_code"))]
    expect(len(begun) == 1, f"{len(begun)} emergencies FF21h", "one")
    return f"{len(mine)} readings with the same angles and U1, one emergency"


@check("power_on", "GYRO-RES-01", needs={"can"})
def res_ends_the_mode_and_counts_anew(e: Capture) -> str:
    """Look at MODE and STEP after a Res while it levelled."""
    period_s = row_for(e, "GYRO-CAN-02").limit("period_us") * 1e-6
    late = late_readings(e, "GYRO_HEARTBEAT", MESSAGES[0], 0.0, period_s)
    c = columns(e)
    expect(not c["MODE"].any(), f"mode {c['MODE'].max():g}", "0")
    expect(c["STEP"][0] <= 1 + late, f"STEP {c['STEP'][0]:g} first", f"{1 + late} at most")
    return f"{len(c['MODE'])} readings of mode 0, STEP from {c['STEP'][0]:g}"


@check("run", "GYRO-SIG-01", needs={"line", "can"}, wires=LINES)
def lines_show_the_phases(e: Capture, row: Requirement) -> str:
    """Compare STEP, SLEW, SETTLE and WINDOW with the readings."""
    c = columns(e)
    up, down = e.wires.pulses("STEP", 1)
    seen = interval(
        e, up, down, row.limit("step_high_us") * US, row.limit("tolerance_us") * US, "of STEP high", ("STEP",)
    )
    rises, n = e.wires.rises("STEP"), len(c["PHASE"])
    at = rises + round(US)
    shown = np.stack([e.wires[name].at(at) for name in PHASES], axis=1).astype(np.int64)
    told = np.stack([c["PHASE"] == phase for phase in PHASES.values()], axis=1).astype(np.int64)
    if _runs(shown) != _runs(told):
        raise Failed(f"{', '.join(PHASES)} in turn {_runs(shown)}", f"{_runs(told)} as PHASE tells", lines=LINES)
    if not len(e.wires.gaps_ns):
        off = np.abs(shown.sum(axis=0) - told.sum(axis=0))
        if off.max() > abs(len(rises) - n) + 2:  # steps at the ends of the recording
            raise Failed(f"{', '.join(PHASES)} high in {shown.sum(axis=0)} steps", f"{told.sum(axis=0)}", lines=LINES)
    expect(int(e.wires["READY"].at(e.wires.end_ns)), "READY low in a run", "high", lines=LINES)
    return f"{seen}; SLEW, SETTLE and WINDOW with their phases"


@check("silence", "GYRO-SIG-01", needs={"line", "can"}, wires=("STEP", "FAULT"))
def fault_shows_the_flags(e: Capture) -> str:
    """Compare FAULT with the flags of the readings while the level unit is silent for a while, twice."""
    conclusive(not len(e.wires.gaps_ns), "samples were lost: a flag of a single step may be among them")
    c = columns(e)
    shown = e.wires["FAULT"].at(e.wires.rises("STEP") + round(US)).astype(np.int64)[:, None]
    told = np.max([c[name] for name in FLAGS], axis=0).astype(np.int64)[:, None]
    if not len(shown) or _runs(shown) != _runs(told):
        raise Failed(f"FAULT in turn {_runs(shown)}", f"{_runs(told)} as the flags tell", lines=("STEP", "FAULT"))
    return f"FAULT in {int(shown.sum())} steps, flags in {int(told.sum())} readings"
