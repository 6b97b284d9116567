"""Texts of pictures in Russian: translated, and inside the picture where they are longer than the English ones."""

from __future__ import annotations

import pytest
from matplotlib.figure import Figure
from matplotlib.text import Text
from psabench.report.language import reports_in
from psabench.report.picture_texts import in_two_lines, localise_texts

LABEL = "largest error of the readings of all positions, in seconds of arc"


def a_figure(width_in: float) -> Figure:
    figure = Figure(figsize=(width_in, 1.6), layout="constrained")
    ax = figure.subplots()
    ax.plot([0, 1], [0, 1], label="mean of realisations")
    ax.set_xticks([0, 1], ["error at the end", "largest error in motion"])
    ax.set_ylabel("levelling rate S, deg/h")
    ax.legend(loc="upper left")
    return figure


def texts_of(figure: Figure) -> set[str]:
    return {t.get_text() for t in figure.findobj(Text)}


def test_labels_legends_and_named_ticks_are_translated() -> None:
    with reports_in("ru"):
        figure = a_figure(5.0)
        localise_texts(figure)
        figure.draw_without_rendering()
        texts = texts_of(figure)
    assert {"среднее", "скорость S, град/ч", "в конце", "в движении"} <= texts
    assert "mean of realisations" not in texts


def test_a_text_that_does_not_fit_becomes_two_lines() -> None:
    with reports_in("ru"):
        figure = Figure(figsize=(2.5, 1.5), layout="constrained")
        figure.subplots().set_title(LABEL)
        localise_texts(figure)
    (title,) = [t for t in texts_of(figure) if t.replace("\n", " ") == LABEL]
    assert title.count("\n") == 1


def test_english_pictures_are_as_they_were() -> None:
    figure = a_figure(2.5)
    before = texts_of(figure)
    localise_texts(figure)
    assert texts_of(figure) == before


@pytest.mark.parametrize(
    ("text", "lines"), [("a b c d", "a b\nc d"), ("word", "word"), ("long-first x", "long-first\nx")]
)
def test_the_break_is_nearest_to_the_middle(text: str, lines: str) -> None:
    assert in_two_lines(text) == lines
