"""Reference of the C libraries: the public headers as pages, comments as text, declarations below them."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator
from pathlib import Path

from sitegen.prose import markdown

HEADERS = (
    "emu/api/psabench.h",
    "emu/api/psabench_models.h",
    *(f"nav/{n}.h" for n in ("nav", "nav_mc", "kf", "sins", "strapdown", "errors", "koi")),
)  # fmt: skip - as tools/install has them
TEXT = re.compile(r"/\*(.*?)\*/\s*", re.DOTALL)
SECTION = re.compile(r"/\* -+ (.+?) -+ \*/\s*")
API = re.compile(r"^(?:PSABENCH_API|NAV_API) ", re.MULTILINE)
# Names that a block declares: functions and their types, structures and enumerations, constants.
NAMES = re.compile(
    r"^(?:PSABENCH_API|NAV_API)[^(;]*?\b(?P<function>\w+)\("
    r"|^typedef \w+ (?P<callback>\w+)\(|^typedef (?:struct|enum) \w+ (?P<type>\w+);"
    r"|^(?P<kind>struct|enum) (?P<tag>\w+) \{|^#define (?P<macro>[A-Z]\w+)",
    re.MULTILINE,
)
# What is the compiler's affair.
PLUMBING = re.compile(
    r"^#if(?:n?def| ).*?^#endif\n|^#(?:include|endif)\b[^\n]*\n|^#define NAV_API [^\n]*\n|^extern \"C\" \{\n",
    re.MULTILINE | re.DOTALL,
)


def c_pages(root: Path, pages: Collection[str]) -> dict[str, str]:
    """Path and text of each page."""
    return {f"api/c/{Path(h).stem}.md": header_page(h, (root / h).read_text(encoding="utf-8"), pages) for h in HEADERS}


def header_page(path: str, text: str, pages: Collection[str]) -> str:
    """A header's page. Raises ValueError for a header that does not begin with its text."""
    m = TEXT.match(text)
    if not m:
        raise ValueError(f"{path}: expected a comment at its beginning, got {text[:20]!r}")
    parts = [f"# {Path(path).name}", markdown(_comment(m[1]), "c", pages)]
    level = "##"
    for block in _blocks(_declarations(text[m.end() :])):
        level = "###" if SECTION.match(block) else level
        parts += _block_parts(block, level, pages)
    return "\n\n".join(parts) + "\n"


def _declarations(text: str) -> str:
    """Without the guard, what C++ needs, and includes."""
    guard = re.match(r"#ifndef (\w+)\n#define \1\n", text)
    return PLUMBING.sub("", text[guard.end() :] if guard else text)


def _blocks(text: str) -> Iterator[str]:
    yield from (b.strip("\n") for b in re.split(r"\n\s*\n", text) if b.strip())


def _block_parts(block: str, level: str, pages: Collection[str]) -> Iterator[str]:
    """A heading of what it declares, its comment as text, its declarations as code."""
    if m := SECTION.match(block):
        yield f"## {m[1]}"
        block = block[m.end() :]
    names = [_name(m) for m in NAMES.finditer(block)]
    if names:
        yield f"{level} {', '.join(names[:4])}{', …' if len(names) > 4 else ''}"
    if m := TEXT.match(block):
        yield markdown(_comment(m[1]), "c", pages)
        block = block[m.end() :]
    if block.strip():
        yield f"```c\n{API.sub('', block)}\n```"


def _name(m: re.Match[str]) -> str:
    if m["function"]:
        return f"`{m['function']}()`"
    return f"`{m['kind']} {m['tag']}`" if m["tag"] else f"`{m['callback'] or m['type'] or m['macro']}`"


def _comment(text: str) -> str:
    """Its lines without the stars."""
    return "\n".join(re.sub(r"^ \* ?", "", line) for line in text.strip().split("\n"))
