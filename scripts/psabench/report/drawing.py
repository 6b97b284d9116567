"""Pictures of lines as SVG: rows of a recording, values below them, intervals with their dimensions.

Same input, same bytes; light and dark pages.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

from psabench.errors import expected
from psabench.link.vcd import Vcd, Wire

WIDTH, LEFT, RIGHT = 1120, 76, 18  # px: picture, column of names, margin
ROW, HIGH, GAP = 32, 16, 22  # px: row pitch, height of a pulse, between sections
LANE = 22  # px: pitch of intervals below the rows
CHARACTER = 6.8  # px: width, with a margin

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
    if x1 - x0 > CHARACTER * len(dim.label):
        out.append(_text((x0 + x1) / 2, y - 4, "dimtext", dim.label, "middle"))
    elif x1 + CHARACTER * len(dim.label) < s.x1 + RIGHT:
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
        name = _time_name(t - s.section.zero_ns)
        if s.x(t) + max(44, 3 + CHARACTER * len(name)) < s.x1 + RIGHT:
            out.append(_text(s.x(t) + 3, bottom + 2, "note", name))
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
        raise ValueError(expected(f"the lines {', '.join(missing)}", ", ".join(vcd.wires)))
