"""Every "sources N.N" that code, tests and pages cite is in docs/sources.md, and what is there exists."""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
PAGE = ROOT / "docs/sources.md"
CITED = ("emu", "proto", "scripts", "tests", "tools", "docs", "examples", "decoders", "README.md", "Makefile")

GAP = r"[\s*/#]+"  # a comment may break its line here
NUMBER = r"\d(?:\.\d)?"
CITATION = re.compile(
    rf"\b[Ss]ources\]?(?:\([^)]*\))?{GAP}(?P<sheet>(?:instruments|can){GAP})?"
    rf"(?P<first>\d\.\d)(?P<more>(?:(?:,|-|{GAP}(?:\.\.|to|and))[\s*/#]*\d\.\d(?![\d.]\d))*)"
)
ENTRY = re.compile(rf"^\| (?P<key>(?:instruments |can )?{NUMBER}) \|", re.MULTILINE)
DANGLING = re.compile(r"\b[Ff]acts? (?:sheet|adc-chips|instruments|can|\d)|\bfacts/")


def entries() -> set[str]:
    return {m["key"] for m in ENTRY.finditer(PAGE.read_text())}


def cited(text: str) -> Iterator[str]:
    for m in CITATION.finditer(text):
        sheet = f"{(m['sheet'] or '').strip(' */#')} ".lstrip()
        for number in (m["first"], *re.findall(r"\d\.\d", m["more"])):
            yield sheet + number


def files() -> list[Path]:
    """Text files under version control, or about to be."""
    command = ["git", "ls-files", "--cached", "--others", "--exclude-standard", "--", *CITED]
    try:
        names = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout.splitlines()
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("not a git checkout")
    here = (ROOT / n for n in names if n.endswith((".c", ".h", ".py", ".md", ".yaml")))
    return [p for p in here if p.exists() and p != Path(__file__)]


@pytest.mark.parametrize(
    ("text", "keys"),
    [
        ("(sources 1.4)", ["1.4"]),
        ("Sources 1.7, 1.8. Then", ["1.7", "1.8"]),
        ("sources 2.5 .. 2.8", ["2.5", "2.8"]),
        ("sources 1.2 to 1.6", ["1.2", "1.6"]),
        ("sources 1.6 and 1.8", ["1.6", "1.8"]),
        ("sources instruments 2.3-2.4", ["instruments 2.3", "instruments 2.4"]),
        ("see sources\n * can 3.1", ["can 3.1"]),
        ("[sources](../sources.md) 4.1", ["4.1"]),
        ("sources 1.8, 12.5 dB", ["1.8"]),
        ("our sources are many", []),
    ],
)
def test_a_citation_is_recognised(text: str, keys: list[str]) -> None:
    assert list(cited(text)) == keys


def test_every_citation_has_its_entry() -> None:
    known = entries()
    found = {(p.relative_to(ROOT).as_posix(), key) for p in files() for key in cited(p.read_text())}
    assert len(found) > 40
    assert sorted(f for f in found if f[1] not in known) == []


def test_nothing_cites_a_sheet_that_nobody_can_open() -> None:
    assert [p.relative_to(ROOT).as_posix() for p in files() if DANGLING.search(p.read_text())] == []


def test_what_the_page_names_exists() -> None:
    page = PAGE.read_text()
    paths = re.findall(r"`((?:emu|proto|scripts|tools)/[^`]*)`", page)
    tests = re.findall(r"\btest_\w+", page)
    assert len(paths) > 20
    assert [p for p in paths if not (ROOT / p).exists()] == []
    assert [t for t in tests if not list(ROOT.glob(f"tests/**/{t}.*"))] == []
