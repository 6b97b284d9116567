"""What a test came to, and how a test says so.

A test returns in words what it saw. It raises `Failed` where that is not what was due, `Inconclusive` where what it got
does not suffice to say either, and `Unseen` where there is nothing to look at; `expect` and `none_of` raise the first
of these, `conclusive` and `known` the second. Only `decide` turns this into a verdict: for a board, a recording and a
host.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from enum import Enum
from typing import TypeVar

from psabench.conform.capture.log import CanFrame
from psabench.errors import BenchError, DeviceError

T = TypeVar("T")


class Verdict(Enum):
    """Only PASSED is a pass. A report counts the others by name."""

    PASSED = "passed"
    FAILED = "failed"
    INCONCLUSIVE = "inconclusive"  # the test could not be carried out, or had too little to look at
    NOT_OBSERVABLE = "not observable"  # a probe is missing
    NOT_APPLICABLE = "not applicable"  # another board or profile


class Failed(Exception):
    """A requirement is not met."""

    def __init__(
        self,
        saw: str,
        due: str,
        *,
        at_ns: float | None = None,
        lines: Sequence[str] = (),
        frames: Sequence[CanFrame] = (),
    ) -> None:
        """saw, due: in words with units.

        at_ns: where in the recording of the lines; lines: which of them show it; frames: those that do.
        """
        super().__init__(f"saw {saw}; due {due}")
        self.saw, self.due, self.at_ns = saw, due, at_ns
        self.lines, self.frames = tuple(lines), tuple(frames)


class Inconclusive(Exception):
    """Neither met nor broken: the words say what would be needed."""


class Unseen(Exception):
    """Not observable in what was captured: the words say why."""


def expect(
    met: object,
    saw: str,
    due: str,
    *,
    at_ns: float | None = None,
    lines: Sequence[str] = (),
    frames: Sequence[CanFrame] = (),
) -> str:
    """Raises Failed with these words unless it is met; returns what was seen."""
    if not met:
        raise Failed(saw, due, at_ns=at_ns, lines=lines, frames=frames)
    return saw


def conclusive(enough: object, why: str) -> None:
    """Raises Inconclusive unless there is enough to look at."""
    if not enough:
        raise Inconclusive(why)


def none_of(found: Sequence[T], saw: Callable[[T], str], due: str, *, frames: Sequence[CanFrame] = ()) -> None:
    """Raises Failed where there are any, with what is to be said of the first."""
    if found:
        raise Failed(saw(found[0]), due, frames=frames)


def known(value: T | None, why: str) -> T:
    """The value. Raises Inconclusive where there is none."""
    if value is None:
        raise Inconclusive(why)
    return value


@contextmanager
def damaged_data_are(other: Callable[..., Exception], *due: str, **shown: Sequence[CanFrame]) -> Iterator[None]:
    """A ValueError within, of data that cannot be decoded, is raised as this one: its words, what is due, frames."""
    try:
        yield
    except ValueError as e:
        raise other(str(e), *due, **shown) from e


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """Of one test on one board."""

    test: str  # name of the function
    title: str  # first line of its docstring: what it did
    requirements: tuple[str, ...]
    verdict: Verdict
    saw: str = ""
    due: str = ""
    reason: str = ""  # of what is neither passed nor failed
    at_ns: float | None = None
    stimulus: str = ""
    took_s: float = 0.0
    excerpts: tuple[str, ...] = ()  # files of the report's folder: VCD excerpt, picture, CAN excerpt


def not_decided(test: Callable[..., str], ids: Sequence[str], stimulus: str) -> Outcome:
    """The outcome of a test before it runs."""
    title = (test.__doc__ or test.__name__).partition("\n")[0]
    return Outcome(
        test=test.__name__,
        title=title,
        requirements=tuple(ids),
        verdict=Verdict.NOT_OBSERVABLE,
        stimulus=stimulus,
    )


def decide(open_: Outcome, test: Callable[[], str], keep: Callable[[Failed], tuple[str, ...]]) -> Outcome:
    """Run a test and take its verdict; keep: writes the excerpts that show a failure. Raises OSError."""
    try:
        return replace(open_, verdict=Verdict.PASSED, saw=test())
    except Failed as e:
        return replace(open_, verdict=Verdict.FAILED, saw=e.saw, due=e.due, at_ns=e.at_ns, excerpts=keep(e))
    except DeviceError as e:
        return replace(open_, verdict=Verdict.FAILED, saw=str(e), due="no error from the board")
    except Unseen as e:
        return replace(open_, verdict=Verdict.NOT_OBSERVABLE, reason=str(e))
    except (Inconclusive, BenchError) as e:
        return replace(open_, verdict=Verdict.INCONCLUSIVE, reason=str(e))
    except OSError:
        raise
    except Exception as e:  # an error of the test's own: the other tests still run
        reason = f"the test itself failed: {type(e).__name__}: {str(e)[:200]}"
        return replace(open_, verdict=Verdict.INCONCLUSIVE, reason=reason)
