"""The commands of psabench: a walk through the tree of its parsers."""

from __future__ import annotations

import argparse
from collections.abc import Iterator

from cligen import tables


def every_command() -> dict[str, argparse.ArgumentParser]:
    """Each command that does something, by its words."""
    return {p.prog.removeprefix("psabench "): p for p in _leaves(tables.psabench())}


def _leaves(p: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    below = [a for a in p._actions if isinstance(a, argparse._SubParsersAction)]
    if not below:
        yield p
    for action in below:
        for one in action.choices.values():
            yield from _leaves(one)
