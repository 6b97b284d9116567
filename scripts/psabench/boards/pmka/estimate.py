"""PMKA: from codes, resets and calibrations to the integrals of the inputs, eqs (1)-(7) of the article, section 3.

    dS_i = (dN_i / Nr(s)) Sr CT(s) - dS0,     dN_i = N_i - N_(i-1) + s Nr(s),     Sr = UREF Ts          (4), (5)
    S    = Sr [sum s_j CT(s_j) + sum (N_i - N_(i-1)) CT / Nr] - m dS0                                   (7)

s = 1, -1, 0: the reset of the period, Nr(s) = KADC Ur(s) its size in codes, CT(s) the correction of the ROM at the
measured temperature. The capacitor is in Nr alone, which is measured while the integrator is out of work: with its
input at ground each reset shows Nr itself. The zero is what its code gains meanwhile, from the first and the last code
of a run: the roundings of all codes between them cancel. Codes of different integrators are never subtracted from each
other: where an axis is handed over its sum goes on from increment to increment. Axes 0, 1, 2 = X, Y, Z; integrators
0..3 = X, Y, Z, K.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from psabench.errors import expected

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]

INTEGRATORS = ("X", "Y", "Z", "K")
AXES = ("X", "Y", "Z")
CODE_V = 10.0 / 2**15  # article: 16 bits; +-10 V follow from its quantum
UREF_V = 10.0  # article
CAL_ZERO, CAL_RESETS = 1, 2
PLUS, MINUS = 0, 1
ROM_LAYOUT, ROM_HEAD, ROM_ROW = 1, 6, 3
CT_LSB, ZERO_LSB_VS = 2.0**-22, 1e-10


@dataclass(frozen=True, slots=True, kw_only=True)
class Rom:
    """The correction ROM: tables over temperature."""

    serial: int  # low 16 bits
    ts_s: float
    degc: Floats  # (p,)
    ct: Floats  # (4, p, 2): by integrator, point, sign
    zero_vs: Floats  # (4, p): dS0, V s per Ts

    def ct_at(self, integrator: int, sign: int, degc: Floats) -> Floats:
        """CT(sign), linear between the points; outside, that of the nearest one."""
        ct: Floats = np.interp(degc, self.degc, self.ct[integrator, :, sign])
        return ct

    def zero_at_vs(self, integrator: int, degc: Floats) -> Floats:
        """dS0, V s per Ts."""
        zero_vs: Floats = np.interp(degc, self.degc, self.zero_vs[integrator])
        return zero_vs


def rom_of(words: Sequence[int]) -> Rom:
    """The ROM from its 16-bit words. Raises ValueError for one that is damaged or of another layout."""
    w = np.asarray(words, dtype=np.int64) & 0xFFFF
    if len(w) < ROM_HEAD or w[0] != ROM_LAYOUT:
        raise ValueError(expected(f"layout {ROM_LAYOUT}", f"{w[0] if len(w) else 'none'} in {len(w)} words", "ROM"))
    points = int(w[2])
    if len(w) != ROM_HEAD + 4 * ROM_ROW * points + 1:
        raise ValueError(expected(f"{ROM_HEAD + 4 * ROM_ROW * points + 1} words for {points} points", len(w), "ROM"))
    if int(w.sum()) & 0xFFFF:
        raise ValueError(expected("words with the sum 0", f"{int(w.sum()) & 0xFFFF:04X}h", "ROM"))
    signed = np.where(w > 0x7FFF, w - 0x10000, w).astype(np.float64)
    table = signed[ROM_HEAD:-1].reshape(4, points, ROM_ROW)
    return Rom(
        serial=int(w[1]),
        ts_s=float(w[5]) * 1e-6,
        degc=signed[3] + signed[4] * np.arange(points),
        ct=1.0 + table[:, :, :2] * CT_LSB,
        zero_vs=table[:, :, 2] * ZERO_LSB_VS,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Periods:
    """n readings one after the other, none missing; those of row k tell of the period that ended with it."""

    code: Floats  # (n, 4)
    reset: Ints  # (n, 4): 1, -1, 0
    serves: Ints  # (n, 4): axis + 1; 0: input at ground
    cal: Ints  # (n,)
    degc: Floats  # (n,)

    def __len__(self) -> int:
        return len(self.code)


def periods_of(columns: Mapping[str, Floats]) -> Periods:
    """From the columns of PMKA_CODES and PMKA_STATE in the units of the DBC.

    Raises ValueError when a reading is missing, or an amplifier or a code was at its limit: what was lost there no one
    knows.
    """
    seq = columns["SEQ"].astype(np.int64)
    gaps = np.flatnonzero(np.diff(seq) % 0x10000 != 1)
    if len(gaps):
        raise ValueError(expected("every reading once", f"{len(gaps)} gaps, the first after SEQ {seq[gaps[0]]}", "SEQ"))
    for flag in ("SATURATED", "CLIPPED"):
        bad = np.flatnonzero(columns[flag])
        if len(bad):
            raise ValueError(expected("0 in all readings", f"1 in {len(bad)}, the first with SEQ {seq[bad[0]]}", flag))
    return Periods(
        code=np.rint(np.column_stack([columns[i] for i in INTEGRATORS]) / CODE_V),
        reset=np.column_stack([columns[f"RESET_{i}"] for i in INTEGRATORS]).astype(np.int64),
        serves=np.column_stack([columns[f"SERVES_{i}"] for i in INTEGRATORS]).astype(np.int64),
        cal=columns["CAL"].astype(np.int64),
        degc=np.asarray(columns["T"], dtype=np.float64),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """What the calibrations of one integrator gave, one element each, and the reading in the middle of each."""

    nr_at: Floats  # (k,)
    nr: Floats  # (k, 2): codes of a reset, by sign
    zero_at: Floats  # (j,)
    zero: Floats  # (j,): codes per Ts

    def nr_of(self, sign: int, at: Floats) -> Floats:
        """Nr(sign) at readings `at`, linear between two calibrations."""
        nr: Floats = np.interp(at, self.nr_at, self.nr[:, sign])
        return nr

    def zero_of(self, at: Floats) -> Floats:
        """Codes per Ts."""
        zero: Floats = np.interp(at, self.zero_at, self.zero)
        return zero


def runs(mask: npt.NDArray[np.bool_]) -> list[tuple[int, int]]:
    """[first, last] of each row of True."""
    edges = np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8))
    return list(zip(np.flatnonzero(edges == 1).tolist(), (np.flatnonzero(edges == -1) - 1).tolist(), strict=True))


def _resting(p: Periods, integrator: int, cal: int) -> list[tuple[int, int]]:
    """Runs of periods in which it was calibrated so; the code before the first of them is there.

    Those shorter than half of the longest, where a recording begins or ends, say too little.
    """
    mask = (p.cal == cal) & (p.serves[:, integrator] == 0)
    mask[:1] = False
    found = runs(mask)
    longest = max((last - first for first, last in found), default=0)
    return [(first, last) for first, last in found if last - first >= longest / 2]


def _steps(p: Periods, integrator: int, first: int, last: int) -> Floats:
    """N_i - N_(i-1) of the periods first..last."""
    return np.diff(p.code[first - 1 : last + 1, integrator])


def _size_of_reset(steps: Floats, resets: Ints, zero: float) -> tuple[float, float] | None:
    """Nr(+), Nr(-) of a run; None: it does not have both."""
    sizes = [-sign * (steps[resets == sign] - zero) for sign in (1, -1)]
    return (float(sizes[0].mean()), float(sizes[1].mean())) if len(sizes[0]) and len(sizes[1]) else None


def calibrate(p: Periods, integrator: int) -> Calibration:
    """Nr of both signs and the zero of an integrator from all its calibrations. Raises ValueError for want of one."""
    name = INTEGRATORS[integrator]
    nr_at, nr = [], []
    rough = _zero_of_runs(p, integrator, None)
    for first, last in _resting(p, integrator, CAL_RESETS):
        zero = float(np.interp(first, *rough)) if len(rough[0]) else 0.0
        size = _size_of_reset(_steps(p, integrator, first, last), p.reset[first : last + 1, integrator], zero)
        if size:
            nr_at.append((first + last) / 2)
            nr.append(size)
    if not nr:
        raise ValueError(expected("a run of both signs", "no calibrated reset", f"integrator {name}"))
    sizes = (np.array(nr_at), np.array(nr))
    zero_at, zeros = _zero_of_runs(p, integrator, sizes)
    if not len(zeros):
        raise ValueError(expected("a run at rest", "no calibrated zero", f"integrator {name}"))
    return Calibration(nr_at=sizes[0], nr=sizes[1], zero_at=zero_at, zero=zeros)


def _zero_of_runs(p: Periods, integrator: int, nr: tuple[Floats, Floats] | None) -> tuple[Floats, Floats]:
    """Middle and codes per Ts of each run: last code less first, by its length. nr None: only runs without a reset."""
    at, zero = [], []
    for first, last in _resting(p, integrator, CAL_ZERO):
        resets = p.reset[first : last + 1, integrator]
        gained = float(p.code[last, integrator] - p.code[first - 1, integrator])
        middle = (first + last) / 2
        if nr is None and resets.any():
            continue
        if nr is not None:
            gained += int((resets == 1).sum()) * float(np.interp(middle, nr[0], nr[1][:, PLUS]))
            gained -= int((resets == -1).sum()) * float(np.interp(middle, nr[0], nr[1][:, MINUS]))
        at.append(middle)
        zero.append(gained / (last - first + 1))
    return np.array(at), np.array(zero)


def increments_vs(p: Periods, integrator: int, cal: Calibration, rom: Rom, uref_v: float = UREF_V) -> Floats:
    """dS of each period of an integrator, V s, shape (n,), eq. (5); the first reading has none: 0.

    Without a reset the sign is that of the step: CT(s)/Nr(s) hardly depends on it.
    """
    at = np.arange(len(p), dtype=np.float64)
    step = np.diff(p.code[:, integrator], prepend=p.code[:1, integrator])
    reset = p.reset[:, integrator]
    negative = np.where(reset != 0, reset < 0, step < 0)
    nr = np.where(negative, cal.nr_of(MINUS, at), cal.nr_of(PLUS, at))
    ct = np.where(negative, rom.ct_at(integrator, MINUS, p.degc), rom.ct_at(integrator, PLUS, p.degc))
    ds = (step + reset * nr - cal.zero_of(at)) / nr * (uref_v * rom.ts_s) * ct
    ds[:1] = 0.0
    return ds


def integrals_vs(
    p: Periods, rom: Rom, calibrations: Sequence[Calibration] | None = None, uref_v: float = UREF_V
) -> Floats:
    """Integral of each axis since the first reading, V s, shape (n, 3), eq. (7).

    calibrations: by integrator; None: from the readings themselves. The integral of row k goes to the sampling instant
    of the integrator that has the axis; where K gives it back, to that instant.
    """
    if calibrations is None:
        calibrations = [calibrate(p, i) for i in range(len(INTEGRATORS))]
    ds = np.column_stack([increments_vs(p, i, calibrations[i], rom, uref_v) for i in range(len(INTEGRATORS))])
    out = np.empty((len(p), len(AXES)))
    for axis in range(len(AXES)):
        out[:, axis] = np.cumsum(np.where(p.serves == axis + 1, ds, 0.0).sum(axis=1))
    return out


def quantum_vs(nr: float, ts_s: float, uref_v: float = UREF_V) -> float:
    """What a code is worth at the input, V s: Sr / Nr, the inverse of (6)."""
    return uref_v * ts_s / nr


def velocity_mps(integral_vs: Floats, *, ma_v_per_g: float, g_mps2: float) -> Floats:
    """Velocity of an accelerometer with Ma volts a g, m/s."""
    return integral_vs * (g_mps2 / ma_v_per_g)
