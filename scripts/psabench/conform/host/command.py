"""`psabench conform host`: does somebody's program take these boards, good and bad, as it should?"""

from __future__ import annotations

import argparse
import sys
from functools import partial

from psabench.boards.registry import ALIASES
from psabench.conform import report
from psabench.conform.defaults import LINKS
from psabench.conform.host import runner
from psabench.conform.host.check import CaseCheck, case_checks
from psabench.conform.identity import suite_facts
from psabench.conform.profile import Variant, variant
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.selection import goal_of, selection_of
from psabench.conform.verdict import Outcome, Verdict
from psabench.errors import BadInput, expected
from psabench.procedures.head_bench import Silent
from psabench.progress import Bar


def link_of(args: argparse.Namespace) -> str:
    """The place that the program takes the board at. Raises BadInput for none and for two."""
    if args.manual:
        if args.results is None:
            raise BadInput(expected("--results FILE, which the program writes to", "none", "--manual"))
        return str(args.manual)
    named = [place for place in LINKS if f"{{{place}}}" in args.command]
    if len(named) != 1:
        raise BadInput(expected(f"one of {', '.join(f'{{{p}}}' for p in LINKS)}", repr(args.command), "--command"))
    return named[0]


def handle(args: argparse.Namespace) -> int:
    """Handler of `conform host`."""
    if not 0.01 <= args.speed <= 1000:
        raise BadInput(expected("0.01 to 1000", f"{args.speed:g}", "--speed"))
    if not 0 <= args.port <= 65535:
        raise BadInput(expected("0 to 65535", args.port, "--port"))
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
        raise BadInput(expected("requirements or cases with a check (docs/conform_host.md)", "none", "--only"))
    goal = goal_of(args, rows)
    outcomes = list(unseen(rows, tests, link))
    out_of_reach = frozenset(i for o in outcomes for i in o.requirements)
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
        goal=goal,
        selection=selection_of(("--only", args.only), ("--case", args.case)),
        out_of_reach=out_of_reach,
    )
    return report.publish(args.out, told, args)


def wants_form(case: str) -> bool:
    """Whether the case is only for a host that takes other frame forms than pairs."""
    return getattr(runner.ALL[case], "form", 0) != 0


def take(outcomes: list[Outcome], outcome: Outcome, *, tell: bool) -> None:
    """Keep an outcome; tell it at once to who starts the host by hand."""
    outcomes.append(outcome)
    if tell:
        said = outcome.saw or outcome.reason
        print(f"  {outcome.verdict.value} {', '.join(outcome.requirements)}: {said}", file=sys.stderr, flush=True)


def unseen(rows: list[Requirement], tests: list[CaseCheck], link: str) -> list[Outcome]:
    """Of the requirements that no case shows at this link."""
    seen = {i for j in tests for i in j.ids}
    of_forms = {i for j in case_checks() if wants_form(j.case) and link in runner.ALL[j.case].links for i in j.ids}
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
        raise BadInput(expected(f"a board that has a case at {LINKS[link]}", v.board, "--board"))
    if v.family == "psd1" and (v["host_strobe_ns"] == 0) != (link == "bus"):
        other = "without" if link == "bus" else "with"
        raise BadInput(expected(f"a profile {other} a built-in host", v.profile, "--profile"))
