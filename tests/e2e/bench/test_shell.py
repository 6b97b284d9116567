"""The shell as a user has it: in a terminal, from a file, through a pipe; with an emulator, and with a device alone."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
from pathlib import Path
from typing import Any

import pytest
from psabench.emulator import Emulator
from psabench.places import find_emulator
from rig import HOST, PSABENCH, TIMEOUT_S, MakeRig, until
from terminal import Terminal

pytestmark = HOST

CTRL_C, CTRL_D = "\x03", "\x04"


@pytest.fixture
def env(tmp_path: Path) -> dict[str, str]:
    """History of its own, the tests' emulator, and python-can's configuration nowhere."""
    return {**os.environ, "PSA_EMU": str(find_emulator()), "XDG_STATE_HOME": str(tmp_path), "HOME": str(tmp_path)}


def shell(env: dict[str, str], *args: str | Path, stdin: str | None = None) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [str(PSABENCH), *(str(a) for a in args)],
        env=env,
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
        input=stdin,
        check=False,
    )


def objects(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


def children(pid: int) -> list[int]:
    return [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


# ---- at the keyboard


class Keyboard(Terminal):
    """Somebody who waits for the prompt before the next line."""

    def say(self, line: str, answer: str, prompt: str = r"psa> ") -> None:
        """Type a line, see the answer and the next prompt."""
        self.type(f"{line}\r")
        self.wait_for(answer)
        self.wait_for(prompt)

    def leave(self) -> None:
        self.type(CTRL_D)
        assert self.wait_end() == 0


def keyboard(env: dict[str, str], *args: str) -> Keyboard:
    return Keyboard([str(PSABENCH), "shell", *args], env)


def test_a_session_at_the_keyboard(env: dict[str, str], tmp_path: Path) -> None:
    script = tmp_path / "session.psa"
    with keyboard(env, "quiet", "--pace", "step") as t:
        t.wait_for(r"pace step\.")
        t.wait_for(r"psa> ")
        t.wait_for(r"0\.000 s step")  # the status bar
        t.say("head.turn 30", r"angle_deg +30")
        t.type("head.tu")
        t.wait_for(r"angle on the head's scale|Turns the dividing head")  # the menu, or the line below
        t.type(" \x15")  # away with it
        t.say("wait 250ms", "")
        t.say("time", r"t_s +0\.25")
        t.say("dut.ready", "")
        t.say("dut.register x CONFIG0", r"SYNC 0 pulse, DR 2 1000 /s, PHASE 1 minimum, FILTR 2 sinc \+ FIR")
        t.say(
            "head.turn 4000",
            r"angle_deg: expected a number in range, got 4000 \(angle on the head's scale, deg, -3600 to 3600\)",
        )
        t.say(f"save {script}", r"lines +\d")
        emulators = children(t.pid)
        assert emulators
        t.leave()
    until(lambda: not any(Path(f"/proc/{p}").exists() for p in emulators), "the end of the emulator")
    text = script.read_text()
    assert "start quiet\nhead.turn 30\n" in text
    assert "# head.turn 4000   error: angle_deg: expected a number in range, got 4000" in text
    again = shell(env, "run", "script", script, "--json")
    assert again.returncode == 0, again.stderr
    results = {o["line"]: o["result"] for o in objects(again.stdout)}
    assert results["dut.register x CONFIG0"]["value"] == "56h"
    assert results["head.turn 30"]["angle_deg"] == 30.0


@pytest.mark.parametrize("pace", ["wall", "step"])
def test_ctrl_c_ends_the_command_and_not_the_shell(env: dict[str, str], pace: str) -> None:
    with keyboard(env, "quiet", "--pace", pace) as t:
        t.wait_for(r"psa> ")
        t.type("wait 86400\r")
        t.wait_for(r"\d s \w+ \|[^\n]*\r[^\n]*\d s \w+ \|")  # it waits, and the status goes on below
        t.type(CTRL_C)
        t.wait_for(r"interrupted")
        t.wait_for(r"psa> ")
        t.say("head.turn 12", r"angle_deg +12")
        t.say("dut.register x CONFIG0", r"value +56h")
        t.type("head.turn 99")
        t.wait_for("99")
        t.type(CTRL_C)  # drops the line
        t.wait_for(r"psa> ")
        t.say("head.read", r"angle_deg +12")
        t.type("exit\r")
        assert t.wait_end() == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_the_shell_and_its_emulator(env: dict[str, str], number: signal.Signals) -> None:
    with keyboard(env, "quiet", "--pace", "step") as t:
        t.wait_for(r"psa> ")
        emulators = children(t.pid)
        assert emulators
        os.kill(t.pid, number)
        assert t.wait_end() == 128 + number
    until(lambda: not any(Path(f"/proc/{p}").exists() for p in emulators), "the end of the emulator")


def test_modes_for_can_and_scpi(env: dict[str, str]) -> None:
    with keyboard(env, "quiet", "--pace", "step") as t:
        t.wait_for(r"psa> ")
        t.say("dut.ready", "")
        t.say("can", "", r"can> ")
        t.say("605#4018100400000000", r"585 +4318100401000000 +SDO_TX", r"can> ")  # upload 1018h:4, serial number
        t.say("nonsense", r"expected ID#DATA in hexadecimal", r"can> ")
        t.type(CTRL_D)
        t.wait_for(r"psa> ")
        t.say("scpi head", "", r"scpi head> ")
        t.say("*IDN?", r"answer +\S+,", r"scpi head> ")
        t.say("ANGL 45;ANGL?", r"answer +\+?4\.?5", r"scpi head> ")
        t.say("ANGL abc", r"-1\d\d|-2\d\d", r"scpi head> ")
        t.type(CTRL_D)
        t.wait_for(r"psa> ")
        t.say("head.read", r"angle_deg +45")
        t.leave()


def test_python_with_the_bench_in_it(env: dict[str, str]) -> None:
    with keyboard(env, "quiet", "--pace", "step") as t:
        t.wait_for(r"psa> ")
        t.say("python", r"bench: psabench\.Bench", r"In .*1.*: ")
        t.say("bench.head.turn(17.0)", r"17\.0", r"In .*2.*: ")
        t.type(CTRL_D)
        t.wait_for(r"psa> ")
        t.say("head.read", r"angle_deg +17")
        t.leave()


def test_a_shell_that_is_killed_leaves_no_emulator(env: dict[str, str]) -> None:
    with keyboard(env, "quiet", "--pace", "step") as t:
        t.wait_for(r"psa> ")
        (emulator,) = children(t.pid)
        argv = Path(f"/proc/{emulator}/cmdline").read_bytes().decode().split("\0")
        control = Path(argv[argv.index("--control") + 1])
        assert control.is_socket()
        os.kill(t.pid, signal.SIGKILL)
        until(lambda: not control.exists(), "the end of the emulator, which takes its socket with it")
    shutil.rmtree(control.parent)


# ---- scripts, pipes


LINES = [
    "head.turn 30",
    "wait 100ms",
    "dut.ready",
    "dut.stream 20",
    "head.read",
    "can.send 605#4018100400000000",
    "time",
]


def test_what_is_saved_does_the_same_again(env: dict[str, str], tmp_path: Path) -> None:
    script = tmp_path / "session.psa"
    commands = [a for line in [*LINES, f"save {script}"] for a in ("--command", line)]
    first = shell(env, "shell", "calibrate", "--seed", "7", "--json", *commands)
    assert first.returncode == 0, first.stderr
    again = shell(env, "run", "script", script, "--json")
    assert again.returncode == 0, again.stderr
    assert objects(again.stdout) == objects(first.stdout)[:-1]  # instants and noise, to the last bit
    other = shell(env, "run", "script", script, "--json", "--seed", "8")
    assert objects(other.stdout) != objects(first.stdout)[:-1]


def test_a_session_in_real_time_comes_again_at_its_instants(env: dict[str, str], tmp_path: Path) -> None:
    script = tmp_path / "session.psa"
    with keyboard(env, "quiet") as t:
        t.wait_for(r"psa> ")
        for angle in (10, 20):
            t.say(f"head.turn {angle}", rf"angle_deg +{angle}")
        t.say(f"save {script}", r"lines +\d")
        t.leave()
    lines = script.read_text().splitlines()[2:]
    at_s = [float(line.split()[1]) for line in lines if line.startswith("at ")]
    assert len(at_s) == 3  # of each line, and where `save` was said: the bench ends in the same state
    assert 0.0 < at_s[0] < at_s[1] < at_s[2]
    again = shell(env, "run", "script", script, "--json")
    assert again.returncode == 0, again.stderr
    turns = [o for o in objects(again.stdout) if o["line"].startswith("head.turn")]
    assert [o["t_s"] for o in turns] == pytest.approx(at_s[:2], abs=1e-9)


STATUSES = [
    ("start quiet\nhead.turn 5\nexpect angle_deg = 5 +- 0.001\n", 0, ""),
    ("start quiet\nhead.turn 5\nexpect angle_deg = 6\nhead.read\n", 1, ""),
    ("start quiet\nhead.turn 5\nhead.spin\n", 2, ":3:1: head.spin: unknown command"),
    ("start quiet\nhead.turn 5 6\n", 2, ":2:13: head.turn: expected head.turn angle_deg, got one more argument, 6"),
    ("start nosuch\n", 2, "nosuch"),
    ("head.turn 5\n", 2, "expected a first line `start SCENARIO`"),
    ("start quiet\ndut.register x CONFIG0\n", 3, ":2: node 5: read 2000h:2: abort"),  # not set up yet
]


@pytest.mark.parametrize(("text", "status", "words"), STATUSES, ids=[f"{s[1]} {s[2]}" for s in STATUSES])
def test_a_script_ends_with_its_status(env: dict[str, str], tmp_path: Path, text: str, status: int, words: str) -> None:
    script = tmp_path / "x.psa"
    script.write_text(text)
    done = shell(env, "run", "script", script)
    assert done.returncode == status, done.stderr
    assert words in done.stderr
    assert done.stderr.count("\n") == (status > 1)
    assert ("FAILED: angle_deg is 5, expected = 6" in done.stdout) == (status == 1)
    if status == 2:
        assert done.stdout == ""  # nothing was done


def test_a_pipe_in_text_and_in_json(env: dict[str, str]) -> None:
    text = shell(env, "shell", "quiet", stdin="head.turn 5\n\n# nothing\nhead.read\n")
    assert (text.returncode, text.stdout.count("angle_deg  5\n")) == (0, 2), text.stderr
    found = objects(shell(env, "shell", "quiet", "--json", stdin="head.turn 5\nwait 0.5\nhead.read\n").stdout)
    assert [(o["line"], o["ok"], o["t_s"]) for o in found] == [
        ("head.turn 5", True, 0.0),
        ("wait 0.5", True, 0.5),
        ("head.read", True, 0.5),
    ]


# ---- a bench that is there


def test_an_emulator_that_is_there(env: dict[str, str], make_rig: MakeRig) -> None:
    rig = make_rig("socketcand")
    control = rig.emulator.control_path
    assert control is not None
    lines = ("--command", "head.turn 7", "--command", "dut.ready")
    done = shell(env, "shell", "--connect", control, "--can", "none", *lines)
    assert done.returncode == 2
    assert "dut: not available: it needs a bus (--can SPEC" in done.stderr
    assert rig.control.call("head.read").result["angle_deg"] == pytest.approx(0.0)  # checked before anything is done
    done = shell(env, "shell", "--connect", control, "--can", rig.spec, *lines)
    assert done.returncode == 0, done.stderr
    assert rig.control.call("head.read").result["angle_deg"] == pytest.approx(7.0, abs=0.01)


def test_the_control_socket_alone_tells_where_the_rest_is(env: dict[str, str]) -> None:
    with Emulator("quiet", scpi=True) as emulator:
        there = ("shell", "--connect", str(emulator.control_path))
        lines = ("dut.ready", "head.turn 7", "scpi.send head ANGLE?", "expect answer = 7", "bench.endpoints")
        done = shell(env, *there, "--json", *(a for line in lines for a in ("--command", line)))
        assert done.returncode == 0, done.stdout + done.stderr
        assert objects(done.stdout)[-1]["result"]["endpoints"] == emulator.endpoints
        done = shell(env, *there, "--command", "bench.quit")
        assert (done.returncode, done.stderr) == (0, "")
        assert emulator.wait(TIMEOUT_S) == 0


def test_a_device_without_a_control_socket(env: dict[str, str], make_rig: MakeRig) -> None:
    rig = make_rig("socketcand", pace="wall")
    lines = ["dut.ready", "dut.register x CONFIG0", "expect value = 56h", "dut.stream 10", "expect settled = true"]
    done = shell(env, "shell", "--can", rig.spec, "--json", *(a for line in lines for a in ("--command", line)))
    assert done.returncode == 0, done.stderr
    assert objects(done.stdout)[3]["result"]["frames"] == 10
    assert "t_s" not in objects(done.stdout)[0]  # no one tells the simulated time
    for thing in ("head.turn 5", "faults.list"):
        done = shell(env, "shell", "--can", rig.spec, "--command", thing)
        assert done.returncode == 2
        assert f"{thing.split('.')[0]}: not available: it needs the control socket of an emulator" in done.stderr


def test_where_nothing_is_there_one_line_says_so(env: dict[str, str], tmp_path: Path) -> None:
    for args in (
        ["--connect", tmp_path / "none"],
        ["--can", "socketcand:127.0.0.1:1"],
        ["--scpi", "table"],
        ["nosuch"],
    ):
        done = shell(env, "shell", *args, "--command", "time")
        assert done.returncode in (2, 3)
        assert done.stderr.count("\n") == 1
        assert done.stdout == ""
