"""What a host on the line must have told of each case."""

from __future__ import annotations

from psabench.conform.host.cases_line import LINE_CASES, due, falls_us
from psabench.conform.host.check import HostCapture, checks, limits
from psabench.conform.host.line_waves import LineFrame, form_of
from psabench.conform.host.results import Sample
from psabench.conform.verdict import Failed, Unseen, expect

ALL_BITS, LOW_BITS, NO_BITS = -1, 0xFF, 0  # of codes that are held against each other


def _frames(e: HostCapture) -> list[LineFrame]:
    return LINE_CASES[e.case].frames(form_of(e.profile))


def _pairs(e: HostCapture, bits: int = ALL_BITS) -> list[tuple[Sample, int, LineFrame]]:
    """Samples told with the frames that were due. Raises Failed where they are not the same, one after the other."""
    want = due(LINE_CASES[e.case], form_of(e.profile))
    told = e.told.samples
    for s, (i, f) in zip(told, want, strict=False):
        expect([c & bits for c in s.codes] == [c & bits for c in f.codes], f"{s.codes} for frame {i}", f"{f.codes}")
    expect(len(told) == len(want), f"{len(told)} frames{e.last_words()}", f"{len(want)}")
    return [(s, i, f) for s, (i, f) in zip(told, want, strict=True)]


def _status(e: HostCapture) -> None:
    if not form_of(e.profile).has_status:
        raise Unseen(f"word T of profile {e.profile} has no room for channel and status")


def _lost(e: HostCapture) -> dict[int, int]:
    """Frames that did not come, by the number of samples before them."""
    found: dict[int, int] = {}
    told = 0
    for f in _frames(e):
        if not f.seen:
            found[told] = found.get(told, 0) + 1
        told += f.seen and not f.torn
    return found


def _torn(e: HostCapture) -> str:
    _pairs(e)
    n = sum(f.torn for f in _frames(e))
    e.count("torn", n)
    e.nothing_but("torn")
    return f"torn: {n}, {len(e.told.samples)} others whole"


@checks("HOST-LINE-01", "line_good")
def a_transfer_is_from_fall_to_rise_of_int(e: HostCapture) -> str:
    """Number and instants of frames, against those that were sent."""
    return f"{len(_pairs(e, NO_BITS))} frames, {_instants(e)}"


@checks("HOST-LINE-02", "line_narrow")
def bits_are_taken_at_the_rise_of_clk(e: HostCapture) -> str:
    """DATA is wrong but for a quarter of a period on either side of the rise."""
    return f"{len(_pairs(e))} frames"


@checks("HOST-LINE-03", "line_good")
def words_begin_with_the_least_bit_and_address(e: HostCapture) -> str:
    """Words 1 and 80000000h among others, four different ones in a frame: their low bits."""
    return f"{len(_pairs(e, LOW_BITS))} frames, low bits alone"


@checks("HOST-LINE-04", "line_good")
def words_have_their_sign(e: HostCapture) -> str:
    """Codes -1 and both limits."""
    negative = sum(f.codes[1] < 0 for _, _, f in _pairs(e))
    return f"{negative} words that are negative"


@checks("HOST-LINE-05", "line_good")
def word_t_has_three_parts(e: HostCapture) -> str:
    """Code, channel and status of word T."""
    _status(e)
    for s, i, f in _pairs(e):
        if (s.channel, s.status) != (f.channel, f.status):
            raise Failed(f"channel {s.channel}, status {s.status} of frame {i}", f"{f.channel}, {f.status}")
    return "code, channel and status of each"


@checks("HOST-LINE-06", "line_fast", "line_slow")
def a_clock_that_is_off_is_no_fault(e: HostCapture) -> str:
    """1.5 s with a clock that is 100 ppm fast, or slow."""
    assert abs(LINE_CASES[e.case].ppm) == limits("HOST-LINE-06").limit("clock_error_ppm")
    _pairs(e)
    e.nothing_but()
    return f"{len(e.told.samples)} frames, no fault, {_instants(e)}"


def _instants(e: HostCapture) -> str:
    """Raises Failed when the falls of INT are reported otherwise than they were."""
    bound_us = float(limits("HOST-LINE-01").limit("instant_tolerance_us"))
    falls = falls_us(LINE_CASES[e.case], form_of(e.profile))
    pairs = _pairs(e, NO_BITS)
    worst_us = 0.0
    for s, i, _ in pairs:
        off_us = (s.t_us - pairs[0][0].t_us) - (falls[i] - falls[pairs[0][1]])
        worst_us = max(worst_us, abs(off_us))
        expect(worst_us <= bound_us, f"frame {i} told {off_us:.3f} us off", f"{bound_us:g} us at most")
    return f"instants right to {worst_us:.3f} us"


@checks("HOST-LINE-07", "line_under_way")
def a_frame_under_way_is_not_told(e: HostCapture) -> str:
    """The samples begin in the middle of a frame."""
    _pairs(e)
    e.nothing_but()
    return f"{len(e.told.samples)} frames after it"


@checks("HOST-TORN-01", "line_missing")
def a_pulse_too_few_is_torn(e: HostCapture) -> str:
    """One pulse of CLK is missing: the first, the last, and some between."""
    return _torn(e)


@checks("HOST-TORN-02", "line_extra")
def a_pulse_too_many_is_torn(e: HostCapture) -> str:
    """One pulse of CLK too many: after the first, the last, and some between."""
    return _torn(e)


@checks("HOST-TORN-03", "line_pauses")
def other_pauses_are_torn(e: HostCapture) -> str:
    """128 bits with a pause of 3 or 5 periods."""
    return _torn(e)


@checks("HOST-TORN-04", "line_cut")
def int_without_a_frame_is_torn(e: HostCapture) -> str:
    """INT low for 74 us without a bit; frames that are cut off."""
    return _torn(e)


@checks("HOST-TORN-05", "line_glitch")
def a_glitch_is_no_frame(e: HostCapture) -> str:
    """INT low for 125 ns, 250 ns and 1 us."""
    _pairs(e)
    e.nothing_but("torn")
    return f"{len(e.told.samples)} frames, no more"


@checks("HOST-LOST-01", "line_lost")
def frames_that_do_not_come_are_counted(e: HostCapture) -> str:
    """1, 2 and 5 frames are missing, by the time between two falls of INT."""
    _pairs(e)
    want = _lost(e)
    if (told := e.told.by_place("lost")) != want:
        raise Failed(f"lost {told} (samples before: frames)", f"{want}")
    e.nothing_but("lost")
    return ", ".join(map(str, want.values()))


@checks("HOST-STALE-01", "line_silence")
def silence_on_the_line_is_told_and_its_end(e: HostCapture) -> str:
    """40 ms without a frame, then half a second."""
    _pairs(e)
    at = max(_lost(e))
    told = [(x.value, x.at) for x in e.told.events if x.name == "stale"]
    expect(told == [(True, at), (False, at)], f"stale {told}", f"true and false after {at} samples")
    e.nothing_but("stale", "lost")
    return f"stale after {at} samples, fresh with the next"


@checks("HOST-STALE-01", "line_stuck")
def a_line_that_is_stuck_is_told(e: HostCapture) -> str:
    """INT stays low for 0.6 s while CLK goes on."""
    _pairs(e)
    expect(e.told.of("stale") == [True, False], f"stale {e.told.of('stale')}", "true and false")
    e.nothing_but("stale", "lost", "torn")
    return f"stale after {e.told.places('stale')[0]} samples"


@checks("HOST-STALE-02", "line_frozen")
def words_that_stand_still_are_told(e: HostCapture) -> str:
    """The same words for 1.5 s."""
    _pairs(e)
    expect(e.told.of("frozen") == [True, False], f"frozen {e.told.of('frozen')}", "true and false")
    e.nothing_but("frozen")
    return f"frozen after {e.told.places('frozen')[0] - 20} samples of the same codes"


@checks("HOST-RANGE-01", "line_over")
def each_axis_at_its_limit_is_told(e: HostCapture) -> str:
    """X, Y and Z at their positive and at their negative limit."""
    _pairs(e)
    want = [(name, axis) for axis in "xyz" for _ in range(2) for name in ("over_range", "in_range")]
    told = [(x.name, x.value) for x in e.told.events]
    if (told := [t for t in told if t[0] in ("over_range", "in_range")]) != want:
        raise Failed(f"{told}", f"{want}")
    e.nothing_but("over_range", "in_range")
    return f"{len(want) // 2} times over the range and back"


@checks("HOST-SETTLE-01", "line_status")
def words_that_have_not_settled_are_not_told(e: HostCapture) -> str:
    """Two frames whose status does not say settled."""
    _status(e)
    return f"none of 2, {len(_pairs(e))} others"


@checks("HOST-OVER-01", "line_status")
def a_conversion_that_was_lost_is_told(e: HostCapture) -> str:
    """A frame whose status says that a conversion was lost before it."""
    _status(e)
    e.count("overrun", 1)
    return "overrun: 1"


@checks("HOST-RES-01", "line_good")
def each_frame_is_told_once_and_in_order(e: HostCapture) -> str:
    """The frames told, against those that were sent."""
    return f"{len(_pairs(e))} frames"


@checks("HOST-RES-02", "line_slow")
def nothing_is_told_that_was_not_on_the_line(e: HostCapture) -> str:
    """Everything told of 1.5 s of a good board."""
    e.nothing_but()
    return f"{len(_pairs(e))} frames and no fault"
