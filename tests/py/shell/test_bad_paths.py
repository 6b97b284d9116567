"""Paths, sockets and ports that cannot be used: every command of psabench, every option that takes one.

Each gives one line in the form `<where>: expected <what>, got <value>`, the exit status of docs/limits.md, and
nothing on stdout. Root may read and write everything: what may not be is shown by a folder, and by a path below a file.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import pytest
from commands import every_command
from psabench import cli
from psabench.errors import BadInput, LinkError
from psabench.options import report_folder

FORM = re.compile(r"psabench: [^\n]+: expected [^\n]+, got [^\n]+\n")
SYSTEM = re.compile(r"No such file|[Ii]s a directory|Not a directory|Errno|Permission denied|Connection refused")
INPUT, FILE, FOLDER, PORT = "input", "output file", "output folder", "port"
CASES: Mapping[str, Sequence[str]] = {  # what is put there, in the folder of the test
    INPUT: ("absent", "folder", "file/below"),
    FILE: ("absent/new", "folder", "file/below"),
    FOLDER: ("file", "file/below"),
    PORT: ("absent", "file/below"),
}
# What an option or argument names. "command name": where a command differs.
KINDS: Mapping[str, str] = {
    **dict.fromkeys(("--control", "--connect", "--truth", "--lines", "--bus-port", "--receiver", "port"), PORT),
    **dict.fromkeys(("--record", "--svg", "--wavedrom", "--results", "out"), FILE),
    **dict.fromkeys(("--out", "--dir", "--resume"), FOLDER),
    **dict.fromkeys(("decode --out", "passport export --out", "passport header --out", "record file"), FILE),
    **dict.fromkeys(("nav apply --out", "nav header --out"), FILE),
    "tap port": INPUT,  # or a recording
}
NAMED = ("--batch", "--experiment", "--flight", "--plan", "--receiver", "--schedule")  # of type str: a name, or a path
ENDINGS: Mapping[str, str] = {  # where the ending says what it is
    "record file": ".log",
    "convert file": ".log",
    "convert out": ".log",
    "decode file": ".log",
    "conform recording files": ".log",
    "panel --recording": ".log",
    "--scenario": ".yaml",
}
GIVEN: Mapping[str, str] = {  # other arguments that a command wants
    "--calibration": "calibration.json",
    "--serial": "S1",
    "--type": "unit",
    "--quantity": "q",
    "--step": "1",
    "--with-estimates": "S1",
    "--board": "psd1",
    "kind": "line",
    "serial": "S1",
}
BESIDE: Mapping[str, str] = {  # more words, for an option alone
    **dict.fromkeys((f"run {name} --record" for name in ("turns", "fourier", "reversal")), "--condition quiet"),
    **dict.fromkeys((f"run {name} --record" for name in ("gyrocompass", "heading-hold")), "--reading article"),
    "campaign gyrocompass --scenario": "--chain emulated",
    "decode --store": "--passport S1",
    "record file": "--can virtual:bad_paths",
    "run sins-calibration-secondary --scenario": "--latitude-deg 50 --longitude-deg 30",
    "waveform --dir": "--decoders",
}
LATE: Mapping[str, str] = {  # what is not opened at once, by its name alone or with its command, and why
    "--truth": "beside --control, whose emulator is asked first",
    "campaign gyrocompass --store": "made where there is none",
    "campaign run-in --store": "made where there is none",
    "run koi-season --store": "made where there is none",
    "conform host --results": "when the first host starts",
    "koi replay folders": "after the passport of --with-estimates",
    "nav apply recording": "after --calibration",
    "nav apply --layout": "after --calibration",
    "nav apply --out": "after --calibration",
    "nav header --out": "after CALIBRATION",
    "passport add --store": "after RESULT",
    "passport export --out": "after --store",
    "passport header --out": "after --store",
    "report diff b": "after the first result",
    "run all --record": "never: of one procedure alone",
    "run sins-calibration --layout": "after --data",
    "run sins-calibration --angles": "after --data",
    "run sins-calibration-secondary --plan": "after --first",
    "run sins-calibration-secondary --second": "after --first",
    "waveform --wavedrom": "after FILE",
    "waveform --svg": "after FILE",
    "conform device --lines": "beside --can, whose board is asked first",
    "conform device --bus-port": "beside --can, whose board is asked first",
    "conform device --control": "beside --can, whose board is asked first",
    "run sins-calibration-secondary --control": "beside --can",
}
ON_STDOUT = ("run sins-calibration",)  # commands that print what their plan can give, before anything is opened


def _name(action: argparse.Action) -> str:
    return action.option_strings[-1] if action.option_strings else action.dest


def _is_path(action: argparse.Action) -> bool:
    return action.type in (Path, report_folder) or _name(action) in NAMED


def _kind(command: str, name: str) -> str:
    return KINDS.get(f"{command} {name}", KINDS.get(name, INPUT))


def _words(command: str, parser: argparse.ArgumentParser, tried: argparse.Action, value: str) -> list[str]:
    """The command line: the argument that is tried with this value, others that the command wants as they should be."""
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


def _lines() -> Iterator[tuple[list[str], str, str]]:
    """The command line, the value that is tried, its kind."""
    for command, parser in every_command().items():
        for action in (a for a in parser._actions if _is_path(a)):
            name = _name(action)
            at = f"{command} {name}"
            for case in () if {at, name} & set(LATE) else CASES[_kind(command, name)]:
                ending = ENDINGS.get(at, ENDINGS.get(name, ""))
                value = f"{case}{ending}"
                yield _words(command, parser, action, value), value, _kind(command, name)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the commands run: a regular file and a folder of each ending."""
    for ending in ("", *ENDINGS.values()):
        (tmp_path / f"folder{ending}").mkdir(exist_ok=True)
        (tmp_path / f"file{ending}").write_text("precious\n")
    (tmp_path / "file.log").write_text("".join(f"(0.100000) can0 {i}#0000000000000000\n" for i in (185, 185, 186)))
    (tmp_path / "calibration.json").write_text("{}\n")
    monkeypatch.chdir(tmp_path)
    return tmp_path


LINES = list(_lines())


@pytest.mark.parametrize(("words", "value", "kind"), LINES, ids=[" ".join(words) for words, _, _ in LINES])
def test_a_path_that_cannot_be_used_is_one_line_in_the_form(
    words: list[str], value: str, kind: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    status = cli.main(words)
    out, err = capsys.readouterr()
    assert FORM.fullmatch(err), err
    assert not SYSTEM.search(err), err
    assert value in err
    assert status == (LinkError if kind == PORT else BadInput).exit_status
    assert out == "" or " ".join(words).startswith(ON_STDOUT)
    assert (folder / "file").read_text() == "precious\n"
