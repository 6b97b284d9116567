"""The list of mutants, mutants.yaml: read, checked, applied."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from protogen.source import parse_yaml

LIST = Path(__file__).with_name("mutants.yaml")
KEYS = {"id", "kind", "in", "old", "new", "run", "breaks"}
MORE = {"after", "equivalent", "survives"}


class ListError(Exception):
    """A row that does not fit its source, in words."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Target:
    """What the suite is run on: `psa2`, `psa2:w24`, `psa2@slcan`."""

    board: str
    profile: str | None = None
    adapter: str = field(default="", repr=False)  # CAN adapter of the emulator; repr: stamps of rows without it stand

    @classmethod
    def of(cls, text: str) -> Target:
        """As the list writes it."""
        text, _, adapter = text.partition("@")
        board, _, profile = text.partition(":")
        return cls(board=board, profile=profile or None, adapter=adapter)

    def __str__(self) -> str:
        board = self.board if self.profile is None else f"{self.board}:{self.profile}"
        return f"{board}@{self.adapter}" if self.adapter else board


@dataclass(frozen=True, slots=True, kw_only=True)
class Mutant:
    """One wrong in one file. breaks: requirements, of which a failure must name one; empty: any will do."""

    id: str
    kind: str
    file: str
    old: str
    new: str
    after: str = ""
    on: tuple[Target, ...]
    breaks: tuple[str, ...] = ()
    equivalent: str = ""
    survives: str = ""

    @property
    def reason(self) -> str:
        """Why no run can find it; empty: one must."""
        return self.equivalent or self.survives

    def applied(self, text: str) -> str:
        """The file with the wrong in it. Raises ListError."""
        at = text.find(self.after) + len(self.after) if self.after else 0
        if self.after and text.count(self.after) != 1:
            raise ListError(f"{self.id}: {self.file} has {text.count(self.after)} times what is before the old text")
        found = text.count(self.old, at)
        if not self.old or found == 0 or (found > 1 and not self.after):
            raise ListError(f"{self.id}: {self.file} has the old text {found} times, not once")
        begin = text.index(self.old, at)
        return text[:begin] + self.new + text[begin + len(self.old) :]

    def stamp(self) -> str:
        """Of all that makes it; the reason why nothing finds it does not."""
        return hashlib.sha256(repr(replace(self, equivalent="", survives="")).encode()).hexdigest()[:16]


def _words(value: Any) -> tuple[str, ...]:
    return tuple(map(str, value)) if isinstance(value, list) else (str(value),)


def _text(value: Any) -> str:
    """Block scalars end with a line feed that is the YAML's; a quoted text keeps its own."""
    text = str(value)
    return text[:-1] if text.count("\n") > 0 and text.endswith("\n") and not text.startswith(" ") else text


def _mutant(row: Mapping[str, Any]) -> Mutant:
    keys = set(row)
    if not keys >= KEYS or keys - KEYS - MORE:
        raise ListError(f"{row}: keys {', '.join(sorted(map(str, keys)))}; a row has {', '.join(sorted(KEYS))}")
    return Mutant(
        id=str(row["id"]),
        kind=str(row["kind"]),
        file=str(row["in"]),
        old=_text(row["old"]),
        new=_text(row["new"]),
        after=_text(row.get("after", "")),
        on=tuple(map(Target.of, _words(row["run"]))),
        breaks=_words(row["breaks"]),
        equivalent=str(row.get("equivalent", "")),
        survives=str(row.get("survives", "")),
    )


def load(path: Path = LIST) -> list[Mutant]:
    """Raises ListError."""
    rows = parse_yaml(path.read_text(encoding="utf-8"))
    if not isinstance(rows, list):
        raise ListError(f"{path}: expected a list of rows")
    return [_mutant(row) for row in rows]


def _of_one(m: Mutant, root: Path, known: Iterable[str]) -> Iterator[str]:
    if not re.fullmatch(r"[a-z0-9]+(-[a-z0-9]+)*", m.id):
        yield f"{m.id}: a name is small letters, digits and hyphens"
    yield from (f"{m.id}: no requirement {i}" for i in m.breaks if i not in known)
    if m.equivalent and m.survives:
        yield f"{m.id}: equivalent and survives are two reasons for one thing"
    if m.old == m.new:
        yield f"{m.id}: changes nothing"
    path = root / m.file
    if not path.is_file():
        yield f"{m.id}: no file {m.file}"
        return
    try:
        m.applied(path.read_text(encoding="utf-8"))
    except ListError as e:
        yield str(e)


def problems(mutants: Iterable[Mutant], root: Path, known: Iterable[str]) -> list[str]:
    """What is wrong with the list, in words; known: ids of requirements."""
    ids, rows = set(known), list(mutants)
    found: list[str] = []
    for m in rows:
        found += _of_one(m, root, ids)
    seen = [m.id for m in rows]
    return found + [f"{i}: twice in the list" for i in sorted({i for i in seen if seen.count(i) > 1})]
