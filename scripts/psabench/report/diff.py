"""Two results beside each other: where they come from, and each number with its difference over its uncertainty.

Pure, but for `read_result`. A result is what result.json or conform.json holds. What says how and when it was computed
(provenance, facts, dates, the time that a test took) is shown and counts for nothing: results are the same when the
rest is.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from psabench.errors import BadInput, expected, input_error
from psabench.report.page import PAGE_NAME, page_without_foot
from psabench.report.provenance import KEY

FILES = ("result.json", "conform.json")  # of a folder
ORIGIN = (KEY, "facts")  # keys that say where a result comes from
VOLATILE = ("took_s",)  # measured again by each run of the same program
NAMES = ("procedure", "reading", "label", "name", "study", "case", "chain", "test", "number", "what")  # of a row


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """An estimate of a result, with the half width of its interval."""

    value: float
    half: float


Leaf = Quantity | float | str | bool | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One value in both results; None: there is none in that one."""

    where: str
    a: Leaf
    b: Leaf

    @property
    def differs(self) -> bool:
        return self.a != self.b

    @property
    def difference(self) -> float | None:
        """b - a; None where they are not two numbers."""
        a, b = _number_of(self.a), _number_of(self.b)
        return None if a is None or b is None else b - a

    @property
    def u(self) -> float | None:
        """Uncertainty of the difference of two independent runs: root of the sum of the squares of both half widths."""
        if isinstance(self.a, Quantity) and isinstance(self.b, Quantity):
            return math.hypot(self.a.half, self.b.half)
        return None

    @property
    def en(self) -> float | None:
        """Difference over its uncertainty, the normalised error of two laboratories (ISO 13528, 9.6)."""
        d, u = self.difference, self.u
        return d / u if d is not None and u else None


@dataclass(frozen=True, slots=True, kw_only=True)
class Diff:
    """All of a comparison."""

    origin: tuple[Row, ...]  # only what differs
    quantities: tuple[Row, ...]  # all estimates
    others: tuple[Row, ...]  # all other values

    @property
    def differing(self) -> tuple[Row, ...]:
        """What differs in the results."""
        return tuple(r for r in (*self.quantities, *self.others) if r.differs)

    @property
    def told(self) -> tuple[Row, ...]:
        """Other values that differ, without those that belong to an estimate that differs."""
        below = tuple(f"{r.where}/" for r in self.quantities if r.differs)
        return tuple(r for r in self.others if r.differs and not r.where.startswith(below))

    @property
    def same(self) -> bool:
        return not self.differing


def read_result(path: Path) -> dict[str, Any]:
    """result.json or conform.json: the file, or that of a folder. Raises BadInput."""
    found = [path / name for name in FILES if (path / name).is_file()] if path.is_dir() else [path]
    if len(found) != 1:
        raise BadInput(expected(f"one of {' and '.join(FILES)}", "both" if found else "none", path))
    try:
        data = json.loads(found[0].read_text(encoding="utf-8"))
    except OSError as e:
        raise input_error(found[0], "a result of psabench", e) from e
    except ValueError as e:
        raise BadInput(expected("a result of psabench in JSON", e, found[0])) from e
    if not isinstance(data, dict) or "format" not in data:
        raise BadInput(expected("a result of psabench, with its format", type(data).__name__, found[0]))
    return data


def report_without_provenance(folder: Path) -> tuple[str, str]:
    """Data and page of a report but for who computed them and when: the same seed gives the same. Raises BadInput."""
    data = {k: v for k, v in read_result(folder).items() if k != KEY}
    page = (folder / PAGE_NAME).read_text(encoding="utf-8")
    return json.dumps(data, indent=1, ensure_ascii=False), page_without_foot(page)


def compare_results(a: Mapping[str, Any], b: Mapping[str, Any]) -> Diff:
    """Every value of two results, in the order of the first."""
    rows = _paired_rows(
        {k: v for k, v in a.items() if k not in ORIGIN}, {k: v for k, v in b.items() if k not in ORIGIN}
    )
    origin = _paired_rows({k: a.get(k) for k in ORIGIN}, {k: b.get(k) for k in ORIGIN})
    return Diff(
        origin=tuple(r for r in origin if r.differs),
        quantities=tuple(r for r in rows if isinstance(r.a, Quantity) or isinstance(r.b, Quantity)),
        others=tuple(r for r in rows if not (isinstance(r.a, Quantity) or isinstance(r.b, Quantity))),
    )


def _paired_rows(a: Mapping[str, Any], b: Mapping[str, Any]) -> list[Row]:
    left, right = dict(_leaves_of(a, "")), dict(_leaves_of(b, ""))
    return [Row(where=where, a=left.get(where), b=right.get(where)) for where in {**left, **right}]


def _leaves_of(value: Any, where: str) -> Iterator[tuple[str, Leaf]]:
    """Every value below, with its path; an estimate is one value and those of its other keys."""
    if isinstance(value, Mapping):
        if (half := _half_width(value)) is not None:
            yield where, Quantity(value=float(value["value"]), half=half)
        for key, inner in value.items():
            if key not in VOLATILE and not (half is not None and key == "value"):
                inner = shlex.join(inner) if key == "command" and inner else inner
                yield from _leaves_of(inner, f"{where}/{key}" if where else key)
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for name, inner in zip(_row_names(value), value, strict=True):
            yield from _leaves_of(inner, f"{where}/{name}")
    else:
        yield where, value


def _row_names(rows: Sequence[Any]) -> list[str]:
    """What the rows of a list are called: by what names them, else by number, from 1."""
    found = [
        ", ".join(str(row[k]) for k in NAMES if row.get(k)) if isinstance(row, Mapping) else str(i)
        for i, row in enumerate(rows, start=1)
    ]
    return [name if found.count(name) == 1 and name else f"{name or 'row'} {i}" for i, name in enumerate(found, 1)]


def _half_width(row: Mapping[str, Any]) -> float | None:
    """Half width of an estimate's interval: its expanded uncertainty; None: it is not an estimate."""
    if not isinstance(row.get("value"), int | float):
        return None
    if isinstance(row.get("expanded_u"), int | float):
        return float(row["expanded_u"])
    ends = row.get("ci95")
    return (float(ends[1]) - float(ends[0])) / 2.0 if isinstance(ends, Sequence) and len(ends) == 2 else None


def _number_of(x: Leaf) -> float | None:
    if isinstance(x, Quantity):
        return x.value
    return float(x) if isinstance(x, int | float) and not isinstance(x, bool) else None


# ---- as text and as data

SHOWN = 20  # of the other values that differ
WIDTH = 72  # of a value that is text


def diff_lines(d: Diff) -> Iterator[str]:
    """For the terminal."""
    from psabench.report.grading import aligned

    if d.origin:
        yield "where they come from"
        yield from (f"  {line}" for line in aligned(_plain_rows(d.origin), left=(0, 1, 2)))
    if d.quantities:
        yield "estimates: U is that of the difference"
        head = ("", "A", "B", "difference", "U", "difference/U")
        yield from (f"  {line}" for line in aligned([head, *map(_quantity_row, d.quantities)]))
    if d.told:
        yield "other values that differ"
        yield from (f"  {line}" for line in aligned(_plain_rows(d.told[:SHOWN]), left=(0, 1, 2)))
        yield from [f"  and {len(d.told) - SHOWN} more"] if len(d.told) > SHOWN else []
    count = len(d.quantities) + len(d.others)
    yield f"the same: all {count} values" if d.same else f"{len(d.differing)} of {count} values differ"


def _plain_rows(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    return [("", "A", "B"), *((_row_title(r), _leaf_text(r.a), _leaf_text(r.b)) for r in rows)]


def _row_title(r: Row) -> str:
    """The path without the words that every path has."""
    return r.where.removeprefix("sections/").removeprefix(f"{KEY}/").replace("/estimates/", ": ")


def _quantity_row(r: Row) -> tuple[str, ...]:
    difference = "" if r.difference is None else f"{r.difference:+.3g}"
    u, en = "" if r.u is None else f"{r.u:.2g}", "" if r.en is None else f"{r.en:+.2f}"
    return (_row_title(r), _leaf_text(r.a), _leaf_text(r.b), difference, u, en)


def _leaf_text(x: Leaf) -> str:
    """Cut to WIDTH characters."""
    text = f"{x.value:.9g}" if isinstance(x, Quantity) else "-" if x is None else str(x)
    return text if len(text) <= WIDTH else f"{text[: WIDTH - 3]}..."


def diff_dict(d: Diff) -> dict[str, Any]:
    """For programs: all estimates, and of all else what differs."""
    return {
        "format": 1,
        "same": d.same,
        KEY: {r.where: [r.a, r.b] for r in d.origin},
        "estimates": [
            {
                "where": r.where,
                "a": _number_of(r.a),
                "b": _number_of(r.b),
                "difference": r.difference,
                "u": r.u,
                "en": r.en,
            }
            for r in d.quantities
        ],
        "others": {r.where: [r.a, r.b] for r in d.others if r.differs},
    }
