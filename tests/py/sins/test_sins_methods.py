"""Methods of calibration beside the filter: without noise each finds what it says.

Faults of the table go where they should.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import mistake_line
from psabench import cli
from psabench.campaign import sins_methods, sins_table
from psabench.campaign.sins_methods import METHODS, Row
from psabench.campaign.sins_table import BASES, Base, Recording, draw_unit, record_run
from psabench.campaign.sins_unit import UnitErrors
from psabench.errors import BadInput
from psabench.native.nav import ARCMIN, DEGPH
from psabench.native.sins import Params
from psabench.quartz.draws import draw_source
from psabench.sins.methods.legs import legs_of
from psabench.sins.plan import RotationPlan, read_plan

BY_NAME = {m.name: m for m in METHODS}
SEED = 1


@pytest.fixture
def quiet(monkeypatch: pytest.MonkeyPatch) -> None:
    """Data without noise, the methods as they are."""
    silent = replace(sins_table.FILTER, gyro_noise_radps_rts=1e-15, accel_noise_mps2_rts=1e-13)
    monkeypatch.setattr(sins_table, "FILTER", silent)
    monkeypatch.setattr(sins_table, "ANGLE_SD_RAD", 0.0)


def recorded(plan: str, unit: int = 0, base: Base = BASES[0]) -> tuple[UnitErrors, Recording]:
    drawn = draw_unit(SEED, unit)
    return drawn, record_run(read_plan(plan), drawn, base, draw_source(SEED, f"{plan} {base.name} {unit}"))


def worst(found: Params, truth: UnitErrors) -> dict[str, float]:
    """Greatest error of each block: deg/h, parts, m/s^2, parts."""
    return {
        "nu": float(np.abs(found.nu_radps - truth.nu_radps).max()) / DEGPH,
        "theta": float(np.abs(found.theta - truth.theta).max()),
        "df": float(np.abs(found.df_mps2 - truth.df_mps2).max()),
        "gamma": float(np.abs(found.gamma - truth.gamma).max()),
    }


@pytest.mark.usefixtures("quiet")
@pytest.mark.parametrize("name", ["six positions and turns", "Fourier"])
@pytest.mark.parametrize("unit", range(3))
def test_without_noise_all_21_errors_are_found(name: str, unit: int) -> None:
    truth, r = recorded(BY_NAME[name].plan, unit)
    left = worst(BY_NAME[name].find(r), truth)
    assert left["nu"] < 1e-6
    assert max(left["theta"], left["df"], left["gamma"]) < 1e-9


@pytest.mark.usefixtures("quiet")
def test_a_tilt_of_the_base_goes_into_positions_and_into_no_series() -> None:
    base = Base(name="tilted", tilt_rad=ARCMIN)
    truth, r = recorded("six_positions", base=base)
    left = worst(BY_NAME["six positions and turns"].find(r), truth)
    assert left["df"] > 3e-4
    assert left["gamma"] > 5e-5
    truth, r = recorded("article", base=base)
    left = worst(BY_NAME["Fourier"].find(r), truth)
    assert max(left["theta"], left["df"], left["gamma"]) < 3e-7  # g cos(tilt), and the Earth's rate along the axis


@pytest.mark.usefixtures("quiet")
def test_the_azimuth_of_a_series_goes_into_the_drift_alone() -> None:
    truth, r = recorded("article")
    off = replace(r, plan=r.plan.with_azimuth(10.0))
    left = worst(BY_NAME["Fourier"].find(off), truth)
    cosine = 15.041 * np.cos(np.radians(55.7)) * (1.0 - np.cos(np.radians(10.0)))
    assert left["nu"] == pytest.approx(cosine, rel=0.1)  # the unit is a degree or two off the axes
    assert max(left["df"], left["gamma"]) < 1e-9


def test_a_batch_errs_as_the_page_says() -> None:
    """Eight units, seed 1; rms over 24 to 72 elements: within 40 % of the figures of twenty."""
    print(f"seed {SEED}")
    rms = {}
    for name in ("six positions and turns", "Fourier"):
        off = []
        for unit in range(8):
            truth, r = recorded(BY_NAME[name].plan, unit)
            off.append(sins_methods.error_columns(BY_NAME[name].find(r), truth))
        rms[name] = np.sqrt(np.mean(np.square(off), axis=0))
    page = {
        "six positions and turns": (0.0040, 1.7e-6, 0.085, 1.3e-4, 2.5e-5, 0.12),
        "Fourier": (0.012, 1.2e-6, 0.10, 1.0e-4, 1.2e-5, 0.11),
    }
    for name, figures in page.items():
        assert rms[name] == pytest.approx(figures, rel=0.4), name


def test_a_plan_that_a_method_cannot_use_is_refused() -> None:
    _, r = recorded("article")
    with pytest.raises(BadInput, match="expected six dwells and whole turns about each axis, got 0 dwells"):
        BY_NAME["six positions and turns"].find(r)
    short = RotationPlan(name="x", axis_azimuth_deg=0.0, turns=r.plan.turns[:2])
    with pytest.raises(BadInput, match="expected two turns or more there and back about each axis, got 1 cycles"):
        BY_NAME["Fourier"].find(replace(r, plan=short))
    with pytest.raises(BadInput, match=r"expected a leg of whole samples, got 9 s of 0.7 s"):
        legs_of(RotationPlan(name="x", axis_azimuth_deg=0.0, turns=r.plan.turns[2:3]), 0.7)


def test_the_command_prints_all_tables_and_stores_them(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    results = []
    for k in (1, 2):
        out = tmp_path / f"run{k}"
        assert cli.main(["campaign", "sins-methods", "--units", "1", "--out", str(out)]) == 0
        result = json.loads((out / "result.json").read_text(encoding="utf-8"))
        results.append(result["rows"])
    assert results[0] == results[1]
    assert len(results[0]) == len(METHODS) * len(BASES)
    text = capsys.readouterr().out
    assert all(text.count(m.name) >= 4 for m in METHODS)
    assert "(" in next(line for line in text.splitlines() if line.startswith("six positions alone"))


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (["--units", "0"], "--units: expected 1 to 100000, got 0"),
        (["--seed", "9007199254740993"], "--seed: expected 0 to 9007199254740992"),
    ],
)
def test_a_mistake_is_named(option: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert words in mistake_line(["campaign", "sins-methods", *option], capsys)


def test_what_a_method_does_not_find_is_marked() -> None:
    row = Row(method=METHODS[0], base=BASES[0], rms={"theta_ii": 6e-4, "nu_degph": 0.1}, minutes=45.0, compute_s=0.1)
    assert (row.found("theta_ii"), row.found("nu_degph")) == (False, True)
