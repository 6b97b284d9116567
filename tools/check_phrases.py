#!/usr/bin/env python3
"""Phrases that no text of the project uses: README, docs, help texts, messages, comments (docs/terms.md).

Usage:
    check_phrases.py                 exit 1 if a phrase occurs more often than its limit; says where
    check_phrases.py --list [NAME]   every place of a phrase, or of all
    check_phrases.py --root DIR      of another checkout

A limit above 0 is a debt: lower it when you rewrite texts, never raise it.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TEXTS = (".md", ".c", ".h", ".cpp", ".hpp", ".py", ".yaml", ".toml", ".sh", ".psa", ".in", "Makefile", "lint", "setup")
# Lists of the phrases themselves, and recorded data.
LEFT_OUT = ("docs/terms.md", "tools/check_phrases.py", "tests/py/project/test_check_phrases.py", "tests/fuzz/corpus/")


@dataclass(frozen=True, slots=True)
class Phrase:
    """What is not written, what to write instead, and how often it may still occur."""

    name: str
    pattern: str
    instead: str
    limit: int = 0


@dataclass(frozen=True, slots=True)
class Place:
    """Where a phrase occurs."""

    file: str
    line: int
    text: str


PHRASES = (
    Phrase("is wanted", r"\b(is|are|was|were) wanted\b", "expected <what>, got <value>; is required"),
    Phrase("is told", r"\b(is|are|was|were) told\b", "is reported, is notified, gets"),
    Phrase("nobody", r"\bnobody('s)?\b", "name the object: no client, no node, not observable"),
    Phrase("anew", r"(?<![-.])\banew\b", "again"),
    Phrase("stands", r"\bstands\b(?! still)|\bstand in\b|\bwhat stands\b", "is, is in, contains, replaces"),
    Phrase("likewise", r"\blikewise\b", "repeat the fact, or: the same"),
    Phrase("for ever", r"\bfor ever\b", "without end, forever"),
    Phrase("befalls", r"\bbefalls?\b", "affects"),
    Phrase("brings about", r"\b(brings?|brought) about\b", "causes, injects"),
    Phrase("somebody else's", r"\bsomebody else's\b", "another client's"),
    Phrase("cries wolf", r"\bcr(y|ies) wolf\b", "false alarm"),
    Phrase("quantum of velocity", r"\bquantum of velocity\b", "velocity resolution (LSB weight)"),
)


def files(root: Path) -> Iterator[Path]:
    """The tracked texts of a checkout."""
    listed = subprocess.run(
        ["git", "-C", str(root), "ls-files", "-z"], check=True, capture_output=True, text=True
    ).stdout
    for name in listed.split("\0"):
        if name.endswith(TEXTS) and not name.startswith(LEFT_OUT) and (root / name).is_file():
            yield root / name


def places(phrase: Phrase, paths: Iterable[Path], root: Path) -> list[Place]:
    """Every place of a phrase; a phrase may be broken at the end of a line."""
    pattern = re.compile(phrase.pattern.replace(" ", r"\s+(?:(?:\*|//|#)\s+)?"), re.IGNORECASE)
    found = []
    for path in paths:
        text = path.read_text(encoding="utf-8", errors="replace")
        for m in pattern.finditer(text):
            number = text.count("\n", 0, m.start()) + 1
            found.append(Place(str(path.relative_to(root)), number, text.splitlines()[number - 1].strip()))
    return found


def report(phrase: Phrase, found: Sequence[Place]) -> None:
    print(f'"{phrase.name}": {len(found)}, limit {phrase.limit}; write instead: {phrase.instead}', file=sys.stderr)
    for place in found[:20]:
        print(f"  {place.file}:{place.line}: {place.text[:110]}", file=sys.stderr)
    if len(found) > 20:
        print(f"  and {len(found) - 20} more (tools/check_phrases.py --list '{phrase.name}')", file=sys.stderr)


def check(root: Path, phrases: Sequence[Phrase] = PHRASES) -> int:
    """The number of phrases above their limits; each is reported."""
    paths = list(files(root))
    above = 0
    for phrase in phrases:
        found = places(phrase, paths, root)
        if len(found) > phrase.limit:
            report(phrase, found)
            above += 1
        elif len(found) < phrase.limit:
            print(f'check_phrases: "{phrase.name}": lower the limit from {phrase.limit} to {len(found)}')
    return above


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; see the module's text. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--list", nargs="?", const="", metavar="NAME", help="every place of a phrase, or of all")
    parser.add_argument("--root", type=Path, default=ROOT, help="another checkout")
    args = parser.parse_args(argv)
    if args.list is None:
        return 1 if check(args.root) else 0
    paths = list(files(args.root))
    for phrase in PHRASES:
        if args.list in ("", phrase.name):
            for place in places(phrase, paths, args.root):
                print(f"{place.file}:{place.line}: {place.text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
