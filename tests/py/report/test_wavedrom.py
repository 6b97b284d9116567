"""WaveDrom JSON of a window: every edge of the recording is in it, wavedrom (PyPI) draws it; the same window as SVG."""

from __future__ import annotations

import json
import random
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import wavedrom
from psabench import cli
from psabench.link.vcd import Vcd, Wire, read_vcd
from psabench.report.wavedrom import MOST_COLUMNS, Window, wavedrom_text, window_picture

GOLDEN = Path(__file__).resolve().parents[2] / "golden"
TEXT = "{http://www.w3.org/2000/svg}text"


def recording(end_ns: int = 1000, /, **edges: Sequence[int]) -> Vcd:
    """Lines that are low at first and change at these instants."""
    wires = {
        name: Wire(np.array([0, *t_ns], np.int64), np.arange(len(t_ns) + 1, dtype=np.uint8) % 2)
        for name, t_ns in edges.items()
    }
    return Vcd(10, 0, end_ns, wires)


def waves(vcd: Vcd, *lines: str, start_ns: int = 0, end_ns: int = 1000, tick_ns: int = 0) -> dict[str, Any]:
    """The JSON, its form checked."""
    shown: dict[str, Any] = json.loads(wavedrom_text(vcd, Window(lines, start_ns, end_ns, tick_ns), "title"))
    assert set(shown) == {"signal", "head", "foot", "config"}
    assert shown["head"] == {"text": "title"}
    assert len({len(row["wave"]) for row in shown["signal"]}) == 1
    for row in shown["signal"]:
        assert set(row) <= {"name", "wave", "data"}
        assert set(row["wave"]) <= set("01.=")
        assert row["wave"][0] != "."
        assert row["wave"].count("=") == len(row.get("data", []))
    return shown


def by_name(shown: dict[str, Any]) -> dict[str, str]:
    return {row["name"]: row["wave"] for row in shown["signal"]}


def test_a_column_is_a_tick_and_edges_begin_columns() -> None:
    vcd = recording(A=[300, 500], B=[400], D0=[300], D1=[500, 700], D10=[700], DX=[1])
    shown = waves(vcd, "A", "B", "D", start_ns=100, end_ns=800)
    assert shown["signal"] == [
        {"name": "A", "wave": "0.1.0..."},
        {"name": "B", "wave": "0..1...."},
        {"name": "D[2:0]", "wave": "=.=.=.=.", "data": ["0h", "1h", "3h", "5h"]},
    ]
    assert shown["foot"] == {"text": "a column is 100 ns, the first begins at 100 ns"}


def test_the_first_column_begins_a_little_earlier_where_edges_would_lie_between_columns() -> None:
    shown = waves(recording(A=[300, 500]), "A", start_ns=130, end_ns=700)
    assert shown["signal"] == [{"name": "A", "wave": "010."}]
    assert shown["foot"] == {"text": "a column is 200 ns, the first begins at 100 ns"}


@pytest.mark.parametrize("edges", [[], [500]])
def test_a_line_that_rests_is_drawn(edges: list[int]) -> None:
    assert by_name(waves(recording(A=edges), "A", tick_ns=250)) == {"A": "0.1.." if edges else "0...."}
    assert by_name(waves(recording(A=edges), "A"))["A"][0] == "0"


def random_recording(draw: random.Random) -> Vcd:
    """Lines with their own periods, as clocks that are no multiples of each other, cut to 10 ns."""
    edges = {}
    for line in ("A", "B", "D0", "D1", "D2"):
        period = draw.choice([100, 488.28, 137, 1000]) * draw.choice([1, 1, 10])
        edges[line] = [int(k * period) // 10 * 10 for k in range(1, int(50_000 / period)) if draw.random() < 0.7]
    return recording(50_000, **edges)


@pytest.mark.parametrize("seed", range(12))
def test_every_edge_of_the_window_is_an_edge_of_the_picture(seed: int) -> None:
    draw = random.Random(seed)
    vcd = random_recording(draw)
    start_ns, end_ns = draw.randrange(0, 20_000), draw.randrange(25_000, 50_000)
    shown = waves(vcd, "A", "B", "D0", "D1", "D2", start_ns=start_ns, end_ns=end_ns)
    tick_ns, first_ns = (int(word) for word in shown["foot"]["text"].split() if word.isdigit())
    assert start_ns - tick_ns < first_ns <= start_ns
    assert len(shown["signal"][0]["wave"]) <= MOST_COLUMNS
    for name, wave in by_name(shown).items():
        at_ns = first_ns + tick_ns * np.arange(len(wave))
        level, levels = 0, []
        for mark in wave:
            level = level if mark == "." else int(mark)
            levels.append(level)
        assert levels == vcd.wires[name].at(at_ns).tolist()
        t_ns = vcd.wires[name].t_ns[1:]
        assert sum(m != "." for m in wave[1:]) == np.count_nonzero((t_ns > first_ns) & (t_ns <= at_ns[-1]))
        assert end_ns - at_ns[-1] < tick_ns


@pytest.mark.parametrize(
    ("window", "says"),
    [
        (Window(["E"], 0, 1000), "expected the lines E, got A, B"),
        (Window([""], 0, 1000), "expected the lines , got A, B"),
        (Window(["A"], 500, 500), "window: expected 0 <= from < to <= 1000 ns, got from 500 to 500 ns"),
        (Window(["A"], -1, 500), "got from -1 to 500 ns"),
        (Window(["A"], 0, 1001), "got from 0 to 1001 ns"),
        (Window(["A"], 0, 1000, 20), "tick: expected up to 10 ns, the shortest pulse of these lines, got 20 ns"),
        (Window(["A"], 0, 1000, -1), "tick: expected up to 10 ns"),
    ],
)
def test_a_window_that_cannot_be_drawn_is_rejected(window: Window, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        wavedrom_text(recording(A=[100, 110], B=[5]), window, "")


def test_too_many_columns_are_rejected() -> None:
    vcd = recording(20_010, A=[100, 110])
    assert len(by_name(waves(vcd, "A", end_ns=19_989))["A"]) == MOST_COLUMNS - 1
    with pytest.raises(ValueError, match=rf"window: expected at most {MOST_COLUMNS} columns, got 2001 of 10 ns"):
        wavedrom_text(vcd, Window(["A"], 0, 19_990), "")


def test_what_is_before_the_window_does_not_count() -> None:
    shown = waves(recording(A=[100, 110, 300, 500]), "A", start_ns=200, end_ns=700)
    assert shown["foot"] == {"text": "a column is 200 ns, the first begins at 100 ns"}


def test_a_window_of_a_golden_trace_is_drawn_by_wavedrom_and_by_us(tmp_path: Path) -> None:
    out, svg = tmp_path / "cycle.json", tmp_path / "cycle.svg"
    lines = ["A0", "RFX", "SCLK", "SDAT", "FL2", "CS", "AB"]
    words = f"waveform {GOLDEN}/psd1_cycle.vcd --from 9.8785ms --to 9.931ms --lines {','.join(lines)}"
    assert cli.main([*words.split(), "--wavedrom", str(out), "--svg", str(svg), "--title", "a < b"]) == 0
    shown = json.loads(out.read_text())
    assert shown["signal"][-1]["data"] == ["0h", "1h", "0h", "2h", "0h"]
    assert by_name(shown)["SCLK"].count("1") == 48
    assert shown["config"] == {"skin": "narrow"}
    drawing = wavedrom.render(out.read_text()).tostring()
    texts = [e.text for e in ElementTree.fromstring(drawing).iter(TEXT)]
    spans = [e.text for e in ElementTree.fromstring(drawing).iter("{http://www.w3.org/2000/svg}tspan")]
    assert {*lines[:-1], "AB[1:0]", "0h", "1h", "2h"} <= {*texts, *spans}
    rows = [e.text for e in ElementTree.fromstring(svg.read_text()).iter(TEXT)]
    assert rows[0] == "a < b"
    assert {*lines[:-1], "AB0", "AB1"} <= set(rows)


def test_windows_stand_below_one_another() -> None:
    vcd = read_vcd(GOLDEN / "pik_latch.vcd")
    windows = [Window(["CLK", "FZP"], 0, 1_000_000, title="first"), Window(["LATCH"], 0, 24_000_000, title="second")]
    texts = [e.text for e in ElementTree.fromstring(window_picture(vcd, windows, "t")).iter(TEXT)]
    assert [t for t in texts if t in ("CLK", "FZP", "LATCH", "first", "second")] == "CLK FZP first LATCH second".split()
    with pytest.raises(ValueError, match="expected 0 <= from"):
        window_picture(vcd, [Window(["CLK"], 5, 5)], "t")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("--decoders --dir d --wavedrom x.json", "expected a VCD file, got none"),
        ("--wavedrom x.json", "expected a VCD file, got none"),
        ("{vcd} --wavedrom x.json --lines NO", "setup.vcd: expected the lines NO"),
        ("{vcd} --svg x.svg --from 1 --to 2", "setup.vcd: window: expected 63000000 <= from < to"),
        ("{vcd} --svg x.svg --from 1h --to 1e999", "--to"),
        ("{vcd} --svg x.svg --from soon", "--from: expected a number, got 'soon'"),
        ("nothing.vcd --svg x.svg", "nothing.vcd: expected a VCD file, got no such file"),
        ("{text} --svg x.svg", "expected a VCD file, got"),
    ],
)
def test_the_command_says_what_is_wrong(
    words: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    line = words.format(vcd=GOLDEN / "setup.vcd", text=__file__)
    assert cli.main(["waveform", *line.split()]) == 2
    assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
