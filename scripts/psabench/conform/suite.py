"""All stimuli, checks and active tests: importing their modules registers them.

Those of all boards are in conform/stimulus, conform/check and conform/active, those of one board in
boards/<type>/conform as stimulus*.py, check*.py and active*.py.
"""

from __future__ import annotations

import pkgutil
from collections.abc import Iterator
from importlib import import_module

KINDS = ("stimulus", "check", "active")


def load() -> None:
    """Import them all: stimuli first, within a kind in the order of names, a board's under the board's name."""
    for kind in KINDS:
        for _, module in sorted(_modules(kind)):
            import_module(module)


def _modules(kind: str) -> Iterator[tuple[str, str]]:
    """(name by which it is sorted, dotted module)."""
    common = f"psabench.conform.{kind}"
    for module in pkgutil.iter_modules(import_module(common).__path__):
        yield module.name, f"{common}.{module.name}"
    boards = import_module("psabench.boards")
    for board in pkgutil.iter_modules(boards.__path__):
        if not board.ispkg:
            continue
        package = import_module(f"{boards.__name__}.{board.name}.conform")
        for module in pkgutil.iter_modules(package.__path__):
            head, _, topic = module.name.partition("_")
            if head == kind:
                yield f"{board.name}_{topic}".rstrip("_"), f"{package.__name__}.{module.name}"
