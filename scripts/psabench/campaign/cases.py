"""The studies of a campaign of gyrocompassing: which set-ups are computed, and what a reader sees beside them.

A study is a list of cases; a case is a set-up through a chain, so many runs of it. The article's sentence, one by one
(readings), one source of error at a time, scans, and the hold. What must come out is in `claims`.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import KW_ONLY, dataclass, replace

from psabench.campaign.setup import BEFORE_S, Hold, Setup, level_white_degph_rts

QUIET = {  # no error at all; a study of single sources adds one
    "latitude_error_arcmin": 0.0,
    "gm_sigma_degph": 0.0,
    "beta_sys_arcmin": 0.0,
    "gamma_sys_arcmin": 0.0,
    "beta_random_arcmin": 0.0,
    "gamma_random_arcmin": 0.0,
    "angle_sys_arcmin": 0.0,
    "angle_random_arcmin": 0.0,
    "simplified": False,
}
# The readings of the article's random drift and of its 6', each under one name on every page (docs/procedures). White
# noise drawn each 10 ms without 1/sqrt(dt), in a filter that starts at rest, makes SMALL_GM of 0.2 deg/h.
NOT_COUNTED = {"angle_sys": "none"}  # the 6'
FROM_ZERO = {"gm_from_zero": True}  # else stationary: as large at the first window as ever
SMALL_GM = {"gm_sigma_degph": 0.02, **FROM_ZERO}
SMALL_STATIONARY = {"gm_sigma_degph": 0.02}
ARTICLE = {**SMALL_GM, **NOT_COUNTED}  # R5n: the reading in which the article's figures hold
ARTICLE_STATIONARY = {**SMALL_STATIONARY, **NOT_COUNTED}  # R5ns
ENCODER = {  # read, instead of the set angle trusted
    "encoder": True,
    **NOT_COUNTED,
    "angle_random_arcmin": 0.5,
    "simplified": False,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A set-up with what the report calls it; `x` is where it is on the axis of a scan."""

    study: str
    name: str
    title: str
    setup: Setup
    hold: Hold | None = None
    curve: str = ""
    x: float = 0.0


@dataclass(frozen=True, slots=True)
class Study:
    """Cases that belong together; `axis` is the scan's, empty for a table."""

    name: str
    title: str
    _: KW_ONLY
    cases: Callable[[Setup], Iterator[Case]]
    axis: str = ""
    figure: str = "p95"  # on the vertical axis: p95 or sd of the platform's error
    log_y: bool = False


def _readings(base: Setup) -> Iterator[Case]:
    averaged: dict[str, object] = {"per_sample": True}
    uncorrected: dict[str, object] = {"gimbal": "uncorrected"}
    corrected: dict[str, object] = {"gimbal": "corrected", "simplified": False}
    rows: tuple[tuple[str, str, Mapping[str, object]], ...] = (
        ("R0", "literal: exact Gauss-Markov drift, 6' shared by all positions", {}),
        ("R1", "6' on the second and third position only", {"angle_sys": "increment"}),
        ("R2", "6' adds up from step to step", {"angle_sys": "accumulates"}),
        ("R3", "6' not counted", NOT_COUNTED),
        ("R4", "no random drift, eq. (15)", {"gm_sigma_degph": 0.0}),
        ("R4n", "the same, 6' not counted", {"gm_sigma_degph": 0.0, **NOT_COUNTED}),
        ("R5", "random drift of 0.02 deg/h from zero, 6' counted", SMALL_GM),
        ("R5n", "the same, 6' not counted: the article's figures", ARTICLE),
        ("R5s", "random drift of 0.02 deg/h, stationary, 6' counted", SMALL_STATIONARY),
        ("R5ns", "the same, 6' not counted", ARTICLE_STATIONARY),
        ("R6", "exact drift that starts from zero", FROM_ZERO),
        ("R6n", "the same, 6' not counted", {**FROM_ZERO, **NOT_COUNTED}),
        ("R7", "exact drift, windows back to back", {"gap_s": 0.0}),
        ("R11", "R5n, and random errors average out in a window", {**ARTICLE, **averaged}),
        ("R11+", "the same, 6' counted", {**SMALL_GM, **averaged}),
        ("R11s", "R5ns, and random errors average out in a window", {**ARTICLE_STATIONARY, **averaged}),
        ("cardan", "R5n, steps of the gimbal taken for steps of azimuth", {**ARTICLE, **uncorrected}),
        ("cardan+", "the same, 6' counted", {**SMALL_GM, **uncorrected}),
        ("cardan fixed", "R5n, steps of the gimbal, corrected", {**ARTICLE, **corrected}),
        ("improved", "(0, 180, 90, 270) x6, 5 s each, 5 s between (ideal), encoder read, GLS, R3", _at_once()),
    )
    for name, title, change in rows:
        yield Case(study="readings", name=name, title=title, setup=_with(base, change))


FAIR_DEG = (0.0, 180.0, 90.0, 270.0)
# The same directions six times, the shorter way from the last of one round to the first of the next: 90, not 270 deg.
FAIR_TURNS_DEG = (*FAIR_DEG, *(360.0, 180.0, 90.0, 270.0) * 5)
SHORT: dict[str, object] = {**ENCODER, "window_s": 5.0}


def _at_once() -> dict[str, object]:
    return {**SHORT, "angles_deg": FAIR_DEG * 6, "gap_s": 5.0, "method": "gls"}


def _with_turns(angles_deg: tuple[float, ...], slew_dps: float, settle_s: float) -> dict[str, object]:
    """As `psabench run gyrocompass --reading improved` has a gyro unit turn, with its weights."""
    turns: dict[str, object] = {"slew_dps": slew_dps, "slew_dps2": 20.0, "settle_s": settle_s, "angles_deg": angles_deg}
    loops: dict[str, object] = {"m1_per_s": 2.0, "m2_per_s": 2.0, "gimbal": "corrected"}
    return {**SHORT, **turns, **loops, "method": "gls_constrained"}


def _improved(base: Setup) -> Iterator[Case]:
    """What `improved` is worth with turns that take time: the delivered unit's 18 deg/s, 30 of profile gyro_fast.

    Silent: without the noise of the bench's level sensors, which is ours (E0); the article has none.
    """
    noise = {"white_degph_rts": level_white_degph_rts(5.0, m1_per_s=2.0)}
    unit, fast = (_with_turns(FAIR_TURNS_DEG, slew_dps, 5.0) for slew_dps in (18.0, 30.0))
    short = _with_turns(_fill((0.0, 120.0, 240.0, 120.0), 240.0, 5.0, 5.5 + 30.0 / 20.0, 30.0), 30.0, 5.5)
    rows: tuple[tuple[str, str, Mapping[str, object]], ...] = (
        ("instant", "ideal: (0, 180, 90, 270) x6, turn and settle in 5 s, silent", _at_once()),
        ("unit, silent", "as the unit runs it: the same, 18 deg/s, silent", unit),
        ("unit", "as the unit runs it", {**unit, **noise}),
        ("fast, silent", "fast torquers: 30 deg/s, silent", fast),
        ("fast", "fast torquers", {**fast, **noise}),
        ("4 min, silent", "fast torquers: 0, 120, 240, 120, ..., silent", short),
        ("4 min", "fast torquers: 0, 120, 240, 120, ...", {**short, **noise}),
    )
    for name, title, change in rows:
        setup = _with(base, change)
        yield Case(study="improved", name=name, title=f"{title}; {duration_s(setup):.0f} s", setup=setup)


def duration_s(setup: Setup) -> float:
    """From the begin of the first window to the end of the last."""
    windows_s = len(setup.angles_deg) * setup.window_s
    turned_deg = [abs(b - a) for a, b in itertools.pairwise(setup.angles_deg)]
    if not setup.slew_dps:
        return windows_s + len(turned_deg) * setup.gap_s
    ramps_s = setup.slew_dps / setup.slew_dps2 if setup.slew_dps2 else 0.0
    return windows_s + sum(turned_deg) / setup.slew_dps + len(turned_deg) * (ramps_s + setup.settle_s)


def _sources(base: Setup) -> Iterator[Case]:
    rows: tuple[tuple[str, Mapping[str, object]], ...] = (
        ("exact random drift 0.2 deg/h", {"gm_sigma_degph": 0.2}),
        ("exact random drift, back to back", {"gm_sigma_degph": 0.2, "gap_s": 0.0}),
        ("random drift 0.02 deg/h", SMALL_GM),
        ("gimbal steps uncorrected", {"gimbal": "uncorrected"}),
        ("azimuth random 3'", {"angle_random_arcmin": 3.0}),
        ("azimuth 6', common", {"angle_sys_arcmin": 6.0}),
        ("azimuth 6' on increments", {"angle_sys_arcmin": 6.0, "angle_sys": "increment"}),
        ("azimuth 6' a step", {"angle_sys_arcmin": 6.0, "angle_sys": "accumulates"}),
        ("level sensors random 1'", {"beta_random_arcmin": 1.0, "gamma_random_arcmin": 1.0}),
        ("gamma systematic 10'", {"gamma_sys_arcmin": 10.0}),
        ("beta systematic 10'", {"beta_sys_arcmin": 10.0}),
        ("latitude 0.1'", {"latitude_error_arcmin": 0.1}),
        ("torquer scale 0.1 %", {"torquer_scale": 1e-3}),
        ("torquer scale 1 %", {"torquer_scale": 1e-2}),
    )
    for title, change in rows:
        yield Case(study="sources", name=title, title=title, setup=_with(base, {**QUIET, **change}))


GM_CURVES: tuple[tuple[str, Mapping[str, object]], ...] = (
    ("exact drift 0.2 deg/h", {}),
    ("drift 0.02 deg/h", SMALL_GM),
)


def _step(base: Setup) -> Iterator[Case]:
    white = {**QUIET, "white_degph_rts": 0.05 * base.window_s**0.5}  # 0.05 deg/h a window
    curves = (
        *GM_CURVES,
        ("white 0.05 deg/h", white),
        ("white, constrained fit", {**white, "method": "constrained"}),
    )
    for curve, change in curves:
        for step_deg in (30, 45, 60, 75, 90, 105, 120, 135, 150):
            angles_deg = (0.0, float(step_deg), 2.0 * step_deg)
            yield _scan("step", curve, step_deg, _with(base, {**change, "angles_deg": angles_deg}))


def _latitude(base: Setup) -> Iterator[Case]:
    for curve, change in GM_CURVES:
        for latitude_deg in (0, 15, 30, 45, 50, 60, 70, 80):
            yield _scan("latitude", curve, latitude_deg, _with(base, {**change, "latitude_deg": float(latitude_deg)}))


def _tilt(base: Setup) -> Iterator[Case]:
    small: dict[str, object] = {**ARTICLE, "tilt": "corners"}
    curves: tuple[tuple[str, Mapping[str, object]], ...] = (
        ("set about the vertical", small),
        ("gimbal steps uncorrected", {**small, "gimbal": "uncorrected"}),
        ("gimbal steps corrected", {**small, "gimbal": "corrected", "simplified": False}),
    )
    for curve, change in curves:
        for tilt_deg in (0, 1, 2, 3, 4, 5, 7, 10):
            yield _scan("tilt", curve, tilt_deg, _with(base, {**change, "tilt_deg": float(tilt_deg)}))


def _time(base: Setup) -> Iterator[Case]:
    curves: tuple[tuple[str, Mapping[str, object]], ...] = (
        ("exact drift, 10 s apart", {**ENCODER, "gap_s": 10.0}),
        ("exact drift, a window apart", ENCODER),
        ("0.02 deg/h, 10 s apart", {**ENCODER, **SMALL_GM, "gap_s": 10.0}),
        ("white, 0.05 deg/h in 10 s", {**QUIET, "white_degph_rts": 0.05 * 10.0**0.5}),
    )
    for curve, change in curves:
        for window_s in (2, 5, 10, 20, 30, 60, 120):
            times = {"gap_s": float(window_s), **change, "window_s": float(window_s)}
            yield _scan("time", curve, window_s, _with(base, times))


def _order(base: Setup) -> Iterator[Case]:
    even: dict[str, object] = {**ENCODER, "method": "lsq", "window_s": 10.0, "gap_s": 10.0}
    fast: dict[str, object] = {**even, "window_s": 5.0, "gap_s": 5.0}
    monotone, fair = (0.0, 90.0, 180.0, 270.0), (0.0, 180.0, 90.0, 270.0)
    rows: tuple[tuple[str, tuple[float, ...], Mapping[str, object]], ...] = (
        ("0, 90, 180", (0.0, 90.0, 180.0), even),
        ("0, 120, 240", (0.0, 120.0, 240.0), even),
        ("0, 90, 180, 270", monotone, even),
        ("the same, GLS", monotone, {**even, "method": "gls"}),
        ("0, 180, 90, 270", fair, even),
        ("0, 180, 180, 0, 90, 270, 270, 90", (0.0, 180.0, 180.0, 0.0, 90.0, 270.0, 270.0, 90.0), even),
        ("six, 60 apart", tuple(60.0 * i for i in range(6)), even),
        ("eight, 45 apart", tuple(45.0 * i for i in range(8)), even),
        ("(0, 180, 90, 270) x4", fair * 4, even),
        ("(0, 180, 90, 270) x6, 5 s", fair * 6, fast),
        ("the same, GLS", fair * 6, {**fast, "method": "gls"}),
    )
    for i, (title, angles_deg, change) in enumerate(rows):
        name = f"{i + 1}: {title}"
        yield Case(study="order", name=name, title=title, setup=_with(base, {**change, "angles_deg": angles_deg}))


def _slew(base: Setup) -> Iterator[Case]:
    """With the time that turns take: how long a run must be for 0.1 deg at 95 %."""
    fit: dict[str, object] = {**ENCODER, "method": "gls_constrained", "window_s": 5.0, "settle_s": 7.0}
    for slew_dps in (9.0, 30.0):
        for total_s in (60, 120, 180, 240, 360):
            angles_deg = _fill((0.0, 120.0, 240.0, 120.0), total_s, 5.0, 7.0, slew_dps)
            change = {**fit, "slew_dps": slew_dps, "angles_deg": angles_deg}
            yield _scan("slew", f"{slew_dps:g} deg/s", total_s, _with(base, change))


def _fill(
    pattern: tuple[float, ...], total_s: float, window_s: float, settle_s: float, slew_dps: float
) -> tuple[float, ...]:
    """As many positions of the pattern, over and over, as the time allows; three at least."""
    angles, spent_s = [pattern[0]], window_s
    while len(angles) < 64:
        following = pattern[len(angles) % len(pattern)]
        spent_s += abs(following - angles[-1]) / slew_dps + settle_s + window_s
        if spent_s > total_s and len(angles) >= 3:
            break
        angles.append(following)
    return tuple(angles)


def _hold(base: Setup) -> Iterator[Case]:
    averaged: dict[str, object] = {**ARTICLE, "per_sample": True}
    fixed = Hold(axis2="fixed")
    flight = Hold(v_east_kmph=500.0, speed_error=0.01)
    rows: tuple[tuple[str, Mapping[str, object], Hold], ...] = (
        ("0.1 deg and 0.05 deg/h, nothing else", {"gm_sigma_degph": 0.0}, fixed),
        ("the same and exact drift from zero", FROM_ZERO, fixed),
        ("whole chain, exact drift", NOT_COUNTED, Hold()),
        ("whole chain, exact drift from zero", {**NOT_COUNTED, **FROM_ZERO}, Hold()),
        ("R5n: 0.02 deg/h from zero, 6' not counted", ARTICLE, Hold()),
        ("R5: the same, 6' counted", SMALL_GM, Hold()),
        ("R5ns: 0.02 deg/h, stationary, 6' not counted", ARTICLE_STATIONARY, Hold()),
        ("R11, levelling 10' in flight", averaged, Hold(level_arcmin=10.0)),
        ("R11, latitude off by 10'", averaged, Hold(latitude_error_arcmin=10.0)),
        ("R11, 500 km/h east, speed off by 1 %", averaged, flight),
        ("R11, azimuth axis' drift differs by 0.1 deg/h", averaged, Hold(axis2="differs", axis2_sd_degph=0.1)),
        ("R11, azimuth axis' drift differs by 1 deg/h", averaged, Hold(axis2="differs", axis2_sd_degph=1.0)),
        ("R11, azimuth axis' drift measured", averaged, Hold(axis2="measured")),
    )
    for title, change, hold in rows:
        # With the signs as given, 6' of the angle and 10' of the level would cancel for hours.
        setup = _with(base, {"random_sign": True, **change})
        yield Case(study="hold", name=title, title=title, setup=setup, hold=hold)


def _wire(base: Setup) -> Iterator[Case]:
    """What the emulated chain can do as well: turns of the gimbal that take time, the converters' noise.

    12 s: after the 10 s that would do for the article, the levelling loop still leaves 0.02 deg (m1 = 1 1/s).
    """
    loops: dict[str, object] = {"m2_per_s": 2.0, "gm_before_s": BEFORE_S}
    turns: dict[str, object] = {**loops, "gimbal": "corrected", "slew_dps": 9.0, "settle_s": 12.0}
    long: dict[str, object] = {**turns, "white_degph_rts": level_white_degph_rts(base.window_s)}
    fast: dict[str, object] = {**turns, "window_s": 5.0, "white_degph_rts": level_white_degph_rts(5.0)}
    fair: dict[str, object] = {**fast, **ENCODER, "angles_deg": (0.0, 180.0, 90.0, 270.0), "method": "gls"}
    rows: tuple[tuple[str, str, Mapping[str, object]], ...] = (
        ("article", "R5n, 9 deg/s between windows", {**long, **ARTICLE}),
        ("literal", "R0, 9 deg/s between windows", long),
        ("better", "0, 180, 90, 270, 5 s each, encoder read, GLS, R3", fair),
    )
    for name, title, change in rows:
        yield Case(study="wire", name=name, title=title, setup=_with(base, change))


def _own(base: Setup) -> Iterator[Case]:
    yield Case(study="own", name="own", title="as set with --set", setup=base)


def _scan(study: str, curve: str, x: float, setup: Setup) -> Case:
    return Case(study=study, name=f"{curve}, {x:g}", title=curve, setup=setup, curve=curve, x=float(x))


def _with(base: Setup, change: Mapping[str, object]) -> Setup:
    return replace(base, **change)  # type: ignore[arg-type]  # names and types are checked by Setup


STUDIES: Mapping[str, Study] = {
    s.name: s
    for s in (
        Study("readings", "Each reading of the article's sentence", cases=_readings),
        Study("sources", "One source of error at a time", cases=_sources),
        Study("step", "Error against step", cases=_step, axis="step of the gimbal, deg", figure="sd", log_y=True),
        Study("latitude", "Error against latitude", cases=_latitude, axis="latitude, deg", figure="sd"),
        Study("tilt", "Error against tilt", cases=_tilt, axis="pitch and roll, deg", figure="sd", log_y=True),
        Study("time", "Error against averaging time", cases=_time, axis="averaging window, s", figure="sd", log_y=True),
        Study("order", "Number and order of positions", cases=_order),
        Study("improved", "The improved procedure, with the time that turns take", cases=_improved),
        Study("slew", "Error against the duration of the run", cases=_slew, axis="duration of the run, s"),
        Study("hold", "Heading after 4 h of hold", cases=_hold),
        Study("wire", "Cases that also run on an emulated board", cases=_wire),
        Study("own", "As set on the command line", cases=_own),
    )
}
DEFAULT_STUDIES = tuple(name for name in STUDIES if name != "own")
WIRE_STUDIES = ("wire",)  # what the emulated chain does without --study
