"""PMKA's equations against a model of four integrators in a few lines: exact, and with what a real one adds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from psabench.boards.pmka import estimate as est

TS_S = 4.8e-3
SR_VS = 10.0 * TS_S
NR = 16732.6
BEAT, ZERO = 200, 120


def rom_words(ct: tuple[float, float] = (1.0, 1.0), zero_vs: float = 0.0, slope: float = 0.0) -> list[int]:
    """Words of a ROM whose CT falls by `slope` a point, alike for all integrators."""
    words = [1, 77, 3, -20, 40, 4800]
    for _ in range(4):
        for point in range(3):
            words += [round((c - 1.0 - slope * point) / est.CT_LSB) for c in ct] + [round(zero_vs / est.ZERO_LSB_VS)]
    words.append(-sum(words))
    return [w & 0xFFFF for w in words]


def columns(
    inputs_v: np.ndarray,
    *,
    ct: tuple[float, float] = (1.0, 1.0),
    zero_vs: float = 0.0,
    rounding: bool = True,
    nr: float = NR,
) -> dict[str, est.Floats]:
    """What PMKA_CODES and PMKA_STATE would say of steady inputs in each Ts, (n, 3), all sampled at once.

    A reset is worth CT(s) Sr at the input, and Nr(s) = nr CT(s) codes. Hand-overs at the sampling instants.
    """
    n = len(inputs_v)
    u = np.array([100.0, 2000.0, -3000.0, 500.0])  # codes
    lsb_vs = SR_VS / nr
    code, reset, serves = np.zeros((n, 4)), np.zeros((n, 4)), np.zeros((n, 4))
    tau, cal = np.zeros(n), np.zeros(n)
    for k in range(1, n):
        code[k - 1] = np.rint(u) if rounding else u
        beat, age = (k - 1) // BEAT % 5 + 1, (k - 1) % BEAT
        resting = beat - 2 if 2 <= beat <= 4 else 3
        tau[k] = beat
        cal[k] = est.CAL_ZERO if 1 <= age <= ZERO else est.CAL_RESETS if ZERO < age < BEAT - 1 else 0
        for i in range(4):
            axis = None if i == resting else resting if i == 3 else i
            serves[k, i] = 0 if axis is None else axis + 1
            forced = axis is None and cal[k] == est.CAL_RESETS
            s = np.sign(u[i]) if abs(u[i]) > 11469 or forced else 0.0
            reset[k, i] = s
            u[i] += (zero_vs + (0.0 if axis is None else inputs_v[k, axis] * TS_S)) / lsb_vs
            u[i] -= s * nr * ct[est.PLUS if s > 0 else est.MINUS]
    code[-1] = np.rint(u) if rounding else u
    out = {name: code[:, i] * est.CODE_V for i, name in enumerate(est.INTEGRATORS)}
    out |= {f"RESET_{name}": reset[:, i] for i, name in enumerate(est.INTEGRATORS)}
    out |= {f"SERVES_{name}": serves[:, i] for i, name in enumerate(est.INTEGRATORS)}
    flags = dict.fromkeys(("SATURATED", "CLIPPED"), np.zeros(n))
    return out | flags | {"SEQ": np.arange(n) % 65536.0, "TAU": tau, "CAL": cal, "T": np.full(n, 20.0)}


def waves(n: int) -> np.ndarray:
    t = np.arange(n) * TS_S
    return np.column_stack([6.0 * np.sin(7.0 * t), 1.2 + 0 * t, -0.6 + 2.0 * np.cos(3.0 * t)])


def test_without_rounding_the_sum_is_exact() -> None:
    inputs = waves(3000)
    p = est.periods_of(columns(inputs, rounding=False, zero_vs=3e-7))
    # codes are whole numbers: half a one at either end of each turn of an integrator
    got = est.integrals_vs(p, est.rom_of(rom_words()))
    assert got[0].tolist() == [0.0, 0.0, 0.0]
    want = np.cumsum(inputs, axis=0) * TS_S
    assert got[-1] == pytest.approx(want[-1] - want[0], abs=12 * SR_VS / NR)


def test_resets_of_either_sign_count_what_the_rom_says() -> None:
    ct = (1.0 + 400 * est.CT_LSB, 1.0 - 500 * est.CT_LSB)
    inputs = waves(3000)
    c = columns(inputs, ct=ct)
    p, rom = est.periods_of(c), est.rom_of(rom_words(ct))
    want = (np.cumsum(inputs, axis=0) * TS_S)[-1] - inputs[0] * TS_S
    assert est.integrals_vs(p, rom)[-1] == pytest.approx(want, abs=12 * SR_VS / NR)
    swapped = replace(rom, ct=rom.ct[:, :, ::-1])
    assert abs(est.integrals_vs(p, swapped)[-1][1] - want[1]) > 1e-3


def test_calibrations_give_reset_and_zero() -> None:
    ct = (1.0 + 400 * est.CT_LSB, 1.0 - 500 * est.CT_LSB)
    zero_vs = 4.2e-7
    p = est.periods_of(columns(waves(2050), ct=ct, zero_vs=zero_vs))
    for i in range(4):
        c = est.calibrate(p, i)
        assert len(c.nr) == len(c.zero) == (4 if i == 3 else 2)  # of the last beat there is too little
        assert c.nr.mean(axis=0) == pytest.approx([NR * ct[0], NR * ct[1]], abs=0.05)
        assert c.zero.mean() == pytest.approx(zero_vs / (SR_VS / NR), abs=1.0 / ZERO)


def test_a_zero_is_a_rate_per_ts() -> None:
    zero_vs = 3e-5  # ten codes a Ts
    p = est.periods_of(columns(waves(1001), zero_vs=zero_vs))
    for i in range(4):
        assert est.calibrate(p, i).zero == pytest.approx(zero_vs / (SR_VS / NR), abs=1.0 / ZERO)


def test_a_zero_run_with_a_reset_in_it_is_used() -> None:
    """The one that came from work may be beyond Uc: Nr of its sign goes back into the run."""
    c = columns(waves(2100), zero_vs=4.2e-7)
    p = est.periods_of(c)
    runs = est.runs((p.cal == est.CAL_ZERO) & (p.serves[:, 1] == 0))
    first, last = runs[0]
    code, reset = p.code.copy(), p.reset.copy()
    for sign, at in ((1, first + 3), (-1, first + 50)):
        code[at : last + 1, 1] -= sign * NR
        reset[at, 1] += sign
    changed = replace(p, code=code, reset=reset)
    assert est.calibrate(changed, 1).zero == pytest.approx(est.calibrate(p, 1).zero, abs=2.0 / ZERO)


def test_nr_between_two_calibrations() -> None:
    c = est.Calibration(
        nr_at=np.array([100.0, 300.0]),
        nr=np.array([[10.0, 20.0], [12.0, 26.0]]),
        zero_at=np.array([50.0]),
        zero=np.array([0.25]),
    )
    at = np.array([0.0, 150.0, 400.0])
    assert c.nr_of(est.PLUS, at).tolist() == [10.0, 10.5, 12.0]
    assert c.nr_of(est.MINUS, at).tolist() == [20.0, 21.5, 26.0]
    assert c.zero_of(at).tolist() == [0.25, 0.25, 0.25]


def test_figures_of_the_article() -> None:
    """Sources, instruments 4.2: Ur 5.106 V, Nr 16733, 2.87e-6 V s and 2.34e-5 m/s a code, 0.392 m/s a reset."""
    ur_v = 10.0 * TS_S / 2 / (10e3 * 0.47e-6)
    assert ur_v == pytest.approx(5.106, abs=5e-4)
    nr = ur_v / est.CODE_V
    assert nr == pytest.approx(16733, abs=1)
    assert est.quantum_vs(nr, TS_S) == pytest.approx(2.87e-6, rel=1e-3)
    one = est.velocity_mps(np.array([est.quantum_vs(nr, TS_S), SR_VS]), ma_v_per_g=1.2, g_mps2=9.8)
    assert one == pytest.approx([2.34e-5, 0.392], rel=2e-3)


def test_rom_words() -> None:
    rom = est.rom_of(rom_words((1.001, 0.999), zero_vs=-2.5e-7, slope=100 * est.CT_LSB))
    assert (rom.serial, rom.degc.tolist()) == (77, [-20.0, 20.0, 60.0])
    assert rom.ts_s == pytest.approx(4.8e-3)
    assert rom.ct[2, 0] == pytest.approx([1.001, 0.999], abs=est.CT_LSB)
    assert rom.zero_vs == pytest.approx(np.full((4, 3), -2.5e-7), abs=1e-10)
    at = rom.ct_at(3, est.MINUS, np.array([-60.0, 0.0, 20.0, 100.0]))
    assert at == pytest.approx(0.999 - np.array([0.0, 50.0, 100.0, 200.0]) * est.CT_LSB, abs=est.CT_LSB)
    assert rom.zero_at_vs(0, np.array([5.0])) == pytest.approx([-2.5e-7], abs=1e-10)


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda w: [2, *w[1:]], "expected layout 1, got 2"),
        (lambda w: [], "expected layout 1, got none"),
        (lambda w: w[:-1], "expected 43 words for 3 points, got 42"),
        (lambda w: [*w[:20], w[20] ^ 0x40, *w[21:]], "expected words with the sum 0"),
    ],
)
def test_a_rom_that_is_none(change: object, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        est.rom_of(change(rom_words()))  # type: ignore[operator]


def test_what_is_lost_is_not_made_up() -> None:
    c = columns(waves(60))
    with pytest.raises(ValueError, match="expected every reading once, got 1 gaps, the first after SEQ 29"):
        est.periods_of({k: np.delete(v, 30) for k, v in c.items()})
    for flag in ("SATURATED", "CLIPPED"):
        bad = c[flag].copy()
        bad[17] = 4.0
        with pytest.raises(ValueError, match=f"{flag}: expected 0 in all readings, got 1 in 1, the first with SEQ 17"):
            est.periods_of(c | {flag: bad})
    wrapped = c | {"SEQ": (c["SEQ"] + 65500) % 65536}
    assert len(est.periods_of(wrapped)) == 60


def test_without_calibration_there_is_no_answer() -> None:
    p = est.periods_of(columns(waves(2100)))
    nothing = replace(p, cal=np.zeros_like(p.cal))
    with pytest.raises(ValueError, match="integrator Y: expected a run of both signs"):
        est.calibrate(nothing, 1)
    no_zero = replace(p, cal=np.where(p.cal == est.CAL_ZERO, 0, p.cal))
    with pytest.raises(ValueError, match="integrator K: expected a run at rest"):
        est.calibrate(no_zero, 3)


def test_runs() -> None:
    mask = np.array([True, True, False, True, False, False, True])
    assert est.runs(mask) == [(0, 1), (3, 3), (6, 6)]
    assert est.runs(np.zeros(3, dtype=bool)) == []
