"""`--climate` of the calibrations on the head as a user runs it: what is found at each temperature, and per kelvin."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from psabench import cli

pytestmark = pytest.mark.host


@pytest.mark.parametrize(
    ("procedure", "slopes", "scale_name"), [("turns", 6, "kx_sum_v_per_g"), ("fourier", 10, "kx_eff_v_per_g")]
)
def test_turns_in_a_chamber_find_the_coefficients(
    procedure: str, slopes: int, scale_name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["run", procedure, "--climate", "--realisations", "3", "--out", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert f"All {slopes} slopes are within 2 U of the sensor's true coefficients per kelvin." in told
    data = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert data["temperatures_degc"] == [-40.0, 0.0, 25.0, 60.0, 85.0]
    assert len(data["sections"]) == 5
    of = {c["name"]: c for c in data["against_temperature"]}
    zero, scale = of["u0_v_per_k"], of[f"{scale_name}_per_k"]
    for found in (zero, scale):  # not hidden by U, and near the truth: neither is by chance
        assert abs(found["truth_per_k"]) > 2.0 * found["expanded_u"]
        assert abs(found["per_k"] - found["truth_per_k"]) < 2.0 * found["expanded_u"]
    assert zero["budget"]["chain's drift"] > 1e-5  # 10 µV/K of the board's zero, 5 ppm/K of 2.5 V
    assert (tmp_path / f"{procedure}--40.csv").exists()
    assert "Against temperature" in (tmp_path / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize("option", ["--record", "--replay", "--can", "--head"])
def test_a_bench_without_a_chamber_is_refused(option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", "reversal", "--climate", option, "there", "--out", str(tmp_path)]) == 2
    assert f"run: expected no {option} beside --climate, got there" in capsys.readouterr().err
