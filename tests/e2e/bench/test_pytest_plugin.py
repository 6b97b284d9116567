"""The pytest plugin in a session of its own: what a failed test leaves, and that it goes on from there."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import pytest
from psabench import Bench
from rig import HOST, TIMEOUT_S

TESTS = """
import os, signal
import pytest

@pytest.mark.scenario("quiet", seed=7)
def test_passes(bench):
    bench.unit.wait_ready()

@pytest.mark.scenario("mine.yaml")
class TestOfAFile:
    def test_fails(self, bench):
        bench.unit.wait_ready()
        bench.head.turn(90.0)
        bench.unit.stream(3)
        assert sorted(bench.units) == ["other"]

@pytest.mark.scenario("flight")
def test_of_a_unit_without_lines(bench):
    bench.run_for(0.1)
    raise ValueError

def test_whose_emulator_dies(bench):
    bench.emulator.signal(signal.SIGKILL)
    assert False

@pytest.mark.scenario("quiet", 7)
def test_with_a_wrong_marker(bench):
    pass
"""
SCENARIO = Path("proto/scenarios/quiet.yaml")


@dataclass(frozen=True)
class Session:
    folder: Path  # of the tests
    printed: str

    def kept(self, test: str) -> Path:
        return self.folder / "bench-failures" / f"test_it.py--{test}"

    def section(self, test: str) -> str:
        """What the report says of a test, from `kept in` on."""
        return self.printed.partition(f"kept in {self.kept(test)}:")[2].partition("\n___")[0]


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> Session:
    folder = tmp_path_factory.mktemp("user")
    (folder / "test_it.py").write_text(TESTS)
    (folder / "mine.yaml").write_text(SCENARIO.read_text())
    argv = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "test_it.py"]
    (folder / "tmp").mkdir()
    env = os.environ | {"TMPDIR": str(folder / "tmp")}
    done = subprocess.run(argv, cwd=folder, env=env, capture_output=True, text=True, timeout=TIMEOUT_S)
    assert done.returncode == 1, done.stdout + done.stderr
    return Session(folder, done.stdout)


@HOST
def test_what_passes_leaves_nothing(session: Session) -> None:
    assert "3 failed, 1 passed, 1 error" in session.printed
    folders = {p.name for p in (session.folder / "bench-failures").iterdir()}
    assert "test_it.py--test_passes" not in folders
    assert "test_it.py--test_with_a_wrong_marker" not in folders
    assert list((session.folder / "tmp").rglob("*.vcd")) == []
    assert list((session.folder / "tmp").glob("psabench-*")) == []


@HOST
def test_the_snapshot_goes_on_from_the_failed_assertion(session: Session) -> None:
    """By the line that the report prints, in a process that knows nothing of the test."""
    line = re.search(r"^  (python -i -c .*)$", session.section("TestOfAFile--test_fails"), re.MULTILINE)
    assert line is not None
    with Bench.restore(session.kept("TestOfAFile--test_fails") / "bench.snapshot") as bench:
        here_s = bench.time_s
        assert bench.head.angle_deg == pytest.approx(90.0, abs=0.01)
    argv = [sys.executable, *shlex.split(line[1])[1:]]
    typed = "print('at', bench.time_s)\n"
    asked = subprocess.run(argv, input=typed, cwd=session.folder, capture_output=True, text=True, timeout=TIMEOUT_S)
    assert f"at {here_s}" in asked.stdout, asked.stderr


@HOST
def test_lines_and_frames_are_those_since_power_on(session: Session) -> None:
    kept = session.kept("TestOfAFile--test_fails")
    lines = (kept / "lines.vcd").read_text()
    assert "$enddefinitions" in lines
    assert "#0\n" in lines
    frames = (kept / "can.log").read_text().splitlines()
    assert frames[0].endswith(" 000#8005"), frames[0]  # the host's first: pre-operational
    assert sum("185#" in f for f in frames) >= 3


@HOST
def test_what_cannot_be_kept_is_named_with_its_reason(session: Session) -> None:
    died = session.section("test_whose_emulator_dies")
    assert re.search(r"bench.snapshot .*; not complete: ", died), died
    assert re.search(r"lines.vcd .*; not complete: ", died), died
    assert "--restore" not in died


@HOST
def test_a_wrong_marker_says_what_is_expected(session: Session) -> None:
    marker = "scenario(name='calibrate', *, seed, pace, can, node, extra)"
    assert f"test_it.py::test_with_a_wrong_marker: expected {marker}, got (7,)" in session.printed
