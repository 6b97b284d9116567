"""Which sources a result was got with."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Sequence
from pathlib import Path


def digest(root: Path, parts: Sequence[str], suffixes: Collection[str]) -> str:
    """SHA-256 of names and bytes of the files in those folders of root that end so, in hexadecimal."""
    h = hashlib.sha256()
    for part in parts:
        for path in sorted((root / part).rglob("*")):
            if path.is_file() and path.suffix in suffixes:
                h.update(str(path.relative_to(root)).encode() + b"\0" + path.read_bytes())
    return h.hexdigest()
