"""What a search for a plan of rotations shows: the accuracy beside the article's plan, the plan, the search itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from psabench.errors import BadInput, expected
from psabench.link.own import replace_file
from psabench.report.grading import aligned
from psabench.report.page import bullets, section, table, whole_page, write_report
from psabench.sins.covariance import (
    QUANTITIES,
    READINGS,
    Prediction,
    Quantity,
    Reading,
    predict_accuracy,
    read_as,
    warnings_of,
)
from psabench.sins.plan import RotationPlan, plan_of_dict
from psabench.sins.planner.draft import PlanDict, article_draft, plan_dict, plan_text, time_of
from psabench.sins.planner.search import BLOCKS, Search, score_of

NAME = "sins-plan"
FORMAT = 1  # of result.json
PLAN_NAME = "plan.yaml"


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """Both plans in one reading of the noise."""

    article: Prediction
    best: Prediction

    @property
    def score(self) -> float:
        return score_of(_sd(self.best), _sd(self.article))


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """A search that has ended."""

    search: Search
    reading: str  # that the search used
    plan: PlanDict
    compared: Mapping[str, Compared]  # by reading
    ended_early: bool
    took_s: float

    @property
    def rotations(self) -> RotationPlan:
        return plan_of_dict(self.plan, NAME, "best")

    @property
    def main(self) -> Compared:
        return self.compared[self.reading]


def _sd(found: Prediction) -> Any:
    return np.concatenate([found.sd[block] for block in BLOCKS])


def reading_of(name: str) -> Reading:
    """Of READINGS, with or without the space. Raises BadInput."""
    names = {key.replace(" ", ""): r for key, r in READINGS.items()}
    if name.replace(" ", "") not in names:
        raise BadInput(expected(" or ".join(names), name, "--reading"))
    return names[name.replace(" ", "")]


def gather(search: Search, reading: str, ended_early: bool, took_s: float) -> Found:
    """Both plans in every reading."""
    drafts = (article_draft(search.limits), search.best)
    dicts = [plan_dict(d, search.limits) for d in drafts]
    article, best = (plan_of_dict(d, NAME, "") for d in dicts)
    cfgs = {r.name: read_as(r, search.cfg) for r in READINGS.values()}
    assert dicts[1] is not None
    return Found(
        search=search,
        reading=reading_of(reading).name,
        plan=dicts[1],
        compared={
            n: Compared(article=predict_accuracy(article, c), best=predict_accuracy(best, c)) for n, c in cfgs.items()
        },
        ended_early=ended_early,
        took_s=took_s,
    )


# ---- what is shown


def _heading(q: Quantity) -> str:
    return f"{q.label}, {q.unit}" if q.unit else q.label


def accuracy_rows(found: Found) -> list[list[str]]:
    """Quantities of the article's tables: root mean square over the elements, and the worst element."""
    article, best = found.main.article.columns, found.main.best.columns
    return [
        ["", "article's plan", "worst", "best plan", "worst", "article / best"],
        *(
            [
                _heading(q),
                *(f"{x:.3g}" for c in (article[q.key], best[q.key]) for x in (c.rms, c.high)),
                f"{article[q.key].rms / best[q.key].rms:.2f}",
            ]
            for q in QUANTITIES
        ),
    ]


def reading_rows(found: Found) -> list[list[str]]:
    """The plan that one reading has chosen, in all of them: geometric mean of article / best."""
    rows = [["reading", "noise", "article / best, mean", *(q.label for q in QUANTITIES)]]
    for name, c in found.compared.items():
        factors = [c.article.columns[q.key].rms / c.best.columns[q.key].rms for q in QUANTITIES]
        mark = " (of the search)" if name == found.reading else ""
        rows.append([f"{name}{mark}", READINGS[name].text, *(f"{x:.2f}" for x in (np.exp(-c.score), *factors))])
    return rows


def turn_rows(found: Found) -> list[list[str]]:
    """The plan, turn by turn."""
    rows = [["", "axis", "rate, °/s", "time, s", "angle, °", ""]]
    for k, t in enumerate(found.plan["turns"], start=1):
        angle = t["rate_degps"] * t["for_s"]
        by_hand = "mounted again" if t.get("remount") else ""
        rows.append([str(k), t["axis"], f"{t['rate_degps']:.4g}", f"{t['for_s']:.1f}", f"{angle:.0f}", by_hand])
    return rows


def warnings(found: Found) -> list[str]:
    """Of the best plan; its turns may be about other axes of the table than that whose azimuth is given."""
    said = warnings_of(found.rotations, found.search.cfg, found.main.best)
    return [w for w in said if not w.startswith("the table's axis is ")]


def rate_words(found: Found) -> str:
    """How much was searched."""
    a_minute = 60.0 * found.search.computed / max(found.took_s, 1e-3)
    return f"{found.search.computed} plans in {found.took_s:.1f} s, {a_minute:.0f} a minute"


def console_lines(found: Found) -> list[str]:
    """Accuracy, score, warnings."""
    gain = float(np.exp(-found.main.score))
    return [
        *aligned(accuracy_rows(found)),
        f"geometric mean over 21 parameters: {gain:.3f} times better than the article's plan in the same time",
        *(f"WARNING: {w}" for w in warnings(found)),
    ]


NOTES = (
    "Score: mean of ln(σ / σ of the article's plan) over 21 parameters: ν 3, Θ 9, Δf 3, Γ 6. It weighs a factor alike, "
    "whatever the quantity; another aim chooses another plan.",
    "The article's plan: its three cycles at 10°/s, or the table's greatest rate, stretched or cut to the same time.",
    "The search is random: it proves no optimum. Another seed and more plans may find a better one.",
    "Not modelled: acceleration and settling of the table, errors that depend on rate, sense or size, flexure, "
    "temperature over a longer calibration. A gain by many reversals or a high rate is as good as these are small.",
)


def result_dict(found: Found) -> dict[str, Any]:
    """result.json: the same bytes for the same seed, but for the provenance; no times of computing."""
    readings = {
        name: {
            "score": c.score,
            "article": {key: asdict(s) for key, s in c.article.columns.items()},
            "best": {key: asdict(s) for key, s in c.best.columns.items()},
        }
        for name, c in found.compared.items()
    }
    s = found.search
    return {
        "format": FORMAT,
        "procedure": NAME,
        "limits": asdict(s.limits),
        "reading": found.reading,
        "seed": s.seed,
        "plans": s.computed,
        "interrupted": found.ended_early,
        "score": found.main.score,
        "plan": found.plan,
        "duration_s": time_of(found.rotations, s.limits),
        "readings": readings,
        "history": [{"plans": n, "score": score} for n, score in s.history],
        "warnings": warnings(found),
    }


def write_page(out: Path, found: Found) -> Path:
    """plan.yaml, report.html and result.json; the page. Raises OSError, OutputError."""
    s = found.search
    out.mkdir(parents=True, exist_ok=True)
    replace_file(out / PLAN_NAME, plan_text(found.plan, _comments(found)))
    facts = {
        "table": f"{s.limits.axes} axes, {s.limits.max_rate_degps:g}°/s",
        "time": f"{s.limits.budget_s / 60.0:g} min",
        "reading": found.reading,
        "seed": str(s.seed),
        "plans": str(s.computed),
    }
    history = [["plans", "article / best, mean"], *([str(n), f"{np.exp(-x):.3f}"] for n, x in s.history)]
    sections: Sequence[str] = (
        section("What the article's plan leaves on the table", table(accuracy_rows(found)), bullets(warnings(found))),
        section("In every reading of the noise", table(reading_rows(found))),
        section("The plan", table(turn_rows(found))),
        section("The search", table(history)),
        section("How to read it", bullets(NOTES)),
    )
    return write_report(out, result_dict(found), whole_page("A plan of rotations for your table", facts, sections))


def _comments(found: Found) -> list[str]:
    s = found.search
    return [
        f"psabench campaign sins-plan: seed {s.seed}, {s.computed} plans, reading {found.reading}.",
        f"Table of {s.limits.axes} axes, {s.limits.max_rate_degps:g} deg/s, {s.limits.budget_s:g} s, any acceleration.",
    ]
