"""PMKA: the coefficient of an integrator's input, K_IN = 1/(R_IN C), from frames alone, and what it is good for.

    dU = K_IN Ua Ts (1);   Nr = KADC Ur = KADC Kr UREF Ts/2,  Kr = 1/(Rr C) (2);   so  KADC K_IN = Nr / (Sr CT)   (6)

The article names two ways to keep the drift of the capacitor out of the result: measure K_IN at work, in the mode
"calibration", or indirectly measure the reset at Ua = 0. A known input for the first it does not describe. The second
gives the same coefficient, for Rr/RIN is known: CT of the ROM. What comes out is K_PSA = KADC K_IN, codes per V s: the
gain of the converter is in it, as it is in the codes.

The calibrations here differ in how old Nr is: that of the printed parts, that of the first rotation, that of each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from psabench.boards.pmka.estimate import (
    AXES,
    CODE_V,
    MINUS,
    PLUS,
    UREF_V,
    Calibration,
    Floats,
    Periods,
    Rom,
    increments_vs,
)

R_IN_OHM, CAP_F = 20e3, 0.47e-6  # article, the figures after (7); RIN = 2 Rr
K_IN_PRINTED = 1.0 / (R_IN_OHM * CAP_F)  # 1/s


def k_psa(cal: Calibration, rom: Rom, integrator: int, degc: Floats, at: Floats) -> Floats:
    """KADC K_IN at readings `at`, codes per V s, (k,): the mean of what the resets of either sign give.

    degc: (n,) of the same recording.
    """
    here_degc = np.interp(at, np.arange(len(degc)), degc)
    by_sign = [cal.nr_of(sign, at) / rom.ct_at(integrator, sign, here_degc) for sign in (PLUS, MINUS)]
    k: Floats = (by_sign[0] + by_sign[1]) / (2.0 * UREF_V * rom.ts_s)
    return k


def k_in_per_s(cal: Calibration, rom: Rom, integrator: int, degc: Floats, at: Floats) -> Floats:
    """K_IN, 1/s, with the converter's nominal gain: its error is the error of this figure, not of the integrals."""
    return k_psa(cal, rom, integrator, degc, at) * CODE_V


def held(cal: Calibration) -> Calibration:
    """As if the integrator had been calibrated in the first rotation alone."""
    return replace(cal, nr_at=cal.nr_at[:1], nr=cal.nr[:1])


def printed(cal: Calibration, rom: Rom) -> Calibration:
    """As if it had never been: the reset of the printed parts, the same for both signs."""
    nr = K_IN_PRINTED / CODE_V * UREF_V * rom.ts_s
    return replace(cal, nr_at=cal.nr_at[:1], nr=np.full((1, 2), nr))


def error_of_increments(
    p: Periods, rom: Rom, calibrations: Sequence[Calibration], inputs_v: Sequence[float], last: int
) -> Floats:
    """Relative error of increments between resets, by axis (3,), in the `last` readings of steady inputs; NaN: none.

    Without a reset an increment knows its integrator's coefficient alone, so its error is that of K_IN. Those in which
    a key moved, which are of less than Ts, are left out.
    """
    out = np.full(len(AXES), np.nan)
    ds = [increments_vs(p, i, cal, rom) for i, cal in enumerate(calibrations)]
    recent = np.arange(len(p)) >= len(p) - last
    for axis, input_v in enumerate(inputs_v):
        alone = (p.serves[:, axis] == axis + 1) & (p.serves[:, 3] != axis + 1)
        own = recent & alone & np.roll(alone, 1) & (p.reset[:, axis] == 0)
        if own.any():
            out[axis] = float(ds[axis][own].mean()) / (input_v * rom.ts_s) - 1.0
    return out
