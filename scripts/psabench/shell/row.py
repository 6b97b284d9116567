"""A command that the shell itself carries out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from psabench.bench import Bench
from psabench.shell.commands import Command
from psabench.shell.grammar import Value

if TYPE_CHECKING:
    from psabench.shell.session import Session

Args = Mapping[str, Value]
Handler = Callable[["Session", Args], Mapping[str, Any]]


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
