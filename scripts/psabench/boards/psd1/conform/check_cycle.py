"""PSD-1's cycle of reading: A0, the order of the words, 1M25, what lies between cycles (article, section 4)."""

from __future__ import annotations

import numpy as np

from psabench.boards.psd1.conform.capture_cycles import (
    ADDRESS,
    DATA,
    FRAMES,
    LEAST,
    LINES,
    PINS,
    cycles,
    fl2_level,
    from_x,
    of,
    starts,
    transfers,
    trouble,
)
from psabench.conform.capture.intervals import after, at_levels, before, edges, first_bad, interval, together
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import conclusive

START = ("CLK_1M25", "INT0", "FL1", "DR", "A0", "RFX")
US = 1e3
RATES = ("PSD1-CYC-12", "PSD1-CYC-13")


@check("stream", "PSD1-CYC-01", needs={"line"})
def words_are_read_in_turn(e: Capture) -> str:
    """Follow RFX, RFY, RFZ and the strobe that takes each word before the next transfer."""
    words = from_x(transfers(e))
    if found := trouble(words):
        raise found
    late = of(words, "cs_rise")[:-1] > of(words, "fall")[1:]
    first_bad(late, of(words, "fall")[1:], "the next transfer before the strobe's end", "after", LINES)
    none = of(words, "cs_fall") < 0
    first_bad(none, of(words, "rise"), "no strobe between two words", "a strobe for each word", LINES)
    return f"{len(words)} words X, Y, Z in turn, each word with its strobe"


@check("stream", "PSD1-CYC-02", needs={"pins"}, wires=START)
def a_cycle_begins_with_its_three_conditions(e: Capture) -> str:
    """Look at INT0, FL1 and DR just before each rise of A0."""
    at_ns = starts(e, cycles(e))
    just = at_ns - 1 - round(e.slack_ns(0.0))
    for name, due in (("INT0", 1), ("FL1", 0), ("DR", 0)):
        bad = e.wires[name].at(just) != due
        first_bad(bad, at_ns, f"A0 rises with {name} {1 - due}", f"{name} {due}", START)
    return f"{len(at_ns)} cycles, INT0 1, FL1 0 and DR 0 before each"


@check("stream", "PSD1-CYC-03", needs={"pins"})
def a0_rises_with_the_clock(e: Capture, row: Requirement) -> str:
    """Compare each rise of A0 with the rises of 1M25."""
    at_ns = starts(e, cycles(e))
    return together(
        e,
        at_ns,
        e.wires.rises("CLK_1M25"),
        row.limit("tolerance_ns"),
        "A0 and a rise of 1M25",
        START,
    )


@check("stream", "PSD1-CYC-04", needs={"pins"}, wires=START)
def a0_rises_with_the_first_clock_that_it_can(e: Capture) -> str:
    """Look whether the rise of 1M25 before that of A0 came too early for all conditions."""
    whole = cycles(e)
    at_ns = starts(e, whole)
    held_ns = e.wires.rises("INT0"), e.wires.falls("FL1"), e.wires.falls("DR")  # each condition from here on
    ready = np.max([before(edge_ns, at_ns) for edge_ns in held_ns], axis=0)
    ready[1:] = np.maximum(ready[1:], np.array([c[2].clear for c in whole], np.int64)[:-1])
    period_ns = row_for(e, "PSD1-CYC-07").limit("period_ns")
    waited = at_ns - ready
    saw = [f"A0 {w} ns after the last condition" for w in waited]
    slack_ns = e.slack_ns(period_ns)
    bad = (waited <= 0) | (waited > period_ns + slack_ns)
    first_bad(bad[1:], at_ns[1:], saw[1:], f"up to {period_ns:g} ns, the next rise of 1M25", START)
    return f"{len(at_ns) - 1} cycles, A0 {waited[1:].min()} to {waited[1:].max()} ns after the last condition"


@check("stream", "PSD1-CYC-06", needs={"pins"})
def rfx_falls_half_a_clock_after_a0(e: Capture, row: Requirement) -> str:
    """Measure from the rise of A0 to the fall of RFX, and compare that with the falls of 1M25."""
    whole = cycles(e)
    falls, tolerance_ns = of([c[0] for c in whole], "fall"), row.limit("tolerance_ns")
    together(e, falls, e.wires.falls("CLK_1M25"), tolerance_ns, "RFX and a fall of 1M25", START)
    return interval(e, starts(e, whole), falls, row.limit("a0_to_rfx_ns"), tolerance_ns, "from A0 to RFX", START)


@check("stream", "PSD1-CYC-07", needs={"pins"}, wires=("CLK_1M25",))
def the_clock_runs_without_a_gap(e: Capture, row: Requirement) -> str:
    """Measure every period of 1M25 and its high half."""
    rises = e.wires.rises("CLK_1M25")
    up, down = e.wires.pulses("CLK_1M25", 1)
    conclusive(len(rises) >= LEAST, f"{len(rises)} rises of 1M25 were recorded")
    tolerance_ns = row.limit("tolerance_ns")
    interval(e, up, down, row.limit("high_ns"), tolerance_ns, "of 1M25 high", ("CLK_1M25",))
    return interval(
        e, rises[:-1], rises[1:], row.limit("period_ns"), tolerance_ns, "from rise to rise of 1M25", ("CLK_1M25",)
    )


@check("stream", "PSD1-CYC-08", needs={"pins"})
def a0_falls_where_the_profile_says(e: Capture, row: Requirement) -> str:
    """Compare the fall of A0 with the rise of RFZ and the end of the last FL2."""
    whole = cycles(e)
    early = e.variant["a0_release"] == "rfz"
    z = [c[2] for c in whole]
    due = of(z, "rise" if early else "clear")
    fell = after(e.wires.falls("A0"), starts(e, whole))
    return together(
        e,
        fell,
        due,
        row.limit("tolerance_ns"),
        f"A0 and the {'rise of RFZ' if early else 'end of the last FL2'}",
        ("A0", "RFZ", "FL2"),
    )


@check("stream", "PSD1-CYC-09", needs={"pins"})
def a_cycle_has_its_length(e: Capture, row: Requirement) -> str:
    """Measure from the rise of A0 to the end of the last FL2."""
    whole = cycles(e)
    begin, end = starts(e, whole), of([c[2] for c in whole], "clear")
    least_ns = row.limit("shortest_us") * US
    took = end - begin
    first_bad(
        took < least_ns - e.slack_ns(least_ns), begin, [f"{t} ns" for t in took], f"{least_ns:.0f} ns or more", PINS
    )
    return interval(e, begin, end, row.limit("built_in_us") * US, row.limit("tolerance_us") * US, "of a cycle", LINES)


@check("stream", "PSD1-CYC-10", needs={"pins"})
def a_cycle_begins_only_after_the_last_has_ended(e: Capture) -> str:
    """Look for A0 and FL2 at rest before each rise of A0, and for a rise of 1M25 since."""
    whole = cycles(e)
    at_ns, ends = starts(e, whole), of([c[2] for c in whole], "clear")
    early = at_ns[1:] <= ends[:-1]
    first_bad(early, at_ns[1:], "A0 rises before FL2 is cleared", "after the last FL2", LINES)
    just = at_ns - 1 - round(e.slack_ns(0.0))
    waits = e.wires["FL2"].at(just) == fl2_level(e)
    first_bad(waits, at_ns, "FL2 is active when A0 rises", "no word waits", LINES)
    together(e, at_ns, e.wires.rises("CLK_1M25"), row_for(e, "PSD1-CYC-03").limit("tolerance_ns"), "A0 and 1M25", START)
    return f"{len(at_ns)} cycles, the next {int((at_ns[1:] - ends[:-1]).min())} ns after the last or later"


@check("stream", "PSD1-CYC-11", needs={"pins"}, wires=PINS)
def nothing_moves_between_cycles(e: Capture) -> str:
    """Look for edges of any other line but 1M25 and DR between the last FL2 and the next A0."""
    whole = cycles(e)
    begin, end = of([c[2] for c in whole], "clear")[:-1], starts(e, whole)[1:]
    slack = round(e.slack_ns(0.0))
    hosts = () if e.variant["host_strobe_ns"] else ("CS", "RW", *ADDRESS, *DATA, "INT0", "FL1")  # a host of its own
    for name in PINS:
        if name in ("CLK_1M25", "DR", *hosts):
            continue
        moved = after(edges(e, name), begin + slack) < end - slack
        first_bad(moved, begin, f"{name} moves between cycles", "1M25 and DR alone", (name, "A0", "FL2"))
    return f"{len(begin)} pauses without an edge but of 1M25 and DR"


@check("stream", "PSD1-CYC-12", "PSD1-CYC-13", needs={"line"})
def cycles_come_at_their_rate(e: Capture) -> str:
    """Measure from one fall of RFX to the next."""
    row = row_for(e, *RATES)
    falls = of([c[0] for c in cycles(e)], "fall")
    period_ns = row.limit("period_us") * US
    tolerance_ns = row.limit("jitter_max_us") * US + period_ns * row.limit("clock_error_ppm") * 1e-6
    return interval(e, falls[:-1], falls[1:], period_ns, tolerance_ns, "from cycle to cycle", FRAMES)


@check("stream", "PSD1-CYC-12", needs={"pins"}, wires=("DR", "A0"))
def a_cycle_follows_each_fall_of_dr(e: Capture) -> str:
    """Count the falls of DR and the rises of A0 in turn."""
    falls, rises = e.wires.falls("DR"), e.wires.rises("A0")
    conclusive(len(rises) >= LEAST and len(falls), f"{len(falls)} falls of DR, {len(rises)} rises of A0 were recorded")
    inside = rises[rises > falls[0]]
    n = min(len(inside), len(falls))
    answers = after(rises, falls[:n])
    bad = inside[:n] != answers
    first_bad(bad, falls[:n], "a fall of DR without its cycle, or a cycle without one", "one for each", START)
    return f"{n} falls of DR, {n} rises of A0 in turn"


@check("power_on", "PSD1-SIG-01", needs={"pins"}, wires=PINS)
def lines_rest_at_their_levels(e: Capture, row: Requirement) -> str:
    """Look at every line after Res, before the first control word goes out."""
    moves = edges(e, "TFS")
    moves = moves[moves > e.wires.start_ns]
    conclusive(len(moves), "TFS never moves after Res")
    names = [name for name in PINS if name not in ("CLK_1M25", "FL2")]
    return at_levels(e, names, int(moves[0]) - 1 - round(e.slack_ns(0.0)), row, "at rest", ("TFS",))


@check("stream", "PSD1-FL2-05", needs={"line"})
def fl2_rests_at_its_level(e: Capture) -> str:
    """Look at FL2 while a word is transferred, and how long it is at each level."""
    words = transfers(e)
    due = 1 - fl2_level(e)
    level = e.wires["FL2"].at(of(words, "fall") + round(e.slack_ns(0.0)) + 100)
    first_bad(level != due, of(words, "fall"), f"FL2 {1 - due} in a transfer", f"{due}", LINES)
    return f"{len(words)} transfers with FL2 {due}"
