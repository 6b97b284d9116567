"""What the mutants came to: a table for the terminal, mutants.json, the tables of docs/reference/mutants.md."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import between
from psabench.link.own import replace_file
from scipy import stats

from tests.mutants.declared import load
from tests.mutants.verdict import KILLED, WRONG, Result

FORMAT = 1  # of mutants.json
MARKS = "<!-- result: made by `make mutants`, do not edit -->", "<!-- end of result -->"


def rate(results: Iterable[Result]) -> tuple[int, int]:
    """Killed, and of how many: those that no one can see, or of which nothing is known, do not count."""
    rows = [r for r in results if r.result != "equivalent" and r.result not in WRONG]
    return sum(r.result in KILLED for r in rows), len(rows)


def interval(killed: int, of: int) -> str:
    """95 % by Clopper and Pearson: exact, it holds for any rate and any count."""
    if not of:
        return "-"
    ci = stats.binomtest(killed, of).proportion_ci(0.95, "exact")
    return f"{100.0 * ci.low:.1f} to {100.0 * ci.high:.1f} %"


def percent(killed: int, of: int) -> str:
    """As a table shows it."""
    return f"{100.0 * killed / of:.1f} %" if of else "-"


def line(r: Result) -> str:
    """One mutant on the terminal."""
    found = r.by or " ".join(r.found[:4]) + (f" and {len(r.found) - 4} more" if len(r.found) > 4 else "")
    named = "" if r.named or not r.found or not r.breaks else f" (not {' or '.join(r.breaks)})"
    detail = f"{found}{named}" if found else r.reason or f"breaks {', '.join(r.breaks) or 'an undeclared requirement'}"
    return f"{r.result:12} {r.id:34} {r.on:16} {detail.splitlines()[-1] if detail else ''}"


def summary(title: str, results: Sequence[Result]) -> Iterator[str]:
    """Rates, overall and per kind; then who was not found."""
    killed, of = rate(results)
    counts = Counter(r.result for r in results)
    yield f"{title}: {killed} of {of} killed, {percent(killed, of)}, 95 %: {interval(killed, of)}: " + ", ".join(
        f"{n} {name}" for name, n in sorted(counts.items())
    )
    named = sum(r.named for r in results if r.result == "killed" and r.breaks)
    declared = sum(r.result == "killed" for r in results if r.breaks)
    if declared:
        yield f"  of {declared} that a requirement found, {named} by one that the list names"
    for kind in sorted({r.kind for r in results}):
        killed, of = rate(r for r in results if r.kind == kind)
        yield f"  {kind:16} {killed:4} of {of:4}  {percent(killed, of)}"
    for r in sorted(results, key=lambda r: (r.breaks, r.id)):
        if r.result not in KILLED:
            why = f": {r.reason.splitlines()[-1]}" if r.reason else ""
            yield f"  {r.result}: {r.id} ({', '.join(r.breaks) or r.file}){why}"


def read(path: Path) -> dict[str, Any]:
    """The latest mutants.json; empty: none, or of another format."""
    if not path.is_file():
        return {}
    found = json.loads(path.read_text(encoding="utf-8"))
    return found if isinstance(found, dict) and found.get("format") == FORMAT else {}


def write(path: Path, parts: dict[str, Sequence[Result]], facts: dict[str, Any]) -> None:
    """parts: declared, random."""
    path.parent.mkdir(parents=True, exist_ok=True)
    everything = {"format": FORMAT, **facts, **{name: [asdict(r) for r in rows] for name, rows in parts.items()}}
    replace_file(path, json.dumps(everything, indent=1, ensure_ascii=False) + "\n")


def page(path: Path, parts: dict[str, Sequence[Result]], facts: Mapping[str, Any]) -> None:
    """The tables of docs/reference/mutants.md, in place of those that are there; a part without results stays."""
    titles = {"declared": "Declared mutants", "random": f"Random mutants, seed {facts.get('random_seed')}"}
    before = path.read_text(encoding="utf-8").partition(MARKS[0])[2].partition(MARKS[1])[0].split("### ")[1:]
    bodies = []
    for name, results in parts.items():
        kept = [f"### {section.rstrip()}\n" for section in before if section.startswith(f"{name.capitalize()} mutants")]
        bodies += ["\n".join(_part(name, titles[name], results))] if results else kept
    between.write(path, MARKS, "\n" + "\n".join(bodies))


def _part(name: str, title: str, results: Sequence[Result]) -> Iterator[str]:
    yield f"### {title}\n"
    if name == "declared" and len(results) < len(load()):
        yield f"Judged so far: {len(results)} of the {len(load())} of the list.\n"
    counts = Counter(r.result for r in results)
    yield f"{_said(results)} Of all {len(results)}: {', '.join(f'{n} {what}' for what, n in sorted(counts.items()))}.\n"
    yield from _rates("kind", {r.kind: [s for s in results if s.kind == r.kind] for r in results})
    if name == "random":
        yield from _rates(
            "folder", {folder(r.file): [s for s in results if folder(s.file) == folder(r.file)] for r in results}
        )
    spared = [r for r in results if r.result not in KILLED and (r.result != "equivalent" or r.breaks)]
    if spared:
        yield "| not killed | what became of it | breaks | reason |\n|---|---|---|---|"
    for r in sorted(spared, key=lambda r: r.id):
        reason = r.reason.splitlines()[-1].replace("|", "\\|") if r.reason else ""
        yield f"| {r.id} | {r.result} | {', '.join(r.breaks) or r.file} | {reason} |"
    if spared:
        yield ""


def folder(file: str) -> str:
    """emu/chip/ads1282 of emu/chip/ads1282/conv.c."""
    return Path(file).parent.as_posix()


def _rates(title: str, rows: Mapping[str, Sequence[Result]]) -> Iterator[str]:
    """A table: what became of each row's mutants; the columns of the tests only where they have judged."""
    tested = any(r.by for results in rows.values() for r in results)
    yield f"| {title} | killed |{' by tests alone |' if tested else ''} of | rate |"
    yield "|---|---|---|---|" + ("---|" if tested else "")
    for name, results in sorted(rows.items()):
        killed, of = rate(results)
        by = f" {sum(bool(r.by) for r in results)} |" if tested else ""
        yield f"| {name} | {killed} |{by} {of} | {percent(killed, of)} |"
    yield ""


def _said(results: Sequence[Result]) -> str:
    """The rate, and how those that a requirement found were found."""
    killed, of = rate(results)
    found = [r for r in results if r.result == "killed" and not r.by]
    words = f"{killed} of {of} killed, {percent(killed, of)} (95 %, Clopper-Pearson: {interval(killed, of)})."
    if tested := [r.by for r in results if r.by]:
        first = len(found) + sum(r.result in KILLED for r in results if r.result != "killed")
        counts = ", ".join(f"{n} by {what}" for what, n in sorted(Counter(tested).items()))
        words += f" Device conformance killed {first}, {percent(first, of)}; of the others {counts} of their folder."
    if found and all(r.failed is not None for r in found):
        failed = sum(r.failed is True for r in found)
        words += f" In {failed} of {len(found)} a requirement failed; in the others one could not be carried out."
    listed = [r for r in found if r.breaks]
    if listed:
        words += f" {sum(r.named for r in listed)} were found by a requirement that the list names."
    return words
