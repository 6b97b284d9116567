"""Readings of a PMKA from a log: pairs of its two messages as columns; its integrals by the article's equations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from psabench.boards.pmka import estimate as est
from psabench.conform.capture.intervals import fact
from psabench.conform.capture.log import CanFrame, CanLog, Capture
from psabench.conform.proves import row_for
from psabench.conform.verdict import Inconclusive, conclusive, damaged_data_are, expect
from psabench.link.signals import Floats

CODES, STATE = "PMKA_CODES", "PMKA_STATE"
MILLI = 1e3


def columns(e: Capture, least: int = 10) -> dict[str, Floats]:
    """Signals of whole readings, codes in V and T in degC as the DBC has them. Raises Inconclusive, Failed."""
    return dict(_columns(e.can, e.variant.family, e.node, least))


@lru_cache(maxsize=8)
def _columns(can: CanLog, board: str, node: int, least: int) -> Mapping[str, Floats]:
    codes, states = can.of(CODES, board, node), can.of(STATE, board, node)
    if min(len(codes), len(states)) < least:
        raise Inconclusive(f"{len(codes)} PMKA_CODES, {len(states)} PMKA_STATE came; expected {least} of each")
    pairs = _pairs(can, codes.frames[0].can_id, states.frames[0].can_id)
    conclusive(len(pairs) >= least, f"{len(pairs)} PMKA_CODES had their PMKA_STATE; expected {least}")
    found: dict[str, Floats] = {}
    try:
        for name, frames in ((CODES, [p[0] for p in pairs]), (STATE, [p[1] for p in pairs])):
            found |= {k: v.astype(np.float64) for k, v in CanLog(frames=tuple(frames)).raw(name).items()}
    except ValueError as err:
        raise Inconclusive(f"messages of a wrong length: {err}") from err
    for axis in est.INTEGRATORS:
        found[axis] = found[axis] * est.CODE_V
    found["T"] = found["T"] / 128.0
    return found


def _pairs(can: CanLog, codes_id: int, state_id: int) -> list[tuple[CanFrame, CanFrame]]:
    pairs, waits = [], None
    for f in can.frames:
        if f.sent or f.error:
            continue
        if f.can_id == codes_id:
            waits = f
        elif f.can_id == state_id and waits is not None:
            pairs.append((waits, f))
            waits = None
    return pairs


@dataclass(frozen=True, kw_only=True)
class Run:
    """A long recording, what its calibrations gave, and what the ROM corrects."""

    periods: est.Periods
    calibrations: list[est.Calibration]
    rom: est.Rom
    inputs_v: Mapping[str, float]

    @property
    def ends(self) -> tuple[int, int]:
        """First and last reading at which each axis is on its own integrator."""
        home = self.periods.serves[:, 3] == 0
        both = np.flatnonzero(home & np.roll(home, 1))[1:]
        conclusive(len(both) >= 2, "the spare is never free")
        return int(both[0]), int(both[-1])

    def error_mmps(self, e: Capture, integral_vs: Floats) -> Floats:
        """Of integrals (n, 3) between the ends against the known input, mm/s by axis. Raises Inconclusive."""
        row = row_for(e, "PMKA-INT-02")
        first, last = self.ends
        took_s = self.rom.ts_s * (last - first)
        if took_s < row.limit("duration_s"):
            raise Inconclusive(f"{took_s:.1f} s were recorded; expected {row.limit('duration_s'):g} s")
        due_vs = np.array([self.inputs_v[a] for a in "xyz"]) * took_s
        error_vs = integral_vs[last] - integral_vs[first] - due_vs
        return np.asarray(error_vs * row.limit("g_mps2") / row.limit("ma_v_per_g") * MILLI, np.float64)


def run_of(e: Capture) -> Run:
    """Raises Inconclusive where calibrations, ROM or inputs are missing, Failed where readings are."""
    lacking = "the ROM, or the volts at the three inputs, are not known"
    words = fact(e, "rom", lacking)
    conclusive(len(e.inputs_v) >= 3, lacking)
    with damaged_data_are(Inconclusive):
        rom = est.rom_of(words)
        periods = est.periods_of(columns(e))
        calibrations = [est.calibrate(periods, i) for i in range(4)]
    return Run(periods=periods, calibrations=calibrations, rom=rom, inputs_v=e.inputs_v)


def largest(e: Capture, run: Run, integral_vs: Floats, most_mmps: float) -> str:
    """Raises Failed where an axis is off by more than that."""
    error = run.error_mmps(e, integral_vs)
    saw = f"{', '.join(f'{v:.2f}' for v in error)} mm/s on X, Y, Z"
    return expect(np.abs(error).max() <= most_mmps, saw, f"{most_mmps:g} mm/s at most")
