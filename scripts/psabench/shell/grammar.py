"""A line of the shell understood: which command, with which values."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from psabench.errors import expected
from psabench.shell import units
from psabench.shell.commands import Arg, Command, Kind, Vocabulary
from psabench.shell.lexer import Word, Wrong, quote, split

Value = float | int | bool | str | list[float]
LISTED = 12  # choices that are reported when one of them may have been meant
_NAMED = re.compile(r"([a-z][a-z0-9_]*)=")
_BOOLS = {"on": True, "true": True, "yes": True, "1": True, "off": False, "false": False, "no": False, "0": False}


@dataclass(frozen=True, slots=True)
class Call:
    """A command and its arguments by name, checked against its rows."""

    command: Command
    args: dict[str, Value]

    @property
    def line(self) -> str:
        """The line that is this call."""
        rows = [a for a in self.command.args if a.name in self.args]
        bare = any(a.kind is Kind.REST for a in self.command.args)
        values = [_write(self.args[a.name]) for a in rows]
        words = [v if bare else f"{a.name}={quote(v)}" for a, v in zip(rows, values, strict=True)]
        return " ".join([self.command.name, *words])


def parse(line: str, vocabulary: Vocabulary) -> Call | None:
    """The call of a line; None for a blank or a comment. Raises Wrong with the column and what would be right."""
    first, *others = line.splitlines() or [""]
    if others:  # a saved script would have two
        raise Wrong(expected("one line", "a line break", "line"), len(first) + 1)
    name = re.match(r"\s*([^\s#]+)", line)
    command = vocabulary.commands.get(name[1]) if name else None
    if command and command.args and command.args[-1].kind is Kind.REST:
        return Call(command, _with_rest(command, line))
    words = split(line)
    if not words:
        return None
    if command is None:
        raise unknown(words[0], vocabulary)
    command = command.variant([w.raw for w in words[1:]])
    return Call(command, _arguments(command, words[1:], len(line)))


def unknown(word: Word, vocabulary: Vocabulary) -> Wrong:
    """Why there is no such command."""
    thing = word.text.split(".")[0]
    if thing in vocabulary.absent:
        return Wrong(f"{thing}: not available: {vocabulary.absent[thing]}", word.column)
    near = vocabulary.nearest(word.text)
    mine = [c for c in vocabulary.commands if c.startswith(f"{thing}.")]
    right = f"did you mean {' or '.join(near)}?" if near else f"it has {', '.join(mine)}" if mine else "help lists them"
    return Wrong(f"{word.text}: unknown command; {right}", word.column)


def _with_rest(command: Command, line: str) -> dict[str, Value]:
    """The last argument is what is left of the line as it is, blanks, quotes, # and all."""
    *head, last = command.args
    words = line.split(maxsplit=len(head) + 1)[1:]
    values: dict[str, Value] = {}
    for a, text in zip(head, words, strict=False):
        values[a.name] = value(a, Word(text, text, line.find(text)))
    rest = words[len(head)].rstrip() if len(words) > len(head) else ""
    missing = [a for a in head if a.name not in values] + ([] if rest or last.optional else [last])
    if missing:
        raise _missing(command, missing[0], len(line))
    return values | ({last.name: rest} if rest else {})


def _arguments(command: Command, words: Sequence[Word], end: int) -> dict[str, Value]:
    values: dict[str, Value] = {}
    for word in words:
        a, of = _which(command, word, values)
        if a.name in values:
            raise Wrong(expected("the argument once", f"{word.raw} as well", a.name), word.column)
        values[a.name] = value(a, of)
    for a in command.args:
        if not a.optional and a.name not in values:
            raise _missing(command, a, end)
    return {a.name: values[a.name] for a in command.args if a.name in values}


def _missing(command: Command, a: Arg, end: int) -> Wrong:
    return Wrong(f"{expected(f'a value ({describe(a)})', 'none', a.name)}; usage: {command.usage}", end + 1)


def _which(command: Command, word: Word, values: dict[str, Value]) -> tuple[Arg, Word]:
    """The argument that a word is for, and its value's word."""
    named = _NAMED.match(word.raw)
    if named:
        a = command.arg(named[1])
        if a is None:
            known = ", ".join(x.name for x in command.args) or "no argument"
            near = difflib.get_close_matches(named[1], [x.name for x in command.args], 1)
            hint = f" (did you mean {near[0]}?)" if near else ""
            raise Wrong(expected(known, f"{named[1]}{hint}", f"argument of {command.name}"), word.column)
        cut = len(named.group())
        return a, Word(word.text[cut:], word.raw[cut:], word.start + cut)
    for a in command.args:
        if a.name not in values:
            return a, word
    raise Wrong(expected(command.usage, f"one more argument, {word.raw}", command.name), word.column)


def value(a: Arg, word: Word) -> Value:
    """The value of an argument. Raises Wrong."""
    try:
        if a.kind is Kind.REALS:
            return [_number(a, x) for x in word.text.split(",")]
        if a.kind is Kind.REAL:
            return _number(a, word.text)
        if a.kind is Kind.COUNT:
            return _count(a, word.text)
    except ValueError as e:
        raise Wrong(f"{a.name}: {e} ({describe(a)})", word.column) from None
    if a.kind is Kind.BOOL:
        if word.text.lower() not in _BOOLS:
            raise Wrong(expected("on or off", repr(word.text), a.name), word.column)
        return _BOOLS[word.text.lower()]
    if a.choices and a.strict and word.text not in a.choices:
        near = difflib.get_close_matches(word.text, a.choices, 1)
        hint = f" (did you mean {near[0]}?)" if near else ""
        known = ", ".join(a.choices) if len(a.choices) <= LISTED or not near else "a value that Tab lists"
        raise Wrong(expected(known, f"{word.text!r}{hint}", a.name), word.column)
    return word.text


def _number(a: Arg, text: str) -> float:
    x = units.number(text, a.unit)
    if not (a.low <= x <= a.high) or math.isinf(x) or 0 < abs(x) < a.least:
        raise ValueError(expected("a number in range", f"{x:.10g}"))
    return x


def _count(a: Arg, text: str) -> int:
    x = _number(a, text)
    if x != math.floor(x):
        raise ValueError(expected("an integer", f"{x:.10g}"))
    return int(x)


def describe(a: Arg) -> str:
    """`angle on the head's scale, deg, -3600 to 3600`."""
    return ", ".join(x for x in (a.what, a.range) if x) or a.kind.value


def _write(x: Value) -> str:
    if isinstance(x, bool):
        return "on" if x else "off"
    if isinstance(x, list):
        return ",".join(repr(v) for v in x)
    return x if isinstance(x, str) else f"{x:g}" if float(f"{x:g}") == x else repr(x)
