"""Operators of mutants for Python, from its syntax tree: the same small wrongs as those of C (operators.py).

A place is cut out of the text as it is: a mutant differs from its file in nothing else. Annotations, decorators and
texts are left alone.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator, Mapping
from itertools import pairwise

from tests.mutants.operators import Place

Cut = tuple[str, int, int, bytes]  # a Place in bytes: the tree counts them
OPERATORS: Mapping[str, Mapping[str, str]] = {
    "relation": {
        "<": "<=", "<=": "<", ">": ">=", ">=": ">", "==": "!=", "!=": "==", "is not": "is", "is": "is not",
        "not in": "in", "in": "not in",
    },
    "arithmetic": {"+": "-", "-": "+", "*": "/", "/": "*", "//": "/", "%": "*", "**": "*"},
    "bits": {"&": "|", "|": "&", "<<": ">>", ">>": "<<", "^": "&"},
    "logic": {"and": "or", "or": "and"},
}  # fmt: skip
KIND_OF = {old: (kind, new) for kind, table in OPERATORS.items() for old, new in table.items()}
SWAPPED = ("-", "/", "//", "%", "**", "<<", ">>", "<", "<=", ">", ">=")  # whose operands may not change places


class _Text:
    """A file's bytes, and where its nodes are."""

    def __init__(self, text: str) -> None:
        self.data = text.encode()
        self._lines = [0, *(m.end() for m in re.finditer(rb"\n", self.data))]

    def span(self, node: ast.expr | ast.stmt) -> tuple[int, int]:
        assert node.end_lineno is not None
        assert node.end_col_offset is not None
        return self._lines[node.lineno - 1] + node.col_offset, self._lines[node.end_lineno - 1] + node.end_col_offset

    def of(self, node: ast.expr | ast.stmt) -> bytes:
        begin, end = self.span(node)
        return self.data[begin:end]


def _between(t: _Text, left: ast.expr, right: ast.expr) -> Iterator[Cut]:
    """The operator between two operands, and the two in each other's place."""
    begin, end = t.span(left)[1], t.span(right)[0]
    m = re.fullmatch(rb"([\s)]*)([^\s()]+(?: (?:in|not))?)([\s(]*)", t.data[begin:end])
    word = m[2].decode() if m else ""
    if m is None or word not in KIND_OF:
        return
    kind, new = KIND_OF[word]
    yield kind, begin + m.start(2), begin + m.end(2), new.encode()
    if word in SWAPPED and t.of(left) != t.of(right) and not m[1].strip() and not m[3].strip():
        yield "operands", t.span(left)[0], t.span(right)[1], t.of(right) + m[0] + t.of(left)


def _of_number(t: _Text, node: ast.Constant) -> Iterator[Cut]:
    if type(node.value) in (int, float):
        yield "constant", *t.span(node), b"(" + t.of(node) + b" + 1)"
        yield "constant-less", *t.span(node), b"(" + t.of(node) + b" - 1)"


def _of_call(t: _Text, node: ast.Call) -> Iterator[Cut]:
    for a, b in pairwise(node.args):
        if isinstance(a, ast.Name) and isinstance(b, ast.Name) and a.id != b.id:
            yield "arguments", t.span(a)[0], t.span(b)[1], t.data[slice(*t.span(b))] + b", " + t.of(a)


def _of_node(t: _Text, node: ast.AST) -> Iterator[Cut]:
    match node:
        case ast.Compare():
            for left, right in pairwise([node.left, *node.comparators]):
                yield from _between(t, left, right)
        case ast.BinOp():
            yield from _between(t, node.left, node.right)
        case ast.BoolOp():
            for left, right in pairwise(node.values):
                yield from _between(t, left, right)
        case ast.Constant():
            yield from _of_number(t, node)
        case ast.If() | ast.While() | ast.IfExp():
            yield "condition", *t.span(node.test), b"(not (" + t.of(node.test) + b"))"
        case ast.Subscript() if isinstance(node.slice, ast.Constant | ast.Name) and isinstance(node.ctx, ast.Load):
            if not isinstance(node.slice, ast.Constant) or isinstance(node.slice.value, int):
                yield "index", *t.span(node.slice), b"1" if t.of(node.slice) == b"0" else b"0"
        case ast.Call():
            yield from _of_call(t, node)
        case ast.Expr() if isinstance(node.value, ast.Call):
            yield "call", *t.span(node), b"pass"
        case ast.Assign() | ast.AugAssign():
            if isinstance(node, ast.AugAssign) or not isinstance(node.targets[0], ast.Name):
                yield "statement", *t.span(node), b"pass"


LEFT_ALONE = ("annotation", "returns", "decorator_list", "bases")


def _walk(node: ast.AST, *, inside: bool) -> Iterator[ast.AST]:
    """Nodes within functions, without annotations, decorators and f-strings, whose parts have no place of their own."""
    if inside:
        yield node
    if isinstance(node, ast.JoinedStr):
        return
    inside = inside or isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
    for name, value in ast.iter_fields(node):
        if name in LEFT_ALONE:
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _walk(child, inside=inside)


def python_places(text: str) -> Iterator[Place]:
    """Each place of a Python file and what it becomes there; nothing that stays as it is."""
    t = _Text(text)
    seen = set()
    for node in _walk(ast.parse(text), inside=False):
        for kind, begin, end, new in _of_node(t, node):
            if new != t.data[begin:end] and (kind, begin, end) not in seen:
                seen.add((kind, begin, end))
                yield kind, len(t.data[:begin].decode()), len(t.data[:end].decode()), new.decode()
