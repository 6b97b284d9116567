"""Temperatures of PSA-2 and PSA-1: channels in turn, the steps of their scan, times, place beside the reads."""

from __future__ import annotations

import itertools

import numpy as np

from psabench.boards.psa2.conform.capture_can import aligned, pairs, signed
from psabench.boards.psa2.conform.check_serial import LEAST, MUX_WRITE, RDATA, least, near, temp_messages
from psabench.boards.psa2.conform.check_setup import TEMP, port_traffic
from psabench.boards.psa2.conform.check_stream import unit_us
from psabench.boards.psa2.conform.check_words import Beside, beside, channel_on_the_line
from psabench.boards.psa2.conform.stimulus_can import Answer
from psabench.conform.capture.intervals import first_of
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect
from psabench.link.signals import Ints

TEMP_LEAST = 120  # samples: fewer have not the temperatures that a judgement needs, one every 10 ms at 1000 SPS


@check("quiet", "PSA2-TEMP-01")
def channels_take_turns(e: Capture, row: Requirement) -> str:
    """Follow CHANNEL through the samples with T_NEW."""
    p = pairs(e, TEMP_LEAST)
    seen = p.channel[p.new]
    count = int(row.limit("channels_count"))
    if len(seen) < 2 * count:
        raise Failed(f"{len(seen)} new temperatures in {len(p)} samples", "one every 10 ms", frames=p.about(0))
    step = np.diff(seen) % count
    if (step != 1).any() or set(seen.tolist()) != set(range(count)):
        k = int(np.flatnonzero(step != 1)[0]) if (step != 1).any() else 0
        raise Failed(
            f"channel {seen[k]}, then {seen[k + 1]}",
            f"0 to {count - 1} in turn",
            frames=p.about(int(np.flatnonzero(p.new)[k])),
        )
    return f"{len(seen)} temperatures of {count} channels in turn"


@check("stream", "PSA2-TEMP-02", needs={"pins"})
def temperature_codes_are_the_upper_bits_that_were_read(e: Capture, row: Requirement) -> str:
    """Compare the temperature codes with the words on DOutT."""
    bits, code_bits = int(row.limit("read_bits")), int(row.limit("code_bits"))
    bursts = [b for m in port_traffic(e).of(temp=True) if m.sent[:1] == b"\x01" for b in m.bursts[1:]]
    conclusive(len(bursts) >= LEAST, f"{len(bursts)} temperatures were read")
    for b in bursts[:-1]:
        expect(b.bits == bits, f"{b.bits} clocks", f"{bits}", at_ns=int(b.rise_ns[0]), lines=("SClk", "CST", "DOutT"))
    read = signed(np.array([[int(b.got[0][:code_bits] or "0", 2)] for b in bursts], np.int64), code_bits)
    p = pairs(e)
    told = p.temp[p.new][:, None]
    _shift, same = aligned(read, told)
    if same < len(told) - int(row.limit("edge_max_frames")):
        raise Failed(
            f"{len(told) - same} of {len(told)} new codes on CAN were not read",
            "the upper bits of each word",
            frames=p.about(int(np.flatnonzero(p.new)[0]) if p.new.any() else 0),
        )
    return f"{same} codes are the upper {code_bits} of {bits} bits"


@check("quiet", "PSA2-TEMP-05")
def temperatures_come_at_their_rate(e: Capture, row: Requirement) -> str:
    """Measure TSTAMP between samples with T_NEW."""
    p = pairs(e, TEMP_LEAST)
    at_us = p.stamp[p.new] * unit_us(e)
    if len(at_us) < LEAST:
        raise Failed(f"{len(at_us)} new temperatures in {len(p)} samples", "one every 10 ms", frames=p.about(0))
    period = np.diff(at_us)
    mean_ms = float(period.mean()) * 1e-3
    lo, hi = row.limit("period_min_ms"), row.limit("period_max_ms")
    sample_ms = row_for(e, "PSA2-READ-06").limit("period_us") * 1e-3
    off = (period * 1e-3 < lo - sample_ms) | (period * 1e-3 > hi + sample_ms)
    if not lo <= mean_ms <= hi or off.any():
        k = int(np.flatnonzero(off)[0]) if off.any() else 0
        raise Failed(
            f"{mean_ms:.3f} ms a temperature, one after {period[k] * 1e-3:.3f} ms",
            f"{lo} to {hi} ms",
            frames=p.about(int(np.flatnonzero(p.new)[k])),
        )
    return f"{len(at_us)} temperatures, {mean_ms:.3f} ms apart"


@check("selfcal", "PSA2-TEMP-08")
def the_scan_waits_for_a_calibration(e: Capture, row: Requirement) -> str:
    """SELFCAL while temperatures are scanned: a pause, then they come again."""
    expect(e.facts.get("opcode") == Answer(), f"SELFCAL answered by {e.facts.get('opcode')}", "it is taken")
    p = pairs(e)
    at_ms = p.stamp[p.new] * unit_us(e) * 1e-3
    expect(len(at_ms) >= LEAST, f"{len(at_ms)} new temperatures", "they come again", frames=p.about(len(p) - 3))
    pause = np.diff(at_ms)
    k = int(np.argmax(pause))
    if not row.limit("pause_min_ms") <= pause[k] <= row.limit("pause_max_ms"):
        due = f"{row.limit('pause_min_ms')} to {row.limit('pause_max_ms')} ms"
        raise Failed(f"the longest pause is {pause[k]:.2f} ms", due, frames=p.about(int(np.flatnonzero(p.new)[k])))
    tail_ms = (p.stamp[-1] * unit_us(e) * 1e-3) - at_ms[-1]
    if k == len(pause) - 1 or tail_ms > row.limit("pause_min_ms"):
        raise Failed("no temperature after the pause", "they come again", frames=p.about(len(p) - 3))
    return f"a pause of {pause[k]:.2f} ms, then {len(pause) - k - 1} more temperatures"


# ---- the scan on its port


@check("stream", "PSA2-CHIP-08", needs={"pins"})
def drd_t_rises_when_a_temperature_is_read(e: Capture) -> str:
    """Look at DRD_T before and after each RDATA."""
    reads = [m for m in temp_messages(e) if m.sent[:1] == bytes([RDATA])][:-1]
    conclusive(reads, "no RDATA was recorded")
    begin, end = (np.array([getattr(m, side) for m in reads], np.int64) for side in ("begin_ns", "end_ns"))
    for at_ns, level in ((begin, 0), (end, 1)):
        bad = e.wires["DRD_T"].at(at_ns) != level
        if bad.any():
            saw = f"DRD_T {1 - level} {'after' if level else 'before'} RDATA ({int(bad.sum())} of {len(bad)})"
            raise Failed(saw, f"{level}", at_ns=int(at_ns[bad][0]), lines=TEMP)
    return f"DRD_T low before and high after each of {len(reads)} RDATA"


@check("stream", "PSA2-TEMP-06", needs={"pins"})
def the_scan_goes_by_its_steps(e: Capture) -> str:
    """Decode the messages to the temperature converter, with the edges of SYNC_T and DRD_T between them."""
    found = temp_messages(e)
    rises, ready = e.wires.rises("SYNC_T"), e.wires.falls("DRD_T")
    read_bits = int(row_for(e, "PSA2-TEMP-02").limit("read_bits"))
    for a, b in itertools.pairwise(found):
        if a.sent[:2] == bytes([MUX_WRITE, 0]):
            pulse = rises[(rises > a.end_ns) & (rises < b.begin_ns)]
            told = ready[(ready > (pulse[-1] if len(pulse) else a.end_ns)) & (ready < b.begin_ns)]
            good = len(pulse) == 1 and len(told) == 1 and b.sent[:1] == bytes([RDATA])
        else:
            good = (
                a.sent[:1] == bytes([RDATA]) and len(a.sent) == 1 + read_bits // 8 and b.sent[:1] == bytes([MUX_WRITE])
            )
        if not good:
            due = "51 00 mm, SYNC_T, DRD_T, 01 and 24 clocks, in turn"
            raise Failed(f"{a.name}, then {b.name}", due, at_ns=a.begin_ns, lines=TEMP)
    return f"{len(found)} messages: MUX, SYNC_T, DRD_T, RDATA in turn"


def _converted(e: Capture, b: Beside) -> tuple[Ints, Ints]:
    """Frames (m,) of b with a new temperature, and the channel (m,) whose input the one read before them had.

    The channel of an input that is none of the table is -1. Raises Inconclusive.
    """
    row = row_for(e, "PSA2-TEMP-09")
    channels = range(int(row_for(e, "PSA2-TEMP-01").limit("channels_count")))
    of_input = {int(row.limit(f"mux_{k}_code")): k for k in channels}
    read_ns, channel, now = [], [], -1
    for m in temp_messages(e):
        if m.sent[:2] == bytes([MUX_WRITE, 0]) and len(m.sent) == 3:
            now = of_input.get(m.sent[2], -1)
        elif m.sent[:1] == bytes([RDATA]):
            read_ns.append(m.end_ns)
            channel.append(now)
    new = np.flatnonzero(b.samples.new)
    before = np.searchsorted(np.array(read_ns, np.int64), b.fall_ns[new]) - 1
    new, before = new[before > 0], before[before > 0]  # of the first read no one saw which input it is of
    if len(new) < 2 * len(channels):
        raise Inconclusive(f"{len(new)} temperatures were seen from the choice of their input to their frame")
    return new, np.array(channel, np.int64)[before]


def _is_of_its_channel(b: Beside, new: Ints, told: Ints, converted: Ints) -> str:
    bad = told != converted
    if (k := first_of(bad)) is not None:
        saw = f"channel {told[k]} told ({int(bad.sum())} of {len(bad)})"
        due, at_ns = f"{converted[k]}, whose input was converted", int(b.fall_ns[new[k]])
        raise Failed(saw, due, at_ns=at_ns, lines=TEMP, frames=b.samples.about(int(new[k])))
    return f"{len(new)} temperatures, each told as the channel whose input was converted"


@check("stream", "PSA2-TEMP-09", needs={"pins"})
def a_temperature_on_can_is_of_its_channel(e: Capture) -> str:
    """Compare CHANNEL of each new temperature with the input that was written to MUX before it was read."""
    b = beside(e)
    new, converted = _converted(e, b)
    return _is_of_its_channel(b, new, b.samples.channel[new], converted)


@check("stream", "PSA2-WORD-06", needs={"pins"})
def a_temperature_on_the_line_is_of_its_channel(e: Capture) -> str:
    """Compare the channel in word T of each new temperature with the input that was written to MUX before it."""
    b = beside(e)
    new, converted = _converted(e, b)
    return _is_of_its_channel(b, new, channel_on_the_line(e, b)[new], converted)


def _ends_in_time(e: Capture) -> str:
    due_ns = row_for(e, "PSA2-TEMP-07").limit("margin_min_us") * 1e3
    falls = e.wires.falls("DRD_A")
    ends = np.array([m.end_ns for m in temp_messages(e)], np.int64)
    ends = ends[ends < falls[-1]] if len(falls) else ends[:0]
    margin_ns = (falls[np.searchsorted(falls, ends)] - ends).astype(np.float64)
    return least(e, margin_ns, ends, due_ns, "from a burst to the next fall of DRD_A", TEMP)


@check("stream", "PSA2-TEMP-07", needs={"pins"})
def bursts_keep_clear_of_the_next_conversion(e: Capture) -> str:
    """Measure the end of each burst to the temperature converter to the next fall of DRD_A."""
    return _ends_in_time(e)


@check("busy", "PSA2-TEMP-07", needs={"pins"})
def bursts_keep_clear_at_the_highest_rate(e: Capture) -> str:
    """The same with four thousand conversions a second, while registers of both groups are read."""
    return _ends_in_time(e)


@check("stream", "PSA2-CHIP-10", needs={"pins"})
def a_temperature_settles_in_its_time(e: Capture, row: Requirement) -> str:
    """Measure the rise of SYNC_T to the next fall of DRD_T."""
    rises, falls = e.wires.rises("SYNC_T"), e.wires.falls("DRD_T")
    rises = rises[rises < falls[-1]] if len(falls) else rises[:0]
    conclusive(len(rises), "no fall of DRD_T after a pulse on SYNC_T was recorded")
    saw = (falls[np.searchsorted(falls, rises)] - rises).astype(np.float64)
    lo, hi = row.limit("t18_min_ms") * 1e6, row.limit("t18_max_ms") * 1e6
    return near(e, saw, rises, (lo + hi) / 2, (hi - lo) / 2, "from SYNC_T to DRD_T", TEMP)
