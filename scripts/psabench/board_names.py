"""Names of the boards, and PSA-2's usual node. Loads no library: the command line is read with it."""

from __future__ import annotations

from collections.abc import Mapping

BOARDS = ("psa2", "psd1", "pmka", "pik", "gyro")
ALIASES: Mapping[str, str] = {"psa1": "psa2", "pik5": "pik", "pik6": "pik"}  # the same board, another profile
DBC_NODE = 5  # node of PSA-2's identifiers in the DBC; those of node n are n - 5 higher
