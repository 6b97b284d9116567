"""How often the truth lies within U: hits of each quantity beside what chance allows, and of all together. Pure."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from psabench.budget.gum import COVERAGE

BAND = 0.999  # of all rows together: each row's own is wider (Bonferroni)
POOLED = (0.94, 0.96)
BY_LIMIT = " (limit)"  # of a quantity whose U rests on a printed limit: it contains the truth at least as often

Run = Mapping[str, tuple[float, float]]  # by quantity: z and En


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One quantity over all its runs."""

    quantity: str
    runs: int
    hits: int  # |En| <= 1
    mean_z: float
    rms_z: float
    least: int  # hits, by chance, at the promised coverage
    most: int

    @property
    def within(self) -> bool:
        return self.least <= self.hits <= self.most


def chance_band(runs: int, rows: int) -> tuple[int, int]:
    """Fewest and most hits of `runs` that one of `rows` rows may have at COVERAGE: exact binomial tails."""
    from scipy.stats import binom

    tail = (1.0 - BAND) / rows / 2.0
    return int(binom.ppf(tail, runs, COVERAGE)), int(binom.isf(tail, runs, COVERAGE))


def rows_of(runs: Iterable[Run]) -> list[Row]:
    """A row for each quantity, in the order in which they come."""
    of: dict[str, list[tuple[float, float]]] = {}
    for run in runs:
        for quantity, numbers in run.items():
            of.setdefault(quantity, []).append(numbers)
    return [_row_of(quantity, numbers, len(of)) for quantity, numbers in of.items()]


def _row_of(quantity: str, numbers: Sequence[tuple[float, float]], rows: int) -> Row:
    z = [n[0] for n in numbers]
    least, most = chance_band(len(z), rows)
    most = len(z) if quantity.endswith(BY_LIMIT) else most
    return Row(
        quantity=quantity,
        runs=len(z),
        hits=sum(abs(en) <= 1.0 for _, en in numbers),
        mean_z=math.fsum(z) / len(z),
        rms_z=math.sqrt(math.fsum(x * x for x in z) / len(z)),
        least=least,
        most=most,
    )


def pooled_share(rows: Sequence[Row]) -> float:
    """Share of hits in all rows but those of a limit."""
    pooled = pooled_rows(rows)
    return sum(r.hits for r in pooled) / max(sum(r.runs for r in pooled), 1)


def pooled_rows(rows: Sequence[Row]) -> list[Row]:
    return [r for r in rows if not r.quantity.endswith(BY_LIMIT)]


def coverage_kept(rows: Sequence[Row]) -> bool:
    """Every row within its band, and all together within POOLED."""
    return bool(rows) and all(r.within for r in rows) and POOLED[0] <= pooled_share(rows) <= POOLED[1]


def markdown_table(rows: Sequence[Row]) -> str:
    """The table of the page."""
    head = [
        "| quantity | runs | within U | share | by chance | mean z | rms z | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    lines = [
        f"| {r.quantity} | {r.runs} | {r.hits} | {r.hits / r.runs:.3f} | {r.least} to {r.most} | {r.mean_z:+.2f} "
        f"| {r.rms_z:.2f} | {'' if r.within else 'NO'} |"
        for r in rows
    ]
    pooled = pooled_rows(rows)
    total, hits = sum(r.runs for r in pooled), sum(r.hits for r in pooled)
    last = f"| **all** | {total} | {hits} | **{pooled_share(rows):.3f}** | | | | |"
    return "\n".join([*head, *lines, last])
