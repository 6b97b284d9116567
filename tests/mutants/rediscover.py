"""Does `psabench explore` find mutants again, told nothing but the board? A sample of the declared list, one by one.

    PYTHONPATH=tools .venv/bin/python -m tests.mutants.rediscover --sample 30 --seed 1

Each mutant is built in a private copy of the sources; `psabench explore` runs on it until its first violation, or for
--schedules. A line a mutant, results in build/rediscover.json; it goes on with those that are not in there. Exit
status: 0 at least 90 % are found, 1 fewer, 2 the unmutated emulator violates something.
"""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.mutants.declared import Mutant, Target, load
from tests.mutants.run import sample, targets
from tests.mutants.suite import PROGRAM, Suite
from tests.mutants.tree import ROOT, Tree

OUT = ROOT / "build" / "rediscover.json"
WANTED = 0.9
TIMEOUT_S = 600.0
VIOLATED, CLEAN = 1, 0  # exit status of psabench explore


def parser() -> argparse.ArgumentParser:
    """Options."""
    p = argparse.ArgumentParser(prog="mutants.rediscover", description=__doc__)
    p.add_argument("--sample", type=int, default=30, metavar="N", help="mutants, spread over the kinds (%(default)s)")
    p.add_argument("--seed", type=int, default=1, help="of the sample and of the schedules (%(default)s)")
    p.add_argument("--schedules", type=int, default=400, metavar="N", help="for each mutant at most (%(default)s)")
    p.add_argument("--length", type=float, metavar="S", help="simulated time of each (the board's)")
    p.add_argument("--minutes", type=float, default=40.0, help="begin no further mutant after so long (%(default)g)")
    p.add_argument("--out", type=Path, default=OUT, help="results (build/rediscover.json)")
    return p


def explored(suite: Suite, emulator: Path, target: Target, args: argparse.Namespace) -> dict[str, Any]:
    """What a search says of an emulator: found (None: the search did not end), schedules that it took, its words."""
    with tempfile.TemporaryDirectory(prefix="rediscover-") as folder:
        words = ["explore", "--board", target.board, "--seed", str(args.seed), "--schedules", str(args.schedules)]
        words += ["--profile", target.profile] if target.profile else []
        words += ["--length", f"{args.length:g}"] if args.length else []
        words += ["--findings", "1", "--jobs", "1", "--out", folder]
        begun_s = time.monotonic()
        status, said = suite.python(emulator, ["-c", PROGRAM, *words], TIMEOUT_S)
    told = re.search(r"(\d+) schedules, ", said)
    found = {VIOLATED: True, CLEAN: False}.get(-1 if status is None else status)
    took_s = round(time.monotonic() - begun_s, 1)
    return {"found": found, "schedules": int(told[1]) if told else 0, "took_s": took_s, "said": said[-600:]}


def judged(tree: Tree, suite: Suite, m: Mutant, args: argparse.Namespace) -> dict[str, Any]:
    """The first of its targets that finds it, else the last."""
    text = m.applied((tree.folder / m.file).read_text(encoding="utf-8"))
    row: dict[str, Any] = {}
    with tree.mutated(m.file, text) as emulator:
        for target in m.on:
            row = {"id": m.id, "kind": m.kind, "on": str(target), **explored(suite, emulator, target, args)}
            if row["found"]:
                break
    return row


def line(row: Mapping[str, Any]) -> str:
    """For people."""
    what = {True: "found", False: "not found", None: "broken"}[row["found"]]
    key = next((w for w in str(row["said"]).splitlines() if w.startswith("found: ")), "")[:100]
    return f"{row['id']} ({row['on']}): {what} in {row['schedules']} schedules, {row['took_s']} s {key}"


def summary(rows: Sequence[Mapping[str, Any]]) -> tuple[int, int]:
    """Found, and of how many."""
    return sum(bool(r["found"]) for r in rows), len(rows)


def main() -> int:
    """Entry point."""
    args = parser().parse_args()
    mutants = sample(load(), args.sample, args.seed)
    rows = json.loads(args.out.read_text(encoding="utf-8")) if args.out.is_file() else []
    known = {r["id"] for r in rows}
    begun_s = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
        tree, suite = Tree(Path(folder) / "work", borrow=True), Suite(Path(folder) / "work")
        for target in targets(mutants):
            plain = explored(suite, tree.emulator, target, argparse.Namespace(**{**vars(args), "schedules": 20}))
            if plain["found"] is not False:
                print(f"unmutated {target}: {plain['said']}")
                return 2
        for m in mutants:
            if m.id in known or time.monotonic() - begun_s > 60.0 * args.minutes:
                continue
            rows.append(judged(tree, suite, m, args))
            args.out.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
            print(line(rows[-1]), flush=True)
    found, of = summary(rows)
    print(f"{found} of {of} found, {100.0 * found / max(1, of):.1f} %")
    return 0 if found >= WANTED * of else 1


if __name__ == "__main__":
    sys.exit(main())
