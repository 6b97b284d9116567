"""The state of a panel's bench, by the snapshots that it makes."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import panel_run as run
from websockets.sync.client import ClientConnection


def digest(snapshot: Path) -> str:
    """SHA-256 over the state of the bench (docs/snapshots.md)."""
    (state,) = re.findall(r'"state":"([0-9a-f]{64})"', snapshot.read_text())
    return str(state)


def say_all(socket: ClientConnection, lines: Sequence[str]) -> None:
    for k, line in enumerate(lines):
        answer = run.said(socket, 100 + k, line)
        assert "error" not in answer, answer


def replayed(script: Path, made: Path) -> str:
    """The state in which a saved script ends: it makes that snapshot again."""
    before = digest(made)
    made.unlink()
    command = [sys.executable, "-m", "psabench.cli", "run", "script", str(script)]
    subprocess.run(command, check=True, timeout=run.WAIT_S)
    after = digest(made)
    assert after == before
    return after
