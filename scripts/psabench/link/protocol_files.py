"""The DBC that is generated from proto/psabench.yaml and proto/<board>.yaml, read once."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

import cantools

from psabench.places import proto_file


@cache
def database() -> Any:
    """The DBC, as cantools reads it."""
    return cantools.database.load_file(str(proto_file("psabench.dbc")))


HEARTBEAT_BASE = 0x700  # CiA 301, 7.3.3
NODE_BITS = 0x7F  # of an identifier that belongs to a node


def message(name: str) -> Any:
    """A message of the DBC by name."""
    return database().get_message_by_name(name)


@cache
def dbc_node(board: str) -> int:
    """Node of a board's identifiers in the DBC: its default node."""
    heartbeat = message("HEARTBEAT" if board == "psa2" else f"{board.upper()}_HEARTBEAT")
    return int(heartbeat.frame_id) - HEARTBEAT_BASE


@cache
def _names(board: str) -> dict[int, str]:
    """Names of a board's messages by the identifier they would have at node 0."""
    node = dbc_node(board)
    services = "PSA2_", "EMCY", "SDO_", "HEARTBEAT"
    mine = services if board == "psa2" else (f"{board.upper()}_",)
    return {int(m.frame_id) - node: str(m.name) for m in database().messages if m.name.startswith(mine)}


def message_name(arbitration_id: int, boards: Mapping[int, str]) -> str:
    """Name of the message that an identifier represents; boards: by node, as they are on this bus. "": none."""
    everybody_s = {int(message(name).frame_id): name for name in ("NMT", "SYNC")}
    if arbitration_id in everybody_s:
        return everybody_s[arbitration_id]
    node = arbitration_id & NODE_BITS
    return _names(boards[node]).get(arbitration_id - node, "") if node in boards else ""
