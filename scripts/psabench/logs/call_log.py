"""The calls of a recorded run, beside its CAN log: FILE.calls.csv.

A row is a call with its argument and answer, the bench's time behind it and the number of frames received by then. The
first row is the set-up of the run, the last one its end. On replay the calls are the same in the same order, or the
first other one is named.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack
from pathlib import Path
from typing import Any

import can
import numpy as np

from psabench.errors import BadInput, expected, input_error
from psabench.link.log_file import LogFile
from psabench.link.own import output_text
from psabench.logs.formats import READABLE
from psabench.report import provenance

COLUMNS = ("call", "argument", "answer", "t_s", "frames")
SETUP, END = "setup", "end"


def calls_path(log: Path) -> Path:
    """Where the calls of a log are."""
    return log.with_name(log.name + ".calls.csv")


def check_ending(log: Path) -> None:
    """Raises BadInput for a log that could not be read back."""
    if log.suffix.lower() not in READABLE:
        raise BadInput(expected(f"an ending of {' '.join(READABLE)}", log.suffix or "none", log))


class CallWriter(AbstractContextManager["CallWriter"]):
    """The CAN log and the calls of a run that is being recorded. Stores the end of a run that ends well."""

    def __init__(self, path: Path) -> None:
        """Raises BadInput or OutputError when one of the two files cannot be made."""
        check_ending(path)
        self._frames, self.t_s = 0, 0.0
        with ExitStack() as stack:
            self._log = LogFile(path)
            stack.callback(self._log.close)
            file = stack.enter_context(output_text(calls_path(path), lambda: f"stored {self._frames} frames"))
            self._csv = csv.writer(file, lineterminator="\n")
            self._csv.writerow(COLUMNS)
            self._stack = stack.pop_all()

    def keep_frame(self, message: can.Message) -> None:
        """A frame that has come."""
        if not message.is_error_frame:
            self._frames += self._log(message)

    def store_call(self, call: str, argument: str, answer: str, t_s: float) -> None:
        """A call that is over, at the bench's time t_s. Raises OutputError when the log could not take its frames."""
        self._check_log()
        self.t_s = t_s
        self._csv.writerow([call, argument, answer, repr(t_s), self._frames])

    def _check_log(self) -> None:
        if self._log.error is not None:
            raise self._log.error

    def __exit__(self, kind: type[BaseException] | None, *rest: Any) -> None:
        try:
            if kind is None:
                self.store_call(END, "", "", self.t_s)
        finally:
            self._stack.__exit__(kind, *rest)
        if kind is None:
            self._check_log()


class Calls:
    """Those of a recording, one after the other."""

    def __init__(self, log: Path) -> None:
        """Raises BadInput for calls that are missing, cut or damaged."""
        self._log, self.path = log, calls_path(log)
        self._rows = _read_calls(self.path)
        self._at = 0
        row = self.next_call(SETUP, None)
        try:
            self.setup: dict[str, Any] = dict(json.loads(row["argument"]))
            _ = dict(self.setup["facts"]), self.setup["procedure"]
            provenance.note_recorded(self.setup)
        except (ValueError, KeyError, TypeError) as e:
            raise self.no_setup() from e
        for role, path in (("recording", log), ("calls", self.path)):
            provenance.note_file(role, path)

    def no_setup(self) -> BadInput:
        """Of a first row that does not say how the run was."""
        return BadInput(expected("the set-up of a run", self._rows[0]["argument"][:60], f"{self.path}:2"))

    def check_frames(self, count: int) -> None:
        """Raises BadInput where the log has another number of frames."""
        if count != int(self._rows[-1]["frames"]):
            raise BadInput(expected(f"{self._rows[-1]['frames']} frames, as {self.path} says", count, self._log))

    @property
    def t_s(self) -> float:
        """Time of the bench behind the last call."""
        return float(self._rows[self._at - 1]["t_s"])

    @property
    def frames(self) -> int:
        """Received by the end of the last call."""
        return int(self._rows[self._at - 1]["frames"])

    @property
    def where(self) -> str:
        """File and line of the last call."""
        return f"{self.path}:{self._at + 1}"

    def comes_next(self, call: str, argument: str) -> bool:
        """Whether this is the next call."""
        row = self._rows[min(self._at, len(self._rows) - 1)]
        return (row["call"], row["argument"]) == (call, argument)

    def next_call(self, call: str, argument: str | None) -> dict[str, str]:
        """The next call of the recording. Raises BadInput when the procedure makes another one."""
        row = self._rows[min(self._at, len(self._rows) - 1)]
        self._at += 1
        if row["call"] != call or argument not in (None, row["argument"]):
            asked = f"{call} {argument or ''}".strip()
            raise BadInput(
                expected(f"{row['call']} {row['argument']}".strip(), f"{asked} (of the procedure)", self.where)
            )
        return row


def _read_calls(path: Path) -> list[dict[str, str]]:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as e:
        what = "the calls of a recorded run, which psabench run --record writes beside the log"
        raise input_error(path, what, e) from e
    rows = list(csv.reader(text.splitlines()))
    if not rows or tuple(rows[0]) != COLUMNS:
        raise BadInput(expected(f"the columns {','.join(COLUMNS)}", ",".join(rows[0]) if rows else "none", f"{path}:1"))
    calls, frames = [], 0
    for line, row in enumerate(rows[1:], start=2):
        call = dict(zip(COLUMNS, row, strict=False))
        if (
            len(row) != len(COLUMNS)
            or not call["frames"].isdecimal()
            or int(call["frames"]) < frames
            or not _is_good(call)
        ):
            raise BadInput(
                expected("a call, its answer, a time and a rising number of frames", ",".join(row), f"{path}:{line}")
            )
        frames = int(call["frames"])
        calls.append(call)
    if not calls or calls[-1]["call"] != END:
        raise BadInput(expected("a last row `end`", "a run that was ended early", path))
    return calls


def _is_good(call: Mapping[str, str]) -> bool:
    try:
        return bool(np.isfinite([float(call["t_s"]), float(call["answer"] or 0)]).all())
    except ValueError:
        return False


def refuse_beside_replay(given: Mapping[str, object]) -> None:
    """given: options of the bench, None: it was not given. Raises BadInput."""
    for option, value in given.items():
        if value is not None:
            raise BadInput(expected("no option of the bench beside --replay", option, "run"))


def check_procedure(log: Path, setup: Mapping[str, Any], asked: str) -> None:
    """Raises BadInput where another procedure was recorded."""
    if asked != setup["procedure"]:
        raise BadInput(expected(f"run {setup['procedure']}, as recorded", asked, log))
