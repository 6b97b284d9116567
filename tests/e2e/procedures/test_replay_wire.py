"""Runs of a platform on their own recordings: the same results from every format that keeps what they depend on."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path

import can
import pytest
from psabench import cli
from psabench.conform.sources import mf4
from psabench.emulator import Emulator
from psabench.link.log_file import LogFile
from psabench.logs.call_log import calls_path
from psabench.logs.formats import KEEPS, READABLE, read_frames
from psabench.report.diff import report_without_provenance

pytestmark = [pytest.mark.host, pytest.mark.timeout(300)]

SHORT = "--window-s 2 --settle-s 7 --sequence 0,120,240 --slew-dps 20 --latitude-deg 50.45"
RUNS: Mapping[str, str] = {
    "gyrocompass": f"--reading article {SHORT}",
    "heading-hold": f"--reading improved {SHORT} --hours 0.02 --look-s 36 --speed-kmh 300",
}
WITH_MF4 = pytest.mark.skipif(not mf4.asammdf_is_there(), reason="asammdf is not there: make setup")
EVERY = [pytest.param(e, marks=[WITH_MF4] if e == ".mf4" else []) for e in READABLE]


def run(procedure: str, *words: str | Path) -> int:
    return cli.main(["run", procedure, *RUNS[procedure].split(), *map(str, words)])


@pytest.fixture(scope="module")
def gyrocompass(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record("gyrocompass", tmp_path_factory)


def record(name: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The log of a live run without the truth; its results are in the folder live beside it."""
    folder = tmp_path_factory.mktemp(name)
    with Emulator("gyrocompass") as emulator:
        assert emulator.control_path is not None
        where = ("--control", emulator.control_path, "--record", folder / "run.log", "--out", folder / "live")
        assert run(name, *where) in (0, 1)
    return folder / "run.log"


def same(a: Path, b: Path) -> bool:
    return report_without_provenance(a) == report_without_provenance(b)


def test_each_format_says_what_it_keeps() -> None:
    assert sorted(KEEPS) == READABLE


def test_a_replay_of_gyrocompass_gives_the_live_results(gyrocompass: Path, tmp_path: Path) -> None:
    assert run("gyrocompass", "--replay", gyrocompass, "--out", tmp_path) in (0, 1)
    assert same(tmp_path, gyrocompass.parent / "live")


def test_a_replay_of_a_hold_gives_the_live_results(tmp_path_factory: pytest.TempPathFactory, tmp_path: Path) -> None:
    log = record("heading-hold", tmp_path_factory)
    assert run("heading-hold", "--replay", log, "--out", tmp_path) in (0, 1)
    assert same(tmp_path, log.parent / "live")


@pytest.mark.parametrize("ending", [".mcap", ".lcmlog", ".pcap", pytest.param(".mf4", marks=WITH_MF4)])
def test_other_formats_give_them_too(ending: str, gyrocompass: Path, tmp_path: Path) -> None:
    """What all the others keep is compared below."""
    path = tmp_path / f"run{ending}"
    shutil.copy(calls_path(gyrocompass), calls_path(path))
    out = LogFile(path)
    assert all(out(m) for m in read_frames(gyrocompass))
    out.close()
    assert run("gyrocompass", "--replay", path, "--out", tmp_path) in (0, 1)
    assert same(tmp_path, gyrocompass.parent / "live")


@pytest.mark.parametrize("ending", [e for e, kept in KEEPS.items() if "time stamps" not in kept])
def test_a_format_without_exact_instants_is_refused(
    ending: str, gyrocompass: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / f"run{ending}"
    shutil.copy(calls_path(gyrocompass), calls_path(path))
    assert run("gyrocompass", "--replay", path, "--out", tmp_path) == 2
    assert f"{path}: expected a format that keeps time stamps (" in capsys.readouterr().err


def test_what_was_not_recorded_is_refused(
    gyrocompass: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    name, other, log = "gyrocompass", "heading-hold", gyrocompass
    for words, why in (
        ([name, "--replay", log, "--window-s", "3"], "(of the procedure)"),
        ([name, "--replay", log, "--seed", "3"], "expected no option of the bench beside --replay, got --seed"),
        ([name, "--replay", log, "--real-time"], "got --real-time"),
        ([other, "--replay", log], f"expected run {name}, as recorded, got {other}"),
        ([name, "--record", tmp_path / "x.log"], "expected one reading (--reading article or improved), got several"),
        ([name, "--record", tmp_path / "x.blf", "--reading", "article"], "a format that keeps time stamps (.csv .db"),
    ):
        words = [*words, *SHORT.split()[2:], "--out", tmp_path]
        assert cli.main(["run", *map(str, words)]) == 2
        assert why in capsys.readouterr().err.splitlines()[-1]
    lines = log.read_text().splitlines(keepends=True)
    cut = Path(shutil.copy(calls_path(log), tmp_path)).with_name("run.log")
    cut.write_text("".join(lines[:-1]))
    assert run(name, "--replay", cut, "--out", tmp_path) == 2
    assert f"expected {len(lines)} frames, as " in capsys.readouterr().err


@pytest.mark.parametrize("ending", EVERY)
def test_what_a_format_keeps_is_what_it_says(ending: str, tmp_path: Path) -> None:
    """Instants to the microsecond on two buses, as a recorder has them."""
    at_s = [round(0.1 + n * 0.007_919 + n * n * 1e-6, 6) for n in range(200)]
    log = LogFile(tmp_path / f"run{ending}")
    for n, t_s in enumerate(at_s):
        assert log(can.Message(timestamp=t_s, arbitration_id=5, is_extended_id=False, data=b"1", channel=n % 2))
    log.close()
    got = list(read_frames(log.path))
    assert len(got) == len(at_s)
    kept = {
        "time stamps": [m.timestamp for m in got] == at_s,
        "channels": [m.channel is not None and can.util.channel2int(m.channel) for m in got]
        == [n % 2 for n in range(200)],
    }
    assert [what for what, same in kept.items() if same] == list(KEEPS[ending])
