"""Scenarios for the page: names and texts of those that psa-emu knows, and an edited text, which psa-emu checks."""

from __future__ import annotations

import hashlib
import re
import subprocess
from dataclasses import dataclass
from pathlib import Path

from psabench.errors import BenchError, input_error
from psabench.places import find_emulator, proto_file
from psabench.shell.lexer import Wrong

CHECK_S = 20.0
PLACE = re.compile(r"psa-emu: .*?:(?P<line>\d+):(?P<column>\d+): (?P<text>.*)")


@dataclass(frozen=True, slots=True)
class Named:
    """One that is shipped."""

    name: str
    what: str


def shipped_scenarios() -> list[Named]:
    """As the emulator lists them. Raises BenchError."""
    done = _ask_emulator("--list-scenarios")
    if done.returncode:
        raise BenchError(f"scenario: {done.stderr.strip()}")
    pairs = (line.partition(" ") for line in done.stdout.splitlines() if line.strip())
    return [Named(name, what.strip()) for name, _, what in pairs]


def text_of(scenario: str) -> str:
    """Of a shipped one by name, or of a file. Raises BenchError."""
    names = [s.name for s in shipped_scenarios()]
    path = proto_file(f"scenarios/{scenario}.yaml") if scenario in names else Path(scenario)
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        raise input_error(f"scenario {scenario}", "a scenario", e) from e


def checked_file(text: str, folder: Path) -> Path:
    """The text as a file of ours, named by its content: a saved script finds it again. Raises Wrong with its place."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / f"scenario-{hashlib.sha256(text.encode()).hexdigest()[:12]}.yaml"
    path.write_text(text, encoding="utf-8")
    done = _ask_emulator(str(path), "--dump")
    if done.returncode:
        path.unlink()
        raise Wrong(_without_path(done.stderr.strip()))
    return path


def _without_path(error: str) -> str:
    """The emulator's words with the place in the text: its file is ours."""
    found = PLACE.search(error)
    return f"line {found['line']}, column {found['column']}: {found['text']}" if found else error


def _ask_emulator(*words: str) -> subprocess.CompletedProcess[str]:
    try:
        return subprocess.run(
            [str(find_emulator()), *words], capture_output=True, text=True, timeout=CHECK_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as e:
        raise BenchError(f"scenario: {e}") from e
