"""Converters in a chamber over the wire, five temperatures: what the host finds is what the parts drift by.

What the run prints is on its page (test_docs.py); both look at one run.
"""

from __future__ import annotations

import json
import subprocess
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench.climate.converters import ChamberParams

pytestmark = [pytest.mark.host, pytest.mark.timeout(600)]  # the run: a minute of CPU

Generations = Mapping[str, Mapping[str, Any]]
COVERAGE_K = 2.0
DRIFT_U = COVERAGE_K * 2**0.5  # times the standard uncertainty of a value: of the difference of two


@pytest.fixture(scope="module")
def result(chamber_job: tuple[subprocess.CompletedProcess[str], Path]) -> dict[str, Any]:
    done, folder = chamber_job
    assert done.returncode == 0, done.stdout
    read: dict[str, Any] = json.loads((folder / "result.json").read_text(encoding="utf-8"))
    return read


@pytest.fixture(scope="module")
def found(result: dict[str, Any]) -> Generations:
    return {g["name"]: g for g in result["generations"]}


def lines(generation: Mapping[str, Any], of: str) -> Iterator[tuple[float, float]]:
    """Greatest drift from the first temperature on, without its sign, and U, of each zero or scale."""
    for line in generation["lines"]:
        if line["name"].startswith(of):
            yield float(np.abs(np.array(line["values"]) - line["values"][0]).max()), DRIFT_U * line["u"]


def test_what_is_found_is_what_the_parts_drift_by(result: dict[str, Any], found: Generations) -> None:
    assert result["temperatures_degc"] == list(ChamberParams().points_degc)
    graded = [x for g in found.values() for x in g["lines"] if x["truth_per_k"] is not None]
    assert len(graded) == 30
    for line in graded:
        assert abs(line["per_k"] - line["truth_per_k"]) <= 2.0 * line["per_k_expanded_u"], line
    for name in ("pik", "pik6", "psa2"):  # and it is not hidden by U
        for of in ("zero", "scale"):
            drift, u = max(lines(found[name], of))
            assert drift > 2.0 * u


def test_the_zero_of_psa_drifts_less_than_that_of_pik(found: Generations) -> None:
    """The article's words; by the scenario's own coefficients (E0). PMKA and PSD-1 drift less than their U."""
    worst_g = {name: max(lines(g, "zero"))[0] / g["ma_v_per_g"] for name, g in found.items()}
    for name in ("pik", "pik5", "pik6"):
        assert worst_g["psa2"] < worst_g[name]
    for name in ("pmka", "psd1"):
        drift, u = max(lines(found[name], "zero"))
        assert drift < 2.0 * u
    before = min(g["quantum_mps"] for name, g in found.items() if name not in ("psa1", "psa2"))
    assert before / found["psa2"]["quantum_mps"] > 10.0


def test_the_rom_ends_at_its_points(found: Generations) -> None:
    """Corrected within -40 to 80 degC, to what 30 s of calibrations leave; at -60 the ROM has its last point."""
    values = np.array([x["values"] for x in found["pmka"]["lines"] if x["name"].startswith("scale")])
    drift = np.abs(values - values[:, :1])
    assert drift[:, 2:].max() < 8e-6  # -20, 55, 85 degC
    assert drift[:, 1].max() > 15e-6
