"""A command that the shell itself carries out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

from psabench.bench import Bench
from psabench.boards.unit import Unit
from psabench.shell.commands import Arg, Command, Vocabulary
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


@dataclass(frozen=True, slots=True)
class Row:
    """A command, what carries it out, and whether a bench has it."""

    command: Command
    run: Handler
    here: Callable[[Bench], bool]


def row(name: str, what: str, run: Handler, *args: Arg, here: Callable[[Bench], bool] = lambda _: True) -> Row:
    """A row of a command with these arguments; here: always, unless given."""
    return Row(Command(name=name, what=what, args=args), run, here)


def number(args: Args, name: str, default: float = 0.0) -> float:
    """An argument that the grammar has made a number of."""
    value = args.get(name, default)
    assert isinstance(value, int | float)
    return float(value)
