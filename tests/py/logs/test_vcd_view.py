"""`psabench view FILE`: which program is started, how, on what session; a fake program is on the path."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest
from psabench import cli
from psabench.boards.registry import BOARDS
from psabench.logs.sessions import FIRST_ROW_PX, SESSIONS, SHOWN_LINES, shown_lines
from psabench.logs.vcd_span import Span, span_of
from psabench.logs.vcd_view import OPENED_BY
from psabench.logs.viewers import board_texts
from psabench.places import CHECKOUT

HEAD = "$timescale 10 ns $end\n$scope module psa2 $end\n$var wire 1 ! Int $end\n$upscope $end\n$enddefinitions $end\n"


@pytest.fixture
def vcd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A recording from 2 s to 2.05 s, in a folder without a viewer on the path."""
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setenv("DISPLAY", ":7")
    path = tmp_path / "a run.vcd"
    path.write_text(HEAD + "#200000000\n$dumpvars\n1!\n$end\n#200035000\n0!\n#205000000\n")
    return path


def installed(folder: Path, program: str, text: str = 'printf "%s\\n" "$SIGROKDECODE_DIR" "$@" > "$0.log"') -> Path:
    """A program of that name on the path; what it got is in the file that is returned."""
    script = folder / "bin" / program
    script.parent.mkdir(exist_ok=True)
    script.write_text(f"#!/bin/sh\n{text}\n")
    script.chmod(0o755)
    return script.with_suffix(".log")


def test_pulseview_starts_on_the_recording_with_our_decoders_and_a_session(vcd: Path) -> None:
    log = installed(vcd.parent, "pulseview")
    installed(vcd.parent, "gtkwave")
    assert cli.main(["view", str(vcd)]) == 0
    decoders, *words = log.read_text().splitlines()
    assert words == ["-c", "-i", str(vcd), "-I", "vcd"]
    assert (Path(decoders) / "psa2frame/pd.py").is_file()
    assert vcd.with_suffix(".pvs").is_file()


@pytest.mark.parametrize("options", [[], ["--with", "gtkwave"]])
def test_gtkwave_starts_where_it_is_named_or_alone(options: list[str], vcd: Path) -> None:
    if options:
        installed(vcd.parent, "pulseview")
    log = installed(vcd.parent, "gtkwave")
    assert cli.main(["view", str(vcd), *options]) == 0
    assert log.read_text().splitlines()[1:] == [str(vcd), str(vcd.with_suffix(".gtkw"))]
    assert "\npsa2.Int\n" in vcd.with_suffix(".gtkw").read_text()


@pytest.mark.parametrize("program", ["pulseview", "gtkwave"])
def test_print_needs_no_program_and_a_shell_takes_it(
    program: str, vcd: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("DISPLAY")
    assert cli.main(["view", str(vcd), "--with", program, "--print"]) == 0
    words = [w for w in shlex.split(capsys.readouterr().out) if "=" not in w]
    assert words[0] == program
    assert str(vcd) in words


def test_a_session_that_its_user_has_changed_stays(vcd: Path) -> None:
    installed(vcd.parent, "pulseview")
    vcd.with_suffix(".pvs").write_text("mine")
    assert cli.main(["view", str(vcd)]) == 0
    assert vcd.with_suffix(".pvs").read_text() == "mine"
    assert vcd.with_suffix(".gtkw").is_file()


def test_a_viewer_that_fails_is_an_error_of_the_bench(vcd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    installed(vcd.parent, "pulseview", "exit 9")
    assert cli.main(["view", str(vcd)]) == 3
    assert capsys.readouterr().err == "psabench: pulseview: expected exit status 0, got 9\n"


def test_what_to_install_is_one_line(vcd: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["view", str(vcd)]) == 2
    assert (
        "expected pulseview (apt-get install pulseview), got none; psabench panel --recording "
        in capsys.readouterr().err
    )
    installed(vcd.parent, "pulseview")
    assert cli.main(["view", str(vcd), "--with", "gtkwave"]) == 2
    assert (
        "expected gtkwave (apt-get install gtkwave), got none; psabench panel --recording " in capsys.readouterr().err
    )


def test_without_a_display_nothing_is_started(
    vcd: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    log = installed(vcd.parent, "pulseview")
    monkeypatch.delenv("DISPLAY")
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    assert cli.main(["view", str(vcd)]) == 2
    assert "got none; --print shows the command" in capsys.readouterr().err
    assert not log.exists()


@pytest.mark.parametrize("ending", OPENED_BY)
def test_other_files_get_what_opens_them_in_one_line(ending: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["view", f"run{ending}"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert line.startswith(f"psabench: run{ending}: expected a VCD file, got {ending}; ")
    assert line.endswith(OPENED_BY[ending].format(file=f"run{ending}"))


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["none.vcd"], "none.vcd: expected a VCD file, got no such file"),
        ([str(CHECKOUT / "Makefile")], "expected a VCD file with a scope and wires"),
        (["x.vcd", "--can", "slcan:x"], "view: expected a file or --can, got both"),
        (["x.vcd", "--for", "1"], "view: expected a file or --for, got both"),
        (["--print"], "--print: expected a VCD file, got none"),
        (["--with", "gtkwave"], "--with: expected a VCD file, got none"),
    ],
)
def test_view_says_what_is_wrong(words: list[str], text: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["view", *words]) == 2
    assert text in capsys.readouterr().err


# ---- what the session shows


def begins(texts: dict[str, str]) -> tuple[int, int]:
    """Where PulseView and GTKWave begin, ns, each as it counts."""
    pulseview = re.search(r"^offset=22 serialization::archive 18 0 0 0 0 (\d+) ", texts[".pvs"], re.MULTILINE)
    gtkwave = re.search(r"^\[timestart\] (\d+)$", texts[".gtkw"], re.MULTILINE)
    assert pulseview
    assert gtkwave
    return int(pulseview[1]) * 10, int(gtkwave[1])


def test_a_late_recording_is_shown_from_its_first_edge_on(vcd: Path) -> None:
    span = span_of(vcd)
    assert span == Span(2_000_000_000, 2_000_350_000, 2_050_000_000)
    assert begins(board_texts("psa2", span)) == (350_000, 2_000_350_000)


@pytest.mark.parametrize("board", BOARDS)
def test_a_recording_from_power_on_is_shown_where_its_board_begins(board: str) -> None:
    session = SESSIONS[board]
    assert begins(board_texts(board, Span(0, 10, 10**9))) == (session.from_ns, session.gtk_from_ns)
    assert begins(board_texts(board, Span(1000, 2000, 10**9))) == (session.from_ns - 1000, session.gtk_from_ns)


@pytest.mark.parametrize("board", BOARDS)
def test_pulseview_draws_as_many_lines_as_leave_room_for_the_decoded_rows(board: str) -> None:
    """In PulseView 0.4.2, 1000 x 720: a line takes its height and 16 px, a row 24.5, a stack one more row."""
    shown, session = shown_lines(board), SESSIONS[board]
    text = board_texts(board, Span(0, 10, 10**9))[".pvs"]
    hidden = re.findall(r"^\[(\w+)\]\nname=\1\nenabled=false$", text, re.MULTILINE)
    assert sorted([*shown, *hidden]) == sorted(BOARDS[board].lines)
    assert 0 < len(shown) <= SHOWN_LINES
    assert f"\nv_offset={FIRST_ROW_PX}\n" in text
    rows = {"spi": 2, "ads128x": 2, "ads1256": 2, "psd1cycle": 3, "psa2frame": 2, "uart": 2}
    decoded_px = sum(24.5 * (1 + sum(rows.get(d.id, 1) for d in stack.decoders)) for stack in session.stacks)
    assert -FIRST_ROW_PX + len(shown) * (session.trace_height + 16) + decoded_px <= 580
