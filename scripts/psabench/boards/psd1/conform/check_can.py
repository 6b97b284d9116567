"""What PSD-1 tells on CAN: order, numbers, lengths and contents of its messages."""

from __future__ import annotations

import numpy as np

from psabench.boards.psd1.conform.host import BEGUN
from psabench.conform.capture.log import CanLog, Capture
from psabench.conform.capture.messages import as_laid_out
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, expect, none_of
from psabench.link.protocol_files import message
from psabench.link.signals import Floats

ALL = ("PSD1_CYCLE", *BEGUN)


def _told(e: Capture, name: str, least: int = 3) -> CanLog:
    log = e.frames_of(name)
    conclusive(len(log) >= least, f"{len(log)} messages {name} came; expected {least}")
    due = int(message(name).length)
    bad = [f for f in log.frames if len(f.data) != due]
    none_of(bad, lambda f: f"{name} of {len(f.data)} bytes", f"{due}", frames=bad)
    return log


@check("messages", "PSD1-CAN-02", needs={"can"})
def messages_have_their_lengths(e: Capture) -> str:
    """Look at the lengths of the four messages, and at bits that have no signal."""
    for name in ALL:
        _told(e, name)
    return as_laid_out(e, ALL)


@check("messages", "PSD1-CAN-03", needs={"can"})
def cnt_rises_by_one(e: Capture, row: Requirement) -> str:
    """Look at CNT of PSD1_CYCLE from cycle to cycle, and in all messages of a cycle."""
    modulo = int(row.limit("modulo"))
    log = _told(e, "PSD1_CYCLE")
    cnt = log.raw("PSD1_CYCLE")["CNT"]
    parts = np.flatnonzero(np.diff(cnt) % modulo != 1)
    allowed = 1  # between the two stretches of the stimulus
    if len(parts) > allowed:
        k = int(parts[0])
        raise Failed(f"CNT {cnt[k]}, then {cnt[k + 1]}", "one more", frames=log.frames[k : k + 2])
    latest = -1
    names = {_told(e, name, 1).frames[0].can_id: name for name in ALL}
    for f in e.can.frames:
        name = names.get(f.can_id, "")
        if not name or f.sent:
            continue
        number = f.data[7] if name == "PSD1_TIME" else f.data[6]
        if name == "PSD1_CYCLE":
            latest = number
        elif latest >= 0 and number != latest:
            raise Failed(f"CNT {number} in {name} after {latest} in PSD1_CYCLE", "the same", frames=(f,))
    return f"{len(cnt)} cycles, CNT {cnt[0]} to {cnt[-1]}"


@check("messages", "PSD1-CAN-04", needs={"can"})
def further_messages_are_off_until_wanted(e: Capture) -> str:
    """Look for PSD1_TIME, PSD1_GYRO and PSD1_RATE before and after they were switched on."""
    before = int(str(e.facts.get("before", 0)))
    early = CanLog(frames=e.can.frames[:before])
    for name in BEGUN:
        stray = early.of(name, e.variant.family, e.node)
        expect(not len(stray), f"{name} before it was switched on", "none", frames=stray.frames)
        expect(len(e.frames_of(name)), f"no {name} after it was switched on", "one for each cycle")
    return "none before, all three after"


@check("messages", "PSD1-CAN-05", needs={"can"})
def strobes_are_told(e: Capture) -> str:
    """Look at READ_X, READ_Y and READ_Z of complete cycles."""
    log = _told(e, "PSD1_CYCLE")
    raw = log.raw("PSD1_CYCLE")
    for axis in "XYZ":
        bad = np.flatnonzero(raw[f"READ_{axis}"] != 1)
        if len(bad):
            raise Failed(f"READ_{axis} 0", "1", frames=(log.frames[int(bad[0])],))
    return f"{len(log)} cycles, all three read"


def volts(e: Capture, log: CanLog) -> Floats:
    """(n, 3) by the words of PSD1_CYCLE."""
    row = row_for(e, "PSD1-WORD-01")
    raw = log.raw("PSD1_CYCLE")
    codes = np.stack([raw[a] for a in "XYZ"], axis=1)
    return np.asarray((codes - row.limit("zero_code")) / row.limit("zero_code") * row.limit("full_scale_v"), np.float64)


@check("words", "PSD1-WORD-01", needs={"can", "inputs"})
def words_are_offset_binary(e: Capture, row: Requirement) -> str:
    """Compare the means of many words with the volts at the inputs."""
    v = volts(e, _told(e, "PSD1_CYCLE", 16))
    quiet = e.variant.profile == "psd1_quiet"
    most_v = row.limit("quiet_tolerance_pct" if quiet else "tolerance_pct") / 100 * row.limit("full_scale_v")
    for axis, mean in zip("xyz", v.mean(axis=0), strict=True):
        if axis in e.inputs_v and abs(mean - e.inputs_v[axis]) > most_v:
            raise Failed(f"{mean:.4f} V on {axis.upper()}", f"{e.inputs_v[axis]:g} +- {most_v:.4f} V")
    return f"{len(v)} words, means {', '.join(f'{m:.4f}' for m in v.mean(axis=0))} V"


@check("words", "PSD1-CHIP-04", needs={"can", "inputs"})
def noise_is_that_of_the_table(e: Capture, row: Requirement) -> str:
    """Take the standard deviation of a thousand words of each axis."""
    v = volts(e, _told(e, "PSD1_CYCLE", int(row.limit("readings_count"))))
    noise_mv = v.std(axis=0, ddof=1) * 1e3
    due, part = row.limit("noise_mv"), row.limit("tolerance_pct") / 100
    for axis, mv in zip("XYZ", noise_mv, strict=True):
        expect(abs(mv / due - 1) <= part, f"{mv:.2f} mV rms on {axis}", f"{due:g} mV +- {part:.0%}")
    return f"{len(v)} words, {', '.join(f'{m:.2f}' for m in noise_mv)} mV rms"
