"""A recording in the panel: the samples that `psabench decode` reads, time forwards and back, files that are bad."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import panel_run as run
import pytest
from psabench.boards.decode import decode_can
from psabench.errors import BadInput
from psabench.panel.command_line import parse
from psabench.panel.recorded.can_view import CanView
from psabench.panel.recorded.source import RecordingSource
from psabench.places import find_emulator
from psabench.shell.lexer import Wrong
from websockets.sync.client import ClientConnection


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """a.log: half a second of a PSA-2 at node 5; b.log: its first 100 frames, then no frame."""
    here = tmp_path_factory.mktemp("recordings")
    log = here / "a.log"
    words = ["--can", f"log:{log}", "--pace", "free", "--for", "500ms", "--seed", "1", "--start", "--quiet"]
    subprocess.run([find_emulator(), *words], check=True, capture_output=True)
    (here / "b.log").write_text("".join(log.read_text().splitlines(keepends=True)[:100]) + "(1.0) can0 what#\n")
    (here / "notes.txt").write_text("not a log\n")
    return here


def opened(path: Path, **given: Any) -> CanView:
    view = RecordingSource(path, **given).open()
    assert isinstance(view, CanView)
    return view


def decoded(path: Path) -> list[dict[str, str]]:
    out = io.StringIO()
    decode_can(path, 5, out, board="psa2")
    return list(csv.DictReader(io.StringIO(out.getvalue())))


def seen(view: CanView) -> Any:
    """What a page that opens now gets."""
    view.take(every_unit=True)
    return view.describe()["history"], view.state(lines=False)["overview"], view.can(view.now_s())["buses"]


def test_the_samples_are_those_that_decode_reads(folder: Path) -> None:
    view, rows = opened(folder / "a.log"), decoded(folder / "a.log")
    view.line("wait 10")
    view.take(every_unit=True)
    (unit,) = view.state(lines=False)["overview"]
    assert (unit["name"], unit["samples"], unit["lost"]) == ("node5", len(rows), 0)
    for channel, column in (("x", "x_v"), ("y", "y_v"), ("z", "z_v")):
        _, values = view.channels["node5"].latest(channel)
        assert values.tolist() == pytest.approx([float(r[column]) for r in rows], abs=1e-12)
    assert view.channel_statistics("x")
    assert view.state(lines=False)["ended"] == "end"


def test_time_comes_in_steps_or_at_once_and_goes_back(folder: Path) -> None:
    steps, at_once = opened(folder / "a.log"), opened(folder / "a.log")
    for _ in range(20):
        steps.line("wait 0.01")
    assert not at_once.line("at 0.2")["rewound"]
    first = seen(at_once)
    assert steps.now_s() == pytest.approx(at_once.now_s()) == pytest.approx(0.2)
    steps.take(every_unit=True)
    assert steps.channels["node5"].count == at_once.channels["node5"].count > 0
    at_once.line("at 0.3")
    assert seen(at_once) != first
    assert at_once.line("at 0.2")["rewound"]
    assert seen(at_once) == first


def test_a_damage_ends_it_after_the_frames_before(folder: Path) -> None:
    view = opened(folder / "b.log")
    about = view.describe()["recording"]
    assert not about["whole"]
    assert "b.log" in about["damage"]
    view.line("wait 10")
    assert view.state(lines=False)["ended"] == about["damage"]
    assert [bus["frames"] for bus in view.can(view.now_s())["buses"]] == [100]


@pytest.mark.parametrize("line", ["head.turn 10", "dut.start", "bench.snapshot a", "save a", "dut.use node6", "at x"])
def test_a_line_that_needs_a_bench_is_rejected(folder: Path, line: str) -> None:
    with pytest.raises(Wrong):
        opened(folder / "a.log").line(line)


def a_pipe(path: Path) -> None:
    os.mkfifo(path)


BAD: dict[str, tuple[Callable[[Path], object], str]] = {
    "none.log": (lambda _: None, "no such file"),
    "empty.log": (lambda p: p.write_text(""), "expected a frame, got none"),
    "bad.log": (lambda p: p.write_text("nothing of the kind\n"), "expected"),
    "bad.blf": (lambda p: p.write_bytes(b"LOGG" + bytes(20)), "expected"),
    "bad.txt": (lambda p: p.write_text("x"), "expected an ending of"),
    "folder": (lambda p: p.mkdir(), "expected a file with an ending of"),
    "pipe.log": (a_pipe, "expected a file or a folder, got a pipe or a device"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_file_is_one_line(tmp_path: Path, name: str) -> None:
    path, (make, why) = tmp_path / name, BAD[name]
    make(path)
    with pytest.raises(BadInput) as e:
        opened(path)
    assert str(path) in str(e.value)
    assert why in str(e.value)
    assert "\n" not in str(e.value)


def test_a_node_without_samples_is_bad_input(folder: Path) -> None:
    with pytest.raises(BadInput, match="expected samples of a psa2 at node 9, got none"):
        opened(folder / "a.log", node=9)
    assert [u["node"] for u in opened(folder / "a.log", node=5).describe()["units"]] == [5]


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (["calibrate", "--recording", "x.log"], "panel: expected no scenario beside --recording, got calibrate"),
        (["--pace", "wall", "--recording", "x.log"], "panel: expected no --pace beside --recording, got wall"),
        (["--seed", "1", "--recording", "x.log"], "panel: expected no --seed beside --recording, got 1"),
        (["--board", "psa2"], "--board: expected --recording with it, got psa2"),
    ],
)
def test_options_that_do_not_go_together_are_bad_input(words: list[str], why: str) -> None:
    args = parse(words)
    with pytest.raises(BadInput) as e:
        args.handler(args)
    assert str(e.value) == why


def messages_of_a_wait(socket: ClientConnection) -> dict[str, dict[str, Any]]:
    """Its answer, the samples, the counts, the bus: all come, in any order."""
    socket.send(json.dumps({"id": 1, "do": "line", "line": "wait 0.3"}))
    seen: dict[str, dict[str, Any]] = {}
    while len(seen) < 4:
        m: dict[str, Any] = json.loads(socket.recv(timeout=run.WAIT_S))
        if m.get("id") == 1:
            seen["answer"] = m
        elif "new" in m or (m["kind"] == "state" and m["overview"][0]["samples"]) or m.get("buses"):
            seen[m["kind"]] = m
    return seen


def test_a_panel_plays_goes_back_and_changes_the_file(folder: Path, tmp_path: Path) -> None:
    with run.running("--recording", folder, "--paused", "--out", tmp_path) as panel, panel.socket() as socket:
        hello = run.received(socket, "hello")
        assert hello["recording"]["file"] == "a.log"
        assert hello["recording"]["files"] == ["a.log", "b.log"]
        seen = messages_of_a_wait(socket)
        assert seen["answer"]["result"]["t_s"] == pytest.approx(0.3)
        assert seen["update"]["new"]["unit"] == "node5"
        with panel.socket() as looks:
            run.received(looks, "hello")
            assert "error" not in run.said(socket, 2, "at 0.1")
            assert run.received(looks, "hello")["time"]["t_s"] == pytest.approx(0.1)
        for what in ("fork", "scenarios", "begin", "restore"):
            assert "a recording" in run.asked(socket, 3, do=what)["error"]
        assert "error" in run.asked(socket, 4, do="recording", name="../a.log")
        assert "error" not in run.asked(socket, 5, do="recording", name="b.log")
        assert "error" in run.asked(socket, 6, do="frame")
        assert run.said(socket, 7, "time")["result"]["t_s"] == 0.0


def test_a_bad_file_ends_the_panel_with_status_2(tmp_path: Path) -> None:
    bad = tmp_path / "bad.log"
    bad.write_text("nothing of the kind\n")
    run.assert_refuses(bad, tmp_path / "out")
