"""`psabench run mems-gyro` through the whole wire: table over SCPI, gyro's volts, PSA-2, CAN, host."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import numpy as np
import pytest
from psabench import cli
from psabench.emulator import Emulator
from psabench.mems_gyro.params import MemsGyroParams

from tests.coverage import mems_gyro as coverage

pytestmark = pytest.mark.host

ROOT = Path(__file__).parents[3]
SHORT = ("--series", "1", "--dwell-s", "2", "--rest-s", "300")
Lines = pytest.CaptureFixture[str]


def run(out: Path, *words: str | Path) -> int:
    return cli.main(["run", "mems-gyro", "--out", str(out), *map(str, words)])


def scenario(folder: Path, *changes: tuple[str, str], more: str = "") -> Path:
    text = (ROOT / "proto/scenarios/mems_gyro.yaml").read_text()
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    path = folder / "gyro.yaml"
    path.write_text(text + more)
    return path


def test_a_short_run_finds_the_gyro(tmp_path: Path, capsys: Lines) -> None:
    """Within 2 U of the truth; the files have what the page says."""
    assert run(tmp_path, *SHORT, "--seed", "3", "--verbose") == 0
    said = capsys.readouterr().out
    assert "10 numbers are within 2 U of the gyro's true parameters" in said
    section = json.loads((tmp_path / "result.json").read_text())["sections"][0]
    found = {e["name"]: e for e in section["estimates"]}
    assert found["scale_mv_per_dps"]["truth"] == pytest.approx(11.8189, abs=1e-4)  # another one for each seed
    assert 0.0 < found["scale_mv_per_dps"]["sd"] < 0.004
    assert set(found["cross_y_mrad"]["budget"]) == {"scatter", "mounting"}
    assert found["cross_y_mrad"]["budget"]["mounting"] == pytest.approx(1e3 * math.radians(1 / 60), rel=0.05)
    with (tmp_path / "dwells.csv").open() as f:
        rows = list(csv.DictReader(f))
    assert sum(r["recording"] == "1" for r in rows) == 300
    assert len(rows) == 300 + 40 * 2
    assert len(section["correlation"]["names"]) == 9
    assert (tmp_path / "report.html").read_text().count("<svg") == 2


def test_the_truth_changes_no_result(tmp_path: Path) -> None:
    """On an emulator without a truth port the same readings, to the byte, and the same estimates."""
    run(tmp_path / "told", *SHORT, "--seed", "5")
    with Emulator("mems_gyro", seed=5, scpi=True) as emu:
        assert run(tmp_path / "blind", *SHORT, "--control", str(emu.control_path)) == 0
    told, blind = (tmp_path / name for name in ("told", "blind"))
    assert (told / "dwells.csv").read_bytes() == (blind / "dwells.csv").read_bytes()
    values = [
        [e["value"] for e in json.loads((folder / "result.json").read_text())["sections"][0]["estimates"]]
        for folder in (told, blind)
    ]
    assert values[0] == values[1]


def test_a_gyro_on_another_channel(tmp_path: Path, capsys: Lines) -> None:
    path = scenario(tmp_path, ("      x:\n", "      z:\n"))
    assert run(tmp_path / "z", *SHORT, "--axis", "z", "--scenario", path) == 0
    assert "true parameters" in capsys.readouterr().out


def test_a_fault_of_the_sensor_is_a_doubt(tmp_path: Path, capsys: Lines) -> None:
    """An output that sticks during the series: its dwells are named, and the exit status says so."""
    fault = "faults: [{kind: sensor.stuck, point: a.sensor.x, at_s: 450}]\n"
    assert run(tmp_path, *SHORT, "--dwell-s", "4", "--scenario", scenario(tmp_path, more=fault)) == 1
    said = capsys.readouterr().out
    assert "DOUBT: -75.0 °/s at 0°, 180°: the output has no noise: at a limit, or stuck" in said
    assert "The intervals are not to be trusted" in said


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        (
            "    - {along: z}\n    - {along: y}\n    - {along: x}\n",
            "    - {along: z}\n",
            "expected a table of 3 axes, each of the gyro's goes along the vertical, got 1",
        ),
        ("        sensor: mems_gyro\n", "        sensor: mems_gyro\n        afe: {input: current}\n", "voltage"),
        (
            "        sensor: mems_gyro\n",
            "        sensor: mems_gyro\n        signal: {file: a.csv, column: x_mps2}\n",
            "expected a sensor that takes it, got mems_gyro",
        ),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, capsys: Lines, old: str, new: str, text: str) -> None:
    assert run(tmp_path / "out", *SHORT, "--scenario", scenario(tmp_path, (old, new))) == 2
    assert text in capsys.readouterr().err


def test_a_run_of_another_sensor_is_an_error(tmp_path: Path, capsys: Lines) -> None:
    """Before anything is measured."""
    assert run(tmp_path / "out", "--scenario", scenario(tmp_path), "--axis", "y") == 2
    assert "mems-gyro: expected a mems_gyro on channel y, got none" in capsys.readouterr().err
    assert not (tmp_path / "out/dwells.csv").exists()


def test_u_contains_the_truth_through_the_wire(tmp_path: Path) -> None:
    """Two specimens with the defaults of the command, 18 numbers of the model: no more beyond U than chance has it."""
    runs = [coverage.through_the_wire(seed, MemsGyroParams(), str(tmp_path)) for seed in (11, 12)]
    en = np.array([run[q][0] for run in runs for q in run if not q.endswith(("_rth", "degph"))])
    assert en.size == 18
    assert np.sum(np.abs(en) > 1.0) <= 4  # 0.8 expected; more comes once in 1000
    assert np.max(np.abs(en)) < 2.0
