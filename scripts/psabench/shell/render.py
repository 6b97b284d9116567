"""Results as text for people: names, values, tables."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import Any

WIDTH = 100  # of a value in a line


def text(result: Mapping[str, Any]) -> str:
    """A result as lines; "" if there is nothing in it."""
    return "\n".join(_lines(result, ""))


def _lines(result: Mapping[str, Any], indent: str) -> list[str]:
    lines: list[str] = []
    simple = {k: v for k, v in result.items() if not _nested(v)}
    width = max((len(k) for k in simple), default=0)
    for k, v in simple.items():
        first, *more = textwrap.wrap(scalar(v), WIDTH) or [""]
        lines.append(f"{indent}{k:{width}}  {first}".rstrip())
        lines += [f"{indent}{'':{width}}  {rest}" for rest in more]
    for k, v in result.items():
        if isinstance(v, Mapping) and v:
            inner = _lines(v, indent + "  ")
            lines += [f"{indent}{k}", *inner]
        elif _nested(v) and v:
            lines += [f"{indent}{k}", *(f"{indent}  {row}" for row in table(v))]
    return lines


def table(rows: list[Mapping[str, Any]]) -> list[str]:
    """Rows of the same names as columns, the names on top."""
    names = list(dict.fromkeys(k for row in rows for k in row))
    cells = [names, *([scalar(row.get(n, "")) for n in names] for row in rows)]
    widths = [max(len(row[i]) for row in cells) for i in range(len(names))]
    return ["  ".join(f"{c:{w}}" for c, w in zip(row, widths, strict=True)).rstrip() for row in cells]


def scalar(v: Any) -> str:
    """One value: numbers without noise in the last digits, lists of them with blanks between."""
    if isinstance(v, bool):
        return "true" if v else "false"
    if isinstance(v, float):
        return f"{v:.9g}"
    if isinstance(v, Mapping):  # of a row that is known by its name, the name is enough here
        return str(v["name"]) if "name" in v else ", ".join(f"{k} {scalar(x)}" for k, x in v.items())
    if isinstance(v, list):
        return " ".join(scalar(x) for x in v)
    return "-" if v is None else str(v)


def _nested(v: Any) -> bool:
    return bool(isinstance(v, Mapping) and v) or (
        isinstance(v, list) and bool(v) and all(isinstance(x, Mapping) for x in v)
    )
