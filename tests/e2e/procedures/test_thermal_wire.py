"""Thermal runs through the wire: killed and resumed, a chamber that does not follow."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import time
from pathlib import Path

import pytest
from psabench import cli

pytestmark = pytest.mark.host

ROOT = Path(__file__).resolve().parents[3]
PSABENCH = ROOT / ".venv/bin/psabench"
SEED = int(os.environ.get("TEST_SEED", "20151110"))
# Lags of 2 and 4 s: a sweep takes three minutes.
UNIT = """
seed: 5
site: {g_mps2: 9.8094}
head: {resolution_arcsec: 1, setting_error_arcsec_rms: 2, turn_s: 1}
chamber: {heating_max_k_per_min: 60, cooling_max_k_per_min: 60, tau_case_s: 2, tau_element_s: 4}
spread: {quartz: serial}
units:
  - name: a
    spread: true
    axes:
      x: &sensor {sensor: quartz, quartz: {pendulum: {}, cycles: 10}, afe: {input: current, load_ohm: 937.5}}
      y: *sensor
      z: *sensor
"""
SCHEDULE = """
low_c: 15
high_c: 35
degree: 1
record_s: 0.16
soak: {temperatures_c: [15, 25, 35], ramp_k_per_min: 60, dwell_s: 20}
sweep: {rates_k_per_min: [5], every_s: 6, rest_s: 20, legs: up, ramp_k_per_min: 60}
"""


def started(folder: Path, unit: str = UNIT) -> list[str]:
    """The words of a new run in `folder`."""
    folder.mkdir()
    (folder / "unit.yaml").write_text(unit)
    (folder / "schedule.yaml").write_text(SCHEDULE)
    files = ["--scenario", f"{folder}/unit.yaml", "--schedule", f"{folder}/schedule.yaml"]
    return ["run", "thermal", *files, "--out", f"{folder}/run"]


def rows_in(folder: Path) -> int:
    path = folder / "run/thermal.csv"
    return path.read_bytes().count(b"\n") - 1 if path.exists() else 0


def kill_after(words: list[str], folder: Path, rows: int) -> None:
    """The run, when it has stored so many recordings."""
    run = subprocess.Popen([PSABENCH, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    while rows_in(folder) < rows and run.poll() is None:
        time.sleep(0.01)  # until the file has grown; no order depends on it
    run.kill()
    assert run.wait() == -signal.SIGKILL


def test_a_run_that_was_killed_has_the_digits_of_one_in_one_piece(tmp_path: Path) -> None:
    print(f"TEST_SEED={SEED}")
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    assert cli.main(started(whole)) in (0, 1)
    words = started(cut)
    for rows in sorted(random.Random(SEED).sample(range(1, 45), 2)):
        kill_after(words, cut, rows)
        words = ["run", "thermal", "--resume", f"{cut}/run"]
    assert cli.main(words) in (0, 1)
    for name in ("thermal.csv", "thermal-truth.csv"):
        assert (cut / "run" / name).read_bytes() == (whole / "run" / name).read_bytes()
    results = [json.loads((folder / "run/result.json").read_text()) for folder in (cut, whole)]
    assert results[0]["sections"] == results[1]["sections"]


@pytest.mark.parametrize(
    ("fault", "says", "rows"),
    [
        # seen by the recording that it spoils
        ("chamber.slow, point: chamber, rate_part: 1.0e-6", "chamber: expected 25.0 degC .* it does not follow", 7),
        (
            "chamber.readout, point: chamber, readout_k: 5",
            "chamber: expected 25.0 degC .* it does not follow or reads",
            7,
        ),
        ("analog.load_open, point: a.afe.y", "channel y: expected readings within its range, got one at its limit", 6),
    ],
)
def test_a_fault_of_the_bench_ends_the_run_and_what_it_has_is_kept(
    fault: str, says: str, rows: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    unit = f"{UNIT}faults: [{{at_s: 72, kind: {fault}}}]\n"
    assert cli.main(started(tmp_path / "run", unit)) == 3
    (line,) = [x for x in capsys.readouterr().err.splitlines() if x.startswith("psabench: ")]
    assert re.search(says, line)
    assert rows_in(tmp_path / "run") == rows


def test_a_chamber_that_cannot_reach_a_temperature_ends_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(started(tmp_path / "run", UNIT.replace("chamber: {", "chamber: {max_degc: 30, "))) == 3
    (line,) = [x for x in capsys.readouterr().err.splitlines() if x.startswith("psabench: ")]
    assert re.search("chamber: TEMP 35.0: Data out of range;temp_degc: expected -60 to 30 degC, got 35", line)
    assert rows_in(tmp_path / "run") == 12  # of the two temperatures that it reached
