"""Codes of PSA-2 and PSA-1 against what lies at the inputs: scale, sign, limits, filter, noise, temperatures."""

from __future__ import annotations

import numpy as np

from psabench.boards.psa2.conform.capture_can import Pairs, pairs, segment
from psabench.boards.psa2.conform.check_serial import LEAST
from psabench.boards.psa2.conform.check_stream import number
from psabench.boards.psa2.conform.stimulus_can import FACTOR, OFFSET, Answer
from psabench.conform.capture.intervals import fact, first_of
from psabench.conform.capture.log import Capture
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement
from psabench.conform.verdict import Failed, Inconclusive, conclusive, expect, none_of
from psabench.link.signals import Floats

AXES = "xyz"
ZERO_K = 273.15


def _inputs(e: Capture) -> dict[int, float]:
    """Volts by number of the axis. Raises Inconclusive where none are known."""
    found = {k: e.inputs_v[a] for k, a in enumerate(AXES) if a in e.inputs_v}
    conclusive(found, "the volts at the inputs are not known")
    return found


@check("quiet", "PSA2-ADC-01", "PSA1-ADC-01", needs={"inputs"})
def codes_are_volts(e: Capture) -> str:
    """Compare the mean code of each axis with the volts at its load."""
    p, row = pairs(e, 100), row_for(e, "PSA2-ADC-01")
    said = []
    for k, volt_v in _inputs(e).items():
        saw = float(np.median(p.code[:, k]))
        due = volt_v * 1e6 / row.limit("code_uv") * row.limit("filter_gain")
        slack = abs(due) * row.limit("tolerance_pct") / 100 + row.limit("tolerance_codes")
        if abs(saw - due) > slack:
            raise Failed(f"{'XYZ'[k]} {saw:.0f} at {volt_v:g} V", f"{due:.0f} +- {slack:.0f}", frames=p.about(0))
        said.append(f"{'XYZ'[k]} {saw:.0f} at {volt_v:g} V")
    return ", ".join(said)


@check("quiet", "PSA2-ADC-02", needs={"inputs"})
def codes_have_the_sign_of_the_volts(e: Capture, row: Requirement) -> str:
    """Compare signs."""
    p = pairs(e)
    least = row.limit("least_v")
    seen = {k: v for k, v in _inputs(e).items() if abs(v) >= least}
    conclusive(seen, f"no input is {least:g} V or more from zero")
    for k, volt_v in seen.items():
        code = np.median(p.code[:, k])
        saw = f"{'XYZ'[k]} {code:.0f} at {volt_v:g} V"
        expect(np.sign(code) == np.sign(volt_v), saw, "the same sign", frames=p.about(0))
    return f"{len(seen)} axes of the sign of their input"


def _settled(e: Capture, name: str, least: int = LEAST) -> Pairs:
    """The samples of a part of stimulus "numbers", whose writes must have been taken."""
    refused = [a for a in fact(e, name) if a != Answer()]
    none_of(refused, lambda a: f"a write of OFC or FSC answered by {a.abort:08X}h", "it is taken")
    return pairs(segment(e, name, f"{name} end"), least)


@check("numbers", "PSA2-CHIP-05")
def ofc_and_fsc_act_as_they_should(e: Capture, row: Requirement) -> str:
    """Write an offset and a factor, and compare the codes with those before."""
    before = _settled(e, "as it was")
    raw = before.code[_sound(e, before)]
    unity = row.limit("fsc_unity_code")
    said = []
    for name, factor in (("offset", 1.0), ("factor", FACTOR / unity)):
        p = _settled(e, name)
        saw = p.code[_sound(e, p)]
        due = (raw.mean(axis=0) - OFFSET) * factor
        noise = np.maximum(raw.std(axis=0), 1.0) * max(1.0, factor) * row.limit("noise_max_sigma")
        slack = row.limit("tolerance_codes") + noise * np.sqrt(1 / len(raw) + 1 / len(saw))
        off = np.abs(saw.mean(axis=0) - due)
        if (off > slack).any():
            k = int(np.argmax(off - slack))
            raise Failed(
                f"{'XYZ'[k]} {saw[:, k].mean():.1f} with {name}",
                f"{due[k]:.1f} +- {slack[k]:.1f}",
                frames=_settled(e, name).frames[:3],
            )
        said.append(f"{name}: off by {off.max():.1f} codes at most")
    return ", ".join(said)


@check("numbers", "PSA2-ADC-03", needs={"inputs"})
def clip_tells_of_any_axis(e: Capture, row: Requirement) -> str:
    """Drive one axis beyond full scale, the others not: the code of that one at its limit, and CLIP."""
    said = []
    alone = fact(e, "alone")
    if set(alone) != {"one high", "one low"}:
        raise Inconclusive("the inputs of the three axes lie too near to each other for one to be driven beyond alone")
    for name, limit in (("one high", "code_max"), ("one low", "code_min")):
        p, axis, due = _settled(e, name), alone[name], int(row.limit(limit))
        others = np.delete(p.code, axis, axis=1)
        bad = (p.code[:, axis] != due) | (others == due).any(axis=1) | ~p.clip
        if (k := first_of(bad)) is not None:
            raise Failed(f"{p.code[k]}, CLIP {int(p.clip[k])}", f"{'XYZ'[axis]} {due} and CLIP 1", frames=p.about(k))
        said.append(f"{'XYZ'[axis]} {due}")
    return f"{', then '.join(said)} alone at its limit, with CLIP"


@check("numbers", "PSA2-ADC-03")
def codes_stop_at_their_limits(e: Capture, row: Requirement) -> str:
    """Drive the codes beyond full scale, either way, by OFC and FSC: the code at its limit, CLIP, no wrap."""
    if _settled(e, "as it was").clip.any():
        raise Failed("CLIP at an input within range", "0", frames=_settled(e, "as it was").frames[:3])
    for name, limit in (("high", "code_max"), ("low", "code_min")):
        p, due = _settled(e, name), int(row.limit(limit))
        bad = (p.code != due).any(axis=1) | ~p.clip
        if (k := first_of(bad)) is not None:
            raise Failed(f"{p.code[k]}, CLIP {int(p.clip[k])}", f"{due} and CLIP 1", frames=p.about(k))
    return f"{int(row.limit('code_max'))} and {int(row.limit('code_min'))}, with CLIP"


# ---- the filter, by the step that a change of the gain makes


def _step(e: Capture) -> tuple[Pairs, int, Floats]:
    """Samples, number of the first that the change reached, and the step response of each axis, 0 to 1.

    Raises Failed where the codes do not change, Inconclusive where too few came.
    """
    expect(fact(e, "answer") == Answer(), f"CONFIG1 answered by {fact(e, 'answer').abort:08X}h", "it is taken")
    p = pairs(e, 200)
    tail = np.median(p.code[-50:], axis=0)
    head = np.median(p.code[:50], axis=0)
    swing = tail - head
    row = row_for(e, "PSA2-REG-08")
    saw, moved = f"codes {head.round()} before, {tail.round()} after", np.abs(swing) >= row.limit("swing_min_codes")
    expect(moved.all(), saw, "another gain shows in all codes", frames=p.about(0))
    y = (p.code - head) / swing
    moved = np.abs(p.code - head) > row.limit("moved_min_sigma") * np.maximum(p.code[:50].std(axis=0), 1.0)
    first = int(np.argmax(moved.any(axis=1)))
    return p, first, y


@check("gain", "PSA2-ADC-06")
def a_step_settles_in_its_time(e: Capture, row: Requirement) -> str:
    """Change the gain while frames flow: after how many frames do the codes stand?"""
    p, first, y = _step(e)
    due = int(row.limit("settling_max_frames"))
    swing = np.abs(p.code[-50:].mean(axis=0) - p.code[:50].mean(axis=0))
    noise = row.limit("noise_max_sigma") * p.code[-50:].std(axis=0)
    off = np.abs(y - 1.0) * swing
    late = off[first + due :] > noise + row.limit("settled_ppm") * 1e-6 * swing
    if late.any():
        k = first + due + int(np.flatnonzero(late.any(axis=1))[0])
        raise Failed(
            f"off by {off[k].max():.0f} codes after {k - first} frames", f"settled after {due}", frames=p.about(k)
        )
    half = int(np.argmax(y[:, 0] > 0.5)) - first
    if half > row.limit("half_max_frames"):
        due_half = f"at most {int(row.limit('half_max_frames'))}, as the minimum-phase filter"
        raise Failed(f"half of the step after {half} frames", due_half, frames=p.about(first + half))
    early = np.abs(y[first + int(row.limit("moving_min_frames"))] - 1.0)
    if (early < row.limit("settled_ppm") * 1e-6).all():
        raise Failed("settled at once", "as a filter does", frames=p.about(first))
    return f"settled {due} frames after the change, to {off[first + due :].max():.0f} codes of {swing.max():.0f}"


def _response_db(e: Capture, per_rate: float) -> float:
    """Response of the filter at a frequency in units of the data rate, from the step response of axis X, dB."""
    _, first, y = _step(e)
    begin, end = max(first - 1, 0), min(first + 70, len(y) - 1)
    impulse = np.diff(y[begin : end + 1, 0])
    wave = np.exp(-2j * np.pi * per_rate * np.arange(len(impulse)))
    rectangle = float(np.sinc(per_rate))  # of the difference of two neighbouring words
    return 20.0 * float(np.log10(max(abs(complex((impulse * wave).sum())) / rectangle, 1e-9)))


@check("gain", "PSA2-ADC-07")
def the_filter_stops_above_its_band(e: Capture, row: Requirement) -> str:
    """Response to a step of the gain: how much of half the data rate is left?"""
    band_db = _response_db(e, row.limit("passband_per_rate"))
    stop_db = _response_db(e, row.limit("stop_per_rate"))
    if band_db - stop_db < row.limit("stop_min_db"):
        raise Failed(f"{stop_db - band_db:.1f} dB at half the data rate", f"-{row.limit('stop_min_db'):g} dB or less")
    return f"{band_db:.2f} dB in the pass band, {stop_db:.0f} dB at half the data rate"


@check("gain", "PSA2-CHIP-06")
def the_filter_has_its_corner(e: Capture, row: Requirement) -> str:
    """Response to a step of the gain at the corner and in the pass band."""
    corner = (row.limit("corner_per_rate"), row.limit("corner_db"), row.limit("tolerance_db"))
    inside = (row.limit("passband_1_per_rate"), row.limit("passband_2_per_rate"))
    for per_rate, due_db, slack_db in (corner, *((f, 0.0, row.limit("passband_db")) for f in inside)):
        saw_db = _response_db(e, per_rate)
        if abs(saw_db - due_db) > slack_db:
            raise Failed(f"{saw_db:.3f} dB at {per_rate:g} of the data rate", f"{due_db:g} +- {slack_db:g} dB")
    return (
        f"{_response_db(e, row.limit('corner_per_rate')):.3f} dB at {row.limit('corner_per_rate'):g} of the data rate"
    )


@check("gain", "PSA2-READ-10")
def three_axes_move_together(e: Capture, row: Requirement) -> str:
    """Change the gain of all three converters: is the step in the three codes of the same frames?"""
    p, first, y = _step(e)
    part = y[max(first - 2, 0) : first + 70]
    apart = np.abs(part - part[:, :1]).max(axis=0)
    swing = np.abs(p.code[-50:].mean(axis=0) - p.code[:50].mean(axis=0))
    most = row.limit("apart_max_ppm") * 1e-6
    noise = row.limit("noise_max_sigma") * p.code[-50:].std(axis=0) * (1 / swing + 1 / swing[0])
    if (apart > most + noise).any():
        k = int(np.argmax(apart))
        raise Failed(f"{'XYZ'[k]} {apart[k]:.5f} of the step away from X", f"at most {most:.5f}", frames=p.about(first))
    return f"steps of three axes alike to {apart.max() * 1e6:.0f} ppm"


@check("gain", "PSA2-ADC-08")
def settled_tells_of_a_new_gain(e: Capture, row: Requirement) -> str:
    """Count the frames without SETTLED after a write of CONFIG1."""
    p, due = pairs(e, 100), int(row.limit("unsettled_frames"))
    off = np.flatnonzero(~p.settled)
    if len(off) != due or (len(off) and off[-1] - off[0] + 1 != due):
        raise Failed(
            f"{len(off)} frames without SETTLED", f"{due} in a row", frames=p.about(int(off[0]) if len(off) else 0)
        )
    _, first, _ = _step(e)
    expect(first >= off[0], "codes moved while SETTLED was 1", "0 from the change on", frames=p.about(first))
    return f"{len(off)} frames without SETTLED in a row"


@check("gain", "PSA2-REG-08")
def a_write_changes_all_codes(e: Capture, row: Requirement) -> str:
    """Write CONFIG1 through 2000h: the registers and the codes of all axes."""
    p, _, _ = _step(e)
    for a in fact(e, "read"):
        expect(number(a) == int(row.limit("config1_code")), f"CONFIG1 {number(a):02X}h", "0Ah on each converter")
    ratio = np.median(p.code[-50:], axis=0) / np.median(p.code[:50], axis=0)
    if (np.abs(ratio - row.limit("ratio")) > row.limit("tolerance_ratio")).any():
        raise Failed(f"codes grew by {ratio.round(4)}", "2, on each axis", frames=p.about(len(p) - 3))
    return f"codes of all axes grew by {ratio.round(5)}"


# ---- noise, damage, temperatures


@check("quiet", "PSA2-CHIP-07", "PSA1-CHIP-01", needs={"can", "inputs"})
def noise_is_the_published_one(e: Capture, row: Requirement) -> str:
    """Standard deviation of the codes at quiet inputs; words that another port damaged are left out."""
    p = pairs(e, int(row.limit("readings_count")))
    code_uv = row_for(e, "PSA2-ADC-01").limit("code_uv")
    sound = _sound(e, p)
    for k in range(3):
        saw_uv = float(p.code[sound, k].std()) * code_uv
        due_uv = row.limit("noise_uv")
        if abs(saw_uv - due_uv) > due_uv * row.limit("tolerance_pct") / 100:
            raise Failed(f"{saw_uv:.2f} uV on {'XYZ'[k]}", f"{due_uv:g} uV +- {row.limit('tolerance_pct'):g} %")
    return f"{(p.code[sound].std(axis=0) * code_uv).round(2)} uV on X, Y, Z"


def _sound(e: Capture, p: Pairs) -> np.ndarray:
    """(n,) samples near the middle of their axis: within what no noise leaves."""
    off = np.abs(p.code - np.median(p.code, axis=0))
    most = row_for(e, "PSA2-SIG-12", "PSA2-SIG-13").limit("noise_max_mad")
    limit = most * np.maximum(np.median(off, axis=0), 1.0)
    sound: np.ndarray = (off <= limit).all(axis=1)
    return sound


@check("quiet", "PSA2-SIG-12", needs={"can", "inputs"})
def no_word_is_damaged_by_the_other_port(e: Capture) -> str:
    """Look for single codes far from the others while temperatures are scanned."""
    p = pairs(e, 100)
    bad = np.flatnonzero(~_sound(e, p))
    if len(bad):
        k = int(bad[0])
        raise Failed(
            f"{p.code[k]} among {np.median(p.code, axis=0).astype(int)} ({len(bad)} of {len(p)})",
            "no code off by more than noise",
            frames=p.about(k),
        )
    return f"{len(p)} samples, none off by more than noise"


@check("quiet", "PSA2-SIG-13", needs={"can", "inputs"})
def bursts_damage_words_where_nothing_gates_them(e: Capture, row: Requirement) -> str:
    """Count single codes far from the others."""
    p = pairs(e, 100)
    bad = int((~_sound(e, p)).sum())
    if bad < row.limit("wrong_min_frames") or bad > row.limit("wrong_max_pct") / 100 * len(p):
        due = f"{row.limit('wrong_min_frames')} and more, at most {row.limit('wrong_max_pct'):g} %"
        raise Failed(f"{bad} wrong frames of {len(p)}", due, frames=p.about(0))
    return f"{bad} wrong frames of {len(p)}"


@check("chamber", "PSA2-TEMP-04", needs={"chamber"})
def temperature_codes_are_kelvins(e: Capture, row: Requirement) -> str:
    """Compare the code of the converter board's sensor with the temperature of the chamber."""
    p = pairs(e)
    temp_degc = fact(e, "temp_degc")
    codes = p.temp[(p.channel == int(row.limit("channel_code"))) & (p.temp != 0)]
    expect(len(codes), "no temperature of the converter board", "one every four", frames=p.about(0))
    due = row.limit("codes_per_k") * (temp_degc + ZERO_K)
    saw, slack = float(np.median(codes)), due * row.limit("tolerance_pct") / 100
    if abs(saw - due) > slack:
        raise Failed(f"{saw:.0f} at {temp_degc:.2f} degC", f"{due:.0f} +- {slack:.0f}", frames=p.about(0))
    return f"{saw:.0f} at {temp_degc:.2f} degC"
