"""Paths, sockets and ports that cannot be used: every command of psabench, every option that takes one.

Each gives one line in the form `<where>: expected <what>, got <value>`, the exit status of docs/limits.md, and nothing on
stdout. Root may read and write everything: what may not be is shown by a folder, and by a path below a regular file.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest
from psabench import cli
from psabench.errors import BadInput, LinkError

from tests.py.support.commands import every_command

FORM = re.compile(r"psabench: [^\n]+: expected [^\n]+, got [^\n]+\n")
SYSTEM = re.compile(r"No such file|[Ii]s a directory|Not a directory|Errno|Permission denied|Connection refused")
INPUT, FILE, FOLDER, PORT = "input", "output file", "output folder", "port"
CASES: Mapping[str, Sequence[str]] = {  # what is put there, in the folder of the test
    INPUT: ("none", "folder", "file/below"),
    FILE: ("none/new", "folder", "file/below"),
    FOLDER: ("file", "file/below"),
    PORT: ("none", "file/below"),
}
# What an option or argument names. "command name": where a command differs.
KINDS: Mapping[str, str] = {
    **dict.fromkeys(("--control", "--connect", "--truth", "--lines", "--bus-port", "--receiver", "port"), PORT),
    **dict.fromkeys(("--record", "--svg", "--wavedrom", "--results", "out"), FILE),
    **dict.fromkeys(("--out", "--dir", "--resume"), FOLDER),
    **dict.fromkeys(("decode --out", "passport export --out", "passport header --out", "record file"), FILE),
    **dict.fromkeys(("nav apply --out", "nav header --out"), FILE),
}
NAMED = ("--batch", "--experiment", "--flight", "--plan", "--receiver", "--schedule")  # of type str: a name, or a path
ENDINGS: Mapping[str, str] = {  # where the ending says what it is
    "record file": ".log",
    "convert file": ".log",
    "convert out": ".log",
    "decode file": ".log",
    "conform recording files": ".log",
    "panel --recording": ".log",
}
GIVEN: Mapping[str, str] = {  # other arguments that a command wants
    "--calibration": "calibration.json",
    "--serial": "S1",
    "--type": "unit",
    "--quantity": "q",
    "--with-estimates": "S1",
    "kind": "can",
    "serial": "S1",
}
BESIDE: Mapping[str, str] = {  # more words, for an option alone
    "run turns --record": "--condition quiet",
}
LATE: Mapping[str, str] = {  # what is opened when the work is done, or not in this process; proved elsewhere
}


def _name(action: argparse.Action) -> str:
    return action.option_strings[-1] if action.option_strings else action.dest


def _is_path(action: argparse.Action) -> bool:
    return action.type is Path or _name(action) in NAMED


def _kind(command: str, name: str) -> str:
    return KINDS.get(f"{command} {name}", KINDS.get(name, INPUT))


def _others(command: str, parser: argparse.ArgumentParser, tried: argparse.Action, value: str) -> list[str]:
    """The command line: the argument that is tried with this value, the others that the command wants as they should be."""
    words = command.split()
    options: list[str] = []
    for a in parser._actions:
        name = _name(a)
        wanted = a.required or (not a.option_strings and a.nargs != "?")
        if not (a is tried or wanted) or isinstance(a, argparse._HelpAction):
            continue
        text = value if a is tried else GIVEN.get(name, f"file{ENDINGS.get(f'{command} {name}', '')}")
        if a.option_strings:
            options += [name, text]
        else:
            words.append(text)
    return words + options + BESIDE.get(f"{command} {_name(tried)}", "").split()


def _lines() -> Iterator[tuple[str, list[str], str]]:
    """Command and option, words, kind."""
    for command, parser in every_command().items():
        for action in (a for a in parser._actions if _is_path(a)):
            name = _name(action)
            at = f"{command} {name}"
            for case in CASES[_kind(command, name)] if at not in LATE else ():
                ending = ENDINGS.get(at, "")
                yield at, _others(command, parser, action, f"{case}{ending}"), _kind(command, name)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the commands run: a regular file and a folder of each ending."""
    for ending in ("", *ENDINGS.values()):
        (tmp_path / f"folder{ending}").mkdir(exist_ok=True)
        (tmp_path / f"file{ending}").write_text("precious\n")
    (tmp_path / "calibration.json").write_text("{}\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


LINES = list(_lines())


@pytest.mark.parametrize(("at", "words", "kind"), LINES, ids=[" ".join(words) for _, words, _ in LINES])
def test_a_path_that_cannot_be_used_is_one_line_in_the_form(
    at: str, words: list[str], kind: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = cli.main(words)
    out, err = capsys.readouterr()
    assert FORM.fullmatch(err), err
    assert not SYSTEM.search(err), err
    assert status == (LinkError if kind == PORT else BadInput).exit_status
    assert out == ""
    assert (folder / "file").read_text() == "precious\n"
