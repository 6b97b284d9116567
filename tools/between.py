"""A page of which a tool writes a part: what stands between two marks."""

from __future__ import annotations


def marks(name: str) -> tuple[str, str]:
    """Lines that a page has around a part of that name."""
    return f"<!-- {name}:begin -->", f"<!-- {name}:end -->"


def spliced(text: str, between: tuple[str, str], body: str) -> str:
    """The page with another body between its marks. Raises ValueError, with the marks, unless they stand there once."""
    begin, end = between
    head, _, rest = text.partition(f"{begin}\n")
    _, closed, tail = rest.partition(end)
    if not closed or begin in rest:
        raise ValueError(f"wanted once, each on a line of its own: {begin} and after it {end}")
    return f"{head}{begin}\n{body}\n{end}{tail}"
