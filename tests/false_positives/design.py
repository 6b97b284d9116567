"""Which runs are made: seeds, profiles, errors of the clocks. All of it is fixed before anything is run."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from random import Random

from psabench.conform.dut import has_clock
from psabench.conform.profile import Variant, variant
from psabench.conform.requirements import requirements

SEEDS = range(1, 201)
LOAD_SEEDS = range(1, 4)
ERRORS_PPM = (-100.0, 0.0, 100.0)
DRAW = "alarms"  # beginning of the seeds of the draw itself


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One run of the suite on a conforming board. Errors: by how much the board's clocks and the probes' are fast."""

    board: str
    profile: str
    seed: int
    board_ppm: float = 0.0
    probes_ppm: float = 0.0
    load: bool = False  # in real time, with every core busy

    @property
    def error_ppm(self) -> float:
        """Of the board's clocks as the probes see them."""
        return self.board_ppm - self.probes_ppm

    @property
    def key(self) -> str:
        """In false_positives.json."""
        how = "load" if self.load else "lockstep"
        return f"{self.board} {self.profile} {self.seed} {self.board_ppm:g} {self.probes_ppm:g} {how}"

    @property
    def command(self) -> str:
        """What somebody types to have this run again."""
        if self.load:
            return f"make false-positives ARGS='--load --seeds {self.seed}-{self.seed} --anew {self.profile}'"
        words = f"psabench conform device --board {self.board} --profile {self.profile} --seed {self.seed}"
        words += f" --clock-error {self.board_ppm:g}" if self.board_ppm else ""
        return words + (f" --recorder-error {self.probes_ppm:g}" if self.probes_ppm else "")


def profiles(names: Iterable[str] = ()) -> dict[str, str]:
    """Shipped profiles to their boards; names: only these. Raises ValueError for one that there is not."""
    found = dict(requirements().profiles)
    unknown = set(names) - set(found)
    if unknown:
        raise ValueError(f"no profile {', '.join(sorted(unknown))}; there are {', '.join(found)}")
    return {p: b for p, b in found.items() if not names or p in names}


def _errors(profile: str) -> Sequence[float]:
    """Of each seed: all errors equally often, in an order of the profile's own."""
    deck = [ERRORS_PPM[k % len(ERRORS_PPM)] for k in range(len(SEEDS))]
    Random(f"{DRAW} {profile}").shuffle(deck)
    return deck


def _case(v: Variant, seed: int, error_ppm: float) -> Case:
    """The error is the board's with every other seed, where a profile can have it; else the probes'."""
    own = error_ppm != 0.0 and seed % 2 == 0 and has_clock(v, error_ppm)
    return Case(
        board=v.board,
        profile=v.profile,
        seed=seed,
        board_ppm=error_ppm if own else 0.0,
        probes_ppm=0.0 if own else 0.0 - error_ppm,
    )


def lockstep(names: Iterable[str] = (), seeds: range = SEEDS, *, full: bool = False) -> Iterator[Case]:
    """Each profile with each seed once, with the error that is drawn for it; full: with each error.

    Profiles change fastest, so that runs which are ended early have met them all.
    """
    found = [variant(board, profile) for profile, board in profiles(names).items()]
    drawn = {v.profile: _errors(v.profile) for v in found}
    for seed in seeds:
        for v in found:
            for error_ppm in ERRORS_PPM if full else (drawn[v.profile][seed - SEEDS.start],):
                yield _case(v, seed, error_ppm)


def under_load(names: Iterable[str] = (), seeds: range = LOAD_SEEDS) -> Iterator[Case]:
    """In real time; errors in turn, of the board's own clocks where a profile can have them, else none."""
    for seed in seeds:
        for n, (profile, board) in enumerate(profiles(names).items()):
            error_ppm = ERRORS_PPM[(seed + n) % len(ERRORS_PPM)]
            own = has_clock(variant(board, profile), error_ppm)
            yield Case(board=board, profile=profile, seed=seed, board_ppm=error_ppm if own else 0.0, load=True)
