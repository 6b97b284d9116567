"""What a test came to, and how a test says so.

A test returns in words what it saw; it raises `Failed` where that is not what was due, and `Inconclusive` where what it
got does not suffice to say either.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

from psabench.conform.capture.log import CanFrame


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


def conforms(verdicts: Sequence[Verdict]) -> bool:
    """Nothing failed, nothing is open but what no probe was there to see, and something passed."""
    bad = (Verdict.FAILED, Verdict.INCONCLUSIVE)
    return Verdict.PASSED in verdicts and not any(v in bad for v in verdicts)
