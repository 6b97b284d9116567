"""Progress and results of procedures as LCM messages: PSABENCH_PROGRESS and PSABENCH_RESULT."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager

from psabench.estimate.uncertainty import Estimate
from psabench.lcm.channel import Publisher
from psabench.procedures.head_bench import Progress
from psabench.progress import Advance

PROGRESS, RESULT = "PSABENCH_PROGRESS", "PSABENCH_RESULT"
EVERY_S = 0.1  # real time between two messages of a step


class LcmProgress:
    """A `Progress` that publishes and hands on. The first and the last part of a step are always published."""

    def __init__(self, publisher: Publisher, procedure: str, inner: Progress) -> None:
        self._publisher, self._procedure, self._inner = publisher, procedure, inner

    def step(self, name: str, total: int) -> AbstractContextManager[Advance]:
        return self._step(name, total)

    @contextmanager
    def _step(self, name: str, total: int) -> Iterator[Advance]:
        done, told_s = 0, time.monotonic()
        self._tell(name, 0, total)
        with self._inner.step(name, total) as shown:

            def advance(note: str = "") -> None:
                nonlocal done, told_s
                done += 1
                shown(note)
                if done == total or time.monotonic() - told_s >= EVERY_S:
                    told_s = time.monotonic()
                    self._tell(name, done, total)

            yield advance

    def _tell(self, step: str, done: int, total: int) -> None:
        values = {"procedure": self._procedure, "step": step, "done": done, "total": total}
        self._publisher.publish(PROGRESS, "progress_t", {"host_ns": time.time_ns(), **values})


def publish_result(
    publisher: Publisher, procedure: str, condition: str, estimates: Sequence[Estimate], within: bool
) -> None:
    """One message with all estimates of a procedure."""
    values = {
        "host_ns": time.time_ns(),
        "procedure": procedure,
        "condition": condition,
        "count": len(estimates),
        "name": [e.name for e in estimates],
        "value": [e.value for e in estimates],
        "sd": [e.sd for e in estimates],
        "unit": [e.unit for e in estimates],
        "within_limits": within,
    }
    publisher.publish(RESULT, "result_t", values)
