"""The inertial unit: its readings, their intervals, TICK (docs/reference/protocol_bins.md)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from psabench.boards.bins.device import MESSAGES
from psabench.conform.capture.intervals import counted, interval, rises_at_rate
from psabench.conform.capture.log import CanLog, Capture
from psabench.conform.capture.messages import as_laid_out, booted, in_turn, reading_columns
from psabench.conform.plan import check
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, expect
from psabench.link.signals import Ints

LEAST = 20
US = 1e3
WRAP_US = 1 << 32


def columns_of(e: Capture) -> Mapping[str, Ints]:
    """Raw signals of whole readings. Raises Inconclusive."""
    return reading_columns(e, MESSAGES, LEAST)


@check("stream", "BINS-CAN-01", needs={"can"})
def four_messages_make_a_reading(e: Capture) -> str:
    """Follow the messages of each reading."""
    return in_turn(e, MESSAGES)


@check("stream", "BINS-CAN-03", needs={"can"})
def messages_have_their_lengths(e: Capture) -> str:
    """Look at the lengths of the four messages, and at bits that have no signal."""
    return as_laid_out(e, MESSAGES)


@check("stream", "BINS-CAN-02", needs={"can"})
def readings_are_counted(e: Capture, row: Requirement) -> str:
    """Look at SEQ from reading to reading."""
    return counted(columns_of(e)["SEQ"], int(row.limit("modulo")), "SEQ")


@check("stream", "BINS-CAN-02", needs={"line"}, wires=("TICK",))
def readings_come_at_their_rate(e: Capture, row: Requirement) -> str:
    """Measure from one rise of TICK to the next."""
    return rises_at_rate(e, row, "TICK", "from latch to latch")


@check("stream", "BINS-SIG-01", needs={"line"}, wires=("TICK",))
def tick_is_a_pulse(e: Capture, row: Requirement) -> str:
    """Measure how long TICK is high."""
    begins, ends = e.wires.pulses("TICK", 1)
    tolerance_ns = row.limit("tolerance_us") * US
    return interval(e, begins, ends, row.limit("high_us") * US, tolerance_ns, "TICK is high", ("TICK",))


@check("stream", "BINS-INC-01", needs={"can"})
def intervals_follow_one_another(e: Capture, row: Requirement) -> str:
    """Compare TSTAMP from reading to reading, and look at WORDS and the flags of a whole one."""
    c = columns_of(e)
    stamps: Ints = c["TSTAMP"].astype(np.int64)
    steps_us = np.diff(stamps) % WRAP_US
    off_us = np.abs(steps_us - row.limit("period_us"))
    if off_us.max() > row.limit("tolerance_us"):
        raise Failed(f"intervals of {steps_us.min()} to {steps_us.max()} us", f"{row.limit('period_us'):g} us")
    words = np.unique(c["WORDS"])
    whole = (c["SETTLED"] == 1) & (c["INCOMPLETE"] == 0) & (c["STRETCHED"] == 0)
    if len(words) != 1 or not whole.all():
        raise Failed(f"{words.tolist()} words, {int((~whole).sum())} readings that are not whole", "whole readings")
    return f"{len(off_us)} intervals, {words[0]} words each"


@check("power_on", "BINS-RES-01", needs={"can"})
def the_first_reading_is_number_one(e: Capture, row: Requirement) -> str:
    """Look at SEQ of the first reading after the boot-up message."""
    boot = booted(e, "BINS_HEARTBEAT")
    log = CanLog(frames=tuple(f for f in e.frames_of("BINS_GYRO_Z").frames if f.t_s > boot.t_s))
    conclusive(len(log) and e.facts.get("prompt"), "the host did not start the node before the first reading")
    first = int(log.raw("BINS_GYRO_Z")["SEQ"][0])
    return expect(first == row.limit("first_seq"), f"SEQ {first}", f"{row.limit('first_seq'):g}")
