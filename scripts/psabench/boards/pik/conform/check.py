"""PIK, PIK-5 and PIK-6: pulses on their lines and counts in their readings (article, sections 1 and 2)."""

from __future__ import annotations

import numpy as np

from psabench.conform.capture.intervals import at_levels, before, edges, first_bad, first_of, interval, overlaps
from psabench.conform.capture.log import CanLog, Capture, LineLog
from psabench.conform.capture.messages import as_laid_out, emergencies, in_turn, late_readings
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect
from psabench.link.protocol_files import message
from psabench.link.signals import Floats, Ints, unwrap

PULSES = ("FXP", "FXN", "FYP", "FYN", "FZP", "FZN")
ADDRESS, DATA = tuple(f"AB{k}" for k in range(4)), tuple(f"D{k}" for k in range(16))
PINS = (*PULSES, "LATCH", "CS", "RW", *ADDRESS, *DATA)
MESSAGES = ("PIK_COUNTS", "PIK_TOTALS", "PIK_TOTAL_Z")
US = 1e3
LEAST = 8
ROUNDED_NS = 2.0  # two edges in whole nanoseconds
LAG_NS = 300_000  # a recording that begins late may have missed an edge of its first 200 us (docs/boards/pik.md)
COEFFICIENT = ("PIK-LAW-02", "PIK-LAW-03")


def _told(e: Capture, name: str, least: int = LEAST) -> CanLog:
    log = e.frames_of(name)
    conclusive(len(log) >= least, f"{len(log)} messages {name} came; expected {least}")
    bad = [f for f in log.frames if len(f.data) != int(message(name).length)]
    if bad:
        raise Inconclusive(f"{name} of {len(bad[0].data)} bytes")
    return log


def totals(e: Capture, least: int = LEAST) -> tuple[Floats, Ints]:
    """Instants (n,) s by the board's stamps and totals (n, 3) of whole readings, not wrapped."""
    xy, z = _told(e, "PIK_TOTALS", least).raw("PIK_TOTALS"), _told(e, "PIK_TOTAL_Z", least).raw("PIK_TOTAL_Z")
    n = min(len(xy["X"]), len(z["Z"]))
    found = np.stack([_unwrapped(v[:n]) for v in (xy["X"], xy["Y"], z["Z"])], axis=1)
    return np.asarray(unwrap(z["TSTAMP"][:n], 32) * 1e-6, np.float64), found


def _unwrapped(v: Ints) -> Ints:
    step = (np.diff(v) + (1 << 31)) % (1 << 32) - (1 << 31)
    return np.concatenate([v[:1], v[0] + np.cumsum(step)])


def rates(e: Capture) -> dict[str, tuple[float, float]]:
    """Volts and pulses a second of each axis whose input is known, over the whole recording."""
    t_s, n = totals(e)
    took_s = float(t_s[-1] - t_s[0])
    conclusive(took_s > 0.0 and e.inputs_v, "expected inputs that are known, and stamps that go on")
    mine = {a: k for k, a in enumerate("xyz") if a in e.inputs_v}
    return {a: (e.inputs_v[a], float(n[-1, k] - n[0, k]) / took_s) for a, k in mine.items()}


def _allowed_hz(e: Capture, volts: float, part: float) -> float:
    """What a channel's zero, the error of K and a pulse at either end of a minute allow."""
    k = row_for(e, *COEFFICIENT).limit("k_hz_per_v")
    return k * (abs(volts) * part + row_for(e, "PIK-LAW-01").limit("zero_max_v")) + 2.0 / 60.0


@check("minute", "PIK-LAW-01", needs={"can", "inputs"})
def the_frequency_follows_the_input(e: Capture, row: Requirement) -> str:
    """Compare pulses a second with the volts at the inputs."""
    k, seen = row_for(e, *COEFFICIENT).limit("k_hz_per_v"), []
    part = row.limit("pik6_tolerance_pct" if e.variant.board == "pik6" else "tolerance_pct") / 100
    for axis, (volts, hz) in rates(e).items():
        most = _allowed_hz(e, volts, part)
        if abs(hz - k * volts) > most:
            raise Failed(f"{hz:.3f} Hz at {volts:g} V on {axis.upper()}", f"{k * volts:.3f} +- {most:.3f} Hz")
        seen.append(f"{hz:.2f}")
    return f"{', '.join(seen)} Hz"


@check("minute", "PIK-LAW-02", "PIK-LAW-03", needs={"can", "inputs"})
def the_coefficient_is_the_printed_one(e: Capture) -> str:
    """Take the coefficient from the pulses of a minute."""
    row = row_for(e, *COEFFICIENT)
    k, part, seen = row.limit("k_hz_per_v"), row.limit("error_max_pct") / 100, []
    for axis, (volts, hz) in rates(e).items():
        most = _allowed_hz(e, volts, part + e.clock_ppm * 1e-6)
        if abs(hz - k * volts) > most:
            raise Failed(f"{hz / volts:.4f} Hz/V on {axis.upper()}", f"{k:g} Hz/V, {most / abs(volts):.4f} off at most")
        seen.append(f"{hz / volts:.4f}")
    return f"{', '.join(seen)} Hz/V"


@check("minute", "PIK-LAW-04", needs={"can", "inputs"})
def the_count_is_the_integral(e: Capture, row: Requirement) -> str:
    """Compare the totals of a minute at a still input with a straight line."""
    most = row.limit("error_max_pulses")
    t_s, n = totals(e, 100)
    worst = 0.0
    for k, axis in enumerate("XYZ"):
        slope, at_0 = np.polyfit(t_s - t_s[0], n[:, k].astype(np.float64), 1)
        off = float(np.abs(n[:, k] - (slope * (t_s - t_s[0]) + at_0)).max())
        expect(off <= most, f"{off:.2f} pulses from a straight line on {axis}", f"{most:g} at most")
        worst = max(worst, off)
    return f"{len(n)} readings, {worst:.2f} pulses from a straight line at most"


@check("minute", "PIK-LAW-05", needs={"can", "inputs"})
def a_pulse_has_the_printed_weight(e: Capture, row: Requirement) -> str:
    """Take the weight from the measured coefficient and the accelerometer's volts a g on the load of the profile."""
    due = row.limit(f"{e.variant.board}_mps")
    volts, hz = max(rates(e).values(), key=lambda r: abs(r[0]))
    ma_v_per_g = row.limit("current_a_per_g") * float(e.variant["ra_ohm"])
    weight = row.limit("g_mps2") * volts / hz / ma_v_per_g if hz else 0.0
    if abs(weight / due - 1) > row.limit("tolerance_pct") / 100:
        raise Failed(f"{weight * 1e3:.3f} mm/s a pulse", f"{due * 1e3:g} mm/s +- {row.limit('tolerance_pct'):g} %")
    return f"{weight * 1e3:.3f} mm/s a pulse"


@check("minute", "PIK-LAW-09", needs={"can", "inputs"})
def the_law_is_linear(e: Capture, row: Requirement) -> str:
    """Compare the coefficients of the three channels, whose inputs are not alike."""
    found = rates(e)
    k = np.array([hz / volts for volts, hz in found.values()])
    zero = row_for(e, "PIK-LAW-01").limit("zero_max_v") / min(abs(v) for v, _ in found.values())
    spread, most = float(np.ptp(k) / k.mean()), row.limit("spread_max_pct") / 100 + 2 * zero
    expect(len(k) >= 2 and spread <= most, f"coefficients {spread * 100:.3f} % apart", f"{most * 100:.3f} % at most")
    return f"coefficients {spread * 100:.4f} % apart at {', '.join(f'{v:g}' for v, _ in found.values())} V"


@check("minute", "PIK-SAT-02", needs={"can", "inputs"})
def nothing_saturates_below_full_scale(e: Capture, row: Requirement) -> str:
    """Look for SAT bits in a minute."""
    most = row.limit("input_max_v")
    conclusive(not any(abs(v) > most for v in e.inputs_v.values()), f"expected inputs of {most:g} V at most")
    raw = _told(e, "PIK_COUNTS").raw("PIK_COUNTS")
    for axis in "XYZ":
        expect(not raw[f"SAT_{axis}"].any(), f"SAT_{axis}", f"none up to {most:g} V")
    return f"{len(raw['X'])} readings without SAT"


@check("stream", "PIK-LAW-07", needs={"line", "inputs"}, wires=PULSES)
def signs_have_their_lines(e: Capture) -> str:
    """Count pulses on the lines P and N of each channel."""
    seen = []
    for axis, volts in e.inputs_v.items():
        p, n = (len(e.wires.rises(f"F{axis.upper()}{sign}")) for sign in "PN")
        mine, other = (p, n) if volts > 0 else (n, p)
        if not mine or other:
            raise Failed(f"{p} pulses on F{axis.upper()}P, {n} on F{axis.upper()}N at {volts:g} V", "on one of them")
        seen.append(f"{p} and {n}")
    return f"pulses on P and N: {', '.join(seen)}"


@check("stream", "PIK-LAW-08", needs={"line"}, wires=PULSES)
def a_reset_lasts_its_time(e: Capture, row: Requirement) -> str:
    """Measure the pulses."""
    due_ns = _tclk_ns(e)
    slack_ns = ROUNDED_NS + due_ns * row.limit("clock_error_ppm") * 1e-6
    seen = ""
    for name in PULSES:
        up, down = e.wires.pulses(name, 1)
        known = up > e.wires.start_ns + LAG_NS
        up, down = up[known], down[known]
        if len(up):
            seen = interval(e, up, down, due_ns, slack_ns, f"of {name} high", (name,))
    conclusive(seen, "no pulse was recorded")
    return seen


def _tclk_ns(e: Capture) -> float:
    row = row_for(e, "PIK-LAW-08")
    return row.limit("pik6_us" if e.variant.board == "pik6" else "pik_us") * US


@check("stream", "PIK-LAW-10", needs={"pins"}, wires=("CLK", *PULSES))
def pulses_begin_on_their_grid(e: Capture, row: Requirement) -> str:
    """Compare the rises of pulses with the clock, and measure from pulse to pulse."""
    tclk_ns = _tclk_ns(e)
    tick_ns = tclk_ns / row.limit("grid_per_tclk")
    clock, count = e.wires.rises("CLK"), 0
    for axis in "XYZ":
        rises = np.sort(np.concatenate([e.wires.rises(f"F{axis}{s}") for s in "PN"]))
        rises = rises[rises > e.wires.start_ns + LAG_NS]
        inside = rises[rises > (clock[0] if len(clock) else e.wires.end_ns)]
        phase = (inside - before(clock, inside + 1)) / tick_ns
        off_ns = np.abs(phase - np.rint(phase)) * tick_ns
        slack_ns = ROUNDED_NS + row.limit("tolerance_ns") + e.slack_ns(tclk_ns)
        first_bad(
            off_ns > slack_ns,
            inside,
            [f"{o:.1f} ns off the grid" for o in off_ns],
            f"{slack_ns:.1f} ns",
            ("CLK", f"F{axis}P", f"F{axis}N"),
        )
        gap_ns = np.diff(rises)
        least_ns = row.limit("gap_min_per_tclk") * tclk_ns - slack_ns
        first_bad(
            gap_ns < least_ns,
            rises[1:],
            [f"{g} ns between pulses" for g in gap_ns],
            f"{least_ns:.0f} ns",
            (f"F{axis}P",),
        )
        count += len(inside)
    conclusive(count >= LEAST, f"{count} pulses were recorded")
    return f"{count} pulses on a grid of {tick_ns:.1f} ns"


@check("overdrive", "PIK-LAW-10", needs={"line", "head"}, wires=PULSES)
def pulses_keep_their_distance(e: Capture, row: Requirement) -> str:
    """Measure from pulse to pulse of a channel that cannot keep up with its input."""
    tclk_ns = _tclk_ns(e)
    least_ns, seen = row.limit("gap_min_per_tclk") * tclk_ns, []
    slack_ns = ROUNDED_NS + row.limit("tolerance_ns") + e.slack_ns(least_ns)
    for name in PULSES:
        rises = e.wires.rises(name)
        rises = rises[rises > e.wires.start_ns + LAG_NS]
        known = e.wires.known(rises[:-1], rises[1:])
        gaps_ns, at = np.diff(rises)[known], rises[1:][known]
        saw = [f"{g} ns between pulses" for g in gaps_ns]
        first_bad(gaps_ns < least_ns - slack_ns, at, saw, f"{least_ns:.0f} ns", (name,))
        seen += gaps_ns.tolist()
    if not seen or min(seen) > least_ns + 2 * tclk_ns / row.limit("grid_per_tclk"):
        raise Inconclusive(f"pulses {min(seen, default=0)} ns apart: no channel is at its limit")
    return f"{len(seen)} gaps between pulses, {min(seen)} ns and more"


@check("overdrive", "PIK-SAT-01", needs={"can", "head"})
def saturation_is_told(e: Capture, row: Requirement) -> str:
    """Look for SAT and EMCY FF11h while a channel cannot keep up, and for their end."""
    raw = _told(e, "PIK_COUNTS").raw("PIK_COUNTS")
    stamps = unwrap(_told(e, "PIK_TOTAL_Z").raw("PIK_TOTAL_Z")["TSTAMP"], 32) * 1e-6
    sat = np.stack([raw[f"SAT_{a}"] for a in "XYZ"], axis=1)[: len(stamps)]
    code = int(row.limit("emcy_code"))
    found = [(k, t) for k, t in emergencies(e, "PIK_EMCY") if k in (0, code)]
    conclusive(sat.any() or found, "no channel was at its limit")
    if not sat.any() or sat[-1].any() or [k for k, _ in found] != [code, 0]:
        told = [f"{k:04X}h" for k, _ in found]
        raise Failed(f"SAT in {int(sat.any(axis=1).sum())} readings, emergencies {told}", f"{code:04X}h, 0000h")
    last_s = float(stamps[np.flatnonzero(sat.any(axis=1))[-1]])
    took_ms, due_ms = (found[1][1] - last_s) * 1e3, row.limit("ends_ms")
    period_ms = float(np.median(np.diff(stamps))) * 1e3  # the last loss was within the reading before
    if not due_ms - period_ms <= took_ms <= due_ms + row.limit("tolerance_ms"):
        raise Failed(f"it ends {took_ms:.1f} ms after the last reading with SAT", f"{due_ms:g} ms after the last loss")
    return f"SAT in {int(sat.any(axis=1).sum())} readings, FF11h, over {took_ms:.1f} ms after the last of them"


@check("stream", "PIK-CNT-01", needs={"line", "can"}, wires=(*PULSES, "LATCH"))
def counts_are_the_pulses(e: Capture) -> str:
    """Count pulses between falls of LATCH and compare them with the readings."""
    log = e.wires.unbroken()
    latch = log.falls("LATCH")
    conclusive(len(latch) >= LEAST, f"{len(latch)} latches were recorded")
    seen = np.stack([_between(log, f"F{a}P", latch) - _between(log, f"F{a}N", latch) for a in "XYZ"], axis=1)
    raw = _told(e, "PIK_COUNTS").raw("PIK_COUNTS")
    told = np.stack([raw[a] for a in "XYZ"], axis=1)
    for here, there in overlaps(len(seen), len(told)):
        if np.abs((seen[here] - told[there]).cumsum(axis=0)).max() <= 1:
            return f"{len(seen[here])} readings, {np.abs(seen[here]).sum(axis=0).tolist()} pulses on X, Y, Z"
    raise Failed(
        f"{told[:4].tolist()} told", f"{seen[:4].tolist()} seen", at_ns=int(latch[0]), lines=("LATCH", *PULSES)
    )


def _between(log: LineLog, name: str, latch: Ints) -> Ints:
    found: Ints = np.diff(np.searchsorted(log.rises(name), latch, "right"))
    return found


@check("stream", "PIK-CNT-02", needs={"line"}, wires=("LATCH",))
def counters_are_latched_every_period(e: Capture, row: Requirement) -> str:
    """Measure from one fall of LATCH to the next."""
    falls = e.wires.falls("LATCH")
    due_ns, tolerance_ns = row.limit("default_us") * US, row.limit("tolerance_us") * US
    return interval(e, falls[:-1], falls[1:], due_ns, tolerance_ns, "from latch to latch", ("LATCH",))


@check("stream", "PIK-CNT-03", needs={"line"}, wires=("LATCH",))
def latch_is_low_for_its_time(e: Capture, row: Requirement) -> str:
    """Measure the lows of LATCH."""
    down, up = e.wires.pulses("LATCH", 0)
    return interval(e, down, up, row.limit("low_us") * US, row.limit("tolerance_us") * US, "of LATCH low", ("LATCH",))


@check("stream", "PIK-CAN-01", needs={"can"})
def three_messages_make_a_reading(e: Capture) -> str:
    """Follow the messages of each reading."""
    return in_turn(e, MESSAGES)


@check("stream", "PIK-CAN-02", needs={"can"})
def counts_are_differences_of_totals(e: Capture) -> str:
    """Compare PIK_COUNTS with the totals of this reading and the one before."""
    _, n = totals(e)
    raw = _told(e, "PIK_COUNTS").raw("PIK_COUNTS")
    counts = np.stack([raw[a] for a in "XYZ"], axis=1)[: len(n)]
    if (k := first_of((np.diff(n, axis=0) != counts[1 : len(n)]).any(axis=1))) is not None:
        raise Failed(f"counts {counts[k + 1].tolist()}", f"{np.diff(n, axis=0)[k].tolist()}, difference of the totals")
    return f"{len(counts)} readings"


@check("stream", "PIK-CAN-03", needs={"can"})
def readings_are_numbered_and_stamped(e: Capture, row: Requirement) -> str:
    """Look at SEQ and TSTAMP from reading to reading."""
    due = row_for(e, "PIK-CNT-02").limit("default_us")
    seq, stamps = _told(e, "PIK_COUNTS").raw("PIK_COUNTS")["SEQ"], _told(e, "PIK_TOTAL_Z").raw("PIK_TOTAL_Z")["TSTAMP"]
    if (np.diff(seq) % int(row.limit("modulo")) != 1).any():
        raise Failed(f"SEQ {seq[:6].tolist()} ...", "one more each time")
    took = np.diff(unwrap(stamps, 32)) * row.limit("unit_us")
    off = np.abs(took - due).max()
    if off > 2 * row.limit("unit_us") + due * e.clock_ppm * 1e-6:
        raise Failed(f"{took.min():.0f} to {took.max():.0f} us between stamps", f"{due:g} us")
    return f"{len(seq)} readings, {took.min():.0f} to {took.max():.0f} us apart"


@check("stream", "PIK-CAN-04", needs={"can"})
def messages_have_their_lengths(e: Capture) -> str:
    """Look at lengths and at bits without a signal."""
    return as_laid_out(e, MESSAGES)


@check("power_on", "PIK-RES-01", needs={"can"})
def counters_begin_with_res(e: Capture, row: Requirement) -> str:
    """Look at SEQ and the totals of the first reading after Res."""
    period_s = row_for(e, "PIK-CNT-02").limit("default_us") * 1e-6
    raw = _told(e, "PIK_COUNTS", 2).raw("PIK_COUNTS")
    _, n = totals(e, 2)
    seq, counts = int(raw["SEQ"][0]), [int(raw[a][0]) for a in "XYZ"]
    late = late_readings(e, "PIK_HEARTBEAT", "PIK_COUNTS", period_s, period_s)
    if not 1 <= seq <= 1 + late or (seq == 1 and n[0].tolist() != counts):
        raise Failed(f"SEQ {seq}, totals {n[0].tolist()}, counts {counts}", "SEQ 1, totals as the counts")
    each = (n[-1] - n[0]) / (len(n) - 1)  # of inputs that are known to stand still
    if e.inputs_v and np.abs(n[0] - seq * each).max() > row.limit("error_max_pulses"):
        raise Failed(f"totals {n[0].tolist()} in reading {seq}", f"{(seq * each).round(1).tolist()} since Res")
    return f"SEQ {seq}, totals {n[0].tolist()}"


@check("power_on", "PIK-SIG-01", needs={"pins"}, wires=PINS)
def lines_rest_at_their_levels(e: Capture, row: Requirement) -> str:
    """Look at every line before the first pulse or latch that comes when nothing has moved for longer than a pulse."""
    return at_levels(e, PINS, _at_rest_ns(e), row, "at rest", PULSES)


def _at_rest_ns(e: Capture) -> int:
    """An instant at which nothing has moved for longer than a pulse lasts, before one begins. Raises Inconclusive."""
    tclk_ns = _tclk_ns(e)
    moves = np.unique(np.concatenate([edges(e, name) for name in PINS]))
    begins = np.concatenate([*(edges(e, name) for name in PULSES), e.wires.falls("LATCH")])
    still = np.diff(moves, prepend=e.wires.start_ns) > tclk_ns + ROUNDED_NS + e.slack_ns(tclk_ns)
    found = moves[still & np.isin(moves, begins)]
    conclusive(len(found), "no pulse and no latch after Res, or too many for the lines to be at rest")
    return int(found[0]) - 1 - round(e.slack_ns(0.0))


@check("power_cycle", "PIK-SIG-01", needs={"pins", "supply"}, wires=("CLK",))
def the_clock_rests_low(e: Capture, row: Requirement) -> str:
    """Look at CLK while the board has no power: the longest time without an edge of it."""
    ends = e.wires["CLK"].t_ns
    conclusive(len(ends) >= 3, "CLK does not move")
    k = int(np.argmax(np.diff(ends)))
    still_ns = int(ends[k + 1] - ends[k])
    conclusive(still_ns >= 2 * _tclk_ns(e), f"CLK moves on: {still_ns} ns without an edge at most")
    level, due = int(e.wires["CLK"].level[k]), int(row.limits.get("clk_level", 0))
    expect(level == due, f"CLK {level} for {still_ns} ns", f"{due} at rest", at_ns=int(ends[k]), lines=("CLK",))
    return f"CLK {level} for {still_ns} ns without power"
