"""One run of each study through the wire: an emulator of its own, the host's procedure, the truth port last."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import yaml
from psabench.places import proto_file
from psabench.procedures import gyro_run, run
from psabench.procedures.head_bench import Silent
from psabench.procedures.registry import PROCEDURES
from psabench.procedures.run_table import CONDITIONS
from psabench.report import grading, gyro_grading

from tests.coverage.passports import PASSPORTS
from tests.coverage.table import Run

CALIBRATION = CONDITIONS["realistic"]
REALISATIONS = {"fourier": 2, "reversal": 2}  # of 5: two fifths of the time, wider intervals, the same budget


def passport_of(seed: int) -> str:
    """The passports in turn."""
    return list(PASSPORTS)[seed % len(PASSPORTS)]


def calibration_scenario(passport: str) -> dict[str, object]:
    """The scenario `realistic` with another sensor."""
    scenario: dict[str, object] = yaml.safe_load(
        proto_file(f"scenarios/{CALIBRATION.scenario}.yaml").read_text(encoding="utf-8")
    )
    units = scenario["units"]
    assert isinstance(units, list)
    units[0]["axes"]["x"] |= PASSPORTS[passport]
    return scenario


def run_calibrations(seed: int, folder: Path) -> Iterator[tuple[str, tuple[float, float]]]:
    """Every procedure on the head, each on a unit drawn by the seed: z and En of what it calls measured."""
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump(calibration_scenario(passport_of(seed))), encoding="utf-8")
    for name, procedure in PROCEDURES.items():
        params = {"realisations": REALISATIONS[name]} if name in REALISATIONS else {}
        options = run.RunOptions(procedures=[name], out=folder, scenario=path, seed=seed, params=params)
        section = run.measure_section(procedure, CALIBRATION, options, Silent())
        for g in grading.grade(section):
            if g.estimate.identifiable and g.z is not None and g.en is not None:
                yield f"{name} {g.estimate.name}", (g.z, g.en)


def run_gyrocompass(reading: str, seed: int, folder: Path) -> Iterator[tuple[str, tuple[float, float]]]:
    """North and drifts of a platform drawn by the seed."""
    options = gyro_run.GyroOptions(procedure="gyrocompass", out=folder, seed=seed, params={"reading": reading})
    for section in gyro_run.run(options, Silent()):
        for g in gyro_grading.grade(section):
            if g.error is not None:
                yield (
                    f"gyrocompass {reading} {g.estimate.name}",
                    (g.error / g.estimate.sd, g.error / g.estimate.ci_half),
                )


STUDIES: Mapping[str, Callable[[int, Path], Iterator[tuple[str, tuple[float, float]]]]] = {
    "calibrations": run_calibrations,
    "gyrocompass-article": lambda seed, folder: run_gyrocompass("article", seed, folder),
    "gyrocompass-improved": lambda seed, folder: run_gyrocompass("improved", seed, folder),
}


def run_study(name: str, seed: int) -> Run:
    """One run. Raises BenchError."""
    with tempfile.TemporaryDirectory(prefix="psabench-") as folder:
        return dict(STUDIES[name](seed, Path(folder)))
