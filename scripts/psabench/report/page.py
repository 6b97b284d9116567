"""Builder of every report.html: title, facts, verdict, sections, tables, figures; style for light, dark and print.

Texts given as `str` are HTML where the parameter says so, and are escaped everywhere else.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from typing import Any

from psabench.link.own import replace_file
from psabench.report.language import localised_page
from psabench.report.provenance import KEY, provenance_of_run
from psabench.report.quantities import page_words, symbol_html

PAGE_NAME = "report.html"
PAGE = """<!doctype html>
<html lang=en><head><meta charset=utf-8><meta name=viewport content="width=device-width, initial-scale=1">
<title>@TITLE@</title>
<style>
:root { color-scheme: light dark; --ground:#fbfcfd; --card:#ffffff; --ink:#1d2733; --muted:#5b6875;
  --grid:#dfe4ea; --line:#d3dae2;
  --s1:#1f6fb4; --s2:#c4572b; --s3:#2f8f5b; --s4:#8a5cc2; --good:#217a4b; --bad:#b3261e; }
@media (prefers-color-scheme: dark) { :root { --ground:#12171d; --card:#1a2129; --ink:#e4e9ef;
  --muted:#97a4b2; --grid:#2c3641;
  --line:#34404d; --s1:#62aef0; --s2:#f08a5d; --s3:#5cc48d; --s4:#b795ee; --good:#5cc48d; --bad:#ff8a80; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2rem 1.2rem 4rem; max-width: 70rem; background: var(--ground); color:
  var(--ink);
  font: 15px/1.5 system-ui, "Segoe UI", "DejaVu Sans", sans-serif; }
h1 { font-size: 1.7rem; margin: 0; letter-spacing: -.01em; } h2 { font-size: 1.15rem; margin: 0 0 .6rem; }
section { background: var(--card); border: 1px solid var(--line); border-radius: 8px; padding: 1.1rem 1.3rem;
  margin: 1.2rem 0; }
.facts, .small, figcaption, .notes, .method { color: var(--muted); } .facts b { color: var(--ink);
  font-weight: 600; }
.small, figcaption { font-size: .85rem; } .facts { margin: .2rem 0 .8rem; }
.verdict { border-left: 4px solid var(--muted); padding: .5rem .9rem; background: var(--card); font-size:
  1.05rem; }
.verdict.good { border-color: var(--good); } .verdict.bad { border-color: var(--bad); }
.scroll { overflow-x: auto; } table { border-collapse: collapse; font-size: .92rem; }
th, td { padding: .28rem .55rem; text-align: left; border-bottom: 1px solid var(--grid); vertical-align:
  baseline; }
thead th { color: var(--muted); font-weight: 500; font-size: .85rem; } tbody th { font-weight: 500;
  white-space: nowrap; }
.num { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; } .unit, .si, .ci { color:
  var(--muted); }
.si { font-size: .85em; } .ci { font-size: .8em; white-space: nowrap; font-variant-numeric: tabular-nums; }
.cmp td { font-variant-numeric: tabular-nums; } .same { font-weight: 650; color: var(--good); } .other {
  font-weight: 650; }
.flag { color: var(--s2); font-weight: 600; } .same.flag { color: var(--s2); } .bad { color: var(--bad);
  font-weight: 650; }
.off .num { color: var(--muted); } .mark { font-size: .85rem; white-space: nowrap; }
.est thead th:not(:first-child) { text-align: right; } .est thead th:nth-child(4) { text-align: left; } .none
  { color: var(--muted); }
figure { margin: 1rem 0 0; } figure svg { width: 100%; height: auto; max-width: 52rem; display: block;
  overflow: visible; }
details { margin-top: .8rem; } summary { cursor: pointer; color: var(--muted); } .notes { font-size: .9rem; }
sub { font-size: .72em; line-height: 0; }
.v-passed { color: var(--good); } .v-failed { color: var(--bad); font-weight: 650; }
.v-inconclusive { color: var(--s2); } .v-other { color: var(--muted); }
td.id { white-space: nowrap; font-weight: 600; } .orig { color: var(--muted);
  font-size: .85em; } .sign td { height: 3.2rem; min-width: 14rem; vertical-align: bottom; }
footer { color: var(--muted); font-size: .85rem; margin-top: 1.6rem; } footer td { overflow-wrap: anywhere; }
@media print { @page { margin: 15mm; } body { max-width: none; padding: 0; }
  figure, tr, .verdict { break-inside: avoid; } h2 { break-after: avoid; }
  figure svg { max-height: 220mm; } .scroll { overflow: visible; } table { font-size: .8rem; } }
</style></head><body>
@BODY@
</body></html>
"""


def write_report(folder: Path, data: Mapping[str, Any], page: str, json_name: str = "result.json") -> Path:
    """Writes `data` and report.html into `folder` (made if missing), each whole or not at all; returns the page.

    Both get the provenance of the run: the last key, the foot of the page. Raises OSError, OutputError.
    """
    folder.mkdir(parents=True, exist_ok=True)
    origin = provenance_of_run()
    whole = {**data, KEY: origin}
    replace_file(folder / json_name, json.dumps(whole, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    replace_file(folder / PAGE_NAME, localised_page(page.replace("</body>", f"{provenance_foot(origin)}\n</body>")))
    return folder / PAGE_NAME


def verdict_line(text: str, good: bool | None) -> str:
    """The verdict, green or red; None: neither."""
    return verdict_html(escape(text), good)


def verdict_html(text: str, good: bool | None) -> str:
    """The same of HTML."""
    kind = "plain" if good is None else "good" if good else "bad"
    return f"<p class='verdict {kind}'>{text}</p>"


def quoted_html(text: str) -> str:
    """A text that stays as it is in a report of another language."""
    return f"<span lang=en>{escape(text)}</span>"


def section(heading: str, *parts: str, kind: str = "") -> str:
    """A card; parts are HTML."""
    mark = f" class={kind}" if kind else ""
    return f"<section{mark}><h2>{escape(heading)}</h2>{''.join(parts)}</section>"


def table(
    rows: Sequence[Sequence[str]], heads: int = 1, *, numeric: bool = True, symbols: Mapping[str, str] | None = None
) -> str:
    """Plain text in cells: head rows first, the first column heads its row; numbers right-aligned, NO in red.

    symbols: of quantities whose names are in the first column.
    """

    def cell(tag: str, text: str) -> str:
        kind = "" if not numeric else " class='num bad'" if text == "NO" else " class=num"
        return f"<{tag}{kind}>{escape(page_words(text))}</{tag}>"

    def first(name: str) -> str:
        symbol = (symbols or {}).get(name)
        return (
            f"<th>{escape(name)}</th>" if symbol is None else f"<th title='{escape(name)}'>{symbol_html(symbol)}</th>"
        )

    def row(tag: str, r: Sequence[str]) -> str:
        return f"<tr>{first(r[0])}{''.join(cell(tag, x) for x in r[1:])}</tr>"

    head, body = "".join(row("th", r) for r in rows[:heads]), "".join(row("td", r) for r in rows[heads:])
    return html_table(head, body)


def html_table(head: str, body: str, kind: str = "") -> str:
    """A table of rows in HTML."""
    mark = f" class={kind}" if kind else ""
    return f"<div class=scroll><table{mark}><thead>{head}</thead><tbody>{body}</tbody></table></div>"


def figure(svg: str, caption: str = "") -> str:
    """A picture with its caption in HTML."""
    return f"<figure>{svg}{f'<figcaption>{caption}</figcaption>' if caption else ''}</figure>"


def folded(summary: str, body: str) -> str:
    """HTML that opens on a click."""
    return f"<details><summary>{escape(summary)}</summary>{body}</details>"


def bullets(items: Sequence[str], kind: str = "notes") -> str:
    """A list of HTML items; "" for none."""
    return f"<ul class={kind}>{''.join(f'<li>{x}</li>' for x in items)}</ul>" if items else ""


def whole_page(title: str, facts: Mapping[str, str], sections: Iterable[str]) -> str:
    """One file, nothing loaded from elsewhere. Same input, same bytes; empty sections leave no trace."""
    told = " · ".join(f"{escape(k)} <b>{escape(v)}</b>" for k, v in facts.items())
    header = f"<header><h1>{escape(title)}</h1><p class=facts>{told}</p></header>"
    body = "\n".join([header, *(s for s in sections if s)])
    return PAGE.replace("@TITLE@", escape(title)).replace("@BODY@", body)


def provenance_foot(origin: Mapping[str, Any]) -> str:
    """The provenance of a result as the foot of its page; `page_without_foot` takes it away."""
    rows = [(name, words) for name, value in origin.items() if (words := provenance_words(value))]
    return f"<footer><h2>Provenance</h2>{table(rows, 0, numeric=False)}</footer>"


def provenance_words(value: object) -> str:
    """A value of the provenance in one line; "": there is none."""
    if isinstance(value, Mapping):
        return ", ".join(f"{k} {provenance_words(v)}" for k, v in value.items() if v not in (None, "", [], {}))
    if isinstance(value, Sequence) and not isinstance(value, str):
        rows = any(isinstance(v, Mapping) for v in value)
        return "; ".join(map(provenance_words, value)) if rows else shlex.join(map(str, value))
    return "" if value is None else str(value)


def page_without_foot(page: str) -> str:
    """A page as it was before `write_report` wrote who made it, and when."""
    return re.sub(r"<footer>.*?</footer>\n", "", page, flags=re.DOTALL)
