"""What PMKA's readings tell: codes, resets, who serves whom, calibrations, integrals (article, section 3)."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from psabench.boards.pmka import estimate as est
from psabench.boards.pmka.conform.capture_readings import CODES, STATE, columns, largest, run_of
from psabench.conform.capture.intervals import first_of
from psabench.conform.capture.log import Capture
from psabench.conform.capture.messages import as_laid_out, booted, in_turn, late_readings
from psabench.conform.plan import check
from psabench.conform.proves import row_for
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Failed, Inconclusive, conclusive, damaged_data_are, expect, none_of
from psabench.link.signals import Floats, Ints

BEAT_OF_AXIS = {2: 0, 3: 1, 4: 2}  # beat to the axis that the spare serves
HOME = (1, 2, 3, 0)  # SERVES of X, Y, Z, K with no one out of work but the spare


def _periods(e: Capture) -> est.Periods:
    """Raises Inconclusive where readings are missing or at their limits."""
    with damaged_data_are(Inconclusive):
        return est.periods_of(columns(e))


def _steady(tau: Floats) -> np.ndarray:
    """(n,) whether a reading lies within a beat, away from a hand-over."""
    same = np.zeros(len(tau), bool)
    same[2:-2] = (tau[2:-2] == tau[:-4]) & (tau[2:-2] == tau[4:])
    return same


@check("stream", "PMKA-CAN-01", needs={"can"})
def codes_and_state_alternate(e: Capture) -> str:
    """Follow the two messages of each reading."""
    return in_turn(e, (CODES, STATE))


@check("minute", "PMKA-CAN-02", needs={"can"})
def readings_are_counted_without_gaps(e: Capture, row: Requirement) -> str:
    """Look at SEQ from reading to reading."""
    modulo = int(row.limit("modulo"))
    seq = columns(e)["SEQ"].astype(np.int64)
    gaps = np.flatnonzero(np.diff(seq) % modulo != 1).tolist()
    none_of(gaps, lambda k: f"SEQ {seq[k]}, then {seq[k + 1]} ({len(gaps)} gaps)", "one more")
    return f"{len(seq)} readings, SEQ {seq[0]} to {seq[-1]}"


@check("power_on", "PMKA-CAN-02", needs={"can"})
def readings_begin_with_0_after_res(e: Capture, row: Requirement) -> str:
    """Look at SEQ of the first reading after Res; one that was reported late counts those before it."""
    first = int(row.limit("first"))
    seq = int(columns(e, 3)["SEQ"][0])
    late = late_readings(
        e,
        "PMKA_HEARTBEAT",
        CODES,
        row_for(e, "PMKA-CAN-04").limit("start_ms") * 1e-3,
        row_for(e, "PMKA-SAMP-01").limit("ts_us") * 1e-6,
    )
    expect(first <= seq <= first + late, f"SEQ {seq} first", f"{first}" if not late else f"{first} to {first + late}")
    return f"SEQ {seq} first"


@check("power_on", "PMKA-ERR-02", needs={"can"})
def res_begins_with_beat_0(e: Capture) -> str:
    """Look at TAU of the first reading after Res, and whether anything was reset before it; later at beat 1."""
    booted(e, "PMKA_HEARTBEAT")
    c = columns(e, 3)
    seq, tau = int(c["SEQ"][0]), int(c["TAU"][0])
    resets = [int(c[f"RESET_{name}"][0]) for name in est.INTEGRATORS]
    if seq >= requirements()["PMKA-CAL-03"].limit("beat_periods"):
        raise Inconclusive(f"the first reading that was reported has SEQ {seq}")
    if tau not in (0, *([1] if seq else [])) or (any(resets) and not seq):
        raise Failed(f"SEQ {seq}, TAU {tau}, resets {resets} first", "TAU 0, no reset")
    return f"TAU {tau} in the first reading, SEQ {seq}"


@check("stream", "PMKA-CAN-03", needs={"can"})
def messages_have_their_lengths(e: Capture) -> str:
    """Look at lengths and at bits without a signal."""
    return as_laid_out(e, (CODES, STATE))


@check("power_on", "PMKA-CAN-04", needs={"stamps"})
def the_first_sample_comes_in_time(e: Capture, row: Requirement) -> str:
    """Measure from the boot-up message to the first PMKA_CODES."""
    boot, log = booted(e, "PMKA_HEARTBEAT"), e.frames_of(CODES)
    conclusive(len(log), "no PMKA_CODES came")
    seq, ts_ms = int(columns(e, 3)["SEQ"][0]), row_for(e, "PMKA-SAMP-01").limit("ts_us") * 1e-3
    took_ms, due_ms = float(log.t_s[0] - boot.t_s) * 1e3, row.limit("start_ms") + seq * ts_ms
    if abs(took_ms - due_ms) > row.limit("tolerance_ms"):
        due = f"{due_ms:g} +- {row.limit('tolerance_ms'):g} ms"
        raise Failed(f"{took_ms:.3f} ms with SEQ {seq}", due, frames=(boot, log.frames[0]))
    return f"{took_ms:.3f} ms from boot-up to the codes of SEQ {seq}"


@check("stream", "PMKA-INT-01", needs={"can", "inputs"})
def an_integrator_moves_with_its_input(e: Capture, row: Requirement) -> str:
    """Compare steps of codes without a reset with the volts at the input."""
    c = columns(e)
    steady, seen = _steady(c["TAU"])[1:], []
    for k, axis in enumerate("XYZ"):
        volts = e.inputs_v.get(axis.lower(), 0.0)
        mine = steady & (c[f"RESET_{axis}"][1:] == 0) & (c[f"SERVES_{axis}"][1:] == k + 1)
        if abs(volts) < 0.1 or mine.sum() < 10:
            raise Inconclusive(f"{volts} V at {axis}, {int(mine.sum())} periods without a reset")
        per_v = float(np.diff(c[axis])[mine].mean()) / volts
        if abs(per_v / row.limit("v_per_v") - 1) > row.limit("tolerance_pct") / 100:
            raise Failed(
                f"{per_v:.4f} V a period for 1 V on {axis}",
                f"{row.limit('v_per_v')} V +- {row.limit('tolerance_pct'):g} %",
            )
        seen.append(f"{per_v:.4f}")
    return f"{', '.join(seen)} V a period for 1 V"


@check("minute", "PMKA-INT-04", needs={"can", "inputs"})
def resets_are_as_many_as_the_input_wants(e: Capture, row: Requirement) -> str:
    """Count the resets of each axis in a minute: one a period at full scale."""
    full_v, p = row.limit("full_scale_v"), _periods(e)
    seen = []
    for axis in range(3):
        serving = p.serves == axis + 1
        made = float((p.reset * serving).sum()) / len(p) * full_v
        volts = e.inputs_v.get("xyz"[axis], 0.0)
        if abs(made - volts) > row.limit("tolerance_v"):
            raise Failed(f"resets for {made:.3f} V on {'XYZ'[axis]}", f"{volts:.3f} V")
        seen.append(f"{made:.3f}")
    return f"resets for {', '.join(seen)} V"


@check("minute", "PMKA-INT-04", needs={"can", "inputs"})
def nothing_saturates_below_full_scale(e: Capture, row: Requirement) -> str:
    """Look for SATURATED and CLIPPED in a minute."""
    most, c = row.limit("full_scale_v"), columns(e)
    conclusive(not any(abs(v) > most for v in e.inputs_v.values()), f"expected inputs of {most:g} V at most")
    for flag in ("SATURATED", "CLIPPED"):
        if c[flag].any():
            raise Failed(f"{flag} in {np.count_nonzero(c[flag])} of {len(c[flag])} readings", f"none up to {most:g} V")
    return f"{len(c['SEQ'])} readings without SATURATED and CLIPPED"


@check("stream", "PMKA-RST-01", needs={"can"})
def resets_follow_codes_beyond_uc(e: Capture, row: Requirement) -> str:
    """Look for the reset after each code beyond Uc, and for none after one within."""
    c = columns(e)
    uc, tol, count = row.limit("uc_v"), row.limit("uc_tolerance_v"), 0
    for name in est.INTEGRATORS:
        code, reset = c[name][:-1], c[f"RESET_{name}"][1:]
        free = (c[f"SERVES_{name}"][1:] != 0) | (c["CAL"][1:] == est.CAL_ZERO)
        due = np.where(code > uc + tol, 1, np.where(code < -uc - tol, -1, 0))
        sure = free & (np.abs(np.abs(code) - uc) > tol)
        if (k := first_of(sure & (reset != due))) is not None:
            saw = f"RESET_{name} {int(reset[k])} after a code of {code[k]:.4f} V"
            raise Failed(saw, f"{int(due[k])}: Uc is {uc:g} V")
        count += int((reset[sure] != 0).sum())
    conclusive(count >= 10, f"{count} resets were reported")
    return f"{count} resets, each after a code beyond {uc:g} V"


@check("minute", "PMKA-RST-03", needs={"can"})
def a_reset_moves_the_code_by_its_size(e: Capture, row: Requirement) -> str:
    """Take the steps of calibrated integrators."""
    p = _periods(e)
    due, part = row.limit("nr_codes"), row.limit("tolerance_pct") / 100
    sizes = _sizes(p)
    if np.abs(sizes / due - 1).max() > part:
        raise Failed(f"{', '.join(f'{v:.1f}' for v in sizes.reshape(-1))} codes", f"{due:g} +- {part:.0%}")
    return f"{sizes.min():.1f} to {sizes.max():.1f} codes against the sign of the reset"


def _sizes(p: est.Periods) -> Floats:
    """(4, 2) mean Nr by integrator and sign. Raises Inconclusive."""
    with damaged_data_are(Inconclusive):
        return np.array([est.calibrate(p, k).nr.mean(axis=0) for k in range(4)])


@check("minute", "PMKA-RST-04", needs={"can"})
def the_input_stays_connected_in_a_reset(e: Capture, row: Requirement) -> str:
    """Compare increments of periods with a reset, Nr added, with those without."""
    p = _periods(e)
    sizes, seen = _sizes(p), []
    for k in range(3):
        home = (p.serves[1:, k] == k + 1) & (p.serves[:-1, k] == k + 1) & (p.serves[1:, 3] != k + 1)
        step, reset = np.diff(p.code[:, k]), p.reset[1:, k]
        plain = home & (reset == 0)
        hit = home & (reset != 0)
        conclusive(plain.sum() >= 10 and hit.sum() >= 10, f"{int(hit.sum())} periods with a reset on {'XYZ'[k]}")
        whole = step + np.where(reset > 0, sizes[k, 0], 0.0) - np.where(reset < 0, sizes[k, 1], 0.0)
        with_reset, without = float(whole[hit].mean()), float(step[plain].mean())
        if abs(with_reset / without - 1) > row.limit("increment_tolerance_pct") / 100:
            raise Failed(f"{with_reset:.2f} codes with a reset on {'XYZ'[k]}, {without:.2f} without", "the same")
        seen.append(f"{with_reset:.1f} and {without:.1f}")
    return f"increments with and without a reset: {'; '.join(seen)} codes"


@check("minute", "PMKA-RST-07", needs={"can"})
def the_two_signs_have_sizes_of_their_own(e: Capture, row: Requirement) -> str:
    """Compare the ratio of Nr(+) and Nr(-) with that of CT(+) and CT(-) in the ROM."""
    run = run_of(e)
    sizes, degc = _sizes(run.periods), run.periods.degc.mean(keepdims=True)
    nr = sizes[:, 0] / sizes[:, 1] - 1
    ct = np.array([float(run.rom.ct_at(k, 0, degc)[0] / run.rom.ct_at(k, 1, degc)[0]) - 1 for k in range(4)])
    expect(np.any(run.rom.ct[:, :, 0] != run.rom.ct[:, :, 1]), "CT(+) is CT(-) in the whole ROM", "two of them")
    off = np.abs(nr - ct) * 1e6
    if off.max() > row.limit("ratio_tolerance_ppm"):
        raise Failed(
            f"Nr(+)/Nr(-) off by {off.max():.1f} ppm", f"{row.limit('ratio_tolerance_ppm'):g} ppm of CT(+)/CT(-)"
        )
    return f"Nr(+)/Nr(-) - 1 = {', '.join(f'{v * 1e6:.0f}' for v in nr)} ppm, as the ROM says"


@check("minute", "PMKA-INT-03", needs={"can"})
def a_code_is_worth_what_the_article_says(e: Capture, row: Requirement) -> str:
    """Take Sr / Nr of a calibration."""
    p = _periods(e)
    ts_s = row_for(e, "PMKA-SAMP-01").limit("ts_us") * 1e-6
    quanta = np.array([est.quantum_vs(float(nr), ts_s) for nr in _sizes(p).reshape(-1)])
    due, part = row.limit("quantum_vs"), row.limit("tolerance_pct") / 100
    if np.abs(quanta / due - 1).max() > part:
        raise Failed(f"{quanta.min():.4g} to {quanta.max():.4g} V s a code", f"{due:g} +- {part:.0%}")
    return f"{quanta.min():.4g} to {quanta.max():.4g} V s a code"


@check("minute", "PMKA-INT-02", needs={"can", "inputs"})
def a_minute_is_integrated_without_a_gap(e: Capture, row: Requirement) -> str:
    """Sum all increments of a minute by the article's equations and compare them with the input."""
    run = run_of(e)
    integral = est.integrals_vs(run.periods, run.rom, run.calibrations)
    return largest(e, run, integral, row.limit("velocity_error_max_mmps"))


@check("minute", "PMKA-RST-06", needs={"can", "inputs"})
def the_capacitor_does_not_matter(e: Capture, row: Requirement) -> str:
    """The same where capacitors lose some of their value, which the size of resets must show."""
    run = run_of(e)
    took_h = (run.calibrations[0].nr_at[-1] - run.calibrations[0].nr_at[0]) * run.rom.ts_s / 3600
    grown = float(run.calibrations[0].nr[-1].mean() / run.calibrations[0].nr[0].mean()) - 1
    due = -float(e.variant["cap_ageing_per_h"]) * took_h
    if abs(grown - due) > row.limit("growth_tolerance_pct") / 100 * due:
        raise Failed(f"Nr grows by {grown * 1e6:.0f} ppm", f"{due * 1e6:.0f} ppm")
    integral = est.integrals_vs(run.periods, run.rom, run.calibrations)
    seen = largest(e, run, integral, row.limit("velocity_error_max_mmps"))
    return f"Nr grows by {grown * 1e6:.0f} ppm; {seen}"


@check("minute", "PMKA-ROT-07", needs={"can", "inputs"})
def a_sum_across_hand_overs_is_wrong(e: Capture, row: Requirement) -> str:
    """Sum the codes as if one integrator had the axis all the time, and as they should be."""
    run = run_of(e)
    p, out = run.periods, np.zeros((len(run.periods), 3))
    for axis in range(3):
        has: Ints = np.where(p.serves[:, 3] == axis + 1, 3, axis)
        rows = np.arange(len(p))
        nr = np.array([c.nr.mean() for c in run.calibrations])[has]
        steps = np.diff(p.code[rows, has], prepend=p.code[0, has[0]])
        out[:, axis] = np.cumsum(steps / nr + p.reset[rows, has]) * est.UREF_V * run.rom.ts_s
    wrong = np.abs(run.error_mmps(e, out)).max()
    expect(wrong >= row.limit("wrong_min_mmps"), f"{wrong:.1f} mm/s", f"more than {row.limit('wrong_min_mmps'):g} mm/s")
    right = est.integrals_vs(p, run.rom, run.calibrations)
    return f"{wrong:.0f} mm/s off; as they should be {largest(e, run, right, row.limit('right_max_mmps'))}"


@check("minute", "PMKA-CAL-01", needs={"can"})
def calibration_is_first_of_zero_then_of_resets(e: Capture) -> str:
    """Follow CAL in each beat, and look who serves no one meanwhile."""
    c, p = columns(e), _periods(e)
    beats = np.flatnonzero(np.diff(c["TAU"])) + 1
    busy = p.cal != 0
    idle = (p.serves == 0).sum(axis=1)
    conclusive(busy.any(), "no calibration in the recording")
    expect(not (idle[busy] != 1).any(), "CAL without one integrator that serves no axis", "one")
    count = 0
    for a, b in pairwise(beats):
        cal = p.cal[a:b]
        order = cal[cal != 0]
        expect(not len(order) or not (np.diff(order) < 0).any(), "a zero after resets in a beat", "zero first")
        count += len(order) > 0
    return f"{count} beats, first the zero, then resets"


@check("minute", "PMKA-CAL-03", needs={"can"})
def beats_have_their_lengths(e: Capture, row: Requirement) -> str:
    """Count the periods of each beat, and those of its zero and its resets."""
    c = columns(e)
    turns = np.flatnonzero(np.diff(c["TAU"])) + 1
    conclusive(len(turns) >= 3, f"{len(turns)} changes of the beat")
    due = [int(row.limit(n)) for n in ("beat_periods", "zero_periods", "reset_periods")]
    for a, b in pairwise(turns):
        cal = c["CAL"][a:b]
        saw = [int(b - a), int((cal == est.CAL_ZERO).sum()), int((cal == est.CAL_RESETS).sum())]
        if saw != due or c["TAU"][b] != c["TAU"][a] % 5 + 1:
            raise Failed(f"beat {int(c['TAU'][a])} of {saw} periods, then {int(c['TAU'][b])}", f"{due}, beats in turn")
    return f"{len(turns) - 1} beats of {due[0]} periods, {due[1]} for the zero, {due[2]} for resets"


@check("minute", "PMKA-ROT-01", needs={"can"})
def in_beat_1_the_spare_is_free(e: Capture) -> str:
    """Look at SERVES in the middle of beat 1."""
    return _serves(e, 1, HOME)


@check("minute", "PMKA-ROT-02", needs={"can"})
def the_spare_serves_x_y_z_in_turn(e: Capture) -> str:
    """Look at SERVES in the middle of beats 2, 3 and 4."""
    seen = ""
    for tau, axis in BEAT_OF_AXIS.items():
        due = list(HOME)
        due[axis], due[3] = 0, axis + 1
        seen = _serves(e, tau, tuple(due))
    return seen


@check("minute", "PMKA-ROT-03", needs={"can"})
def in_beat_5_the_spare_is_free(e: Capture) -> str:
    """Look at SERVES in the middle of beat 5."""
    return _serves(e, 5, HOME)


def _serves(e: Capture, tau: int, due: tuple[int, ...]) -> str:
    c = columns(e)
    mine = _steady(c["TAU"]) & (c["TAU"] == tau)
    conclusive(mine.any(), f"no reading of beat {tau}")
    serves = np.column_stack([c[f"SERVES_{n}"] for n in est.INTEGRATORS]).astype(np.int64)[mine]
    bad = serves[(serves != np.array(due)).any(axis=1)].tolist()
    none_of(bad, lambda one: f"SERVES {one} in beat {tau}", f"{list(due)} of X, Y, Z, K")
    return f"{int(mine.sum())} readings of beat {tau}, SERVES {list(due)}"


@check("minute", "PMKA-ROT-04", needs={"can"})
def each_axis_has_an_integrator(e: Capture) -> str:
    """Look for each axis in SERVES of each reading: once, twice around a hand-over."""
    p, c = _periods(e), columns(e)
    steady, twice = _steady(c["TAU"]), 0
    for axis in (1, 2, 3):
        count = (p.serves == axis).sum(axis=1)
        if (k := first_of((count < 1) | (count > 2) | (steady & (count != 1)))) is not None:
            saw = f"SERVES {p.serves[k].tolist()}, TAU {int(c['TAU'][k])}"
            raise Failed(saw, "each axis once, twice around a hand-over")
        twice += int((count == 2).sum())
    return f"{len(p)} readings, {twice} hand-overs"


@check("minute", "PMKA-ROT-06", needs={"can", "inputs"})
def nothing_is_lost_in_a_hand_over(e: Capture, row: Requirement) -> str:
    """Sum the increments of both integrators in the readings of hand-overs."""
    run = run_of(e)
    p = run.periods
    ds = np.column_stack([est.increments_vs(p, k, run.calibrations[k], run.rom) for k in range(4)])
    step_us, ts_us = row_for(e, "PMKA-SAMP-02").limit("step_us"), row_for(e, "PMKA-SAMP-01").limit("ts_us")
    off = []
    for axis in range(3):
        both = (p.serves[:, axis] == axis + 1) & (p.serves[:, 3] == axis + 1)
        if both[:1].any():
            both[0] = False
        volts = e.inputs_v["xyz"[axis]]
        for k in np.flatnonzero(both):
            leaves = k + 1 < len(p) and p.serves[k + 1, 3] == axis + 1
            more = (3 - axis) * step_us * (1 if leaves else -1)  # K is sampled so much later
            due_vs = volts * (ts_us + more) * 1e-6
            off.append(
                (ds[k, axis] + ds[k, 3] - due_vs)
                / est.quantum_vs(float(run.calibrations[axis].nr.mean()), run.rom.ts_s)
            )
        expect(not (p.cal[both] != 0).any(), "CAL in the period of a hand-over", "0")
    conclusive(len(off) >= 6, f"{len(off)} hand-overs were recorded")
    if np.abs(off).max() > row.limit("tolerance_codes"):
        raise Failed(f"{np.abs(off).max():.1f} codes off", f"{row.limit('tolerance_codes'):g} codes at most")
    return f"{len(off)} hand-overs, {np.abs(off).max():.1f} codes off at most"
