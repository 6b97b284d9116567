"""A page of which a tool writes a part: the text between two marks."""

from __future__ import annotations

from pathlib import Path

from psabench.link.own import replace_file

# Of docs/reference/mutants.md; FIDELITY.md has the same table.
MUTATED = "<!-- unit tests: made by `make mutate`, do not edit -->", "<!-- end of unit tests -->"


def marks(name: str) -> tuple[str, str]:
    """Lines that a page has around a part of that name."""
    return f"<!-- {name}:begin -->", f"<!-- {name}:end -->"


def spliced(text: str, between: tuple[str, str], body: str, page: str = "page") -> str:
    """The page with another body between its marks. Raises ValueError, with its name, unless the first one is there
    once, at the end of a line, and the other one after it."""
    begin, end = between
    head, _, rest = text.partition(f"{begin}\n")
    _, closed, tail = rest.partition(end)
    if text.count(begin) != 1 or not closed:
        raise ValueError(f"{page}: expected one line {begin} and after it {end}, got none or several")
    return f"{head}{begin}\n{body}\n{end}{tail}"


def part_of(page: Path, between: tuple[str, str]) -> str:
    """What a page has between two marks, without blank lines at its ends. Raises ValueError where they are missing."""
    begin, end = between
    _, opened, rest = page.read_text(encoding="utf-8").partition(f"{begin}\n")
    body, closed, _ = rest.partition(end)
    if not opened or not closed:
        raise ValueError(f"{page.name}: expected a line {begin} and after it {end}, got none")
    return body.strip("\n")


def write(page: Path, between: tuple[str, str], body: str) -> None:
    """The whole page or none of it. Raises ValueError as spliced()."""
    replace_file(page, spliced(page.read_text(encoding="utf-8"), between, body, page.name))
