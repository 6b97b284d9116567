"""Operators of random mutants, from the syntax of C: small wrongs at places that no one has chosen.

Comments, strings and the preprocessor's lines are left alone. A place is a match of one of the patterns below within a
function's body.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from functools import cache

BLANKS = re.compile(
    r"//[^\n]*|/\*.*?\*/|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])+'|^[ \t]*#(?:[^\n\\]|\\\n|\\.)*", re.S | re.M
)

Match = re.Match[str]
Place = tuple[str, int, int, str]  # kind, begin, end, new text
RELATIONS: Mapping[str, str] = {"<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "=="}
SUMS: Mapping[str, str] = {"+": "-", "-": "+", "*": "/", "/": "*", "%": "*"}
BITS: Mapping[str, str] = {"&": "|", "|": "&", "<<": ">>", ">>": "<<", "^": "&"}
LOGIC: Mapping[str, str] = {"&&": "||", "||": "&&"}
TERM = r"(?:[A-Za-z_]\w*(?:(?:->|\.)\w+|\[\w+\])*|0[xX][0-9a-fA-F]+|\d+)"
NO_STATEMENT = "|".join(
    "return const struct static enum unsigned int bool double uint size_t char void "
    "case default break goto do while for if else }".split()
)
NUMBER = re.compile(r"(?<![\w.])(?:0[xX][0-9a-fA-F]+|\d+)[uU]?(?![\w.'])(?=[^\[\]]*;)")
CALL = r"[A-Za-z_][\w>.-]*\([^;{}\n]*\);"


def _of(table: Mapping[str, str]) -> Callable[[Match], str]:
    return lambda m: f" {table[m[1]]} "


def _any_of(table: Mapping[str, str]) -> re.Pattern[str]:
    words = sorted(map(re.escape, table), key=len, reverse=True)
    return re.compile(rf" ({'|'.join(words)}) (?=[\w(&!~*-])")


def _other_index(m: Match) -> str:
    """Another element that is there as a rule: the first, of the first the second."""
    return "[1]" if m[1] == "0" else "[0]"


PATTERNS: Mapping[str, tuple[re.Pattern[str], Callable[[Match], str]]] = {
    "relation": (_any_of(RELATIONS), _of(RELATIONS)),
    "arithmetic": (_any_of(SUMS), _of(SUMS)),
    "bits": (_any_of(BITS), _of(BITS)),
    "logic": (_any_of(LOGIC), _of(LOGIC)),
    "constant": (NUMBER, lambda m: f"({m[0]} + 1)"),
    "constant-less": (NUMBER, lambda m: f"({m[0]} - 1)"),
    "operands": (
        re.compile(rf"(?<![\w.>\])])({TERM}) (-|/|%|<<|>>|<|<=|>|>=) ({TERM})(?![\w.(\[]|->)"),
        lambda m: f"{m[3]} {m[2]} {m[1]}",
    ),
    "arguments": (re.compile(rf"(?<=[(,])( ?)({TERM}), ({TERM})(?=[,)])"), lambda m: f"{m[1]}{m[3]}, {m[2]}"),
    "index": (re.compile(r"(?<=[\w\])])\[(\w[^\[\]\n]*)\]"), _other_index),
    "condition": (re.compile(r"\b(if|while) \("), lambda m: f"{m[1]} (!"),
    "call": (re.compile(rf"(?<=\n)( +)(?!{NO_STATEMENT}){CALL}(?=\n)"), lambda m: f"{m[1]};"),
    "statement": (
        re.compile(rf"(?<=\n)( +)(?!{NO_STATEMENT}|{CALL}\n)[\w*][^;{{}}\n]*;(?=\n)"),
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


@cache
def places(text: str) -> tuple[Place, ...]:
    """Each place of a C file and what it becomes there; nothing that stays as it is."""
    return tuple(_find_places(text))


def _find_places(text: str) -> Iterator[Place]:
    code = blanked(text)
    for kind, (pattern, change) in PATTERNS.items():
        for m in pattern.finditer(code):
            if not _in_function(code, m.start()):
                continue
            begin, end, new = m.start(), m.end(), change(m)
            if kind == "condition":
                end = _condition_end(code, m.end() - 1) + 1
                new += f"{text[m.end() - 1 : end]})"
            if new != text[begin:end]:
                yield kind, begin, end, new
