"""PSD-1's transfers: RFX, RFY, RFZ, SCLK, SDAT, FL2, and the strobe that takes the word (article, section 4)."""

from __future__ import annotations

import numpy as np

from psabench.boards.psd1.conform.capture_cycles import (
    ADDRESS,
    DATA,
    FRAMES,
    LINES,
    Transfer,
    cycles,
    of,
    serial_words,
    transfers,
)
from psabench.conform.capture.intervals import (
    after,
    before,
    bus_word,
    edges,
    first_bad,
    interval,
    overlaps,
    together,
    wires_needed,
)
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, damaged_data_are, expect

SERIAL = (*FRAMES, "SCLK", "SDAT", "CLK_1M25")
HAND = (*FRAMES, "FL2", "CS", "CLK_1M25")


def _words(e: Capture) -> list[Transfer]:
    return [t for c in cycles(e) for t in c]


@check("stream", "PSD1-SER-01", needs={"pins"})
def the_first_bit_comes_in_time(e: Capture, row: Requirement) -> str:
    """Look at SDAT 400 ns after the fall of RFx and up to the first rise of SCLK."""
    words = _words(e)
    due = of(words, "fall") + round(row.limit("access_max_ns") + e.slack_ns(row.limit("access_max_ns")))
    first = np.array([t.rises[0] for t in words], np.int64)
    late = after(edges(e, "SDAT"), due) <= first
    first_bad(
        late,
        due,
        "SDAT moves after that",
        f"the first bit within {row.limit('access_max_ns'):g} ns",
        SERIAL,
    )
    ones = int(e.wires["SDAT"].at(first).sum())
    conclusive(ones, "no word begins with a 1")
    return f"{len(words)} words, {ones} of them begin with a 1"


@check("stream", "PSD1-SER-02", needs={"pins"})
def the_most_significant_bit_comes_first(e: Capture) -> str:
    """Compare the bits of SDAT at the rises of SCLK with the word on D0..D15."""
    words = _words(e)
    return _same_words(e, words, "bits of SDAT")


@check("stream", "PSD1-SER-02", needs={"line", "can"})
def words_of_the_line_are_those_on_can(e: Capture) -> str:
    """Look for the words of PSD1_CYCLE among those of SDAT, most significant bit first."""
    seen, told = serial_words(e.wires, _words(e)).reshape(-1, 3), told_words(e)
    known = {tuple(w) for w in seen.tolist()}
    both = sum(tuple(w) in known for w in told.tolist())
    if both < min(len(told), len(seen)) // 2:
        raise Failed(f"{_hex(told[0])} on CAN, {_hex(seen[0])} on SDAT, {both} alike", "the same words", lines=LINES)
    return f"{both} cycles with the same words on SDAT and on CAN"


@check("stream", "PSD1-CAN-01", needs={"line", "can"})
def each_cycle_is_told_once(e: Capture) -> str:
    """Look for the words of PSD1_CYCLE, in their order and none left out, among those of SDAT."""
    return _found(serial_words(e.wires, _words(e)).reshape(-1, 3), told_words(e))


def told_words(e: Capture) -> np.ndarray:
    """(n, 3) of PSD1_CYCLE. Raises Inconclusive for fewer than two, Failed for frames of another length."""
    log = e.frames_of("PSD1_CYCLE")
    conclusive(len(log) >= 3, f"{len(log)} messages PSD1_CYCLE came")
    with damaged_data_are(Failed, "8 bytes", frames=log.frames):
        raw = log.raw("PSD1_CYCLE")
    return np.stack([raw[a] for a in "XYZ"], axis=1)


def _found(seen: np.ndarray, told: np.ndarray) -> str:
    """The reported words are consecutive words of those seen; words outside the recording are left out."""
    for here, there in overlaps(len(seen), len(told)):
        if len(seen[here]) >= 3 and np.array_equal(seen[here], told[there]):
            return f"{len(seen[here])} cycles, their words on SDAT and on CAN"
    raise Failed(
        f"{_hex(told[0])} on CAN, {_hex(seen[0])} on SDAT, never alike", "the same words in order", lines=LINES
    )


def _hex(words: np.ndarray) -> str:
    return " ".join(f"{w:04X}" for w in words)


@check("stream", "PSD1-SER-03", needs={"line"})
def the_first_edge_of_sclk_is_a_rise(e: Capture, row: Requirement) -> str:
    """Measure from the fall of RFx to the first edge of SCLK."""
    words = _words(e)
    falls = of(words, "fall")
    edge = after(edges(e, "SCLK"), falls)
    down = e.wires["SCLK"].at(np.minimum(edge, e.wires.end_ns)) == 0
    first_bad(down, falls, "the first edge of SCLK falls", "a rise", SERIAL)
    return interval(
        e, falls, edge, row.limit("first_rise_ns"), row.limit("tolerance_ns"), "to the first rise of SCLK", SERIAL
    )


@check("stream", "PSD1-SER-04", needs={"pins"}, wires=("CLK_1M25",))
def sclk_is_the_clock_delayed(e: Capture, row: Requirement) -> str:
    """Measure from each rise of 1M25 to the rise of SCLK that follows it, and from rise to rise."""
    words = _words(e)
    rises = np.array([t.rises for t in words], np.int64)
    tolerance_ns, period_ns = row.limit("tolerance_ns"), row.limit("period_ns")
    interval(
        e, rises[:, :-1].reshape(-1), rises[:, 1:].reshape(-1), period_ns, tolerance_ns, "from rise to rise", SERIAL
    )
    at_ns = rises.reshape(-1)
    begin = before(e.wires.rises("CLK_1M25"), at_ns)
    return interval(e, begin, at_ns, row.limit("shift_ns"), tolerance_ns, "from 1M25 to SCLK", SERIAL)


@check("stream", "PSD1-SER-05", needs={"line"})
def a_transfer_has_its_pulses(e: Capture, row: Requirement) -> str:
    """Count the rises and falls of SCLK in each transfer."""
    due = int(row.limit("pulses_count"))
    words = transfers(e)
    counts = np.array([len(t.rises) if len(t.falls) == due else len(t.falls) for t in words])
    saw = [f"{n} pulses of SCLK in a transfer" for n in counts]
    first_bad(counts != due, of(words, "fall"), saw, f"{due}", SERIAL)
    return f"{len(words)} transfers of {due} pulses"


@check("stream", "PSD1-SER-06", needs={"pins"})
def bits_change_after_the_fall_of_sclk(e: Capture, row: Requirement) -> str:
    """Measure from the fall of SCLK to the change of SDAT that follows, up to the last bit."""
    words = _words(e)
    moves = edges(e, "SDAT")
    late: list[int] = []
    for t in words:
        inside = moves[(moves > t.rises[0]) & (moves <= t.rises[-1])]
        late.extend((inside - t.falls[np.searchsorted(t.falls, inside, "right") - 1]).tolist())
    expect(late, "a SDAT that never moves in a word", "bits", at_ns=words[0].fall, lines=SERIAL)
    took, slack_ns = np.array(late), e.slack_ns(row.limit("change_max_ns"))
    bad = (took < row.limit("hold_min_ns") - slack_ns) | (took > row.limit("change_max_ns") + slack_ns)
    if bad.any():
        saw = f"SDAT moves {took[bad][0]} ns after a fall of SCLK ({int(bad.sum())} of {len(took)})"
        due = f"{row.limit('hold_min_ns'):g} to {row.limit('change_max_ns'):g} ns after one"
        raise Failed(saw, due, at_ns=words[0].fall, lines=SERIAL)
    return f"{len(took)} changes of SDAT, {took.min()} to {took.max()} ns after a fall of SCLK"


@check("stream", "PSD1-SER-07", needs={"line"})
def rfx_is_low_for_its_time(e: Capture, row: Requirement) -> str:
    """Measure the lows of RFX, RFY and RFZ, and look for the 16th pulse before their end."""
    words = _words(e)
    last = np.array([t.falls[-1] if len(t.falls) else t.rise + 1 for t in words], np.int64)
    late = last > of(words, "rise")
    first_bad(late, of(words, "rise"), "a rise within pulse 16", "after it", SERIAL)
    return interval(
        e,
        of(words, "fall"),
        of(words, "rise"),
        row.limit("rfx_low_ns"),
        row.limit("tolerance_ns"),
        "of RFx low",
        SERIAL,
    )


@check("stream", "PSD1-SER-07", needs={"pins"}, wires=("CLK_1M25",))
def rfx_rises_with_a_fall_of_the_clock(e: Capture, row: Requirement) -> str:
    """Compare the rises of RFX, RFY and RFZ with the falls of 1M25."""
    tolerance_ns = row.limit("tolerance_ns")
    return together(e, of(_words(e), "rise"), e.wires.falls("CLK_1M25"), tolerance_ns, "RFx and a fall of 1M25", SERIAL)


@check("stream", "PSD1-SER-08", needs={"line"})
def fl2_is_set_as_rfx_rises(e: Capture, row: Requirement) -> str:
    """Compare FL2 with the rises of RFX, RFY and RFZ."""
    words = transfers(e)
    tolerance_ns = row.limit("tolerance_ns")
    return interval(e, of(words, "rise"), of(words, "fl2"), 0.0, tolerance_ns, "from RFx to FL2", HAND)


@check("stream", "PSD1-SER-09", needs={"line"}, wires=FRAMES)
def one_converter_at_a_time(e: Capture) -> str:
    """Look for two of RFX, RFY and RFZ low at once."""
    at_ns = np.unique(np.concatenate([e.wires[n].t_ns for n in FRAMES]))
    lows = sum((1 - e.wires[n].at(at_ns).astype(np.int64) for n in FRAMES), np.zeros(len(at_ns), np.int64))
    first_bad(lows > 1, at_ns, [f"{n} of RFX, RFY, RFZ low at once" for n in lows], "one at most", FRAMES)
    return f"{len(transfers(e))} transfers, never two at once"


@check("stream", "PSD1-SER-10", needs={"line"})
def sclk_rests_low(e: Capture) -> str:
    """Look for pulses of SCLK outside transfers."""
    words = transfers(e)
    rises = e.wires.rises("SCLK")
    rises = rises[(rises > words[0].fall) & (rises < words[-1].rise)]
    inside = np.zeros(len(rises), bool)
    spans = [e.wires.pulses(n, 0) for n in (*FRAMES, "TFS") if n in e.wires]
    for begin, end in spans:
        k = np.searchsorted(begin, rises, "right") - 1
        inside |= (k >= 0) & (rises <= end[np.maximum(k, 0)]) if len(begin) else False
    first_bad(~inside, rises, "SCLK rises outside a transfer", "low", SERIAL)
    rest = of(words, "rise") + round(e.slack_ns(0.0))
    high = e.wires["SCLK"].at(rest) == 1
    first_bad(high, rest, "SCLK high after a transfer", "low", SERIAL)
    return f"{len(rises)} pulses of SCLK, all within transfers"


@check("stream", "PSD1-SER-11", needs={"pins"}, wires=("DR",))
def dr_rises_after_the_last_bit_of_x(e: Capture, row: Requirement) -> str:
    """Look at DR 110 ns after the 16th fall of SCLK under RFX."""
    x = [c[0] for c in cycles(e)]
    most = row.limit("rise_max_ns")
    at_ns = np.array([t.falls[-1] for t in x], np.int64) + round(most + e.slack_ns(most))
    first_bad(
        e.wires["DR"].at(at_ns) == 0,
        at_ns,
        "DR low",
        f"high {most:g} ns after the last fall",
        (*SERIAL, "DR"),
    )
    return f"{len(x)} times high {most:g} ns after the last fall"


@check("stream", "PSD1-FL2-01", needs={"pins"})
def fl2_is_cleared_by_the_clock_after_the_strobe(e: Capture, row: Requirement) -> str:
    """Compare the end of FL2 with the first fall of 1M25 strictly after that of the strobe."""
    return _cleared(e, transfers(e), row.limit("tolerance_ns"))


@check("stream", "PSD1-FL2-04", needs={"pins"})
def fl2_of_z_is_cleared_likewise(e: Capture) -> str:
    """The same for the third strobe of each cycle."""
    return _cleared(e, [c[2] for c in cycles(e)], row_for(e, "PSD1-FL2-01").limit("tolerance_ns"))


def _cleared(e: Capture, words: list[Transfer], tolerance_ns: float) -> str:
    wires_needed(e, "CLK_1M25")
    none = of(words, "cs_fall") < 0
    first_bad(none, of(words, "rise"), "FL2 cleared without a strobe", "by a strobe", HAND)
    due = after(e.wires.falls("CLK_1M25"), of(words, "cs_rise"))
    return interval(
        e, due, of(words, "clear"), 0.0, tolerance_ns, "from the fall of 1M25 after the strobe to the end of FL2", HAND
    )


@check("stream", "PSD1-FL2-02", needs={"line"})
def rfy_falls_as_fl2_of_x_is_cleared(e: Capture, row: Requirement) -> str:
    """Measure from the end of FL2 of X to the fall of RFY."""
    return _handed(e, 1, row.limit("tolerance_ns"))


@check("stream", "PSD1-FL2-03", needs={"line"})
def rfz_falls_as_fl2_of_y_is_cleared(e: Capture, row: Requirement) -> str:
    """Measure from the end of FL2 of Y to the fall of RFZ."""
    return _handed(e, 2, row.limit("tolerance_ns"))


def _handed(e: Capture, axis: int, tolerance_ns: float) -> str:
    whole = cycles(e)
    clear, fall = of([c[axis - 1] for c in whole], "clear"), of([c[axis] for c in whole], "fall")
    return interval(e, clear, fall, 0.0, tolerance_ns, f"from the end of FL2 to {FRAMES[axis]}", HAND)


@check("stream", "PSD1-FL2-07", needs={"pins"})
def the_built_in_host_keeps_its_times(e: Capture, row: Requirement) -> str:
    """Measure from FL2 to the strobe, and the strobe."""
    words = _words(e)
    slow = "slow_" if e.variant.profile == "psd1_slow" else ""
    wait_ns, strobe_ns = row.limit(f"{slow}wait_ns"), row.limit(f"{slow}strobe_ns")
    tolerance_ns = row_for(e, "PSD1-SER-08").limit("tolerance_ns")
    interval(e, of(words, "fl2"), of(words, "cs_fall"), wait_ns, tolerance_ns, "from FL2 to the strobe", HAND)
    return interval(e, of(words, "cs_fall"), of(words, "cs_rise"), strobe_ns, tolerance_ns, "of strobe", HAND)


@check("stream", "PSD1-BUS-01", needs={"pins"})
def words_are_on_the_bus_at_their_address(e: Capture) -> str:
    """Look at D0..D15, AB0..AB3 and R/W in the strobe that takes each word."""
    words = _words(e)
    seen = _same_words(e, words, "bits of SDAT")
    at_ns = of(words, "cs_fall") + round(e.slack_ns(0.0))
    for name, saw, due in (
        ("address", bus_word(e, "AB", len(ADDRESS), at_ns), of(words, "axis")),
        ("R/W", e.wires["RW"].at(at_ns).astype(np.int64), np.ones(len(words), np.int64)),
    ):
        first_bad(saw != due, at_ns, [f"{name} {v}" for v in saw], "that of the axis, a read", ("CS", "RW", *ADDRESS))
    return f"{seen}, at the addresses of their axes"


def _same_words(e: Capture, words: list[Transfer], what: str) -> str:
    wires_needed(e, "RW", *ADDRESS, *DATA)
    at_ns = of(words, "cs_fall")
    first_bad(at_ns < 0, of(words, "rise"), "no strobe", "a strobe for each word", LINES)
    at_ns = at_ns + round(e.slack_ns(0.0))
    seen, sent = bus_word(e, "D", len(DATA), at_ns), serial_words(e.wires, words)
    saw = [f"{b:04X}h on D0..D15, {a:04X}h in the {what}" for a, b in zip(sent, seen, strict=True)]
    first_bad(seen != sent, at_ns, saw, "the same word", ("SCLK", "SDAT", "CS"))
    return f"{len(words)} words on D0..D15 as they came on SDAT"
