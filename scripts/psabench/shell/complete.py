"""What may come next in a line that is being typed: a function of the text before the cursor and the vocabulary."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from psabench.shell.commands import OBJECTS, Arg, Command, Kind, Vocabulary
from psabench.shell.grammar import describe


@dataclass(frozen=True, slots=True)
class Candidate:
    """text replaces `typed` characters before the cursor; about tells what it is."""

    text: str
    typed: int
    about: str


def candidates(before: str, vocabulary: Vocabulary) -> list[Candidate]:
    """What may stand at the cursor, given the text before it."""
    words = before.split()
    if not words or (len(words) == 1 and not before[-1:].isspace()):
        return list(_names(words[0] if words else "", vocabulary))
    command = vocabulary.commands.get(words[0])
    return list(_values(*_typed(command, words, before))) if command else []


def argument(before: str, vocabulary: Vocabulary) -> tuple[Command, Arg | None] | None:
    """The command that is being typed and the argument at the cursor: what the status bar explains."""
    words = before.split()
    command = vocabulary.commands.get(words[0]) if words else None
    if command is None:
        return None
    if len(words) == 1 and not before[-1:].isspace():
        return command, None
    command, done, last = _typed(command, words, before)
    free = _free(command, done)
    named = command.arg(last.split("=")[0]) if "=" in last else None
    return command, named or (free[0] if free else None)


def _typed(command: Command, words: list[str], before: str) -> tuple[Command, list[str], str]:
    """The variant that is being typed, the words after its name that are complete, and the one that is not."""
    done, last = (words[1:], "") if before[-1:].isspace() else (words[1:-1], words[-1])
    return command.variant(done), done, last


def _names(prefix: str, vocabulary: Vocabulary) -> Iterator[Candidate]:
    """Commands; of an object that is not yet written out, the object."""
    seen = set()
    for name, command in sorted(vocabulary.commands.items()):
        thing, dot, _ = name.partition(".")
        if name.startswith(prefix) and (not dot or "." in prefix):
            yield Candidate(name, len(prefix), command.what)
        elif dot and "." not in prefix and thing.startswith(prefix) and thing not in seen:
            seen.add(thing)
            yield Candidate(f"{thing}.", len(prefix), OBJECTS.get(thing, ""))
    for thing, why in sorted(vocabulary.absent.items()):
        if prefix.startswith(f"{thing}.") or (prefix and thing.startswith(prefix)):
            yield Candidate(prefix, len(prefix), f"{thing}: not available: {why}")


def _free(command: Command, words: list[str]) -> list[Arg]:
    """Arguments that the words do not give yet, in order."""
    named = {w.split("=")[0] for w in words if re.match(r"[a-z][a-z0-9_]*=", w) and command.arg(w.split("=")[0])}
    free = [a for a in command.args if a.name not in named]
    return free[len(words) - len(named) :]


def _values(command: Command, words: list[str], last: str) -> Iterator[Candidate]:
    free = _free(command, words)
    name, equals, typed = last.partition("=")
    if equals and (a := command.arg(name)):
        yield from (Candidate(v, len(typed), describe(a)) for v in _choices(a) if v.startswith(typed))
        return
    if free:
        first = free[0]
        yield from (Candidate(v, len(last), _about(first)) for v in _choices(first) if v.startswith(last))
    for a in free:
        if a.kind is not Kind.REST and f"{a.name}=".startswith(last):
            yield Candidate(f"{a.name}=", len(last), ("optional: " if a.optional else "") + describe(a))


def _choices(a: Arg) -> tuple[str, ...]:
    return ("on", "off") if a.kind is Kind.BOOL else a.offers


def _about(a: Arg) -> str:
    return f"{a.name}: {a.what}" if a.what else a.name
