"""Reports in another language: the texts of a finished page, looked up in a gettext catalogue.

A text is what is between two tags of a block (heading, cell, paragraph, label of a picture), its numbers taken out:
"residual <b>{} µV</b> rms". So each report is translated in one place, where it is written, and procedures know of no
language. Numbers keep their decimal point, as in result.json. locale/LANG.po: docs/tools/languages.md
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from psabench.errors import BadInput, expected
from psabench.places import need_extra

ENGLISH, OPTION = "en", "--lang"
LOCALE = Path(__file__).with_name("locale")
_BLOCK = re.compile(r"(<(h1|h2|p|td|th|li|figcaption|summary|text|title)\b[^>]*>)(.*?)(</\2>)", re.DOTALL)
_FOOT = re.compile(r"<footer>.*?</footer>", re.DOTALL)  # provenance: names of fields are those of result.json
_SEPARATOR = re.compile(r"( · |<br>)")
_NUMBER = re.compile(r"(?<![\w.\-−])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_FACT = re.compile(r"(.*\S) <b>(.*)</b>", re.DOTALL)
_DOUBT = re.compile(r"(<span class=bad>)(.*)(</span>)", re.DOTALL)
_WORD = re.compile(r"[A-Za-z]{2}")
# What has no words: tags, indices, functions, units and symbols that are the same in each language.
_SYMBOLS = re.compile(r"<sub>\w*</sub>|<span class=flag .*?</span>|<[^>]*>|&\w+;|\b(?:sin|cos|atan|hypot|En|[mµn]V)\b")


@dataclass(slots=True)
class Language:
    """A catalogue, and what was looked up in it."""

    name: str
    texts: Mapping[str, str]
    found: set[str] = field(default_factory=set)
    missing: set[str] = field(default_factory=set)

    def translate_page(self, page: str) -> str:
        """A page in this language; what the catalogue does not have stays English, and is in `missing`."""
        foot = _FOOT.search(page)
        end = foot.start() if foot else len(page)
        head = page[:end].replace("<html lang=en>", f"<html lang={self.name}>", 1)
        return _BLOCK.sub(self._block, head) + page[end:]

    def _block(self, found: re.Match[str]) -> str:
        parts = _SEPARATOR.split(found[3])
        return found[1] + "".join(x if i % 2 else self._text(x) for i, x in enumerate(parts)) + found[4]

    def _text(self, text: str) -> str:
        if wrapped := _DOUBT.fullmatch(text):
            return wrapped[1] + self._text(wrapped[2]) + wrapped[3]
        found = self._known(text) or self._fact(text) or self._joined(text, ": ") or self._joined(text, ", ")
        if found is None and _WORD.search(_SYMBOLS.sub("", text)):
            self.missing.add(key_of(text))
        return found or text

    def _fact(self, text: str) -> str | None:
        """Name and value; the value may be a name, which no language has."""
        fact = _FACT.fullmatch(text)
        name = self._known(fact[1]) if fact else None
        return (
            f"{name} <b>{self._known(fact[2]) or self._joined(fact[2], ', ') or fact[2]}</b>" if fact and name else None
        )

    def _joined(self, text: str, by: str) -> str | None:
        """A list of texts, each of them known."""
        parts = [self._known(x) or (self._joined(x, ", ") if by != ", " else None) for x in text.split(by)]
        return None if len(parts) < 2 or None in parts else by.join(x for x in parts if x)

    def _known(self, text: str) -> str | None:
        key = key_of(text)
        words = self.texts.get(key)
        if not words:
            return None
        self.found.add(key)
        return words.format(*_NUMBER.findall(text))


def key_of(text: str) -> str:
    """The msgid of a text."""
    return _NUMBER.sub("{}", text.strip())


_current: list[Language] = []  # of this run of a command; none: English


@contextmanager
def reports_in(name: str) -> Iterator[None]:
    """Reports that are written inside it are in this language; at its end one line says what of them is not."""
    found = load_language(name)
    _current[:] = [found] if found else []
    try:
        yield
    finally:
        _current.clear()
        if found and found.missing:
            looked_up = len(found.found) + len(found.missing)
            print(f"psabench: --lang {name}: {len(found.missing)} of {looked_up} texts are English", file=sys.stderr)


def localised_page(page: str) -> str:
    """A finished page as it is written."""
    return _current[0].translate_page(page) if _current else page


def take_option(words: Sequence[str]) -> tuple[list[str], str]:
    """--lang LANG or --lang=LANG, anywhere in a command line: the other words, and the language. Raises BadInput."""
    left, name, rest = [], ENGLISH, iter(words)
    for word in rest:
        if word == OPTION:
            name = next(rest, "")
            if not name:
                raise BadInput(expected("a value", "none", OPTION))
        elif word.startswith(f"{OPTION}="):
            name = word.partition("=")[2]
        else:
            left.append(word)
    return left, name


def known_languages() -> Sequence[str]:
    return (ENGLISH, *sorted(p.stem for p in LOCALE.glob("*.po")))


def load_language(name: str) -> Language | None:
    """None: English, which needs no catalogue. Raises BadInput."""
    if name not in known_languages():
        raise BadInput(expected(", ".join(known_languages()), repr(name), OPTION))
    if name == ENGLISH:
        return None
    need_extra("languages", OPTION)
    import polib  # of who asks for a translation

    catalogue = polib.pofile(str(LOCALE / f"{name}.po"))
    return Language(name=name, texts={e.msgid: e.msgstr for e in catalogue if not e.fuzzy and not e.obsolete})
