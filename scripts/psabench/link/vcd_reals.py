"""Value Change Dump (IEEE 1364-2001, clause 18): its real-valued channels, read into arrays.

link/vcd.py reads the wires of the same file and passes these over.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from psabench.errors import expected
from psabench.link.signals import Floats
from psabench.link.vcd import Ints, read_vcd

_VAR = re.compile(r"\$var\s+real\s+64\s+(\S+)\s+(\S+)\s+\$end")


@dataclass(frozen=True, slots=True)
class Real:
    """Value (n) of a channel at t_ns (n); between two of them the file says nothing."""

    t_ns: Ints
    value: Floats

    def at(self, t_ns: int) -> float:
        """The latest value at that very instant. Raises ValueError when there is none."""
        found = np.flatnonzero(self.t_ns == t_ns)
        if not len(found):
            raise ValueError(expected(f"a value at {t_ns} ns", "none", "VCD"))
        return float(self.value[found[-1]])


def read_reals(path: Path) -> dict[str, Real]:
    """The real-valued channels of a file of the emulator, by name. Raises OSError, or ValueError for another file."""
    unit_ns = read_vcd(path).unit_ns  # every other line has been looked at with it
    head, _, body = path.read_text(encoding="ascii").partition("$enddefinitions $end\n")
    names: dict[str, str] = dict(_VAR.findall(head))
    found: dict[str, list[tuple[int, float]]] = {name: [] for name in names.values()}
    t_ns = 0
    for line in body.splitlines():
        if line.startswith("#"):
            t_ns = int(line[1:]) * unit_ns
        elif line.startswith("r"):
            value, code = line[1:].split()
            found[names[code]].append((t_ns, float(value)))
    return {
        name: Real(np.array([t for t, _ in rows], np.int64), np.array([v for _, v in rows], np.float64))
        for name, rows in found.items()
    }
