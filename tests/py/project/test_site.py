"""The site: every page has its place, every link leads somewhere, and nothing comes from the network."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import notebooks
import pytest
from sitegen import build

ROOT = Path(__file__).parents[3]
WITH_SITE = pytest.mark.skipif(not notebooks.PACKAGES.is_dir(), reason="Sphinx is not there: tools/setup all")
SAMPLE = ("index", "README", "docs/chips/ads1282", "docs/procedures/thermal", "examples/notebooks/first_frame")
# What a browser fetches by itself: not the target of <a>.
FETCHED = re.compile(
    r"""<(?!a\b)[a-z]+\b[^>]*?\b(?:src|srcset|href|data|poster)\s*=\s*["']?\s*((?:[a-z]+:)?//[^"'\s>]+)"""
    r"""|(?:@import\s+(?:url\()?|url\()\s*["']?\s*((?:https?:)?//[^"'\s)]+)"""
    r"""|\b(?:fetch|import|importScripts)\(\s*["'`]((?:https?:)?//[^"'`]+)""",
    re.IGNORECASE,
)


def fetched(text: str) -> list[str]:
    """Addresses of the network in a page, a style or a script."""
    return ["".join(m.groups(default="")) for m in FETCHED.finditer(text)]


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ('<script defer src="https://cdn.example/x.js"></script>', ["https://cdn.example/x.js"]),
        ('<link rel="stylesheet" href="//fonts.example/css">', ["//fonts.example/css"]),
        ("<img alt='a' src='http://example/a.png'>", ["http://example/a.png"]),
        ('@import "https://fonts.example/a.css";', ["https://fonts.example/a.css"]),
        ("src: url(https://fonts.example/a.woff2)", ["https://fonts.example/a.woff2"]),
        ("await fetch('https://example/x')", ["https://example/x"]),
        ('<a href="https://example/">', []),
        ('<img src="_images/a.svg"><link href="_static/a.css"> url("data:image/svg+xml,http://www.w3.org")', []),
    ],
)
def test_an_address_of_the_network_is_found(text: str, found: list[str]) -> None:
    assert fetched(text) == found


@WITH_SITE
def test_every_link_of_every_page_leads_somewhere_and_nothing_comes_from_the_network(tmp_path: Path) -> None:
    """All pages are read, some are written: the templates are the same. Raw HTML of the others is searched, too."""
    command = [sys.executable, ROOT / "tools/sitegen/build.py", "--out", tmp_path, "--check", *SAMPLE]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    for page in SAMPLE:
        assert (tmp_path / f"{page}.html").is_file()
    assert '"First frame"' in (tmp_path / "searchindex.js").read_text()  # search reads it as a script: no server
    files = [p for p in tmp_path.rglob("*") if p.suffix in (".html", ".css", ".js")]
    assert len(files) > 15
    assert {str(p): fetched(p.read_text()) for p in [*files, *build.SOURCE.rglob("*.md")]} == {
        str(p): [] for p in [*files, *build.SOURCE.rglob("*.md")]
    }


def test_each_page_has_one_place() -> None:
    """Of the checkout; `placed` refuses else."""
    entries = build.navigation()
    pages = build.collect(ROOT)
    flat = [name for names in build.placed(entries, pages.names) for name in names]
    assert len(flat) == len(set(flat)) > 100


ENTRY = {"title": "T", "text": "t", "first": ["a"], "pages": ["a", "docs/*"]}


@pytest.mark.parametrize(
    ("names", "more", "said"),
    [
        (["a", "docs/b", "other/c"], [], "other/c"),
        (["docs/b"], [], "a"),
        (["a", "docs/b"], [ENTRY | {"pages": ["docs/b"]}, ENTRY | {"pages": ["docs/b"]}], "docs/b"),
        (["a", "docs/b"], [ENTRY | {"first": ["docs/d"], "pages": []}], "docs/d"),
    ],
)
def test_a_page_without_a_place_is_named(names: list[str], more: list[dict[str, object]], said: str) -> None:
    with pytest.raises(ValueError, match=f"expected each page in one entry, got {said}$"):
        build.placed([ENTRY, *more], names)


def test_a_folder_that_a_page_links_to_becomes_a_list() -> None:
    pages = build.collect(ROOT)
    assert "](docs/chips/index.md)" in pages.texts["README.md"]
    assert "[ads1282.md](ads1282.md)" in pages.texts["docs/chips/index.md"]
    assert "emu/chip/ads1282/regs.c" not in pages.texts
