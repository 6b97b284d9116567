"""Results of `make bench` as tables and picture of docs/reference/performance.md: pure functions of result.json."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from string import ascii_lowercase
from typing import Any
from xml.sax.saxutils import escape

from between import spliced

from tests.bench.cases import FLEETS, TURNS

Result = dict[str, Any]
ALONE_LABELS = {
    "alone-eager": "everything computed (`--eager`)",
    "alone-lazy": "asleep",
    "alone-streams": "streaming (`--start`)",
}
FRAME_HZ = 1000  # of the board: so many frames are one second of it
PEER = "verilator"

ENGINES = {  # of the first table and of the picture
    "icarus": "Icarus Verilog",
    "verilator-timing": "Verilator `--timing`",
    "verilator": "Verilator, hand-written C++ driver",
    "frames-watched": "psabench, all lines watched, bit-exact converters",
    "frames-watched-direct": "psabench, all lines watched, no decimation chain",
}
PSD1_ENGINES = {
    "verilator-psd1": "Verilator, hand-written C++ driver",
    "psd1-watched": "psabench, all 34 lines watched",
    "psd1-cycle": "psabench, all but the clock watched",
    "psd1-unwatched": "psabench, without observers",
}
UNWATCHED = {
    "frames-direct": "no decimation chain (`adc_chain: direct`)",
    "frames": "bit-exact decimation chain, three channels (the default)",
    "frames-modulator": "bit-true modulator before it (`adc_chain: modulator`)",
}
OTHERS = {
    "vcd": "VCD writer alone, fed with the edges of frames",
    "frames-vcd": "whole board, no decimation chain, all lines into a VCD",
    "decode": "host: line port at 8 MHz to words (`psabench.link.lineport`)",
    "can": "CAN: psa-emu in free pace, socketcand, a client that only counts",
    "spi": "libpsabench from C: SPI bytes of an ADS1256's registers",
    "readings": "libpsabench from C: bytes of readings at each DRDY, 30 kSPS",
    "chips-spi": "psabench.chips from Python: SPI bytes of the same registers, 13 a call",
}

GYRO = {
    "gyro-emulator": "one gyrocompassing, article's schedule, full emulated chain in free pace: psa-emu alone",
    "gyro-chain": "the same, with decoding the recorded bus and the host's estimate in Python",
}

MONTE_CARLO = {
    "mc-numpy": "NumPy, sample by sample, 1000 runs at once, one thread",
    "mc-samples": "`nav_mc_samples`, sample by sample, one thread",
    "mc-samples-all": "the same, a thread a core, real time",
    "mc-closed": "`nav_mc_closed`, closed form, one thread",
    "mc-closed-all": "the same, a thread a core, real time",
}


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
WHY_FLEET = (
    "a unit asleep follows the instants of its temperature scan, 97 conversions a second with 1,700 instructions each: "
    "they drift past the frames, and which of them wait for a frame has no closed form"
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
    "the recurrence of a fourth-order modulator is serial; three channels side by side are not built; back to back on "
    "one machine it is 1.7 times as fast as before"
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
    Target("decoding the line port, frames a second", True, 300_000, rate("decode")),
    Target("gyrocompasses by the closed form, all cores, times NumPy", True, 3000, of("mc-closed-all", "times_peer")),
    Target("the same on one core", True, 3000, of("mc-closed", "times_peer"), WHY_CLOSED),
    Target("gyrocompasses sample by sample, all cores, times NumPy", True, 8, of("mc-samples-all", "times_peer")),
    Target("the same on one core", True, 8, of("mc-samples", "times_peer"), WHY_SAMPLES),
    Target("one gyrocompassing, emulator in free pace: ms of CPU of psa-emu", False, 50, ms_each("gyro-emulator")),
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
        WHY_FLEET,
    ),
    Target("the same, times those with 64 units", False, 1.02, fleet_growth),
    Target(
        "64 units at 1,000 frames a second, exact chain, in real time: % of one core (not held before)",
        False,
        50,
        fleet_share,
        WHY_WALL,
    ),
    Target("emulator ready to serve, ms after start", False, 50, of("start", "ms")),
)


def figure(x: float | None) -> str:
    """Three digits, thousands apart: 1,230,000; 12.3; 0.0123."""
    if x is None:
        return ""
    if x == 0:
        return "0"
    digits = 2 - math.floor(math.log10(abs(x)))
    return f"{round(x, digits):,.{max(digits, 0)}f}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def engines(r: Result) -> str:
    return _engines(r, ENGINES, "frame")


def psd1(r: Result) -> str:
    return _engines(r, PSD1_ENGINES, "cycle")


def _engines(r: Result, names: dict[str, str], unit: str) -> str:
    rows = []
    for name, label in names.items():
        if c := r["cases"].get(name):
            per_edge = c.get("instructions_per_edge")
            cells = (c["per_s"], c["times_peer"], c["per_s"] / FRAME_HZ, c.get("edges_per_unit"))
            rows.append([label, *map(figure, (*cells, c.get("instructions_per_unit"), per_edge))])
    head = f"engine|{unit}s/s|times the peer|times real time|edges a {unit}|instructions a {unit}|an edge"
    return table(head.split("|"), rows)


def unwatched(r: Result) -> str:
    rows = []
    for name, label in UNWATCHED.items():
        if c := r["cases"].get(name):
            rows.append([label, *map(figure, (c["per_s"], c["per_s"] / FRAME_HZ, c.get("instructions_per_unit")))])
    return table(["converters", "frames/s", "times real time", "instructions a frame"], rows)


def others(r: Result) -> str:
    rows = []
    for name, label in OTHERS.items():
        if c := r["cases"].get(name):
            edges = c.get("medges_per_s")
            rows.append([label, f"{figure(c['per_s'])} {c['unit']}/s", f"{figure(edges)} Medge/s" if edges else ""])
    for name, label in GYRO.items():
        if ms := ms_each(name)(r):
            rows.append([label, f"{figure(ms)} ms of CPU", ""])
    if start := r["cases"].get("start"):
        rows.append(["psa-emu from spawning to `ready all`, scenario `calibrate`", f"{figure(start['ms'])} ms", ""])
    return table(["what", "median", ""], rows)


def monte_carlo(r: Result) -> str:
    rows = []
    for name, label in MONTE_CARLO.items():
        if c := r["cases"].get(name):
            rows.append([label, figure(c["per_s"]), figure(c["times_peer"])])
    return table(["model", "gyrocompasses/s", "times NumPy"], rows)


def alone(r: Result) -> str:
    rows = []
    for name, label in ALONE_LABELS.items():
        for turns, how in (("", "at rest"), (TURNS, "turning")):
            if c := r["cases"].get(name + turns):
                rows.append([f"{label}, head {how}", *map(figure, (c.get("instructions_per_unit"), c["per_s"]))])
    return table(["unit", "instructions a simulated second", "times real time"], rows)


def fleets(r: Result) -> str:
    rows = []
    for n in FLEETS:
        if c := r["cases"].get(f"fleet-{n}"):
            f = c["facts"]
            cells = (
                f["ready_ns"] * 1e-6 / n,
                f["rss_kb"] / n,
                c["ms"] / n * 1000 / c["count"],
                fleet_instructions(r, n),
            )
            rows.append([f"{n:,}", *map(figure, cells)])
    head = [
        "units",
        "ready, ms a unit",
        "memory, kB a unit",
        "CPU, ms a unit and simulated second",
        "instructions, the same",
    ]
    return table(head, rows)


def targets(r: Result) -> str:
    rows, reasons = [], []
    for t in TARGETS:
        value = t.value(r)
        if value is None:
            verdict = "not measured"
        elif value >= t.limit if t.at_least else value <= t.limit:
            verdict = "reached"
        else:
            verdict = f"missed by {abs(value / t.limit - 1):.0%}"
            if t.why:
                reasons += [t.why] if t.why not in reasons else []
                verdict += f" ({ascii_lowercase[reasons.index(t.why)]})"
        rows.append([t.what, ("≥ " if t.at_least else "≤ ") + figure(t.limit), figure(value), verdict])
    told = "".join(f"\n\n({ascii_lowercase[i]}) {why[0].upper()}{why[1:]}." for i, why in enumerate(reasons))
    return table(["target", "wanted", "measured", ""], rows) + told


def machine(r: Result) -> str:
    m = r["machine"]
    return (
        f"{m['cores']} cores, {m['arch']}; {m['cc']} with `{m['cflags']}`, {m['verilator']} with g++ {m['cxx']} and "
        f"`{m['peer_cflags']}`, {m['icarus']}, Python {m['python']}, NumPy {m['numpy']}, {m['valgrind']}. "
        f"Medians of {r['rounds']} rounds; each round runs every row once, ratios are taken within a round."
    )


SECTIONS: dict[str, Callable[[Result], str]] = {
    "machine": machine,
    "targets": targets,
    "engines": engines,
    "psd1": psd1,
    "unwatched": unwatched,
    "others": others,
    "alone": alone,
    "fleets": fleets,
    "monte-carlo": monte_carlo,
}


def fill(page: str, r: Result) -> str:
    """The page with the text between its markers written again. ValueError if a marker is missing."""
    for name, make in SECTIONS.items():
        page = spliced(page, (f"<!-- bench:{name} -->", "<!-- bench:end -->"), make(r), "docs/reference/performance.md")
    return page


BAR_X, BAR_W, ROW_H, TOP = 390, 520, 30, 52
STYLE = """svg{font:12px ui-monospace,SFMono-Regular,Menlo,Consolas,"DejaVu Sans Mono",monospace}
.card{fill:#fff;stroke:#d0d7de}.name{fill:#1f2328}.head{fill:#1f2328;font-weight:600}.note{fill:#59636e}.grid{stroke:#d0d7de}
.peer{fill:#afb8c1}.ours{fill:#0969da}
@media(prefers-color-scheme:dark){
.card{fill:#0d1117;stroke:#3d444d}.name,.head{fill:#f0f6fc}.note{fill:#9198a1}.grid{stroke:#3d444d}
.peer{fill:#57606a}.ours{fill:#58a6ff}}"""


def picture(r: Result) -> str:
    """Frames a second of the engines and of the unwatched board, as bars on a logarithmic scale from 1 k."""
    bars = [(name, label) for name, label in (ENGINES | UNWATCHED).items() if name in r["cases"]]
    top = max(r["cases"][name]["per_s"] for name, _ in bars)
    decades = math.ceil(math.log10(top)) - 3
    height = TOP + ROW_H * len(bars) + 34
    title = "PSA-2 frames a second on one core; the board itself sends 1 k"
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 1000 {height}" width="1000" height="{height}">',
        f"<title>{title}</title>\n<style>\n{STYLE}\n</style>",
        f'<rect class="card" x=".5" y=".5" width="999" height="{height - 1}" rx="6"/>',
        f'<text class="head" x="14" y="26">{title}</text>',
    ]
    for d in range(decades + 1):
        x = BAR_X + BAR_W * d / decades
        label = f"{10**d} k" if d < 3 else f"{10 ** (d - 3)} M"
        out.append(f'<line class="grid" x1="{x:g}" x2="{x:g}" y1="40" y2="{height - 26}"/>')
        out.append(f'<text class="note" x="{x:g}" y="{height - 10}" text-anchor="middle">{label}</text>')
    for i, (name, label) in enumerate(bars):
        per_s = r["cases"][name]["per_s"]
        width = BAR_W * max(math.log10(per_s) - 3, 0.005) / decades
        y = TOP + ROW_H * i
        shown = label.partition(" (")[0].replace("`", "")
        shown = shown if name in ENGINES else f"not watched: {shown.partition(',')[0]}"
        kind = "ours" if name.startswith("frames") else "peer"
        out.append(f'<text class="name" x="14" y="{y + 13}">{escape(shown)}</text>')
        out.append(f'<rect class="{kind}" x="{BAR_X}" y="{y}" width="{width:.1f}" height="18"/>')
        out.append(f'<text class="note" x="{BAR_X + width + 6:.1f}" y="{y + 13}">{figure(per_s)}</text>')
    return "\n".join([*out, "</svg>"]) + "\n"
