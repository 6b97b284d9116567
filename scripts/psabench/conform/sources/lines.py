"""Lines of each board by the names that recordings of all pins have, and whose channel of a recording each is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from psabench.boards.registry import BOARDS
from psabench.conform.capture.log import LineLog
from psabench.conform.sources.taken import LineTake
from psabench.conform.verdict import conclusive
from psabench.errors import BadInput, expected
from psabench.link.vcd import Vcd, Wire

LINES: Mapping[str, Sequence[str]] = {name: board.lines + board.wires for name, board in BOARDS.items()}


class Recorded(LineLog):
    """Lines of a recording: what no one recorded is not absent, and nothing is said about it."""

    def __contains__(self, name: str) -> bool:
        conclusive(super().__contains__(name), f"the recording has no line {name}")
        return True

    def __getitem__(self, name: str) -> Wire:
        conclusive(name in self.recording.wires, f"the recording has no line {name}")
        return self.recording.wires[name]


def log_of(take: LineTake, family: str, told: Mapping[str, str], where: str) -> Recorded:
    """The board's lines among the channels of a take; told: channel of each line, where the user says it.

    Where he says any, those are all. Raises BadInput for a line or a channel that there is not.
    """
    chosen = _told(take, family, told, where) if told else _by_name(take, family)
    if not chosen:
        raise BadInput(expected("channels named as lines, or --line LINE=CHANNEL", ", ".join(take.channels), where))
    wires = {line: take.channels[channel] for line, channel in chosen.items()}
    return Recorded(
        recording=Vcd(1, take.start_ns, take.end_ns, wires), resolution_ns=take.resolution_ns, gaps_ns=take.gaps_ns
    )


def _by_name(take: LineTake, family: str) -> dict[str, str]:
    """As it is written or, failing that, in other capitals."""
    lower = {c.lower(): c for c in reversed(list(take.channels))}
    found = {line: line if line in take.channels else lower.get(line.lower(), "") for line in LINES[family]}
    return {line: channel for line, channel in found.items() if channel}


def _told(take: LineTake, family: str, told: Mapping[str, str], where: str) -> dict[str, str]:
    lines = {line.lower(): line for line in LINES[family]}
    found = {}
    for name, channel in told.items():
        if name.lower() not in lines:
            raise BadInput(expected(" ".join(LINES[family]), name, f"--line {name}={channel}"))
        if channel not in take.channels:
            raise BadInput(expected(" ".join(take.channels), channel, f"--line {name}={channel}"))
        found[lines[name.lower()]] = channel
    return found
