#!/usr/bin/env python3
"""Phrases that no text uses (docs/terms.md), and the form of errors: `<where>: expected <what>, got <value>`.

Usage:
    check_phrases.py                 exit 1 if a phrase or an error of another form is above its limit; says where
    check_phrases.py --list [NAME]   every place of a phrase, of all, or of "errors"
    check_phrases.py --root DIR      of another checkout

A limit above 0 is a debt: lower it when you rewrite texts, never raise it.

Errors in Python: a raise of an input error makes its text with errors.expected(), or passes on the text of another
error after a prefix, as `{path}: {e}`. In C: the text of an error has "expected", or ends with that of another error,
`%s`. What failed outside the program (no answer, a closed link, no memory) is no input error and has its own text.
"""

from __future__ import annotations

import argparse
import ast
import itertools
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


# Errors about an input: an argument, an option, a file, a name.
INPUT_ERRORS = ("ArgumentTypeError", "BadInput", "KeyError", "RequirementsError", "ValueError", "Wrong")
C_CALLS = re.compile(r"\b(why_fail|api_fail|fail_option|yaml_file_fail)\(")
C_STRING = re.compile(r'"((?:[^"\\]|\\.)*)"')

# Texts of another form that stay, by file: part of the text, and why. A row goes with its text.
DECLARED = {
    ("scripts/psabench/boards/gyro/device.py", "rejected by the unit"): "the unit's own text",
    ("scripts/psabench/campaign/emulated.py", "psa-emu: "): "the emulator's own text",
    ("scripts/psabench/link/canopen_host.py", "remote frames"): "not supported by the transports",
    ("scripts/psabench/options.py", "next(texts"): "argparse's messages, in this form where options.py knows them",
}
# The count of C texts of another form: states of links, files and the bus, and input texts to rewrite. Only lower it.
C_LIMIT = 4


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


def python_errors(root: Path) -> Iterator[Place]:
    """Errors of another form in Python, the declared ones included."""
    for path in sorted((root / "scripts").rglob("*.py")):
        source = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(source)):
            if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) and _is_other(node.exc):
                text = " ".join((ast.get_source_segment(source, node.exc) or "").split())
                yield Place(str(path.relative_to(root)), node.lineno, text)


def _is_other(call: ast.Call) -> bool:
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    if name not in INPUT_ERRORS or not call.args:
        return False
    parts = list(ast.walk(call.args[0]))
    if any(isinstance(p, ast.Call) and getattr(p.func, "id", "") == "expected" for p in parts):
        return False
    return any(isinstance(p, ast.Constant) and isinstance(p.value, str) for p in parts) and not _passes_on(call.args[0])


def _passes_on(text: ast.expr) -> bool:
    """`{where}: {e}`, `{where}: {e} (...)`: the text of another error after a prefix."""
    if not isinstance(text, ast.JoinedStr):
        return False
    parts = text.values
    for before, value in itertools.pairwise(parts):
        ends = isinstance(before, ast.Constant) and str(before.value).endswith(": ")
        if ends and isinstance(value, ast.FormattedValue) and _is_error(value.value):
            return True
    return False


def _is_error(value: ast.expr) -> bool:
    """e, err, e.strerror, part.note, reason, str(e).splitlines()[0]: made from another error."""
    names = {n.id for n in ast.walk(value) if isinstance(n, ast.Name)}
    notes = {n.attr for n in ast.walk(value) if isinstance(n, ast.Attribute)}
    return bool(names & {"e", "err", "error", "reason"} or notes & {"note"})


def c_errors(root: Path) -> Iterator[Place]:
    """Errors of another form in C."""
    for path in sorted((root / "emu").rglob("*.c")):
        source = path.read_text(encoding="utf-8")
        for m in C_CALLS.finditer(source):
            text = "".join(C_STRING.findall(source[m.end() : source.find(";", m.end())]))
            if text and "expected " not in text and not re.search(r"(^|: )%s$", text) and "of memory" not in text:
                yield Place(str(path.relative_to(root)), source.count("\n", 0, m.start()) + 1, text)


def is_declared(place: Place) -> bool:
    return any(place.file == file and part in place.text for file, part in DECLARED)


def check_errors(root: Path, c_limit: int = C_LIMIT) -> int:
    """The number of errors of another form above the limits; each is reported."""
    found, in_c = list(python_errors(root)), list(c_errors(root))
    other = [p for p in found if not is_declared(p)]
    unused = [k for k in DECLARED if not any(p.file == k[0] and k[1] in p.text for p in found)] if found else []
    for p in other:
        print(f"{p.file}:{p.line}: expected a text made by errors.expected(), got {p.text[:110]}", file=sys.stderr)
    for file, part in unused:
        print(f"check_phrases: {file}: remove the declared exception {part!r}: the text has gone", file=sys.stderr)
    if len(in_c) > c_limit:
        for p in in_c:
            print(f'{p.file}:{p.line}: expected a text with "expected", got "{p.text[:90]}"', file=sys.stderr)
        print(f"check_phrases: {len(in_c)} errors of another form in emu, limit {c_limit}", file=sys.stderr)
    elif len(in_c) < c_limit:
        print(f"check_phrases: lower the limit of emu from {c_limit} to {len(in_c)}")
    return len(other) + len(unused) + max(0, len(in_c) - c_limit)


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; see the module's text. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument(
        "--list", nargs="?", const="", metavar="NAME", help="every place of a phrase, of all, or of errors"
    )
    parser.add_argument("--root", type=Path, default=ROOT, help="another checkout")
    args = parser.parse_args(argv)
    if args.list is None:
        return 1 if check(args.root) + check_errors(args.root) else 0
    paths = list(files(args.root))
    if args.list == "errors":
        for place in [*python_errors(args.root), *c_errors(args.root)]:
            print(f"{place.file}:{place.line}: {place.text}")
    for phrase in PHRASES:
        if args.list in ("", phrase.name):
            for place in places(phrase, paths, args.root):
                print(f"{place.file}:{place.line}: {place.text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
