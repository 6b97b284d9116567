#!/usr/bin/env python3
"""Links between the pages: each names a file that is there and, after a #, a heading of that page.

Usage:
    check_links.py              exit 1 if a link is dead; says where
    check_links.py --root DIR   of another checkout

Looks at every tracked Markdown page, but not into code: fenced blocks and `spans`. A heading's address is the one that
GitHub gives it; a page may name others with <a id="...">. Addresses outside the checkout are not opened.
"""

from __future__ import annotations

import argparse
import posixpath
import re
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from urllib.parse import unquote

ROOT = Path(__file__).resolve().parents[1]

FENCE = re.compile(r"^ {0,3}(`{3,}|~{3,})")
SPAN = re.compile(r"(`+)(?!`).+?(?<!`)\1(?!`)")
# [text](target), ![text](target "title"), [name]: target; the text may hold one pair of brackets.
INLINE = re.compile(r"\[(?:[^\[\]]|\[[^\[\]]*\])*\]\(\s*<?([^\s<>()]+)>?(?:\s+\"[^\"]*\")?\s*\)")
REFERENCE = re.compile(r"^ {0,3}\[[^\]]+\]:\s+<?([^\s<>]+)>?")
HEADING = re.compile(r"^ {0,3}#{1,6}\s+(.*?)\s*#*\s*$")
NAMED = re.compile(r"<a\s+(?:id|name)=\"([^\"]+)\"")
# Heads of generated pages: their links are those of the page, in docs/reference.
LEFT_OUT = ("proto/protocol_head.md", "proto/protocol_unit_head.md")
OUTSIDE = re.compile(r"^(?:[a-z][a-z0-9+.-]*:|//)", re.IGNORECASE)


def files(root: Path) -> frozenset[str]:
    """Files of the checkout that git knows or would add."""
    command = ["git", "-C", str(root), "ls-files", "-z", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return frozenset(name for name in listed.split("\0") if (root / name).is_file())


def prose(text: str) -> Iterator[tuple[int, str]]:
    """The lines of a page that are not in a fenced block, by number from 1."""
    fence = ""
    for number, line in enumerate(text.splitlines(), 1):
        mark = FENCE.match(line)
        if fence:
            if mark and mark[1].startswith(fence) and not line.strip(" `~"):
                fence = ""
        elif mark:
            fence = mark[1]
        else:
            yield number, line


def targets(text: str) -> Iterator[tuple[int, str]]:
    """What the links of a page name, with the line where each begins; a link may go on in the next line."""
    lines = dict(prose(text))
    for number, line in lines.items():
        if m := REFERENCE.match(line):
            yield number, m[1]
    whole = SPAN.sub(lambda m: re.sub(r"[^\n]", "x", m[0]), _with_gaps(lines))
    for m in INLINE.finditer(whole):
        yield whole.count("\n", 0, m.start()) + 1, m[1]


def _with_gaps(lines: dict[int, str]) -> str:
    """The lines at their numbers, empty ones between them."""
    return "\n".join(lines.get(n, "") for n in range(1, max(lines, default=0) + 1))


def anchors(text: str) -> frozenset[str]:
    """The addresses of a page's headings, a repeated one with -1, -2, and those that <a id> names."""
    seen: Counter[str] = Counter()
    found: set[str] = set()
    for _, line in prose(text):
        found.update(NAMED.findall(line))
        if m := HEADING.match(line):
            name = address(m[1])
            found.add(f"{name}-{seen[name]}" if seen[name] else name)
            seen[name] += 1
    return frozenset(found)


def address(heading: str) -> str:
    """The address that GitHub gives a heading: of a link its text, no marks, small letters, - for a space."""
    shown = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", heading)
    return re.sub(r"[^\w\- ]", "", shown.lower()).replace(" ", "-")


def dead(page: str, target: str, known: frozenset[str], anchors_of: Callable[[str], frozenset[str]]) -> str | None:
    """Why a link of a page leads nowhere, or None."""
    path, _, anchor = target.partition("#")
    place = posixpath.normpath(posixpath.join(posixpath.dirname(page), unquote(path))) if path else page
    if place not in known and not any(name.startswith(f"{place}/") for name in known) and place != ".":
        return f"expected a file of the checkout, got {target}"
    if not anchor:
        return None
    if not place.endswith(".md"):
        return f"expected a page before the #, got {target}"
    return None if unquote(anchor) in anchors_of(place) else f"expected a heading of {place}, got #{anchor}"


def check(root: Path) -> list[str]:
    """Every dead link: page, line, why."""
    known = files(root)

    @cache
    def anchors_of(page: str) -> frozenset[str]:
        return anchors((root / page).read_text(encoding="utf-8"))

    found = []
    for page in sorted(name for name in known if name.endswith(".md") and name not in LEFT_OUT):
        for line, target in targets((root / page).read_text(encoding="utf-8")):
            why = None if OUTSIDE.match(target) else dead(page, target, known, anchors_of)
            if why:
                found.append(f"{page}:{line}: {why}")
    return found


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; see the module's text. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--root", type=Path, default=ROOT, help="another checkout")
    found = check(parser.parse_args(argv).root)
    for line in found:
        print(line, file=sys.stderr)
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
