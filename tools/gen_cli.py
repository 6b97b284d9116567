#!/usr/bin/env python3
"""Manual pages, and completion for bash, zsh and fish, of psabench and psa-emu, from the tables that --help prints.

Usage:
    gen_cli.py --out FOLDER   psabench.1, psabench.bash, psabench.zsh, psabench.fish, and the same of psa-emu

Needs build/psa-emu, or the one that $PSA_EMU names. `make install` puts the files where man and the shells look.
"""

from __future__ import annotations

import argparse
import os
import re
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import shtab
from cligen import tables
from cligen.man import manual

ROOT = Path(__file__).resolve().parents[1]
SHELLS = ("bash", "zsh", "fish")
ABOUT = {
    "psabench": "procedures, conformance tests and logs for converter boards on CAN",
    "psa-emu": "emulator of accelerometer converter boards on CAN",
}


def trees() -> Iterator[argparse.ArgumentParser]:
    """The two commands."""
    emulator = os.environ.get("PSA_EMU", str(ROOT / "build/psa-emu"))
    printed, listed = (
        subprocess.run([emulator, option], capture_output=True, text=True, check=True).stdout
        for option in ("--help", "--list-scenarios")
    )
    yield tables.psabench()
    yield tables.psa_emu(printed, [line.split()[0] for line in listed.splitlines()])


def files() -> Iterator[tuple[str, str]]:
    """Name and text of each file."""
    version = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]
    for top in trees():
        other = next(f"{name}(1)" for name in ABOUT if name != top.prog)
        yield f"{top.prog}.1", manual(top, ABOUT[top.prog], version, other)
        for shell in SHELLS:
            yield f"{top.prog}.{shell}", shtab.complete(top, shell)


def main() -> int:
    """Writes the files."""
    p = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    p.add_argument("--out", type=Path, required=True, metavar="FOLDER")
    out: Path = p.parse_args().out
    out.mkdir(parents=True, exist_ok=True)
    for name, text in files():
        (out / name).write_text(re.sub(r"[ \t]+$", "", text, flags=re.MULTILINE), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
