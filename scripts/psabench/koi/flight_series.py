"""What a flight leaves behind second by second."""

from __future__ import annotations

from typing import Any

import numpy as np

from psabench.link.signals import Floats
from psabench.native.koi import Kind, Koi

SIGMA_S = 10  # between rows of standard deviations


class FlightSeries:
    """Rows of solutions every second, standard deviations and sums of innovations every 10 s."""

    def __init__(self) -> None:
        self._t_s, self._autonomous, self._hybrid = list[float](), list[Floats](), list[Floats]()
        self._sd_t_s, self._sd = list[float](), list[Floats]()
        self._nis: list[list[tuple[float, int]]] = []

    def add(self, t_s: float, autonomous: Floats, hybrid: Floats, koi: Koi) -> None:
        self._t_s.append(t_s)
        self._autonomous.append(autonomous)
        self._hybrid.append(hybrid)
        if len(self._t_s) % SIGMA_S == 1:
            self._sd_t_s.append(t_s)
            self._sd.append(koi.sd)
            taken = koi.state.taken
            self._nis.append([(taken[kind].nis_sum, taken[kind].nis_dof) for kind in Kind])

    def ground(self) -> tuple[Floats, Floats, Floats]:
        """Time, speed and heading of the hybrid solution so far, (m,) each. Axis 1 of the unit points ahead."""
        rows = np.array(self._hybrid).reshape(-1, 15)
        return np.array(self._t_s), np.hypot(rows[:, 3], rows[:, 4]), np.arctan2(rows[:, 6], rows[:, 9])

    def arrays(self) -> dict[str, Any]:
        """As FlightFound has them."""
        nis = np.array(self._nis, dtype=float).reshape(-1, len(Kind), 2)
        return {
            "t_s": np.array(self._t_s),
            "autonomous": np.array(self._autonomous).reshape(-1, 15),
            "hybrid": np.array(self._hybrid).reshape(-1, 15),
            "sd_t_s": np.array(self._sd_t_s),
            "sd": np.array(self._sd),
            "nis_sum": {kind.name.lower(): nis[:, i, 0] for i, kind in enumerate(Kind)},
            "nis_dof": {kind.name.lower(): nis[:, i, 1] for i, kind in enumerate(Kind)},
        }
