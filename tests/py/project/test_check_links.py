"""tools/check_links.py: what is dead is named, what is in code is not looked at, and our pages have no dead link."""

from __future__ import annotations

import subprocess
from pathlib import Path

import check_links
import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = """# A page

## Set-up, `words` & [links](b.md)

## Twice

## Twice

<a id="own"></a>

```sh
# no heading
```
"""


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    (tmp_path / "docs").mkdir()
    (tmp_path / "docs/page.md").write_text(PAGE)
    (tmp_path / "docs/b.md").write_text("# Страница\n")
    (tmp_path / "docs/code.c").write_text("int x;\n")
    subprocess.run(["git", "init", "-q", str(tmp_path)], check=True)
    return tmp_path


def dead(root: Path, text: str) -> list[str]:
    (root / "README.md").write_text(text)
    return check_links.check(root)


@pytest.mark.parametrize(
    "text",
    [
        "[a](docs/page.md), [folder](docs), ![c](docs/code.c), [web](https://example.com/none.md#none)",
        "[a](docs/page.md#set-up-words--links) [b](docs/b.md#страница) [b](docs/%62.md)",
        "[first](docs/page.md#twice) [second](docs/page.md#twice-1) [own](docs/page.md#own)",
        "# Here\n\n[here](#here) [[1]](docs/b.md) [`code`](docs/b.md)\n\n[name]: docs/b.md\n",
        "`[a](none.md)` and ``[`a`](none.md)``\n\n```\n[a](none.md)\n```\n\n~~~\n```\n[a](none.md)\n~~~\n",
    ],
)
def test_a_link_that_leads_somewhere_passes(checkout: Path, text: str) -> None:
    assert dead(checkout, text) == []


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("One.\n\n[a](none.md)", "README.md:3: expected a file of the checkout, got none.md"),
        ("[a\nb](docs/none.md)", "README.md:1: expected a file of the checkout, got docs/none.md"),
        ("![a](docs/none.svg)", "README.md:1: expected a file of the checkout, got docs/none.svg"),
        ("[name]: docs/none.md", "README.md:1: expected a file of the checkout, got docs/none.md"),
        ("`a` [`b`](none.md) `c`", "README.md:1: expected a file of the checkout, got none.md"),
        ("[a](../README.md)", "README.md:1: expected a file of the checkout, got ../README.md"),
        ("[a](docs/page.md#none)", "README.md:1: expected a heading of docs/page.md, got #none"),
        ("[a](docs/page.md#no-heading)", "README.md:1: expected a heading of docs/page.md, got #no-heading"),
        ("[a](docs/page.md#twice-2)", "README.md:1: expected a heading of docs/page.md, got #twice-2"),
        ("[a](#none)", "README.md:1: expected a heading of README.md, got #none"),
        ("[a](docs/code.c#L1)", "README.md:1: expected a page before the #, got docs/code.c#L1"),
    ],
)
def test_a_dead_link_is_named_with_its_line(checkout: Path, text: str, says: str) -> None:
    assert dead(checkout, text) == [says]


def test_what_git_ignores_is_not_there(checkout: Path) -> None:
    (checkout / ".gitignore").write_text("build\n")
    (checkout / "build").mkdir()
    (checkout / "build/a.md").write_text("# A\n")
    assert dead(checkout, "[a](build/a.md)") == ["README.md:1: expected a file of the checkout, got build/a.md"]


def test_the_status_tells_dead_links(checkout: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (checkout / "README.md").write_text("[a](docs/b.md)")
    assert check_links.main(["--root", str(checkout)]) == 0
    (checkout / "README.md").write_text("[a](none.md)")
    assert check_links.main(["--root", str(checkout)]) == 1
    assert "none.md" in capsys.readouterr().err


def test_our_pages_have_no_dead_link() -> None:
    pages = [name for name in check_links.files(ROOT) if name.endswith(".md")]
    assert sum(len(list(check_links.targets((ROOT / name).read_text()))) for name in pages) > 700
    assert check_links.check(ROOT) == []
