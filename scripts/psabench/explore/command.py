"""`psabench explore`: options, progress, and what is printed."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

from psabench.boards.registry import BOARDS, NAMES
from psabench.options import Parser, natural, positive, report_folder
from psabench.output import STREAM, add_json, show_event

if TYPE_CHECKING:
    from psabench.explore.finding import Finding
    from psabench.explore.search import Tally

ABOUT = """\
Play random schedules of faults and host behaviours on an emulated board, and check the requirements in each.
"""
EPILOG = """\
examples:
  psabench explore --board psa2                          1000 schedules; findings in build/explore/psa2-article
  psabench explore --board psa2 --hours 8 --seed 7       as many as eight hours allow
  psabench explore --replay build/explore/psa2-article/KEY/schedule.json

A schedule takes at most --length of simulated time. A violation is shrunk to the shortest schedule that shows it; its
folder has the schedule, a snapshot, and a scenario for psa-emu alone (docs/tools/explore.md). The same command goes on
where it was ended.

Exit status: 0 no violation, 1 a violation, 2 bad input, 3 the bench failed, 130 ended by Ctrl-C.
"""
OUT = Path("build/explore")
SCHEDULES = 1000
ALONE = 100  # schedules: starting processes takes as long
KEPT = "schedules that are done are kept; the same command goes on"


def parse(words: Sequence[str]) -> argparse.Namespace:
    """What follows `psabench explore`. Raises BadInput."""
    p = Parser(prog="psabench explore", description=ABOUT, epilog=EPILOG)
    p.set_defaults(handler=_handle_command, kept=KEPT)
    p.add_argument("--board", default="psa2", help=f"board: {', '.join(NAMES)} (%(default)s)")
    p.add_argument("--profile", help="profile of the board (psa-emu --list-profiles)")
    p.add_argument("--seed", type=natural, default=1, help="random seed of the schedules (%(default)s)")
    p.add_argument("--schedules", type=natural, metavar="N", help=f"schedules to play ({SCHEDULES})")
    p.add_argument("--hours", type=positive, metavar="H", help="play for so long instead; 0.1: six minutes")
    lengths = ", ".join(f"{name} {board.schedule_s:g}" for name, board in BOARDS.items())
    p.add_argument("--length", type=positive, metavar="S", help=f"simulated time of a schedule at most ({lengths})")
    p.add_argument("--findings", type=natural, metavar="N", help="end after N different violations")
    p.add_argument("--jobs", type=natural, metavar="N", help="processes (one per core for many schedules)")
    p.add_argument("--out", type=report_folder, metavar="FOLDER", help=f"folder of the findings ({OUT}/BOARD-PROFILE)")
    p.add_argument("--fresh", action="store_true", help="play again what is done")
    p.add_argument("--replay", type=Path, metavar="FILE", help="play one schedule from its file")
    add_json(p, STREAM)
    return p.parse_args(words)


def _handle_command(args: argparse.Namespace) -> int:
    return _replay_schedule(args) if args.replay else _explore_board(args)


def _replay_schedule(args: argparse.Namespace) -> int:
    from psabench.explore.finding import replay_file

    played = replay_file(args.replay)
    for v in played.violations:
        show_event(args, {"event": "violation", **asdict(v)}, v.words())
    counts = {"actions": played.actions, "simulated_s": played.time_s, "violations": len(played.violations)}
    line = "{actions} actions, {simulated_s:.6f} s simulated, {violations} violations".format(**counts)
    show_event(args, {"event": "end", "file": str(args.replay), **counts}, f"{args.replay}: {line}")
    return 1 if played.violations else 0


def _explore_board(args: argparse.Namespace) -> int:
    from psabench.campaign.workers import workers
    from psabench.conform.profile import variant
    from psabench.explore.search import DONE, Search, run_search

    v = variant(args.board, args.profile)
    length_s = args.length or BOARDS[v.family].schedule_s
    search = Search(board=v.board, profile=v.profile, seed=args.seed, length_s=length_s)
    count = args.schedules if args.schedules is not None else None if args.hours else SCHEDULES
    jobs = args.jobs if args.jobs is not None or count is None or count > ALONE else 1
    out = args.out or OUT / f"{v.board}-{v.profile}"
    if args.fresh:
        (out / DONE).unlink(missing_ok=True)
    shown = Shown(args, v.name, count)
    for_s = None if args.hours is None else 3600.0 * args.hours
    with workers(jobs) as at_work:
        tally = run_search(search, out, at_work, count=count, for_s=for_s, most=args.findings, told=shown.tell)
    shown.close()
    counts = {"schedules": tally.schedules, "simulated_s": tally.simulated_s, "violations": tally.times}
    show_event(args, {"event": "end", "board": v.name, **counts}, shown.summary(tally))
    return 1 if tally.times else 0


def _finding_dict(f: Finding) -> dict[str, Any]:
    """A finding as a line of JSON."""
    counts = {"actions": len(f.schedule.actions), "of_actions": f.of}
    return {"event": "found", **asdict(f.violation), **counts, "schedule": str(f.folder / "schedule.json")}


class Shown:
    """Progress on stderr, findings on stdout."""

    def __init__(self, args: argparse.Namespace, name: str, count: int | None) -> None:
        self._args, self._name, self._count = args, name, count
        self._live = sys.stderr.isatty()

    def tell(self, tally: Tally, finding: Finding | None) -> None:
        """As `search.run_search` tells."""
        if finding is not None:
            self.close()
            show_event(self._args, _finding_dict(finding), f"found: {finding.words()}")
        elif self._live:
            of = "" if self._count is None else f" of {self._count}"
            print(f"\r{self._name}: {tally.schedules}{of}, {len(tally.times)} found \x1b[K", end="", file=sys.stderr)

    def close(self) -> None:
        """The line of progress goes."""
        if self._live:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    def summary(self, tally: Tally) -> str:
        """What came of the search, with what it had done before."""
        found = ", ".join(f"{key} ({times})" for key, times in sorted(tally.times.items())) or "no violation"
        return f"{self._name}: {tally.schedules} schedules, {tally.simulated_s:.1f} s simulated: {found}"
