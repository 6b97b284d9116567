"""The first pass of a calibration while its run goes on: what the progress line shows of it.

A look, not a result: the estimate is made of the whole recording afterwards. It follows the unit's readings up to the
table's last angle, if there are any.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from psabench.native.nav import Floats, Refused
from psabench.native.sins import Sins, SinsConfig, feed_data
from psabench.sins.parameters import SCALES, state_parameters
from psabench.sins.table import AXES, attitudes


class LivePass:
    """A `table_run.Follower`."""

    def __init__(self, config: Callable[[float], SinsConfig], azimuth_rad: float) -> None:
        """config: of the interval of the readings, which shows with the first of them."""
        self._config, self._azimuth_rad = config, azimuth_rad
        self._filter: Sins | None = None
        self._zero_s = 0.0
        self._fed = 0
        self._waiting: list[tuple[Floats, Floats]] = []
        self._refused = ""

    def take(self, end_s: Floats, dtheta_rad: Floats, dv_mps: Floats) -> None:
        """With angles of the table, readings wait for them."""
        if self._filter is None and len(end_s) > 1:
            interval_s = float(end_s[-1] - end_s[0]) / (len(end_s) - 1)
            self._zero_s = float(end_s[0]) - interval_s
            start = attitudes(self._azimuth_rad, np.zeros((1, AXES)))[0]
            self._filter = Sins(self._config(interval_s), start, feedback=True)
        self._waiting.append((dtheta_rad, dv_mps))
        if self._filter and not self._filter.cfg.stand:
            self._go(self._filter, math.inf, None)

    def follow(self, at_s: Floats, angles_deg: Floats) -> None:
        """Through the readings that these angles came for."""
        if self._filter and len(at_s):
            stand_s = at_s - self._zero_s
            self._go(self._filter, float(stand_s[-1]), (stand_s, attitudes(self._azimuth_rad, np.radians(angles_deg))))

    def _go(self, s: Sins, to_s: float, stand: tuple[Floats, Floats] | None) -> None:
        """A refusal ends the pass, not the run."""
        if self._refused:
            return
        dtheta, dv = (np.concatenate([x[k] for x in self._waiting]) for k in range(2))
        count = min(len(dtheta), max(math.floor(to_s / s.cfg.sample_s) - self._fed, 0) if stand else len(dtheta))
        try:
            feed_data(s, dtheta[:count], dv[:count], stand, first=self._fed)
        except Refused as e:
            self._refused = str(e)
        self._fed += count
        self._waiting = [(dtheta[count:], dv[count:])]

    @property
    def words(self) -> str:
        """The time, and of each kind of parameter the largest standard deviation."""
        if self._refused:
            return f"live filter: {self._refused}"
        if self._filter is None:
            return ""
        return f"{self._fed * self._filter.cfg.sample_s:.0f} s, sd {sigma_words(self._filter)}"


def sigma_words(s: Sins) -> str:
    """Of each block the largest standard deviation, of each of its units: ν 0.012 °/h, Θ 3.1 ppm 2.0 ″, ..."""
    sd = np.sqrt(np.diag(s.covariance()[1]))
    largest: dict[str, float] = {}
    for _, key, k in state_parameters(s.rows, s.cfg):
        largest[key] = max(largest.get(key, 0.0), float(sd[k]) * SCALES[key].per_si)
    words: dict[str, str] = {}
    for key, x in largest.items():
        symbol = SCALES[key].symbol.format(i="", j="")
        words[symbol] = f"{words.get(symbol, symbol)} {_short(x)} {SCALES[key].unit}"
    return ", ".join(words.values())


def _short(x: float) -> str:
    return f"{x:.0f}" if x >= 100.0 else f"{x:.2g}"
