"""Int, Data and CLK of PSA-2 and PSA-1: words, bits, edges, pauses, levels at rest (article, section 5)."""

from __future__ import annotations

import numpy as np

from psabench.boards.psa2.conform.capture_line import WORDS, Transfers, transfers
from psabench.boards.psa2.conform.check_stream import FORMATS, LINES, whole_transfers, word_bits
from psabench.conform.capture.intervals import first_of, none_at
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, expect
from psabench.link.signals import Floats, Ints

LOWS = ("PSA2-INT-04", "PSA2-INT-05", "PSA2-INT-06")


def _clk_ns(e: Capture) -> float:
    return 1e9 / row_for(e, *FORMATS).limit("clk_hz")


def _first(bad: np.ndarray, at_ns: Ints, saw: Floats, due: str, unit: str = "ns") -> None:
    """Raises Failed for the first of `bad`."""
    if (k := first_of(bad)) is not None:
        raise Failed(f"{saw[k]:.3f} {unit} ({int(bad.sum())} of {len(bad)})", due, at_ns=int(at_ns[k]), lines=LINES)


@check("stream", "PSA2-FRAME-01", needs={"line"})
def a_transfer_has_four_words(e: Capture, row: Requirement) -> str:
    """Count the groups of pulses of CLK in each transfer that pauses set apart."""
    t = transfers(e.wires)
    due, apart_ns = int(row.limit("words_count")), row.limit("apart_min_clk") * _clk_ns(e)
    for fall, rises in zip(t.fall_ns, t.rises, strict=True):
        count = int((np.diff(rises) > apart_ns).sum()) + (len(rises) > 0)
        expect(count == due, f"{count} words in a transfer", f"{due}", at_ns=int(fall), lines=LINES)
    return f"{len(t)} transfers of {due} words"


@check("stream", "PSA2-FRAME-06", "PSA2-FRAME-07", "PSA2-FRAME-08", needs={"line"})
def words_have_their_bits_at_their_clock(e: Capture) -> str:
    """Count the pulses of CLK in each transfer and measure their period."""
    t, clk_ns = whole_transfers(e), _clk_ns(e)
    rises, bits = t.grid_ns(word_bits(e)), word_bits(e)
    word_ns = (rises[:, bits - 1] - rises[:, 0]) / (bits - 1)
    slack_ns = e.slack_ns(clk_ns * (bits - 1)) / (bits - 1)
    bad = np.abs(word_ns - clk_ns) > slack_ns
    _first(bad, t.fall_ns, word_ns, f"{clk_ns:.3f} +- {slack_ns:.3f} ns a period of CLK")
    return f"{len(t)} transfers of {WORDS} words of {bits} bits, CLK {1e3 / word_ns.mean():.6f} MHz"


@check("stream", "PSA2-FRAME-02", needs={"line"})
def words_are_apart(e: Capture, row: Requirement) -> str:
    """Measure the pauses between the words of a transfer."""
    t, clk_ns, bits = whole_transfers(e), _clk_ns(e), word_bits(e)
    due_ns = row.limit("rise_to_rise_clk") * clk_ns
    rises = t.grid_ns(bits)
    pause_ns = (rises[:, bits::bits] - rises[:, bits - 1 : -1 : bits]).reshape(-1)
    slack_ns = row.limit("tolerance_clk") * clk_ns + e.slack_ns(due_ns)
    at_ns = np.repeat(t.fall_ns, WORDS - 1)
    _first(np.abs(pause_ns - due_ns) > slack_ns, at_ns, pause_ns, f"{due_ns:.1f} +- {slack_ns:.1f} ns between words")
    return f"{len(pause_ns)} pauses of {pause_ns.min() / clk_ns - 1:.3f} to {pause_ns.max() / clk_ns - 1:.3f} CLK"


@check("stream", "PSA2-FRAME-09", "PSA2-INT-01", needs={"line"})
def clk_runs_only_with_data(e: Capture) -> str:
    """Look for pulses of CLK outside transfers, and for more or fewer than one a bit within them."""
    t = whole_transfers(e)
    first, last = t.fall_ns[0], t.rise_ns[-1]
    rises = t.clk_rise_ns[(t.clk_rise_ns >= first) & (t.clk_rise_ns <= last)]
    inside = np.searchsorted(t.fall_ns, rises, "right") - np.searchsorted(t.rise_ns, rises, "left") == 1
    stray = rises[~inside & e.wires.known(np.full(len(rises), first), rises)]
    none_at(stray, f"{len(stray)} pulses of CLK with Int high", "none", LINES)
    return f"{len(rises)} pulses, all within {len(t)} transfers"


@check("stream", "PSA2-FRAME-10", needs={"line"})
def data_stand_still_around_each_rise_of_clk(e: Capture, row: Requirement) -> str:
    """Look for changes of Data near a rise of CLK."""
    t, clk_ns = whole_transfers(e), _clk_ns(e)
    changes = e.wires["Data"].t_ns[1:]
    keep_ns = (row.limit("hold_clk") - row.limit("tolerance_clk")) * clk_ns - e.slack_ns(clk_ns)
    rises = t.clk_rise_ns
    expect(len(changes), "a Data line that never changes", "data", at_ns=int(t.fall_ns[0]), lines=LINES)
    after = np.searchsorted(rises, changes)
    to_next = np.where(after < len(rises), rises[np.minimum(after, len(rises) - 1)] - changes, np.inf)
    since = np.where(after > 0, changes - rises[np.maximum(after - 1, 0)], np.inf)
    near_ns = np.minimum(to_next, since)
    _first(near_ns < keep_ns, changes, near_ns, f"no change of Data within {keep_ns:.1f} ns of a rise of CLK")
    return f"{len(changes)} changes of Data, none nearer than {near_ns.min():.1f} ns to a rise of CLK"


def _rests_low(e: Capture, line: str, row: Requirement) -> str:
    t, clk_ns, bits = whole_transfers(e), _clk_ns(e), word_bits(e)
    rises = t.grid_ns(bits)
    pauses = (rises[:, bits - 1 : -1 : bits] + row.limit("look_in_pause_clk") * clk_ns).reshape(-1)
    after = t.rise_ns + row.limit("look_after_clk") * clk_ns
    at_ns = np.concatenate((pauses, after)).astype(np.int64)
    high = e.wires[line].at(at_ns).astype(bool)
    if high.any():
        raise Failed(f"{line} high between words", "low", at_ns=int(at_ns[np.flatnonzero(high)[0]]), lines=LINES)
    return f"low in {len(pauses)} pauses and after {len(after)} transfers"


@check("stream", "PSA2-FRAME-11", needs={"line"})
def data_rest_low(e: Capture, row: Requirement) -> str:
    """Look at Data in the pauses and between transfers."""
    return _rests_low(e, "Data", row)


@check("stream", "PSA2-FRAME-12", needs={"line"})
def clk_rests_low(e: Capture, row: Requirement) -> str:
    """Look at CLK in the pauses and between transfers."""
    return _rests_low(e, "CLK", row)


@check("stream", "PSA2-FRAME-13", needs={"pins"})
def clk_is_high_for_half_of_its_period(e: Capture, row: Requirement) -> str:
    """Measure the pulses of CLK."""
    clk_ns = _clk_ns(e)
    up, down = e.wires.pulses("CLK", 1)
    conclusive(len(up), "no pulse on CLK was recorded")
    high_ns = (down - up).astype(np.float64)
    due_ns, slack_ns = row.limit("high_clk") * clk_ns, row.limit("tolerance_clk") * clk_ns + e.slack_ns(clk_ns)
    _first(np.abs(high_ns - due_ns) > slack_ns, up, high_ns, f"{due_ns:.1f} +- {slack_ns:.1f} ns high")
    return f"{len(high_ns)} pulses of {high_ns.min():.0f} to {high_ns.max():.0f} ns"


@check("stream", "PSA2-INT-02", needs={"line"})
def int_is_low_long_enough(e: Capture, row: Requirement) -> str:
    """Measure the lows of Int."""
    t = whole_transfers(e)
    low_ns = (t.rise_ns - t.fall_ns).astype(np.float64)
    least_ns = row.limit("int_low_min_us") * 1e3
    _first(low_ns < least_ns - e.slack_ns(least_ns), t.fall_ns, low_ns, f"not less than {least_ns:.0f} ns of Int low")
    return f"{len(t)} lows of {low_ns.min() * 1e-3:.3f} to {low_ns.max() * 1e-3:.3f} us"


@check("stream", "PSA2-INT-04", "PSA2-INT-05", "PSA2-INT-06", needs={"line"})
def int_is_low_for_its_periods_of_clk(e: Capture) -> str:
    """Measure the lows of Int, and the lead-in before the first bit."""
    t, row, clk_ns = whole_transfers(e), row_for(e, *LOWS), _clk_ns(e)
    low_ns = (t.rise_ns - t.fall_ns).astype(np.float64)
    lead_ns = t.grid_ns(word_bits(e))[:, 0] - t.fall_ns
    for saw_ns, due_ns, what in (
        (low_ns, row.limit("int_low_us") * 1e3, "of Int low"),
        (lead_ns, (row.limit("lead_in_clk") + 0.5) * clk_ns, "from the fall of Int to the first rise of CLK"),
    ):
        slack_ns = e.slack_ns(due_ns)
        _first(np.abs(saw_ns - due_ns) > slack_ns, t.fall_ns, saw_ns, f"{due_ns:.1f} +- {slack_ns:.1f} ns {what}")
    return f"{len(t)} lows of {low_ns.mean() * 1e-3:.4f} us, lead-in {lead_ns.mean() / clk_ns - 0.5:.3f} CLK"


def _clk_falls(t: Transfers) -> tuple[Floats, Floats]:
    """First and last fall (n,) of CLK in each transfer. Raises Failed where there is none."""
    for rise, falls in zip(t.rise_ns, t.falls, strict=True):
        expect(len(falls), "no fall of CLK in a transfer", "one a bit", at_ns=int(rise), lines=LINES)
    return np.array([f[0] for f in t.falls], np.float64), np.array([f[-1] for f in t.falls], np.float64)


@check("stream", "PSA2-INT-03", needs={"line"})
def int_rises_with_the_last_fall_of_clk(e: Capture, row: Requirement) -> str:
    """Compare the rise of Int with the last falling edge of CLK."""
    t, clk_ns = whole_transfers(e), _clk_ns(e)
    _first_ns, last_ns = _clk_falls(t)
    off_ns = t.rise_ns - last_ns
    slack_ns = row.limit("tolerance_clk") * clk_ns + e.slack_ns(0.0)
    _first(np.abs(off_ns) > slack_ns, t.rise_ns, off_ns, f"0 +- {slack_ns:.1f} ns after the last fall of CLK")
    return f"{len(t)} rises of Int within {np.abs(off_ns).max():.1f} ns of the last fall of CLK"


@check("stream", "PSA2-INT-09", needs={"line"})
def int_rests_high(e: Capture, row: Requirement) -> str:
    """Look at Int where CLK has long been still."""
    for name in LINES:
        conclusive(name in e.wires, f"the recording has no line {name}")
    edges = e.wires["CLK"].t_ns[1:]
    still_ns = np.diff(edges)
    long = (still_ns > 2 * row.limit("quiet_us") * 1e3) & e.wires.known(edges[:-1], edges[1:])
    at_ns = (edges[:-1] + still_ns // 2)[long]
    conclusive(len(at_ns), "CLK never runs and then stands still")
    low = e.wires["Int"].at(at_ns) == 0
    none_at(at_ns[low], f"Int low between frames ({int(low.sum())} of {len(low)})", "high", LINES)
    return f"high in {len(at_ns)} pauses between frames"


@check("stream", "PSA2-INT-10", needs={"line"})
def int_changes_on_the_grid_of_clk(e: Capture, row: Requirement) -> str:
    """Measure from both edges of Int to the first fall of CLK: whole periods of CLK?"""
    t, clk_ns = whole_transfers(e), _clk_ns(e)
    first_ns, _last_ns = _clk_falls(t)
    tolerance_ns = row.limit("tolerance_clk") * clk_ns
    for edges, what in ((t.fall_ns, "fall"), (t.rise_ns, "rise")):
        span_ns = np.abs(first_ns - edges)
        off_ns = np.abs(span_ns - np.rint(span_ns / clk_ns) * clk_ns)
        slack_ns = tolerance_ns + e.slack_ns(float(span_ns.max()))
        _first(off_ns > slack_ns, edges, off_ns, f"a {what} of Int on the grid of the falls of CLK")
    return f"{len(t)} falls and rises of Int on the grid of CLK"
