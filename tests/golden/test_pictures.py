"""The waveform pictures of the docs are drawn from the golden traces; GOLDEN=rewrite draws them again."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
from psabench.boards.psd1.waveform import cycle_picture, handover_picture
from psabench.link.vcd import Vcd, read_vcd
from psabench.report.wavedrom import Window, window_picture
from psabench.report.waveform import frame_picture, setup_picture

MS = 1_000_000


def shows(title: str, *windows: tuple[str, float, float, str]) -> Callable[[Vcd], str]:
    """A picture of windows: lines, from and to in ms, title."""
    cut = [Window(lines.split(), round(a * MS), round(b * MS), title=text) for lines, a, b, text in windows]
    return lambda vcd: window_picture(vcd, cut, title)


PMKA = shows(
    "PMKA in operation: a sample of each integrator every 4.8 ms, a precision reset of Z",
    (
        "SH CONV MUX0 MUX1",
        9.95,
        10.45,
        "one period: X, Y, Z and K are held and converted; MUX is the integrator that is next",
    ),
    ("SH RP3 TAU0", 9.8, 60, "ten periods: the reset begins with the sample of Z that is beyond Uc, and lasts Ts/2"),
)
PIK = shows(
    "PIK: Z at 1 g",
    ("CLK FZP", 4, 12, "a reset balances the input for one period of CLK"),
    ("FZP LATCH", 0, 24, "LATCH falls every 10 ms and takes the counters"),
)
GYRO = shows(
    "Gyro unit after power-on: READY at 200 ms, a step every 10 ms, FAULT until 570 ms",
    ("STEP READY FAULT", 190, 640, ""),
)
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
        ("pmka_samples", PMKA, "pmka_samples.svg", "SH|MUX1|RP3|one period|ten periods"),
        ("pik_latch", PIK, "pik_latch.svg", "CLK|FZP|LATCH"),
        ("gyro_steps", GYRO, "gyro_steps.svg", "STEP|READY|FAULT"),
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
