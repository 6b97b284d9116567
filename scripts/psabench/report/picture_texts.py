"""Texts of a picture in the language of the report: translated before the layout, made to fit where they are longer.

A label or a title that does not fit into its picture becomes two lines; a legend that is wider becomes smaller.
"""

from __future__ import annotations

from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Text
from matplotlib.ticker import FixedFormatter, Formatter, FuncFormatter

from psabench.report.language import is_localised, localised_label

SMALLER, LEAST_PT = 0.96, 6.0  # by which a legend shrinks at a time, and the size of text that can still be read


def localise_texts(figure: Figure) -> None:
    """Labels, titles, legends and named ticks. English stays as it is, to the byte."""
    if not is_localised():
        return
    for text in figure.findobj(Text):
        text.set_text(localised_label(text.get_text()))
    for ax in figure.axes:
        for axis in (ax.xaxis, ax.yaxis):
            axis.set_major_formatter(_localised_ticks(axis.get_major_formatter()))
    figure.draw_without_rendering()
    legends = figure.findobj(Legend)
    listed = {text for legend in legends for text in legend.get_texts()}
    for text in figure.findobj(Text):
        if text not in listed and _is_outside(figure, text):
            text.set_text(in_two_lines(text.get_text()))
    for legend in legends:
        _shrink_legend(figure, legend)


def _localised_ticks(ticks: Formatter) -> Formatter:
    """Those with names: `set_xticks(at, names)` gives one or the other, by what was there before."""
    if isinstance(ticks, FixedFormatter):
        return FixedFormatter([localised_label(name) for name in ticks.seq])
    if isinstance(ticks, FuncFormatter):
        return FuncFormatter(lambda x, at: localised_label(ticks.func(x, at)))
    return ticks


def _is_outside(figure: Figure, what: Text | Legend) -> bool:
    there, picture = what.get_window_extent(), figure.bbox
    return bool(there.x0 < picture.x0 or there.x1 > picture.x1 or there.y0 < picture.y0 or there.y1 > picture.y1)


def in_two_lines(text: str) -> str:
    """Broken at the space that is nearest to its middle."""
    spaces = [k for k, c in enumerate(text) if c == " "]
    if not spaces:
        return text
    at = min(spaces, key=lambda k: abs(k - len(text) / 2))
    return f"{text[:at]}\n{text[at + 1 :]}"


def _shrink_legend(figure: Figure, legend: Legend) -> None:
    texts = legend.get_texts()
    while texts and _is_outside(figure, legend) and (size := float(texts[0].get_fontsize()) * SMALLER) >= LEAST_PT:
        for text in texts:
            text.set_fontsize(size)
        figure.draw_without_rendering()
