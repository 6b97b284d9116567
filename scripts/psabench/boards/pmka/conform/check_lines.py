"""PMKA on its lines: sampling, resets, keys, what its bus shows (article, section 3)."""

from __future__ import annotations

import numpy as np

from psabench.boards.pmka.conform.capture_readings import columns
from psabench.conform.capture.intervals import after, at_levels, bus_word, first_bad, interval, nearest, wires_needed
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, expect
from psabench.link.signals import Ints

KEYS = ("KL1", "KL2", "KL3", "KL4")
MUX = ("MUX0", "MUX1")
RESETS = tuple(f"R{sign}{k}" for k in range(1, 5) for sign in "PN")
TAU = ("TAU0", "TAU1", "TAU2")
ADDRESS, DATA = tuple(f"AB{k}" for k in range(4)), tuple(f"D{k}" for k in range(16))
PINS = (*KEYS, *TAU, *RESETS, "SH", "CONV", *MUX, "CS", "RW", *ADDRESS, *DATA)
SAMPLE = ("SH", "CONV", *MUX)
US = 1e3
LEAST = 8
SPARE = 3


def samples(e: Capture, least: int = LEAST) -> tuple[Ints, Ints]:
    """Instants of the rises of SH and the integrator that each samples: MUX just before it. Raises Inconclusive."""
    wires_needed(e, "SH", *MUX)
    log = e.wires.unbroken()
    rises = log.rises("SH")
    pause_ns = row_for(e, "PMKA-SAMP-01").limit("ts_us") * US / 2
    begins = np.flatnonzero(np.diff(rises, prepend=log.start_ns) > pause_ns)  # what comes before is a part of a reading
    rises = rises[int(begins[0]) :] if len(begins) else rises[:0]
    conclusive(len(rises) >= 4 * least, f"{len(rises)} samples were recorded; expected {4 * least}")
    return rises, bus_word(e, "MUX", 2, rises - 1 - round(e.slack_ns(0.0)))


@check("stream", "PMKA-SAMP-01", needs={"line"})
def integrators_are_sampled_every_ts(e: Capture, row: Requirement) -> str:
    """Measure from one sample of an integrator to its next."""
    rises, which = samples(e)
    period_ns = row.limit("ts_us") * US
    tolerance_ns = period_ns * row.limit("clock_error_ppm") * 1e-6
    seen = []
    for k in range(4):
        mine = rises[which == k]
        seen.append(
            interval(e, mine[:-1], mine[1:], period_ns, tolerance_ns, f"between samples of {'XYZK'[k]}", SAMPLE)
        )
    return seen[0]


@check("stream", "PMKA-SAMP-02", needs={"line"})
def four_samples_follow_one_another(e: Capture, row: Requirement) -> str:
    """Follow MUX from X to K and measure the steps."""
    rises, which = samples(e)
    due = np.arange(len(which)) % 4
    first_bad(which != due, rises, [f"{'XYZK'[w]} sampled" for w in which], "X, Y, Z, K in turn", SAMPLE)
    n = len(rises) // 4 * 4
    groups = rises[:n].reshape(-1, 4)
    a, b = groups[:, :-1].reshape(-1), groups[:, 1:].reshape(-1)
    return interval(e, a, b, row.limit("step_us") * US, row.limit("tolerance_us") * US, "from sample to sample", SAMPLE)


@check("stream", "PMKA-SAMP-03", needs={"pins"}, wires=SAMPLE)
def samples_are_held_and_converted(e: Capture, row: Requirement) -> str:
    """Measure SH, and CONV from it."""
    up, down = e.wires.pulses("SH", 1)
    begin, end = after(e.wires.rises("CONV"), up - 1), after(e.wires.falls("CONV"), up)
    conclusive(len(up) >= LEAST, f"{len(up)} samples were recorded")
    tolerance_ns, hold_ns = row.limit("tolerance_us") * US, row.limit("hold_us") * US
    interval(e, up, begin, row.limit("convert_from_us") * US, tolerance_ns, "from SH to CONV", SAMPLE)
    interval(e, up, end, hold_ns, tolerance_ns, "from SH to the end of CONV", SAMPLE)
    return interval(e, up, down, hold_ns, tolerance_ns, "of SH high", SAMPLE)


@check("stream", "PMKA-RST-02", needs={"pins"}, wires=RESETS)
def resets_last_half_a_period(e: Capture, row: Requirement) -> str:
    """Measure RP1 to RN4, and compare their begin with the samples of their integrators."""
    rises, which = samples(e)
    tolerance_ns, seen, count = row.limit("tolerance_us") * US, "", 0
    for k in range(4):
        mine = rises[which == k]
        for sign in "PN":
            name = f"R{sign}{k + 1}"
            up, down = e.wires.pulses(name, 1)
            if not len(up):
                continue
            count += len(up)
            seen = interval(e, up, down, row.limit("reset_us") * US, tolerance_ns, f"of {name} high", (name, *SAMPLE))
            interval(e, nearest(mine, up), up, 0.0, tolerance_ns, f"from the sample to {name}", (name, *SAMPLE))
    conclusive(count >= LEAST, f"{count} resets were recorded")
    return f"{count} resets; {seen}"


@check("stream", "PMKA-RST-05", needs={"pins", "can"}, wires=RESETS)
def resets_are_told_with_their_signs(e: Capture) -> str:
    """Count positive and negative resets of each integrator on the lines and in the readings."""
    c = columns(e)
    seen = []
    for k, name in enumerate("XYZK"):
        for sign, wire in ((1, f"RP{k + 1}"), (-1, f"RN{k + 1}")):
            told, real = int((c[f"RESET_{name}"] == sign).sum()), len(e.wires.rises(wire))
            expect(abs(told - real) <= 1, f"{told} resets of sign {sign} of {name} told", f"{real} on {wire}")
            seen.append(real)
    conclusive(sum(seen) >= LEAST, f"{sum(seen)} resets were recorded")
    return f"{sum(seen)} resets on the lines, as many told"


@check("stream", "PMKA-CAL-01", needs={"pins"}, wires=(*KEYS, *RESETS))
def a_calibrated_integrator_is_off_its_sensor(e: Capture) -> str:
    """Look for alternating resets, which only a calibration makes, while the key is closed."""
    off, ts_ns = 0, row_for(e, "PMKA-SAMP-01").limit("ts_us") * US
    for k, key in enumerate(KEYS):
        both = np.sort(np.concatenate([e.wires.rises(f"RP{k + 1}"), e.wires.rises(f"RN{k + 1}")]))
        signs = np.isin(both, e.wires.rises(f"RP{k + 1}"))
        turns = both[1:][(signs[1:] != signs[:-1]) & (np.diff(both) < 1.5 * ts_ns)]  # no input turns as fast
        level = e.wires[key].at(turns)
        bad = level == 1
        first_bad(bad, turns, f"{key} closed while it is calibrated", "open", (key, f"RP{k + 1}", f"RN{k + 1}"))
        off += int((level == 0).sum())
    conclusive(off, "no calibration of resets in the recording")
    return f"{off} resets in turn, all with the key open"


@check("stream", "PMKA-ROT-04", needs={"line"}, wires=KEYS)
def three_keys_are_closed_at_any_instant(e: Capture) -> str:
    """Count closed keys at every edge, and half a microsecond after."""
    at_ns = np.unique(np.concatenate([e.wires[k].t_ns for k in KEYS])) + round(e.slack_ns(0.0))
    closed = sum((e.wires[k].at(at_ns).astype(np.int64) for k in KEYS), np.zeros(len(at_ns), np.int64))
    first_bad(closed != 3, at_ns, [f"{n} keys closed" for n in closed], "3: an integrator for each axis", KEYS)
    conclusive(len(at_ns) >= 4, "no hand-over in the recording")
    return f"{len(at_ns) - 1} moves of keys, three closed at any instant"


@check("stream", "PMKA-ROT-05", needs={"pins"}, wires=KEYS)
def keys_move_about_the_sample_of_the_spare(e: Capture, row: Requirement) -> str:
    """Measure from each closing of a key to the sample of K."""
    rises, which = samples(e)
    spare = rises[which == SPARE]
    gap_ns, tolerance_ns = row.limit("gap_us") * US, row.limit("tolerance_us") * US
    homes = np.sort(np.concatenate([e.wires.rises(k) for k in KEYS[:SPARE]]))
    takes = e.wires.rises(KEYS[SPARE])
    # K goes from one axis to the next without its key being seen to move: the other's opening tells it.
    leaves = np.sort(np.concatenate([e.wires.falls(k) for k in KEYS[:SPARE]]))
    seen = interval(
        e, homes, nearest(spare, homes), gap_ns, tolerance_ns, "from an axis' return to the sample of K", KEYS
    )
    interval(
        e, nearest(spare, leaves), leaves, gap_ns, tolerance_ns, "from the sample of K to the next hand-over", KEYS
    )
    if len(takes):
        interval(e, nearest(spare, takes), takes, gap_ns, tolerance_ns, "from the sample of K to its key", KEYS)
    return seen


@check("strobes", "PMKA-BUS-01", needs={"pins", "bus"}, wires=("CS", "RW", *ADDRESS, *DATA))
def cycles_are_on_the_bus(e: Capture) -> str:
    """Compare address, R/W and data of each strobe with the cycles that were made."""
    begin, end = e.wires.pulses("CS", 0)
    if len(begin) != len(e.cycles) or not len(begin):
        raise Failed(
            f"{len(begin)} strobes on CS", f"{len(e.cycles)} cycles", at_ns=int(begin[0]) if len(begin) else None
        )
    at = begin + round(e.slack_ns(0.0))
    seen = np.stack(
        [bus_word(e, "AB", 4, at), bus_word(e, "D", 16, at), 1 - e.wires["RW"].at(at).astype(np.int64)], axis=1
    )
    due = np.array([[c.address, c.data, int(c.write)] for c in e.cycles], np.int64)
    saw = [f"address {a:X}h, data {d:04X}h, {'write' if w else 'read'}" for a, d, w in seen]
    first_bad((seen != due).any(axis=1), begin, saw, "as the cycle was", ("CS", "RW", *ADDRESS))
    rest = end + round(e.slack_ns(0.0))
    moved = (bus_word(e, "AB", 4, rest) | bus_word(e, "D", 16, rest)) != 0
    first_bad(moved & (e.wires["CS"].at(rest) == 1), end, "address or data not 0 after the strobe", "0", ("CS",))
    return f"{len(begin)} cycles on CS, RW, AB0..AB3 and D0..D15"


@check("power_on", "PMKA-SIG-01", needs={"pins"}, wires=PINS)
def lines_rest_at_their_levels(e: Capture, row: Requirement) -> str:
    """Look at every line before the first sample after Res."""
    rises, _ = samples(e, 1)
    at = int(rises[0]) - 1 - round(e.slack_ns(0.0))
    return at_levels(e, PINS, at, row, "before the first sample", ("SH",))


@check("power_on", "PMKA-ERR-02", needs={"pins"}, wires=(*RESETS, *TAU))
def res_ends_resets(e: Capture) -> str:
    """Look at RP1 to RN4 and the beat between Res and the first sample."""
    rises, which = samples(e, 1)
    for name in (*RESETS, *TAU):
        if int(e.wires[name].at(int(rises[0]) - 1 - round(e.slack_ns(0.0)))):
            raise Failed(f"{name} high before the first sample", "low", at_ns=int(rises[0]), lines=(name, "SH"))
    expect(int(which[0]) == 0, f"{'XYZK'[int(which[0])]} sampled first", "X", at_ns=int(rises[0]), lines=SAMPLE)
    return "no reset, beat 0, X sampled first"
