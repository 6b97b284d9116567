"""What a command prints on stdout: lines for people or, with --json, its data for programs.

A command that prints data calls `add_json` in its parser and prints with one function of this module. JSON is one
document, of a report the document that it has stored; a command that prints while it runs prints one object a line.
Names of keys are stable and have the unit in them; a number that is not finite is null. Errors and progress stay on
stderr, and the exit status is the same as without --json. docs/tools/json.md lists what each prints.
"""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

DOCUMENT = "print JSON instead of text"
STREAM = "print one JSON object per line instead of text"
FLAG: Mapping[str, Any] = {"action": "store_true", "help": DOCUMENT}  # --json as argparse takes it
RESULT = "result.json"  # of a report's folder


def add_json(p: Any, text: str = DOCUMENT) -> None:
    """--json of a command that prints data."""
    p.add_argument("--json", **{**FLAG, "help": text})


def show_data(args: argparse.Namespace, data: object, lines: Iterable[str]) -> None:
    """The data with --json, else the lines."""
    if args.json:
        print_json(data)
    else:
        for line in lines:
            print(line)


def show_event(args: argparse.Namespace, data: object, line: str) -> None:
    """At once, of a command that runs on: a line of JSON with --json, else the line."""
    print(json_line(data) if args.json else line, flush=True)


def show_report(args: argparse.Namespace, lines: Iterable[str], write: Callable[[], Path]) -> None:
    """The lines and where the page is; with --json the result beside the page, as it is stored.

    write: writes both and returns the page, after the lines: they are seen where it cannot be stored.
    """
    if args.json:
        _print_stored(write().parent / RESULT)
        return
    for line in lines:
        print(line)
    print(f"report: {write()}")


def show_stored(args: argparse.Namespace, lines: Iterable[str], path: Path) -> None:
    """The lines; with --json a document that has just been stored, byte for byte."""
    if args.json:
        _print_stored(path)
    else:
        for line in lines:
            print(line)


def print_json(data: object) -> None:
    """One document."""
    print(json.dumps(without_nan(data), indent=1, ensure_ascii=False, allow_nan=False))


def json_line(data: object) -> str:
    """An object of a stream."""
    return json.dumps(without_nan(data), ensure_ascii=False, allow_nan=False)


def _print_stored(path: Path) -> None:
    print(path.read_text(encoding="utf-8"), end="")


def without_nan(x: Any) -> Any:
    """JSON has no NaN: null instead, which a report has there, too."""
    if isinstance(x, Mapping):
        return {k: without_nan(v) for k, v in x.items()}
    if isinstance(x, list | tuple):
        return [without_nan(v) for v in x]
    return None if isinstance(x, float) and not math.isfinite(x) else x
