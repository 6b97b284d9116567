"""The receiver: its readings, their time, PPS and SOL (docs/reference/protocol_receiver.md)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from psabench.boards.receiver.device import MESSAGES, NO_FIX, WEEK_S
from psabench.conform.capture.intervals import counted, interval, rises_at_rate
from psabench.conform.capture.log import CanLog, Capture
from psabench.conform.capture.messages import as_laid_out, booted, in_turn, reading_columns
from psabench.conform.plan import check
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, expect
from psabench.link.signals import Ints

LEAST = 8
US = 1e3


def columns_of(e: Capture) -> Mapping[str, Ints]:
    """Raw signals of whole readings. Raises Inconclusive."""
    return reading_columns(e, MESSAGES, LEAST)


@check("stream", "RECEIVER-CAN-01", needs={"can"})
def four_messages_make_a_reading(e: Capture) -> str:
    """Follow the messages of each reading."""
    return in_turn(e, MESSAGES)


@check("stream", "RECEIVER-CAN-02", needs={"can"})
def readings_are_counted(e: Capture, row: Requirement) -> str:
    """Look at SEQ from reading to reading."""
    return counted(columns_of(e)["SEQ"], int(row.limit("modulo")), "SEQ")


@check("stream", "RECEIVER-CAN-02", needs={"line"}, wires=("SOL",))
def solutions_come_at_their_rate(e: Capture, row: Requirement) -> str:
    """Measure from one rise of SOL to the next."""
    return rises_at_rate(e, row, "SOL", "from solution to solution")


@check("stream", "RECEIVER-CAN-03", needs={"can"})
def messages_have_their_lengths(e: Capture) -> str:
    """Look at the lengths of the four messages, and at bits that have no signal."""
    return as_laid_out(e, MESSAGES)


@check("stream", "RECEIVER-TIME-01", needs={"can"})
def time_goes_on_by_the_period(e: Capture, row: Requirement) -> str:
    """Compare WEEK and TOW from reading to reading."""
    c = columns_of(e)
    ms: Ints = c["WEEK"].astype(np.int64) * WEEK_S * 1000 + c["TOW"].astype(np.int64)
    steps = np.unique(np.diff(ms))
    due = row.limit("period_us") / US
    return expect(steps.tolist() == [due], f"steps of {steps.tolist()} ms", f"{due:g} ms")


@check("stream", "RECEIVER-POS-01", needs={"can"})
def a_fix_is_on_the_earth(e: Capture, row: Requirement) -> str:
    """Look at latitude and longitude of the readings with a fix."""
    c = columns_of(e)
    valid = c["FIX"] != NO_FIX
    conclusive(valid.any(), "no reading has a fix")
    lat, lon = c["LAT"].astype(np.int64)[valid], c["LON"].astype(np.int64)[valid]
    limits_e7 = row.limit("latitude_deg") * 1e7, row.limit("longitude_deg") * 1e7
    bad = (abs(lat) > limits_e7[0]) | (abs(lon) > limits_e7[1]) | (lon == -limits_e7[1])
    if bad.any():
        k = int(np.argmax(bad))
        raise Failed(f"latitude {lat[k]} e-7 deg, longitude {lon[k]} e-7 deg", "a place on the Earth")
    return f"{int(valid.sum())} readings with a fix"


@check("stream", "RECEIVER-SIG-01", needs={"line"}, wires=("PPS",))
def pps_is_a_pulse(e: Capture, row: Requirement) -> str:
    """Measure how long PPS is high."""
    begins, ends = e.wires.pulses("PPS", 1)
    tolerance_ns = row.limit("tolerance_us") * US
    return interval(e, begins, ends, row.limit("high_us") * US, tolerance_ns, "PPS is high", ("PPS",))


@check("power_on", "RECEIVER-RES-01", needs={"can"})
def the_first_reading_is_number_one(e: Capture, row: Requirement) -> str:
    """Look at SEQ of the first reading after the boot-up message."""
    boot = booted(e, "RECEIVER_HEARTBEAT")
    log = CanLog(frames=tuple(f for f in e.frames_of("RECEIVER_TIME").frames if f.t_s > boot.t_s))
    conclusive(len(log) and e.facts.get("prompt"), "the host did not start the node before the first reading")
    first = int(log.raw("RECEIVER_TIME")["SEQ"][0])
    return expect(first == row.limit("first_seq"), f"SEQ {first}", f"{row.limit('first_seq'):g}")
