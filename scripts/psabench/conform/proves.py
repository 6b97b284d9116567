"""What ties a test of the conformance suite to the requirements that it proves: @check and @active of `plan`, @proves.

The ids are literals, so that tools/gen_requirements.py finds them without running anything.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

from psabench.conform.capture.log import Capture
from psabench.conform.requirements import Requirement, requirements
from psabench.errors import expected

if TYPE_CHECKING:
    from psabench.conform.dut import Dut

Test = TypeVar("Test", bound=Callable[..., str])


@dataclass(frozen=True, slots=True)
class SuiteTest:
    """A test of the suite and the ids of what it proves."""

    test: Callable[..., str]
    ids: tuple[str, ...]


_suite_tests: list[SuiteTest] = []


def proves(*ids: str) -> Callable[[Test], Test]:
    """Register a test under ids of requirements. Raises ValueError for none, for one twice and for an unknown one."""
    if not ids or len(set(ids)) != len(ids):
        raise ValueError(expected("ids of requirements, each once", ids, "proves"))
    if unknown := [i for i in ids if i not in requirements().rows]:
        raise ValueError(expected("ids of requirements", ", ".join(unknown), "proves"))

    def register(test: Test) -> Test:
        _suite_tests.append(SuiteTest(test, ids))
        return test

    return register


def suite_tests() -> tuple[SuiteTest, ...]:
    """Every test that was registered so far, in the order in which its module was imported."""
    return tuple(_suite_tests)


def row_for(e: Capture | Dut, *ids: str) -> Requirement:
    """The one of these requirements that holds for the variant. Raises ValueError when none does."""
    v = e.variant
    for i in ids:
        row = requirements().rows[i]
        if row.applies(v.board, v.profile):
            return row
    raise ValueError(expected(f"an id that holds for {v.name}", ", ".join(ids), "proves"))
