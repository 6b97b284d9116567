"""Whole runs of the device suite whose report stays in build/conform, as a laboratory would file it."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Sequence
from html import escape
from pathlib import Path
from xml.etree import ElementTree as ET

from psabench.conform import device_command, report
from psabench.conform.dut import Addresses
from psabench.conform.profile import variant
from psabench.conform.requirements import requirements
from psabench.conform.verdict import Verdict
from psabench.procedures.head_bench import Silent

ROOT = Path(__file__).resolve().parents[3]
OUT = ROOT / "build/conform"
PROFILES = [(board, profile) for profile, board in requirements().profiles.items()]


def reported(board: str, profile: str, at: Addresses, link: str = "", only: Sequence[str] = ()) -> report.Run:
    """Run everything, or some groups; build/conform/BOARD-PROFILE[-LINK] is written again. Asserts what it says."""
    folder = OUT / "-".join(filter(None, (board, profile, link)))
    shutil.rmtree(folder, ignore_errors=True)
    run = device_command.device_run(variant(board, profile), at, folder, Silent(), only=only)
    report.write(folder, run)
    check_report(folder, run)
    return run


def check_report(folder: Path, run: report.Run) -> None:
    """Identity, versions, hashes, every requirement with its verdict, a place to sign; the same in JSON and JUnit."""
    page = (folder / "report.html").read_text(encoding="utf-8")
    for fact in ("device", "hardware", "software", "serial number", "suite", "requirements", "date", "emulator"):
        assert f"{fact} <b>{run.facts[fact]}</b>" in page, fact
    for hashed in ("requirements", "emulator"):
        assert re.search(r"\b[0-9a-f]{16}$", run.facts[hashed]), hashed
    verdicts = run.verdicts()
    for r in run.rows:
        assert re.search(rf"<td class=id>{r.id}</td><td class=[\w-]+>{verdicts[r.id].value}</td>", page), r.id
    assert all(who in page for who in ("Carried out by", "Checked by", "Date, place"))
    told = json.loads((folder / "conform.json").read_text(encoding="utf-8"))
    assert told["requirements"] == {i: v.value for i, v in verdicts.items()}
    assert told["conforms"] == run.conforms
    check_counts(folder, run)


def check_counts(folder: Path, run: report.Run) -> None:
    """The line on the terminal, the page, JSON and JUnit count the same requirements."""
    c = run.coverage()
    told = json.loads((folder / "conform.json").read_text(encoding="utf-8"))
    assert [told[key] for key in ("result", "judged", "of")] == [c.result.value, c.judged, len(run.rows)]
    assert f"{c.judged} of {len(run.rows)} requirements judged" in report.summary(run)
    page = (folder / "report.html").read_text(encoding="utf-8")
    assert escape(report.summary(run)) in re.sub("<span lang=en>(.*?)</span>", r"\1", page)
    suite = ET.parse(folder / "junit.xml").getroot()
    assert [case.get("name") for case in suite.findall("testcase")] == [r.id for r in run.rows]
    of_junit = {"failures": "failed", "errors": "inconclusive", "skipped": "not_observable"}
    assert {kind: int(suite.get(kind, "-1")) for kind in of_junit} == {kind: told[v] for kind, v in of_junit.items()}
    assert int(suite.get("tests", "-1")) == len(run.rows)
    properties = {p.get("name"): p.get("value") for p in suite.iter("property")}
    assert (properties["result"], properties["judged"]) == (c.result.value, str(c.judged))
    for name in ("psabench", "revision", "begun", "seed"):
        want = told["provenance"][name]
        assert properties.get(f"provenance.{name}") == (None if want is None else str(want))
    if told["provenance"]["command"]:
        assert shlex.split(properties["provenance.command"]) == told["provenance"]["command"]


def not_met(run: report.Run) -> list[str]:
    """Tests that failed or could not tell, in words."""
    bad = (Verdict.FAILED, Verdict.INCONCLUSIVE)
    return [f"{o.requirements}: {o.saw or o.reason}; due {o.due}" for o in run.outcomes if o.verdict in bad]


def untested(run: report.Run) -> set[str]:
    """Requirements that somebody can see, and no test looks at."""
    looked_at = {i for o in run.outcomes for i in o.requirements}
    return {r.id for r in run.rows if r.observe and r.id not in looked_at}
