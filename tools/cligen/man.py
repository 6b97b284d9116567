"""A manual page, in groff's man macros, of a tree of parsers: options, and the commands below as subsections."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from typing import Any

HEAD = """\
.\\" Made by tools/gen_cli.py from the tables of --help.
.TH {title} 1 "" "psabench {version}" "User Commands"
.nh
.ad l
.SH NAME
{name} \\- {what}
.SH SYNOPSIS
"""


def manual(top: argparse.ArgumentParser, what: str, version: str, see: str) -> str:
    """what: for whatis; see: other pages, as `psa-emu(1)`."""
    lines = [
        HEAD.format(title=top.prog.upper(), version=version, name=escaped(top.prog), what=escaped(what)).rstrip(),
        *_preformatted(_usage(top)),
        ".SH DESCRIPTION",
        *_paragraphs(top.description or ""),
        ".SH OPTIONS",
        *_options(top),
    ]
    if commands := list(_below(top)):
        lines.append(".SH COMMANDS")
        for command in commands:
            lines += _command(command)
    lines += _ending(top.epilog or "")
    lines += [".SH SEE ALSO", re.sub(r"([\w-]+)\((\d)\)", r"\\fB\1\\fR(\2)", see).replace("-", "\\-")]
    return "\n".join(lines) + "\n"


def escaped(text: str) -> str:
    """A line of text: backslashes and dashes as printed, and no request at its beginning."""
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("`", "\\(ga")
    return f"\\&{text}" if text.startswith((".", "'")) else text.replace("'", "\\(aq")


def _command(p: argparse.ArgumentParser) -> Iterator[str]:
    yield f'.SS "{escaped(p.prog)}"'
    yield from _preformatted(_usage(p))
    yield from _paragraphs(p.description or "")
    yield from _options(p)
    yield from _paragraphs(p.epilog or "")


def _below(p: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """All commands below, the parents first."""
    for action in p._actions:
        if isinstance(action, argparse._SubParsersAction):
            for one in action.choices.values():
                yield one
                yield from _below(one)


def _usage(p: argparse.ArgumentParser) -> str:
    formatter = argparse.HelpFormatter(p.prog, width=78)
    formatter.add_usage(p.usage, p._actions, p._mutually_exclusive_groups, prefix="")
    return formatter.format_help().rstrip("\n")


def _options(p: argparse.ArgumentParser) -> Iterator[str]:
    formatter: Any = p._get_formatter()
    for action in p._actions:
        if isinstance(action, argparse._SubParsersAction) or action.help is argparse.SUPPRESS:
            continue
        yield ".TP"
        invoked = formatter._format_action_invocation(action)
        yield f"\\fB{escaped(invoked)}\\fR"
        text = formatter._expand_help(action) if action.help else ""
        # The lines of a table in the text stay lines.
        yield from (
            _preformatted(text) if re.search(r"\n +\S", text) else [escaped(x.strip()) for x in text.split("\n")]
        )


def _paragraphs(text: str) -> Iterator[str]:
    """Indented lines, examples and tables, stay lines."""
    for paragraph in re.split(r"\n{2,}", text.strip("\n")):
        lines = paragraph.split("\n")
        if not paragraph.strip():
            continue
        yield ".PP"
        if any(line.startswith("  ") for line in lines):
            yield from _preformatted(paragraph)
        else:
            yield from map(escaped, lines)


def _preformatted(text: str) -> Iterator[str]:
    yield ".nf"
    yield from map(escaped, text.split("\n"))
    yield ".fi"


def _ending(epilog: str) -> Iterator[str]:
    """Examples and exit statuses have sections of their own."""
    for paragraph in re.split(r"\n{2,}", epilog.strip("\n")):
        if paragraph.startswith("examples:"):
            yield ".SH EXAMPLES"
            yield from _preformatted(paragraph.partition("\n")[2])
        elif paragraph:
            yield ".SH EXIT STATUS" if "xit status" in paragraph else ".SH NOTES"
            yield from map(escaped, paragraph.split("\n"))
