"""Decoded rows for GTKWave: a copy of the recording with them, its session, and what a real GTKWave reads of both."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
import pywellen
from psabench import cli
from psabench.boards.registry import BOARDS
from psabench.boards.session import Decoder, Stack
from psabench.link.vcd import read_vcd
from psabench.logs.annotations import _changes_of, read_rows
from psabench.logs.decoded_vcd import write_decoded
from psabench.logs.sessions import GTK_MARGIN_PX, GTK_ROW_PX, decoded_gtkwave_text
from psabench.places import CHECKOUT

from tests.py.boards.test_sigrok import FRAME_IDLE, LINES, frame, sigrok, write

pytestmark = pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")
WHOLE, TORN = "Frame 0: X=1 Y=-2 Z=3 T=0004h ch0 st0", "Torn frame: 127 bits, not 128"


@pytest.fixture
def vcd(tmp_path: Path) -> Path:
    """A torn frame and a whole one, recorded from 2 s on."""
    words = [1, 0xFFFFFFFE, 3, 4]
    edges = frame(200_000, words, clks=127) + frame(400_000, words)
    path = write(tmp_path / "a run.vcd", FRAME_IDLE, edges, 600_000)
    moved = re.sub(r"^#(\d+)$", lambda m: f"#{int(m[1]) + 200_000_000}", path.read_text(), flags=re.MULTILINE)
    path.write_text(moved)
    return path


def texts(path: Path) -> dict[str, list[tuple[int, str]]]:
    """The rows of a copy by the parser of Surfer, which shares nothing with ours: instants in ns, texts."""
    found = pywellen.Waveform(str(path)).all_vars()
    return {v.full_name: [(t * 10, str(x)) for t, x in v.tv] for v in found if v.full_name.startswith("decoded.")}


def test_the_copy_has_the_texts_of_sigrok_at_their_instants_and_every_edge(vcd: Path) -> None:
    written = write_decoded(vcd, 1.0)
    assert written
    copy, _ = written
    rows = texts(copy)
    assert set(rows) == {"decoded.Frame_Words", "decoded.Frame_Frames", "decoded.Frame_Warnings"}
    shown = [(t, text) for row in rows.values() for t, text in row if text]
    assert sorted(text for _, text in shown) == sorted(sigrok(vcd, LINES, "psa2frame=words:frames:warnings"))
    fall_ns = {text: t for t, text in shown}
    assert (fall_ns[TORN], fall_ns[WHOLE]) == (2_000_200_000, 2_000_400_000)
    theirs, ours = read_vcd(copy), read_vcd(vcd)
    assert (theirs.start_ns, theirs.end_ns) == (ours.start_ns, ours.end_ns)
    for name, wire in ours.wires.items():
        assert theirs.wires[name].t_ns.tolist() == wire.t_ns.tolist()
        assert theirs.wires[name].level.tolist() == wire.level.tolist()


def test_a_row_says_where_decoding_ends(vcd: Path) -> None:
    written = write_decoded(vcd, 0.0003)
    assert written
    rows = texts(written[0])
    assert rows["decoded.Frame_Warnings"][-1] == (2_000_300_000, "not decoded after 0.0003 s (--decode)")
    assert "decoded.Frame_Frames" not in rows


def test_a_text_that_ends_where_the_next_begins_leaves_no_gap(tmp_path: Path) -> None:
    """`timing` of each period ends where the next begins."""
    edges = [(t, "Int", (t // 1000) % 2) for t in range(1000, 9000, 1000)]
    path = write(tmp_path / "a.vcd", FRAME_IDLE | {"Int": 0}, edges, 10_000)
    stack = Stack("Period", 0, (Decoder("timing", {"edge": "rising"}, hidden=(1, 2)),), {"Data": "Int"})
    [row] = read_rows(path, [stack], CHECKOUT / "decoders", 1.0)
    assert row.name == "Period_Time"
    assert [text.startswith("2.000 μs") for _, text in row.changes] == [True, True, True, False]
    assert [t for t, _ in row.changes] == [100, 300, 500, 700]


def test_a_copy_is_not_copied_again_and_its_changed_session_stays(vcd: Path) -> None:
    written = write_decoded(vcd, 1.0)
    assert written
    copy, session = written
    session.write_text("mine")
    assert write_decoded(vcd, 1.0) == written
    assert session.read_text() == "mine"
    assert write_decoded(copy, 1.0) is None


def test_texts_that_begin_together_are_one_and_a_later_one_takes_the_place_of_one_that_goes_on() -> None:
    spans = [(1, 9, "cut"), (1, 3, "late"), (5, 5, "short"), (6, 8, "over")]
    assert _changes_of(spans) == [(1, "cut; late"), (5, "short"), (6, "over"), (8, "")]
    assert _changes_of([(1, 2, "a"), (4, 5, "b")]) == [(1, "a"), (2, ""), (4, "b"), (5, "")]


@pytest.mark.parametrize("board", BOARDS)
def test_decoded_rows_come_first_and_the_window_has_room_for_all(board: str) -> None:
    names = [f"Row_{n}" for n in range(12)]
    text = decoded_gtkwave_text(board, names)
    shown = [line for line in text.partition("[sst_expanded] 0\n")[2].splitlines() if not line.startswith("@")]
    assert shown[:12] == [f"decoded.{name}" for name in names]
    drawn = re.findall(rf"{board}\.(\w+)", "\n".join(shown))
    assert sorted(drawn) == sorted(BOARDS[board].lines)
    height = re.search(r"^\[size\] 1400 (\d+)$", text, re.MULTILINE)
    assert height
    assert int(height[1]) >= GTK_MARGIN_PX + GTK_ROW_PX * len(shown)
    assert set(re.findall(r"^@(\d+)$", text, re.MULTILINE)) <= {"28", "22", "200"}


@contextmanager
def without_sigrok(folder: Path, text: str) -> Iterator[str]:
    """A path with a sigrok-cli that is that script, or without one."""
    if text:
        (folder / "sigrok-cli").write_text(f"#!/bin/sh\n{text}\n")
        (folder / "sigrok-cli").chmod(0o755)
    yield str(folder)


@pytest.mark.parametrize(
    ("script", "why"),
    [
        ("", "view: expected sigrok-cli (apt-get install sigrok-cli), got none"),
        ("echo broken >&2; exit 9", "sigrok-cli: expected exit status 0, got 9; broken"),
    ],
)
def test_where_sigrok_fails_the_lines_are_shown_and_a_note_says_why(
    script: str, why: str, vcd: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with without_sigrok(vcd.parent, script) as path:
        monkeypatch.setenv("PATH", path)
        assert cli.main(["view", str(vcd), "--with", "gtkwave", "--print"]) == 0
    out, err = capsys.readouterr()
    assert out == f"gtkwave '{vcd}' '{vcd.with_suffix('.gtkw')}'\n"
    assert err == f"psabench: {why}; no decoded rows\n"


QUESTIONS = """
puts "fold [gtkwave::getVisibleNumTraces] [gtkwave::getTotalNumTraces]"
puts "first [lrange [gtkwave::getDisplayedSignals] 0 2]"
foreach t {2000250000 2000450000 2000590000} {
    gtkwave::setMarker $t
    foreach name {Warnings Frames} { puts "$t [gtkwave::getTraceValueAtMarkerFromName decoded.Frame_$name]" }
}
exit
"""


@pytest.mark.skipif(not (shutil.which("gtkwave") and shutil.which("Xvfb")), reason="gtkwave or Xvfb is not installed")
def test_a_real_gtkwave_shows_the_rows_on_top_and_none_below_the_fold(
    vcd: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["view", str(vcd), "--with", "gtkwave", "--print"]) == 0
    script = vcd.with_name("questions.tcl")
    script.write_text(QUESTIONS)
    with display() as name:
        words = ["gtkwave", "-S", str(script), *(str(vcd.with_suffix(f".decoded{e}")) for e in (".vcd", ".gtkw"))]
        env = {**os.environ, "DISPLAY": name}
        said = subprocess.run(
            words, env=env, capture_output=True, text=True, check=True, timeout=60
        ).stdout.splitlines()
    visible, total = next(line for line in said if line.startswith("fold")).split()[1:]
    assert visible == total
    assert int(total) > len(FRAME_IDLE)
    assert "first decoded.Frame_Words decoded.Frame_Frames decoded.Frame_Warnings" in said
    values = [line for line in said if line.startswith("2000")]
    assert values == [
        f"2000250000 {TORN}",
        "2000250000 ",
        "2000450000 ",
        f"2000450000 {WHOLE}",
        "2000590000 ",
        "2000590000 ",
    ]


@contextmanager
def display() -> Iterator[str]:
    """An X server of its own."""
    with subprocess.Popen(
        ["Xvfb", "-displayfd", "1", "-screen", "0", "1600x1100x24"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as server:
        assert server.stdout
        try:
            yield f":{server.stdout.readline().decode().strip()}"
        finally:
            server.kill()
