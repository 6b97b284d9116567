"""`psabench report`: its options, and what is printed."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from psabench.options import Parser
from psabench.output import add_json, show_data

EPILOG = """\
A and B are folders of reports, or files result.json or conform.json. The results are the same when all but provenance
and facts is: the first part of the table says what differs there, and does not count. U of a difference is the root of
the sum of the squares of the expanded uncertainties of A and B.

examples:
  psabench run turns --condition realistic --out build/a
  psabench run turns --condition realistic --seed 2 --out build/b
  psabench report diff build/a build/b

Exit status: 0 the same, 1 they differ, 2 one of them cannot be read.
"""


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench report`. Raises BadInput."""
    p = Parser(prog="psabench report", description="Read reports of psabench.")
    commands = p.add_subparsers(required=True, metavar="COMMAND")
    text = "compare the results of two runs"
    diff = commands.add_parser("diff", help=text, description=f"{text.capitalize()}.", epilog=EPILOG)
    diff.set_defaults(handler=_compare_reports)
    diff.add_argument("a", type=Path, metavar="A", help="folder or file of a result")
    diff.add_argument("b", type=Path, metavar="B", help="the other one")
    add_json(diff)
    return p.parse_args(words)


def _compare_reports(args: argparse.Namespace) -> int:
    from psabench.report import diff

    found = diff.compare_results(diff.read_result(args.a), diff.read_result(args.b))
    show_data(args, diff.diff_dict(found), diff.diff_lines(found))
    return 0 if found.same else 1
