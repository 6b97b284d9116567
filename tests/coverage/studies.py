"""One run of each study through the wire: an emulator of its own, the host's procedure, the truth port last."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from psabench.places import proto_file
from psabench.procedures import comparison, gyro_run, heading_hold, run
from psabench.procedures.command_line.offered import CONDITIONS
from psabench.procedures.compare_converters import CompareParams
from psabench.procedures.gyrocompass_params import GyrocompassParams
from psabench.procedures.head_bench import Silent
from psabench.procedures.registry import PROCEDURES
from psabench.report import grading, gyro_grading
from psabench.report.gyro_grading import GyroSection

from tests.coverage.passports import PASSPORTS
from tests.coverage.table import BY_LIMIT, Run

CALIBRATION = CONDITIONS["realistic"]
REALISATIONS = {"fourier": 2, "reversal": 2}  # of 5: two fifths of the time, wider intervals, the same budget
HOLD_HOURS = 0.5
WALK_V_RTS = 2e-5
LEVEL_AXIS = "Y"  # of the comparison: it feels no motion, so that its coefficient does not matter


def passport_of(seed: int) -> str:
    """The passports in turn."""
    return list(PASSPORTS)[seed % len(PASSPORTS)]


def calibration_scenario(passport: str, **more: float) -> dict[str, object]:
    """The scenario `realistic` with another sensor, more: keys of its axis."""
    scenario: dict[str, object] = yaml.safe_load(
        proto_file(f"scenarios/{CALIBRATION.scenario}.yaml").read_text(encoding="utf-8")
    )
    units = scenario["units"]
    assert isinstance(units, list)
    units[0]["axes"]["x"] |= {**PASSPORTS[passport], **more}
    return scenario


def run_calibrations(seed: int, folder: Path) -> Iterator[tuple[str, tuple[float, float]]]:
    """Every procedure on the head, each on a unit drawn by the seed: z and En of what it calls measured."""
    for name in PROCEDURES:
        yield from _run_calibration(name, calibration_scenario(passport_of(seed)), seed, folder)


def run_wandering(seed: int, folder: Path) -> Iterator[tuple[str, tuple[float, float]]]:
    """Test turns of a sensor whose zero wanders; a run that says so is not counted."""
    scenario = calibration_scenario(passport_of(seed), walk_v_rts=WALK_V_RTS)
    for name, numbers in _run_calibration("turns", scenario, seed, folder, doubtful=False):
        yield f"{name} (zero wanders)", numbers


def _run_calibration(
    name: str, scenario: Mapping[str, object], seed: int, folder: Path, *, doubtful: bool = True
) -> Iterator[tuple[str, tuple[float, float]]]:
    """doubtful: a run that says its zero wanders counts as any other."""
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump(dict(scenario)), encoding="utf-8")
    params = {"realisations": REALISATIONS[name]} if name in REALISATIONS else {}
    options = run.RunOptions(procedures=[name], out=folder, scenario=path, seed=seed, params=params)
    section = run.measure_section(PROCEDURES[name], CALIBRATION, options, Silent())
    for g in grading.grade(section) if doubtful or not section.result.doubts else ():
        if g.estimate.identifiable and g.z is not None and g.en is not None:
            yield f"{name} {g.estimate.name}", (g.z, g.en)


def gyro_scenario(seed: int) -> dict[str, object]:
    """The scenario `gyrocompass` on another vehicle, its constant errors anywhere within the passport's limits."""
    rng = np.random.default_rng([20080924, seed])
    p = GyrocompassParams()
    scenario: dict[str, Any] = yaml.safe_load(proto_file("scenarios/gyrocompass.yaml").read_text(encoding="utf-8"))
    level = scenario["units"][0]
    level["on"] = level.pop(True)  # YAML 1.1 reads the key `on` as true
    anywhere = {"angle_zero_arcmin": p.angle_zero_arcmin, "level_tilt_arcmin": p.level_zero_arcmin}
    anywhere["torquer_scale"] = p.torquer_scale
    drawn = {name: limit * rng.uniform(-1.0, 1.0, 2) for name, limit in anywhere.items()}
    scenario["platform"] |= {name: x.tolist() for name, x in drawn.items()}
    scenario["platform"]["angle_zero_arcmin"] = float(drawn["angle_zero_arcmin"][0])
    scenario["platform"]["drift_degph"] = rng.uniform(-30.0, 30.0, 2).tolist()
    pitch_deg, roll_deg = rng.uniform(-5.0, 5.0, 2).tolist()
    scenario["vehicle"] = {"heading_deg": float(rng.uniform(0.0, 360.0)), "pitch_deg": pitch_deg, "roll_deg": roll_deg}
    return scenario


def run_platform(procedure: str, reading: str, seed: int, folder: Path) -> Iterator[tuple[str, tuple[float, float]]]:
    """Heading, drifts and attitude of a platform drawn by the seed, and the heading that it kept."""
    path = folder / "scenario.yaml"
    path.write_text(yaml.safe_dump(gyro_scenario(seed)), encoding="utf-8")
    params: dict[str, object] = {"reading": reading}
    if procedure == heading_hold.NAME:
        params |= {"hours": HOLD_HOURS, "look_s": HOLD_HOURS * 3600.0}
    options = gyro_run.GyroOptions(procedure=procedure, out=folder, scenario=path, seed=seed, params=params)
    for section in gyro_run.run(options, Silent()):
        yield from _graded_platform(f"gyrocompass {reading}", section)


def _graded_platform(title: str, s: GyroSection) -> Iterator[tuple[str, tuple[float, float]]]:
    for g in gyro_grading.grade(s):
        if g.z is not None and g.en is not None:
            yield f"{title} {g.estimate.name}", (g.z, g.en)
    if s.hold:
        error_rad, end = math.radians(gyro_grading.hold_errors_deg(s)[-1]), s.hold.held[-1]
        yield f"{title} held {HOLD_HOURS:g} h", (error_rad / end.sd_rad, error_rad / end.u_rad)


def run_comparison(seed: int, folder: Path) -> Iterator[tuple[str, tuple[float, float]]]:
    """Velocity of each axis of each generation after one motion."""
    c = comparison.compare(folder, CompareParams(), Silent(), seed=seed)
    for g in c.graded:
        for axis, end, u in zip(comparison.AXES, g.end_mps, g.u_mps, strict=True):
            en, by_limit = float(end / u), BY_LIMIT if g.article.k_source == "E1" and axis != LEVEL_AXIS else ""
            yield f"compare {g.figures.track.name} {axis}{by_limit}", (comparison.COVERAGE_K * en, en)


STUDIES: Mapping[str, Callable[[int, Path], Iterator[tuple[str, tuple[float, float]]]]] = {
    "calibrations": run_calibrations,
    "wander": run_wandering,
    "gyrocompass-article": lambda seed, folder: run_platform("gyrocompass", "article", seed, folder),
    "gyrocompass-improved": lambda seed, folder: run_platform(heading_hold.NAME, "improved", seed, folder),
    "compare": run_comparison,
}


def run_study(name: str, seed: int) -> Run:
    """One run. Raises BenchError."""
    with tempfile.TemporaryDirectory(prefix="psabench-") as folder:
        return dict(STUDIES[name](seed, Path(folder)))
