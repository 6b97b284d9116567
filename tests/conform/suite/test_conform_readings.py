"""Checks of PMKA, PIK and the gyro unit on frames and lines made by hand, good and bad."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from psabench.boards.gyro.conform import check as gyro
from psabench.boards.gyro.conform import check_modes as gyro_modes
from psabench.boards.gyro.conform.capture_readings import MESSAGES as GYRO_MESSAGES
from psabench.boards.pik.conform import check as pik
from psabench.boards.pik.conform.check import MESSAGES as PIK_MESSAGES
from psabench.boards.pmka.conform import check_lines as pmka_lines
from psabench.boards.pmka.conform import check_readings as pmka_readings
from psabench.conform.capture.log import CanFrame, CanLog, Capture, LineLog
from psabench.conform.profile import variant
from psabench.conform.verdict import Failed, Inconclusive
from psabench.link.protocol_files import dbc_node, message
from psabench.link.vcd import Vcd, Wire

Test = Callable[[Capture], str]
Row = Mapping[str, float]


def log(board: str, rows: Sequence[tuple[str, Row]]) -> CanLog:
    """Frames of these messages; signals that a row leaves out are 0."""
    frames = []
    for k, (name, values) in enumerate(rows):
        m = message(name)
        raw = {s.name: values.get(s.name, 0) for s in m.signals}
        data = bytes(m.encode(raw, scaling=False, strict=False))
        frames.append(CanFrame(t_s=k * 1e-3, can_id=int(m.frame_id), data=data))
    return CanLog(frames=tuple(frames))


def lines(moves: Mapping[str, Sequence[tuple[int, int]]], end_ns: int) -> LineLog:
    wires = {
        n: Wire(np.array([t for t, _ in v], np.int64), np.array([x for _, x in v], np.uint8)) for n, v in moves.items()
    }
    return LineLog(recording=Vcd(1, 0, end_ns, wires))


def capture(board: str, can: CanLog, **more: Any) -> Capture:
    inputs = {"x": 2.0, "y": -1.0, "z": 0.5}
    return Capture(
        variant=variant(board), node=dbc_node(variant(board).family), stimulus="", can=can, inputs_v=inputs, **more
    )


def fails(check: Test, e: Capture) -> None:
    with pytest.raises(Failed):
        check(e)


# ---- PMKA


def pmka(n: int = 120, change: Callable[[int, dict[str, float], dict[str, float]], None] = lambda *_: None) -> Capture:
    """Integrators at 2, -1 and 0.5 V in a beat 1 that lasts, K at rest in its zero."""
    rows: list[tuple[str, Row]] = []
    code, reset = {"X": 0.0, "Y": 0.0, "Z": 0.0, "K": 5.0}, dict.fromkeys("XYZK", 0)
    for k in range(n):
        for axis, volts in (("X", 2.0), ("Y", -1.0), ("Z", 0.5)):
            reset[axis] = int(np.sign(code[axis])) if abs(code[axis]) * 10 / 2**15 > 3.5 else 0
            code[axis] += volts * 0.5106 * 3276.8 - reset[axis] * 16732.6
        codes: dict[str, float] = {a: round(v) for a, v in code.items()}
        state: dict[str, float] = {"SEQ": k, "TAU": 1, "CAL": 1, "SERVES_X": 1, "SERVES_Y": 2, "SERVES_Z": 3}
        state |= {f"RESET_{a}": v for a, v in reset.items()}
        change(k, codes, state)
        rows += [("PMKA_CODES", codes), ("PMKA_STATE", state)]
    return capture("pmka", log("pmka", rows))


def test_a_good_pmka_passes() -> None:
    e = pmka()
    for check in (
        pmka_readings.codes_and_state_alternate,
        pmka_readings.readings_are_counted_without_gaps,
        pmka_readings.messages_have_their_lengths,
        pmka_readings.an_integrator_moves_with_its_input,
        pmka_readings.resets_follow_codes_beyond_uc,
        pmka_readings.in_beat_1_the_spare_is_free,
        pmka_readings.nothing_saturates_below_full_scale,
        pmka_readings.each_axis_has_an_integrator,
    ):
        assert check(e)


def test_a_bad_pmka_is_found() -> None:
    def of(name: str, value: float) -> Capture:
        return pmka(change=lambda k, _, s: s.update({name: value}) if k == 50 else None)

    fails(pmka_readings.readings_are_counted_without_gaps, of("SEQ", 7))
    fails(pmka_readings.in_beat_1_the_spare_is_free, of("SERVES_K", 1))
    fails(pmka_readings.each_axis_has_an_integrator, of("SERVES_X", 0))
    fails(pmka_readings.nothing_saturates_below_full_scale, of("SATURATED", 1))
    fails(pmka_readings.nothing_saturates_below_full_scale, of("CLIPPED", 1))
    fails(pmka_readings.resets_follow_codes_beyond_uc, pmka(change=lambda _, __, s: s.update({"RESET_X": 0})))
    wrong_sign = pmka(change=lambda _, __, s: s.update({"RESET_X": -s["RESET_X"]}))
    fails(pmka_readings.resets_follow_codes_beyond_uc, wrong_sign)
    half = pmka(change=lambda _, c, __: c.update({a: round(c[a] / 2) for a in "XYZ"}))
    fails(pmka_readings.an_integrator_moves_with_its_input, half)
    good = pmka()
    fails(
        pmka_readings.codes_and_state_alternate,
        replace(good, can=CanLog(frames=good.can.frames[:5] + good.can.frames[6:])),
    )


def test_only_a_late_host_excuses_a_late_first_reading() -> None:
    """SEQ 2 after Res, two periods late: a host in real time may have begun there, one in lockstep has not."""
    rows: list[tuple[str, Row]] = [("PMKA_HEARTBEAT", {})]
    for k in range(2, 30):
        rows += [("PMKA_CODES", {}), ("PMKA_STATE", {"SEQ": k})]
    frames = log("pmka", rows).frames
    later = (f._replace(t_s=f.t_s + 0.0104 + 2 * 0.0048) for f in frames[1:])
    can = CanLog(frames=(frames[0]._replace(data=b"\0"), *later))
    assert pmka_readings.readings_begin_with_0_after_res(capture("pmka", can))
    fails(pmka_readings.readings_begin_with_0_after_res, capture("pmka", can, facts={"prompt": True}))


def samples(step: int = 100_000, period: int = 4_800_000, order: Sequence[int] = (0, 1, 2, 3)) -> Capture:
    moves: dict[str, list[tuple[int, int]]] = {"SH": [(0, 0)], "MUX0": [(0, 0)], "MUX1": [(0, 0)]}
    t = 10_000_000
    for _ in range(12):
        for k in range(4):
            at, following = t + k * step, order[(k + 1) % 4]
            moves["SH"] += [(at, 1), (at + 50_000, 0)]
            moves["MUX0"].append((at, following & 1))
            moves["MUX1"].append((at, following >> 1))
        t += period
    return capture("pmka", CanLog(), lines=lines(moves, t))


def test_samples_of_a_pmka() -> None:
    for check in (pmka_lines.integrators_are_sampled_every_ts, pmka_lines.four_samples_follow_one_another):
        assert check(samples())
    fails(pmka_lines.integrators_are_sampled_every_ts, samples(period=4_802_000))
    fails(pmka_lines.four_samples_follow_one_another, samples(step=101_000))
    fails(pmka_lines.four_samples_follow_one_another, samples(order=(0, 2, 1, 3)))


# ---- PIK


def counts(
    k_hz_per_v: float = 2000.0, off: float = 0.0, seq_step: int = 1, order: Sequence[int] = (0, 1, 2)
) -> Capture:
    rows: list[tuple[str, Row]] = []
    before = [0, 0, 0]
    for k in range(1, 6101):
        total = [int(v * (k_hz_per_v * 0.01 * k)) + (round(off) if k > 3000 else 0) for v in (2.0, -1.0, 0.5)]
        inc = [a - b for a, b in zip(total, before, strict=True)]
        before = total
        three: list[tuple[str, Row]] = [
            ("PIK_COUNTS", {"X": inc[0], "Y": inc[1], "Z": inc[2], "SEQ": k * seq_step % 256}),
            ("PIK_TOTALS", {"X": total[0], "Y": total[1]}),
            ("PIK_TOTAL_Z", {"Z": total[2], "TSTAMP": 10_000 * k}),
        ]
        rows += [three[i] for i in order]
    return capture("pik6", log("pik", rows))


def test_counts_of_a_pik() -> None:
    good = counts()
    for check in (
        pik.the_frequency_follows_the_input,
        pik.the_coefficient_is_the_printed_one,
        pik.the_count_is_the_integral,
        pik.the_law_is_linear,
        pik.counts_are_differences_of_totals,
        pik.readings_are_numbered_and_stamped,
        pik.three_messages_make_a_reading,
        pik.a_pulse_has_the_printed_weight,
    ):
        assert check(good)
    fails(pik.the_coefficient_is_the_printed_one, counts(k_hz_per_v=2004.0))
    fails(pik.the_frequency_follows_the_input, counts(k_hz_per_v=-2000.0))
    fails(pik.the_count_is_the_integral, counts(off=5.0))
    fails(pik.readings_are_numbered_and_stamped, counts(seq_step=2))
    fails(pik.three_messages_make_a_reading, counts(order=(0, 2, 1)))
    fails(pik.a_pulse_has_the_printed_weight, counts(k_hz_per_v=2100.0))


def pulses(high: int = 25_000, name: str = "FXP", shift: int = 0) -> Capture:
    moves: dict[str, list[tuple[int, int]]] = {n: [(0, 0)] for n in pik.PULSES}
    moves["CLK"] = [(0, 0), *((t + h, 1 - h // 12_500) for t in range(25_000, 5_000_000, 25_000) for h in (0, 12_500))]
    for k in range(20):
        at = 100_000 + k * 200_000 + (shift if k == 9 else 0)
        moves[name] += [(at, 1), (at + high, 0)]
    return capture("pik6", CanLog(), lines=lines(moves, 5_000_000))


def test_pulses_of_a_pik() -> None:
    assert pik.a_reset_lasts_its_time(pulses())
    assert pik.pulses_begin_on_their_grid(pulses())
    fails(pik.a_reset_lasts_its_time, pulses(high=25_100))
    fails(pik.pulses_begin_on_their_grid, pulses(shift=700))
    fails(pik.signs_have_their_lines, pulses(name="FXN"))


def resting(**changed: Sequence[tuple[int, int]]) -> Capture:
    """Pulses on FXP from 100 us on, a latch each 10 ms, all else at rest."""
    moves: dict[str, Sequence[tuple[int, int]]] = {n: [(0, int(n in ("LATCH", "CS", "RW")))] for n in pik.PINS}
    moves["FXP"] = [(0, 0), *FXP]
    moves["LATCH"] = [(0, 1), *((t + h, int(h > 0)) for t in (10_000_000, 20_000_000) for h in (0, 10_000))]
    return capture("pik6", CanLog(), lines=lines(moves | changed, 25_000_000))


FXP = [(t + h, int(not h)) for t in range(100_000, 20_000_000, 400_000) for h in (0, 25_000)]


def test_lines_of_a_pik_at_rest() -> None:
    """A fault shows from the recording's first instant on, as an edge there or as a level."""
    assert pik.lines_rest_at_their_levels(resting())
    assert pik.lines_rest_at_their_levels(resting(FXP=[(0, 1), (20_000, 0), *FXP]))  # it begins amid a pulse
    fails(pik.lines_rest_at_their_levels, resting(FXP=[(0, 0), (0, 1), *((t, 1 - v) for t, v in FXP)]))
    for name in pik.PINS:
        level = int(name not in ("LATCH", "CS", "RW"))
        fails(pik.lines_rest_at_their_levels, resting(**{name: [(0, level)]}))
        fails(pik.lines_rest_at_their_levels, resting(**{name: [(0, 1 - level), (0, level)]}))
    with pytest.raises(Inconclusive):
        pik.lines_rest_at_their_levels(resting(FXP=[(0, 0)], LATCH=[(0, 1)]))


# ---- gyro


def steps(
    change: Callable[[int, dict[str, float]], None] = lambda *_: None, order: Sequence[int] = (0, 1, 2)
) -> Capture:
    """Levelling: U1 = -m1 beta - Wz cos beta sin gamma, U2 = Wz cos beta cos gamma."""
    rows: list[tuple[str, Row]] = []
    wz = 15.041067 * np.sin(np.radians(50.0))
    for k in range(300):
        beta, gamma = np.exp(-k / 100) * 0.1, 0.02
        u1 = -beta * 3600 - wz * np.cos(np.radians(beta)) * np.sin(np.radians(gamma))
        u2 = wz * np.cos(np.radians(beta)) * np.cos(np.radians(gamma))
        v: dict[str, float] = {"U1": u1, "U2": u2, "STEP": k, "MODE": 1, "BETA": beta, "GAMMA": gamma}
        change(k, v)
        three: list[tuple[str, Row]] = [
            ("GYRO_RATES", {"U1": round(v["U1"] * 1e4), "U2": round(v["U2"] * 1e4)}),
            ("GYRO_ANGLES", {"STEP": v["STEP"], "MODE": v["MODE"]}),
            ("GYRO_LEVEL", {"BETA": round(v["BETA"] / 2e-6), "GAMMA": round(v["GAMMA"] / 2e-6)}),
        ]
        rows += [three[i] for i in order]
    return capture("gyro", log("gyro", rows), facts={"m1_per_s": 1.0, "m2_per_s": 2.0, "latitude_deg": 50.0})


def test_steps_of_a_gyro_unit() -> None:
    good = steps()
    for check in (
        gyro.three_messages_make_a_reading,
        gyro.steps_are_counted,
        gyro.u1_levels,
        gyro.u2_runs_free_when_it_levels,
    ):
        assert check(good)
    fails(gyro.three_messages_make_a_reading, steps(order=(1, 0, 2)))
    fails(gyro.steps_are_counted, steps(lambda k, v: v.update(STEP=k + (k > 99))))
    fails(gyro.u1_levels, steps(lambda _, v: v.update(U1=-v["U1"])))
    fails(gyro.u2_runs_free_when_it_levels, steps(lambda _, v: v.update(U2=v["U2"] + 1.0)))


def gimbal(at_deg: float, way_deg: float, *, dps: float = 9.0, dps2: float = 20.0) -> list[float]:
    """Angles of a turn, 100 a second, into half turns: speeds up, brakes, rests for half a second."""
    angles, done, rate, sign = [at_deg], 0.0, 0.0, np.sign(way_deg)
    while done < abs(way_deg) - 1e-6 and len(angles) < 5000:
        rate = min(dps, rate + dps2 * 0.01, max(0.05, np.sqrt(2 * dps2 * (abs(way_deg) - done)) - dps2 * 0.01))
        done = min(abs(way_deg), done + rate * 0.01)
        angles.append(at_deg + sign * done)
    return [float(v) for v in (np.array(angles + angles[-1:] * 50) + 180.0) % 360.0 - 180.0]


def turns(ways: Sequence[Sequence[float]], ends: Sequence[float], *, moves_deg: float = 0.0) -> Capture:
    """Turns by mode 3, then mode 2, in which the gimbal goes on moving."""
    parts, frames, rows = [], 0, list[tuple[str, Row]]()
    held = [float(ways[-1][-1] + moves_deg * k / 100) for k in range(100)]
    for mode, angles, to in (*((3, w, e) for w, e in zip(ways, ends, strict=True)), (2, held, 0.0)):
        for k, q in enumerate(angles):
            rows += [
                ("GYRO_RATES", {"U1": 0}),
                ("GYRO_ANGLES", {"STEP": k % 65536, "MODE": mode, "ENCODER": round(q / (180 / 2**31))}),
                ("GYRO_LEVEL", {"BETA": 0}),
            ]
        parts.append((to, frames, frames + 3 * len(angles)))
        frames += 3 * len(angles)
    facts = {"turns": parts[:-1], "held": parts[-1][1:]}
    return capture("gyro", log("gyro", rows), facts=facts)


def test_turns_of_a_gyro_unit() -> None:
    good = turns([gimbal(10, 80), gimbal(90, 180), gimbal(-90, 90)], [90.0, 270.0, 0.0])
    assert gyro_modes.turns_take_the_shorter_way(good)
    assert gyro_modes.a_turn_ends_at_its_angle_and_holds(good)
    fails(gyro_modes.turns_take_the_shorter_way, turns([gimbal(10, -280)], [90.0]))
    fails(gyro_modes.turns_take_the_shorter_way, turns([gimbal(90, -180)], [270.0]))  # of two alike the positive one
    fails(gyro_modes.turns_take_the_shorter_way, turns([gimbal(10, 80, dps=10.5)], [90.0]))
    fails(gyro_modes.turns_take_the_shorter_way, turns([gimbal(10, 80, dps2=25.0)], [90.0]))
    fails(gyro_modes.a_turn_ends_at_its_angle_and_holds, turns([gimbal(10, 79)], [90.0]))
    fails(gyro_modes.a_turn_ends_at_its_angle_and_holds, turns([gimbal(10, 80)], [90.0], moves_deg=1.0))


def test_u2_of_a_gyro_unit_that_holds() -> None:
    def held(knows: bool) -> Capture:
        rows: list[tuple[str, Row]] = []
        for latitude_deg in (50.0, -50.0):
            wz = 15.041067 * np.sin(np.radians(latitude_deg)) if knows else 0.0
            rows += [
                ("GYRO_RATES", {"U2": round((wz + 7.0) * 1e4)}),
                ("GYRO_ANGLES", {"MODE": 2}),
                ("GYRO_LEVEL", {}),
            ] * 30
        parts = [(50.0, 0, 90), (-50.0, 90, 180)]
        return capture("gyro", log("gyro", rows), facts={"m2_per_s": 2.0, "latitudes": parts})

    assert gyro.u2_turns_with_the_earth(held(True))
    fails(gyro.u2_turns_with_the_earth, held(False))


def test_a_gyro_unit_that_begins_tilted() -> None:
    def tilted(first_deg: float) -> Capture:
        """Settling from half a degree, and a window."""
        beta = [0.5 * 0.97**k for k in range(100) if 0.5 * 0.97**k > first_deg]
        rows: list[tuple[str, Row]] = []
        for phase, angles in ((2, beta), (3, [first_deg] * 20)):
            for b in angles:
                mode = {"MODE": 4, "PHASE": phase, "POSITION": 1}
                rows += [("GYRO_RATES", {}), ("GYRO_ANGLES", mode), ("GYRO_LEVEL", {"BETA": round(b / 2e-6)})]
        return capture("gyro", log("gyro", rows))

    assert gyro_modes.a_window_waits_for_the_level(tilted(0.08))
    fails(gyro_modes.a_window_waits_for_the_level, tilted(0.09))


def test_a_gyro_unit_that_levels() -> None:
    def levelling(ends_deg: float, mode: int = 1) -> Capture:
        rows: list[tuple[str, Row]] = []
        for k in range(100):
            beta = round((ends_deg + 0.5 * 0.9**k) / 2e-6)
            rows += [("GYRO_RATES", {}), ("GYRO_ANGLES", {"MODE": mode}), ("GYRO_LEVEL", {"BETA": beta})]
        return capture("gyro", log("gyro", rows))

    assert gyro_modes.mode_1_levels(levelling(0.082))
    fails(gyro_modes.mode_1_levels, levelling(0.085))
    fails(gyro_modes.mode_1_levels, levelling(-0.085))
    with pytest.raises(Inconclusive):
        gyro_modes.mode_1_levels(levelling(0.0, mode=0))


def test_a_heading_of_a_gyro_unit() -> None:
    def kept(moved_deg: float, free_deg: float) -> Capture:
        facts = {"drift_degph": 25.0, "moved_deg": moved_deg, "moved_s": 36.0, "free_deg": free_deg, "free_s": 3.6}
        return capture("gyro", CanLog(), facts=facts)

    assert gyro_modes.navigation_keeps_the_azimuth(kept(0.0005, 0.025))
    fails(gyro_modes.navigation_keeps_the_azimuth, kept(0.002, 0.025))
    fails(gyro_modes.navigation_keeps_the_azimuth, kept(0.0, 0.0))  # a heading that stands still


def saturated(told: int = 20, over_s: float = 0.15) -> Capture:
    """A PIK-6 whose X cannot keep up for 20 readings from the 10th on; FF11h and its end by the board's time."""
    rows: list[tuple[str, Row]] = []
    for k in range(1, 51):
        if k == 10:
            rows.append(("PIK_EMCY", {"CODE": 0xFF11, "T": 100_000}))
        sat = {"SAT_X": 1} if 10 <= k < 10 + told else {}
        rows += [("PIK_COUNTS", sat | {"SEQ": k}), ("PIK_TOTALS", {}), ("PIK_TOTAL_Z", {"TSTAMP": k * 10_000})]
    if told:
        rows.append(("PIK_EMCY", {"CODE": 0, "T": round((0.01 * (9 + told) + over_s) * 1e6)}))
    return capture("pik6", log("pik", rows))


def test_saturation_of_a_pik() -> None:
    assert pik.saturation_is_told(saturated(over_s=0.095))
    fails(pik.saturation_is_told, saturated(over_s=0.15))
    fails(pik.saturation_is_told, saturated(over_s=0.05))
    fails(pik.saturation_is_told, saturated(told=0))


def gaps(apart: int) -> Capture:
    moves: dict[str, list[tuple[int, int]]] = {n: [(0, 0)] for n in pik.PULSES}
    moves["FXP"] += [(t + h, 1 - h // 25_000) for t in range(1000, 4_000_000, apart) for h in (0, 25_000)]
    return capture("pik6", CanLog(), lines=lines(moves, 5_000_000))


def test_distances_of_pulses_of_a_pik() -> None:
    assert pik.pulses_keep_their_distance(gaps(48_437))
    fails(pik.pulses_keep_their_distance, gaps(46_875))
    with pytest.raises(Inconclusive):
        pik.pulses_keep_their_distance(gaps(80_000))


def checks_of(module: Any) -> list[Test]:
    """Its checks: public functions that it defines."""
    found = [f for name, f in vars(module).items() if callable(f) and not name.startswith("_")]
    return [f for f in found if f.__module__ == module.__name__ and f.__code__.co_argcount == 1]


@pytest.mark.parametrize("check", [f for m in (pmka_readings, gyro, gyro_modes, pik) for f in checks_of(m)])
@pytest.mark.parametrize("what", ["nothing", "wrong lengths"])
def test_nothing_and_wrong_lengths_are_no_pass_and_no_crash(check: Test, what: str) -> None:
    module = check.__module__.split(".")[2]
    board = {"pmka": "pmka_drift", "gyro": "gyro", "pik": "pik6"}[module]
    family = {"pmka_drift": "pmka", "pik6": "pik6"}.get(board, board)
    names = {"pmka": ("PMKA_CODES", "PMKA_STATE"), "gyro": GYRO_MESSAGES, "pik6": PIK_MESSAGES}[family]
    ids = [int(message(n).frame_id) for n in names]
    frames = [CanFrame(t_s=k * 1e-3, can_id=i, data=b"\1\2\3") for k in range(40) for i in ids]
    empty = lines({}, 10**9)
    e = Capture(
        variant=variant(family, board),
        node=dbc_node(variant(family, board).family),
        stimulus="",
        can=CanLog(frames=tuple(frames) if what != "nothing" else ()),
        lines=empty,
        inputs_v={"x": 2.0, "y": -1.0, "z": 0.5},
        facts={"rom": [1, 2, 3], "level_node": 5, "positions": [0.0, 90.0, 180.0], "latitude_deg": 50.0},
    )
    try:
        check(e)
    except (Failed, Inconclusive):
        return
    except ValueError as err:
        if "holds for" in str(err):  # a row of another profile: the runner does not ask it
            return
        raise
    assert what == "wrong lengths"
    assert "alternate" in check.__name__ or "three_messages" in check.__name__  # their order alone is right
