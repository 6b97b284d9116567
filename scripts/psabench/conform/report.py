"""What a run of a suite came to: for the terminal, as JSON, as JUnit's XML, as an HTML page."""

from __future__ import annotations

import argparse
import json
import shlex
import sys
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from html import escape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from psabench.conform.coverage import USUAL, Coverage, Goal, Result
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.verdict import Outcome, Verdict
from psabench.link.own import replace_file
from psabench.output import show_stored
from psabench.report.page import (
    bullets,
    figure,
    html_table,
    quoted_html,
    section,
    verdict_html,
    whole_page,
    write_report,
)
from psabench.report.provenance import KEY

DOCUMENT = "conform.json"
FORMAT = 1  # of it
ORDER = tuple(Verdict)
MARKS = {
    Verdict.PASSED: "ok",
    Verdict.FAILED: "FAILED",
    Verdict.INCONCLUSIVE: "open",
    Verdict.NOT_OBSERVABLE: "unseen",
    Verdict.NOT_APPLICABLE: "n/a",
}

PAGES = ("docs/", "proto/", "CiA ", "ISO ")  # sources that are pages, files, standards: named alike in each language
CSS = {Verdict.PASSED: "v-passed", Verdict.FAILED: "v-failed", Verdict.INCONCLUSIVE: "v-inconclusive"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """Of a suite on one subject.

    facts: who and what was tested, in words. selection: options that left requirements out. out_of_reach: ids of
    requirements that this suite cannot see where it is, whatever the subject does.
    """

    suite: str  # device, recording, host
    subject: str
    facts: Mapping[str, str]
    outcomes: Sequence[Outcome]
    rows: Sequence[Requirement]  # that hold for the subject
    interrupted: bool = False
    goal: Goal = USUAL
    selection: str = ""
    out_of_reach: frozenset[str] = frozenset()

    @property
    def conforms(self) -> bool:
        """Nothing is violated, and enough was judged to say so."""
        return self.coverage().result is Result.CONFORMS

    def coverage(self) -> Coverage:
        """How much was judged."""
        verdicts = self.verdicts()
        hidden = {r.id for r in self.rows if r.unobservable} | self.out_of_reach
        reach = sum(i not in hidden and v is not Verdict.NOT_APPLICABLE for i, v in verdicts.items())
        return Coverage(verdicts=verdicts, reach=reach, goal=self.goal, interrupted=self.interrupted)

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
    """One line: what it came to, how many requirements were judged, and what became of the others."""
    return _summary_line(run, _tested_text(run))


def _tested_text(run: Run) -> str:
    return f"{run.subject} ({run.selection})" if run.selection else run.subject


def _summary_line(run: Run, what: str) -> str:
    c = run.coverage()
    verb = c.result in (Result.CONFORMS, Result.VIOLATED)
    said = f"{what} {c.result.value}:" if verb else f"{what}: {c.result.value},"
    judged = f"{c.judged} of {len(c.verdicts)} requirements judged"
    short = f" ({c.needed} needed)" if c.judged < c.needed and not c.interrupted else ""
    others = [f"{n} {v.value}" for v in ORDER if v is not Verdict.PASSED and (n := c.count_of(v))]
    missing = [f"required and not passed: {' '.join(c.missing)}"] if c.missing else []
    return ", ".join([f"{said} {judged}{short}", *others, *missing])


def unseen(run: Run) -> dict[str, int]:
    """Why requirements are not observable, and how many: what no wire shows first, then probe by probe."""
    because = {i: o.reason for o in run.outcomes if o.verdict is Verdict.NOT_OBSERVABLE for i in o.requirements}
    unseen = "no external interface shows it"
    reasons = [because.get(i, unseen) for i, v in run.verdicts().items() if v is Verdict.NOT_OBSERVABLE]
    return dict(sorted(Counter(reasons).items(), key=lambda found: (found[0] != unseen, -found[1], found[0])))


def write(folder: Path, run: Run) -> Path:
    """conform.json, junit.xml and report.html, each whole or not at all; returns the page. Raises as write_report."""
    page = write_report(folder, as_dict(run), html_page(run, folder), DOCUMENT)
    told = json.loads((folder / DOCUMENT).read_text(encoding="utf-8"))
    replace_file(folder / "junit.xml", junit(run, told[KEY]))
    return page


def publish(folder: Path, run: Run, args: argparse.Namespace, first: Sequence[str] = ()) -> int:
    """Write the report and print what it says, after `first`; the exit status of the command. Raises as write.

    args: --verbose, --json.
    """
    page = write(folder, run)
    show_stored(args, [*first, *lines(run, everything=args.verbose)], folder / DOCUMENT)
    print(f"report: {page}", file=sys.stderr)
    return run.coverage().status


def as_dict(run: Run) -> dict[str, Any]:
    """What conform.json holds."""
    return {
        "format": FORMAT,
        "suite": run.suite,
        "subject": run.subject,
        "conforms": run.conforms,
        "interrupted": run.interrupted,
        **_result_counts(run),
        "facts": dict(run.facts),
        "requirements": {i: v.value for i, v in run.verdicts().items()},
        "tests": [_test_dict(o) for o in run.outcomes],
    }


def _test_dict(o: Outcome) -> dict[str, Any]:
    """Of conform.json: format 1 names the stimulus `stimulus`, the excerpts `excerpts`."""
    keys = {"stimulus": "scene", "excerpts": "exhibits"}
    return {keys.get(name, name): value for name, value in asdict(o).items()} | {"verdict": o.verdict.value}


def _result_counts(run: Run) -> dict[str, Any]:
    """The result and its counts of requirements, the same in each form of the report."""
    c = run.coverage()
    counts = {v.value.replace(" ", "_"): c.count_of(v) for v in ORDER}
    return {"result": c.result.value, "judged": c.judged, "needed": c.needed, "of": len(c.verdicts), **counts}


def junit(run: Run, origin: Mapping[str, Any]) -> str:
    """As CI servers read it, a case for each requirement: one that was not judged is skipped, with its reason.

    origin: the provenance of conform.json, for the properties.
    """
    c = run.coverage()
    suite = ET.Element("testsuite", name=f"conform {run.suite}: {run.subject}", tests=str(len(c.verdicts)))
    kinds = Counter(_JUNIT[v] for v in c.verdicts.values() if v in _JUNIT)
    plurals = {"failure": "failures", "error": "errors", "skipped": "skipped"}
    suite.attrib |= {plural: str(kinds[kind]) for kind, plural in plurals.items()}
    properties = ET.SubElement(suite, "properties")
    for name, value in {**_result_counts(run), **run.facts, **_origin_properties(origin)}.items():
        ET.SubElement(properties, "property", name=name, value=str(value))
    for i, verdict in c.verdicts.items():
        _add_case(suite, run, i, verdict)
    ET.indent(suite)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + ET.tostring(suite, encoding="unicode") + "\n"


def _origin_properties(origin: Mapping[str, Any]) -> dict[str, str]:
    """Who computed it, when, from what; a list of words as a shell takes it, what is not known left out."""
    plain = {k: shlex.join(map(str, v)) if k == "command" and v else v for k, v in origin.items()}
    digests = {f"scenario {s['name']} sha256": s["sha256"] for s in origin.get("scenarios", []) if "sha256" in s}
    known = {k: v for k, v in plain.items() if isinstance(v, str | int | float)} | digests
    return {f"{KEY}.{name}": str(value) for name, value in known.items()}


def _add_case(suite: ET.Element, run: Run, i: str, verdict: Verdict) -> None:
    """The case of a requirement: its tests share their time among what they are tests of."""
    tests = [o for o in run.outcomes if i in o.requirements]
    took_s = sum(o.took_s / len(o.requirements) for o in tests)
    case = ET.SubElement(suite, "testcase", classname=f"{run.suite}.{i.split('-')[0]}", name=i, time=f"{took_s:.3f}")
    if verdict in _JUNIT:
        told = [f"{o.test}: {_reason_of(o)}" for o in tests if o.verdict is verdict]
        ET.SubElement(case, _JUNIT[verdict], message="; ".join(told) or _untested(run, i))


def _reason_of(o: Outcome) -> str:
    return f"saw {o.saw}; due {o.due}" if o.due else o.reason


def _untested(run: Run, i: str) -> str:
    row = next(r for r in run.rows if r.id == i)
    return f"no external interface shows it: {row.unobservable}" if row.unobservable else "no test looked at it"


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
        _verdict(run),
        *(_failure(o, folder) for o in run.outcomes if o.verdict is Verdict.FAILED),
        _table(run),
        _signed(run),
    ]
    if run.suite == "host":  # its subject is a command line
        return whole_page("Conformance of a host program", {"program": run.subject, **run.facts}, body)
    return whole_page(f"Conformance of {run.subject}", run.facts, body)


def _verdict(run: Run) -> str:
    why = [f"{count} not observable: {escape(reason)}" for reason, count in unseen(run).items()]
    colour = {Result.CONFORMS: True, Result.VIOLATED: False}.get(run.coverage().result)
    return verdict_html(_summary_line(run, quoted_html(_tested_text(run))), colour) + bullets(why, "small")


def _failure(o: Outcome, folder: Path) -> str:
    pictures = [figure((folder / name).read_text(encoding="utf-8")) for name in o.excerpts if name.endswith(".svg")]
    files = ", ".join(f"<a href='{escape(name)}'>{escape(name)}</a>" for name in o.excerpts)
    return section(o.title, _saw_and_due(o), *pictures, f"<p class=small lang=en>{files}</p>" if files else "")


def _saw_and_due(o: Outcome) -> str:
    """What was required, what was seen and when: a table, so that each text of it is looked up by itself."""
    rows = [(f"<td class=id>{i}</td>", _required_by(requirements().rows[i])) for i in o.requirements]
    at = [] if o.at_ns is None else [("at", f"{o.at_ns * 1e-6:.6f} ms")]
    rows += [(f"<td>{name}</td>", escape(text)) for name, text in (("saw", o.saw), *at, ("due", o.due))]
    return html_table("", "".join(f"<tr>{head}<td>{text}</td></tr>" for head, text in rows))


def _required_by(r: Requirement) -> str:
    """The sentence, and the article's under it, in its language."""
    return escape(r.text) + (f"<p class=orig lang=ru>{escape(r.original)}</p>" if r.original else "")


def _sources_of(r: Requirement) -> str:
    return "; ".join(quoted_html(s) if s.startswith(PAGES) else escape(s) for s in r.source)


def _table(run: Run) -> str:
    by_id: dict[str, list[Outcome]] = {}
    for o in run.outcomes:
        for i in o.requirements:
            by_id.setdefault(i, []).append(o)
    verdicts = run.verdicts()
    rows = "".join(
        f"<tr><td class=id>{r.id}</td><td class={CSS.get(verdicts[r.id], 'v-other')}>{verdicts[r.id].value}</td>"
        f"<td>{_required_by(r)}</td><td style='overflow-wrap:anywhere'>{_sources_of(r)}</td><td>{r.grade}</td>"
        f"<td>{_seen(by_id.get(r.id, []), r.unobservable)}</td></tr>"
        for r in run.rows
    )
    head = "".join(f"<th>{h}</th>" for h in ("", "verdict", "requirement", "source", "grade", "seen"))
    return section("Requirements", html_table(f"<tr>{head}</tr>", rows))


def _seen(outcomes: list[Outcome], unobservable: str) -> str:
    told = [f"{escape(o.title)}<br>{escape(o.saw or o.reason)}" for o in outcomes]
    return "<br>".join(told) or escape(unobservable)


def _signed(run: Run) -> str:
    lines = "".join(f"<tr><td>{what}</td><td></td></tr>" for what in ("Carried out by", "Checked by", "Date, place"))
    return section("Signatures", html_table("", lines, "sign")) if run.suite != "host" else ""
