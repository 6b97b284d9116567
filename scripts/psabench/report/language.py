"""Reports in another language: the texts of a finished page, looked up in a gettext catalogue.

A text is what is between two tags of a block (heading, cell, paragraph, label of a picture), its numbers and quotes
(lang=en) taken out: "residual <b>{} µV</b> rms". So each report is translated in one place, where it is written, and
procedures know of no language. A text that is not in the catalogue as a whole is put together from its sentences and
its parts. Texts of a drawn picture are translated before its layout. Numbers keep their decimal point, as in
result.json.
locale/LANG/*.po: docs/tools/languages.md
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from html import escape, unescape
from pathlib import Path

from psabench.errors import BadInput, expected
from psabench.places import need_extra

ENGLISH, OPTION = "en", "--lang"
LOCALE = Path(__file__).with_name("locale")
_BLOCK = re.compile(r"(<(h1|h2|p|td|th|li|figcaption|summary|text|title)\b[^>]*>)(.*?)(</\2>)", re.DOTALL)
_FOOT = re.compile(r"<footer>.*?</footer>", re.DOTALL)  # provenance: names of fields are those of result.json
_SEPARATOR = re.compile(r"( · |<br>|<p class=orig lang=\w+>.*?</p>)", re.DOTALL)  # the last: quotes of a source
_TOOLTIP = re.compile(r"(<\w+\b[^<>]* title=')([^']+)(')")
# What a text is about: quoted words, numbers (hexadecimal ones with their h), digests, names of files.
_QUOTED = re.compile(r"<\w+\b[^>]* lang=en>")
_NUMBER = re.compile(
    r"<span lang=en>.*?</span>|[\w./-]+\.(?:yaml|csv|json|log|sqlite|vcd|mf4|mcap|asc|blf|eds|sr|bin|trc|txt)\b"
    r"|\b[\da-f]{16,64}\b|(?<![\w.\-−])[\dA-F]+h\b|(?<![\w.\-−])[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?",
    re.DOTALL,
)
# The same with names of signals, registers, axes and with lists as Python prints them: a check writes one text of many.
_NAME = "|".join(
    (
        r"\b(?:[\dA-F]{2}(?: [\dA-F]{2})+|[\dA-F]{4}(?: [\dA-F]{4})+)(?![.\w])",  # bytes, words
        r"\b[EIRW] [^;,]*? t=\d+|\bE [a-z]+(?:-[a-z]+)*",  # an answer of the bus port
        r"[\dA-F]{4}h:\d+ \([^()]+\)",  # an object and its name
        _NUMBER.pattern,
        r"\[[^\]]*\]|\{[^{}]*\}|\((?:[-+]?[\d.]+, )+[-+]?[\d.]+\)",
        r"(?<![\w.\-−/])(?!(?:[mµun]V|degC|SPS|kHz)\b)(?:[A-Za-z]+\d\w*|\w*[a-z_]\w*[A-Z]\w*|[A-Z][A-Z\d_]+(?:-\d+)?"
        r"|\w+_\w+|[XYZKTPNxyz]|Int|Data|Res|DIn|SClk)\b(?!')",
    )
)
_NAMED = re.compile(_NAME, re.DOTALL)
_NAMES = re.compile(
    r"\b(?:Int|Data|Res|CLK|SEQ|SClk|CST|TFS|tCLK|DIn\w?|DOut\w)\b"
)  # lines and signals that may be a whole text
_LISTED = re.compile(rf"(?:{_NAME})(?:, (?:{_NAME}))*", re.DOTALL)
_FACT = re.compile(r"(.*\S) <b>(.*)</b>", re.DOTALL)
_DOUBT = re.compile(r"(<span class=bad>)(.*)(</span>)", re.DOTALL)
_WORD = re.compile(r"[A-Za-z]{2}")
_CYRILLIC = re.compile(r"[А-Яа-яЁё]")  # of a picture whose texts were translated before it was drawn
_QUANTITY = re.compile(r"\{\} [A-Za-z]")  # 5 m/s: a value that is no name
# What has no words: tags, indices, functions, units, symbols and names of data that are the same in each language.
_SYMBOLS = re.compile(
    r"\{\"[^{}]*\}|\bE [a-z]+(?:-[a-z]+)*(?: [RW] \S+ t=\w+)?"  # lines in JSON, answers of the bus port
    r"|<sub>\w*</sub>|<span class=flag .*?</span>|<[^>]*>|&\w+;|\b\w+_\w+\b|\b[A-Za-z]+\d+\b|[Α-Ωα-ω]\w*"
    r"|\b[A-Z\d]+(?:-[A-Z\d]+)*-\d+\b|\b[\dA-F]{2}(?: [\dA-F]{2})+\b"
    r"|\b(?:sin|cos|atan|hypot|inf|nan|En|[mµn]V|ppm|AIC|BIC|NIS|baro)\b"
)
_VERBAL = re.compile(r"[A-Za-z]{4,}")  # more than a preposition: {} of {}, whose cases depend on what it joins
_REPR = re.compile(r"'[^']*'")
# What a blank may hold: a list, at the end of an entry only.
_IN, _AT_END = r"((?:\[[^\]]*\]|[^;,])+?(?<!:))", "([^;]*?[^;:])"
_BLANK = re.compile(r"\\\{\\\}")
_GAP = re.compile(
    r"[;:,] |(?<=[.!?]) |(?<=\d [num]s) (?=[A-Za-z])| (?=\(\d+ of \d+\))"
)  # "5 ns" of what; how many of them
_CLAUSES, _QUOTING = ("expected", "got", "saw", "due", "said"), "said"


@dataclass(slots=True)
class Language:
    """A catalogue, and what was looked up in it."""

    name: str
    texts: Mapping[str, str]
    found: set[str] = field(default_factory=set)
    missing: set[str] = field(default_factory=set)
    _tried: dict[str, str | None] = field(default_factory=dict)  # by _filled
    _by_word: dict[str, list[str]] = field(default_factory=dict)  # entries with blanks, by _forms_of
    _rows: dict[tuple[str, bool], str | None] = field(default_factory=dict)  # by _joined: a list has many beginnings

    def translate_page(self, page: str) -> str:
        """A page in this language; what the catalogue does not have stays English, and is in `missing`."""
        foot = _FOOT.search(page)
        end = foot.start() if foot else len(page)
        head = page[:end].replace("<html lang=en>", f"<html lang={self.name}>", 1)
        return _TOOLTIP.sub(self._tooltip, _BLOCK.sub(self._block, head)) + page[end:]

    def _tooltip(self, found: re.Match[str]) -> str:
        return found[1] + self._text(found[2]) + found[3]

    def _block(self, found: re.Match[str]) -> str:
        if _QUOTED.fullmatch(found[1]):
            return found[0]
        parts = _SEPARATOR.split(found[3])
        return found[1] + "".join(x if i % 2 else self._text(x) for i, x in enumerate(parts)) + found[4]

    def _text(self, text: str) -> str:
        if wrapped := _DOUBT.fullmatch(text):
            return wrapped[1] + self._text(wrapped[2]) + wrapped[3]
        found = self._known(text) or self._fact(text) or self._joined(text)
        found = found or self._filled(text) or self._joined(text, filled=True)
        if found is None and _has_words(text) and not _CYRILLIC.search(text):
            self.missing.add(key_of(text))
        return found or text

    def label(self, text: str) -> str:
        """A text of a picture, which is no HTML yet."""
        return text if "$" in text else unescape(self._text(escape(text, quote=False)))

    def _fact(self, text: str) -> str | None:
        """Name and value; the value may be a name, which no language has."""
        fact = _FACT.fullmatch(text)
        name = self._known(fact[1]) if fact else None
        return f"{name} <b>{self._value(fact[2])}</b>" if fact and name else None

    def _value(self, text: str) -> str:
        found = self._known(text) or self._joined(text) or self._joined(text, filled=True)
        if found is None and _QUANTITY.match(key_of(text)):
            self.missing.add(key_of(text))
        return found or text

    def _joined(self, text: str, *, filled: bool = False) -> str | None:
        """A list, or a row of sentences, each part known or without words: which of them a page has depends on the run.

        The longest parts are tried first: a part may have commas of its own. filled: or texts whose blanks hold texts.
        """
        if (text, filled) not in self._rows:
            self._rows[text, filled] = self._row(text, filled=filled)
        return self._rows[text, filled]

    def _row(self, text: str, *, filled: bool) -> str | None:
        for gap in reversed(list(_GAP.finditer(text))):
            head, rest = self._part(text[: gap.start()], filled=filled), text[gap.end() :]
            if head is None:
                continue
            if tail := self._part(rest, filled=filled) or self._joined(rest, filled=filled):
                return head + gap[0] + tail
        return None

    def _part(self, text: str, *, filled: bool) -> str | None:
        if found := self._known(text) or self._clause(text):
            return found
        if not _has_words(text):
            return text
        return self._filled(text) if filled else None

    def _clause(self, text: str) -> str | None:
        """What was expected, what was got (psabench.errors.expected); what was seen, due; what a program said."""
        word, _, rest = text.partition(" ")
        if word not in _CLAUSES or word not in self.texts:
            return None
        if word == _QUOTING:
            return f"{self._known(word)} <span lang=en>{rest}</span>"
        found = self._known(rest) or (None if _has_words(rest) else rest)
        return f"{self._known(word)} {found}" if found else None

    def _filled(self, text: str) -> str | None:
        """A text whose blanks hold texts: "no heartbeat {}" of "after NMT stop". The longest entry that fits."""
        plain = _plain_text(text)
        if plain not in self._tried:
            self._tried[plain] = None  # a blank does not hold the text that it is in
            fitting = (self._fill(key, plain) for key in self._forms_of(plain))
            self._tried[plain] = next((found for found in fitting if found), None)
        return self._tried[plain]

    def _forms_of(self, plain: str) -> list[str]:
        """Entries with blanks whose longest word a text has, the longest entry first."""
        if not self._by_word:
            for key in self.texts:
                if "{}" in key and (words := _VERBAL.findall(key)):
                    self._by_word.setdefault(max(words, key=len), []).append(key)
        return sorted(
            (k for w in {*_VERBAL.findall(plain)} for k in self._by_word.get(w, ())), key=lambda k: (-len(k), k)
        )

    def _fill(self, key: str, plain: str) -> str | None:
        last = key.endswith("{}")
        form = _BLANK.sub(lambda _: _IN, re.escape(key.removesuffix("{}"))) + (_AT_END if last else "")
        taken = re.fullmatch(form, plain)
        fills = []
        for fill in taken.groups() if taken else ():
            found = self._part(fill, filled=True) or self._joined(fill, filled=True)
            if found is None:
                return None
            fills.append(found)
        if not taken:
            return None
        self.found.add(key)
        return self.texts[key].format(*fills)

    def _known(self, text: str) -> str | None:
        plain = _plain_text(text)
        for blanked in (_NUMBER, _NAMED, _LISTED):
            key, taken = blanked.sub("{}", plain), blanked.findall(plain)
            words = self.texts.get(key)
            if words and key.count("{}") == len(taken):  # else braces of its own: a schema, a regular expression
                self.found.add(key)
                return words.format(*taken) if taken else words  # else braces of JSON may be in it
        return None


def _plain_text(text: str) -> str:
    return text.strip().replace("&#x27;", "'").replace("&quot;", '"')


def key_of(text: str) -> str:
    """The msgid of a text."""
    return _NUMBER.sub("{}", _plain_text(text))


def keys_of(text: str) -> tuple[str, ...]:
    """The msgids that fit a text, the closest first: without its numbers; its names, too; its lists of both as one."""
    plain = _plain_text(text)
    return tuple(blanked.sub("{}", plain) for blanked in (_NUMBER, _NAMED, _LISTED))


def _has_words(text: str) -> bool:
    plain = _plain_text(text)
    named = _NAMED.sub("", plain)
    if _REPR.fullmatch(plain):  # what a file has there
        return False
    if _NUMBER.search(text) and not _WORD.search(named):  # a value of a register: STATUS 41h
        return False
    return bool(_WORD.search(_SYMBOLS.sub("", _NAMES.sub("", key_of(text)))))


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


def is_localised() -> bool:
    """False: English."""
    return bool(_current)


def localised_label(text: str) -> str:
    """A text of a picture before it is drawn: the layout makes room for what will be there."""
    return _current[0].label(text) if _current else text


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
    return (ENGLISH, *sorted(p.name for p in LOCALE.iterdir() if p.is_dir()))


def load_language(name: str) -> Language | None:
    """None: English, which needs no catalogue. Raises BadInput."""
    if name not in known_languages():
        raise BadInput(expected(", ".join(known_languages()), repr(name), OPTION))
    if name == ENGLISH:
        return None
    need_extra("languages", OPTION)
    import polib  # of who asks for a translation

    entries = (e for path in sorted((LOCALE / name).glob("*.po")) for e in polib.pofile(str(path)))
    return Language(name=name, texts={e.msgid: e.msgstr for e in entries if not e.fuzzy and not e.obsolete})
