"""Results of `make bench` as tables and picture of docs/reference/performance.md: pure functions of result.json."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Sequence
from string import ascii_lowercase
from xml.sax.saxutils import escape

from between import spliced

from tests.bench.cases import FLEETS, TURNS
from tests.bench.targets import FRAME_HZ, TARGETS, Result, fleet_instructions, ms_each

ALONE_LABELS = {
    "alone-eager": "everything computed (`--eager`)",
    "alone-lazy": "asleep",
    "alone-streams": "streaming (`--start`)",
}
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

NAV = {  # label, unit of work, ms or us of one
    "kf-joseph": ("filter step, 45 states of which 6 move, 3 measurements: `NAV_KF_JOSEPH`", "µs", "kf-joseph"),
    "kf-joseph-full": ("the same with no zero in the matrices", "µs", "kf-joseph"),
    "kf-ud": ("the first, `NAV_KF_UD`", "µs", "kf-joseph"),
    "kf-ud-full": ("the same with no zero in the matrices", "µs", "kf-joseph"),
    "kf-dense": ("the first, dense Joseph formulas in Eigen, vectorised", "µs", "kf-joseph"),
    "kf-filterpy": ("the first, filterpy", "µs", "kf-joseph"),
    "sins-plan": ("covariance of the article's three cycles, 2718 s at 100 Hz, 24 states", "ms", "sins-plan"),
    "koi": (
        "integration with a receiver, an hour: strapdown at 100 Hz, 35 states at 10 Hz, position and velocity at 1 Hz",
        "ms",
        "koi",
    ),
    "koi-python-ins": (
        "the same, python-ins: feedforward filter of 33 states (a minute, times 60)",
        "ms",
        "koi",
    ),
    "strapdown": ("strapdown, an hour at 100 Hz, path given back", "ms", "strapdown"),
    "strapdown-python-ins": ("the same, python-ins", "ms", "strapdown"),
}


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


def nav(r: Result) -> str:
    rows = []
    for name, (label, unit, ours) in NAV.items():
        if (c := r["cases"].get(name)) and (base := r["cases"].get(ours)):
            each = {"µs": 1e6, "ms": 1e3}[unit] / c["per_s"]
            times = figure(base["per_s"] / c["per_s"]) if name != ours else ""
            rows.append([label, f"{figure(each)} {unit}", times])
    return table(["what", "CPU time of one", "times the library's"], rows)


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
    "nav": nav,
}


def fill(page: str, r: Result, sections: Collection[str] = SECTIONS) -> str:
    """The page with the text between its markers written again. ValueError if a marker is missing."""
    for name in sections:
        make = SECTIONS[name]
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
