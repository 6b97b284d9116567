"""A line of the shell cut into words, each with its place."""

from __future__ import annotations

import re
from dataclasses import dataclass

from psabench.errors import BadInput, expected

# A word: quoted parts and others, up to a blank. A quote that is not closed runs to the end of the line.
_WORD = re.compile(r"""(?:"(?:[^"\\]|\\.)*"?|'[^']*'?|[^\s"'])+""")
_PART = re.compile(r"""(?P<double>"(?:[^"\\]|\\.)*"?)|(?P<single>'[^']*'?)|(?P<plain>[^"']+)""")


class Wrong(BadInput):
    """A line that cannot be understood; column counts from 1."""

    def __init__(self, text: str, column: int = 1) -> None:
        super().__init__(text)
        self.column = column


@dataclass(frozen=True, slots=True)
class Word:
    """text: without quotes; raw: as it is in the line from column `start` (from 0)."""

    text: str
    raw: str
    start: int

    @property
    def end(self) -> int:
        return self.start + len(self.raw)

    @property
    def column(self) -> int:
        return self.start + 1


def split(line: str) -> list[Word]:
    """The words of a line up to a word that begins with #. Raises Wrong for a quote that is not closed."""
    found = []
    for m in _WORD.finditer(line):
        if m.group().startswith("#"):
            break
        found.append(Word(_unquote(m.group(), m.start()), m.group(), m.start()))
    return found


def quote(text: str) -> str:
    """A word that `split` reads back as text."""
    if text and not re.search(r"""[\s"'\\]""", text) and not text.startswith("#"):
        return text
    escaped = text.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


def _unquote(raw: str, start: int) -> str:
    parts = []
    for m in _PART.finditer(raw):
        text = m.group()
        if m["plain"]:
            parts.append(text)
        elif len(text) < 2 or text[-1] != text[0]:
            raise Wrong(expected("a closing quote", text), start + m.start() + 1)
        else:
            parts.append(re.sub(r"\\(.)", r"\1", text[1:-1]) if m["double"] else text[1:-1])
    return "".join(parts)
