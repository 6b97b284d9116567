"""What a run of a suite came to as a whole: whether something is violated, and whether enough was judged to say more.

A requirement is judged when it passed or failed. A run that judged little has no violation to show, and that is all
it says: it has a result, a colour and an exit status of its own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from fractions import Fraction
from math import ceil

from psabench.conform.verdict import Verdict
from psabench.errors import BadInput, expected


class Result(Enum):
    """Of a run."""

    CONFORMS = "conforms"
    NO_VIOLATION = "no violation seen"
    VIOLATED = "does not conform"
    INTERRUPTED = "interrupted"


STATUS = {Result.CONFORMS: 0, Result.VIOLATED: 1, Result.NO_VIOLATION: 4, Result.INTERRUPTED: 130}


@dataclass(frozen=True, slots=True)
class Least:
    """How many requirements a run must judge: a number of them, or a percentage of those that can be judged."""

    value: Fraction
    percent: bool

    @classmethod
    def parse(cls, text: str) -> Least:
        """A number of requirements, or a percentage: 120, 90%. Raises ValueError."""
        digits = text.removesuffix("%")
        if not digits.isascii() or not digits.isdecimal() or len(digits) > 6:
            raise ValueError(text)
        found = cls(Fraction(digits), text.endswith("%"))
        if found.percent and found.value > 100:
            raise ValueError(text)
        return found

    def of(self, reach: int) -> int:
        """That many, where `reach` can be judged."""
        return ceil(self.value * reach / 100) if self.percent else int(self.value)


# To be called conforming. Ours: the suite on our own emulators judges 94 to 96 % of what an interface shows; the rest
# requires a second device on the bus, or a bus of another kind.
COMPLETE = Least(Fraction(90), percent=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal:
    """What the user asks of a run beside that nothing is violated."""

    least: Least = COMPLETE
    require: tuple[str, ...] = ()  # ids or prefixes of requirements that must have passed

    def check_ids(self, ids: Sequence[str]) -> None:
        """Raises BadInput for one that names none of these requirements, and for more than there are."""
        for named in self.require:
            if not any(i.startswith(named) for i in ids):
                raise BadInput(expected("ids or prefixes of the requirements that are checked", named, "--require"))
        if not self.least.percent and self.least.value > len(ids):
            raise BadInput(expected(f"at most the {len(ids)} that are checked", self.least.value, "--min-judged"))


USUAL = Goal()


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """Counts of a run, and what follows from them."""

    verdicts: Mapping[str, Verdict]  # by requirement
    reach: int  # requirements that an interface of this suite shows
    goal: Goal
    interrupted: bool

    def count_of(self, verdict: Verdict) -> int:
        """Requirements with this verdict."""
        return sum(v is verdict for v in self.verdicts.values())

    @property
    def judged(self) -> int:
        """Requirements that passed or failed."""
        return self.count_of(Verdict.PASSED) + self.count_of(Verdict.FAILED)

    @property
    def needed(self) -> int:
        """Requirements that must be judged."""
        return self.goal.least.of(self.reach)

    @property
    def missing(self) -> list[str]:
        """Requirements that the user named and that did not pass."""
        named = self.goal.require
        return [i for i, v in self.verdicts.items() if named and i.startswith(named) and v is not Verdict.PASSED]

    @property
    def sufficient(self) -> bool:
        """Something passed, nothing failed or stayed open, and as much was judged as the goal says."""
        bad = self.count_of(Verdict.FAILED) + self.count_of(Verdict.INCONCLUSIVE)
        return self.count_of(Verdict.PASSED) > 0 and not bad and self.judged >= self.needed and not self.missing

    @property
    def result(self) -> Result:
        """In one word."""
        if self.interrupted:
            return Result.INTERRUPTED
        if self.count_of(Verdict.FAILED):
            return Result.VIOLATED
        complete = self.sufficient and self.judged >= COMPLETE.of(self.reach)
        return Result.CONFORMS if complete else Result.NO_VIOLATION

    @property
    def status(self) -> int:
        """Exit status of the command."""
        found = self.result
        return 0 if found is Result.NO_VIOLATION and self.sufficient else STATUS[found]
