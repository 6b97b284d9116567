"""A procedure that a page has started: `psabench run NAME` as a process of its own, on an emulator of its own or ours.

It believes to be at a terminal, so it draws its bar; the bar's parts are what a page shows.
"""

from __future__ import annotations

import os
import pty
import re
import signal
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from psabench.errors import BenchError, expected
from psabench.panel.intervals import Intervals
from psabench.procedures.command_line import offered
from psabench.progress import INTERVALS

OFFERED: Mapping[str, str] = {
    **offered.ON_THE_HEAD,
    offered.ALL: "turns, fourier and reversal, each on each bench",
    **offered.ON_THE_PLATFORM,
    **dict([offered.COMPARE, offered.THERMAL, offered.MEMS_GYRO, offered.SINS, offered.COVARIANCE, offered.SNAKE]),
}
AGAIN: Mapping[str, Sequence[str]] = {offered.THERMAL[0]: ("--fresh",)}  # of those that do not overwrite by themselves
REPORT = "report.html"
LINES = 30  # of what it printed
END_S = 10.0  # after Ctrl-C
ESCAPE = re.compile(r"\x1b\[[0-9;]*[A-Za-z]")
BAR = re.compile(r"(?P<name>.+?) (?:[█·]+ )?(?P<done>\d+)/(?P<total>\d+), \d+ s left(?:; (?P<note>.*))?")
DONE = re.compile(r"(?P<name>.+?): (?P<done>\d+)/(?P<total>\d+) in [\d.]+ s(?:; (?P<note>.*))?")


@dataclass(slots=True)
class Progress:
    """What a procedure has said so far."""

    name: str = ""
    state: str = "none"  # running, done, out of limits, failed, stopped
    step: str = ""
    done: int = 0
    total: int = 0
    note: str = ""
    lines: deque[str] = field(default_factory=lambda: deque(maxlen=LINES))

    def take(self, text: str) -> None:
        """One line, or one drawing of the bar."""
        plain = ESCAPE.sub("", text).strip()
        match = BAR.fullmatch(plain) or DONE.fullmatch(plain)
        if match is None:
            if plain:
                self.lines.append(plain)
            return
        self.step, self.note = match["name"], match["note"] or ""
        self.done, self.total = int(match["done"]), int(match["total"])


class Runs:
    """One procedure at a time. changed: called from a thread of ours whenever there is news."""

    def __init__(self, out: Path, changed: Callable[[], None]) -> None:
        self.out = out
        self.progress = Progress()
        self.intervals = Intervals(out / f"intervals-{os.getpid()}.jsonl")  # another panel may have the same folder
        self._changed = changed
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False

    @property
    def is_running(self) -> bool:
        return self._process is not None and self._process.poll() is None

    def start(self, name: str, more: Sequence[str] = ()) -> None:
        """more: further options. Raises BenchError."""
        if name not in OFFERED:
            raise BenchError(expected(", ".join(OFFERED), repr(name[:40]), "procedure"))
        if self.is_running:
            raise BenchError(f"procedure: {self.progress.name} is running; stop it first")
        folder = self.out / name
        folder.mkdir(parents=True, exist_ok=True)
        (folder / REPORT).unlink(missing_ok=True)
        self.intervals.forget()
        self.progress, self._stopped = Progress(name=name, state="running"), False
        ours, theirs = pty.openpty()
        command = [sys.executable, "-m", "psabench.cli", "run", name, "--out", str(folder), *AGAIN.get(name, ())]
        command += more
        try:
            self._process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=theirs,
                stderr=theirs,
                env=os.environ | {"COLUMNS": "200", INTERVALS: str(self.intervals.path.resolve())},
                start_new_session=True,
            )
        finally:
            os.close(theirs)
        self._changed()  # its first words take seconds
        threading.Thread(target=self._follow, args=(ours, self._process, self.progress), daemon=True).start()

    def stop(self) -> None:
        """Ctrl-C, if one is running."""
        if self._process is not None and self.is_running:
            self._stopped = True
            _signal_group(self._process.pid, signal.SIGINT)

    def close(self) -> None:
        """With the panel."""
        self.stop()
        if self._process is not None:
            try:
                self._process.wait(END_S)
            except subprocess.TimeoutExpired:
                _signal_group(self._process.pid, signal.SIGKILL)
                self._process.wait()
        self.intervals.forget()

    def _follow(self, ours: int, process: subprocess.Popen[bytes], progress: Progress) -> None:
        rest = b""
        while more := _read_terminal(ours):
            *whole, rest = re.split(rb"[\r\n]+", rest + more)
            for part in whole:
                progress.take(part.decode(errors="replace"))
            self.intervals.follow()
            self._changed()
        os.close(ours)
        self.intervals.follow()
        status = process.wait()
        known = {0: "done", 1: "out of limits"}
        progress.state = "stopped" if self._stopped else known.get(status, f"failed, status {status}")
        self._changed()

    def message(self) -> dict[str, Any]:
        """For a page."""
        p = self.progress
        report = f"/reports/{p.name}/{REPORT}" if p.name and (self.out / p.name / REPORT).exists() else ""
        return {
            "kind": "procedure",
            "name": p.name,
            "state": p.state,
            "step": p.step,
            "done": p.done,
            "total": p.total,
            "note": p.note,
            "lines": list(p.lines),
            "intervals": self.intervals.message(),
            "report": report if p.state != "running" else "",
        }


def _signal_group(pid: int, number: signal.Signals) -> None:
    with suppress(ProcessLookupError):  # it has just ended
        os.killpg(pid, number)


def _read_terminal(descriptor: int) -> bytes:
    """b"": the other end is closed; Linux calls it EIO."""
    try:
        return os.read(descriptor, 65536)
    except OSError:
        return b""
