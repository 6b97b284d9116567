"""Random numbers of the studies: each figure has a source of its own, so that one more draw shifts no other."""

from __future__ import annotations

import hashlib

import numpy as np


def draw_source(seed: int, name: str) -> np.random.Generator:
    """The source of this name: a function of seed and name, the same on every machine."""
    key = int.from_bytes(hashlib.sha256(f"{seed} {name}".encode()).digest()[:16], "little")
    return np.random.Generator(np.random.PCG64(key))
