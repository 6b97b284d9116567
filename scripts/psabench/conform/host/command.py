"""`psabench conform host`: does somebody's program take these boards, good and bad, as it should?"""

from __future__ import annotations

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any

from psabench.conform import report
from psabench.conform.host import runner
from psabench.conform.host.judge import Judged, judged
from psabench.conform.identity import suite_facts
from psabench.conform.outcome import Outcome, Verdict
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.variant import Variant, variant
from psabench.devices import ALIASES
from psabench.errors import BadInput
from psabench.procedures.head_bench import Silent
from psabench.progress import Bar

OUT = Path("build/conform/host")
LINKS = {
    "can": "socketcand",
    "pty": "slcan",
    "line": "the line port",
    "bus": "the bus port",
}  # by the place that a command names

EPILOG = """\
The program is started once for each case, as soon as its board is powered; it ends when its link ends. In COMMAND
  {can}      127.0.0.1:PORT of a socketcand server          {node}     CANopen node of the board
  {form}     frame form to ask for, for hosts that take 1, too
  {pty}      pseudo-terminal of an slcan adapter            {results}  file to tell into (without it: standard output)
  {line}     pseudo-terminal of the lines, a byte a sample; {word_bits}, {code_bits}: of its words and codes
  {bus}      pseudo-terminal of a bus port: PSD-1, PIK
and it tells what it takes in JSON (docs/conform_host.md): {"frame": 7, "x": ...}, {"lost": 2}, {"stale": true}.

examples:
  psabench conform host --command "build/host {can} {node}"
  psabench conform host --command "build/host_line {line}" --only HOST-TORN
  psabench conform host --board pik --command ".venv/bin/python examples/vins_boards.py pik socketcand:{can} {node}"
  psabench conform host --manual can --results build/told.jsonl     start it by hand, case by case

OUT has report.html, junit.xml and conform.json, and of each case what was on the bus and what was told.
Exit status: 0 conforms, 1 does not, 2 bad input, 3 the bench failed, 130 ended by Ctrl-C.
"""


def add(suites: Any, formatter: Any) -> None:
    """The sub-command."""
    p = suites.add_parser(
        "host",
        help="a program that takes a board's data",
        description="Play good and bad boards to a program and judge what it tells.",
        formatter_class=formatter,
        epilog=EPILOG.replace("%", "%%"),
    )
    p.set_defaults(handler=host)
    how = p.add_mutually_exclusive_group(required=True)
    how.add_argument("--command", metavar="COMMAND", help="how the program is started, with {can}, {pty} or {line}")
    how.add_argument("--manual", choices=list(LINKS), help="it is started by hand when we say so, at this link")
    p.add_argument("--results", type=Path, metavar="FILE", help="with --manual: the file that the program tells into")
    p.add_argument("--port", type=int, default=29536, help="with --manual can: of socketcand, each time (%(default)s)")
    p.add_argument(
        "--board", default="psa2", help="that is played: psa2, psa1, psd1, pmka, pik, pik5, pik6 (%(default)s)"
    )
    p.add_argument("--profile", help="of the board (article for psa2, else of its own name)")
    p.add_argument("--only", nargs="+", default=[], metavar="ID", help="requirements, or beginnings: HOST-LOST")
    p.add_argument("--case", nargs="+", default=[], metavar="NAME", help="these cases alone (docs/conform_host.md)")
    p.add_argument("--speed", type=float, default=1.0, metavar="X", help="times real time, while nothing is silent")
    p.add_argument("--out", type=Path, default=OUT, metavar="FOLDER", help="for the report (%(default)s)")
    p.add_argument("--verbose", action="store_true", help="tell what passed, too")


def link_of(args: argparse.Namespace) -> str:
    """The place that the program takes the board at. Raises BadInput for none and for two."""
    if args.manual:
        if args.results is None:
            raise BadInput("--manual wants --results FILE, the file that the program tells into")
        return str(args.manual)
    named = [place for place in LINKS if f"{{{place}}}" in args.command]
    if len(named) != 1:
        raise BadInput(
            f"--command {args.command}: one of {', '.join(f'{{{p}}}' for p in LINKS)} says where the board is"
        )
    return named[0]


def host(args: argparse.Namespace) -> int:
    """Handler of `conform host`."""
    if not 0.01 <= args.speed <= 1000:
        raise BadInput(f"--speed {args.speed:g}: from 0.01 to 1000")
    if not 0 <= args.port <= 65535:
        raise BadInput(f"--port {args.port}: from 0 to 65535")
    link = link_of(args)
    v = variant(args.board, args.profile)
    refuse(v, link)
    tests = runner.wanted(args.only, args.case, v.board, link)
    if args.command and "{form}" not in args.command:
        tests = [j for j in tests if not wants_form(j.case)]
    rows = [r for r in requirements() if r.group == "host" and r.applies(v.board, v.profile)]
    rows = [r for r in rows if not args.only or r.id.startswith(tuple(args.only))]
    rows = [r for r in rows if not args.case or any(r.id in j.ids for j in tests)]
    if not rows:
        raise BadInput("--only, --case: nothing to judge; docs/conform_host.md has the cases")
    outcomes = list(unseen(rows, tests, link))
    play = runner.Play(
        folder=args.out,
        board=v.family if v.board in ALIASES else v.board,
        profile=v.profile,
        command=args.command or "",
        results=args.results,
        link=link,
        speed=args.speed,
        say=lambda words: print(words, file=sys.stderr, flush=True),
        port=args.port if args.manual else 0,
        terminal=sys.stdin if args.manual and sys.stdin.isatty() else None,
    )
    interrupted = False
    try:
        runner.run(play, tests, Silent() if args.manual else Bar(), partial(take, outcomes, tell=bool(args.manual)))
    except KeyboardInterrupt:
        interrupted = True
    told = report.Run(
        suite="host",
        subject=args.command or f"host at {link}",
        facts={"board": v.name, "link": LINKS[link], **suite_facts()},
        outcomes=outcomes,
        rows=rows,
        interrupted=interrupted,
    )
    page = report.write(args.out, told)
    for line in report.lines(told, everything=args.verbose):
        print(line)
    print(f"report: {page}", file=sys.stderr)
    return 130 if interrupted else 0 if told.conforms else 1


def wants_form(case: str) -> bool:
    """Whether the case is only for a host that takes other frame forms than pairs."""
    return getattr(runner.ALL[case], "form", 0) != 0


def take(outcomes: list[Outcome], outcome: Outcome, *, tell: bool) -> None:
    """Keep an outcome; tell it at once to who starts the host by hand."""
    outcomes.append(outcome)
    if tell:
        said = outcome.saw or outcome.reason
        print(f"  {outcome.verdict.value} {', '.join(outcome.requirements)}: {said}", file=sys.stderr, flush=True)


def unseen(rows: list[Requirement], tests: list[Judged], link: str) -> list[Outcome]:
    """Of the requirements that no case shows at this link."""
    seen = {i for j in tests for i in j.ids}
    of_forms = {i for j in judged() if wants_form(j.case) and link in runner.ALL[j.case].links for i in j.ids}
    return [
        Outcome(
            test="not_played",
            title="What this link does not show.",
            requirements=(r.id,),
            verdict=Verdict.NOT_OBSERVABLE,
            reason="COMMAND has no {form}" if r.id in of_forms else f"no case plays it at {LINKS[link]}",
        )
        for r in rows
        if r.id not in seen
    ]


def refuse(v: Variant, link: str) -> None:
    """Raises BadInput for a board that has no such link, or none that a host could take words at."""
    if not any(v.board in c.boards and link in c.links for c in runner.ALL.values()):
        raise BadInput(f"no case with {v.board} at {LINKS[link]}")
    if v.family == "psd1" and (v["host_strobe_ns"] == 0) != (link == "bus"):
        raise BadInput(
            f"profile {v.profile}: its words wait for a host on the bus, {{bus}}"
            if link != "bus"
            else f"profile {v.profile} has a built-in host that takes each word: --profile psd1_host has none"
        )
