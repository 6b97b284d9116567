#!/usr/bin/env python3
"""The fidelity tables of the chips' pages, from facts.yaml (what is known) and <chip>.yaml (what we do) in docs/chips.

Usage:
    gen_docs.py           write the text between the marks fidelity:begin and fidelity:end of docs/chips/<chip>.md
    gen_docs.py --check   exit 1 and name the pages that are out of date

A row of docs/chips/<chip>.yaml:
    id      of facts.yaml, or a new one, "N.N-words", for what only the model has (then `fact` is needed);
            N.N as in docs/sources.md
    state   modelled, simplified or absent
    grade   "E2", "E0 M85", "E2; rounding E0": docs/design.md#evidence
    tests   ["test_ads1282.c:name", "test_chip_timing.py:test_name"]; none only if absent
    note    optional, but needed if absent: why
    fact, value   optional: in place of the words of facts.yaml
    also    optional: further ids of facts.yaml that the same tests prove
"""

from __future__ import annotations

import argparse
import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from between import marks, spliced
from protogen.source import parse_yaml

ROOT = Path(__file__).resolve().parents[1]
CHIPS = ROOT / "docs/chips"
PAGES = {"1": "ads1282", "2": "ads1256", "3": "ad7712"}  # first figure of a section: the chip's page
STATES = ("modelled", "simplified", "absent")
MARKS = marks("fidelity")
ROW_ID = re.compile(r"[123]\.[0-9]-[a-z0-9][a-z0-9-]*")
GRADE = re.compile(r"E[0-6]( M\d\d)?\b.*")
TEST = re.compile(r"(test_\w+\.c:\w+|test_\w+\.py:test_\w+)")
KEYS = {"id", "state", "grade", "tests", "note", "fact", "value", "also"}
NAME_WIDTH = 34  # of a test in the table; the whole name is in the yaml file


class FidelityError(Exception):
    """One line: file, row, what would be right."""


@dataclass(frozen=True, slots=True)
class Fact:
    """A row of facts.yaml; rows is the number of printed rows it represents.

    analog: a digital model cannot know; measured: to be read off a recording.
    """

    id: str
    fact: str
    value: str
    rows: int
    analog: bool
    measured: bool


@dataclass(frozen=True, slots=True)
class Row:
    """What the model does with a fact, and with those of `also`; tests are "file:name"."""

    id: str
    fact: str
    value: str
    state: str
    grade: str
    note: str
    tests: tuple[str, ...]
    also: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Section:
    """A section of facts.yaml: number as in docs/sources.md."""

    number: str
    title: str
    facts: tuple[Fact, ...]


def read_yaml(path: Path) -> Any:
    try:
        return parse_yaml(path.read_text(encoding="utf-8"))
    except yaml.YAMLError as e:
        raise FidelityError(f"{path.name}: {' '.join(str(e).split())}") from None


@cache
def load_facts(path: Path = CHIPS / "facts.yaml") -> list[Section]:
    """All sections of facts.yaml."""
    return [
        Section(
            s["section"],
            s["title"],
            tuple(
                Fact(f["id"], f["fact"], f.get("value", ""), f.get("rows", 1), "analog" in f, "measured" in f)
                for f in s["facts"]
            ),
        )
        for s in read_yaml(path)
    ]


def sections_of(chip: str, sections: Iterable[Section]) -> list[Section]:
    return [s for s in sections if PAGES[s.number[0]] == chip]


def load_rows(chip: str, sections: Iterable[Section], path: Path | None = None) -> list[Row]:
    """The rows of docs/chips/<chip>.yaml. Raises FidelityError for the first thing that is not right."""
    path = path or CHIPS / f"{chip}.yaml"
    facts = {f.id: f for s in sections_of(chip, sections) for f in s.facts}
    raw = read_yaml(path)
    if not isinstance(raw, list):
        raise FidelityError(f"{path.name}: is no list of rows")
    rows: list[Row] = []
    seen: set[str] = set()
    for number, item in enumerate(raw, 1):
        try:
            row = parse_row(item, facts)
            for name in (row.id, *row.also):
                if name in seen:
                    raise FidelityError(f"{name} is in two rows")
                seen.add(name)
        except FidelityError as e:
            where = item.get("id", "without id") if isinstance(item, dict) else "no mapping"
            raise FidelityError(f"{path.name}: row {number} ({where}): {e}") from None
        rows.append(row)
    return rows


def words(item: dict[str, Any], key: str) -> str:
    """A field that is text; numbers are written as the file has them only when they are quoted."""
    value = item.get(key, "")
    if not isinstance(value, str):
        raise FidelityError(f"{key}: {value!r} is no text; put it in quotes")
    return value


def texts(item: dict[str, Any], key: str) -> tuple[str, ...]:
    value = item.get(key, [])
    if not isinstance(value, list) or not all(isinstance(v, str) for v in value):
        raise FidelityError(f"{key}: {value!r} is no list of texts")
    return tuple(value)


def parse_row(item: Any, facts: dict[str, Fact]) -> Row:
    """One row, checked; facts by id."""
    if not isinstance(item, dict):
        raise FidelityError("a row is a mapping: {id: ..., state: ..., grade: ..., tests: [...]}")
    if unknown := set(item) - KEYS:
        raise FidelityError(f"unknown {', '.join(sorted(unknown))}; there are {', '.join(sorted(KEYS))}")
    known = facts.get(words(item, "id"), Fact("", "", "", 1, False, False))
    row = Row(
        id=words(item, "id"),
        fact=words(item, "fact") or known.fact,
        value=words(item, "value") or known.value,
        state=words(item, "state"),
        grade=words(item, "grade"),
        note=words(item, "note"),
        tests=texts(item, "tests"),
        also=texts(item, "also"),
    )
    for complaint in complaints(row, facts):
        raise FidelityError(complaint)
    return row


def complaints(row: Row, facts: dict[str, Fact]) -> Iterator[str]:
    """What is wrong with a row, and what would be right."""
    own = {i[:3] for i in facts}
    if not ROW_ID.fullmatch(row.id) or row.id[:3] not in own:
        yield f"id is section, hyphen, words in small letters, say 1.4-gap; sections here: {', '.join(sorted(own))}"
    if not row.fact:
        yield "is not in facts.yaml, so it needs `fact`"
    if row.state not in STATES:
        yield f"state '{row.state}' is none of {', '.join(STATES)}"
    if not GRADE.fullmatch(row.grade):
        yield f"grade '{row.grade}' is not like E2, E0 M85 or 'E2; rounding E0'"
    if row.state == "absent" and not row.note:
        yield "is absent, so it needs `note`: why"
    if row.state != "absent" and not row.tests:
        yield f"is {row.state}, so it needs `tests`"
    for test in row.tests:
        if not TEST.fullmatch(test):
            yield f"test '{test}' is not like test_ads1282.c:name or test_chip_timing.py:test_name"
    for other in row.also:
        if other not in facts:
            yield f"also: {other} is not in facts.yaml"


def short(name: str) -> str:
    """A test's name, cut at an underscore so that a search finds it."""
    if len(name) <= NAME_WIDTH:
        return name
    return name[:NAME_WIDTH].rsplit("_", 1)[0] + "…"


def letters(rows: Iterable[Row]) -> dict[str, str]:
    """Test files in order, each with its letter."""
    files = sorted({t.split(":")[0] for r in rows for t in r.tests}, key=lambda f: (f.endswith(".py"), f))
    return {f: chr(ord("A") + i) for i, f in enumerate(files)}


def cell(text: str) -> str:
    return text.replace("|", "\\|").replace("\n", " ").strip()


def table(chip: str, sections: Iterable[Section], rows: list[Row]) -> str:
    """The text between the marks of a page."""
    letter = letters(rows)
    lines = ["", "Generated from `docs/chips/" + chip + ".yaml`. Tests are named by the letter of their file:"]
    lines += [", ".join(f"{mark} `{file}`" for file, mark in letter.items()) + ".", ""]
    for s in sections_of(chip, sections):
        mine = [r for r in rows if r.id.startswith(s.number + "-")]
        if not mine:
            continue
        lines += [
            f"### {s.number} {s.title}",
            "",
            "| clause | value | state | grade | proving test | note |",
            "|---|---|---|---|---|---|",
        ]
        for r in mine:
            tests = ", ".join(f"{letter[t.split(':')[0]]} {short(t.split(':')[1])}" for t in r.tests)
            lines.append("| " + " | ".join(cell(c) for c in (r.fact, r.value, r.state, r.grade, tests, r.note)) + " |")
        lines.append("")
    return "\n".join(lines)


def page(text: str, generated: str, name: str = "page") -> str:
    """A page with the text between its marks replaced."""
    try:
        return spliced(text, MARKS, generated, name)
    except ValueError as e:
        raise FidelityError(str(e)) from None


def pages() -> dict[Path, str]:
    """Each page as it should be."""
    sections = load_facts()
    found = {}
    for chip in PAGES.values():
        path = CHIPS / f"{chip}.md"
        found[path] = page(
            path.read_text(encoding="utf-8"), table(chip, sections, load_rows(chip, sections)), path.name
        )
    return found


def main(argv: list[str] | None = None) -> int:
    """Command line; see the module's text. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--check", action="store_true", help="exit 1 if a page is out of date")
    args = parser.parse_args(argv)
    try:
        wanted = pages()
    except FidelityError as e:
        print(f"gen_docs: {e}", file=sys.stderr)
        return 1
    old = [path for path, text in wanted.items() if path.read_text(encoding="utf-8") != text]
    if args.check:
        if old:
            print(f"out of date: {', '.join(p.name for p in old)}; run tools/gen_docs.py", file=sys.stderr)
        return 1 if old else 0
    for path in old:
        path.write_text(wanted[path], encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
