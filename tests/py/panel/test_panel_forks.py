"""Forks of the panel's bench: the same future without a seed, another one with it; shown, resting, dropped, lost."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import panel_run as run
import pytest
from panel_state import digest, replayed, say_all

FORKS: dict[str, dict[str, object]] = {"fork 1": {}, "fork 2": {"seed": 9}, "fork 3": {"file": "start.psasnap"}}


def test_a_fork_goes_on_as_the_bench_would_and_with_a_seed_otherwise(tmp_path: Path) -> None:
    options = ("calibrate", "--seed", "3", "--paused", "--out", tmp_path)
    with run.running(*options) as panel, panel.socket() as socket, panel.socket() as looks:
        say_all(socket, ["dut.ready", "dut.start", "wait 0.2", "bench.snapshot start.psasnap"])
        assert run.received(looks, "hello")["benches"]["shown"] == "first"
        begin_s = run.said(socket, 1, "time")["result"]["t_s"]
        for k, (name, how) in enumerate(FORKS.items()):
            answer = run.asked(socket, 2, do="fork", **how)
            assert answer["name"] == name
            assert answer["time"]["t_s"] == begin_s
            hello = run.received(looks, "hello")
            assert hello["benches"]["shown"] == name
            assert hello["benches"]["resting"] == ["first", *FORKS][: k + 1]
            assert hello["began"].startswith(f"{name}, of ")
            say_all(socket, ["wait 0.3", f"bench.snapshot {k + 1}.psasnap", f"save {k + 1}.psa"])
            if k < 2:
                assert run.asked(socket, 3, do="show", name="first")["time"]["t_s"] == begin_s
                assert run.received(looks, "hello")["benches"]["shown"] == "first"
        assert run.asked(socket, 4, do="show", name="first")["time"]["t_s"] == begin_s
        say_all(socket, ["wait 0.3", "bench.snapshot 0.psasnap"])
        assert "error" in run.asked(socket, 5, do="drop", name="first")
        assert "error" in run.asked(socket, 5, do="show", name="fork 9")
        assert "error" not in run.asked(socket, 6, do="drop", name="fork 2")
        assert "error" not in run.asked(socket, 7, do="show", name="fork 1")
        assert run.said(socket, 8, "time")["result"]["t_s"] == pytest.approx(begin_s + 0.3)
    first, same, other, again = (digest(tmp_path / f"{k}.psasnap") for k in range(4))
    assert first == same == again != other
    assert replayed(tmp_path / "2.psa", tmp_path / "2.psasnap") == other


def runs(pid: int) -> bool:
    """Whether there is such a process that has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


def test_forks_are_few_end_with_the_panel_and_after_a_lost_one_the_first_is_shown(tmp_path: Path) -> None:
    with run.running("quiet", "--paused", "--out", tmp_path) as panel, panel.socket() as socket:
        assert "error" not in run.asked(socket, 1, do="fork")
        (emulator,) = run.children(panel.process.pid)
        (fork,) = run.children(emulator)
        os.kill(fork, signal.SIGKILL)
        hello = run.received(socket, "hello")
        while hello["benches"]["shown"] != "first":
            hello = run.received(socket, "hello")
        assert "fork 1 was lost" in hello["began"]
        assert "error" not in run.said(socket, 2, "head.turn 10")
        for _ in range(4):
            assert "error" not in run.asked(socket, 3, do="fork")
        assert "up to 4 benches" in run.asked(socket, 4, do="fork")["error"]
        processes = [emulator]
        for pid in processes:  # a fork of a fork is its child
            processes += run.children(pid)
        assert len(processes) == 5
    assert [pid for pid in processes if runs(pid)] == []


@pytest.mark.parametrize("often", [signal.SIGHUP, signal.SIGINT])
def test_a_closed_terminal_and_a_second_ctrl_c_leave_no_process(often: signal.Signals, tmp_path: Path) -> None:
    with run.running("quiet", "--paused", "--out", tmp_path) as panel, panel.socket() as socket:
        assert "error" not in run.asked(socket, 1, do="fork")
        assert "error" not in run.asked(socket, 2, do="run", name="turns")
        processes = [panel.process.pid]
        for pid in processes:
            processes += run.children(pid)
        assert len(processes) >= 4  # emulator, fork, procedure
        while panel.process.poll() is None:
            panel.process.send_signal(often)
            with suppress(subprocess.TimeoutExpired):
                panel.process.wait(0.02)
    deadline_s = time.monotonic() + run.WAIT_S
    while left := [pid for pid in processes if runs(pid)]:  # the procedure's own emulator ends with it
        assert time.monotonic() < deadline_s, left


def test_time_that_moves_by_itself_cannot_rest(tmp_path: Path) -> None:
    with run.running("quiet", "--pace", "wall", "--out", tmp_path) as panel, panel.socket() as socket:
        assert not run.received(socket, "hello")["benches"]["forks"]
        assert run.asked(socket, 1, do="fork")["error"] == "fork: expected step pace, got wall"
