"""What became of a gyro unit in navigation since somebody looked: the unit counts, the host asks now and then.

A fault that came and went between two looks is in the counts of the unit (object 2108h) with the step in which it
began; a reset shows in the count of its steps, which goes on with time. So nothing has to be received in between.
"""

from __future__ import annotations

from collections.abc import Mapping

from psabench.boards.gyro.device import Began, Flag, Gyro, Mode

FLAG_WORDS: Mapping[Flag, str] = {
    Flag.SATURATED: "a torquer is at its limit",
    Flag.LEVEL_LOST: "the level sensors are silent or lose frames",
    Flag.ENCODER_FAULT: "the angle sensor does not follow the torquer: it is stuck, or the torquer is dead",
    Flag.NOT_SETTLED: "the platform does not settle",
}
CLOCK_S, CLOCK_PART = 2.0, 0.01  # so far the unit's clock and the bench's may be apart: latency, wall pace


class NavigationWatch:
    """From the instant at which navigation begins."""

    def __init__(self, gyro: Gyro, t_s: float) -> None:
        """t_s: bench time, here and below."""
        self._gyro = gyro
        self._step_s = gyro.step_s
        self._begun_s, self._begun_steps = t_s, gyro.steps
        self._seen = {flag: began.count for flag, began in gyro.began().items()}
        self._latest: dict[Flag, str] = {}  # what was said of each
        self._reset = ""

    def faults(self, t_s: float) -> tuple[str, ...]:
        """In words: what is, and what began since the call before; the same as long as it is."""
        said = self._lost(t_s)
        flags, began = self._gyro.flags, self._gyro.began()
        for flag, words in FLAG_WORDS.items():
            new = self._count(flag, began[flag])
            if new:
                self._latest[flag] = words + self._when(new, began[flag])
            if new or flag in flags:
                said.append(self._latest.get(flag, words))
        return tuple(said)

    def _count(self, flag: Flag, began: Began) -> int:
        """How often it began since the call before. The unit forgets with a reset and with a mode."""
        before, self._seen[flag] = self._seen[flag], began.count
        return began.count - before if began.count >= before else began.count

    def _when(self, count: int, began: Began) -> str:
        into_s = 0.0 if self._reset else (began.step - self._begun_steps) * self._step_s
        after = "" if self._reset else f", {into_s:.0f} s into navigation"
        return after if count == 1 else f", {count} times{after and ', the last' + after[1:]}"

    def _lost(self, t_s: float) -> list[str]:
        """Navigation itself: a unit that was reset has lost what it was given, whatever its mode is now."""
        mode, steps = self._gyro.mode, self._gyro.steps
        passed_s = t_s - self._begun_s
        behind_s = passed_s - (steps - self._begun_steps) * self._step_s
        if not self._reset and behind_s > CLOCK_S + CLOCK_PART * passed_s:
            at_s = max(0.0, passed_s - steps * self._step_s)
            self._reset = f"reset, or without power for a while, {at_s:.0f} s into navigation"
            self._seen = dict.fromkeys(self._seen, 0)
        if mode is not Mode.NAVIGATE:
            why = self._reset or "another client set it"
            return [f"the unit left navigation, its mode is {mode.name.lower()}: {why}"]
        return [f"the unit was {self._reset}: what it was given is lost"] if self._reset else []
