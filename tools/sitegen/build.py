#!/usr/bin/env python3
"""The site: every page of the checkout, the notebooks and the reference of the interfaces, by Sphinx (docs/tools/site.md).

Usage:
    build.py [--out DIR]    default build/site; exit 1 with Sphinx's warnings if there is one

Pages stay where they are. They are copied to build/site-src beside what is made for the site alone: the start page and the
navigation (navigation.yaml), lists of folders that a page links to, the reference of libraries and of the Python package.
Needs the packages of .venv/site (tools/setup site).
"""

from __future__ import annotations

import argparse
import posixpath
import re
import shutil
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import yaml

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

import check_links  # noqa: E402 - of tools/

from sitegen.c_pages import c_pages  # noqa: E402
from sitegen.python_pages import python_pages  # noqa: E402

HERE = Path(__file__).parent
PACKAGES = ROOT / ".venv/site"
SOURCE, OUT = ROOT / "build/site-src", ROOT / "build/site"
NAVIGATION = HERE / "navigation.yaml"
PAGE = (".md", ".ipynb")
NOTEBOOKS = "examples/notebooks/"
OVERVIEW = "Overview"
TITLE = re.compile(r"^#\s+(.+?)\s*$", re.MULTILINE)


@dataclass
class Pages:
    """Texts by their paths in the source of the site, and files of the checkout that they link to."""

    texts: dict[str, str]
    files: set[str] = field(default_factory=set)

    @property
    def names(self) -> list[str]:
        """Of pages, without endings."""
        return sorted(p.rpartition(".")[0] for p in self.texts)

    def title(self, name: str) -> str:
        """The first heading; README has that of the project."""
        if name == "README":
            return OVERVIEW
        text = next(self.texts[name + e] for e in PAGE if name + e in self.texts)
        found = TITLE.search(text.replace('"# ', "\n# ").replace('\\n"', "\n"))
        return re.sub(r"[`*]", "", found[1]) if found else name


def collect(root: Path) -> Pages:
    """The pages of a checkout, their links to folders changed to lists of these."""
    known = check_links.files(root)
    texts = {p: (root / p).read_text(encoding="utf-8") for p in sorted(known) if _is_page(p)}
    made = Pages(texts)
    folders: set[str] = set()
    for page, text in texts.items():
        if page.endswith(".md"):
            texts[page] = _with_lists(page, text, known, made.files, folders)
    for folder in sorted(folders):
        inside = sorted(f for f in known if posixpath.dirname(f) == folder)
        made.texts[f"{folder}/index.md"] = _folder_page(folder, inside)
        made.files |= {f for f in inside if not _is_page(f)}
    written = frozenset(texts)
    made.texts |= c_pages(root, written) | python_pages(root, written)
    return made


def _is_page(path: str) -> bool:
    return path.endswith(".md") and path not in check_links.LEFT_OUT or path.startswith(NOTEBOOKS) and path.endswith(PAGE)


def _with_lists(page: str, text: str, known: frozenset[str], files: set[str], folders: set[str]) -> str:
    """The text; notes files and folders that it links to. A link that leads nowhere stays, for Sphinx to find."""
    for _, target in set(check_links.targets(text)):
        path = target.partition("#")[0]
        if not path or check_links.OUTSIDE.match(target):
            continue
        place = posixpath.normpath(posixpath.join(posixpath.dirname(page), unquote(path)))
        if place in known:
            files |= set() if _is_page(place) else {place}
        elif any(f.startswith(f"{place}/") for f in known):
            folders.add(place)
            text = text.replace(f"]({target})", f"]({path.rstrip('/')}/index.md)")
    return text


def _folder_page(folder: str, inside: Sequence[str]) -> str:
    rows = (f"- [{posixpath.basename(f)}]({posixpath.basename(f)})" for f in inside)
    return f"# {folder}/\n\n" + "\n".join(rows) + "\n"


# ---- navigation


def navigation(path: Path = NAVIGATION) -> list[dict[str, Any]]:
    found = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert isinstance(found, list)
    return found


def placed(entries: Sequence[Mapping[str, Any]], names: Sequence[str]) -> list[list[str]]:
    """The pages of each entry, with what `*` is. Raises ValueError for a page that is not there, twice or nowhere."""
    by_name = [p for e in entries for p in e["pages"] if not p.endswith("/*")]
    rest = [n for n in names if n not in by_name]
    found = [[n for p in e["pages"] for n in _matches(p, rest)] for e in entries]
    flat = [n for part in found for n in part]
    wrong = {n for n in flat if flat.count(n) > 1 or n not in names}
    wrong |= {n for e in entries for n in e["first"] if n not in names}
    lists = {n for n in names if n.endswith("/index")}  # reached from their links
    wrong |= set(names) - set(flat) - lists
    if wrong:
        raise ValueError(f"{NAVIGATION.name}: expected each page in one entry, got {', '.join(sorted(wrong))}")
    return found


def _matches(pattern: str, rest: Sequence[str]) -> Iterator[str]:
    if not pattern.endswith("/*"):
        yield pattern
        return
    yield from (n for n in rest if posixpath.dirname(n) == pattern[:-2] and not n.endswith("/index"))


def start_page(entries: Sequence[Mapping[str, Any]], pages: Pages) -> str:
    """Tasks with their links; the navigation of all pages is hidden in it."""
    lines = ["# psabench", "", "Converter boards of a strapdown inertial navigation system, emulated register by register."]
    for e in entries:
        lines += ["", f"## {e['title']}", "", e["text"], ""]
        lines += [f"- [{pages.title(n)}](/{n})" for n in e["first"]]
    for e, names in zip(entries, placed(entries, pages.names), strict=True):
        lines += ["", "```{toctree}", ":hidden:", f":caption: {e['title']}", "", *map(_entry, names), "```"]
    lists = [n for n in pages.names if n.endswith("/index")]
    return "\n".join([*lines, "", "```{toctree}", ":hidden:", ":caption: Folders", "", *lists, "```", ""])


def _entry(name: str) -> str:
    """Of a navigation."""
    return f"{OVERVIEW} <{name}>" if name == "README" else name


# ---- the site


def assemble(root: Path, source: Path) -> None:
    """Writes the whole source of the site."""
    pages = collect(root)
    pages.texts["index.md"] = start_page(navigation(), pages)
    shutil.rmtree(source, ignore_errors=True)
    for path, text in pages.texts.items():
        (source / path).parent.mkdir(parents=True, exist_ok=True)
        (source / path).write_text(text, encoding="utf-8")
    for path in pages.files:
        (source / path).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(root / path, source / path)


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; see the module's text. Returns the exit status."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", 1)[0])
    parser.add_argument("--out", type=Path, default=OUT, help="folder of the site (build/site)")
    args = parser.parse_args(argv)
    if not PACKAGES.is_dir():
        print(f"{PACKAGES.relative_to(ROOT)}: expected packages, got none: tools/setup site", file=sys.stderr)
        return 2
    sys.path.append(str(PACKAGES))
    from sphinx.cmd.build import build_main

    assemble(ROOT, SOURCE)
    trees = Path(f"{SOURCE}-doctrees")
    for folder in (args.out, trees):
        shutil.rmtree(folder, ignore_errors=True)
    status = int(build_main(["-q", "-W", "-b", "html", "-c", str(HERE), "-d", str(trees), str(SOURCE), str(args.out)]))
    if status == 0:
        print(f"site: {args.out}/index.html")
    return status


if __name__ == "__main__":
    sys.exit(main())
