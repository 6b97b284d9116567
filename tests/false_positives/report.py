"""What the runs came to: false_positives.json, a summary, the tables of docs/reference/false_positives.md."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

import between
from psabench.link.own import replace_file

from tests.false_positives.design import ERRORS_PPM, SEEDS, profiles
from tests.false_positives.verdict import Alarm, Result, worst

FORMAT = 1  # of false_positives.json
MARKS = "<!-- result: made by `make false-positives`, do not edit -->", "<!-- end of result -->"


def read(path: Path) -> dict[str, Result]:
    """Results by the keys of their cases; empty: no such file, or one of another format."""
    if not path.is_file():
        return {}
    found = json.loads(path.read_text(encoding="utf-8"))
    rows = found["runs"] if isinstance(found, dict) and found.get("format") == FORMAT else []
    results = [Result.of(row) for row in rows]
    return {r.case.key: r for r in results}


def write(path: Path, results: Mapping[str, Result]) -> None:
    """All of them."""
    path.parent.mkdir(parents=True, exist_ok=True)
    everything = {"format": FORMAT, "runs": [r.row() for r in results.values()]}
    replace_file(path, json.dumps(everything, indent=1, ensure_ascii=False) + "\n")


def line(r: Result) -> str:
    """One run on the terminal."""
    c = r.case
    how = "under load" if c.load else "lockstep"
    said = f"{c.profile:14} seed {c.seed:3} {c.error_ppm:+5.0f} ppm {how:10} {r.took_s:6.1f} s"
    return f"{said}  {f'ALARM {worst(r.alarms)}' if r.alarms else f'{r.passed} of {r.tests} passed, no alarm'}"


def summary(results: Sequence[Result]) -> Iterator[str]:
    """Counts; then each requirement that alarmed, with the command that shows it."""
    bad = [r for r in results if r.alarms]
    yield f"{len(results)} runs, {sum(r.tests for r in results)} tests, false alarms in {_bad(results)} runs"
    for name, found in _by_requirement(bad).items():
        r, alarm = found[0]
        yield f"  {name}: {len(found)} times {alarm.verdict}; seeds {_seeds(r for r, _ in found)}"
        yield f"    {alarm.words}"
        yield f"    {r.case.command}"


def _bad(results: Iterable[Result]) -> int:
    """Runs with an alarm."""
    return sum(bool(r.alarms) for r in results)


def _by_requirement(bad: Iterable[Result]) -> dict[str, list[tuple[Result, Alarm]]]:
    found: dict[str, list[tuple[Result, Alarm]]] = {}
    for r in bad:
        for a in r.alarms:
            found.setdefault(" ".join(a.requirements) or a.verdict, []).append((r, a))
    return dict(sorted(found.items(), key=lambda kv: -len(kv[1])))


def _seeds(results: Iterable[Result]) -> str:
    found = [f"{r.case.profile}:{r.case.seed}" for r in results]
    return " ".join(found[:6]) + (f" and {len(found) - 6} more" if len(found) > 6 else "")


def page(path: Path, results: Sequence[Result], state: str) -> None:
    """The tables of docs/reference/false_positives.md, in place of those that are there."""
    tables = "\n".join(_tables(results, state))
    between.write(path, MARKS, f"\n{tables}\n")


def _tables(results: Sequence[Result], state: str) -> Iterator[str]:
    plain, load = [r for r in results if not r.case.load], [r for r in results if r.case.load]
    of = len(SEEDS) * len(profiles())
    seeds = {(r.case.profile, r.case.seed) for r in plain}
    now = sum(r.state == state for r in results)
    yield (
        f"{len(seeds)} of the {of} pairs of a seed and a profile were run in lockstep, {len(load)} runs in real time "
        f"under load: {sum(r.tests for r in results)} tests, false alarms in {_bad(results)} runs. "
        f"{now} of the {len(results)} runs were of the sources as they are.\n"
    )
    yield (
        "| profile | runs | "
        + " | ".join(f"{e:+.0f} ppm" for e in ERRORS_PPM)
        + " | tests | alarms | under load | alarms |"
    )
    yield "|---|" + "---|" * (5 + len(ERRORS_PPM))
    for profile in profiles():
        mine, pressed = ([r for r in rows if r.case.profile == profile] for rows in (plain, load))
        errors = Counter(r.case.error_ppm for r in mine)
        cells = [len(mine), *(errors[e] for e in ERRORS_PPM), sum(r.tests for r in mine)]
        cells += [_bad(mine), len(pressed), _bad(pressed)]
        yield f"| {profile} | " + " | ".join(map(str, cells)) + " |"
    bad = _by_requirement(r for r in results if r.alarms)
    if bad:
        yield "\n| alarm | runs | what it said | shown by |\n|---|---|---|---|"
    for name, found in bad.items():
        r, alarm = found[0]
        said = alarm.words.replace("|", "\\|").replace("\n", " ")
        yield f"| {name} | {len(found)} | {alarm.verdict}: {said} | `{r.case.command}` |"
