"""Where the protocol's files are: the DBC and the EDS that are generated from proto/psabench.yaml.

In a checkout they lie in proto/; after `make install` in PREFIX/share/psabench/proto; $PSABENCH_PROTO overrides both.
"""

from __future__ import annotations

import os
import sys
from functools import cache
from pathlib import Path
from typing import Any

import cantools

from psabench.errors import BadInput


def proto_file(name: str) -> Path:
    """Path of a file of proto/. Raises BadInput when it is nowhere."""
    named = os.environ.get("PSABENCH_PROTO")
    checkout = Path(__file__).resolve().parents[2] / "proto"
    installed = Path(sys.prefix) / "share" / "psabench" / "proto"
    places = [Path(named)] if named else [checkout, installed]
    for place in places:
        if (place / name).is_file():
            return place / name
    raise BadInput(f"{name}: not in {' or '.join(str(p) for p in places)}; PSABENCH_PROTO names another folder")


@cache
def database() -> Any:
    """The DBC, as cantools reads it."""
    return cantools.database.load_file(str(proto_file("psabench.dbc")))


DBC_NODE = 5  # node of the identifiers in the DBC; those of node n are n - 5 higher


def message(name: str) -> Any:
    """A message of the DBC by name."""
    return database().get_message_by_name(name)
