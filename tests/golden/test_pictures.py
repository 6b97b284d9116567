"""The waveform pictures of the docs are drawn from the golden traces; GOLDEN=rewrite draws them again."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from psabench.boards.psd1.waveform import cycle_picture, handover_picture
from psabench.link.vcd import Vcd, read_vcd
from psabench.report.waveform import frame_picture, setup_picture

HERE = Path(__file__).resolve().parent
IMG = HERE.parents[1] / "docs" / "img"


@pytest.mark.parametrize(
    ("trace", "draw", "picture", "texts"),
    [
        ("setup", setup_picture, "setup.svg", "1. 63.106 ms|41|00|56|50|00|02|50|00|04|53|00|82|6. 126.235 ms"),
        ("first_frames", frame_picture, "frame.svg", "X = |Y = |Z = |T = |pause of 4 CLK periods"),
        ("psd1_cycle", cycle_picture, "psd1_cycle.svg", "400 ns|700 ns|800 ns|13 600 ns = 17 periods|X = |Y = |Z = "),
        (
            "psd1_cycle",
            handover_picture,
            "psd1_handover.svg",
            "100 ns to DR|500 ns to the next|1 000 ns the host's|700 ns",
        ),
    ],
)
def test_pictures_in_the_docs_show_the_golden_traces(
    trace: str, draw: Callable[[Vcd], str], picture: str, texts: str
) -> None:
    svg = draw(read_vcd(HERE / f"{trace}.vcd"))
    shown = "|".join(e.text or "" for e in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text"))
    for text in texts.split("|"):
        assert text in shown
    if os.environ.get("GOLDEN") == "rewrite":
        (IMG / picture).write_text(svg, encoding="utf-8")
    assert (IMG / picture).read_text(encoding="utf-8") == svg
