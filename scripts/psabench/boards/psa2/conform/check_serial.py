"""Serial ports of PSA-2 and PSA-1 while it reads: SClk, data, selects, gaps, when what is read (article, section 5)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from psabench.boards.psa2.board import BOARD
from psabench.boards.psa2.conform.capture_spi import AXES, Burst, Message
from psabench.boards.psa2.conform.check_setup import ACCEL, TEMP, port_traffic
from psabench.conform.capture.intervals import first_of, none_at
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect
from psabench.link.signals import Floats, Ints

NS = 1e9
RDATA, MUX_WRITE = 0x01, 0x51
READING = ("DRD_A", "SClk", "CST", "DOutX", "Int")
STILL_IN_A_STREAM = ("Res", "SYNC_A", "DIn")  # lines that only a set-up or a request moves
LEAST = 5  # messages or instants that a judgement needs


def tclk_ns(e: Capture, n: float = 1.0) -> float:
    """n periods of the clock of the accelerometer converters."""
    return n * NS / float(e.variant["fclk_hz"])


def tau_ns(e: Capture, n: float = 1.0) -> float:
    """n periods of the clock of the temperature converter."""
    return n * NS / float(e.variant["temp_clkin_hz"])


def port_bursts(e: Capture, *, temp: bool) -> list[Burst]:
    """Of one port, those that the recording has whole. Raises Inconclusive where there are few."""
    found = [b for b in port_traffic(e).bursts if b.temp == temp and len(b.fall_ns) == b.bits]
    if len(found) < LEAST:
        port = "temperature" if temp else "accelerometer"
        raise Inconclusive(f"{len(found)} bursts on the {port} port; expected {LEAST}")
    return found


def temp_messages(e: Capture) -> list[Message]:
    """Raises Inconclusive where there are few."""
    found = port_traffic(e).of(temp=True)
    conclusive(len(found) >= LEAST, f"{len(found)} messages on the temperature port; expected {LEAST}")
    return found


def least(e: Capture, saw_ns: Floats, at_ns: Ints, due_ns: float, what: str, lines: Sequence[str]) -> str:
    """Raises Failed for the shortest of intervals that is too short, Inconclusive for none."""
    conclusive(len(saw_ns), f"nothing was recorded: {what}")
    k = int(np.argmin(saw_ns))
    if saw_ns[k] < due_ns - e.slack_ns(due_ns):
        raise Failed(f"{saw_ns[k]:.0f} ns {what}", f"not less than {due_ns:.1f} ns", at_ns=int(at_ns[k]), lines=lines)
    return f"at least {saw_ns[k]:.0f} ns {what}"


def near(
    e: Capture, saw_ns: Floats, at_ns: Ints, due_ns: float, slack_ns: float, what: str, lines: Sequence[str]
) -> str:
    """Raises Failed for the interval that is farthest off, if it is too far; Inconclusive for none."""
    conclusive(len(saw_ns), f"nothing was recorded: {what}")
    k = int(np.argmax(np.abs(saw_ns - due_ns)))
    allowed_ns = slack_ns + e.slack_ns(due_ns)
    saw, due = f"{saw_ns[k]:.1f} ns {what}", f"{due_ns:.1f} +- {allowed_ns:.1f} ns"
    expect(abs(saw_ns[k] - due_ns) <= allowed_ns, saw, due, at_ns=int(at_ns[k]), lines=lines)
    return f"{saw_ns.min():.1f} to {saw_ns.max():.1f} ns {what}"


# ---- lines


@check("stream", "PSA2-SIG-01", needs={"pins"})
def the_board_has_its_lines(e: Capture, row: Requirement) -> str:
    """Look for the lines of the article's table in the recording, and for those that a stream moves to move."""
    missing = [name for name in BOARD.lines if name not in e.wires]
    count = int(row.limit("lines_count"))
    expect(not missing and len(BOARD.lines) == count, f"no {', '.join(missing)}", f"{count} lines")
    still = [name for name in BOARD.lines if name not in STILL_IN_A_STREAM and len(e.wires[name].t_ns) < 2]
    expect(not still, f"{', '.join(still)} never moves", "it does", at_ns=e.wires.start_ns, lines=still)
    return f"{count} lines"


@check("stream", "PSA2-SIG-02", needs={"pins"})
def lines_stand_at_their_rest_levels(e: Capture, row: Requirement) -> str:
    """Look at every line where nothing moves on any of the ports."""
    levels = {n.removesuffix("_level"): int(v) for n, v in row.limits.items() if n.endswith("_level")}
    at_ns = quiet_instants(e, row.limit("quiet_us") * 1e3)
    names = {n.lower(): n for n in e.wires.recording.wires}
    for low, level in levels.items():
        bad = e.wires[names[low]].at(at_ns) != level
        none_at(at_ns[bad], f"{names[low]} at {1 - level}", f"{level} at rest", (names[low],))
    return f"{len(levels)} lines at {len(at_ns)} instants"


def quiet_instants(e: Capture, quiet_ns: float) -> Ints:
    """Instants with nothing on SClk, Int and CST for so long on either side."""
    edges = np.unique(
        np.concatenate([e.wires[n].t_ns for n in ("SClk", "Int", "CLK", "CST", "SYNC_T", "DRD_A") if n in e.wires])
    )
    gap = np.diff(edges)
    middle: Ints = (edges[:-1] + gap // 2)[gap > 2 * quiet_ns]
    conclusive(len(middle) >= LEAST, f"{len(middle)} quiet instants in the recording; expected {LEAST}")
    return middle


@check("power_on", "PSA2-SIG-04", needs={"pins"})
def sync_a_is_high_for_its_time(e: Capture, row: Requirement) -> str:
    """Measure the pulse on SYNC_A."""
    up, down = e.wires.pulses("SYNC_A", 1)
    expect(len(up), "no pulse on SYNC_A", "one after Res", at_ns=e.wires.start_ns, lines=("SYNC_A", "Res"))
    saw = (down - up).astype(np.float64)
    return near(e, saw, up, row.limit("pulse_ns"), row.limit("tolerance_ns"), "of SYNC_A high", ("SYNC_A",))


@check("sync", "PSA2-SIG-04", needs={"pins"})
def sync_a_moves_on_falling_edges_of_fclk(e: Capture, row: Requirement) -> str:
    """Pulse SYNC_A while frames flow: where do its edges lie in the clock that the falls of DRD_A before it give?"""
    edges = e.wires["SYNC_A"].t_ns[1:]
    expect(len(edges), "no pulse on SYNC_A", "one for the SYNC with 2024h = 1", at_ns=e.wires.end_ns, lines=("SYNC_A",))
    falls = e.wires.falls("DRD_A")
    falls = falls[falls < edges[0]]
    conclusive(len(falls) > LEAST, f"{len(falls)} falls of DRD_A before the pulse")
    clocks = row_for(e, "PSA2-READ-06").limit("period_tclk")
    period_ns = float(falls[-1] - falls[-1 - LEAST]) / LEAST / clocks
    phase = (edges - falls[-1]) / period_ns % 1.0
    off = np.abs(phase - row.limit("phase_tclk"))
    slack = row.limit("tolerance_tclk") + e.slack_ns(0.0) / period_ns
    if (off > slack).any():
        k = int(np.argmax(off))
        due = f"{row.limit('phase_tclk')} +- {slack:.3f} tCLK"
        saw = f"an edge of SYNC_A {phase[k]:.3f} tCLK after the rise of fCLK that DRD_A falls with"
        raise Failed(saw, due, at_ns=int(edges[k]), lines=("SYNC_A", "DRD_A"))
    return f"{len(edges)} edges, {phase.min():.3f} to {phase.max():.3f} tCLK after the rise of fCLK"


@check("stream", "PSA2-SIG-05", needs={"pins"})
def sync_t_is_low_for_its_time(e: Capture, row: Requirement) -> str:
    """Measure the pulses on SYNC_T."""
    down, up = e.wires.pulses("SYNC_T", 0)
    saw = (up - down).astype(np.float64)
    return near(e, saw, down, row.limit("pulse_ns"), row.limit("tolerance_ns"), "of SYNC_T low", ("SYNC_T",))


@check("stream", "PSA2-SIG-06", needs={"pins"})
def cst_frames_every_burst_of_its_port(e: Capture, row: Requirement) -> str:
    """Measure CST around the messages to the temperature converter, and look for lows of CST without one."""
    period_ns = NS / row_for(e, "PSA2-SIG-09").limit("sclk_hz")
    falls, rises = e.wires.pulses("CST", 0)
    found = temp_messages(e)
    begin, end = np.array([m.begin_ns for m in found]), np.array([m.end_ns for m in found])
    slack_ns = row.limit("tolerance_ns")
    before, after = [], []
    for fall, rise in zip(falls, rises, strict=True):
        k, last = int(np.searchsorted(begin, fall)), int(np.searchsorted(begin, rise)) - 1
        if k > last or end[last] > rise:
            raise Failed("a low of CST without a burst", "one burst in each", at_ns=int(fall), lines=TEMP)
        before.append(float(begin[k] - fall))
        after.append(float(rise - end[last]))
    lo, hi = row.limit("before_min_sclk") * period_ns, row.limit("before_max_sclk") * period_ns
    said = near(e, np.array(before), falls, (lo + hi) / 2, (hi - lo) / 2 + slack_ns, "of CST before SClk", TEMP)
    due_ns = tau_ns(e, row.limit("after_tau"))
    return said + ", " + near(e, np.array(after), rises, due_ns, slack_ns, "after it", TEMP)


def _changes_at(e: Capture, found: Sequence[Burst], lines: Sequence[str], *, falls: bool, delay_ns: float) -> str:
    """Within bursts these lines change at falls (or rises) of SClk only, so much later at most. Raises Failed."""
    edges = np.sort(np.concatenate([b.fall_ns if falls else b.rise_ns for b in found]))
    begin, end = np.array([b.rise_ns[0] for b in found]), np.array([b.fall_ns[-1] for b in found])
    total = 0
    for line in lines:
        t = e.wires[line].t_ns[1:]
        k = np.searchsorted(begin, t, "left") - 1
        t = t[(k >= 0) & (t < end[np.maximum(k, 0)])]
        since = t - edges[np.maximum(np.searchsorted(edges, t, "right") - 1, 0)]
        bad = (since < 0) | (since > delay_ns + e.slack_ns(0.0))
        if bad.any():
            edge = "fall" if falls else "rise"
            saw = f"{line} changes {since[bad][0]} ns after a {edge} of SClk"
            raise Failed(saw, f"at a {edge}", at_ns=int(t[bad][0]), lines=("SClk", line, "CST"))
        total += len(t)
    conclusive(total, f"{', '.join(lines)} never change within a burst")
    return f"{total} changes, all at {'falls' if falls else 'rises'} of SClk"


@check("registers", "PSA2-SIG-07", needs={"pins"}, on_recording="all")
def the_accelerometer_port_is_spi_mode_0(e: Capture, row: Requirement) -> str:
    """Compare changes of DIn and DOut with the edges of SClk while CST is high."""
    delay_ns = row.limit("delay_max_ns")
    return _changes_at(e, port_bursts(e, temp=False), ("DIn", *AXES), falls=True, delay_ns=delay_ns)


@check("registers", "PSA2-SIG-08", needs={"pins"}, on_recording="all")
def the_temperature_port_is_spi_mode_1(e: Capture, row: Requirement) -> str:
    """Compare changes of DInT and DOutT with the edges of SClk while CST is low."""
    delay_ns = row.limit("delay_max_ns")
    return _changes_at(e, port_bursts(e, temp=True), ("DInT", "DOutT"), falls=False, delay_ns=delay_ns)


@check("stream", "PSA2-SIG-09", needs={"pins"})
def sclk_has_its_frequency_and_rests_low(e: Capture, row: Requirement) -> str:
    """Measure the period of SClk within bursts, and look at it between them."""
    due_ns = NS / row.limit("sclk_hz")
    found = [b for b in port_traffic(e).bursts if b.bits > 1 and len(b.fall_ns) == b.bits]
    conclusive(found, "no burst of SClk was recorded")
    at = np.array([b.rise_ns[0] for b in found])
    count = np.array([b.bits - 1 for b in found])
    period_ns = np.array([b.rise_ns[-1] - b.rise_ns[0] for b in found]) / count
    slack_ns = due_ns * row.limit("tolerance_pct") / 100 + np.array([e.slack_ns(due_ns * n) for n in count]) / count
    off = np.abs(period_ns - due_ns) > slack_ns
    if (k := first_of(off)) is not None:
        due = f"{due_ns:.2f} +- {slack_ns[k]:.2f} ns"
        raise Failed(f"{period_ns[k]:.2f} ns a period of SClk", due, at_ns=int(at[k]), lines=("SClk",))
    tail = np.array([b.fall_ns[-1] - b.rise_ns[-1] for b in found], np.float64)
    none_at(at[tail > due_ns], "SClk high between bursts", "low", ("SClk",))
    return f"{period_ns.min():.2f} to {period_ns.max():.2f} ns a period of SClk, low between {len(found)} bursts"


@check("registers", "PSA2-SIG-10", needs={"pins"}, on_recording="all")
def command_bytes_keep_their_gap(e: Capture, row: Requirement) -> str:
    """Measure the time between the bytes of commands to the accelerometer converters."""
    found = [m for m in port_traffic(e).of(temp=False) if len(m.bursts) > 1]
    pairs = [(a, b) for m in found for a, b in zip(m.bursts, m.bursts[1:], strict=False)]
    gaps = np.array([float(b.rise_ns[0] - a.rise_ns[-1]) for a, b in pairs], np.float64)
    at = np.array([b.rise_ns[0] for _, b in pairs], np.int64)
    due_ns = tclk_ns(e, row.limit("gap_min_tclk"))
    return least(e, gaps, at, due_ns, "between bytes of a command", ACCEL)


def rdata_gaps(e: Capture) -> tuple[Floats, Ints]:
    found = [m for m in temp_messages(e) if m.sent[:1] == bytes([RDATA]) and len(m.bursts) > 1]
    gaps = [float(m.bursts[1].rise_ns[0] - m.bursts[0].fall_ns[-1]) for m in found if len(m.bursts[0].fall_ns)]
    return np.array(gaps), np.array([m.begin_ns for m in found], np.int64)


@check("stream", "PSA2-SIG-11", needs={"pins"})
def data_wait_after_rdata(e: Capture, row: Requirement) -> str:
    """Measure RDATA to the first bit of its data."""
    due_ns = tau_ns(e, row.limit("t6_min_tau"))
    return least(e, *rdata_gaps(e), due_ns, "from RDATA to its data", TEMP)


@check("stream", "PSA2-SIG-12", needs={"pins"})
def dout_stands_still_while_the_other_port_is_used(e: Capture) -> str:
    """Look for changes of DOutX, DOutY and DOutZ while CST is low."""
    falls, rises = e.wires.pulses("CST", 0)
    conclusive(len(falls) >= LEAST, f"CST was low {len(falls)} times")
    for line in AXES:
        t = e.wires[line].t_ns[1:]
        k = np.searchsorted(falls, t, "right") - 1
        inside = (k >= 0) & (t < rises[np.maximum(k, 0)])
        none_at(t[inside], f"{line} changes while CST is low", "it stands still", (line, "CST", "SClk"))
    return f"still in {len(falls)} lows of CST"


@check("stream", "PSA2-SIG-17", needs={"pins"})
def clk_is_a_division_of_the_crystal(e: Capture, row: Requirement) -> str:
    """Divide the period of CLK by that of the crystal, which the data period gives."""
    falls, rises = e.wires.falls("DRD_A"), e.wires.rises("CLK")
    if len(falls) < LEAST or len(rises) < 2:
        raise Inconclusive(f"{len(falls)} falls of DRD_A and {len(rises)} rises of CLK were recorded")
    data_ns = row_for(e, "PSA2-READ-06").limit("period_us") * 1e3
    crystal_ns = float(np.median(np.diff(falls))) / (row.limit("fclk_hz") * data_ns / NS)
    word = rises[: int(e.variant["word_bits"])]
    ratio = float(word[-1] - word[0]) / (len(word) - 1) / crystal_ns
    saw, off = f"a period of CLK is {ratio:.4f} periods of fCLK", abs(ratio - round(ratio))
    return expect(off <= row.limit("tolerance_ratio"), saw, "a whole number", at_ns=int(word[0]), lines=("CLK",))


# ---- reading


def _read_of_each_fall(e: Capture) -> list[tuple[int, list[Burst]]]:
    """Falls of DRD_A that a further one follows, with the reads between them. Raises Inconclusive for few."""
    falls = e.wires.falls("DRD_A")
    reads = port_traffic(e).reads
    begin = np.array([b.rise_ns[0] for b in reads], np.int64)
    cut = np.searchsorted(begin, falls)
    conclusive(len(falls) > LEAST, f"{len(falls)} falls of DRD_A were recorded")
    return [(int(falls[k]), reads[cut[k] : cut[k + 1]]) for k in range(len(falls) - 1)]


@check("stream", "PSA2-READ-01", needs={"pins"})
def every_conversion_is_read(e: Capture) -> str:
    """Count the reads after each fall of DRD_A."""
    found = _read_of_each_fall(e)
    for fall, reads in found:
        expect(len(reads) == 1, f"{len(reads)} reads after a fall of DRD_A", "one", at_ns=fall, lines=READING)
    return f"{len(found)} falls of DRD_A, one read after each"


@check("stream", "PSA2-READ-02", "PSA2-READ-03", needs={"pins"})
def a_read_has_its_bits(e: Capture, row: Requirement) -> str:
    """Count the pulses of SClk of each read."""
    due = int(row.limit("read_bits"))
    reads = port_traffic(e).reads
    conclusive(len(reads) >= LEAST, f"{len(reads)} reads were recorded")
    for b in reads[:-1]:
        expect(b.bits == due, f"{b.bits} pulses of SClk in a read", f"{due}", at_ns=int(b.rise_ns[0]), lines=READING)
    return f"{len(reads)} reads of {due} bits"


@check("stream", "PSA2-READ-07", needs={"pins"})
def drd_a_rises_with_the_first_bit_of_a_read(e: Capture, row: Requirement) -> str:
    """Compare the rises of DRD_A with the first falls of SClk."""
    delay_ns = row.limit("delay_max_ns")
    falls, rises = e.wires.falls("DRD_A"), e.wires.rises("DRD_A")
    clocks = e.wires.falls("SClk")
    k = np.searchsorted(clocks, falls, "right")
    falls, k = falls[k < len(clocks)], k[k < len(clocks)]
    up = np.searchsorted(rises, falls, "right")
    if not len(falls) or (up >= len(rises)).sum() > 1:
        raise Failed("DRD_A does not rise", "a rise in each read", at_ns=e.wires.end_ns, lines=READING)
    have = up < len(rises)
    late = (rises[up[have]] - clocks[k[have]]).astype(np.float64)
    slack_ns = delay_ns + e.slack_ns(0.0)
    bad = (late < -e.slack_ns(0.0)) | (late > slack_ns)
    if bad.any():
        at = int(rises[up[have]][bad][0])
        due = f"at the first fall of SClk after its fall, to {slack_ns:.0f} ns"
        raise Failed(f"DRD_A rises {late[bad][0]:.0f} ns after it", due, at_ns=at, lines=READING)
    return f"{len(late)} rises of DRD_A, {late.min():.0f} to {late.max():.0f} ns after the first fall of SClk"


@check("stream", "PSA2-INT-07", "PSA2-INT-08", needs={"pins"})
def int_falls_after_the_read(e: Capture, row: Requirement) -> str:
    """Measure DRD_A to Int."""
    lo, hi = row.limit("after_drd_min_us") * 1e3, row.limit("after_drd_max_us") * 1e3
    falls, ints = e.wires.falls("DRD_A"), e.wires.falls("Int")
    k = np.searchsorted(falls, ints, "right") - 1
    ints, k = ints[k >= 0], k[k >= 0]
    conclusive(len(ints) >= LEAST, f"{len(ints)} frames were recorded")
    after = (ints - falls[k]).astype(np.float64)
    bad = (after < lo - e.slack_ns(lo)) | (after > hi + e.slack_ns(hi))
    if bad.any():
        saw = f"{after[bad][0]:.0f} ns after DRD_A"
        raise Failed(saw, f"{lo:.0f} to {hi:.0f} ns", at_ns=int(ints[bad][0]), lines=READING)
    return f"Int falls {after.min() * 1e-3:.2f} to {after.max() * 1e-3:.2f} us after DRD_A"


@check("stream", "PSA2-INT-11", needs={"pins"})
def every_conversion_gives_a_frame(e: Capture) -> str:
    """Count the falls of Int between falls of DRD_A."""
    falls, ints = e.wires.falls("DRD_A"), e.wires.falls("Int")
    conclusive(len(falls) > LEAST, f"{len(falls)} falls of DRD_A were recorded")
    count = np.diff(np.searchsorted(ints, falls))
    if (count != 1).any():
        k = int(np.flatnonzero(count != 1)[0])
        raise Failed(f"{count[k]} frames after a fall of DRD_A", "one", at_ns=int(falls[k]), lines=READING)
    return f"{len(count)} conversions, one frame each"
