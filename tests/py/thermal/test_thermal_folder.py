"""The folder of a thermal run: damaged files, a second process, death at any instant."""

from __future__ import annotations

import fcntl
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from psabench import cli
from psabench.errors import BadInput
from psabench.procedures.head_bench import Silent
from psabench.thermal import run as thermal_run
from psabench.thermal.records import COLUMNS, TRUTH_COLUMNS, RunFolder, read_recordings, read_rows
from psabench.thermal.run import ThermalOptions, run_thermal

SETUP: dict[str, Any] = {
    "format": 1,
    "name": "quick",
    "schedule": {"degree": 1, "soak": {"temperatures_c": [20, 35, 50]}},
    "ours": True,
    "scenario": "",
    "seed": None,
    "node": 5,
    "accuracy": {},
    "g_mps2": 9.81,
    "origin_s": 1.0,
    "start_degc": 25.0,
}
ROW = dict.fromkeys(COLUMNS, "1.0") | {"segment": "soak", "position": "x_up", "part": "0"}


def error_of(capsys: pytest.CaptureFixture[str], *words: str) -> tuple[int, str]:
    """Exit status and the one line."""
    status = cli.main(["run", "thermal", *words])
    (line,) = capsys.readouterr().err.splitlines()
    return status, line


@pytest.mark.parametrize(
    ("key", "value", "says"),
    [
        ("g_mps2", "heavy", 'expected a number for g_mps2, got "heavy"'),
        ("start_degc", None, "expected a number for start_degc, got null"),
        ("origin_s", 10**400, "expected a number for origin_s, got 1000000"),
        ("start_degc", float("nan"), "expected a number for start_degc, got NaN"),
        ("node", 5.5, "expected a whole number for node, got 5.5"),
        ("node", True, "expected a whole number for node, got true"),
        ("seed", "one", 'expected a whole number or null for seed, got "one"'),
        ("ours", 1, "expected true or false for ours, got 1"),
        ("scenario", 7, "expected a text for scenario, got 7"),
        ("accuracy", {"circle_arcsec": "round"}, 'expected numbers by their names for accuracy, got {"circle'),
        ("accuracy", [3], "expected numbers by their names for accuracy, got [3]"),
        ("schedule", "quick", 'expected a schedule for schedule, got "quick"'),
        ("schedule", {"degree": "two"}, "degree: expected a number, got two"),
        ("schedule", {"low_c": 10**400}, "int too large to convert to float"),
    ],
)
def test_a_set_up_with_a_wrong_value_is_one_line(
    key: str, value: object, says: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "thermal-run.json"
    path.write_text(json.dumps(SETUP | {key: value}))
    status, line = error_of(capsys, "--resume", str(tmp_path))
    assert status == 2
    assert line.startswith(f"psabench: {path}: ")
    assert says in line


def test_a_set_up_that_is_nested_too_deep_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "thermal-run.json").write_text("[" * 100_000)
    status, line = error_of(capsys, "--resume", str(tmp_path))
    assert (status, "thermal-run.json: expected the set-up of a run" in line) == (2, True)


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("x_v", "volts", 'expected a number for x_v, got "volts"'),
        ("case_degc", "nan", 'expected a number for case_degc, got "nan"'),
        ("part", "0.5", "expected a whole number for part, got 0.5"),
        ("part", "first", 'expected a number for part, got "first"'),
        ("position", "x_over", 'expected a position of x_down, .* got "x_over"'),
        ("z_v", "1" * 200_000, "expected comma-separated values, got field larger than field limit"),
    ],
)
def test_a_stored_row_with_a_wrong_value_is_one_line(name: str, text: str, says: str, tmp_path: Path) -> None:
    path = tmp_path / "thermal.csv"
    path.write_text(",".join(COLUMNS) + "\n" + ",".join((ROW | {name: text}).values()) + "\n")
    with pytest.raises(BadInput, match=rf"thermal\.csv(:2)?: {says}"):
        read_recordings(path)


def test_a_row_of_another_length_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "thermal-truth.csv"
    path.write_text(",".join(TRUTH_COLUMNS) + "\n1,2\n")
    with pytest.raises(BadInput, match=r"thermal-truth\.csv:2: expected 9 values, got 2"):
        read_rows(path, TRUTH_COLUMNS)


# ---- a second process

HOLDER = """
import os, sys
from pathlib import Path
from psabench.thermal.records import RunFolder
with RunFolder(Path(sys.argv[1])).own_folder():
    print(os.getpid(), flush=True)
    sys.stdin.read()
"""


@pytest.mark.parametrize("option", ["--out", "--resume"])
def test_a_second_process_is_refused_until_the_first_is_dead(
    option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "thermal-run.json").write_text(json.dumps(SETUP | {"node": "none"}))
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(tmp_path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as first:
        assert first.stdout is not None
        pid = first.stdout.readline().strip()
        status, line = error_of(capsys, option, str(tmp_path))
        first.send_signal(signal.SIGKILL)
    assert status == 2
    assert (
        line == f"psabench: {tmp_path}/thermal.lock: expected a file that no other process writes, got one of pid {pid}"
    )
    with RunFolder(tmp_path).own_folder():  # the lock died with its process
        pass


def test_a_run_holds_its_folder_while_its_report_is_written(tmp_path: Path) -> None:
    complete_run(tmp_path)
    with (
        run_thermal(ThermalOptions(out=tmp_path, resume=tmp_path), Silent()),
        (tmp_path / "thermal.lock").open() as lock,
        pytest.raises(BlockingIOError),
    ):
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)


# ---- the checkpoint that is left


def complete_run(path: Path) -> None:
    """A folder with every recording of its schedule, and the last checkpoint."""
    folder = RunFolder(path)
    folder.store_setup({k: v for k, v in SETUP.items() if k != "format"})
    rows = []
    for part, temp_c in enumerate((20.0, 35.0, 50.0)):
        for k, (name, x, y, z) in enumerate(
            (
                ("x_down", 1, 0, 0),
                ("x_up", -1, 0, 0),
                ("y_down", 0, 1, 0),
                ("y_up", 0, -1, 0),
                ("z_down", 0, 0, 1),
                ("z_up", 0, 0, -1),
            )
        ):
            angle = {"x_down": 270.0, "x_up": 90.0}.get(name, 180.0 if name.endswith("down") else 0.0)
            t_s = 4000.0 * part + 6.0 * k
            rows.append(
                [t_s, "soak", part, name, angle, *[temp_c] * 5, *(1.2 * a + 1e-4 for a in (x, y, z)), *[1e-7] * 3]
            )
    with folder.open_series() as series:
        series.store_rows(rows)
    (path / "checkpoint-18.snapshot").write_text("")
    (path / "checkpoint-12.part").write_text("")


def test_a_complete_run_is_not_written_over_but_on_request(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    complete_run(tmp_path)
    files = {path: path.read_bytes() for path in tmp_path.glob("thermal*")}
    status, line = error_of(capsys, "--out", str(tmp_path))
    ways = f"another folder, --resume {tmp_path} for its report again, or --fresh to measure again"
    assert status == 2
    assert line == f"psabench: --out: expected {ways}, got one with 18 recordings of a run that is complete"
    assert {path: path.read_bytes() for path in files} == files

    def begun(*_: object) -> None:
        raise BadInput("begun")

    monkeypatch.setattr(thermal_run, "_run_of", begun)
    assert error_of(capsys, "--out", str(tmp_path), "--fresh") == (2, "psabench: begun")
    status, line = error_of(capsys, "--resume", str(tmp_path), "--fresh")
    assert (status, line) == (2, "psabench: --resume: expected no option that the run has already, got --fresh")


def test_checkpoints_of_a_complete_run_go_after_its_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    complete_run(tmp_path)
    assert cli.main(["run", "thermal", "--resume", str(tmp_path)]) == 0
    assert not list(tmp_path.glob("checkpoint-*"))
    assert (tmp_path / "result.json").exists()


def test_checkpoints_stay_where_the_report_fails(tmp_path: Path) -> None:
    complete_run(tmp_path)
    with pytest.raises(ZeroDivisionError), run_thermal(ThermalOptions(out=tmp_path, resume=tmp_path), Silent()):
        raise ZeroDivisionError
    assert (tmp_path / "checkpoint-18.snapshot").exists()


# Dies at one of the calls that change the folder: the report, the removal of each checkpoint.
DIES = """
import os, signal, sys
from pathlib import Path
from psabench import cli
from psabench.report import thermal_page
left = int(sys.argv[2])
def dying(call):
    def wrapped(*args, **more):
        global left
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        left -= 1
        return call(*args, **more)
    return wrapped
os.replace = dying(os.replace)
Path.unlink = dying(Path.unlink)
os.unlink = dying(os.unlink)
sys.exit(cli.main(["run", "thermal", "--resume", sys.argv[1]]))
"""


def test_killed_at_any_change_of_the_folder_a_complete_run_still_gives_its_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    instants = 0
    for calls in range(20):
        folder = tmp_path / str(calls)
        folder.mkdir()
        complete_run(folder)
        died = subprocess.run([sys.executable, "-c", DIES, str(folder), str(calls)], check=False, capture_output=True)
        if died.returncode != -signal.SIGKILL:
            break
        instants += 1
        assert (folder / "checkpoint-18.snapshot").exists() or (folder / "result.json").exists()
        assert cli.main(["run", "thermal", "--resume", str(folder)]) == 0
        assert not list(folder.glob("checkpoint-*"))
    assert instants >= 3  # at least result.json and two checkpoints
    assert died.returncode == 0, died.stderr
