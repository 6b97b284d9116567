"""Lines from a file, a pipe or the command line: plain text or JSON out, an exit status at the end.

0: all done and every expectation held; 1: an expectation did not hold; 2: a line is wrong (nothing was done if the
grammar sees it); 3: the bench rejected, or a link failed. A script ends at the first error of kind 2 or 3.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from psabench.errors import BadInput, BenchError, expected, input_error
from psabench.shell.connect import Opening
from psabench.shell.expect import Expectation
from psabench.shell.grammar import parse
from psabench.shell.lexer import Wrong
from psabench.shell.session import Outcome, Session

FAILED = 1


@dataclass(slots=True)
class Voice:
    """How results are reported. say gets one line or block; json: one object a line; echo: the lines as well."""

    say: Callable[[str], None]
    json: bool = False
    echo: bool = False

    def line(self, text: str) -> None:
        if self.echo and not self.json:
            self.say(f"> {text}")

    def outcome(self, text: str, o: Outcome) -> None:
        if self.json:
            t_s = {} if o.t_ns is None else {"t_s": o.t_ns / 1e9}
            self.say(
                json.dumps({"line": text, "ok": not o.failed, **t_s, "result": o.result}, allow_nan=False, default=str)
            )
        elif shown := o.text:
            self.say(shown)

    def error(self, text: str, e: BenchError) -> None:
        if self.json:
            self.say(json.dumps({"line": text, "ok": False, "error": {"status": e.exit_status, "text": str(e)}}))


def run_file(path: Path, opening: Opening, voice: Voice) -> int:
    """`psabench run script FILE`. Raises BadInput with file, line and column for a script that cannot be right."""
    try:
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as e:
        raise input_error(path, "a script", e) from e
    first = next((n for n, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")), 0)
    try:
        opening = opening.of_script(lines[first] if lines else "")
    except Wrong as e:
        raise _at(path, first, e) from e
    if not opening.given:
        raise BadInput(expected("a first line `start SCENARIO`, or --scenario, --control or --can", "none", path))
    if lines and lines[first].split()[:1] == ["start"]:
        lines[first] = ""
    with opening.open() as bench:
        return run_lines(Session(bench, opening.start), lines, voice, path)


def run_lines(session: Session, lines: Sequence[str], voice: Voice, path: Path | None = None) -> int:
    """Check all lines, then carry them out; the exit status, or the BenchError that ended it."""
    _check(session, lines, path)
    return run_stream(session, lines, voice, path)


def run_stream(session: Session, lines: Iterable[str], voice: Voice, path: Path | None = None) -> int:
    """Lines from a pipe, each carried out when it comes."""
    failures = 0
    for number, line in enumerate(lines):
        text = line.strip()
        if not text or text.startswith("#"):
            continue
        voice.line(text)
        try:
            outcome = session.do(line)
        except BenchError as e:
            voice.error(text, e)
            raise _at(path, number, e) from e
        if outcome is not None:
            voice.outcome(text, outcome)
            failures += bool(outcome.failed)
    return FAILED if failures else 0


def _check(session: Session, lines: Sequence[str], path: Path | None) -> None:
    for number, line in enumerate(lines):
        try:
            call = parse(line, session.vocabulary)
            if call is not None and call.command.name == "expect":
                Expectation.parse(str(call.args["check"]))
        except Wrong as e:
            raise _at(path, number, e) from e


def _at(path: Path | None, number: int, e: BenchError) -> BenchError:
    """The error with the place of its line; its exit status stays."""
    place = "" if path is None else f"{path}:{number + 1}:"
    if isinstance(e, Wrong):
        return BadInput(f"{place}{e.column}: {e}" if place else str(e))
    text = f"{place} {e}".lstrip()
    return BadInput(text) if e.exit_status == BadInput.exit_status else BenchError(text)
