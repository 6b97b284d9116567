"""What a run of a suite came to: for the terminal, as JSON, as JUnit's XML, as an HTML page."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Outcome, Verdict, conforms
from psabench.link.own import replace_file
from psabench.report.page import bullets, figure, html_table, section, verdict_line, whole_page, write_report

FORMAT = 1  # of conform.json
ORDER = tuple(Verdict)
MARKS = {
    Verdict.PASSED: "ok",
    Verdict.FAILED: "FAILED",
    Verdict.INCONCLUSIVE: "open",
    Verdict.NOT_OBSERVABLE: "unseen",
    Verdict.NOT_APPLICABLE: "n/a",
}

STYLE = """<style>
.v-passed { color: var(--good); } .v-failed { color: var(--bad); font-weight: 650; }
.v-inconclusive { color: var(--s2); } .v-other { color: var(--muted); }
td.id { white-space: nowrap; font-weight: 600; } .orig { color: var(--muted);
  font-size: .85em; } .sign td { height: 3.2rem; min-width: 14rem; vertical-align: bottom; }
</style>"""
CSS = {Verdict.PASSED: "v-passed", Verdict.FAILED: "v-failed", Verdict.INCONCLUSIVE: "v-inconclusive"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Of a suite on one subject. facts: who and what was tested, in words."""

    suite: str  # device, recording, host
    subject: str
    facts: Mapping[str, str]
    outcomes: Sequence[Outcome]
    rows: Sequence[Requirement]  # that hold for the subject
    interrupted: bool = False

    @property
    def conforms(self) -> bool:
        return not self.interrupted and conforms(list(self.verdicts().values()))

    def verdicts(self) -> dict[str, Verdict]:
        """Of each requirement: the worst of its tests; open where somebody could see it and no test looks."""
        found: dict[str, Verdict] = {}
        for o in self.outcomes:
            for i in o.requirements:
                found[i] = max(found.get(i, Verdict.PASSED), o.verdict, key=_BADNESS.index)
        return {
            r.id: found.get(r.id, Verdict.NOT_OBSERVABLE if r.unobservable else Verdict.INCONCLUSIVE) for r in self.rows
        }


_BADNESS = (
    Verdict.NOT_APPLICABLE,
    Verdict.PASSED,
    Verdict.NOT_OBSERVABLE,
    Verdict.INCONCLUSIVE,
    Verdict.FAILED,
)


def lines(run: Run, *, everything: bool = False) -> Iterator[str]:
    """For the terminal: what is not passed (or everything), why requirements of a board were not seen, the sum."""
    for o in run.outcomes:
        if everything or o.verdict in (Verdict.FAILED, Verdict.INCONCLUSIVE):
            yield from told(o)
    if run.suite != "host":  # whose cases want what a program says it can, not a probe
        for reason, count in unseen(run).items():
            yield f"{count:3} not observable: {reason}"
    yield summary(run)


def told(o: Outcome) -> Iterator[str]:
    """An outcome in a few lines."""
    yield f"{MARKS[o.verdict]:6} {', '.join(o.requirements)}: {o.title}"
    if o.verdict is Verdict.FAILED:
        rows = requirements().rows
        for i in o.requirements:
            yield f"         {i}: {rows[i].text}"
        at = "" if o.at_ns is None else f" at {o.at_ns * 1e-6:.6f} ms"
        yield f"         saw {o.saw}{at}"
        yield f"         due {o.due}"
        if o.excerpts:
            yield f"         see {', '.join(o.excerpts)}"
    elif o.reason:
        yield f"         {o.reason}"
    elif o.saw:
        yield f"         saw {o.saw}"


def summary(run: Run) -> str:
    """One line: what it came to, with the counts of requirements."""
    verdicts = list(run.verdicts().values())
    counts = ", ".join(f"{n} {v.value}" for v in ORDER if (n := verdicts.count(v)))
    if run.interrupted:
        return f"{run.subject}: interrupted; of {len(verdicts)} requirements {counts}"
    said = "conforms" if run.conforms else "does not conform"
    return f"{run.subject} {said}: of {len(verdicts)} requirements {counts}"


def unseen(run: Run) -> dict[str, int]:
    """Why requirements are not observable, and how many: what no wire shows first, then probe by probe."""
    because = {i: o.reason for o in run.outcomes if o.verdict is Verdict.NOT_OBSERVABLE for i in o.requirements}
    unseen = "no external interface shows it"
    reasons = [because.get(i, unseen) for i, v in run.verdicts().items() if v is Verdict.NOT_OBSERVABLE]
    return dict(sorted(Counter(reasons).items(), key=lambda found: (found[0] != unseen, -found[1], found[0])))


def write(folder: Path, run: Run) -> Path:
    """conform.json, junit.xml and report.html, each whole or not at all; returns the page. Raises as write_report."""
    page = write_report(folder, as_dict(run), html_page(run, folder), "conform.json")
    replace_file(folder / "junit.xml", junit(run))
    return page


def publish(folder: Path, run: Run, *, everything: bool, first: Sequence[str] = ()) -> int:
    """Write the report and print what it says, after `first`; the exit status of the command. Raises as write."""
    page = write(folder, run)
    for line in [*first, *lines(run, everything=everything)]:
        print(line)
    print(f"report: {page}", file=sys.stderr)
    return 130 if run.interrupted else 0 if run.conforms else 1


def as_dict(run: Run) -> dict[str, Any]:
    """What conform.json holds."""
    return {
        "format": FORMAT,
        "suite": run.suite,
        "subject": run.subject,
        "conforms": run.conforms,
        "interrupted": run.interrupted,
        "facts": dict(run.facts),
        "requirements": {i: v.value for i, v in run.verdicts().items()},
        "tests": [_test_dict(o) for o in run.outcomes],
    }


def _test_dict(o: Outcome) -> dict[str, Any]:
    """Of conform.json: format 1 names the stimulus `stimulus`, the excerpts `excerpts`."""
    keys = {"stimulus": "scene", "excerpts": "exhibits"}
    return {keys.get(name, name): value for name, value in asdict(o).items()} | {"verdict": o.verdict.value}


def junit(run: Run) -> str:
    """As CI servers read it: what is not observable or not applicable is skipped, with its reason."""
    suite = ET.Element("testsuite", name=f"conform {run.suite}: {run.subject}", tests=str(len(run.outcomes)))
    counts = {
        "failures": sum(o.verdict is Verdict.FAILED for o in run.outcomes),
        "errors": sum(o.verdict is Verdict.INCONCLUSIVE for o in run.outcomes),
        "skipped": sum(o.verdict in (Verdict.NOT_OBSERVABLE, Verdict.NOT_APPLICABLE) for o in run.outcomes),
    }
    suite.attrib |= {name: str(n) for name, n in counts.items()}
    properties = ET.SubElement(suite, "properties")
    for name, value in run.facts.items():
        ET.SubElement(properties, "property", name=name, value=value)
    for o in run.outcomes:
        case = ET.SubElement(suite, "testcase", classname=" ".join(o.requirements), name=o.test, time=f"{o.took_s:.3f}")
        kind = _JUNIT.get(o.verdict)
        if kind is not None:
            ET.SubElement(case, kind, message=f"saw {o.saw}; due {o.due}" if o.due else o.reason)
    ET.indent(suite)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(suite, encoding="unicode") + "\n"


_JUNIT = {
    Verdict.FAILED: "failure",
    Verdict.INCONCLUSIVE: "error",
    Verdict.NOT_OBSERVABLE: "skipped",
    Verdict.NOT_APPLICABLE: "skipped",
}


# ---- the page: who was tested, every requirement with its verdict, a place to sign


def html_page(run: Run, folder: Path) -> str:
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
    why = [f"{count} not observable: {escape(reason)}" for reason, count in unseen(run).items()]
    return verdict_line(summary(run), run.conforms) + bullets(why, "small")


def _failure(o: Outcome, folder: Path) -> str:
    rows = requirements().rows
    due = "".join(f"<p><b>{i}</b> {escape(rows[i].text)}</p>{_original(rows[i].original)}" for i in o.requirements)
    at = "" if o.at_ns is None else f" at {o.at_ns * 1e-6:.6f} ms"
    pictures = [figure((folder / name).read_text(encoding="utf-8")) for name in o.excerpts if name.endswith(".svg")]
    files = ", ".join(f"<a href='{escape(name)}'>{escape(name)}</a>" for name in o.excerpts)
    return section(
        o.title,
        f"{due}<p>Saw <b>{escape(o.saw)}</b>{at}; due {escape(o.due)}.</p>",
        *pictures,
        f"<p class=small>{files}</p>" if files else "",
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
    return section("Requirements", html_table(f"<tr>{head}</tr>", rows))


def _seen(outcomes: list[Outcome], unobservable: str) -> str:
    told = [f"{escape(o.title)} {escape(o.saw or o.reason)}" for o in outcomes]
    return "<br>".join(told) or escape(unobservable)


def _signed(run: Run) -> str:
    lines = "".join(f"<tr><td>{what}</td><td></td></tr>" for what in ("Carried out by", "Checked by", "Date, place"))
    return section("Signatures", f"<table class=sign>{lines}</table>") if run.suite != "host" else ""
