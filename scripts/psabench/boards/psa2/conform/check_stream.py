"""Samples of PSA-2 and PSA-1 on CAN: order, numbers, times, temperatures."""

from __future__ import annotations

import itertools

import numpy as np

from psabench.boards.psa2.conform.capture_can import SEQ_BITS, STAMP_BITS, pairs
from psabench.boards.psa2.conform.capture_line import WORDS, Transfers, transfers
from psabench.boards.psa2.conform.check_serial import LEAST
from psabench.boards.psa2.conform.stimulus_can import FRAMES, OVERRUNS, Answer
from psabench.conform.capture.intervals import fact, first_of, wires_needed
from psabench.conform.capture.log import Bools, CanLog, Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, expect
from psabench.link.protocol_files import message
from psabench.link.signals import Floats, Ints

LINES = ("Int", "Data", "CLK")
SAMPLED = ("DRD_A", "Int")
FORMATS = ("PSA2-FRAME-06", "PSA2-FRAME-07", "PSA2-FRAME-08")
MESSAGES = ("PSA2_XY", "PSA2_ZT", "PSA2_FAST", "PSA2_FRAME", "PSA2_BLOCK")
US = 1e-6


def number(a: object) -> int:
    """Value of an answer. Raises Failed where it is a rejection."""
    if not isinstance(a, Answer) or not isinstance(a.value, int):
        raise Failed(f"abort {a.abort:08X}h" if isinstance(a, Answer) else "no answer", "a value")
    return a.value


def unit_us(e: Capture) -> float:
    """Of TSTAMP."""
    return row_for(e, "PSA2-CAN-05").limit("unit_us")


def word_bits(e: Capture) -> int:
    """Of a word on the line."""
    return int(row_for(e, *FORMATS).limit("word_bits"))


def whole_transfers(e: Capture) -> Transfers:
    """The transfers, each of which must have all its bits. Raises Failed for the first that has not."""
    t = transfers(e.wires)
    due = WORDS * word_bits(e)
    for fall, rises in zip(t.fall_ns, t.rises, strict=True):
        expect(len(rises) == due, f"{len(rises)} pulses of CLK in a transfer", f"{due}", at_ns=int(fall), lines=LINES)
    return t


# ---- pairs


@check("stream", "PSA2-CAN-01")
def xy_and_zt_alternate(e: Capture) -> str:
    """Look at the order of the two messages of a sample, and for others of the stream."""
    ids = {int(message(n).frame_id) - 5 + e.node: n for n in MESSAGES}
    found = [f for f in e.can.frames if f.can_id in ids and not f.error]
    if len(found) < 2 * LEAST:
        conclusive(e.stimulus != "recording", f"{len(found)} frames of samples in the log; expected {2 * LEAST}")
        raise Failed(f"{len(found)} frames of samples", "two of each sample", frames=e.can.frames[:10])
    for k, (a, b) in enumerate(itertools.pairwise(found)):
        names = ids[a.can_id], ids[b.can_id]
        if names not in (("PSA2_XY", "PSA2_ZT"), ("PSA2_ZT", "PSA2_XY")):
            saw = f"{names[0]}, then {names[1]}"
            raise Failed(saw, "PSA2_XY and PSA2_ZT in turn", frames=found[max(0, k - 2) : k + 3])
    return f"{len(found)} frames, PSA2_XY and PSA2_ZT in turn"


@check("stream", "PSA2-CAN-01", needs={"can", "stamps"})
def xy_comes_before_its_zt(e: Capture) -> str:
    """Measure from each of the two messages to the other: those of a sample follow each other at once."""
    ids = {int(message(n).frame_id) - 5 + e.node: n for n in MESSAGES[:2]}
    found = [f for f in e.can.frames if f.can_id in ids and not f.error]
    apart_s: dict[str, list[float]] = {n: [] for n in ids.values()}
    for a, b in itertools.pairwise(found):
        if a.can_id != b.can_id:
            apart_s[ids[a.can_id]].append(b.t_s - a.t_s)
    conclusive(min(len(times) for times in apart_s.values()) >= LEAST, f"{len(found)} frames PSA2_XY and PSA2_ZT came")
    after_xy_us, after_zt_us = (float(np.median(apart_s[n])) / US for n in MESSAGES[:2])
    if after_xy_us > after_zt_us:
        saw = f"PSA2_ZT {after_xy_us:.0f} us after PSA2_XY, PSA2_XY {after_zt_us:.0f} us after PSA2_ZT"
        raise Failed(saw, "PSA2_ZT follows PSA2_XY, not the other way", frames=found[:4])
    return f"PSA2_ZT {after_xy_us:.0f} us after PSA2_XY"


@check("stream", "PSA2-CAN-02")
def messages_have_their_lengths(e: Capture) -> str:
    """Compare lengths, forms and ranges of all messages with the table."""
    seen = 0
    for name in MESSAGES:
        log = e.frames_of(name)
        due = int(message(name).length)
        bad = [f for f in log.frames if len(f.data) != due]
        if bad:
            raise Failed(f"{name} of {len(bad[0].data)} bytes", f"{due}", frames=bad)
        seen += len(log)
    p = pairs(e)
    if (p.channel >= int(row_for(e, "PSA2-TEMP-01").limit("channels_count"))).any():
        k = int(np.argmax(p.channel))
        raise Failed(f"CHANNEL {p.channel[k]}", "a channel that there is", frames=p.about(k))
    return f"{seen} frames of their length"


@check("stream", "PSA2-CAN-03", needs={"pins", "stamps", "lockstep"})
def no_frame_before_its_transfer_has_ended(e: Capture, row: Requirement) -> str:
    """Compare the time of each PSA2_XY on the bus with TSTAMP, and with the rise of Int."""
    p = pairs(e)
    stamp_us = p.stamp * unit_us(e)
    rx_us = np.array([f.t_s for f in p.frames]) / US
    after_us = (rx_us - stamp_us) % (unit_us(e) * (1 << STAMP_BITS))
    least_us = row.limit("after_sample_min_us") - unit_us(e)
    rises = e.wires.rises("Int")
    k = np.searchsorted(rises, rx_us * 1e3)
    since_us = rx_us[k > 0] - rises[k[k > 0] - 1] * 1e-3
    bad = after_us < least_us
    if (n := first_of(bad)) is not None:
        raise Failed(f"PSA2_XY {after_us[n]:.0f} us after its sample", f"{least_us:.0f} us or more", frames=p.about(n))
    expect(len(since_us), "no rise of Int before any PSA2_XY", "one before each", at_ns=e.wires.start_ns, lines=LINES)
    if since_us.max() > row.limit("after_int_max_us"):
        n = int(np.argmax(since_us)) + int((k == 0).sum())
        raise Failed(f"PSA2_XY {since_us.max():.0f} us after Int", "it follows at once", frames=p.about(n))
    return f"PSA2_XY {after_us.min():.0f} us and more after the sample, {since_us.min():.0f} us after Int"


@check("quiet", "PSA2-CAN-04")
def seq_rises_by_one(e: Capture) -> str:
    """Look for gaps of SEQ."""
    p = pairs(e)
    p.unbroken()
    return f"{len(p)} samples, SEQ {p.seq[0]} to {p.seq[-1]}"


@check("quiet", "PSA2-SAMP-01")
def every_conversion_becomes_a_sample(e: Capture, row: Requirement) -> str:
    """Measure TSTAMP from sample to sample: one data period each?"""
    p = pairs(e)
    period_us = row_for(e, "PSA2-READ-06").limit("period_us")
    step_us = np.diff(p.stamp) * unit_us(e)
    slack_us = row.limit("tolerance_us") + e.slack_ns(period_us * 1e3) * 1e-3
    bad = np.flatnonzero(np.abs(step_us - period_us) > slack_us)
    if len(bad):
        saw = f"{step_us[bad[0]]:.0f} us from sample to sample ({len(bad)} of {len(step_us)})"
        raise Failed(saw, f"{period_us:.0f} +- {slack_us:.1f} us", frames=p.about(int(bad[0])))
    return f"{len(p)} samples, each {step_us.min():.0f} to {step_us.max():.0f} us after the one before"


@check("quiet", "PSA2-CAN-05")
def tstamp_goes_by_the_data_period(e: Capture, row: Requirement) -> str:
    """Compare TSTAMP with SEQ times the data period."""
    p = pairs(e, 100)
    period_us = row_for(e, "PSA2-READ-06").limit("period_us")
    n = np.concatenate(([0], np.cumsum(p.steps)))
    expect(n[-1], f"SEQ stands still at {p.seq[0]}", "one more a sample", frames=p.about(0))
    t_us = (p.stamp - p.stamp[0]) * unit_us(e)
    mean_us = float(t_us[-1]) / float(n[-1])
    slack_us = e.slack_ns(period_us * 1e3) * 1e-3 + unit_us(e) / n[-1]
    if abs(mean_us - period_us) > slack_us:
        raise Failed(f"{mean_us:.4f} us a sample", f"{period_us:.1f} +- {slack_us:.4f} us", frames=p.about(0))
    off_us = np.abs(t_us - n * mean_us)
    k = int(np.argmax(off_us))
    most_us = row.limit("jitter_max_us")
    saw, due = f"TSTAMP off by {off_us[k]:.1f} us", f"at most {most_us:g} us and its own unit"
    expect(off_us[k] <= most_us + unit_us(e), saw, due, frames=p.about(k))
    return f"{mean_us:.4f} us a sample over {n[-1]} periods, off by at most {off_us[k]:.1f} us"


@check("stream", "PSA2-CAN-05", needs={"pins", "exact", "stamps"})
def tstamp_is_the_fall_of_drd_a(e: Capture, row: Requirement) -> str:
    """Compare each TSTAMP with the fall of DRD_A of its own sample: the last before the Int that its frame follows."""
    p = pairs(e)
    known, fall_ns = sampled_ns(e, np.array([f.t_s for f in p.frames]))
    conclusive(known.sum() >= LEAST, f"{known.sum()} samples with their fall of DRD_A were recorded")
    wrap = 1 << STAMP_BITS
    saw, due = p.stamp[known] % wrap, fall_ns[known] // round(unit_us(e) * 1e3) % wrap
    if (n := first_of(saw != due)) is not None:
        k = int(np.flatnonzero(known)[n])
        raise Failed(
            f"TSTAMP {saw[n]}", f"{due[n]}, the fall of DRD_A of this sample", frames=p.about(k), lines=SAMPLED
        )
    return f"{len(saw)} time stamps, each the fall of DRD_A of its sample"


def sampled_ns(e: Capture, t_s: Floats) -> tuple[Bools, Ints]:
    """Of frames (n,) that came at t_s: whether the recording has their sample, and its fall of DRD_A in ns.

    A frame is queued when Int rises, and the transfer on the line begins after the read that follows the fall.
    """
    wires_needed(e, *SAMPLED)
    drd, ints = e.wires.falls("DRD_A"), e.wires.pulses("Int", 0)
    transfer = np.searchsorted(ints[1], np.rint(t_s * 1e9).astype(np.int64), "right") - 1
    if not len(drd) or not len(ints[0]):
        return np.zeros(len(t_s), bool), np.zeros(len(t_s), np.int64)
    sample = np.searchsorted(drd, ints[0][np.maximum(transfer, 0)]) - 1
    return (transfer >= 0) & (sample >= 0), drd[np.maximum(sample, 0)]


@check("starts", "PSA2-CAN-06")
def samples_come_whole(e: Capture, row: Requirement) -> str:
    """Start and stop the stream at all phases of a sample: is there a second half without a first?"""
    first, second = (int(message(n).frame_id) - 5 + e.node for n in ("PSA2_XY", "PSA2_ZT"))
    halves = [f for f in e.can.frames if f.can_id in (first, second) and not f.error]
    conclusive(len(halves) >= LEAST, f"{len(halves)} halves of samples came")
    for k, f in enumerate(halves):
        if f.can_id == second and (k == 0 or halves[k - 1].can_id == second):
            raise Failed("a PSA2_ZT without its PSA2_XY", "both", frames=halves[max(0, k - 2) : k + 2])
    torn = sum(a.can_id == b.can_id == first for a, b in itertools.pairwise(halves))
    starts = int(row.limit("starts_count"))
    expect(torn <= starts, f"{torn} PSA2_XY without PSA2_ZT in {starts} stops", "at most one a stop")
    return f"{len(halves)} halves, {torn} cut by a stop"


@check("quiet", "PSA2-CAN-08")
def overrun_tells_of_lost_conversions(e: Capture) -> str:
    """Compare OVERRUN with the gaps of SEQ and with the counter of overruns."""
    p = pairs(e)
    gap = np.concatenate(([False], p.steps != 1))
    wrong = np.flatnonzero(p.overrun[1:] != gap[1:]) + 1
    if len(wrong):
        k = int(wrong[0])
        raise Failed(
            f"OVERRUN {int(p.overrun[k])} {'at a gap' if gap[k] else 'without a gap'} of SEQ",
            "OVERRUN after a gap, and only there",
            frames=p.about(k),
        )
    return f"{int(p.overrun.sum())} of {len(p)} samples with OVERRUN, {int(gap.sum())} gaps"


def _counted(e: Capture, sub: int) -> int:
    before, after = (fact(e, name, "the scene has no counters") for name in ("before", "after"))
    return number(after[sub]) - number(before[sub])


def _meanwhile(e: Capture, sub: int) -> Capture:
    """The log between the two answers that told a counter: the bus has them in their order, whoever was late.

    Raises Inconclusive where it lacks one.
    """
    answer, what = int(row_for(e, "BUS-ID-01").limit("sdo_tx_id")) + e.node, bytes([0x30, 0x20, sub])
    at = [k for k, f in enumerate(e.can.frames) if f.can_id == answer and f.data[1:4] == what and not f.sent]
    conclusive(len(at) >= 2, "the answers that told the counter are not in the log")
    return e.with_can(CanLog(frames=e.can.frames[at[0] : at[-1]]))


@check("quiet", "PSA2-CNT-01")
def frames_are_counted(e: Capture, row: Requirement) -> str:
    """Compare the counter of frames with SEQ."""
    p, counted = pairs(_meanwhile(e, FRAMES)), _counted(e, FRAMES)
    span = int((p.seq[-1] - p.seq[0]) % (1 << SEQ_BITS)) + 1
    fewer, more = int(row.limit("on_its_way_max_frames")), int(row.limit("edge_max_frames"))
    if not span - fewer <= counted <= span + more:
        raise Failed(f"{counted} frames counted, {span} by SEQ", f"{fewer} less to {more} more, at the ends")
    return f"{counted} frames counted, {span} by SEQ"


@check("quiet", "PSA2-CNT-02")
def overruns_are_counted(e: Capture, row: Requirement) -> str:
    """Compare the counter of overruns with OVERRUN."""
    counted = _counted(e, OVERRUNS)
    late = int(row.limit("told_late_max_frames"))  # those were counted before
    told = int(pairs(_meanwhile(e, OVERRUNS)).overrun[late:].sum())
    if counted < told or (counted and not pairs(e).overrun.any()):
        raise Failed(f"{counted} overruns counted, {told} told by OVERRUN", "as many")
    return f"{counted} overruns counted, {told} told by OVERRUN"


@check("power_on", "PSA2-RES-05")
def seq_begins_with_0(e: Capture) -> str:
    """Look at the first sample after the reset."""
    boots = [k for k, f in enumerate(e.can.frames) if f.can_id == 0x700 + e.node and f.data[:1] == b"\0"]
    expect(boots, "no boot-up message after the reset", "one", frames=e.can.frames[:10])
    log = CanLog(frames=e.can.frames[boots[-1] :])
    first = e.with_can(log).frames_of("PSA2_XY").frames[:1]
    conclusive(first and len(first[0].data) == 8, "no PSA2_XY came after the reset")
    seq = int.from_bytes(first[0].data[6:8], "little")
    expect(not seq, f"SEQ {seq} first", "0", frames=log.frames[:6])
    return "SEQ 0 first"


@check("stream", "PSA2-READ-06", needs={"line"})
def frames_come_every_data_period(e: Capture, row: Requirement) -> str:
    """Measure the falls of Int."""
    t = transfers(e.wires)
    period_ns = row.limit("period_us") * 1e3
    clk_ns = 1e9 / row_for(e, *FORMATS).limit("clk_hz")
    step_ns = np.diff(t.fall_ns)
    slack_ns = row.limit("tolerance_clk") * clk_ns + e.slack_ns(period_ns)
    bad = np.flatnonzero((np.abs(step_ns - period_ns) > slack_ns) & e.wires.known(t.fall_ns[:-1], t.fall_ns[1:]))
    if len(bad) and e.variant["gate_sclk"]:  # without gates a burst for the other port may delay a read
        k = int(bad[0])
        saw, due = f"{step_ns[k] * 1e-3:.2f} us to the next frame", f"{period_ns * 1e-3:.1f} us, to a period of CLK"
        raise Failed(saw, due, at_ns=int(t.fall_ns[k]), lines=LINES)
    mean_ns = float(step_ns.mean())
    allowed_ns = e.slack_ns(period_ns) + clk_ns / len(step_ns)
    saw, due = f"{mean_ns * 1e-3:.4f} us from frame to frame", f"{period_ns * 1e-3:.1f} us +- {allowed_ns:.0f} ns"
    sound = abs(mean_ns - period_ns) <= allowed_ns or len(e.wires.gaps_ns)
    expect(sound, saw, due, at_ns=int(t.fall_ns[0]), lines=LINES)
    return f"{len(step_ns)} periods of {mean_ns * 1e-3:.4f} us"
