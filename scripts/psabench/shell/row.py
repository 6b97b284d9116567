"""A command that the shell itself carries out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from psabench.bench import Bench
from psabench.boards.unit import Unit
from psabench.shell.commands import Command, Vocabulary
from psabench.shell.grammar import Value
from psabench.shell.transcript import Transcript

Args = Mapping[str, Value]


class Context(Protocol):
    """What a handler may ask of the session that calls it."""

    vocabulary: Vocabulary
    transcript: Transcript
    latest: Mapping[str, Any]  # result that `expect` looks at

    @property
    def tick(self) -> Callable[[], None]: ...
    @property
    def bench(self) -> Bench: ...
    @property
    def dut_name(self) -> str: ...
    @property
    def dut(self) -> Unit: ...
    def use(self, name: str) -> None: ...
    def now_ns(self) -> int | None: ...


Handler = Callable[[Context, Args], Mapping[str, Any]]


def _always(_: Bench) -> bool:
    return True


@dataclass(frozen=True, slots=True)
class Row:
    """A command, what carries it out, and whether a bench has it."""

    command: Command
    run: Handler
    here: Callable[[Bench], bool] = _always


def number(args: Args, name: str, default: float = 0.0) -> float:
    """An argument that the grammar has made a number of."""
    value = args.get(name, default)
    assert isinstance(value, int | float)
    return float(value)
