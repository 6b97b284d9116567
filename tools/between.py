"""A page of which a tool writes a part: the text between two marks."""

from __future__ import annotations

from pathlib import Path

from psabench.link.own import replace_file


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


def write(page: Path, between: tuple[str, str], body: str) -> None:
    """The whole page or none of it. Raises ValueError as spliced()."""
    replace_file(page, spliced(page.read_text(encoding="utf-8"), between, body, page.name))
