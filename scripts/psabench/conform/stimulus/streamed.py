"""What stimuli of boards that send readings have in common: one take, from Res to some readings, a while of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import wraps

from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut, Take
from psabench.conform.plan import stimulus

BOOT_S = 0.002


@contextmanager
def while_streaming(s: Dut) -> Iterator[None]:
    """Readings flow within."""
    s.unit.start()
    yield
    s.unit.stop()


def recorded(
    name: str,
    *,
    boards: Iterable[str],
    lines: bool = True,
    streaming: bool = False,
    facts: Callable[[Dut], Mapping[str, object]] = lambda _: {},
    around: Callable[[Dut], AbstractContextManager[object]] = nullcontext,
    before: Callable[[Dut], object] = lambda _: None,
    after: Callable[[Dut], object] = lambda _: None,
) -> Callable[[Callable[[Dut, Take], None]], Callable[[Dut], Capture]]:
    """A @stimulus that is one take from its begin to its end, with the lines or without, while readings flow or not.

    before, after: bring the board to a known state; around: the same where it must be done after a failure, too.
    facts: what else is noted, as it was just before the take.
    """

    def register(play: Callable[[Dut, Take], None]) -> Callable[[Dut], Capture]:
        @stimulus(name, boards=boards)
        @wraps(play)
        def make(s: Dut) -> Capture:
            before(s)
            noted = facts(s)
            with around(s), s.take(lines=lines) as take, while_streaming(s) if streaming else nullcontext():
                play(s, take)
            take.facts |= noted
            after(s)
            return s.capture(name, take)

        return make

    return register


def from_res(s: Dut, dwell_s: float) -> Capture:
    """The stimulus power_on: Res, and readings from as soon as it has booted.

    facts: prompt, in lockstep alone: the start came before the first reading.
    """
    with s.take() as take:
        take.facts["prompt"] = s.lockstep
        s.reset()
        s.run_for(BOOT_S)
        with while_streaming(s):
            s.run_for(dwell_s)
    return s.capture("power_on", take)
