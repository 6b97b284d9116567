"""The page of a run: who was tested, what it came to, every requirement with its verdict, a place to sign."""

from __future__ import annotations

from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from psabench.conform.requirements import requirements
from psabench.conform.verdict import Outcome, Verdict
from psabench.report.page import whole_page

if TYPE_CHECKING:
    from psabench.conform.report import Run

STYLE = """<style>
.v-passed { color: var(--good); } .v-failed { color: var(--bad); font-weight: 650; }
.v-inconclusive { color: var(--s2); } .v-other { color: var(--muted); }
td.id { white-space: nowrap; font-weight: 600; } .orig { color: var(--muted);
  font-size: .85em; } .sign td { height: 3.2rem; min-width: 14rem; vertical-align: bottom; }
</style>"""
CSS = {Verdict.PASSED: "v-passed", Verdict.FAILED: "v-failed", Verdict.INCONCLUSIVE: "v-inconclusive"}


def page(run: Run, folder: Path) -> str:
    """One file, nothing loaded from elsewhere; pictures are those of the folder. Same input, same bytes."""
    body = [
        STYLE,
        _verdict(run),
        *(_failure(o, folder) for o in run.outcomes if o.verdict is Verdict.FAILED),
        _table(run),
        _signed(run),
    ]
    return whole_page(f"Conformance of {run.subject}", run.facts, body)


def _verdict(run: Run) -> str:
    from psabench.conform.report import summary, unseen

    why = "".join(f"<li>{count} not observable: {escape(reason)}</li>" for reason, count in unseen(run).items())
    return (
        f"<p class='verdict {'good' if run.conforms else 'bad'}'>{escape(summary(run))}</p><ul class=small>{why}</ul>"
    )


def _failure(o: Outcome, folder: Path) -> str:
    rows = requirements().rows
    due = "".join(f"<p><b>{i}</b> {escape(rows[i].text)}</p>{_original(rows[i].original)}" for i in o.requirements)
    at = "" if o.at_ns is None else f" at {o.at_ns * 1e-6:.6f} ms"
    pictures = "".join(
        f"<figure>{(folder / name).read_text(encoding='utf-8')}</figure>"
        for name in o.exhibits
        if name.endswith(".svg")
    )
    files = ", ".join(f"<a href='{escape(name)}'>{escape(name)}</a>" for name in o.exhibits)
    return (
        f"<section><h2>{escape(o.title)}</h2>{due}<p>Saw <b>{escape(o.saw)}</b>{at}; due {escape(o.due)}.</p>"
        f"{pictures}{f'<p class=small>{files}</p>' if files else ''}</section>"
    )


def _original(text: str) -> str:
    return f"<p class=orig>{escape(text)}</p>" if text else ""


def _table(run: Run) -> str:
    by_id: dict[str, list[Outcome]] = {}
    for o in run.outcomes:
        for i in o.requirements:
            by_id.setdefault(i, []).append(o)
    verdicts = run.verdicts()
    rows = "".join(
        f"<tr><td class=id>{r.id}</td><td class={CSS.get(verdicts[r.id], 'v-other')}>{verdicts[r.id].value}</td>"
        f"<td>{escape(r.text)}{_original(r.original)}</td><td>{escape('; '.join(r.source))}</td><td>{r.grade}</td>"
        f"<td>{_seen(by_id.get(r.id, []), r.unobservable)}</td></tr>"
        for r in run.rows
    )
    head = "".join(f"<th>{h}</th>" for h in ("", "verdict", "requirement", "source", "grade", "seen"))
    return (
        "<section><h2>Requirements</h2><div class=scroll><table>"
        f"<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table></div></section>"
    )


def _seen(outcomes: list[Outcome], unobservable: str) -> str:
    told = [f"{escape(o.title)} {escape(o.saw or o.reason)}" for o in outcomes]
    return "<br>".join(told) or escape(unobservable)


def _signed(run: Run) -> str:
    lines = "".join(f"<tr><td>{what}</td><td></td></tr>" for what in ("Carried out by", "Checked by", "Date, place"))
    return f"<section><h2>Signatures</h2><table class=sign>{lines}</table></section>" if run.suite != "host" else ""
