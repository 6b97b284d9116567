"""What issues and design promise of the speed, as functions of result.json: the first table of the page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

from tests.bench.cases import FLEETS

Result = dict[str, Any]
FRAME_HZ = 1000  # of the board: so many frames are one second of it


@dataclass(frozen=True, slots=True)
class Target:
    """What issue or design promise: value(result) must be at least (or at most) limit. why: said when it is missed."""

    what: str
    at_least: bool
    limit: float
    value: Callable[[Result], float | None]
    why: str = ""


def rate(name: str, per: float = 1.0) -> Callable[[Result], float | None]:
    """Median rate of a case in units of `per`."""
    return lambda r: r["cases"][name]["per_s"] / per if name in r["cases"] else None


def of(name: str, key: str) -> Callable[[Result], float | None]:
    return lambda r: r["cases"].get(name, {}).get(key)


def ms_each(name: str) -> Callable[[Result], float | None]:
    """Of one, by the median rate."""
    return lambda r: 1e3 / r["cases"][name]["per_s"] if name in r["cases"] else None


def watching(r: Result) -> float | None:
    """Instructions an edge that watching adds to an unwatched board."""
    plain, watched = (r["cases"].get(name) for name in ("frames-direct", "frames-watched-direct"))
    if not plain or not watched or not plain.get("instructions_per_unit"):
        return None
    return float((watched["instructions_per_unit"] - plain["instructions_per_unit"]) / watched["edges_per_unit"])


def fleet_kb(r: Result) -> float | None:
    """Memory that each unit beyond the 64 takes."""
    few, many = (r["cases"].get(f"fleet-{n}", {}).get("facts") for n in FLEETS)
    return (many["rss_kb"] - few["rss_kb"]) / (many["units"] - few["units"]) if few and many else None


def fleet_instructions(r: Result, units: int) -> float | None:
    """Of a unit and simulated second."""
    ms = r["cases"].get(f"fleet-{units}", {}).get("instructions_per_unit")
    return ms * 1000 / units if ms else None


def fleet_growth(r: Result) -> float | None:
    few, many = (fleet_instructions(r, n) for n in FLEETS)
    return many / few if few and many else None


def fleet_share(r: Result) -> float | None:
    """CPU time of real time, in percent; nothing where frames were late by more than the pace makes good."""
    c = r["cases"].get("fleet-wall")
    return 100 * c["ms"] / c["facts"]["wall_ms"] if c and not c["facts"]["slips"] else None


def millions(name: str) -> Callable[[Result], float | None]:
    """Instructions of a case that is counted in simulated seconds."""
    return lambda r: (r["cases"].get(name, {}).get("instructions_per_unit") or 0.0) / 1e6 or None


def times(value: Callable[[Result], float | None], before: float) -> Callable[[Result], float | None]:
    """As a ratio to what it was."""

    def ratio(r: Result) -> float | None:
        now = value(r)
        return now / before if now is not None else None

    return ratio


def chamber_s(r: Result) -> float | None:
    """Real time of 30 h, by the median rate."""
    return 30 * 3600 / r["cases"]["chamber"]["per_s"] if "chamber" in r["cases"] else None


LINES = "all lines watched, no decimation chain"
WHY_LINES = (
    "the target is a prototype's that made lines from ready words; here four converters keep their registers and draw "
    "their noise, and of the instructions about three an edge are the counting listener's own; a draw by number "
    "takes more than the next one of a stream did"
)
WHY_CHAIN = "the decimation chain of three converters, which the models lack, takes about half of it"
WHY_STRETCH = (
    "more than half of the instructions are not the filters' but their input's: 32 samples of sensor and analog chain, "
    "with noise, for each reading of each channel"
)
WHY_DIRECT = (
    "a frame is not computed in one stroke: each of its three conversions has its data-ready event, its Gaussian draw "
    "and its analog chain, and these wait for one another more than they compute"
)
WHY_PSD1 = (
    "three converters that draw their noise and keep their registers are the greater part of a cycle, its read-out the "
    "smaller one"
)
WHY_CLOCK = (
    "the prototype behind the target did not report the clock: 1M25 runs on between cycles and makes nine in ten edges"
)
WHY_CLOSED = (
    "the prototype behind the target drew three numbers a run; here a run draws ten and gives the errors of platform, "
    "heading and drift, the quality and the truth"
)
WHY_SAMPLES = (
    "of a sample's 1.7 ns a Gaussian number takes 1.0, half of it a square root and a division; NumPy's is fast, too"
)
WHY_FOURIER = (
    "of a position's 6 ms the host takes 4, for seven commands, the instrument's answers and the frames; the emulator "
    "2, for waking up at each look and for the settling, which is too short to sleep"
)
WHY_GROWTH = (
    "each node's heartbeat is arbitrated among the nodes of its bus and delivered to all of them: 125 with 1,000 "
    "units, 8 with 64; at 64 nodes a bus it is half of all"
)
WHY_MACHINE = (
    "it is the machine's: with 478,000 frames and 41.6 ms that of commit 8f86d1ae reached both, and on the present one "
    "the code of that commit takes as long as today's"
)
WHY_STREAM = (
    "the filters are a tenth; the rest is 96 noisy samples a reading (sensor, analog chain, modulator's input: half of "
    "all), the words' Gaussian draws, frames on the bus and events"
)
WHY_TURNS = WHY_STREAM + "; kinematics are one row a reading, 32 instants each"
WHY_WATCHED = "21,000 asks for the chain at a third of its cost; see the row of a PSA-2 that streams"
WHY_BULK = (
    "words are templates of steps, and sinks take them by the batch; but each of 410 edges a frame has a time of its "
    "own in decimal digits, 50 instructions, and frames begin at other fractions of a unit, so that no frame's text "
    "repeats; back to back on one machine the writer is 1.75 times as fast as before, the board 1.45 times"
)
WHY_MODULATOR = (
    "of 122 instructions a clock the recurrence of the fourth-order modulator, which is serial, takes 27, a white draw "
    "24, the analog chain's pole, which is serial too, 11; the three channels side by side are not built: X is sampled "
    "with the temperature of the period before, Y and Z with that of the present one, so they have no common instant"
)
WHY_GYRO = (
    "on a platform, whose acceleration has no bound, the PSA-2 computes everything, and the platform's loops and the "
    "gyro unit step all the time"
)
WHY_CHAMBER = "the host takes half of it, 15 us a reading from the socket to the array; a minute asleep takes 6 ms"
WHY_WALL = "64 exact chains with 192 noisy sensors: 64,000 readings a second with 30,000 instructions each"
# Of commit 8f86d1ae, before units could sleep: instructions with AVX2; ms of a gyrocompassing on the page's machine.
STREAMED, STREAMED_TURNING = 42.7, 48.9  # million instructions a simulated second
VCD_BEFORE, VCD_BOARD_BEFORE, MODULATOR_BEFORE, GYRO_BEFORE = 36_093, 47_446, 931_586, 100.0
TARGETS = (
    Target(
        f"{LINES}, times Verilator's hand-driven model", True, 6, of("frames-watched-direct", "times_peer"), WHY_LINES
    ),
    Target(
        f"{LINES}, instructions an edge", False, 34, of("frames-watched-direct", "instructions_per_edge"), WHY_LINES
    ),
    Target("of these, what watching adds to the unwatched board", False, 34, watching),
    Target(f"{LINES}, times real time", True, 700, rate("frames-watched-direct", FRAME_HZ), WHY_LINES),
    Target(
        "all lines watched, bit-exact chain too, times Verilator",
        True,
        6,
        of("frames-watched", "times_peer"),
        WHY_CHAIN,
    ),
    Target(
        "all lines watched, bit-exact chain too, times real time",
        True,
        700,
        rate("frames-watched", FRAME_HZ),
        WHY_CHAIN,
    ),
    Target(
        "not watched, no decimation chain, times real time", True, 5000, rate("frames-direct", FRAME_HZ), WHY_DIRECT
    ),
    Target("not watched, bit-exact chain, times real time", True, 300, rate("frames", FRAME_HZ)),
    Target("the same, as a stretch", True, 1000, rate("frames", FRAME_HZ), WHY_STRETCH),
    Target("PSD-1, all lines watched, times Verilator", True, 25, of("psd1-watched", "times_peer")),
    Target("PSD-1, all lines watched, instructions an edge", False, 33, of("psd1-watched", "instructions_per_edge")),
    Target("PSD-1, not watched, times real time", True, 2000, rate("psd1-unwatched", FRAME_HZ), WHY_PSD1),
    Target("PSD-1, all lines watched, times real time", True, 2000, rate("psd1-watched", FRAME_HZ), WHY_CLOCK),
    Target("VCD, million edges a second", True, 40, of("vcd", "medges_per_s")),
    Target("decoding the line port, frames a second", True, 300_000, rate("decode"), WHY_MACHINE),
    Target("gyrocompasses by the closed form, all cores, times NumPy", True, 3000, of("mc-closed-all", "times_peer")),
    Target("the same on one core", True, 3000, of("mc-closed", "times_peer"), WHY_CLOSED),
    Target("gyrocompasses sample by sample, all cores, times NumPy", True, 8, of("mc-samples-all", "times_peer")),
    Target("the same on one core", True, 8, of("mc-samples", "times_peer"), WHY_SAMPLES),
    Target(
        "one gyrocompassing, emulator in free pace: ms of CPU of psa-emu",
        False,
        50,
        ms_each("gyro-emulator"),
        WHY_MACHINE,
    ),
    Target(
        "`run fourier`, first to last reading, host and emulator, times real time (53 reading by reading)",
        True,
        500,
        rate("fourier", 1e3),
        WHY_FOURIER,
    ),
    Target(
        "PSA-2 that no one looks at: million instructions a simulated second (39.9 before)",
        False,
        0.3,
        millions("alone-lazy"),
    ),
    Target("the same while the head turns (46.1 before)", False, 0.5, millions("alone-lazy-turning")),
    Target(
        "PSA-2 that streams, exact chain: instructions, of those before",
        False,
        0.55,
        times(millions("alone-streams"), STREAMED),
        WHY_STREAM,
    ),
    Target(
        "the same while the head turns",
        False,
        0.25,
        times(millions("alone-streams-turning"), STREAMED_TURNING),
        WHY_TURNS,
    ),
    Target(
        "all lines watched, bit-exact chain too, instructions a frame (32,700 before)",
        False,
        21_000,
        of("frames-watched", "instructions_per_unit"),
        WHY_WATCHED,
    ),
    Target(
        "VCD writer alone: instructions, of those before",
        False,
        0.333,
        times(of("vcd", "instructions_per_unit"), VCD_BEFORE),
        WHY_BULK,
    ),
    Target(
        "whole board into a VCD: instructions, of those before",
        False,
        0.333,
        times(of("frames-vcd", "instructions_per_unit"), VCD_BOARD_BEFORE),
        WHY_BULK,
    ),
    Target(
        "bit-true modulator: instructions, of those before",
        False,
        0.333,
        times(of("frames-modulator", "instructions_per_unit"), MODULATOR_BEFORE),
        WHY_MODULATOR,
    ),
    Target(
        "one gyrocompassing, CPU of that before", False, 0.35, times(ms_each("gyro-emulator"), GYRO_BEFORE), WHY_GYRO
    ),
    Target("30 h in a chamber, one second a minute recorded by the host: s", False, 20, chamber_s, WHY_CHAMBER),
    Target("1,000 units: kB of memory a unit", False, 128, fleet_kb),
    Target(
        "the same, instructions a unit and simulated second, no client",
        False,
        25_000,
        partial(fleet_instructions, units=1000),
    ),
    Target("the same, times those with 64 units", False, 1.02, fleet_growth, WHY_GROWTH),
    Target(
        "64 units at 1,000 frames a second, exact chain, in real time: % of one core (not held before)",
        False,
        50,
        fleet_share,
        WHY_WALL,
    ),
    Target("emulator ready to serve, ms after start", False, 50, of("start", "ms")),
)
