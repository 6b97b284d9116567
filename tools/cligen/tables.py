"""The command lines of psabench and psa-emu as one tree of parsers each, from the tables that --help prints."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn
from unittest.mock import patch

import shtab
from psabench.campaign.procedures import CAMPAIGNS
from psabench.cli import COMMANDS, parser
from psabench.options import Parser, report_folder
from psabench.procedures.command_line.commands import COMMANDS as PROCEDURES
from psabench.procedures.command_line.parser import SCRIPT

Parse = Callable[[Sequence[str]], argparse.Namespace]

TEXT_COLUMN = 27  # where the texts of psa-emu's options begin
OF_FILES = re.compile(r"\b(FILE|PATH|LINK|FOLDER|OUT|CONTROL)\b")  # in the form of an option's value


class _Made(Exception):
    """A parser that would have read the command line now."""

    def __init__(self, parser: argparse.ArgumentParser) -> None:
        self.parser = parser


def psabench() -> argparse.ArgumentParser:
    """With the commands, procedures and campaigns below it."""
    top = parser()
    _replace(top, {name: _parser_of(f"psabench.{module}", []) for name, (module, _) in COMMANDS.items()})
    commands = _commands_of(top)
    procedures = {name: (command.summary, [name]) for name, command in PROCEDURES.items()}
    script = _parser_of("psabench.procedures.command_line.parser", [SCRIPT]).description or ""
    _add_names(commands["run"], "run", {**procedures, SCRIPT: (script, [SCRIPT])})
    _add_names(commands["campaign"], "campaign", {name: (line, [name]) for name, (_, line) in CAMPAIGNS.items()})
    _mark_files(top)
    return top


def psa_emu(printed: str, scenarios: Sequence[str]) -> argparse.ArgumentParser:
    """printed: by psa-emu --help."""
    head, _, rest = printed.partition("\n\n  --")
    options, _, end = f"  --{rest}".partition("\n\n")
    title, _, about = head.partition("\n\n")
    what = title.partition(": ")[2]
    top = argparse.ArgumentParser(
        "psa-emu",
        usage="psa-emu [options] [SCENARIO]",
        add_help=False,
        description=f"{what[:1].upper()}{what[1:]}.\n\n{about}",
        epilog=end,
        formatter_class=argparse.RawTextHelpFormatter,
    )
    for entry in re.split(r"\n(?=  --)", options):
        _add_option(top, entry)
    scenario: Any = top.add_argument(
        "scenario", nargs="?", metavar="SCENARIO", help="YAML file, or a name of --list-scenarios"
    )
    scenario.choices = list(scenarios)
    _mark_files(top)
    return top


def _add_option(top: argparse.ArgumentParser, entry: str) -> None:
    """One of psa-emu's: `  --name FORM   text`, and more lines of text."""
    line, _, more = entry.partition("\n")
    wide = line[TEXT_COLUMN - 1 : TEXT_COLUMN] not in ("", " ")
    option, text = (line, "") if wide else (line[:TEXT_COLUMN], line[TEXT_COLUMN:])
    text = "\n".join(filter(None, (text, _text_lines(more))))
    if ", " in option:  # --help, --version
        for name in option.strip().split(", "):
            top.add_argument(name, action="store_true", help=f"print {name[2:]} and exit")
        return
    name, _, form = option.strip().partition(" ")
    if (known := top._option_string_actions.get(name)) is not None:  # another form of the option above
        known.help = f"{known.help}\n{name} {form}: {text}"
    elif not form:
        top.add_argument(name, action="store_true", help=text.replace("%", "%%"))
    else:
        words = form.split("|")
        choices = words if len(words) > 1 and all(w.isalpha() for w in words) else None
        top.add_argument(name, metavar=form, choices=choices, help=text.replace("%", "%%"))


def _text_lines(more: str) -> str:
    """Lines of text below an option; indented ones, of a table in it, stay so."""
    lines = more.splitlines()
    if all(line.startswith(" " * TEXT_COLUMN) for line in lines):
        return "\n".join(line[TEXT_COLUMN:] for line in lines)
    return "\n".join(f"  {line.removeprefix(' ' * 8)}" for line in lines)


def _parser_of(module: str, words: Sequence[str]) -> argparse.ArgumentParser:
    """The parser that a module's `parse` makes for these words."""
    read: Parse = import_module(module).parse
    try:
        with patch.object(Parser, "parse_args", _raise_made):
            read(words)
    except _Made as made:
        return made.parser
    raise ValueError(f"{module}: expected parse() to make a parser")


def _raise_made(self: Parser, *_: object) -> NoReturn:
    raise _Made(self)


def _subparsers(p: argparse.ArgumentParser) -> Any:
    return next((a for a in p._actions if isinstance(a, argparse._SubParsersAction)), None)


def _commands_of(p: argparse.ArgumentParser) -> dict[str, argparse.ArgumentParser]:
    found: dict[str, argparse.ArgumentParser] = _subparsers(p).choices
    return found


def _replace(p: argparse.ArgumentParser, made: Mapping[str, argparse.ArgumentParser]) -> None:
    """Of the commands of p, which know no options, the parsers that are loaded for them."""
    _subparsers(p).choices.update(made)


def _add_names(p: argparse.ArgumentParser, command: str, names: Mapping[str, tuple[str, list[str]]]) -> None:
    """Below p, of `psabench run` or `campaign`: name -> help line, words that load its parser."""
    below = _subparsers(p)
    if below is None:
        for group in (p._actions, p._positionals._group_actions):
            group[:] = [a for a in group if a.option_strings]
        below = p.add_subparsers(metavar="PROCEDURE")
    for name, (line, words) in names.items():
        if name not in below.choices:
            below.add_parser(name, help=line)
        below.choices[name] = _parser_of(f"psabench.{COMMANDS[command][0]}", words)


def _mark_files(p: argparse.ArgumentParser) -> None:
    """Where a value is a file, the shell completes file names."""
    for action in p._actions:
        form = action.metavar if isinstance(action.metavar, str) else ""
        if action.choices is None and (action.type in (Path, report_folder) or OF_FILES.search(form)):
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    below = _subparsers(p)
    for one in below.choices.values() if below else ():
        _mark_files(one)
