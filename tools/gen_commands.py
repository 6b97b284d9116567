#!/usr/bin/env python3
"""The tables of commands in docs/emulator.md, of SCPI headers in docs/scpi.md and of keys in docs/scenarios.md, as the
emulator prints them.

Usage:
    gen_commands.py           write the text between the marks NAME:begin and NAME:end of the pages
    gen_commands.py --check   exit 1 and name the pages that are out of date

Needs build/psa-emu, or the one that $PSA_EMU names.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from between import marks, spliced

ROOT = Path(__file__).resolve().parents[1]
# page -> option that prints its tables -> their marks in the order of printing
PAGES = {
    "emulator.md": ("--list-commands", ("commands", "truth")),
    "faults.md": ("--list-faults", ("kinds", "matrix", "boards", "events")),
    "scenarios.md": ("--list-keys", ("keys",)),
    "scpi.md": ("--list-scpi", ("common", "head", "table", "chamber", "supply")),
}


def tables(option: str) -> list[str]:
    """What the emulator prints, split at its empty lines."""
    emulator = os.environ.get("PSA_EMU", str(ROOT / "build/psa-emu"))
    out = subprocess.run([emulator, option], capture_output=True, text=True, check=True).stdout
    return out.strip().split("\n\n")


def main(check: bool) -> int:
    stale = []
    for name, (option, parts) in PAGES.items():
        page = ROOT / "docs" / name
        was = text = page.read_text(encoding="utf-8")
        printed = tables(option)
        for part, table in zip(parts, printed if len(parts) > 1 else ["\n\n".join(printed)], strict=True):
            text = spliced(text, marks(part), table, name)
        if text == was:
            continue
        stale.append(f"docs/{name}")
        if not check:
            page.write_text(text, encoding="utf-8")
    if check and stale:
        print(f"gen_commands: out of date (make docs): {', '.join(stale)}")
    return int(check and bool(stale))


if __name__ == "__main__":
    try:
        sys.exit(main("--check" in sys.argv[1:]))
    except ValueError as e:
        sys.exit(f"gen_commands: {e}")
