"""The DBC that is generated from proto/psabench.yaml, read once."""

from __future__ import annotations

from functools import cache
from typing import Any

import cantools

from psabench.places import proto_file


@cache
def database() -> Any:
    """The DBC, as cantools reads it."""
    return cantools.database.load_file(str(proto_file("psabench.dbc")))


DBC_NODE = 5  # node of the identifiers in the DBC; those of node n are n - 5 higher


def message(name: str) -> Any:
    """A message of the DBC by name."""
    return database().get_message_by_name(name)
