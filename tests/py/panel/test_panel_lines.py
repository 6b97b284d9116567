"""Lines of a board in the panel: edges and frames of a VCD file, values as CAN has them, files that are bad."""

from __future__ import annotations

import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any, cast

import numpy as np
import panel_run as run
import pytest
from psabench.boards.board import PARALLEL_BUS
from psabench.boards.psa2.device import CODE_V
from psabench.boards.psa2.frames import Frames
from psabench.errors import BadInput
from psabench.link.vcd import Wire, read_vcd
from psabench.panel.handlers import HANDLERS
from psabench.panel.recorded import line_words, lines_view
from psabench.panel.recorded.line_window import COLUMNS, MOST_LINES, line_part
from psabench.panel.recorded.lines_view import LinesView
from psabench.panel.recorded.opening import Opening
from psabench.panel.recorded.source import RecordingSource
from psabench.panel.worker import Worker
from psabench.places import find_emulator
from psabench.shell.lexer import Wrong
from recorded_lines import record_psa2


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Frames]:
    """100 ms of a PSA-2, the middle of it with a pulse of CLK missing in each frame; what CAN had of it."""
    path = tmp_path_factory.mktemp("lines") / "run.vcd"
    return path, record_psa2(path)


@pytest.fixture
def view(recorded: tuple[Path, Frames]) -> LinesView:
    return opened(recorded[0])


def opened(path: Path) -> LinesView:
    found = RecordingSource(path).open()
    assert isinstance(found, LinesView)
    return found


def windowed(view: LinesView, **request: Any) -> dict[str, Any]:
    about = view.about()
    whole = {"from_ns": about["start_ns"], "to_ns": about["end_ns"], "columns": 500, "lines": ["Int", "CLK"]}
    return view.window(whole | request)


def frames_at(view: LinesView, what: str) -> list[int]:
    """Places of all frames of a kind, found one after the other."""
    found: list[int] = []
    at_ns = view.about()["start_ns"]
    while True:
        try:
            frame = view.next_frame({"at_ns": at_ns, "what": what})
        except Wrong:
            return found
        found.append(frame["place"])
        at_ns = frame["begin_ns"]


def test_the_values_are_those_that_can_has(view: LinesView, recorded: tuple[Path, Frames]) -> None:
    view.line("wait 10")
    view.take(every_unit=True)
    t_s, _ = view.channels["psa2"].latest("x")
    shown = np.column_stack([view.channels["psa2"].latest(n)[1] for n in ("x", "y", "z", "t")])
    can = recorded[1]
    sent = {tuple(row) for row in np.column_stack([np.rint(can.u_v / CODE_V), can.temp_degc]).tolist()}
    assert len(t_s) == view.about()["frames"] - view.about()["torn"]
    assert {tuple(row) for row in shown.tolist()} <= sent
    assert (np.diff(t_s) > 0).all()
    (unit,) = view.state(lines=False)["overview"]
    assert (unit["board"], unit["torn"], unit["samples"]) == ("PSA-2", view.about()["torn"], len(t_s))
    assert view.state(lines=False)["ended"] == "end"


def test_torn_frames_are_found_and_say_what_is_wrong(view: LinesView) -> None:
    about, torn = view.about(), frames_at(view, "torn")
    assert about["frames"] == len(frames_at(view, "frame"))
    assert len(torn) == about["torn"] > 20
    assert torn == frames_at(view, "error")
    assert torn == list(range(torn[0], torn[0] + len(torn)))  # one after the other, in the middle
    first = view.next_frame({"at_ns": 0, "what": "torn"})
    assert first["wrong"] == "torn: 127 bits, not 128"
    before = view.next_frame({"at_ns": first["begin_ns"], "what": "frame", "back": True})
    assert (before["place"], before["wrong"]) == (first["place"] - 1, "")


def test_a_frame_that_is_missing_is_an_error(recorded: tuple[Path, Frames], tmp_path: Path) -> None:
    vcd = read_vcd(recorded[0])
    falls, rises = vcd.wires["Int"].edges_ns(0), vcd.wires["Int"].edges_ns(1)
    cut_ns = (int(falls[3]) - 1000, int(rises[4]) + 1000)  # the emulator's own text without two frames
    lines, keep, kept = recorded[0].read_text().splitlines(keepends=True), True, []
    for line in lines:
        if line.startswith("#"):
            keep = not cut_ns[0] <= int(line[1:]) * vcd.unit_ns <= cut_ns[1]
        if keep:
            kept.append(line)
    (tmp_path / "cut.vcd").write_text("".join(kept))
    found = opened(tmp_path / "cut.vcd")
    error = found.next_frame({"at_ns": 0, "what": "error"})
    assert error["wrong"] == "2 missing before it"
    found.line(f"at {error['end_ns'] / 1e9}")
    assert found.state(lines=False)["overview"][0]["lost"] == 2


def test_a_window_has_the_edges_of_the_recording(view: LinesView, recorded: tuple[Path, Frames]) -> None:
    vcd = read_vcd(recorded[0])
    frame = view.next_frame({"at_ns": 0, "what": "frame"})
    near = windowed(view, from_ns=frame["begin_ns"] - 1000, to_ns=frame["end_ns"] + 1000)
    clk = near["lines"][1]
    t_ns = vcd.wires["CLK"].t_ns
    assert clk["t_ns"] == t_ns[(t_ns > frame["begin_ns"] - 1000) & (t_ns <= frame["end_ns"] + 1000)].tolist()
    assert (clk["level"], clk["edges"]) == (0, 256)
    (shown,) = near["frames"]
    assert [w["text"].split(" = ")[0] for w in shown["words"]] == ["X", "Y", "Z", "T"]


def test_more_edges_than_columns_are_what_each_column_has(view: LinesView, recorded: tuple[Path, Frames]) -> None:
    wire = read_vcd(recorded[0]).wires["CLK"]
    whole = windowed(view, columns=300)
    int_, clk = whole["lines"]
    assert "t_ns" in int_
    assert (whole["frames"], whole["seen"]) == ([], view.about()["frames"])
    assert len(clk["columns"]) == 300
    begin, end = whole["from_ns"], whole["to_ns"]
    for k, kind in enumerate(clk["columns"]):
        a, b = (begin + (end - begin) * n // 300 for n in (k, k + 1))
        moved = ((wire.t_ns > a) & (wire.t_ns <= b)).any()
        assert kind == ("2" if moved else str(int(wire.at(a))))


def test_a_column_says_whether_the_line_moves_in_it() -> None:
    wire = Wire(np.array([0, 10, 41, 42, 43, 44]), np.array([0, 1, 0, 1, 0, 1], np.uint8))
    assert line_part("A", wire, 0, 80, 4) == {"name": "A", "level": 0, "edges": 5, "columns": "2121"}
    assert line_part("A", wire, 0, 80, 5)["t_ns"] == [10, 41, 42, 43, 44]
    assert line_part("A", wire, 42, 80, 5) == {"name": "A", "level": 1, "edges": 2, "t_ns": [43, 44]}


BAD_WINDOWS: list[dict[str, Any]] = [
    {"from_ns": 5, "to_ns": 5},
    {"from_ns": -1},
    {"to_ns": 1 << 70},
    {"to_ns": 1.5},
    {"columns": 0},
    {"columns": COLUMNS + 1},
    {"columns": True},
    {"lines": ["../Int"]},
    {"lines": "Int"},
    {"lines": [["Int"]]},
    {"lines": ["Int"] * (MOST_LINES + 1)},
]


@pytest.mark.parametrize("request_", BAD_WINDOWS)
def test_a_window_that_cannot_be_is_rejected(view: LinesView, request_: dict[str, Any]) -> None:
    with pytest.raises(Wrong, match="expected"):
        windowed(view, **request_)
    with pytest.raises(Wrong, match="expected frame, torn, error"):
        view.next_frame({"at_ns": 0, "what": "x" * 1000})


def test_time_goes_on_and_back(view: LinesView) -> None:
    view.line("at 0.23")
    view.take(every_unit=True)
    first = view.describe()["history"]
    view.line("at 0.25")
    view.take(every_unit=True)
    assert view.describe()["history"] != first
    assert view.line("at 0.23")["rewound"]
    view.take(every_unit=True)
    assert view.describe()["history"] == first
    view.line("at 1e6")
    assert view.now_s() == view.about()["end_ns"] / 1e9


def test_words_of_a_psd1_are_what_its_host_reads_on_the_bus(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole, bus = tmp_path / "psd1.vcd", tmp_path / "bus.vcd"
    words = ["converters", "--unit", "psd1", "--vcd", str(whole), "--pace", "free", "--for", "150ms", "--quiet"]
    subprocess.run([find_emulator(), *words], check=True, capture_output=True)
    vcd = read_vcd(whole)
    bus.write_text(vcd.window(PARALLEL_BUS, vcd.start_ns, vcd.end_ns))
    serial, strobes = opened(whole), opened(bus)
    assert (serial.about()["what"], serial.about()["board"], serial.about()["errors"]) == ("word", "PSD-1", 0)
    assert strobes.about()["what"] == "strobe"
    sent = [text.split("(")[1][:4] for text in texts(serial)]
    read = [text.split()[1][:4] for text in texts(strobes) if text.startswith("R")]
    assert len(sent) > 6
    assert sent == read
    serial.line("wait 1")
    serial.take(every_unit=True)
    assert serial.channels["psd1"].count == len(sent) // 3
    lows = sum(len(vcd.wires[line].edges_ns(0)) for line in ("RFX", "RFY", "RFZ"))  # those of the set-up, too
    monkeypatch.setattr(line_words, "MOST_WORDS", lows - 3)
    assert 0 < opened(whole).about()["frames"] < len(sent)


def texts(view: LinesView) -> list[str]:
    """The words of all frames."""
    about = view.about()
    places = [view.next_frame({"at_ns": about["start_ns"], "what": "frame"})]
    while places[-1]["place"] < about["frames"]:
        places.append(view.next_frame({"at_ns": places[-1]["begin_ns"], "what": "frame"}))
    span = {"columns": 100, "lines": []}
    shown = [view.window(span | {"from_ns": p["begin_ns"], "to_ns": p["end_ns"]})["frames"] for p in places]
    return [w["text"] for frames in shown for f in frames for w in f["words"]]


def test_lines_of_no_board_are_edges_alone(tmp_path: Path) -> None:
    path = tmp_path / "two.vcd"
    path.write_text(HEAD + "#0\n0!\n#10\n1!\n#20\n0!\n")
    found = opened(path)
    assert (found.about()["frames"], found.about()["lines"], found.unit) == (0, ["A"], "")
    assert windowed(found, lines=["A"])["lines"][0]["t_ns"] == [10, 20]
    assert found.describe()["units"] == found.state(lines=False)["overview"] == []
    found.line("wait 1")
    assert found.take(every_unit=True) == {}


HEAD = "$timescale 1 ns $end $scope module x $end $var wire 1 ! A $end $upscope $end $enddefinitions $end\n"
LINES_OF_A_FRAME = "".join(f"$var wire 1 {c} {n} $end " for c, n in zip("abc", ("Int", "Data", "CLK"), strict=True))

BAD: dict[str, tuple[Callable[[Path], object], str]] = {
    "none": (lambda _: None, "expected a VCD file, got no such file"),
    "empty": (lambda p: p.write_bytes(b""), "expected a VCD file"),
    "random": (lambda p: p.write_bytes(bytes(range(256)) * 100), "expected a VCD file"),
    "no_end": (lambda p: p.write_text(HEAD.replace("$enddefinitions $end", "") + "#0\n" * 100), "expected a VCD file"),
    "no_wire": (lambda p: p.write_text("$timescale 1 ns $end $enddefinitions $end #0\n"), "expected $var of 1 bit"),
    "no_scale": (lambda p: p.write_text(HEAD.replace("1 ns", "7 ns") + "#0\n0!\n"), "expected $timescale"),
    "no_time": (lambda p: p.write_text(HEAD + "0!\n"), "expected a time and a level"),
    "no_level": (lambda p: p.write_text(HEAD + "#0\n#10\n"), "expected a time and a level"),
    "wires": (
        lambda p: p.write_text(HEAD.replace("$upscope", " ".join(f"$var wire 1 k{n} W{n} $end" for n in range(2000)))),
        "expected at most 1024 wires",
    ),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_line(tmp_path: Path, name: str) -> None:
    path, (make, why) = tmp_path / f"{name}.vcd", BAD[name]
    make(path)
    with pytest.raises(BadInput) as e:
        opened(path)
    assert str(path) in str(e.value)
    assert why in str(e.value)
    assert "\n" not in str(e.value)


def hostile(body: str) -> str:
    """A recording of a board with such a body."""
    return HEAD.replace("$var wire 1 ! A $end", LINES_OF_A_FRAME) + body


DAMAGED: dict[str, str] = {
    "levels": "#0\n0a\n#5\nq!\n#6\n1a\n",
    "time": "#0\n0a\n#9\n1a\n#5\n0a\n",
    "far": "#0\n0a\n#9\n1a\n#99999999999999999999999\n0a\n",
    "torn_alone": "#0\n1a\n0b\n0c\n" + "".join(f"#{k}\n{k % 2}a\n" for k in range(1, 3000)),
    "clock_alone": "#0\n1a\n0b\n0c\n" + "".join(f"#{k}\n{k % 2}c\n" for k in range(1, 3000)),
    "endless_frame": "#0\n1a\n0b\n0c\n#1\n0a\n" + "".join(f"#{k}\n{k % 2}c\n" for k in range(2, 3000)),
    "endless_words": "#0\n1a\n0b\n0c\n" + "".join(f"#{k}\n{k % 2}{'abc'[k % 3]}\n" for k in range(1, 3000)),
    "no_levels_of_two": "#0\n1a\n#5\n0a\n#9\n1a\n",
}


@pytest.mark.parametrize("name", DAMAGED)
def test_a_hostile_file_is_shown_as_far_as_it_goes(tmp_path: Path, name: str) -> None:
    path = tmp_path / f"{name}.vcd"
    path.write_text(hostile(DAMAGED[name]))
    found = opened(path)
    about = found.about()
    assert about["frames"] == about["torn"]
    windowed(found, lines=about["lines"])
    for k in (1, 2):
        found.line(f"wait {k}")
        found.take(every_unit=True)
    found.state(lines=False)
    if name in ("levels", "time", "far"):
        assert f"#{9 if name != 'levels' else 5}" in about["damage"]
        assert found.ended() == about["damage"]


def test_a_long_file_is_read_to_so_many_edges(recorded: tuple[Path, Frames], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lines_view, "MOST_EDGES", 1000)
    about = opened(recorded[0]).about()
    assert not about["whole"]
    assert "read to its" in about["damage"]


def test_it_is_read_in_pieces_that_can_be_stopped(recorded: tuple[Path, Frames]) -> None:
    done: list[float] = []
    RecordingSource(recorded[0]).open_slowly(done.append)
    assert len(done) > 2
    assert done == sorted(done)

    class Enough(Exception):
        pass

    def enough() -> None:
        raise Enough

    opening = Opening(RecordingSource(recorded[0]))
    with pytest.raises(Enough):
        opening.follow(enough)
    opening._thread.join(run.WAIT_S)
    assert not opening._thread.is_alive()


def test_a_page_that_comes_while_a_recording_is_read_sees_how_much(recorded: tuple[Path, Frames]) -> None:
    source = RecordingSource(recorded[0])
    worker = Worker(source, cast(Any, None), cast(Any, None), HANDLERS)
    worker._opening = Opening(source)
    assert worker.hello() == {"kind": "opening", "name": recorded[0].name, "done": 0.0}
    worker._opening.done = 0.4
    assert worker.hello()["done"] == 0.4


def test_a_panel_shows_lines_and_a_bad_file_is_its_error_line(recorded: tuple[Path, Frames], tmp_path: Path) -> None:
    folder = tmp_path / "files"
    folder.mkdir()
    (folder / "a.vcd").symlink_to(recorded[0])
    (folder / "b.vcd").write_text("nothing of the kind\n")
    with run.running("--recording", folder, "--paused", "--out", tmp_path) as panel, panel.socket() as socket:
        hello = run.received(socket, "hello")
        about = hello["recording"]
        assert (about["kind"], about["files"]) == ("lines", ["a.vcd", "b.vcd"])
        error = run.asked(socket, 1, do="recording", name="b.vcd")["error"]
        assert "expected a VCD file" in error
        assert "\n" not in error
        window = {"from_ns": about["start_ns"], "to_ns": about["end_ns"], "columns": 100, "lines": ["Int"]}
        assert run.asked(socket, 2, do="window", **window)["seen"] == about["frames"]
        assert run.asked(socket, 3, do="next", what="torn", at_ns=0)["wrong"] == "torn: 127 bits, not 128"
        assert "error" in run.asked(socket, 4, do="window", from_ns="x")


def test_a_bad_file_ends_the_command_with_status_2(tmp_path: Path) -> None:
    bad = tmp_path / "bad.vcd"
    bad.write_text("nothing of the kind\n")
    run.assert_refuses(bad, tmp_path / "out")


def test_a_bench_has_no_recorded_lines(tmp_path: Path) -> None:
    with run.running("quiet", "--paused", "--out", tmp_path) as panel, panel.socket() as socket:
        assert "a recording of lines" in run.asked(socket, 1, do="window")["error"]
