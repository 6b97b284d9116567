"""From a set-up to the errors of its runs: chains that must agree where they can all do it.

closed: jointly Gaussian means of the windows, nanoseconds a run. samples: drift and noise sample by sample, the
estimator at the end. emulated: an emulator in free pace, its bus and the host's procedure for every run; wire: the
same live, over a socket. Run k of a seed is the same each time.
"""

from __future__ import annotations

import dataclasses
import hashlib
import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from psabench.campaign import builds
from psabench.campaign.setup import Hold, Setup, as_input
from psabench.campaign.store import CELL, Origin, Part, Rows
from psabench.errors import BadInput, expected
from psabench.native import nav, nav_mc
from psabench.native.navlib import library
from psabench.procedures.result import fields_of

ERRORS = ("platform_error_deg", "heading_error_deg", "drift_error_degph", "quality")
DOUBTS = "doubts"  # how many the host's procedure has of a run; the algebra has none to tell
HELD = ("end_error_deg", "largest_error_deg")
KS_P = 0.01  # of two chains that agree, one comparison of a hundred lies below


@dataclass(frozen=True, slots=True, kw_only=True)
class Chain:
    """How runs are computed, and about how long one takes: only how work is cut depends on that."""

    name: str
    title: str
    run_s: float  # one run, one core
    part_runs: int  # of a part in the store: what an interrupt may cost
    model: Callable[..., nav_mc.Errors] | None = None  # of the algebra; None: an emulator and the host's procedure

    @property
    def emulates(self) -> bool:
        return self.model is None

    @property
    def holds(self) -> bool:
        """Whether it computes the hold."""
        return not self.emulates

    def version(self) -> str:
        return versions() if self.emulates else nav_version()

    def build(self) -> str:
        """Of what computes here: digest of its files."""
        return builds.wire() if self.emulates else builds.algebra()

    def compute(self, setup: Setup, seed: int, first_run: int, runs: int) -> Rows:
        """Errors of runs without a hold."""
        if self.model is None:
            from psabench.campaign import emulated  # the boards and cantools: the algebra does without

            return emulated.runs(emulated.platforms(self.name), setup, seed, first_run, runs)
        e = self.model(config(setup), seed, first_run=first_run, runs=runs)
        return _columns(np.degrees(e.platform_rad), np.degrees(e.heading_rad), e.drift_radps / nav.DEGPH, e.quality)


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """Runs that somebody should compute."""

    chain: str
    setup: Setup
    hold: Hold | None
    seed: int
    first_run: int
    runs: int

    @property
    def origin(self) -> Origin:
        return origin(self.chain, self.setup, self.hold, self.seed)


def origin(chain: str, setup: Setup, hold: Hold | None, seed: int) -> Origin:
    """Of the series that these determine."""
    return Origin(
        kind=f"gyrocompass{'' if hold is None else ' and hold'}, {chain}",
        input=as_input(setup, hold),
        seed=seed,
        version=CHAINS[chain].version(),
        build=CHAINS[chain].build(),
        columns=HELD if hold is not None else (*ERRORS, DOUBTS) if CHAINS[chain].emulates else ERRORS,
    )


def compute(wanted: Sequence[Wanted]) -> list[Part]:
    """The work of a worker. Raises BadInput for a set-up that its chain cannot do."""
    return [Part(origin=w.origin, first_run=w.first_run, rows=_rows(w)) for w in wanted]


def _rows(w: Wanted) -> Rows:
    try:
        return _computed(w)
    except nav.Refused as e:  # a class that does not travel between processes
        raise BadInput(f"{w.origin.kind}: {e}") from None


def reasons(w: Wanted, runs: Sequence[int]) -> Mapping[str, int]:
    """Why these runs have no heading, or one in doubt, and how many each: they are run again, the same each time."""
    from psabench.campaign import emulated

    platforms = emulated.platforms(w.chain)
    return Counter(words for k in runs for words in emulated.why(platforms, w.setup, _seed(w), k))


def _computed(w: Wanted) -> Rows:
    chain = CHAINS[w.chain]
    if w.hold is None:
        return chain.compute(w.setup, _seed(w), w.first_run, w.runs)
    if not chain.holds:
        algebra = " or ".join(c.name for c in CHAINS.values() if c.holds)
        raise BadInput(expected(f"{algebra} for a hold", w.chain, "--chain"))
    found = nav_mc.hold(hold_config(w.setup, w.hold), _seed(w), first_run=w.first_run, runs=w.runs)
    return _columns(np.degrees(found.end_rad), np.degrees(found.max_rad))


def _seed(w: Wanted) -> int:
    """Of its own for each chain: what they share then is the set-up alone, and a comparison of two means something."""
    return int.from_bytes(hashlib.sha256(f"{w.seed} {w.chain}".encode()).digest()[:7], "little")


# ---- the algebra of libpsabench-nav


# Unit at the end of a field's name, the library's in its place, and what one of the first is in the second.
_UNITS = (
    ("_degph_rts", "_radps_rts", nav.DEGPH),
    ("_degph", "_radps", nav.DEGPH),
    ("_dps", "_radps", math.radians(1.0)),
    ("_deg", "_rad", math.radians(1.0)),
    ("_arcmin", "_rad", nav.ARCMIN),
    ("_kmph", "_mps", 1.0 / 3.6),
)


def _in_si(value: Setup | Hold) -> dict[str, Any]:
    """The numbers of a set-up in the library's units, under names that end in them; the rest as it is."""
    found: dict[str, Any] = {}
    for f in dataclasses.fields(value):
        name, x = f.name, getattr(value, f.name)
        for unit, si, factor in _UNITS:
            if name.endswith(unit) and isinstance(x, int | float):
                name, x = name.removesuffix(unit) + si, x * factor
                break
        found[name] = x
    return found


def config(setup: Setup) -> nav_mc.McConfig:
    """The library's own configuration; what the estimator believes of the noise is what it is."""
    si = _in_si(setup)
    droop_rad = _droop_rad(setup)
    angle_sys_rad = 0.0 if droop_rad and setup.angle_sys == "none" else si["angle_sys_rad"]
    own = {
        "tilt": nav_mc.Tilt[setup.tilt.upper()],
        "cardan": nav_mc.Cardan[setup.gimbal.upper()],
        "alpha1_rad": si.get("alpha1_rad", math.nan),
        "drift1_radps": si["drift_radps"],
        "angle_sys_rad": angle_sys_rad + droop_rad,
        "angle_sys": nav_mc.AngleSys["COMMON" if droop_rad else setup.angle_sys.upper()],
        "angles_rad": tuple(math.radians(a) for a in setup.angles_deg),
        "settle_s": setup.settle_s + (setup.slew_dps / setup.slew_dps2 if setup.slew_dps2 else 0.0),
        "method": nav.Method[setup.method.upper()],
        "noise": nav.Noise(
            **fields_of(nav.Noise, si), angle_sd_rad=si["angle_random_rad"], level_sd_rad=si["gamma_random_rad"]
        ),
    }
    return nav_mc.McConfig(**{**fields_of(nav_mc.McConfig, si), **own})


def _droop_rad(setup: Setup) -> float:
    """What a proportional azimuth loop is off by while it works against the drift: in all positions, and seen by an
    encoder that is read."""
    if setup.m2_per_s <= 0.0 or setup.encoder or setup.angle_sys not in ("none", "common"):
        return 0.0
    return -setup.drift_degph * nav.DEGPH / setup.m2_per_s


def hold_config(setup: Setup, hold: Hold) -> nav_mc.HoldConfig:
    """The library's configuration of the hold."""
    own = {"start": config(setup), "axis2": nav_mc.Axis2[hold.axis2.upper()]}
    return nav_mc.HoldConfig(**{**fields_of(nav_mc.HoldConfig, _in_si(hold)), **own})


def _columns(*columns: nav.Floats) -> Rows:
    return np.stack(columns, axis=1).astype(CELL)


# ---- what there is


def nav_version() -> str:
    """Of what the algebra depends on."""
    return f"psabench-nav {library().version().decode()}"


def versions() -> str:
    """What two machines must have in common to compute the same."""
    return f"psabench {version('psabench')}, {nav_version()}"


CHAINS: Mapping[str, Chain] = {
    c.name: c
    for c in (
        Chain(name="closed", title="closed form", run_s=1e-7, part_runs=1 << 18, model=nav_mc.closed),
        Chain(name="samples", title="sample by sample", run_s=2e-5, part_runs=1 << 13, model=nav_mc.samples),
        Chain(name="emulated", title="emulator in free pace", run_s=0.15, part_runs=20),
        Chain(name="wire", title="live through the wire", run_s=0.7, part_runs=1),
    )
}


def describe(setup: Setup) -> dict[str, Any]:
    """Fields that differ from the article's error set, for people."""
    plain = Setup()
    names = [f.name for f in dataclasses.fields(Setup)]
    return {n: getattr(setup, n) for n in names if getattr(setup, n) != getattr(plain, n)}
