"""A calibration on its own recording gives what it gave live, byte for byte; a recording that cannot answer says so."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest
from psabench import cli
from psabench.conform.sources import mf4
from psabench.emulator import Emulator
from psabench.link.log_file import FORMATS, LogFile
from psabench.logs.call_log import calls_path
from psabench.logs.formats import READABLE, read_frames
from psabench.report.diff import read_result, report_without_provenance
from rig import PSABENCH, ROOT

pytestmark = [pytest.mark.host, pytest.mark.timeout(300)]


def run(*args: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PSABENCH, "run", *map(str, args)], capture_output=True, text=True, timeout=120)


def check_same(again: Path, live: Path, readings: str) -> None:
    """The same report but for its provenance, the same bytes of readings."""
    assert report_without_provenance(again) == report_without_provenance(live)
    assert (again / readings).read_bytes() == (live / readings).read_bytes()


def recorded(folder: Path, ending: str, procedure: str, *params: str) -> Path:
    """A live run without the truth, recorded."""
    log = folder / f"run{ending}"
    with Emulator("calibrate", scpi=True) as emulator:
        assert emulator.control_path is not None
        done = run(procedure, "--control", emulator.control_path, "--record", log, "--out", folder / "live", *params)
        assert done.returncode in (0, 1), done.stderr
    return log


WITH_MF4 = pytest.mark.skipif(not mf4.asammdf_is_there(), reason="asammdf is not there: make setup")
REPLAYED = [e for e in FORMATS if e in READABLE]  # both are tables of all formats: a new one is tested, or fails here


def test_every_format_is_replayed_or_refused_before_the_run(tmp_path: Path) -> None:
    assert [e for e in FORMATS if e not in REPLAYED] == [".txt"]
    assert [e for e in READABLE if e not in REPLAYED] == []
    log = tmp_path / "run.txt"
    done = run("turns", "--condition", "quiet", "--record", log, "--out", tmp_path)
    assert done.returncode == 2
    assert f"{log}: expected an ending of .asc" in done.stderr
    assert not log.exists()
    done = run("turns", "--replay", log, "--out", tmp_path)
    assert done.returncode == 2


@pytest.mark.parametrize(
    ("procedure", "ending"),
    [
        *(("turns", e) for e in (".log", ".blf", ".asc", ".csv", ".trc", ".mcap")),
        ("fourier", ".log"),
        ("reversal", ".blf"),
    ],
)
def test_a_replay_gives_the_live_results(procedure: str, ending: str, tmp_path: Path) -> None:
    log = recorded(tmp_path, ending, procedure, "--average", "4", "--realisations", "2")
    done = run(procedure, "--replay", log, "--realisations", "2", "--out", tmp_path / "again")
    assert done.returncode in (0, 1), done.stderr
    check_same(tmp_path / "again", tmp_path / "live", f"{procedure}.csv")


def test_whole_words_are_replayed_from_their_answers(tmp_path: Path) -> None:
    """The quiet condition reads 32-bit words by SDO."""
    log = tmp_path / "run.log"
    live = run("turns", "--condition", "quiet", "--realisations", "2", "--record", log, "--out", tmp_path / "live")
    again = run("turns", "--replay", log, "--realisations", "2", "--out", tmp_path / "again")
    assert (live.returncode, again.returncode) == (0, 0), live.stderr + again.stderr
    name = "turns-quiet.csv"
    alone = run("turns", "--condition", "quiet", "--realisations", "2", "--out", tmp_path / "alone")
    assert alone.returncode == 0, alone.stderr
    assert (tmp_path / "alone" / name).read_bytes() == (
        tmp_path / "live" / name
    ).read_bytes()  # recording changes nothing
    assert (tmp_path / "again" / name).read_bytes() == (tmp_path / "live" / name).read_bytes()
    live_from, again_from = (read_result(tmp_path / x)["provenance"] for x in ("live", "again"))
    assert again_from["scenarios"] == live_from["scenarios"]  # the recording names them
    assert (again_from["seed"], [f["role"] for f in again_from["files"]]) == (1, ["recording", "calls"])


def test_a_run_on_another_sensor_shows_its_own_values_live_and_replayed(tmp_path: Path) -> None:
    own, passport, log = tmp_path / "own.yaml", tmp_path / "sn17.yaml", tmp_path / "run.log"
    text = (ROOT / "proto/scenarios/quiet.yaml").read_text().replace("seed: 1", "seed: 41")
    own.write_text(text.replace("kx_v_per_g: 1.0", "kx_v_per_g: 1.0372"))
    passport.write_text("kx_v_per_g: 1.04\n")
    words = ("run", "turns", "--realisations", "2", "--out")
    live = ("--scenario", own, "--average", "0", "--record", log)
    runs = {"live": live, "again": ("--replay", log), "passport": ("--replay", log, "--passport", passport)}
    found = {}
    for name, more in runs.items():
        assert cli.main([*words, str(tmp_path / name), *map(str, more)]) in (0, 1)
        data = read_result(tmp_path / name)
        found[name] = (data["nominal"]["source"], data["nominal"]["values"]["kx_v_per_g"])
        assert (data["facts"]["seed"], data["provenance"]["seed"]) == ("41", 41)
    said = ("scenario own.yaml", "1.0372")
    assert found == {"live": said, "again": said, "passport": ("passport sn17.yaml", "1.04")}
    page = (tmp_path / "live/report.html").read_text(encoding="utf-8")
    assert "the article" not in page.partition("How to read this")[0]


@pytest.fixture(scope="module")
def turns(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return recorded(tmp_path_factory.mktemp("turns"), ".log", "turns", "--average", "1", "--realisations", "2")


@pytest.mark.parametrize("ending", [pytest.param(e, marks=[WITH_MF4] if e == ".mf4" else []) for e in REPLAYED])
def test_a_recording_in_every_format_gives_the_live_results(ending: str, turns: Path, tmp_path: Path) -> None:
    """The frames of one run, written by the writer of each format."""
    log = tmp_path / f"run{ending}"
    out = LogFile(log)
    assert all(out(m) for m in read_frames(turns))
    assert out.close() == len(turns.read_text().splitlines())
    shutil.copy(calls_path(turns), calls_path(log))
    assert cli.main(["run", "turns", "--replay", str(log), "--realisations", "2", "--out", str(tmp_path)]) in (0, 1)
    check_same(tmp_path, turns.parent / "live", "turns.csv")


def edited(turns: Path, folder: Path, old: str, new: str) -> Path:
    """A copy, its calls changed."""
    log = Path(shutil.copy(turns, folder))
    calls = turns.with_name("run.log.calls.csv").read_text()
    assert old in calls
    log.with_name("run.log.calls.csv").write_text(calls.replace(old, new, 1))
    return log


def refused(log: Path, *args: str, procedure: str = "turns", realisations: str = "2") -> str:
    out = log.parent / "out"
    done = run(procedure, "--replay", log, "--realisations", realisations, "--out", out, *args)
    assert done.returncode == 2, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stderr.splitlines()[-1]  # behind the progress


def test_what_was_not_recorded_is_refused(turns: Path, tmp_path: Path) -> None:
    assert "expected turn 271.0, got turn 270.0 (of the procedure)" in refused(
        edited(turns, tmp_path, "turn,270.0", "turn,271.0")
    )
    assert "expected mount side, got turn 270.0 (of the procedure)" in refused(turns, realisations="3")
    assert "expected run turns, as recorded, got fourier" in refused(turns, procedure="fourier")
    assert "expected no option of the bench beside --replay, got --seed" in refused(turns, "--seed", "3")


def test_a_damaged_recording_is_refused(turns: Path, tmp_path: Path) -> None:
    log = Path(shutil.copy(turns, tmp_path))
    assert "which psabench run --record writes beside the log, got no such file" in refused(log)
    assert "expected a last row `end`" in refused(edited(turns, tmp_path, "\nend,", "\nwait,"))
    assert "expected the columns" in refused(edited(turns, tmp_path, "call,", "cell,"))
    assert "expected the set-up of a run" in refused(edited(turns, tmp_path, "average", "mean"))
    assert "expected a call, its answer, a time" in refused(edited(turns, tmp_path, ",0.19", ",x0.19"))
    log = edited(turns, tmp_path, "call,", "call,")
    lines = log.read_text().splitlines(keepends=True)
    log.write_text("".join(lines[:-1]))
    assert "frames, as " in refused(log)
    log.write_text("".join(lines)[:-3])
    assert "a line feed at the end" in refused(log)
    at = next(k for k, line in enumerate(lines) if " 185#" in line)
    log.write_text("".join([*lines[:at], lines[at].replace(" 185#", " 184#"), *lines[at + 1 :]]))
    assert "in the log for this reading" in refused(log)


def test_one_recording_is_of_one_run(tmp_path: Path) -> None:
    done = run("turns", "--record", tmp_path / "r.log", "--out", tmp_path)
    assert done.returncode == 2
    assert "expected one procedure on one bench" in done.stderr
