"""Frame forms, sample modes and SYNC of PSA-2 and PSA-1 on CAN."""

from __future__ import annotations

import itertools

import numpy as np

from psabench.boards.objects import Psa2Objects as OD
from psabench.boards.psa2.conform.capture_can import STAMP_BITS, pairs, segment
from psabench.boards.psa2.conform.check_serial import LEAST
from psabench.boards.psa2.conform.check_stream import MESSAGES, US, number, unit_us
from psabench.boards.psa2.conform.stimulus_can import Answer
from psabench.conform.capture.intervals import fact
from psabench.conform.capture.log import CanLog, Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, conclusive, damaged_data_are, expect, none_of
from psabench.link import signals
from psabench.link.protocol_files import message
from psabench.link.signals import Floats, Ints

PULSED = ("SYNC_A", "DRD_A")

# ---- frame forms


def _form(e: Capture, form: int, name: str, least: int = LEAST) -> CanLog:
    """The frames of a form, and no others of the stream. Raises Failed, Inconclusive."""
    answer = e.facts.get(f"answer {form}")
    expect(answer == Answer(), f"form {form} answered by {answer}", "it is taken")
    part = segment(e, f"form {form}", f"form {form} end")
    log = part.frames_of(name)
    other = [
        f for n in MESSAGES if n != name and not (form == 0 and n in MESSAGES[:2]) for f in part.frames_of(n).frames
    ]
    expect(not other, f"{len(other)} frames of another form", f"{name} alone", frames=other[:5])
    expect(len(log) >= least, f"{len(log)} frames {name}", "one a sample", frames=part.can.frames[:10])
    due = int(message(name).length)
    bad = [f for f in log.frames if len(f.data) != due]
    none_of(bad, lambda f: f"{name} of {len(f.data)} bytes", f"{due}", frames=bad[:3])
    return log


@check("forms", "PSA2-FORM-01")
def the_fast_form_drops_bits(e: Capture, row: Requirement) -> str:
    """Compare the codes of form 1 with those of form 0 at the same inputs."""
    raw = _form(e, 1, "PSA2_FAST").raw("PSA2_FAST")
    pair = pairs(segment(e, "form 0", "form 0 end"))
    fast = np.stack([raw[a] for a in "XYZ"], axis=1)
    for k in range(3):
        lo, hi = np.percentile(pair.code[:, k], (10, 90)).astype(int)
        # noise of one stay beside that of the other
        around = int(row.limit("noise_factor") * (hi - lo) + row.limit("noise_codes"))
        due = (lo - around) >> int(row.limit("shift_bits")), (hi + around) >> int(row.limit("shift_bits"))
        bad = (fast[:, k] < due[0]) | (fast[:, k] > due[1])
        if bad.sum() > len(bad) * (0.0 if e.variant["gate_sclk"] else row.limit("damaged_max_share")):
            raise Failed(
                f"{'XYZ'[k]} {fast[bad, k][0]}",
                f"{due[0]} to {due[1]}, codes of form 0 shifted by 3 bits",
                frames=_form(e, 1, "PSA2_FAST").frames[:3],
            )
        sound = (pair.code[:, k] >= lo - around) & (pair.code[:, k] <= hi + around)
        step = 1 << int(row.limit("shift_bits"))
        off, error = _apart(fast[~bad, k] + 0.5, pair.code[sound, k] / step)
        if abs(off) > max(row.limit("mean_max_codes"), row.limit("sigmas") * error):
            raise Failed(f"{'XYZ'[k]} {off:+.2f} codes from the middle of its step", "rounded towards minus infinity")
    return f"{len(fast)} frames, X, Y, Z those of form 0 shifted"


def _apart(a: Floats, b: Floats) -> tuple[float, float]:
    """Mean of a less that of b, and its standard error."""
    return float(a.mean() - b.mean()), float(np.sqrt(a.var() / len(a) + b.var() / len(b)))


@check("forms", "PSA2-FORM-02")
def tog_alternates(e: Capture) -> str:
    """Follow TOG through the frames of form 1."""
    log = _form(e, 1, "PSA2_FAST")
    tog = log.raw("PSA2_FAST")["TOG"]
    bad = np.flatnonzero(np.diff(tog) == 0)
    if len(bad):
        raise Failed(f"TOG {tog[bad[0]]} twice", "0 and 1 in turn", frames=log.frames[bad[0] : bad[0] + 3])
    return f"TOG alternates in {len(tog)} frames"


def _fd(log: CanLog, name: str) -> None:
    classic = [f for f in log.frames if not f.fd]
    expect(not classic, f"{name} in a classic frame", "an FD frame", frames=classic[:3])
    slow = [f for f in log.frames if f.brs is False]
    expect(not slow, f"{name} without bit rate switch", "with it", frames=slow[:3])


@check("forms", "PSA2-FORM-03", needs={"fd"})
def form_2_is_one_fd_frame_a_sample(e: Capture, row: Requirement) -> str:
    """Look at the frames of form 2: form, length, time stamps."""
    log = _form(e, 2, "PSA2_FRAME")
    _fd(log, "PSA2_FRAME")
    return f"{len(log)} FD frames, {_evenly(e, row, log.raw('PSA2_FRAME')['TSTAMP'], 1)}"


@check("forms", "PSA2-FORM-04", needs={"fd"})
def form_3_is_one_fd_frame_every_five_samples(e: Capture, row: Requirement) -> str:
    """Look at the frames of form 3: form, length, time stamps."""
    log = _form(e, 3, "PSA2_BLOCK")
    _fd(log, "PSA2_BLOCK")
    samples = int(row.limit("samples_count"))
    return f"{len(log)} FD frames, {_evenly(e, row, log.raw('PSA2_BLOCK')['TSTAMP'], samples)}"


def _evenly(e: Capture, row: Requirement, stamp_us: Ints, samples: int) -> str:
    """Time stamps, us, so many samples apart. Raises Failed."""
    step = np.diff(signals.unwrap(stamp_us, 32))
    due = samples * row_for(e, "PSA2-READ-06").limit("period_us")
    slack_us = row.limit("tolerance_us") + e.slack_ns(due * 1e3) * 1e-3
    if (np.abs(step - due) > slack_us).any():
        raise Failed(f"{step[np.argmax(np.abs(step - due))]} us from frame to frame", f"{due:.0f} us")
    return f"{due:.0f} us apart"


@check("forms", "PSA2-FORM-04", needs={"fd"})
def the_stamp_of_a_block_is_that_of_its_first_sample(e: Capture, row: Requirement) -> str:
    """Read 2202h:5, the stamp of the latest sample, once a block has come: its last sample or a later one."""
    apart_us = (row.limit("samples_count") - 1) * row_for(e, "PSA2-READ-06").limit("period_us")
    least_us = apart_us - row.limit("tolerance_us") - e.slack_ns(apart_us * 1e3) * 1e-3
    found = []
    for answer, came in fact(e, "latest", "no stamp was read after a block"):
        with damaged_data_are(Failed, "messages of their length", frames=e.can.frames[came - 1 : came]):
            stamps = CanLog(frames=e.can.frames[came - 1 : came]).raw("PSA2_BLOCK")["TSTAMP"]
        found += [(number(answer) - int(stamp)) % (1 << 32) for stamp in stamps]
    conclusive(found, "no block came")
    due = f"{apart_us:.0f} us or more: the first of its samples"
    expect(least_us <= min(found) <= max(found) < 1 << 31, f"TSTAMP {min(found)} us before the latest sample", due)
    return f"TSTAMP {min(found)} to {max(found)} us before the latest sample"


@check("forms", "PSA2-FORM-05", needs={"fd"})
def a_block_begins_anew_after_a_stop(e: Capture) -> str:
    """Stop the stream and start it: is the first sample of the block one after the start?"""
    stamps = fact(e, "stamps", "the scene started no stream again")
    for k, stamp in enumerate(stamps):
        log = segment(e, f"again {k}", f"again {k} end").frames_of("PSA2_BLOCK")
        expect(len(log), "no block after the start", "one every five samples")
        with damaged_data_are(Failed, "messages of their length", frames=log.frames[:1]):
            before_us, first_us = number(stamp), int(log.raw("PSA2_BLOCK")["TSTAMP"][0])
        if (first_us - before_us) % (1 << 32) >= 1 << 31 or first_us == before_us:
            saw = f"a sample of {first_us} us in the first block"
            raise Failed(saw, f"after {before_us} us", frames=log.frames[:1])
    return f"in {len(stamps)} starts the first sample of the first block comes after the stop"


@check("forms", "PSA2-FORM-06")
def a_form_switches_its_tpdos(e: Capture, row: Requirement) -> str:
    """Read bit 31 of the TPDOs in each form."""
    mask = int(row.limit("off_mask"))
    sends = {0: (0, 1), 1: (2,), 2: (4,), 3: (3,)}
    for form, on in sends.items():
        for k, a in enumerate(fact(e, f"off {form}", "the scene read no TPDOs")):
            saw = f"{OD.TPDO + k:04X}h:1 {number(a):08X}h in form {form}"
            expect(bool(number(a) & mask) != (k in on), saw, f"bit 31 {'clear' if k in on else 'set'}")
    return "bit 31 clear for what each form sends, set for the others"


@check("forms", "PSA2-FORM-08", needs={"fd"})
def fd_frames_are_those_of_two_forms(e: Capture) -> str:
    """Look at the form of every frame."""
    fd = {int(message(n).frame_id) - 5 + e.node for n in ("PSA2_FRAME", "PSA2_BLOCK")}
    wrong = [f for f in e.can.frames if f.fd and f.can_id not in fd]
    none_of(wrong, lambda f: f"{f.can_id:03X}h in an FD frame", "PSA2_FRAME and PSA2_BLOCK only", frames=wrong[:3])
    return f"{sum(f.fd for f in e.can.frames)} FD frames of {len(e.can)}, all of the two forms"


# ---- sample modes


@check("sync", "PSA2-SAMP-02")
def each_sync_takes_one_sample(e: Capture, row: Requirement) -> str:
    """Send SYNC frames in sample mode 1: one sample each, sampled at or after it."""
    cuts = [f"SYNC {k}" for k in range(10)] + ["SYNC end"]
    for a, b in itertools.pairwise(cuts):
        part = segment(e, a, b)
        n = len(part.frames_of("PSA2_XY"))
        expect(n == 1, f"{n} samples after a SYNC", "one", frames=part.can.frames[:10])
    begin = segment(e, cuts[0], cuts[-1])
    p = pairs(begin, LEAST)
    gaps = p.steps
    far = e.facts.get("paced", True) and (gaps > int(row.limit("apart_max_frames"))).any()
    expect(not (gaps < 1).any() and not far, f"SEQ {p.seq.tolist()}", "rising, one for each SYNC", frames=p.frames)
    return f"one sample for each of {len(p)} SYNCs"


@check("sync", "PSA2-SAMP-02", needs={"lockstep"})
def a_sample_of_a_sync_is_not_older_than_it(e: Capture, row: Requirement) -> str:
    """Compare TSTAMP with the instant at which SYNC was sent."""
    wrap_us = unit_us(e) * (1 << STAMP_BITS)
    for k in range(10):
        p = pairs(segment(e, f"SYNC {k}", f"SYNC {k + 1}" if k < 9 else "SYNC end"), 1)
        since = (p.stamp[0] * unit_us(e) - e.marks[f"SYNC {k}"] / US) % wrap_us
        most_us = row.limit("after_max_us")
        if since > most_us:
            raise Failed(f"a sample {wrap_us - since:.0f} us before its SYNC", "at or after it", frames=p.frames)
    return "every sample at or after its SYNC, within a period"


@check("rates", "PSA2-SAMP-03")
def every_nth_frame_is_sent(e: Capture) -> str:
    """Sample mode 2 with N = 4: SEQ of what comes, at every data rate."""
    seen = 0
    for dr in range(5):
        part = segment(e, f"DR {dr}", f"DR {dr} end")
        p = pairs(part, 3)
        if (p.seq % 4).any() or (p.steps != 4).any():
            raise Failed(f"SEQ {p.seq[:6].tolist()}", "multiples of 4, each", frames=p.frames[:6])
        seen += len(p)
    return f"{seen} samples, SEQ a multiple of 4"


@check("rates", "PSA2-READ-08")
def the_frame_period_follows_dr(e: Capture, row: Requirement) -> str:
    """Write CONFIG0 with each DR and measure TSTAMP against SEQ."""
    said = []
    for dr in range(5):
        if e.facts.get(f"answer {dr}") != Answer():
            raise Failed(f"CONFIG0 with DR {dr:03b} answered by {e.facts.get(f'answer {dr}')}", "it is taken")
        p = pairs(segment(e, f"DR {dr}", f"DR {dr} end"), 3)
        frames = int(p.steps.sum())
        expect(frames > 0, f"SEQ {p.seq.tolist()}", "it rises", frames=p.frames[:4])
        period_us = float(p.stamp[-1] - p.stamp[0]) * unit_us(e) / frames
        due_us = row.limit(f"dr_{dr:03b}_us")
        slack_us = e.slack_ns(due_us * 1e3) * 1e-3 + unit_us(e) / frames
        if abs(period_us - due_us) > slack_us:
            raise Failed(f"{period_us:.3f} us with DR {dr:03b}", f"{due_us} +- {slack_us:.3f} us", frames=p.frames[:4])
        said.append(f"{period_us:.2f}")
    return f"{', '.join(said)} us"


@check("sync", "PSA2-SAMP-04")
def sync_starts_the_filters_anew(e: Capture, row: Requirement) -> str:
    """SYNC with 2024h = 1: the pause in TSTAMP, and SEQ after it."""
    ended = len(segment(e, "pulse", "pulse end").frames_of("PSA2_ZT"))
    p = pairs(segment(e, "SYNC end", "pulse end"), LEAST)
    p = p.where(np.arange(len(p)) >= len(p) - ended - 1)  # from the last whole sample before the pulse on
    pause_ms = np.diff(p.stamp) * unit_us(e) * 1e-3
    k = int(np.argmax(pause_ms))
    period_ms = row_for(e, "PSA2-READ-06").limit("period_us") * 1e-3
    lo, hi = row.limit("settling_min_ms"), row.limit("settling_max_ms") + period_ms
    expect(lo <= pause_ms[k] <= hi, f"the longest pause is {pause_ms[k]:.3f} ms", f"{lo} to {hi} ms", frames=p.about(k))
    p.unbroken()
    return f"a pause of {pause_ms[k]:.3f} ms, SEQ goes on"


@check("sync", "PSA2-SAMP-04", needs={"pins"})
def sync_pulses_sync_a(e: Capture, row: Requirement) -> str:
    """SYNC with 2024h = 1: the pulse on SYNC_A, and the fall of DRD_A after it."""
    up = _pulses(e, 1, "one, for the SYNC with 2024h = 1")
    falls = e.wires.falls("DRD_A")
    later = falls[falls > up[0]]
    settled_ms = (float(later[0]) - float(up[0])) * 1e-6 if len(later) else np.inf
    slack_ms = e.slack_ns(settled_ms * 1e6) * 1e-6 if len(later) else 0.0
    lo, hi = row.limit("settling_min_ms"), row.limit("settling_max_ms")
    saw, due = f"DRD_A falls {settled_ms:.3f} ms after SYNC_A", f"{lo} to {hi} ms"
    expect(lo - slack_ms <= settled_ms <= hi + slack_ms, saw, due, at_ns=int(up[0]), lines=PULSED)
    return f"SYNC_A, then DRD_A {settled_ms:.4f} ms later"


def _pulses(e: Capture, due: int, words: str) -> Ints:
    """Rises (n,) of SYNC_A, as many as are due. Raises Failed."""
    up, _ = e.wires.pulses("SYNC_A", 1)
    at_ns = int(up[0]) if len(up) else e.wires.end_ns
    expect(len(up) == due, f"{len(up)} pulses on SYNC_A", words, at_ns=at_ns, lines=PULSED)
    return up


@check("rates", "PSA2-CHIP-04", needs={"pins"})
def filters_settle_in_their_time_at_each_rate(e: Capture, row: Requirement) -> str:
    """Pulse SYNC_A at each data rate and measure the next fall of DRD_A."""
    up, falls = _pulses(e, 5, "one at each of five data rates"), e.wires.falls("DRD_A")
    said = []
    for dr, at in enumerate(up):
        earlier, later = falls[falls < at][-1 - LEAST :], falls[falls > at]
        if len(earlier) <= LEAST or not len(later):
            raise Failed(f"DRD_A stands still with DR {dr:03b}", "it falls", at_ns=int(at), lines=PULSED)
        period_ns = (
            float(earlier[-1] - earlier[0]) / LEAST
        )  # in the board's own clock: no crystal is off against itself
        period_tclk = row.limit("fclk_hz") * row_for(e, "PSA2-READ-08").limit(f"dr_{dr:03b}_us") * 1e-6
        saw_tclk = float(later[0] - at) / period_ns * period_tclk
        due_tclk = row.limit("settling_periods") * period_tclk + row.limit("settling_tclk")
        edge_tclk = e.slack_ns(0.0) / period_ns * period_tclk
        slack_tclk = row.limit("tolerance_tclk") + edge_tclk * (1.0 + row.limit("settling_periods") / LEAST)
        saw, due = f"{saw_tclk:.2f} tCLK with DR {dr:03b}", f"{due_tclk:.2f} +- {slack_tclk:.2f} tCLK"
        expect(abs(saw_tclk - due_tclk) <= slack_tclk, saw, due, at_ns=int(at), lines=PULSED)
        said.append(f"{saw_tclk:.1f}")
    return f"{', '.join(said)} tCLK"
