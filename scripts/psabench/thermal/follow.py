"""Whether the chamber follows its ramp, and the case the chamber: a run that measures something else has to stop."""

from __future__ import annotations

import math
from collections import deque

from psabench.errors import BenchError, expected
from psabench.thermal.schedule import Setting

RAMP_K = 1.5  # that the chamber's reading may be off its ramp
CASE_K = 1.0  # that the case may be outside of what the chamber has read
CASE_S = 1800.0  # so far back: five times the longest lag of a case (360 s) and more
LEFT = math.exp(-CASE_S / 360.0)  # of an older temperature, after that


class FollowCheck:
    """Looks at each recording: `see` raises BenchError with what was to be expected and what is."""

    def __init__(self) -> None:
        self._setting: Setting | None = None
        self._from_degc = self._at_s = 0.0
        self._readings: deque[tuple[float, float]] = deque()
        self._low = self._high = math.nan

    def note_setting(self, setting: Setting, t_s: float, shown_degc: float) -> None:
        """The chamber was set; shown_degc: what it showed then."""
        self._setting, self._from_degc, self._at_s = setting, shown_degc, t_s
        self.note_reading(t_s, shown_degc)

    def note_reading(self, t_s: float, shown_degc: float) -> None:
        """Of the chamber."""
        self._readings.append((t_s, shown_degc))
        while self._readings[0][0] < t_s - CASE_S and len(self._readings) > 1 and self._readings[1][0] <= t_s - CASE_S:
            self._readings.popleft()
        self._low = shown_degc if math.isnan(self._low) else min(self._low, shown_degc)
        self._high = shown_degc if math.isnan(self._high) else max(self._high, shown_degc)

    def expected_degc(self, t_s: float) -> float:
        """Of the air, by the last setting."""
        assert self._setting
        way = self._setting.temp_degc - self._from_degc
        gone = self._setting.ramp_k_per_min / 60.0 * max(t_s - self._at_s, 0.0)
        return self._from_degc + math.copysign(min(gone, abs(way)), way)

    def see(self, t_s: float, shown_degc: float, case_degc: float) -> None:
        """Raises BenchError."""
        self.note_reading(t_s, shown_degc)
        if self._setting is None:
            return
        want = self.expected_degc(t_s)
        if abs(shown_degc - want) > RAMP_K:
            after = f"{(t_s - self._at_s) / 60.0:.3g} min after it was set to {self._setting.temp_degc:g}"
            raise BenchError(
                expected(f"{want:.1f} degC {after}", f"{shown_degc:.1f}: it does not follow or reads wrong", "chamber")
            )
        # The case is a mean of what the air has been, so it is between the extremes, but for what is older.
        recent = [t for _, t in self._readings]
        low = min(recent) - CASE_K - LEFT * (min(recent) - self._low)
        high = max(recent) + CASE_K + LEFT * (self._high - max(recent))
        if not low <= case_degc <= high:
            what = f"{low:.1f} to {high:.1f} degC by the chamber's readings of the last {CASE_S / 60.0:.0f} min"
            raise BenchError(
                expected(what, f"{case_degc:.1f}: it does not follow, or one of the two reads wrong", "case")
            )
