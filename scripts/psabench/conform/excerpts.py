"""What shows a failure, as files: the lines about the instant as VCD and as a picture, the frames as a candump log."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from psabench.conform.capture.log import CanFrame, Capture, LineLog
from psabench.conform.verdict import Failed
from psabench.link.own import replace_file
from psabench.report.drawing import Panel, Section, render

BEFORE_NS, AFTER_NS = 30_000, 120_000
MOST_LINES, MOST_FRAMES = 12, 200


@dataclass(frozen=True, slots=True)
class Excerpts:
    """Files of a report's folder."""

    folder: Path

    def keep(self, test: str, broken: Failed, capture: Capture | None) -> tuple[str, ...]:
        """Names of the files in the folder. Raises OSError, OutputError."""
        made: list[str] = []
        if capture is not None and capture.lines is not None and broken.at_ns is not None:
            made += self._lines(test, broken, capture.lines, round(broken.at_ns))
        frames = broken.frames[:MOST_FRAMES]
        if frames:
            made.append(self._write(f"{test}.log", candump(frames)))
        return tuple(made)

    def _lines(self, test: str, broken: Failed, lines: LineLog, at_ns: int) -> list[str]:
        rows = [n for n in broken.lines or lines.recording.wires if n in lines][:MOST_LINES]
        begin, end = max(lines.start_ns, at_ns - BEFORE_NS), min(lines.end_ns, at_ns + AFTER_NS)
        if not rows or end <= begin:
            return []
        panel = Panel(rows, [Section(begin, end, at_ns)])
        title = f"{test}: saw {broken.saw}; due {broken.due}"
        return [
            self._write(f"{test}.vcd", lines.recording.window(rows, begin, end)),
            self._write(f"{test}.svg", render(lines.recording, [panel], title)),
        ]

    def _write(self, name: str, text: str) -> str:
        self.folder.mkdir(parents=True, exist_ok=True)
        replace_file(self.folder / name, text)
        return name


def candump(frames: Sequence[CanFrame]) -> str:
    """Frames in candump's own format."""
    return "".join(f"({f.t_s:.6f}) can0 {f.can_id:03X}#{'#1' if f.fd else ''}{f.data.hex().upper()}\n" for f in frames)
