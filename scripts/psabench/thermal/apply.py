"""Compensations at work: readings of a unit as acceleration, by the curves of its passport.

With a the acceleration along the axes of the case, g, +1 where gravity is along the axis, an axis of the unit reads

    u_i = K_i(T) (a_i + z_i(T) + sum over j of b_ij(T) a_j),    j other than i

K the scale, z the zero, b the base error (`psabench.thermal.reduce` finds them so). Each curve takes the temperature of
its element: where it has a lag, that of an element which follows the case.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from psabench.boards.psa2.frames import Frames
from psabench.errors import BadInput, expected
from psabench.passport.store import UnitRun
from psabench.thermal.bench import CASE_CHANNEL, SENSOR_HIGH_C, SENSOR_LOW_C, input_v
from psabench.thermal.compensation import Array, Compensation, element_temperature
from psabench.thermal.reduce import ARCSEC, AXES, quantity_names

Case = tuple[Array, Array]  # instants, s, and temperatures of the case, degC; (m,) each


def has_every_curve(run: UnitRun) -> bool:
    """Whether readings can be compensated by it."""
    return run.curves.keys() >= set(quantity_names())


@dataclass(frozen=True, slots=True)
class _Followed:
    """A case so far, and how far behind it an element of each time constant is."""

    t_s: float
    case_c: float
    behind_k: Mapping[float, float]


class Compensator:
    """Takes the readings of one log, some at a time. clamped: how many were outside of a curve's range; blind: how many
    came before a temperature of the case that its sensor can have; open: how many had one that it cannot have, so that
    the last one holds.

    filter_gain: of the converters at DC, which a thermal run takes out of its readings, too (`Psa2.filter_gain`).
    """

    def __init__(self, curves: Mapping[str, Compensation], filter_gain: float = 1.0) -> None:
        missing = [name for name in quantity_names() if name not in curves]
        if missing:
            raise BadInput(expected("curves of zero, scale and base of each axis", f"none of {missing[0]}", "passport"))
        self._curves, self._gain = curves, filter_gain
        self._taus = {c.lag.tau_s for c in curves.values() if c.lag}
        self._past: _Followed | None = None
        self.clamped = self.blind = self.open = 0

    def accelerations_g(self, frames: Frames) -> Array:
        """Along the axes of the case, g, (n, 3); NaN up to the first temperature of the case.

        Raises BadInput for frames whose form has no temperatures.
        """
        t_s = frames.t_rx_s  # the board's stamps begin again after a pause
        case = self._case_of(t_s, frames)
        if case is None:
            self.blind += len(frames)
            return np.full((len(frames), 3), np.nan)
        return self._solve(input_v(frames.u_v, self._gain), self._values_at(t_s, case))

    def columns(self, frames: Frames) -> dict[str, Array]:
        """For a table."""
        return dict(zip(("a_x_g", "a_y_g", "a_z_g"), self.accelerations_g(frames).T, strict=True))

    def _case_of(self, t_s: Array, frames: Frames) -> Case | None:
        """From what is known of before; None: nothing yet."""
        if len(frames) and self._past is None and not np.any(frames.temp_code):
            raise BadInput(
                expected("frames with temperatures, as each form but 1 (fast) has them", "none", "--passport")
            )
        degc = frames.temp_degc  # NaN, or near 0 K, where the sensor is open
        of_case = frames.temp_channel == CASE_CHANNEL
        told = of_case & (degc >= SENSOR_LOW_C) & (degc <= SENSOR_HIGH_C)
        self.open += int(np.count_nonzero(of_case & ~told))
        known_t, known_c = t_s[told], frames.temp_degc[told]
        if self._past is not None:
            known_t, known_c = np.append(self._past.t_s, known_t), np.append(self._past.case_c, known_c)
        later = np.diff(known_t, prepend=-np.inf) > 0.0  # frames of a block may have arrived in one instant
        return (known_t[later], known_c[later]) if len(known_t) else None

    def _values_at(self, t_s: Array, case: Case) -> dict[str, Array]:
        """Each curve at each reading, (n,)."""
        behind = {tau: self._behind_k(case, tau) for tau in self._taus}
        case_c = np.interp(t_s, *case)
        outside, values = np.zeros(len(t_s), np.bool_), {}
        for name, curve in self._curves.items():
            late_k = np.interp(t_s, case[0], behind[curve.lag.tau_s]) if curve.lag else np.zeros(len(t_s))
            element_c = case_c - late_k
            outside |= (element_c < curve.low_c) | (element_c > curve.high_c)
            values[name] = curve.value_at(element_c, late_k)
        self.clamped += int(np.count_nonzero(outside))
        self._past = _Followed(float(case[0][-1]), float(case[1][-1]), {tau: float(b[-1]) for tau, b in behind.items()})
        return values

    def _behind_k(self, case: Case, tau_s: float) -> Array:
        began_k = self._past.behind_k[tau_s] if self._past else 0.0
        return np.asarray(case[1] - element_temperature(*case, tau_s, began_k))

    @staticmethod
    def _solve(u_v: Array, values: Mapping[str, Array]) -> Array:
        read_g = np.empty_like(u_v)
        mixing = np.tile(np.eye(3), (len(u_v), 1, 1))
        for i, a in enumerate(AXES):
            read_g[:, i] = u_v[:, i] / values[f"scale_{a}_v_per_g"] - values[f"zero_{a}_ug"] * 1e-6
            for j, b in enumerate(AXES):
                if i != j:
                    mixing[:, i, j] = values[f"base_{a}{b}_arcsec"] / ARCSEC
        return np.asarray(np.linalg.solve(mixing, read_g[:, :, None])[:, :, 0])
