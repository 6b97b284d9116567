"""`psabench run sins-calibration` through CAN and SCPI: short plans, recordings, refusals; the article's plan."""

from __future__ import annotations

import itertools
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from psabench import cli
from psabench.progress import Advance
from psabench.sins import calibration_run as sins_run
from psabench.sins.calibration_params import SinsOptions

pytestmark = pytest.mark.host

SHORT = """axis_azimuth_deg: 0
turns:
  - {axis: z1, rate_degps: 20, for_s: 36}
  - {axis: z1, rate_degps: -20, for_s: 36}
  - {axis: z3, rate_degps: -10, for_s: 9}
  - {axis: z2, rate_degps: 20, for_s: 36}
  - {axis: z2, rate_degps: -20, for_s: 36}
  - {axis: z1, rate_degps: -10, for_s: 9}
  - {axis: z3, rate_degps: 20, for_s: 36}
  - {axis: z3, rate_degps: -20, for_s: 36}
"""
ROOT = Path(__file__).parents[3]
G_MPS2 = 9.8152038  # of the ellipsoid there
Lines = pytest.CaptureFixture[str]


def plan(folder: Path) -> Path:
    path = folder / "short.yaml"
    path.write_text(SHORT)
    return path


def run(out: Path, *words: str | Path) -> int:
    return cli.main(["run", "sins-calibration", "--out", str(out), *map(str, words)])


def found(out: Path) -> dict[str, object]:
    got: dict[str, object] = json.loads((out / "result.json").read_text())["sections"][0]
    return got


def test_a_short_plan_finds_the_unit_and_its_recording_gives_the_same_digits(tmp_path: Path, capsys: Lines) -> None:
    """With the table's angles; then without, from the files of the same run; then the passport of the unit."""
    assert run(tmp_path / "a", "--plan", plan(tmp_path), "--seed", "4") == 0
    said = capsys.readouterr()
    assert "25 parameters; 21 beside the truth: chi-square " in said.out
    assert re.search(r"plan short: 8/8 in [\d.]+ s; 235 s, sd ν 0.0\d+ °/h, Θ ", said.err)  # live, of the first pass
    first = found(tmp_path / "a")
    names = {e["name"]: e for e in first["estimates"]}  # type: ignore[attr-defined]
    assert names["tau"]["value"] == pytest.approx(-50.0, abs=4 * names["tau"]["sd"])  # of the scenario's readout
    assert abs(names["theta_11"]["error"]) < 4 * names["theta_11"]["sd"] < 20.0
    data = (
        "--data",
        tmp_path / "a/increments.bin",
        "--layout",
        tmp_path / "a/increments.yaml",
        "--plan",
        plan(tmp_path),
    )
    assert run(tmp_path / "b", *data, "--angles", tmp_path / "a/table_angles.csv") == 0
    again = found(tmp_path / "b")
    values = [[e["value"] for e in x["estimates"]] for x in (first, again)]  # type: ignore[attr-defined]
    assert values[0] == pytest.approx(values[1], rel=1e-6)  # angles are stored to 1e-9 deg
    assert run(tmp_path / "c", *data, "--stand", "no") == 0
    alone = {e["name"]: e for e in found(tmp_path / "c")["estimates"]}  # type: ignore[attr-defined]
    assert "tau" not in alone
    assert alone["nu_1"]["sd"] > names["nu_1"]["sd"]
    assert "no truth to compare with" in capsys.readouterr().out
    more = ("--angles", tmp_path / "a/table_angles.csv", "--quad-sd-ugpg2", "100", "--delay-sd-ms", "5")
    assert run(tmp_path / "d", *data, *more) == 0
    added = {e["name"]: e for e in found(tmp_path / "d")["estimates"] if e["name"] not in names}  # type: ignore[attr-defined]
    assert list(added) == ["quad_1", "quad_2", "quad_3", "delay"]
    assert all(abs(e["value"]) < 4 * e["sd"] < 100.0 for e in added.values())  # the emulated unit has neither
    correction: Any = found(tmp_path / "d")["correction"]
    assert correction["delay_s"] == pytest.approx(1e-3 * added["delay"]["value"])
    assert all(correction["quadratic_s2pm"])
    capsys.readouterr()
    store = ("--store", str(tmp_path / "p.sqlite"))
    assert cli.main(["passport", "add", str(tmp_path / "a"), "--serial", "S4", "--type", "sins", *store]) == 0
    assert capsys.readouterr().out == "S4: run 1, sins-calibration short, 25 quantities\n"


def test_a_correction_levels_the_unit(tmp_path: Path) -> None:
    """Another motion of the same unit: corrected, the force is the local gravity in any attitude."""
    assert run(tmp_path / "a", "--plan", plan(tmp_path), "--seed", "4") == 0
    other = tmp_path / "other.yaml"
    other.write_text("turns:\n  - {axis: z1, rate_degps: 5, for_s: 72}\n  - {axis: z3, rate_degps: 10, for_s: 6}\n")
    run(tmp_path / "b", "--plan", other, "--seed", "4")
    apply = ["nav", "apply", str(tmp_path / "b/increments.bin"), "--layout", str(tmp_path / "b/increments.yaml")]
    out = tmp_path / "corrected.csv"
    assert cli.main([*apply, "--calibration", str(tmp_path / "a/result.json"), "--out", str(out)]) == 0
    rows = np.loadtxt(out, delimiter=",", skiprows=1)
    raw = np.fromfile(tmp_path / "b/increments.bin").reshape(-1, 7)
    off = [
        np.linalg.norm(x[:8000].reshape(-1, 20, 3).mean(axis=1), axis=1) / 0.01 - G_MPS2
        for x in (raw[:, 4:], rows[:, 4:])
    ]
    rms = [np.sqrt(np.mean(x**2)) for x in off]
    assert rms[0] > 7e-3
    assert rms[1] < 3e-3  # the noise of 0.2 s is 2.2e-3


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--plan", "none.yaml"), "--plan: expected article"),
        (("--gauge", "upper"), "gauge: expected article, lower, free9, got upper"),
        (("--scenario", "stream"), "expected a scenario with an inertial unit"),
        (("--data", "no.csv"), "no.csv: expected increments of a unit, got no such file"),
        (("--latitude-deg", "89"), "latitude_deg: expected -85 to 85 deg"),
        (("--wobble-arcsec", "-1"), "wobble_arcsec: expected 0 to 3600 arcsec"),
        (("--quad-sd-ugpg2", "-1"), "quad_sd_ugpg2: expected 0 to 10000 ug/g2"),
        (("--delay-sd-ms", "51"), "delay_sd_ms: expected 0 to 50 ms"),
        (("--accel-noise-mps2", "0"), "sins-calibration: "),
        (("--angles", "a.csv"), "--angles: expected --data, got none"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(
    tmp_path: Path, capsys: Lines, words: tuple[str, str], said: str
) -> None:
    assert run(tmp_path, *words) == 2
    error = capsys.readouterr().err.strip().splitlines()
    assert error[-1].startswith("psabench: ")
    assert said in error[-1]


def test_a_unit_that_stands_still_is_no_calibration(tmp_path: Path, capsys: Lines) -> None:
    still = tmp_path / "still.yaml"
    still.write_text("turns:\n  - {axis: z1, rate_degps: 0, for_s: 70}\n")
    assert run(tmp_path / "a", "--plan", still) == 2
    assert "the unit does not turn" in capsys.readouterr().err
    assert (tmp_path / "a/increments.bin").stat().st_size > 7000 * 56  # what was measured is kept


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        ("{kind: gyro.stuck, point: sins.gyro.y, at_s: 100, for_s: 20}", r"gyro y sticks for (20\.0|19\.9)\d s from "),
        (
            "{kind: gyro.saturation, point: sins.gyro.x, limit_dps: 15}",  # x turns at 20 deg/s
            r"gyro x is at its limit for \d{4} intervals, the first at .* saturated",
        ),
    ],
)
def test_a_gyro_that_sticks_or_saturates_is_named(tmp_path: Path, capsys: Lines, fault: str, said: str) -> None:
    """No flag of the frames says it, the data do; of the same plan without it nothing is said (the first test)."""
    scenario = tmp_path / "faulty.yaml"
    scenario.write_text((ROOT / "proto/scenarios/sins_table.yaml").read_text() + f"faults:\n  - {fault}\n")
    assert run(tmp_path / "a", "--plan", plan(tmp_path), "--scenario", scenario, "--seed", "4") == 2
    error = capsys.readouterr().err
    assert re.search(f"expected a recording without findings, got .*{said}", error), error
    assert (tmp_path / "a/increments.bin").stat().st_size > 20_000 * 56  # what was measured is kept


@pytest.mark.parametrize(
    "fault",
    [
        "{kind: gyro.bias, point: sins.gyro.x, drift_degph: 20, at_s: 120}",
        "{kind: gyro.scale, point: sins.gyro.y, scale_ppm: 500, at_s: 140}",
        "{kind: gyro.lock_in, point: sins.gyro.x, lock_in_degph: 100}",
    ],
)
def test_a_gyro_whose_errors_change_is_a_doubt(tmp_path: Path, capsys: Lines, fault: str) -> None:
    scenario = tmp_path / "faulty.yaml"
    scenario.write_text((ROOT / "proto/scenarios/sins_table.yaml").read_text() + f"faults:\n  - {fault}\n")
    assert run(tmp_path / "a", "--plan", plan(tmp_path), "--scenario", scenario, "--seed", "4") == 1
    assert "DOUBT: mean of innovation²/variance of the accelerometers: expected 1" in capsys.readouterr().out


def test_a_coarse_table_and_its_plan_s_azimuth(tmp_path: Path) -> None:
    """The scenario whose table shows no angles; where a plan says that its axis points is believed, here wrongly."""
    assert run(tmp_path / "a", "--plan", plan(tmp_path), "--stand", "no", "--seed", "57") == 0
    assert len(found(tmp_path / "a")["estimates"]) == 21  # type: ignore[arg-type]
    east = tmp_path / "east.yaml"
    east.write_text(SHORT.replace("azimuth_deg: 0", "azimuth_deg: 60"))
    assert run(tmp_path / "b", "--plan", east, "--stand", "no", "--seed", "57") == 1


def test_a_unit_that_latches_its_gyros_late_is_found_as_well(tmp_path: Path) -> None:
    scenario = tmp_path / "late.yaml"
    text = (ROOT / "proto/scenarios/sins_table.yaml").read_text()
    scenario.write_text(text.replace("    board: bins\n", "    board: bins\n    profile_set: {aligned: false}\n"))
    assert run(tmp_path / "a", "--plan", plan(tmp_path), "--scenario", scenario, "--seed", "4") == 0


class Interrupted:
    """A progress whose second step is Ctrl-C."""

    @contextmanager
    def step(self, name: str, total: int) -> Iterator[Advance]:
        del name, total
        steps = itertools.count()

        def advance(note: str = "") -> None:
            del note
            if next(steps) == 1:
                raise KeyboardInterrupt

        yield advance


def test_an_interrupted_run_keeps_what_it_measured(tmp_path: Path) -> None:
    options = SinsOptions(out=tmp_path / "a", params={"plan": str(plan(tmp_path))})
    with pytest.raises(KeyboardInterrupt):
        sins_run.run_calibration(options, Interrupted())
    assert (tmp_path / "a/increments.bin").stat().st_size > 7000 * 56  # two turns of 36 s
    assert run(tmp_path / "b", "--data", tmp_path / "a/increments.bin", "--layout", tmp_path / "a/increments.yaml") == 1


def test_angles_that_jump_are_a_doubt(tmp_path: Path, capsys: Lines) -> None:
    assert run(tmp_path / "a", "--plan", plan(tmp_path), "--seed", "4") == 0
    angles = tmp_path / "a/table_angles.csv"
    rows = np.loadtxt(angles, delimiter=",", skiprows=1)
    rows[1000:1200, 1] += 1.0
    np.savetxt(angles, rows, delimiter=",", header=angles.read_text().splitlines()[0], comments="")
    data = (
        "--data",
        tmp_path / "a/increments.bin",
        "--layout",
        tmp_path / "a/increments.yaml",
        "--plan",
        plan(tmp_path),
    )
    assert run(tmp_path / "b", *data, "--angles", angles) == 1
    assert "DOUBT: the same of the table's angles: expected 1" in capsys.readouterr().out


def test_the_article_s_plan_is_consistent_over_units(tmp_path: Path) -> None:
    """Four drawn units, 45 minutes each: errors of 21 parameters in standard deviations."""
    sizes = []
    for seed in ("31", "32", "33", "34"):
        assert run(tmp_path / seed, "--seed", seed) == 0
        sizes += [e["error"] / e["sd"] for e in found(tmp_path / seed)["estimates"] if "error" in e]  # type: ignore[attr-defined]
        (tmp_path / seed / "increments.bin").unlink()
    assert 0.75 < np.sqrt(np.mean(np.square(sizes))) < 1.25  # of 84, correlated: 1 +- 0.08
