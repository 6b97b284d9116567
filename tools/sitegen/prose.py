"""Text of comments and docstrings as Markdown: paragraphs, and indented parts as they are."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from itertools import pairwise

SPECIAL = re.compile(r"([\\*_<>\[\]#|~$])")
SPAN = re.compile(r"(`[^`\n]+`)")
SLACK = 4  # characters that an editor's filling may leave
PAGE = re.compile(r"\bdocs/[\w/]+\.md\b")


def markdown(text: str, language: str, pages: Collection[str] = ()) -> str:
    """Lines that are indented by two or more become a block of code. pages: those that a text may be linked to."""
    return "\n\n".join(_block(lines, language, pages) for lines in _blocks(text.splitlines()))


def _blocks(lines: list[str]) -> Iterator[list[str]]:
    """Runs of lines of one kind: indented or not; an empty line ends a paragraph, not an indented part."""
    run: list[str] = []
    for line in [*lines, ""]:
        indented = line.startswith("  ")
        if run and ((not line.strip() and not run[0].startswith("  ")) or (line.strip() and _differs(run, indented))):
            yield run
            run = []
        if line.strip() or run:
            run.append(line.rstrip())
    if any(run):
        yield run


def _differs(run: list[str], indented: bool) -> bool:
    return run[0].startswith("  ") != indented


def _block(lines: list[str], language: str, pages: Collection[str]) -> str:
    if lines[0].startswith("  "):
        shift = min(len(line) - len(line.lstrip()) for line in lines if line)
        body = "\n".join(line[shift:] for line in lines).rstrip()
        return f"```{language if shift >= 4 else 'text'}\n{body}\n```"
    return _paragraph(_joined(lines), pages)


def _joined(lines: list[str]) -> str:
    """A line that had room for the next word ends a paragraph: the author has broken it there."""
    width, out = max(map(len, lines)), lines[0]
    for before, line in pairwise(lines):
        room = len(before) + 1 + len(line.split(" ", 1)[0]) <= width - SLACK
        out += ("\n\n" if room else " ") + line
    return out


def _paragraph(text: str, pages: Collection[str]) -> str:
    """Escaped but for `code`; names of pages are links."""
    parts = SPAN.split(text)
    return "".join(p if k % 2 else _linked(p, pages) for k, p in enumerate(parts))


def _linked(text: str, pages: Collection[str]) -> str:
    out, end = "", 0
    for m in PAGE.finditer(text):
        shown = SPECIAL.sub(r"\\\1", m[0])
        out += SPECIAL.sub(r"\\\1", text[end : m.start()]) + (f"[{shown}](/{m[0]})" if m[0] in pages else shown)
        end = m.end()
    return out + SPECIAL.sub(r"\\\1", text[end:])
