"""Thermal runs through the wire: killed and resumed, a chamber that does not follow, a full disk."""

from __future__ import annotations

import json
import os
import random
import resource
import subprocess
import time
from pathlib import Path

import pytest

pytestmark = pytest.mark.host

ROOT = Path(__file__).resolve().parents[3]
PSABENCH = ROOT / ".venv/bin/psabench"
SEED = int(os.environ.get("TEST_SEED", "20151110"))
# Lags of 2 and 4 s: a sweep up and down in two minutes.
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
soak: {temperatures_c: [15, 25, 35], ramp_k_per_min: 60, dwell_s: 60}
sweep: {rates_k_per_min: [10], every_s: 6, rest_s: 60, ramp_k_per_min: 60}
"""
FAULT = "faults: [{kind: chamber.slow, point: chamber, at_s: 60, args: {rate_part: 1.0e-6}}]\n"


def started(folder: Path, *more: str, unit: str = UNIT) -> list[str]:
    """The words of a new run in `folder`."""
    (folder / "unit.yaml").write_text(unit)
    (folder / "schedule.yaml").write_text(SCHEDULE)
    files = ["--scenario", f"{folder}/unit.yaml", "--schedule", f"{folder}/schedule.yaml"]
    return [str(PSABENCH), "run", "thermal", *files, "--out", f"{folder}/run", *more]


def ended(words: list[str], **how: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(words, capture_output=True, text=True, cwd=ROOT, timeout=120, **how)  # type: ignore[call-overload,no-any-return]


def rows_in(folder: Path) -> int:
    path = folder / "run/thermal.csv"
    return path.read_bytes().count(b"\n") - 1 if path.exists() else 0


def killed_after(words: list[str], folder: Path, rows: int) -> None:
    """The run, until it has stored so many recordings."""
    run = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=ROOT)
    while rows_in(folder) < rows and run.poll() is None:
        time.sleep(0.002)  # until the file has grown; no order depends on it
    run.kill()
    run.wait()


def test_a_run_that_was_killed_has_the_digits_of_one_in_one_piece(tmp_path: Path) -> None:
    print(f"TEST_SEED={SEED}")
    rng = random.Random(SEED)
    (tmp_path / "whole").mkdir()
    done = ended(started(tmp_path / "whole"))
    assert done.returncode == 0, done.stdout + done.stderr
    folder = tmp_path / "cut"
    folder.mkdir()
    words = started(folder)
    for rows in sorted(rng.sample(range(1, 50), 2)):
        killed_after(words, folder, rows)
        words = [str(PSABENCH), "run", "thermal", "--resume", f"{folder}/run"]
    done = ended(words)
    assert done.returncode == 0, done.stdout + done.stderr
    for name in ("thermal.csv", "thermal-truth.csv"):
        assert (folder / "run" / name).read_bytes() == (tmp_path / "whole/run" / name).read_bytes()
    results = [json.loads((p / "run/result.json").read_text()) for p in (folder, tmp_path / "whole")]
    assert results[0]["sections"] == results[1]["sections"]


def test_a_chamber_that_sticks_ends_the_run_and_keeps_what_it_has(tmp_path: Path) -> None:
    done = ended(started(tmp_path, unit=UNIT + FAULT))
    assert done.returncode == 3
    (line,) = [x for x in done.stderr.splitlines() if x.startswith("psabench: ")]
    assert "chamber: expected 25.0 degC" in line
    assert "it does not follow or reads wrong" in line
    assert rows_in(tmp_path) == 7  # the coldest temperature, and the recording that shows it


def test_a_full_disk_ends_the_run_in_one_line(tmp_path: Path) -> None:
    def limit() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))

    done = ended(started(tmp_path), preexec_fn=limit)
    assert done.returncode == 3
    (line,) = [x for x in done.stderr.splitlines() if x.startswith("psabench: ")]
    assert "thermal" in line
    assert 0 < rows_in(tmp_path) < 13


def test_resume_refuses_what_it_cannot_continue(tmp_path: Path) -> None:
    resumed = [str(PSABENCH), "run", "thermal", "--resume", str(tmp_path)]
    for more, says in (
        ([], "expected a folder of psabench run thermal, with thermal-run.json, got none"),
        (["--seed", "3"], "--resume: expected no option that the run has already, got --seed"),
    ):
        done = ended([*resumed, *more])
        assert done.returncode == 2
        assert says in done.stderr
