"""Does the conformance suite find what is wrong? Mutants of the emulator, built and judged one after the other."""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from queue import SimpleQueue
from random import Random

from psabench.conform.requirements import requirements
from sources import digest

from tests.mutants import report
from tests.mutants.declared import ListError, Mutant, Target, load, problems
from tests.mutants.folder_tests import FolderTests
from tests.mutants.random_mutants import random_mutants
from tests.mutants.results import Book
from tests.mutants.suite import Run, Suite
from tests.mutants.tree import ROOT, BuildError, Tree
from tests.mutants.verdict import WRONG, Judge, Result

OUT = ROOT / "build" / "mutants.json"
PAGE = ROOT / "docs/reference/mutants.md"
DECLARED_RATE, RANDOM_RATE = 0.95, 0.92  # what the suite must reach; of random ones, with the tests of their folder

EPILOG = """\
Each mutant of tests/mutants/mutants.yaml is built in a private copy of the sources and judged by `psabench conform
device` on the boards that its row names. It is killed when the verdict of a requirement is worse than that of the
unmutated emulator, which must conform; an emulator that falls over and a run that does not end are counted apart.

examples (in the root of a checkout, with PYTHONPATH=tools):
  python -m tests.mutants.run                  all of the list
  python -m tests.mutants.run pik- sdo-        those whose names begin so
  python -m tests.mutants.run --check          only: does each fit its source, and compile?
  python -m tests.mutants.run --sample 8       eight of them, the same eight for one list
  python -m tests.mutants.run --random 60 --seed 7
  python -m tests.mutants.run --again survived go on with those that were not killed last time

What a run has found is in build/mutants.json as it goes on; a run that was ended is resumed by --again. Exit
status: 0 the rates are reached and nothing is wrong with the list, 1 they are not, 2 bad input or the unmutated
emulator does not conform, 130 ended by Ctrl-C.
"""


def parser() -> argparse.ArgumentParser:
    """Options."""
    p = argparse.ArgumentParser(
        prog="mutants.run", description=__doc__, epilog=EPILOG, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    p.add_argument("names", nargs="*", metavar="NAME", help="mutants, or beginnings of their names (all)")
    p.add_argument("--sample", type=int, metavar="N", help="only N of them, spread over the kinds")
    p.add_argument("--random", type=int, default=0, metavar="N", help="N random mutants instead of declared ones")
    p.add_argument("--seed", type=int, default=1, help="of the sample and of the random mutants (%(default)s)")
    p.add_argument("--check", action="store_true", help="apply and compile each, run nothing")
    p.add_argument(
        "--jobs", type=int, choices=range(1, 65), default=1, metavar="N", help="mutants at once (%(default)s)"
    )
    p.add_argument(
        "--quick",
        action="store_true",
        help="run the tests of the requirements that a mutant breaks first, and all only where those find nothing",
    )
    p.add_argument(
        "--again",
        choices=("survived", "unknown"),
        help="leave out what is in the latest file as killed (survived), or what is there at all (unknown)",
    )
    p.add_argument(
        "--relative", action="store_true", help="go on although the unmutated emulator does not conform, and compare"
    )
    p.add_argument("--out", type=Path, default=OUT, metavar="FILE", help="results (build/mutants.json)")
    p.add_argument("--docs", action="store_true", help="write the tables of docs/reference/mutants.md")
    return p


def chosen(mutants: Sequence[Mutant], names: Sequence[str]) -> list[Mutant]:
    """Those whose names begin so; all without names."""
    return [m for m in mutants if not names or m.id.startswith(tuple(names))]


def sample(mutants: Sequence[Mutant], count: int, seed: int) -> list[Mutant]:
    """Of as many kinds as there can be, those that something must find; the same for one list and seed."""
    rng = Random(seed)
    pool = [m for m in mutants if not m.reason]
    rng.shuffle(pool)
    kinds: dict[str, list[Mutant]] = {}
    for m in pool:
        kinds.setdefault(m.kind, []).append(m)
    rows = [row for turn in range(len(pool)) for row in (k[turn] for k in kinds.values() if turn < len(k))]
    return rows[:count]


def targets(mutants: Sequence[Mutant]) -> list[Target]:
    """Each once, in order of appearance."""
    return list(dict.fromkeys(t for m in mutants for t in m.on))


def check(tree: Tree, mutants: Sequence[Mutant]) -> int:
    """Exit status: whether each applies and compiles."""
    wrong = 0
    for n, m in enumerate(mutants, 1):
        try:
            with tree.mutated(m.file, m.applied((tree.folder / m.file).read_text(encoding="utf-8"))):
                print(f"{n}/{len(mutants)} {m.id}: compiles", flush=True)
        except (ListError, BuildError) as e:
            wrong += 1
            print(f"{n}/{len(mutants)} {m.id}: {e}", flush=True)
    print(f"{len(mutants) - wrong} of {len(mutants)} apply and compile")
    return 1 if wrong else 0


def told_baseline(plain: dict[Target, Run]) -> bool:
    """Whether the unmutated emulator conforms everywhere; says where it does not."""
    for target, run in plain.items():
        if run.conforms:
            continue
        bad = [i for i, v in run.verdicts.items() if v in ("failed", "inconclusive")]
        told = [w for w in run.said.splitlines() if not w.startswith("report: ")]
        detail = told[-1] if told else run.how
        print(f"unmutated {target}: {detail}" + (f"; open: {' '.join(bad)}" if bad else ""), flush=True)
    return all(run.conforms for run in plain.values())


def judged(judges: Sequence[Judge], mutants: Sequence[Mutant], keep: Callable[[Result], None]) -> None:
    """Each by the next judge that is free, with a line as it is done. What runs is ended when this is interrupted."""
    free: SimpleQueue[Judge] = SimpleQueue()
    for judge in judges:
        free.put(judge)

    def one(m: Mutant) -> Result:
        judge = free.get()
        try:
            return judge.judge(m)
        finally:
            free.put(judge)

    with ThreadPoolExecutor(len(judges)) as pool:
        try:
            for n, done in enumerate(as_completed([pool.submit(one, m) for m in mutants]), 1):
                r = done.result()
                keep(r)
                print(f"{n}/{len(mutants)} {report.line(r)}", flush=True)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            for judge in judges:
                judge.suite.stop()
            raise


def state() -> str:
    """Of the sources that are judged, and of what judges them."""
    return digest(ROOT, ("emu", "proto", "scripts/psabench/conform"), (".c", ".h", ".yaml", ".py"))[:16]


def mutants_of(args: argparse.Namespace) -> list[Mutant]:
    """Declared or random ones. Raises ListError."""
    if args.random:
        return random_mutants(ROOT, args.random, args.seed)
    rows = load()
    bad = problems(rows, ROOT, requirements().rows)
    if bad:
        raise ListError("\n".join(bad))
    found = chosen(rows, args.names)
    if not found:
        raise ListError(f"no mutant begins with {' or '.join(args.names)}")
    return sample(found, args.sample, args.seed) if args.sample else found


def carry_out(args: argparse.Namespace, mutants: list[Mutant], folder: Path) -> int:
    """Build, judge, tell."""
    tree = Tree(folder, borrow=bool(args.sample), tests=bool(args.random))
    if args.check:
        return check(tree, mutants)
    part = "random" if args.random else "declared"
    book = Book(args.out, part, mutants if args.random else load())
    todo = book.todo(mutants, args.again)
    tests = FolderTests(tree) if args.random else None
    judge = Judge(tree, Suite(folder), compare=bool(args.random), quick=args.quick, tests=tests)
    plain = judge.baseline(targets(todo))
    if not told_baseline(plain) and not args.relative:
        print("the unmutated emulator must conform first (--relative goes on)")
        return 2
    if args.random:
        judge.look(targets(todo))
        book.facts["random_seed"] = args.seed
    book.facts["state"] = state()
    book.facts["baseline"] = {str(t): {"conforms": r.conforms, "took_s": round(r.took_s, 1)} for t, r in plain.items()}
    interrupted = False
    try:
        judged([judge, *(judge.beside(folder / str(k)) for k in range(1, args.jobs))], todo, book.keep)
    except KeyboardInterrupt:
        interrupted = True
    for words in report.summary(part, book.of(mutants)):
        print(words)
    if args.docs:
        report.page(PAGE, book.parts(), book.facts)
    return 130 if interrupted else status(book.of(mutants), random=bool(args.random))


def status(results: Sequence[Result], *, random: bool) -> int:
    """Exit status for these results. A random mutant need not compile."""
    killed, of = report.rate(results)
    wrong = [r for r in results if r.result in WRONG and not (random and r.result == "does not compile")]
    return 1 if wrong or killed < (RANDOM_RATE if random else DECLARED_RATE) * of else 0


def main(argv: Sequence[str] | None = None) -> int:
    """Entry point."""
    args = parser().parse_args(argv)
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a script may have started us in the background
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # as Ctrl-C: the private copy goes
    try:
        mutants = mutants_of(args)
        with tempfile.TemporaryDirectory(prefix="mutants-") as folder:
            return carry_out(args, mutants, Path(folder) / "work")
    except (ListError, BuildError) as e:
        print(e, file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


if __name__ == "__main__":
    sys.exit(main())
