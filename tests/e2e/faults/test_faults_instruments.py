"""Faults of chamber and table, as their readings over SCPI and the codes of a board show them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from psabench import Bench
from psabench.errors import BenchError, TimeOut
from rig import HOST

pytestmark = HOST

KELVIN = 273.15
UNITS = "units: [{temp_noise_scale: 0}]\n"
CHAMBER = "chamber: {start_degc: 20, heating_max_k_per_min: 60, ramp_k_per_min: 60, tau_case_s: 1, tau_element_s: 1}\n"


def bench(folder: Path, text: str) -> Bench:
    path = folder / "s.yaml"
    path.write_text(text)
    return Bench.start(path)


def board_degc(b: Bench) -> float:
    """10 mV/K on the 10 kohm load, 16 bits of the converter's +-5 V (profile article)."""
    b.unit.wait_ready()
    code = b.unit.stream(60).temp_code[-1]
    return float(code) * 5.0 / 2**15 / 0.01 - KELVIN


def test_a_wrong_thermometer_differs_from_the_temperature_codes(tmp_path: Path) -> None:
    with bench(tmp_path, CHAMBER + UNITS) as b:
        with b.fault("chamber.readout", "chamber", readout_k=5):
            assert b.chamber.temp_degc == pytest.approx(25.0)
            assert b.chamber.stable
            assert board_degc(b) == pytest.approx(20.0, abs=0.1)
        assert b.chamber.temp_degc == pytest.approx(20.0)


def test_a_slow_chamber_is_late_and_a_stuck_one_never_there(tmp_path: Path) -> None:
    """40 K at 1 K/s; at half of it, 80 s; and a fault that ends lets the air go on from where it is."""
    with bench(tmp_path, CHAMBER + UNITS) as b:
        with b.fault("chamber.slow", "chamber", rate_part=0.5):
            b.chamber.set(60.0)
            with pytest.raises(TimeOut, match="a stable temperature not reached within 50 s"):
                b.chamber.wait_stable(limit_s=50.0)
            assert b.chamber.temp_degc == pytest.approx(20.0 + b.time_s / 2, abs=0.5)
            b.chamber.wait_stable(limit_s=35.0)
        with b.fault("chamber.slow", "chamber", rate_part=1e-6):
            b.chamber.set(80.0)
            with pytest.raises(TimeOut):
                b.chamber.wait_stable(limit_s=60.0)
            assert b.chamber.temp_degc == pytest.approx(60.0, abs=0.01)
            assert board_degc(b) == pytest.approx(60.0, abs=0.1)
        b.chamber.wait_stable(limit_s=21.0)
        assert b.chamber.temp_degc == pytest.approx(80.0)


def test_a_table_that_ripples_shows_it_in_its_rate_and_in_the_codes(tmp_path: Path) -> None:
    """A level axis x that stands still: gravity along z comes into y by the angle, A / w (1 - cos w t)."""
    units = "units: [{on: table, axes: {x: {sensor: none}, y: {sensor: mems, kx_v_per_g: 1}}}]\n"
    with bench(tmp_path, "table: {axes: [{along: x}]}\n" + units) as b:
        b.unit.wait_ready()
        still = b.unit.stream(500).axis("y")
        with b.fault("table.ripple", "table.1", ripple_dps=10, frequency_hz=5):
            rates_dps = []
            for _ in range(40):
                b.wait(0.005)
                rates_dps.append(b.table.rate_dps())
            volts = b.unit.stream(500).axis("y")
        assert max(rates_dps) == pytest.approx(10.0, rel=0.05)
        assert min(rates_dps) == pytest.approx(-10.0, rel=0.05)
        swing_rad = 2 * np.radians(10.0) / (2 * np.pi * 5)
        assert np.ptp(volts) == pytest.approx(np.sin(swing_rad), rel=0.05)
        assert np.ptp(still) < 1e-4
        b.wait(0.1)
        assert np.ptp(b.unit.stream(500).axis("y")) < 1e-4


@pytest.mark.parametrize(
    ("kind", "point", "values"),
    [
        ("chamber.slow", "chamber", {"rate_part": 0.5}),
        ("chamber.readout", "chamber", {"readout_k": 5.0}),
        ("table.ripple", "table.1", {"ripple_dps": 1.0, "frequency_hz": 1.0}),
    ],
)
def test_what_the_bench_has_not_is_refused(kind: str, point: str, values: dict[str, float], tmp_path: Path) -> None:
    with bench(tmp_path, UNITS) as b, pytest.raises(BenchError, match=point):
        b.fault(kind, point, **values)
