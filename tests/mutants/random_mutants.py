"""Random mutants from the syntax of C: small wrongs at places that no one has chosen.

Comments, strings and the preprocessor's lines are left alone. A place is a match of one of the patterns below; which of
all places of all files are taken is drawn from the seed, each file as often as it has places.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

from tests.mutants.declared import Mutant, Target

BLANKS = re.compile(
    r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])+'|^[ \t]*#(?:[^\n\\]|\\\n|\\.)*", re.S | re.M
)
# By the beginning of a file's name: which boards it is run on. Files of no row here are not mutated.
ON: tuple[tuple[str, str], ...] = (
    ("emu/board/psa2/", "psa2"),
    ("emu/chip/ads1282/", "psa2"),
    ("emu/chip/ads1256/", "psa2"),
    ("emu/board/psd1/", "psd1 psd1:psd1_host"),
    ("emu/chip/ad7712/", "psd1"),
    ("emu/board/pmka/", "pmka"),
    ("emu/board/pik/", "pik"),
    ("emu/board/gyro/", "gyro"),
    ("emu/canopen/co_", "psa2"),
)
# What no board of these has: pins that no one drives edge by edge, faults, what only truth and digest tell.
LEFT_OUT = re.compile(r"/(fault|pins|gpio|board|profile|profile_set|mod|cal|hpf|cic)\.c$")

Match = re.Match[str]
RELATIONS: Mapping[str, str] = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
SUMS: Mapping[str, str] = {"+": "-", "-": "+", "*": "/", "/": "*", "%": "*"}
BITS: Mapping[str, str] = {"&": "|", "|": "&", "<<": ">>", ">>": "<<", "^": "&"}
LOGIC: Mapping[str, str] = {"&&": "||", "||": "&&"}


def _of(table: Mapping[str, str]) -> Callable[[Match], str]:
    return lambda m: f" {table[m[1]]} "


def _any_of(table: Mapping[str, str]) -> re.Pattern[str]:
    words = sorted(map(re.escape, table), key=len, reverse=True)
    return re.compile(rf" ({'|'.join(words)}) (?=[\w(&!~*-])")


def _number(m: Match) -> str:
    return f"({m[0]} + 1)"


PATTERNS: Mapping[str, tuple[re.Pattern[str], Callable[[Match], str]]] = {
    "relation": (_any_of(RELATIONS), _of(RELATIONS)),
    "arithmetic": (_any_of(SUMS), _of(SUMS)),
    "bits": (_any_of(BITS), _of(BITS)),
    "logic": (_any_of(LOGIC), _of(LOGIC)),
    "constant": (re.compile(r"(?<![\w.])(?:0[xX][0-9a-fA-F]+|\d+)[uU]?(?![\w.'])(?=[^\[\]]*;)"), _number),
    "condition": (re.compile(r"\bif \("), lambda _: "if (!"),
    "statement": (
        re.compile(
            r"(?<=\n)( +)(?!return|const|struct|static|enum|unsigned|int|bool|double|uint|size_t|char|void|case|"
            r"default|break|goto|do|while|for|if|else|})[\w*][^;{}\n]*;(?=\n)"
        ),
        lambda m: f"{m[1]};",
    ),
}


def blanked(text: str) -> str:
    """The same text, of the same length, with spaces for what is no code."""
    return BLANKS.sub(lambda m: re.sub(r"[^\n]", " ", m[0]), text)


def _condition_end(text: str, at: int) -> int:
    depth = 0
    for k in range(at, len(text)):
        depth += {"(": 1, ")": -1}.get(text[k], 0)
        if depth == 0 and text[k] == ")":
            return k
    return -1


def _in_function(text: str, at: int) -> bool:
    """Between the braces of a function's body: a declaration of a table has its own line `= {` before it."""
    begin = text.rfind("\n{\n", 0, at)
    return begin >= 0 and text.find("\n}\n", begin, at) < 0


def places(path: str, text: str) -> Iterator[tuple[str, int, int, str]]:
    """(kind, begin, end, new text) of each place."""
    code = blanked(text)
    for kind, (pattern, change) in PATTERNS.items():
        for m in pattern.finditer(code):
            if not _in_function(code, m.start()):
                continue
            if kind == "condition":
                end = _condition_end(code, m.end() - 1)
                yield kind, m.start(), end + 1, f"if (!{text[m.end() - 1 : end + 1]})"
                continue
            yield kind, m.start(), m.end(), change(m)


def _name(path: str) -> str:
    """emu/chip/ads1282/conv.c: ads1282-conv; emu/canopen/co_sdo.c: co-sdo."""
    p = Path(path)
    room = f"{p.parent.name}-" if p.parts[1] in ("chip", "board") else ""
    return room + p.stem.replace("_", "-")


def _mutant(path: str, text: str, place: tuple[str, int, int, str], on: str) -> Mutant:
    """The text before the place is its address: it is there once."""
    kind, begin, end, new = place
    line, name = text.count("\n", 0, begin) + 1, _name(path)
    return Mutant(
        id=f"{name}-{line}-{begin - text.rfind(chr(10), 0, begin)}-{kind}",
        kind=kind,
        file=path,
        old=text[:end],
        new=text[:begin] + new,
        on=tuple(map(Target.of, on.split())),
    )


def random_mutants(root: Path, count: int, seed: int) -> list[Mutant]:
    """So many, all different, the same for one seed and one state of the sources."""
    found: list[Mutant] = []
    for prefix, on in ON:
        for file in sorted(root.glob(f"{prefix}*.c")):
            path = file.relative_to(root).as_posix()
            if LEFT_OUT.search(path):
                continue
            text = file.read_text(encoding="utf-8")
            found += [_mutant(path, text, place, on) for place in places(path, text)]
    return random.Random(seed).sample(found, min(count, len(found)))
