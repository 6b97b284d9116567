#!/usr/bin/env python3
"""compile_commands.json on standard output: `make compile_commands.json`.

Usage: compile_commands.py COMMAND FILE... [-- COMMAND FILE...]: each FILE is compiled by COMMAND -c FILE.
"""

import json
import sys
from collections.abc import Iterator, Sequence
from itertools import groupby
from pathlib import Path


def entries(words: Sequence[str]) -> Iterator[dict[str, str]]:
    """One per file."""
    for is_end, group in groupby(words, lambda word: word == "--"):
        if not is_end:
            command, *files = group
            for file in files:
                yield {"directory": str(Path.cwd()), "file": file, "command": f"{command} -c {file}"}


if __name__ == "__main__":
    print(json.dumps(list(entries(sys.argv[1:])), indent=0))
