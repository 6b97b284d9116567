"""MF4 logs: written by python-can with asammdf, checked by the command as their sources are; damaged ones end in words.

`make test` and `make setup` put asammdf into a folder of its own; without it all but the last tests are skipped.
"""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import can
import made_recordings as make
import numpy as np
import pytest
from made_recordings import NO_VIOLATION, judge
from psabench.cli import main
from psabench.conform.sources import mf4
from psabench.conform.sources.can_logs import read_can
from psabench.conform.sources.taken import Bounds
from psabench.errors import BadInput

from tests.conform.recording.test_conform_recording import drop
from tests.conform.recording.test_conform_recording_files import near_the_head

ROOT = Path(__file__).resolve().parents[3]
SEED = 20261122
PSABENCH = str(Path(sys.executable).with_name("psabench"))
WITH_MF4 = pytest.mark.skipif(not mf4.asammdf_is_there(), reason="asammdf is not there: make setup")
CONVERT = """
import sys, can
for log in sys.argv[1:]:
    with can.LogReader(log) as frames, can.Logger(log.removesuffix(".log") + ".mf4") as out:
        for m in frames:
            out(m)
"""
NEXT = 24  # byte of the link to the next one in a block of FH, DG, CG and CN (ASAM MDF 4: header, then the links)
FRAMES = [
    can.Message(timestamp=1.0, arbitration_id=0x185, is_extended_id=False, data=b"\x01\x02\x03"),
    can.Message(timestamp=1.000123, arbitration_id=0x185, is_extended_id=True, data=bytes(8)),
    can.Message(timestamp=1.25, arbitration_id=0x7FF, is_extended_id=False, is_remote_frame=True),
    can.Message(timestamp=1.5, arbitration_id=5, is_extended_id=False, is_fd=True, bitrate_switch=True, data=bytes(48)),
    can.Message(timestamp=1.75, arbitration_id=0x285, is_extended_id=False, data=b""),
    can.Message(timestamp=2.0, is_error_frame=True),
]


def write_mf4(*logs: Path) -> list[Path]:
    """Each log of candump in MF4, beside it: by python-can's writer, where asammdf is."""
    env = os.environ | {"PYTHONPATH": str(mf4.FOLDER)}
    subprocess.run([sys.executable, "-c", CONVERT, *map(str, logs)], env=env, check=True, timeout=200)
    return [log.with_suffix(".mf4") for log in logs]


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> Mapping[str, Path]:
    """Logs in MF4, by name; the log of candump that each was made of lies beside it."""
    folder = tmp_path_factory.mktemp("mf4")
    psa2 = make.record(folder, "psa2").log
    found = [psa2, make.record(folder, "psd1").log]
    found += [make.changed_log(psa2, "drop", drop), make.stamped(psa2, "calendar", 1.0, 1.7e9)]
    with can.Logger(str(folder / "kinds.log")) as out:
        for m in FRAMES:
            out(m)
    return {path.stem: path for path in write_mf4(*found, folder / "kinds.log")}


@pytest.fixture(scope="module")
def sound(logs: Mapping[str, Path]) -> bytes:
    return logs["psa2"].read_bytes()


# ---- good and broken boards


@WITH_MF4
@pytest.mark.parametrize("name", ["psa2", "psd1"])
def test_an_mf4_is_judged_as_its_source_is(name: str, logs: Mapping[str, Path], tmp_path: Path) -> None:
    words = ["conform", "recording", str(logs[name]), "--board", name, "--out", str(tmp_path / "mf4")]
    run = subprocess.run([PSABENCH, *words], capture_output=True, text=True, timeout=200, check=False)
    assert run.returncode == NO_VIOLATION, run.stdout + run.stderr
    report = json.loads((tmp_path / "mf4/conform.json").read_text())
    source = judge(tmp_path, logs[name].with_suffix(".log"), board=name)
    assert report["requirements"] == source.report["requirements"]
    assert source.passed


@WITH_MF4
def test_an_mf4_of_a_broken_board_fails(logs: Mapping[str, Path], tmp_path: Path) -> None:
    said = judge(tmp_path, logs["drop"])
    assert said.status == 1
    assert "PSA2-CAN-04" in said.failed


@WITH_MF4
def test_stamps_of_a_calendar_are_as_good(logs: Mapping[str, Path]) -> None:
    taken, source = (read_can(logs["calendar"].with_suffix(e), Bounds()) for e in (".mf4", ".log"))
    assert len(taken.frames) == len(source.frames) > 500
    at_s = np.array([[f.t_s for f in take.frames] for take in (taken, source)])
    assert np.abs(at_s[0] - at_s[1]).max() < 2e-6  # a double of such a stamp is known to 0.24 us
    assert [f.data for f in taken.frames] == [f.data for f in source.frames]


@WITH_MF4
def test_every_kind_of_frame_is_kept(logs: Mapping[str, Path]) -> None:
    taken, source = (read_can(logs["kinds"].with_suffix(e), Bounds()) for e in (".mf4", ".log"))
    assert (taken, len(taken.frames)) == (source, len(FRAMES))


@WITH_MF4
def test_no_more_is_judged_than_was_asked(logs: Mapping[str, Path]) -> None:
    take = read_can(logs["psa2"], Bounds(max_s=0.3))
    assert take.note == "judged to 0.3 s"
    assert 0.29 < take.frames[-1].t_s - take.frames[0].t_s <= 0.3


@WITH_MF4
def test_one_that_nobody_closed_is_read(sound: bytes, logs: Mapping[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "open.mf4"
    path.write_bytes(not_closed(sound))
    assert read_can(path, Bounds()) == read_can(logs["psa2"].with_suffix(".log"), Bounds())


def not_closed(data: bytes) -> bytes:
    """Marked so: the counts of its groups are not sure."""
    return b"UnFinMF " + data[8:60] + b"\1" + data[61:]


class Stamped:
    """In place of python-can's reader: messages at 5, 4 and 6 s."""

    def __init__(self, path: str) -> None:
        self.path = path

    def __enter__(self) -> Iterator[can.Message]:
        return iter(can.Message(timestamp=t, arbitration_id=5, is_extended_id=False) for t in (5.0, 4.0, 6.0))

    def __exit__(self, *how: object) -> None:
        pass


@pytest.mark.parametrize(
    ("max_s", "most", "stamps"), [(9.0, 9, "546"), (9.0, 1, "54"), (0.5, 9, "546"), (-2.0, 9, "5")]
)
def test_stamps_stay_as_they_are_and_bounds_are_kept(
    max_s: float, most: int, stamps: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("can.MF4Reader", Stamped)
    with (tmp_path / "x.log").open("w") as out:
        mf4._convert("x.mf4", max_s, most, out)
    assert re.findall(r"^\((\d)\.000000\)", (tmp_path / "x.log").read_text(), re.MULTILINE) == list(stamps)


# ---- damage


@WITH_MF4
@pytest.mark.parametrize("part", [0.5, 0.98])
def test_a_cut_mf4_is_bad_input(part: float, sound: bytes, tmp_path: Path) -> None:
    path = tmp_path / "cut.mf4"
    path.write_bytes(sound[: int(len(sound) * part)])
    words = ["conform", "recording", str(path), "--board", "psa2", "--out", str(tmp_path / "out")]
    run = subprocess.run([PSABENCH, *words], capture_output=True, text=True, timeout=200, check=False)
    assert run.returncode == 2, run.stdout
    assert re.fullmatch(
        rf"[^\n]*{re.escape(str(path))}: asammdf cannot read it \((?:ValueError|MdfException): [^\n]*\n", run.stderr
    )


@WITH_MF4
def test_mutated_files_end_in_words(sound: bytes, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    rng = np.random.default_rng([SEED, 4])
    path = tmp_path / "x.mf4"
    refusals = dict[int, str]()
    for n in range(3):
        path.write_bytes(sound[:8] + near_the_head(sound[8:], rng))
        try:
            read_can(path, Bounds())
        except BadInput as e:
            refusals[n] = str(e)
    assert all(str(path) in why for why in refusals.values()), f"seed {SEED}: {refusals}"
    assert capfd.readouterr() == ("", "")


def in_a_circle(data: bytes, block: bytes) -> bytes:
    """The first block of this kind follows itself."""
    out = bytearray(data)
    at = data.index(block)
    struct.pack_into("<Q", out, at + NEXT, at)
    return bytes(out)


@WITH_MF4
@pytest.mark.parametrize("block", [b"##DG", b"##CN"])
def test_blocks_in_a_circle_cost_bounded_time_and_leave_nothing(
    block: bytes, sound: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setenv("TMPDIR", str(scratch))
    monkeypatch.setattr("tempfile.tempdir", None)  # what it found before
    monkeypatch.setattr(mf4, "MOST_CPU_S", 1)
    path = tmp_path / "circle.mf4"
    path.write_bytes(not_closed(in_a_circle(sound, block)))  # of which asammdf makes a copy
    with pytest.raises(BadInput, match=r"circle\.mf4: asammdf took more than 1 s over it"):
        read_can(path, Bounds())
    assert not list(scratch.iterdir())


@WITH_MF4
def test_and_bounded_memory(sound: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mf4, "MOST_MEMORY", 384 << 20)
    monkeypatch.setattr(mf4, "MOST_CPU_S", 600)  # the memory ends first, on a slow machine, too
    path = tmp_path / "circle.mf4"
    path.write_bytes(in_a_circle(sound, b"##FH"))
    with pytest.raises(BadInput, match=r"circle\.mf4: asammdf cannot read it \(MemoryError"):
        read_can(path, Bounds())


@pytest.mark.parametrize(
    ("status", "words", "why"),
    [
        (-signal.SIGSEGV, b"", "asammdf was ended by SIGSEGV"),
        (-signal.SIGXCPU, b"", "asammdf took more than 60 s over it"),
        (1, b"odd\nKeyError: 'x'\n", "asammdf cannot read it (KeyError: 'x')"),
        (1, b"", "asammdf cannot read it (exit status 1)"),
        (0, b"", ""),
    ],
)
def test_what_came_before_its_end_is_judged(
    status: int, words: bytes, why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(command: list[str], stdout: BinaryIO, stderr: BinaryIO, **how: Any) -> Any:
        stdout.write(b"(1.000000) can0 185#0102 R\n(2.000000) can0 185#03 R\n(3.000000) can0 18")
        stderr.write(words)
        return subprocess.CompletedProcess(command, status)

    monkeypatch.setattr("subprocess.run", run)
    monkeypatch.setattr(mf4, "asammdf_is_there", lambda: True)
    path = tmp_path / "x.mf4"
    path.write_bytes(b"MDF     4.10")
    take = read_can(path, Bounds())
    assert ([f.data for f in take.frames], take.note) == ([b"\1\2", b"\3"], why)


# ---- without asammdf


def test_without_asammdf_it_says_what_it_wants(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(mf4, "FOLDER", tmp_path / "none")
    monkeypatch.setattr(mf4, "find_spec", lambda name: None)
    path = tmp_path / "run.mf4"
    path.write_bytes(b"MDF     4.10")
    assert main(["conform", "recording", str(path), "--board", "psa2"]) == 2
    said = capsys.readouterr().err
    assert "pip install asammdf" in said
    assert "can_logconvert run.mf4 run.log" in said


def test_what_is_no_mf4_is_refused_before_asammdf_sees_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("subprocess.run", None)
    path = tmp_path / "run.mf4"
    path.write_bytes(b"MD")
    with pytest.raises(BadInput, match=r"run\.mf4: expected MDF at the beginning, got another file"):
        read_can(path, Bounds())


# ---- set-up


def pinned(name: str) -> set[str]:
    return set(re.findall(r"^([a-z0-9._-]+)==", (ROOT / name).read_text(), re.MULTILINE))


def test_its_lock_adds_to_the_other_one() -> None:
    assert "asammdf" in pinned("requirements-mf4.lock")
    assert not pinned("requirements-mf4.lock") & pinned("requirements.lock")
    assert "://" not in (ROOT / "requirements-mf4.lock").read_text()


@pytest.mark.parametrize(("stamp", "installs"), [("as it is", 0), ("of another lock", 1), ("none", 1)])
def test_set_up_installs_it_when_its_lock_changes(stamp: str, installs: int, tmp_path: Path) -> None:
    """tools/setup's own function, with a uv that notes how it was called."""
    lines = (ROOT / "tools/setup").read_text().splitlines()
    begin = lines.index("folder_env() { # NAME WHAT")
    body = "\n".join(lines[begin : lines.index("}", begin) + 1])
    for name in ("requirements-mf4.lock", ".venv/bin/uv"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / "requirements-mf4.lock", tmp_path / name)
    uv = tmp_path / ".venv/bin/uv"
    uv.write_text('#!/bin/sh\necho "$@" >> calls\nmkdir -p .venv/mf4\n')
    uv.chmod(0o755)
    script = f"set -euo pipefail\nuv_version=1\n{body}\n"

    def set_up() -> None:
        subprocess.run(
            ["bash", "-c", f"{script}folder_env mf4 asammdf"], cwd=tmp_path, check=True, timeout=60, capture_output=True
        )

    set_up()
    left_over = tmp_path / ".venv/mf4/left_over"
    left_over.touch()
    if stamp == "of another lock":
        with (tmp_path / "requirements-mf4.lock").open("a") as lock:
            lock.write("# changed\n")
    elif stamp == "none":
        (tmp_path / ".venv/mf4/.psabench-setup").unlink()
    set_up()
    calls = (tmp_path / "calls").read_text().splitlines()
    assert len(calls) == 1 + installs
    assert "--no-deps" in calls[0]
    assert "-r requirements-mf4.lock" in calls[0]
    assert left_over.exists() == (not installs)
