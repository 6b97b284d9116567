"""One scenario by shell, panel and Python ends in one state; so does what the panel has saved as a script."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import panel_run as run
from panel_state import digest, replayed, say_all
from psabench import Bench
from websockets.sync.client import ClientConnection


def let_pass(socket: ClientConnection, for_s: float) -> None:
    """Until the page has moved time by so much at the least, without a line."""
    begin_s = run.received(socket, "update")["time"]["t_s"]
    while run.received(socket, "update")["time"]["t_s"] < begin_s + for_s:
        pass


# One scenario, as lines; `by_python` says the same. The head is at rest before 3 s.
LINES = (
    *(
        "dut.ready",
        "head.turn 30",
        "at 3",
        "faults.add sensor.bias a.sensor.x bias_v={bias_v} for_s=0.1",
        "dut.stream 50",
    ),
    *("dut.write x CONFIG0 DR=3", "until INT_FALL 3", "wait 0.05"),
)


def by_panel(made: Path, bias_v: float) -> None:
    options = ("calibrate", "--seed", "3", "--paused", "--out", made.parent)
    with run.running(*options) as panel, panel.socket() as socket:
        say_all(socket, [line.format(bias_v=bias_v) for line in (*LINES, f"bench.snapshot {made.name}")])


def by_shell(made: Path, bias_v: float) -> None:
    lines = [line.format(bias_v=bias_v) for line in (*LINES, f"bench.snapshot {made}")]
    words = [w for line in lines for w in ("--command", line)]
    command = [sys.executable, "-m", "psabench.cli", "shell", "calibrate", "--seed", "3", "--pace", "step", *words]
    subprocess.run(command, check=True, timeout=run.WAIT_S)


def by_python(made: Path, bias_v: float) -> None:
    """As docs/program.md has it: the head is turned over SCPI."""
    with Bench.start("calibrate", seed=3) as bench:
        bench.unit.wait_ready()
        bench.head.turn(30.0)
        bench.wait(3.0 - bench.time_s)
        bench.fault("sensor.bias", "a.sensor.x", bias_v=bias_v, for_s=0.1)
        bench.unit.stream(50)
        config0 = bench.unit.register("x", "CONFIG0")
        bench.unit.write_register("x", "CONFIG0", config0 & ~0x38 | 3 << 3)
        bench.unit.register("x", "CONFIG0")  # as the shell shows it
        bench.run_until("INT_FALL", 3)
        bench.wait(0.05)
        bench.snapshot(made)


DRIVES = {"panel": by_panel, "shell": by_shell, "python": by_python}


def test_one_scenario_by_panel_shell_and_python_ends_in_one_state(tmp_path: Path) -> None:
    """And a tenth of a millivolt in one of them would be seen."""
    for name, drive in DRIVES.items():
        drive(tmp_path / name, 0.1)
    by_python(tmp_path / "other", 0.1001)
    digests = {name: digest(tmp_path / name) for name in (*DRIVES, "other")}
    assert digests["panel"] == digests["shell"] == digests["python"] != digests["other"], digests


def test_a_saved_script_ends_in_the_state_of_the_panel_and_so_does_one_after_going_back(tmp_path: Path) -> None:
    out = tmp_path / "out"
    with run.running("calibrate", "--seed", "3", "--out", out) as panel, panel.socket() as socket:
        say_all(socket, ["dut.ready", "head.turn 30", "dut.start"])
        let_pass(socket, 0.2)
        assert "error" in run.said(socket, 1, "head.turn 40")  # it is turning
        let_pass(socket, 0.1)
        say_all(socket, ["faults.add sensor.bias a.sensor.x bias_v=0.1 for_s=0.1"])
        assert "svg" in run.asked(socket, 2, do="frame")
        assert "error" not in run.asked(socket, 3, do="play", on=True, speed=3)
        let_pass(socket, 0.3)
        say_all(socket, ["bench.snapshot first.psasnap", "save first.psa"])
        let_pass(socket, 0.1)
        say_all(socket, ["faults.add sensor.bias a.sensor.x bias_v=0.2"])  # which going back undoes
        assert "error" not in run.asked(socket, 4, do="restore", file="first.psasnap")
        say_all(
            socket,
            [
                "faults.add sensor.bias a.sensor.x bias_v=0.3",
                "wait 0.05",
                "bench.snapshot second.psasnap",
                "save second.psa",
            ],
        )
    text = (out / "second.psa").read_text()
    assert "start calibrate seed=3\n" in text
    assert "bias_v=0.2" not in text
    assert "# head.turn 40   error: " in text
    first = replayed(out / "first.psa", out / "first.psasnap")
    assert replayed(out / "second.psa", out / "second.psasnap") != first
