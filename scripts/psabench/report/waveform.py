"""Pictures of a VCD excerpt as SVG: what a logic analyser would show, for README and docs.

`python -m psabench.report.waveform RUN.vcd frame OUT.svg` draws the first whole frame on INT, DATA and CLK;
`... setup OUT.svg` draws each transfer of the set-up after Res; `... rdata OUT.svg` the first RDATA that an ADS1256 of
the library was asked for. `... cycle OUT.svg` and `... handover OUT.svg` draw the cycle of reading of a PSD-1
(waveform_psd1.py). Same input, same bytes; light and dark pages.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

import numpy as np

from psabench.link.vcd import Vcd, Wire, read_vcd

WIDTH, LEFT, RIGHT = 1120, 76, 18  # px: picture, column of names, margin
ROW, HIGH, GAP = 32, 16, 22  # px: row pitch, height of a pulse, between sections
LANE = 22  # px: pitch of intervals below the rows

STYLE = """
svg{font:11px ui-monospace,SFMono-Regular,Menlo,Consolas,"DejaVu Sans Mono",monospace}
.card{fill:#fff;stroke:#d0d7de}.name{fill:#1f2328;font-weight:600}.note{fill:#59636e}
.wave{fill:none;stroke:#0969da;stroke-width:1.3;stroke-linejoin:round}.rest{stroke:#d0d7de;stroke-width:.6}
.tag{fill:#ddf4ff;stroke:#54aeff;stroke-width:.8}.word{fill:#0a3069;text-anchor:middle}.grid{stroke:#d0d7de}
@media(prefers-color-scheme:dark){
.card{fill:#0d1117;stroke:#3d444d}.name{fill:#f0f6fc}.note{fill:#9198a1}.wave{stroke:#58a6ff}.rest{stroke:#3d444d}
.tag{fill:#0c2d6b;stroke:#1f6feb}.word{fill:#cae8ff}.grid{stroke:#3d444d}}
"""
DIM_STYLE = """.dim{stroke:#bc4c00;fill:none;stroke-width:.9}.guide{stroke:#bc4c00;stroke-width:.6;stroke-dasharray:2 2}
.dimtext{fill:#bc4c00}
@media(prefers-color-scheme:dark){.dim,.guide{stroke:#f0883e}.dimtext{fill:#f0883e}}
"""


@dataclass(frozen=True, slots=True)
class Tag:
    """A named stretch of a row: what the bits there mean."""

    row: str
    start_ns: int
    end_ns: int
    text: str


@dataclass(frozen=True, slots=True)
class Section:
    """A stretch of time; zero_ns is where its scale counts from."""

    start_ns: int
    end_ns: int
    zero_ns: int
    title: str = ""


@dataclass(frozen=True, slots=True)
class Dim:
    """An interval below the rows, with guides from the rows of its two edges; lanes count downwards from 0."""

    start_row: str
    start_ns: int
    end_row: str
    end_ns: int
    text: str  # is after the interval's length
    lane: int

    @property
    def label(self) -> str:
        return f"{self.end_ns - self.start_ns:,}".replace(",", " ") + f" ns{self.text}"


@dataclass(frozen=True, slots=True)
class Panel:
    """Rows of lines over sections that stand side by side, each as wide as its share."""

    rows: Sequence[str]
    sections: Sequence[Section]
    tags: Sequence[Tag] = field(default=())
    shares: Sequence[float] = field(default=())
    dims: Sequence[Dim] = field(default=())


class _Scale:
    """Nanoseconds of one section to pixels."""

    def __init__(self, section: Section, x0: float, width: float) -> None:
        self.section, self.x0, self.x1 = section, x0, x0 + width
        self.per_ns = width / (section.end_ns - section.start_ns)

    def x(self, t_ns: int) -> float:
        return self.x0 + (t_ns - self.section.start_ns) * self.per_ns


def _n(v: float) -> str:
    return f"{v:.1f}".rstrip("0").rstrip(".")


def _text(x: float, y: float, css: str, text: str, anchor: str = "") -> str:
    at = f' text-anchor="{anchor}"' if anchor else ""
    return f'<text class="{css}" x="{_n(x)}" y="{_n(y)}"{at}>{escape(text)}</text>\n'


def _wave(wire: Wire, s: _Scale, y: float) -> str:
    """One line as a path: vertical edges, high is up."""
    level = int(wire.at(s.section.start_ns))
    d = [f"M{_n(s.x0)} {_n(y - HIGH * level)}"]
    inside = (wire.t_ns > s.section.start_ns) & (wire.t_ns < s.section.end_ns)
    for t_ns, v in zip(wire.t_ns[inside].tolist(), wire.level[inside].tolist(), strict=True):
        d.append(f"H{_n(s.x(t_ns))}V{_n(y - HIGH * v)}")
    d.append(f"H{_n(s.x1)}")
    return f'<path class="wave" d="{"".join(d)}"/>\n'


def _tag(tag: Tag, s: _Scale, y: float) -> str:
    x0, x1 = s.x(tag.start_ns), s.x(tag.end_ns)
    box = f'<rect class="tag" x="{_n(x0)}" y="{_n(y - 14)}" width="{_n(x1 - x0)}" height="17" rx="3"/>\n'
    return box + _text((x0 + x1) / 2, y - 2, "word", tag.text)


def _dim(dim: Dim, s: _Scale, y_rows: dict[str, float], y: float) -> str:
    """Guides, a line with an arrow at each end, and the text where it fits: inside, or behind the end."""
    x0, x1 = s.x(dim.start_ns), s.x(dim.end_ns)
    out = [
        f'<line class="guide" x1="{_n(x)}" x2="{_n(x)}" y1="{_n(y_rows[row])}" y2="{_n(y + 3)}"/>\n'
        for row, x in ((dim.start_row, x0), (dim.end_row, x1))
    ]
    heads = f"M{_n(x0 + 4)} {_n(y - 3)}L{_n(x0)} {_n(y)}L{_n(x0 + 4)} {_n(y + 3)}"
    heads += f"M{_n(x1 - 4)} {_n(y - 3)}L{_n(x1)} {_n(y)}L{_n(x1 - 4)} {_n(y + 3)}"
    out.append(f'<path class="dim" d="M{_n(x0)} {_n(y)}H{_n(x1)}{heads if x1 - x0 > 8 else ""}"/>\n')
    if x1 - x0 > 6.8 * len(dim.label):
        out.append(_text((x0 + x1) / 2, y - 4, "dimtext", dim.label, "middle"))
    elif x1 + 6.8 * len(dim.label) < s.x1 + RIGHT:
        out.append(_text(x1 + 5, y + 4, "dimtext", dim.label))
    else:
        out.append(_text(x0 - 5, y + 4, "dimtext", dim.label, "end"))
    return "".join(out)


def _step_ns(span_ns: int, width: float) -> int:
    """1, 2 or 5 times a power of ten, at least 64 px apart."""
    step = 1
    while True:
        for factor in (1, 2, 5):
            if step * factor * width / span_ns >= 64:
                return step * factor
        step *= 10


def _time_name(ns: int) -> str:
    return f"{ns / 1000:g} µs" if abs(ns) < 1_000_000 else f"{ns / 1e6:g} ms"


def _axis(s: _Scale, top: float, bottom: float) -> str:
    out = []
    step = _step_ns(s.section.end_ns - s.section.start_ns, s.x1 - s.x0)
    first = -((s.section.zero_ns - s.section.start_ns) // step)
    t = s.section.zero_ns + first * step
    while t <= s.section.end_ns:
        x = _n(s.x(t))
        out.append(f'<line class="grid" x1="{x}" x2="{x}" y1="{_n(top)}" y2="{_n(bottom)}"/>\n')
        if s.x(t) + 44 < s.x1 + GAP:
            out.append(_text(s.x(t) + 3, bottom + 2, "note", _time_name(t - s.section.zero_ns)))
        t += step
    return "".join(out)


def _panel(vcd: Vcd, panel: Panel, top: float) -> tuple[str, float]:
    """SVG of one panel and the y below it."""
    titled = any(s.title for s in panel.sections)
    tagged = {t.row for t in panel.tags}
    shares = panel.shares or [1.0] * len(panel.sections)
    room = WIDTH - LEFT - RIGHT - GAP * (len(panel.sections) - 1)
    y_rows, y = {}, top + (20 if titled else 4)
    for row in panel.rows:
        y += ROW + (18 if row in tagged else 0)
        y_rows[row] = y - 8
    out = [_text(12, y_rows[row] - 3, "name", row) for row in panel.rows]
    y_lane, lanes = y + 12, 1 + max((d.lane for d in panel.dims), default=-1)
    y += LANE * lanes
    x = float(LEFT)
    for section, share in zip(panel.sections, shares, strict=True):
        scale = _Scale(section, x, room * share / sum(shares))
        if section.title:
            out.append(_text(x, top + 14, "note", section.title))
        out.append(_axis(scale, top + (20 if titled else 4), y + 8))
        for row in panel.rows:
            out.append(_wave(vcd.wires[row], scale, y_rows[row]))
        inside = [t for t in panel.tags if section.start_ns <= t.start_ns and t.end_ns <= section.end_ns]
        out += [_tag(t, scale, y_rows[t.row] - HIGH - 7) for t in inside]
        within = [d for d in panel.dims if section.start_ns <= d.start_ns and d.end_ns <= section.end_ns]
        out += [_dim(d, scale, y_rows, y_lane + LANE * d.lane) for d in within]
        x = scale.x1 + GAP
    return "".join(out), y + 22


def render(vcd: Vcd, panels: Sequence[Panel], title: str) -> str:
    """The picture as SVG text. Raises ValueError when a row is not in the recording."""
    need(vcd, {row for p in panels for row in p.rows})
    y = 34.0
    body = [_text(12, 22, "name", title)]
    for panel in panels:
        svg, y = _panel(vcd, panel, y)
        body.append(svg)
    size = f'width="{WIDTH}" height="{_n(y)}"'
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {_n(y)}" {size} role="img">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}{DIM_STYLE if any(p.dims for p in panels) else ''}</style>\n"
        f'<rect class="card" x=".5" y=".5" width="{WIDTH - 1}" height="{_n(y - 1)}" rx="6"/>\n{"".join(body)}</svg>\n'
    )


def need(vcd: Vcd, rows: set[str]) -> None:
    missing = sorted(rows - set(vcd.wires))
    if missing:
        raise ValueError(f"the recording has no line {', '.join(missing)}; it has {', '.join(vcd.wires)}")


def frame_words(vcd: Vcd, fall_ns: int, rise_ns: int, word_bits: int) -> list[Tag]:
    """The words of a frame, from the rises of CLK between two edges of INT."""
    rises = vcd.wires["CLK"].edges_ns(1)
    rises = rises[(rises > fall_ns) & (rises < rise_ns)]
    bits = vcd.wires["Data"].at(rises).astype(np.int64)
    half = int(rises[1] - rises[0]) // 2
    tags = []
    for i, name in enumerate("XYZT"):
        at, sent = rises[i * word_bits :][:word_bits], bits[i * word_bits :][:word_bits]
        value = int((sent << np.arange(word_bits)).sum())
        signed = value - (value >> (word_bits - 1) << word_bits)
        fields = f"{value & 0xFFFF:04X}h" + (f" ch{value >> 16 & 15} st{value >> 20 & 15:X}" if word_bits > 16 else "")
        text = f"{name} = {fields if name == 'T' else signed}"
        tags.append(Tag("Data", int(at[0]) - half, int(at[-1]) + half, text))
    return tags


def _first_frame(vcd: Vcd, bits: int) -> tuple[int, int]:
    """INT fall and rise with that many rises of CLK between them."""
    clk = vcd.wires["CLK"].edges_ns(1)
    for fall_ns in vcd.wires["Int"].edges_ns(0).tolist():
        rises = vcd.wires["Int"].edges_ns(1)
        for rise_ns in rises[rises > fall_ns].tolist()[:1]:
            if np.count_nonzero((clk > fall_ns) & (clk < rise_ns)) == bits:
                return fall_ns, rise_ns
    raise ValueError(f"no whole frame in it: no INT low with {bits} pulses of CLK")


def frame_picture(vcd: Vcd, word_bits: int = 32) -> str:
    """The first whole frame, and a closer look at the pause between its first two words. Raises ValueError."""
    rows = ("Int", "Data", "CLK")
    need(vcd, set(rows))
    fall_ns, rise_ns = _first_frame(vcd, 4 * word_bits)
    tags = frame_words(vcd, fall_ns, rise_ns, word_bits)
    margin = (rise_ns - fall_ns) // 30
    whole = Section(fall_ns - margin, rise_ns + margin, fall_ns)
    period = (tags[1].start_ns - tags[0].end_ns) // 4
    near = (
        Section(fall_ns - period, fall_ns + 14 * period, fall_ns, "INT falls, first bits of X"),
        Section(tags[0].end_ns - 7 * period, tags[1].start_ns + 7 * period, fall_ns, "pause of 4 CLK periods"),
    )
    title = f"PSA-2 frame at t = {fall_ns / 1e6:.3f} ms: 4 words of {word_bits} bits, least significant bit first"
    return render(vcd, (Panel(rows, (whole,), tags), Panel(rows, near)), title)


def spi_bytes(vcd: Vcd, row: str, edges_ns: Sequence[int]) -> list[Tag]:
    """Bytes of a line, most significant bit first, sampled at these edges of SClk."""
    tags = []
    for i in range(0, len(edges_ns) - 7, 8):
        at = np.array(edges_ns[i : i + 8], np.int64)
        value = int("".join(map(str, vcd.wires[row].at(at - 1).tolist())), 2)
        half = int(at[1] - at[0]) // 2
        tags.append(Tag(row, int(at[0]) - half, int(at[-1]) + half, f"{value:02X}"))
    return tags


def _transfers(vcd: Vcd, until_ns: int) -> list[tuple[str, list[int]]]:
    """Sampling edges of each transfer before an instant: ("DIn" or "DInT", edges of SClk)."""
    found: list[tuple[str, list[int]]] = []
    cst = vcd.wires["CST"]
    for start, end in zip(cst.edges_ns(0).tolist(), cst.edges_ns(1).tolist(), strict=False):
        falls = vcd.wires["SClk"].edges_ns(0)  # mode 1: sampled where SClk falls
        found.append(("DInT", falls[(falls > start) & (falls <= end)].tolist()))
    rises = vcd.wires["SClk"].edges_ns(1)
    for t in rises[cst.at(rises) == 1].tolist():
        if not found or found[-1][0] == "DInT" or t - found[-1][1][-1] > 20_000:  # bytes of a transfer are closer
            found.append(("DIn", []))
        found[-1][1].append(t)
    return sorted((f for f in found if f[1] and f[1][0] < until_ns), key=lambda f: f[1][0])


def setup_picture(vcd: Vcd) -> str:
    """The set-up after Res, up to the first SYNC_A: each transfer in a section of its own, and the two SYNC pulses.

    Raises ValueError when there is no transfer, or a line is missing.
    """
    rows = ("DRD_A", "DRD_T", "SClk", "DIn", "CST", "DInT", "SYNC_T", "SYNC_A")
    need(vcd, set(rows))
    sync = {name: vcd.wires[name].t_ns[1:3].tolist() for name in ("SYNC_T", "SYNC_A")}
    until_ns = sync["SYNC_A"][0] if sync["SYNC_A"] else vcd.end_ns
    parts: list[tuple[int, int, int, float]] = []  # start, end, margin, share of the width
    tags: list[Tag] = []
    for row, at in _transfers(vcd, until_ns):
        tags += spi_bytes(vcd, row, at)
        parts.append((at[0], at[-1], max((at[-1] - at[0]) // 8, 2000), 1.0))
    for pulse in sync.values():
        if len(pulse) == 2:
            parts.append((pulse[0], pulse[1], 2 * (pulse[1] - pulse[0]), 0.6))
    if not parts:
        raise ValueError("no transfer of the set-up in it")
    parts.sort()
    sections = [
        Section(start - margin, end + margin, start, f"{n}. {start / 1e6:.3f} ms")
        for n, (start, end, margin, _) in enumerate(parts, start=1)
    ]
    panel = Panel(rows, sections, tags, [share for *_, share in parts])
    return render(vcd, (panel,), "Set-up after Res: each step at its data-ready event, bytes in order of sending")


def rdata_picture(vcd: Vcd) -> str:
    """The first RDATA of an ADS1256 in a recording of the library: command, t6, 24 bits. Raises ValueError."""
    rows = ("DRDY", "CS", "SCLK", "DIN", "DOUT")
    need(vcd, set(rows))
    falls = vcd.wires["SCLK"].edges_ns(0)  # mode 1: sampled where SCLK falls
    cs = vcd.wires["CS"]
    for start, end in zip(cs.edges_ns(0).tolist(), cs.edges_ns(1).tolist(), strict=False):
        at = falls[(falls > start) & (falls <= end)].tolist()
        sent = spi_bytes(vcd, "DIN", at)
        if len(sent) != 4 or sent[0].text != "01":
            continue
        word = spi_bytes(vcd, "DOUT", at)[1:]
        code = int("".join(t.text for t in word), 16)
        signed = code - (code >> 23 << 24)
        margin = (end - start) // 30
        tags = [Tag("DIN", sent[0].start_ns, sent[0].end_ns, "01 RDATA"), *word]
        section = Section(start - 2 * margin, end + margin, start)
        return render(vcd, (Panel(rows, (section,), tags),), f"RDATA at t = {start / 1e6:.3f} ms: code {signed}")
    raise ValueError("no RDATA of four bytes in it")


def main(argv: Sequence[str] | None = None) -> int:
    """Command line; 2 for bad input, with one line that says what would be right."""
    args = list(sys.argv[1:] if argv is None else argv)
    from psabench.boards.psd1 import waveform as waveform_psd1  # which draws with what is above

    pictures = {
        "frame": frame_picture,
        "setup": setup_picture,
        "rdata": rdata_picture,
        "cycle": waveform_psd1.cycle_picture,
        "handover": waveform_psd1.handover_picture,
    }
    if len(args) != 3 or args[1] not in pictures:
        print(f"usage: python -m psabench.report.waveform RUN.vcd {'|'.join(pictures)} OUT.svg", file=sys.stderr)
        return 2
    try:
        svg = pictures[args[1]](read_vcd(Path(args[0])))
        Path(args[2]).write_text(svg, encoding="utf-8")
    except (OSError, ValueError) as err:
        print(f"waveform: {args[0]}: {err}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
