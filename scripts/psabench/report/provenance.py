"""Where a result comes from: who computed it, when, from what; the key `provenance` of result.json, the foot of a page.

`cli.main` opens a run with `command_run`. Code that starts an emulator, reads a recording or loads a library notes it
there. Outside of a run notes are dropped. Nothing else of a report depends on what is noted: the same seed gives the
same bytes but for this block.
"""

from __future__ import annotations

import hashlib
import json
import platform
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from psabench.places import CHECKOUT

FORMAT = 1  # of the block
KEY = "provenance"  # of result.json and conform.json
LIBRARIES = ("numpy", "scipy")  # that numbers depend on
GIT_S = 5.0  # timeout


@dataclass(slots=True, kw_only=True)
class Run:
    """One command under way, and what it has used."""

    words: tuple[str, ...]
    begun: datetime
    start_s: float  # time.monotonic
    started: dict[tuple[str, str], None] = field(default_factory=dict)  # name and text of scenarios, in order
    rows: list[dict[str, Any]] = field(default_factory=list)  # of scenarios that were not started here
    files: list[dict[str, Any]] = field(default_factory=list)
    programs: dict[str, Path] = field(default_factory=dict)
    closed: bool = False  # to notes

    @property
    def scenarios(self) -> list[dict[str, Any]]:
        """What the block says of each scenario. Digested when asked for: the shell of a fleet does without."""
        found: list[dict[str, Any]] = []
        digests = ({"name": Path(name).stem, **scenario_digest(json.loads(text))} for name, text in self.started)
        for row in (*digests, *self.rows):
            found += [] if row in found else [row]
        return found


_runs: list[Run] = []  # the last is the one under way; a list of the process: emulators are started from any thread
_loaded: dict[str, Path] = {}  # libraries of this process


@contextmanager
def command_run(words: Sequence[str]) -> Iterator[Run]:
    """A run of these words of a command line; reports written in it name them and what was noted."""
    run = Run(words=tuple(words), begun=datetime.now(UTC), start_s=time.monotonic())
    _runs.append(run)
    try:
        yield run
    finally:
        _runs.remove(run)


def noted_run() -> Run | None:
    """The run that takes notes; None: there is none."""
    return _runs[-1] if _runs and not _runs[-1].closed else None


@contextmanager
def without_notes() -> Iterator[None]:
    """For a command that starts emulators by the hundred and names their common scenario itself."""
    run = noted_run()
    if run is not None:
        run.closed = True
    try:
        yield
    finally:
        if run is not None:
            run.closed = False


# ---- notes


def note_scenario(name: str, text: str) -> None:
    """A scenario with every key, as `psa-emu --resolved` writes it."""
    if run := noted_run():
        run.started[name, text] = None


def note_bench(name: str, seed: int) -> None:
    """The scenario of an emulator that was there already, as its truth port tells it."""
    if run := noted_run():
        run.rows.append({"name": Path(name).stem, "seed": seed})


def note_recorded(setup: Mapping[str, Any]) -> None:
    """The scenarios of a run that is replayed, from its set-up."""
    if run := noted_run():
        run.rows += setup.get("scenarios", [])


def noted_scenarios() -> list[dict[str, Any]]:
    """Those of the run under way, for the set-up of a recording."""
    run = noted_run()
    return run.scenarios if run else []


def note_digest(name: str, seed: int, value: object) -> None:
    """What a command without an emulator computes from, as JSON has it."""
    if run := noted_run():
        run.rows.append({"name": name, "seed": seed, "sha256": json_digest(value)})


def note_file(role: str, path: Path) -> None:
    """A file that the result depends on: recording, passport, scenario."""
    if (run := noted_run()) and path.is_file():
        row = {"role": role, "name": path.name, "sha256": _file_digest(path)}
        run.files += [] if row in run.files else [row]


def note_program(name: str, path: Path) -> None:
    """A program of ours that was started."""
    if run := noted_run():
        run.programs[name] = path


def note_library(name: str, path: Path) -> None:
    """A library of ours that this process has loaded, for the rest of its life."""
    _loaded[name] = path


def scenario_digest(resolved: Mapping[str, Any]) -> dict[str, Any]:
    """Seed, and SHA-256 of a resolved scenario without its seed, of its profiles and of its sensors' passports."""
    body = {k: v for k, v in resolved.items() if k not in ("seed", "version")}
    units = body.get("units", [])
    profiles = {u["profile_set"]["name"]: json_digest(u["profile_set"]) for u in units if "profile_set" in u}
    return {
        "seed": int(resolved["seed"]),
        "sha256": json_digest(body),
        "profiles": dict(sorted(profiles.items())),
        "passports_sha256": json_digest([[u.get("name"), u.get("axes"), u.get("spread")] for u in units]),
    }


def json_digest(value: object) -> str:
    """SHA-256 of JSON: keys in order, no blanks."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, separators=(",", ":")).encode()).hexdigest()


def _file_digest(path: Path) -> str:
    with path.open("rb") as f:
        return hashlib.file_digest(f, "sha256").hexdigest()


# ---- the block


def provenance_of_run() -> dict[str, Any]:
    """The block of a report that is written now: plain data. Outside of a run: who and when, and no more."""
    run = _runs[-1] if _runs else None
    binaries = _loaded | (run.programs if run else {})
    scenarios = run.scenarios if run else []
    return {
        "format": FORMAT,
        "psabench": _installed_version("psabench"),
        "revision": _git_revision(),
        "python": platform.python_version(),
        "libraries": {name: _installed_version(name) for name in LIBRARIES if name in sys.modules},
        "machine": f"{platform.system()} {platform.machine()}",
        "binaries": [_binary_dict(name, path) for name, path in sorted(binaries.items()) if path.is_file()],
        "command": list(run.words) if run else None,
        "begun": (run.begun if run else datetime.now(UTC)).isoformat(timespec="seconds"),
        "duration_s": round(time.monotonic() - run.start_s, 3) if run else None,
        "seed": _common_seed(scenarios),
        "scenarios": scenarios,
        "files": list(run.files) if run else [],
    }


def _common_seed(scenarios: Sequence[Mapping[str, Any]]) -> int | None:
    """The one that all scenarios have; each names its own as well."""
    seeds = {int(s["seed"]) for s in scenarios}
    return seeds.pop() if len(seeds) == 1 else None


def _installed_version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def _git_revision() -> str | None:
    """`git describe` of the checkout that this program runs from; None: it is installed."""
    if not (CHECKOUT / ".git").exists():
        return None
    return _program_output("git", "-C", str(CHECKOUT), "describe", "--tags", "--always", "--dirty")


def _binary_dict(name: str, path: Path) -> dict[str, Any]:
    """SHA-256; of the emulator its version, compiler and flags, too: they decide the last bit."""
    told = (_program_output(str(path), "--version") or "").splitlines() if name == "psa-emu" else []
    lines = dict(line.split(": ", 1) for line in told[1:] if ": " in line)
    own = {"version": told[0].removeprefix("psa-emu "), **lines} if told else {}
    return {"name": name, "sha256": _file_digest(path), **own}


def _program_output(*command: str) -> str | None:
    """Standard output of a program; None: there is none, or it fails."""
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=GIT_S, check=True)
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()
