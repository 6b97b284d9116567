"""What the options of `psabench conform` and its suites share; loads no library."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

OUT = Path("build/conform")
MAX_S = 60.0  # of each file of a recording
LINKS: Mapping[str, str] = {
    "can": "socketcand",
    "pty": "slcan",
    "line": "the line port",
    "bus": "the bus port",
}  # by the place that a command names
