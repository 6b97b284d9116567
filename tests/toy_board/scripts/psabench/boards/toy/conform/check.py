"""TOY: its codes on CAN and on its lines."""

from __future__ import annotations

import numpy as np

from psabench.conform.capture.intervals import wires_needed
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive
from psabench.link.signals import Ints

LEAST = 8
SEQ_MODULO = 256


def sample_codes(e: Capture) -> Ints:
    """X, Y, Z (n, 3) of the samples. Raises Inconclusive for fewer than eight."""
    log = e.frames_of("TOY_SAMPLE")
    if len(log) < LEAST:
        raise Inconclusive(f"{len(log)} messages TOY_SAMPLE came; expected {LEAST}")
    raw = log.raw("TOY_SAMPLE")
    return np.stack([raw[axis] for axis in "XYZ"], axis=1)


@check("stream", "TOY-CAN-01", needs={"can", "inputs"})
def codes_are_the_volts_at_the_inputs(e: Capture, row: Requirement) -> str:
    """Divide the known volts at the inputs by the weight of a code."""
    found = sample_codes(e)
    due = np.array([e.inputs_v.get(axis, 0.0) for axis in "xyz"]) / row.limit("code_v")
    if np.abs(found - due).max() > row.limit("error_max_codes"):
        raise Failed(f"codes {found[0].tolist()}", f"{due.round(1).tolist()}")
    return f"codes {found[0].tolist()} at {dict(e.inputs_v)} V"


@check("stream", "TOY-CAN-02", needs={"can", "stamps"})
def samples_come_at_their_pace(e: Capture, row: Requirement) -> str:
    """Measure the time from frame to frame, and follow SEQ."""
    sample_codes(e)
    log = e.frames_of("TOY_SAMPLE")
    steps_us = np.diff(log.t_s) * 1e6
    off_us = float(np.abs(steps_us - row.limit("period_us")).max())
    rises = set((np.diff(log.raw("TOY_SAMPLE")["SEQ"]) % SEQ_MODULO).tolist())
    if off_us > row.limit("tolerance_us") or rises != {1}:
        raise Failed(f"{steps_us.min():.0f} to {steps_us.max():.0f} us, SEQ rises by {rises}", "each 10 ms, by one")
    return f"{len(log)} samples, {steps_us.min():.0f} to {steps_us.max():.0f} us apart"


@check("stream", "TOY-LINE-01", needs={"line"})
def lines_carry_the_codes(e: Capture) -> str:
    """Read DATA at the rises of CLK while FRAME is low, and look for these words among the codes on CAN."""
    wires_needed(e, "FRAME", "CLK", "DATA")
    bits = int(row_for(e, "TOY-LINE-01").limit("bits_count"))
    begins, ends = e.wires.pulses("FRAME", 0)
    rises = e.wires.rises("CLK")
    sent = [tuple(int(c) for c in row) for row in sample_codes(e)]
    found = []
    for begin, end in zip(begins, ends, strict=True):
        at = rises[(rises > begin) & (rises < end)]
        if len(at) != bits:
            raise Failed(
                f"{len(at)} rises of CLK while FRAME is low", f"{bits}", at_ns=int(begin), lines=("FRAME", "CLK")
            )
        levels = e.wires["DATA"].at(at).astype(np.int64).reshape(3, bits // 3)
        words = levels @ (1 << np.arange(bits // 3)[::-1])
        found.append(tuple(int(w) for w in (words + 0x8000) % 0x10000 - 0x8000))
    if len(found) < LEAST:
        raise Inconclusive(f"{len(found)} frames on the lines; expected {LEAST}")
    if strange := [word for word in found if word not in sent]:
        raise Failed(f"{strange[0]} on DATA ({len(strange)} of {len(found)})", "codes of TOY_SAMPLE", lines=("DATA",))
    return f"{len(found)} frames on the lines, the codes of TOY_SAMPLE"
