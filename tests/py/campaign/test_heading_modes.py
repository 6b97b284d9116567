"""The campaign heading-modes: its algebra, its intervals, its page and command. The emulated flights: tests/e2e."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from command_line import mistake_line
from psabench import cli
from psabench.campaign import heading_modes as modes
from psabench.campaign import heading_modes_page as page
from psabench.campaign.heading_modes import ROWS, draw_instruments, errors_deg
from psabench.procedures.heading_modes import ModeParams, slaved_rad

FLIGHT = ModeParams()
HOUR = ModeParams(hours=1.0)


def test_a_flight_to_the_north_and_what_the_crew_sets() -> None:
    p = ModeParams(accel_mps2=2.0, speed_kmh=360.0, latitude_deg=50.0, fix_s=1800.0)
    at = p.latitudes_deg(np.array([0.0, 50.0, 3600.0]))
    way_m = np.radians(at - 50.0) * 6_371_000.0
    assert way_m == pytest.approx([0.0, 2500.0, 2500.0 + 355_000.0], abs=1.0)
    assert p.panel_deg(np.array([0.0, 1799.0, 1800.0])).tolist() == [51.0, 51.0, 52.0]  # 50.8, 52.4 on a division of 1
    assert p.setter_deg(np.array([0.0])).tolist() == [8.0]
    exact = replace(p, setter_step_deg=0.0)
    assert exact.setter_deg(np.array([0.0]))[0] == pytest.approx(
        8.0 + 0.3 * (p.latitudes_deg(np.array([900.0]))[0] - 50)
    )


@pytest.mark.parametrize("wrong", [{"hours": 0.0}, {"look_s": -1.0}, {"hours": 9.0}, {"slave_s": 0.0}])
def test_a_flight_that_cannot_be_is_rejected(wrong: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="expected"):
        ModeParams(**wrong)


def test_slaving_is_exponential_and_limited() -> None:
    """60 s of 300 s take off 1 - exp(-0.2) of a small error; 1.5 deg/min of a large one."""
    assert slaved_rad(0.1, 0.01, FLIGHT, 60.0) == pytest.approx(0.1 + 0.01 * (1.0 - math.exp(-0.2)))
    assert slaved_rad(0.0, 1.0, FLIGHT, 60.0) == pytest.approx(math.radians(1.5))
    assert slaved_rad(0.0, -1.0, FLIGHT, 60.0) == pytest.approx(-math.radians(1.5))


def test_run_k_is_the_same_whatever_the_batch() -> None:
    for row in ROWS.values():
        whole = errors_deg(row, HOUR, 5, 6)
        assert np.array_equal(whole[2:], errors_deg(row, HOUR, 5, 4, first_run=2)), row.name
        assert not np.array_equal(whole, errors_deg(row, HOUR, 6, 6)), row.name


def test_a_drift_that_the_workshop_missed_turns_the_half_compass_by_its_time() -> None:
    """1 deg/h more than the passport says: 4 deg in 4 h, and as much less on the other side."""
    quiet = replace(ROWS["half-compass"], gm_sigma_degph=0.0)
    drawn = draw_instruments(1, 0, 1)
    start, end = errors_deg(quiet, FLIGHT, 1, 1)[0][[0, -1]]
    missed_degph = float(drawn.drift2_degph[0]) - 25.0
    exact = replace(FLIGHT, drift2_degph=float(drawn.drift2_degph[0]))
    start_0, end_0 = errors_deg(quiet, exact, 1, 1)[0][[0, -1]]
    scale = 1.0 + modes.TORQUER_SCALE
    assert (end - start) - (end_0 - start_0) == pytest.approx(-4.0 * missed_degph * scale, rel=1e-9)


def test_the_latitude_panel_costs_what_its_division_leaves() -> None:
    """Half a degree of latitude is 0.07 to 0.08 deg/h of the Earth's rate; the panel is set each half hour."""
    row = replace(ROWS["half-compass"], gm_sigma_degph=0.0)
    coarse = replace(FLIGHT, panel_step_deg=10.0, drift2_degph=25.0)
    fine, rough = (errors_deg(row, p, 1, 1)[0] for p in (replace(FLIGHT, panel_step_deg=0.0, fix_s=60.0), coarse))
    t_s = FLIGHT.looks_s
    wz = 15.041067 * np.sin(np.radians(FLIGHT.latitudes_deg(t_s)))
    panel = 15.041067 * np.sin(np.radians(coarse.panel_deg(t_s)))
    want = float((panel[:-1] - 0.5 * (wz[1:] + wz[:-1])).sum() * 60.0 / 3600.0)  # held from look to look
    assert (rough - fine)[-1] - (rough - fine)[0] == pytest.approx(want, abs=0.005)
    assert abs(want) > 0.1


def test_the_magnetic_heading_errs_by_its_sensor_its_setter_and_the_dip() -> None:
    """In straight flight the slaved heading is that of the sensor: chart, deviation, division, tan dip by Coriolis."""
    row = replace(ROWS["magnetic"], gm_sigma_degph=0.0)
    p = replace(FLIGHT, setter_step_deg=0.0, fix_s=60.0)
    drawn = draw_instruments(3, 0, 50)
    e = errors_deg(row, p, 3, 50)[:, -60:].mean(axis=1)
    phi = math.radians(float(p.latitudes_deg(np.array([3.5 * 3600.0]))[0]))  # of the last hour
    dip = math.radians(66.0 + 0.6 * (math.degrees(phi) - 50.0))
    coriolis_deg = math.degrees(math.tan(dip) * 2.0 * 7.292e-5 * math.sin(phi) * p.speed_mps / 9.81)
    m = math.radians(-8.0 - 0.3 * (math.degrees(phi) - 50.0))  # shown
    terms = [1.0, math.sin(m), math.cos(m), math.sin(2 * m), math.cos(2 * m)]
    off = e - drawn.chart_deg - drawn.deviation_deg @ terms
    assert np.std(off) < 0.1  # what is left: the drift by the time constant, 0.5 deg/h x 300 s, and noise
    assert np.mean(off) == pytest.approx(coriolis_deg, abs=0.03)
    assert 0.2 < coriolis_deg < 0.5


def test_the_random_drift_has_its_spread_and_its_memory() -> None:
    """0.2 deg/h, 1000 s: an hour turns by 0.2 deg/h of sqrt(2 tau (T - tau (1 - exp(-T/tau))))."""
    row = ROWS["half-compass"]
    p = replace(HOUR, drift2_degph=25.0)
    e = errors_deg(row, p, 11, 2000) - errors_deg(replace(row, gm_sigma_degph=0.0), p, 11, 2000)
    tau, t = 1000.0, 3600.0
    want = 0.2 / 3600.0 * math.sqrt(2.0 * tau * (t - tau * (1.0 - math.exp(-t / tau))))
    assert np.std(e[:, -1]) == pytest.approx(want, rel=0.05)


def test_the_claim_holds_in_its_reading_and_not_in_the_literal_one() -> None:
    """The table of the page, at another seed."""
    found = {name: page.summary_of(errors_deg(ROWS[name], FLIGHT, 7, 400), 7) for name in ROWS}
    assert found["claim"].within.value > 0.98
    assert 0.1 < found["literal"].within.value < 0.35
    assert found["literal"].end_rms_deg.value == pytest.approx(0.75, abs=0.1)
    assert found["half-compass"].end_rms_deg.value == pytest.approx(2.2, abs=0.3)
    assert found["magnetic"].end_rms_deg.value == pytest.approx(1.0, abs=0.2)
    for s in found.values():
        assert s.end_rms_deg.low < s.end_rms_deg.value < s.end_rms_deg.high
    # What grows and what does not.
    assert found["magnetic"].end_rms_deg.value < 1.3 * found["magnetic"].start_rms_deg.value
    assert found["half-compass"].end_rms_deg.value > 2.0 * found["half-compass"].start_rms_deg.value


@pytest.mark.parametrize(
    ("good", "n", "low", "high"), [(0, 200, 0.0, 0.0188), (200, 200, 0.9812, 1.0), (5, 10, 0.2366, 0.7634)]
)
def test_the_interval_of_a_share_is_wilson_s(good: int, n: int, low: float, high: float) -> None:
    f = page.share_figure(good, n)
    assert (f.low, f.high) == pytest.approx((low, high), abs=1e-3)


def test_intervals_of_an_rms_hold_the_truth_in_most_batches() -> None:
    rng = np.random.default_rng(4)
    inside = 0
    for k in range(60):
        s = page.summary_of(rng.standard_normal((200, 2)), k)
        inside += s.end_rms_deg.low < 1.0 < s.end_rms_deg.high
    assert inside >= 51  # 95 % expected: fewer than 51 of 60 once in a thousand


def test_the_command_writes_a_report(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["campaign", "heading-modes", "--runs", "20", "--hours", "0.5", "--out", str(tmp_path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:6]] == list(ROWS)
    result = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))
    assert result["procedure"] == "heading-modes"
    assert set(result["rows"]) == set(ROWS)
    assert "stay within" in (tmp_path / "report.html").read_text(encoding="utf-8")


def test_each_option_of_the_crew_moves_its_modes_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of `end_rms_deg`; a speed moves all of them."""
    magnetic, prototype = {"magnetic"}, {"magnetic", "half-compass"}
    moved = {
        "--speed-kmh=100": set(ROWS),
        "--fix-s=60": prototype,
        "--panel-step-deg=0": prototype,
        "--setter-step-deg=0": prototype,
        "--align-s=1": prototype,
        "--slave-s=3000": magnetic,
        "--slave-limit-dpm=0.01": magnetic,
    }

    def ends(*options: str) -> dict[str, float]:
        assert cli.main(["campaign", "heading-modes", "--runs", "3", *options, "--out", str(tmp_path)]) == 0
        rows = json.loads((tmp_path / "result.json").read_text(encoding="utf-8"))["rows"]
        return {name: row["end_rms_deg"][0] for name, row in rows.items()}

    plain = ends()
    found = {option: {name for name, value in ends(option).items() if value != plain[name]} for option in moved}
    capsys.readouterr()
    assert found == moved


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--runs", "0"), "--runs: expected 1 to 100000, got 0"),
        (("--hours", "8"), "--hours: expected 0.2 to 5.5, got 8.0"),
        (("--chain", "wire"), "--chain"),
        (("--fix-s", "0"), "fix_s: expected a number above 0, got 0.0"),
        (("--panel-step-deg", "-1"), "panel_step_deg: expected a number from 0 on, got -1.0"),
    ],
)
def test_mistakes_are_one_line(option: tuple[str, ...], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert words in mistake_line(["campaign", "heading-modes", *option], capsys)
