"""The site: every page has its place, every link leads somewhere, and nothing comes from the network."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import notebooks
import pytest
from sitegen import build
from sitegen.c_pages import header_page
from sitegen.prose import markdown
from sitegen.python_pages import module_page

ROOT = Path(__file__).parents[3]
WITH_SITE = pytest.mark.skipif(not notebooks.PACKAGES.is_dir(), reason="Sphinx is not there: tools/setup all")
# What a browser fetches by itself: not the target of <a>.
FETCHED = re.compile(
    r"""<(?!a\b)[a-z]+\b[^>]*?\b(?:src|srcset|href|data|poster)\s*=\s*["']?\s*((?:[a-z]+:)?//[^"'\s>]+)"""
    r"""|(?:@import\s+(?:url\()?|url\()\s*["']?\s*((?:https?:)?//[^"'\s)]+)"""
    r"""|\b(?:fetch|import|importScripts)\(\s*["'`]((?:https?:)?//[^"'`]+)""",
    re.IGNORECASE,
)


@pytest.fixture(scope="module")
def pages() -> build.Pages:
    return build.collect(ROOT)


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
def test_every_link_of_every_page_leads_somewhere_and_nothing_comes_from_the_network(
    tmp_path: Path, pages: build.Pages
) -> None:
    """The whole site, as users build it; a link without a target is an error there. Raw HTML is searched, too."""
    command = [sys.executable, str(ROOT / "tools/sitegen/build.py"), "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    written = {str(p.relative_to(tmp_path).with_suffix("")) for p in tmp_path.rglob("*.html")}
    assert set(pages.names) <= written
    assert any(name.startswith("examples/notebooks/") for name in written)
    assert '"First frame"' in (tmp_path / "searchindex.js").read_text()  # search reads it as a script: no server
    files = [p for p in tmp_path.rglob("*") if p.suffix in (".html", ".css", ".js")]
    assert len(files) > 15
    assert {str(p): fetched(p.read_text()) for p in [*files, *build.SOURCE.rglob("*.md")]} == {
        str(p): [] for p in [*files, *build.SOURCE.rglob("*.md")]
    }


def test_each_page_has_one_place(pages: build.Pages) -> None:
    """Of the checkout; `placed` refuses else."""
    entries = build.navigation()
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


def test_a_folder_that_a_page_links_to_becomes_a_list(pages: build.Pages) -> None:
    assert "](docs/chips/index.md)" in pages.texts["CONTRIBUTING.md"]
    assert "[ads1282.md](ads1282.md)" in pages.texts["docs/chips/index.md"]
    assert "emu/chip/ads1282/regs.c" not in pages.texts


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("a line that is filled and\ngoes on", "a line that is filled and goes on"),
        ("Time: so.\nLevels: a long line that is filled up", "Time: so.\n\nLevels: a long line that is filled up"),
        ("x_p is *p, `a*b`", r"x\_p is \*p, `a*b`"),
        ("See docs/nav.md and docs/none.md.", "See [docs/nav.md](/docs/nav.md) and docs/none.md."),
        ("as\n\n    f(1)\n\n    g(2)\n\nthen", "as\n\n```python\nf(1)\n\ng(2)\n```\n\nthen"),
        ("pins:\n  a  b\n  c  d\nend", "pins:\n\n```text\na  b\nc  d\n```\n\nend"),
    ],
)
def test_a_comment_becomes_markdown(text: str, shown: str) -> None:
    assert markdown(text, "python", {"docs/nav.md"}) == shown


HEADER = """/* A library.
 * More. */
#ifndef A_H
#define A_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#define A_MOST 3 /* of them */

/* ---- Parts ---- */

/* Makes one. */
NAV_API int a_new(int n); /* NULL: no */
typedef void a_fn(void *ctx);

#ifdef __cplusplus
}
#endif

#endif
"""


def test_a_header_becomes_a_page() -> None:
    page = header_page("nav/a.h", HEADER, ())
    parts = ["# a.h", "A library. More.", "## `A_MOST`", "```c\n#define A_MOST 3 /* of them */\n```", "## Parts"]
    parts += ["### `a_new()`, `a_fn`", "Makes one.", "```c\nint a_new(int n); /* NULL: no */"]
    assert page == "\n\n".join(parts) + "\ntypedef void a_fn(void *ctx);\n```\n"


@pytest.mark.parametrize("page", ["psabench", "nav", "nav_mc", "kf", "sins", "koi"])
def test_every_function_of_a_public_header_is_on_its_page(page: str, pages: build.Pages) -> None:
    """Headers and pages, by two ways of finding a declaration."""
    path = ROOT / ("emu/api/psabench.h" if page == "psabench" else f"nav/{page}.h")
    shown = pages.texts[f"api/c/{page}.md"]
    declared = re.findall(r"_API [\w *]*?\b((?:psabench|nav)_\w+)\(", path.read_text())
    assert len(declared) > 4
    blocks = "".join(re.findall(r"```c\n(.*?)```", shown, re.DOTALL))
    assert [name for name in declared if f"{name}(" not in blocks] == []


MODULE = '''"""A module."""

from dataclasses import dataclass


@dataclass
class Box:
    """Of things."""

    size_m: float = 1.0  # of an edge
    _hidden: int = 0

    @property
    def volume_m3(self) -> float:
        """Of its inside."""
        return self.size_m**3

    def _turn(self) -> None: ...


def long_name(first: int, *, second_argument_of_it: str = "a", third_argument: str | None = None) -> dict[str, int]:
    """Does it."""
    return {}
'''


def test_a_module_becomes_a_page() -> None:
    page = module_page("psabench.box", MODULE, ())
    assert page.startswith("# psabench.box\n\nA module.\n\n## `Box`\n\n```python\nclass Box\n```\n\nOf things.")
    assert "```python\nsize_m: float = 1.0  # of an edge\n```" in page
    assert "### `Box.volume_m3`\n\n```python\n@property\ndef volume_m3(self) -> float\n```\n\nOf its inside." in page
    assert "_hidden" not in page
    assert "_turn" not in page
    assert "    first: int,\n    *,\n    second_argument_of_it: str = 'a',\n    third" in page
