"""The command line: each mistake gets one line (what, where, what would be right) and status 2, before any work."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import pytest
from psabench import cli
from psabench.protocol_files import dbc_node
from test_lineport import lines

MISTAKES: list[tuple[str, str]] = [
    ("run", "which procedure? turns, fourier, reversal, compare-converters, gyrocompass, heading-hold or all"),
    (
        "run spin",
        "run spin: no such procedure; turns, fourier, reversal, compare-converters, gyrocompass, heading-hold or all",
    ),
    ("run turns --positions 80", "--positions: turns has no such parameter; it has --axis"),
    ("run all --axis w", "turns: axis is 'w'; it must be x, y or z"),
    ("run turns --out /dev/null/x", "/dev/null/x: "),
    ("run turns --can socketcand:127.0.0.1:1", "--head is missing"),
    ("decode nothing.log", "nothing.log: no such file"),
    ("decode README.md", "README.md: ending .md; python-can reads"),
    ("decode --line nothing.bin", "nothing.bin: no such file"),
    ("decode --line x.bin --board psd1 --out x.csv", "--line: line frames are PSA-2's; of a psd1 a CAN log is decoded"),
    ("decode --line nothing.bin --board psa1", "nothing.bin: no such file"),
    ("decode --line /", "/: a folder; a file is wanted"),
    ("decode --line /dev/null --word-bits 17", "word_bits is 17; a PSA-2 sends words of 16, 24 or 32 bits"),
    ("decode --line /dev/null --out /dev/null/x.csv", "/dev/null/x.csv: "),
]


@pytest.mark.parametrize(("line", "words"), MISTAKES, ids=[m[0] for m in MISTAKES])
def test_a_mistake_gets_one_line_and_status_2(
    line: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert cli.main(line.split()) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("psabench: ")
    assert words in err


@pytest.mark.parametrize(
    ("convert", "text"),
    [
        (cli.natural, "-3"),
        (cli.natural, "x"),
        (cli.positive, "0"),
        (cli.positive, "nan"),
        (cli.positive, "inf"),
        (cli.node_id, "0"),
        (cli.node_id, "128"),
        (cli.yes_no, "maybe"),
        (cli.board_name, "psd9"),
    ],
)
def test_an_argument_out_of_range_is_refused(convert: object, text: str) -> None:
    assert callable(convert)
    with pytest.raises(argparse.ArgumentTypeError, match="expected"):
        convert(text)


@pytest.mark.parametrize(("name", "board"), [("psa1", "psa2"), ("pik5", "pik"), ("pik6", "pik"), ("pmka", "pmka")])
def test_another_name_of_a_board_is_taken_as_the_board(
    name: str, board: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    node = dbc_node(board)
    Path("bus.log").write_text("".join(f"(0.{k}) can0 {k}8{node}#0000000000000000\n" for k in (1, 2, 3)))
    tables = []
    for known in (name, board):
        assert cli.main(["decode", "bus.log", "--board", known]) == 0
        tables.append(capsys.readouterr())
    assert tables[0] == tables[1]
    assert "frames 1" in tables[0].err


LOGS: list[tuple[str, str, str]] = [
    ("empty", "", "no frame of node 5; nodes with frames: none"),
    ("no samples", "(0.1) can0 705#00\n(0.2) can0 000#0100\n", "no frame of node 5; nodes with frames: none"),
    (
        "pair, FD frame, block and fast form of others",
        "(0.1) can0 187#15DA1F0100000000\n(0.2) can0 287#000000534C19E4B8\n(0.3) can0 201##100\n(0.4) can0 489##100\n"
        "(0.5) can0 3FF#0000000000000000\n",
        "no frame of node 5; nodes with frames: 1, 7, 9, 127",
    ),
    ("29-bit, remote", "(0.1) can0 00000187#00\n(0.2) can0 187#R\n", "no frame of node 5; nodes with frames: none"),
    ("half a pair", "(0.1) can0 185#15DA1F0100000000\n", "only parts of frames of node 5; others with frames: none"),
]


@pytest.mark.parametrize(("log", "words"), [x[1:] for x in LOGS], ids=[x[0] for x in LOGS])
def test_a_log_without_a_frame_of_the_node_gets_one_line_and_status_2(
    log: str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bus.log").write_text(log)
    assert cli.main(["decode", "bus.log"]) == 2
    assert capsys.readouterr() == ("", f"psabench: bus.log: {words}\n")


def test_a_log_with_a_frame_of_the_node_is_a_table(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("bus.log").write_text("(0.1) can0 187#15DA1F0100000000\n(0.2) can0 287#000000534C19E4B8\n")
    assert cli.main(["decode", "bus.log", "--node", "7"]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("t_rx_s,")
    assert out.count("\n") == 2
    assert err == "frames 1, lost 0, torn 0\n"


def test_a_capture_without_a_frame_gets_one_line_and_status_2(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("x.bin").write_bytes(b"\x01\x00\x01")
    assert cli.main(["decode", "--line", "x.bin"]) == 2
    counts = "samples=3 frames=0 torn=1 lost=0 late=0 early=0 gaps=0"
    assert capsys.readouterr() == ("", f"psabench: x.bin: no frame of 32-bit words ({counts})\n")


def test_a_reader_that_has_seen_enough_is_no_error() -> None:
    samples = b"\x01" * 100 + lines([1, 2, 3, 4])
    command = [sys.executable, "-m", "psabench.cli", "decode", "--line", "/dev/stdin"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as p:
        assert p.stdin
        assert p.stdout
        assert p.stderr
        p.stdout.close()
        p.stdin.write(samples)
        p.stdin.close()
        words = p.stderr.read().decode()
        assert p.wait(60) == 0
    assert "Traceback" not in words
    assert "Broken pipe" not in words


def test_without_a_command_help_is_printed(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main([]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert "a first hour:" in err


def test_help_and_the_shell_do_without_the_libraries_of_the_report() -> None:
    """Each takes a second to import."""
    told = "import sys, psabench.cli; print(sorted({'matplotlib', 'scipy', 'IPython'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "[]\n"
