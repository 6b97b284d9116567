"""A snapshot's input log as a scenario: what a host sent and commanded becomes a timeline, and no host is needed.

    psa-emu script.yaml --pace free --for 1s --can log:bus.log --vcd lines.vcd

The format of a snapshot is that of docs/snapshots.md. Pure.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from psabench.errors import BadInput, expected

NS = 1e9
MOST = 128  # entries of a timeline


def script_of(snapshot: str) -> dict[str, Any] | None:
    """The scenario of a snapshot with its inputs as a timeline; None where a timeline cannot have them: they are too
    many, or cycles of a bus port.

    Raises BadInput for a text that is no snapshot.
    """
    try:
        head, scenario, *entries = [json.loads(line) for line in snapshot.splitlines()]
        if head["psabench"] != "snapshot":
            raise ValueError(expected("snapshot", head["psabench"]))
        buses = [b["name"] for b in scenario["buses"]]
        timeline = [*(scenario.get("timeline") or []), *(t for e in entries for t in _timed_entries(e, buses))]
    except (ValueError, KeyError, TypeError) as e:
        raise BadInput(expected("a snapshot", f"{type(e).__name__}: {e}", "explore")) from e
    if len(timeline) > MOST or any("cycle" in e for e in entries):
        return None
    return {**scenario, "timeline": timeline}


def length_s(snapshot: str) -> float:
    """Simulated time at its end, s."""
    ends = [row["end"] for row in map(json.loads, snapshot.splitlines()) if "end" in row]
    return float(ends[-1]) / NS


def _timed_entries(entry: dict[str, Any], buses: list[str]) -> Iterator[dict[str, Any]]:
    """An entry of the input log as entries of a timeline; none for what changes nothing on the wires."""
    if entry.get("refused"):
        return
    if "frame" in entry:
        args = {"frame": entry["frame"], "bus": buses[entry["bus"]]}
        yield {"at_s": entry["t"] / NS, "cmd": "can.put", "args": args}
    elif "cmd" in entry:
        yield {"at_s": entry["t"] / NS, "cmd": entry["cmd"], "args": entry.get("args", {})}
