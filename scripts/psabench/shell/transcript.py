"""What was said in a session, as a script that does it again at the same simulated instants."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

HEADER = "# A session of psabench shell. Again: psabench run script FILE"


@dataclass(frozen=True, slots=True)
class Said:
    """A line; t_ns: simulated time when it was given, None where no one tells it; wrong: why it was rejected."""

    line: str
    t_ns: int | None
    wrong: str = ""


@dataclass(slots=True)
class Transcript:
    """start: the `start` line that brings up the same bench; "": the script is given where its bench is."""

    start: str
    lockstep: bool  # time moves only when a line says so: no instants need to be written down
    said: list[Said] = field(default_factory=list)

    def add(self, line: str, t_ns: int | None, wrong: str = "") -> None:
        self.said.append(Said(line, t_ns, wrong))

    def copy(self) -> Transcript:
        """As far as it is now."""
        return Transcript(self.start, self.lockstep, list(self.said))

    def script(self, end_ns: int | None = None) -> str:
        """The session as a script, to end_ns. What was rejected is in comments."""
        lines = [HEADER, *([self.start] if self.start else [])]
        for said in self.said:
            if said.wrong:
                lines.append(f"# {' '.join(said.line.split())}   error: {' '.join(said.wrong.split())}")
                continue
            if not self.lockstep and said.t_ns is not None and not said.line.startswith("at "):
                lines.append(f"at {seconds(said.t_ns)}")
            lines.append(said.line)
        if not self.lockstep and end_ns is not None:
            lines.append(f"at {seconds(end_ns)}")
        return "\n".join(_without_repeats(lines)) + "\n"


def seconds(t_ns: int) -> str:
    """Exact to the nanosecond, without zeros at the end."""
    text = f"{t_ns // 10**9}.{t_ns % 10**9:09d}".rstrip("0")
    return text + "0" if text.endswith(".") else text


def _without_repeats(lines: Sequence[str]) -> list[str]:
    """`at` lines that follow one of the same instant say nothing."""
    kept: list[str] = []
    at = ""
    for line in lines:
        if line.startswith("at "):
            if line == at:
                continue
            at = line
        kept.append(line)
    return kept
