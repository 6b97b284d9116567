"""What a search has found: the schedule shrunk, and a folder from which anyone sees it again.

schedule.json     the shortest schedule; psabench explore --replay FOLDER/schedule.json
before.snapshot   the bench before the last action; psa-emu --restore FILE
script.yaml       the same inputs as a scenario for psa-emu alone, in free pace
finding.txt       what was violated, and the lines that show it again
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from psabench.errors import input_error
from psabench.explore.oracle import Violation
from psabench.explore.play import Played, play_schedule
from psabench.explore.schedule import Action, Schedule, of_data
from psabench.explore.script import length_s, script_of
from psabench.explore.shrink import shrink_list

Player = Callable[[Schedule], Played]


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """schedule: shrunk. of: how many actions it had. also: what else it violates."""

    violation: Violation
    also: Sequence[Violation] = ()
    schedule: Schedule
    of: int
    folder: Path

    def words(self) -> str:
        """On two lines."""
        many = f"{len(self.schedule.actions)} of {self.of} actions"
        return f"{self.violation.words()}\n  {many}; psabench explore --replay {self.folder / 'schedule.json'}"


def shrink_schedule(schedule: Schedule, key: str, player: Player = play_schedule) -> Schedule:
    """The shortest schedule that violates the same; itself where it does not violate it again."""

    def fails(actions: Sequence[Action]) -> bool:
        found = player(replace(schedule, actions=tuple(actions)))
        return any(v.key == key for v in found.violations)

    begun = schedule.actions[: player(schedule).actions]
    if not fails(begun):
        return schedule
    return replace(schedule, actions=shrink_list(begun, fails))


def keep_finding(out: Path, schedule: Schedule, violation: Violation, player: Player = play_schedule) -> Finding:
    """Shrink it and write its folder, OUT/KEY. Raises OSError."""
    shrunk = shrink_schedule(schedule, violation.key, player)
    folder = out / re.sub(r"\W+", "-", violation.key).strip("-")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "schedule.json").write_text(json.dumps(shrunk.data(), indent=1) + "\n", encoding="utf-8")
    again = play_schedule(shrunk, folder)
    seen = next((v for v in again.violations if v.key == violation.key), violation)
    also = [v for v in again.violations if v is not seen]
    finding = Finding(violation=seen, also=also, schedule=shrunk, of=len(schedule.actions), folder=folder)
    (folder / "finding.txt").write_text(_finding_text(finding, _write_script(folder)), encoding="utf-8")
    return finding


def _write_script(folder: Path) -> str:
    """The line that runs it; empty where there is none: see `script_of`."""
    saved = [folder / f"{name}.snapshot" for name in ("after", "before")]
    path = next((p for p in saved if p.is_file()), None)
    text = "" if path is None else path.read_text(encoding="utf-8")
    script = script_of(text) if text else None
    if script is None:
        return ""
    (folder / "script.yaml").write_text(json.dumps(script, indent=1) + "\n", encoding="utf-8")
    wires = "--can log:bus.log --vcd lines.vcd"
    return f"psa-emu {folder / 'script.yaml'} --pace free --for {length_s(text):.9f}s {wires}"


def _finding_text(f: Finding, script: str) -> str:
    lines = [
        *(v.words() for v in (f.violation, *f.also)),
        "",
        *(f"{k}. {a.words()}" for k, a in enumerate(f.schedule.actions, 1)),
        "",
    ]
    lines += [f"psabench explore --replay {f.folder / 'schedule.json'}"]
    lines += [f"psa-emu --restore {f.folder / 'before.snapshot'}"]
    lines += [script] if script else []
    return "\n".join(lines) + "\n"


def read_schedule(path: Path) -> Schedule:
    """Raises BadInput."""
    try:
        return of_data(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as e:
        raise input_error(path, "a schedule of psabench explore", e) from e


def replay_file(path: Path) -> Played:
    """Play a schedule from a file. Raises BadInput, BenchError."""
    return play_schedule(read_schedule(path))
