"""Faults of chamber, head and table, and of their links, as readings over SCPI and the codes of a board show them."""

from __future__ import annotations

import socket
from pathlib import Path

import numpy as np
import pytest
from psabench import Bench, instruments
from psabench.errors import BenchError, LinkError, TimeOut
from psabench.thermal.bench import WireThermal
from rig import HOST, TIMEOUT_S

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


def test_a_chamber_overshoots_and_comes_back(tmp_path: Path) -> None:
    """40 K at 1 K/s, then 5 K past it and back: stable after 50 s in place of 40."""
    with bench(tmp_path, CHAMBER.replace("}", ", cooling_max_k_per_min: 60}") + UNITS) as b:
        with b.fault("chamber.overshoot", "chamber", overshoot_k=5):
            b.chamber.set(60.0)
            with pytest.raises(TimeOut, match="a stable temperature not reached within 45 s"):
                b.chamber.wait_stable(limit_s=45.0)
            assert b.chamber.temp_degc == pytest.approx(65.0, abs=0.5)
            b.chamber.wait_stable(limit_s=7.0)
        assert b.chamber.temp_degc == pytest.approx(60.0)


def level_v(b: Bench) -> float:
    """Mean of X, V, when the filter has forgotten the turn."""
    b.run_for(0.1)
    return float(b.unit.stream(200).axis("x").mean())


LEVEL = "units: [{axes: {x: {sensor: mems, kx_v_per_g: 1}}}]\n"


def test_a_head_that_sticks_says_so(tmp_path: Path) -> None:
    with bench(tmp_path, LEVEL) as b:
        b.unit.wait_ready()
        assert b.head.turn(30.0) == pytest.approx(30.0)
        with b.fault("head.stick", "head"):
            with pytest.raises(TimeOut, match=r"^head: 90 deg not reached: at rest its scale shows 30 deg$"):
                b.head.turn(90.0)
            assert level_v(b) == pytest.approx(-0.5, abs=1e-3)
        assert b.head.turn(90.0) == pytest.approx(90.0)


def test_a_head_that_slips_is_seen_in_the_codes_alone(tmp_path: Path) -> None:
    with bench(tmp_path, LEVEL) as b:
        b.unit.wait_ready()
        with b.fault("head.slip", "head", slip_deg=2):
            assert b.head.turn(30.0) == pytest.approx(30.0)
            assert level_v(b) == pytest.approx(-np.sin(np.radians(28.0)), abs=1e-3)
        assert b.head.turn(30.0) == pytest.approx(30.0)
        assert level_v(b) == pytest.approx(-0.5, abs=1e-3)


def test_a_silent_link_is_a_time_out_that_names_the_instrument(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """And what was said meanwhile was not heard."""
    monkeypatch.setattr(instruments, "REPLY_S", 0.3)
    with bench(tmp_path, CHAMBER + UNITS) as b:
        with b.fault("scpi.silent", "scpi.chamber"):
            with pytest.raises(TimeOut, match=r"^chamber at TCPIP::.*: TEMP 60.0: no answer within 0.3 s$"):
                b.chamber.set(60.0)
            assert b.head.at_rest, "its link is another"
        assert b.chamber.setpoint_degc == 20.0


def test_a_late_answer_is_not_that_to_the_next_question(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """TEMP? and the look at the error queue time out; both answers come a second later."""
    monkeypatch.setattr(instruments, "REPLY_S", 0.3)
    with bench(tmp_path, CHAMBER + UNITS) as b:
        with (
            b.fault("scpi.late", "scpi.chamber", late_s=1),
            pytest.raises(TimeOut, match=r"TEMP\?: no answer within 0.3 s$"),
        ):
            _ = b.chamber.temp_degc
        b.run_for(2.0)
        assert b.chamber.query("*IDN?").startswith("psabench,")
        assert b.chamber.temp_degc == 20.0


def test_what_was_late_is_lost_when_the_link_falls_silent(tmp_path: Path) -> None:
    with bench(tmp_path, CHAMBER + UNITS) as b:
        _, host, port = b.head.address.split("::")[:3]
        with (
            b.fault("scpi.late", "scpi.head", late_s=2),
            socket.create_connection((host, int(port)), TIMEOUT_S) as client,
        ):
            client.sendall(b"ANGL?\n")
            b.run_for(0.5)  # inputs are read before time moves
            with b.fault("scpi.silent", "scpi.head"):
                b.run_for(3.0)
            b.run_for(1.0)
            client.setblocking(False)
            with pytest.raises(BlockingIOError):
                client.recv(100)


def test_a_garbled_answer_is_shown_as_it_came(tmp_path: Path) -> None:
    with (
        bench(tmp_path, CHAMBER + UNITS) as b,
        b.fault("scpi.garbled", "scpi.chamber"),
        pytest.raises(LinkError, match=r"chamber at .*: TEMP\?: expected ASCII text, got b'.*\\x"),
    ):
        _ = b.chamber.temp_degc


def test_a_snapshot_and_a_fork_keep_them(tmp_path: Path) -> None:
    faults: list[tuple[str, str, dict[str, object]]] = [
        ("head.stick", "head", {}),
        ("head.slip", "head", {"slip_deg": 2}),
        ("chamber.overshoot", "chamber", {"overshoot_k": 5}),
        ("scpi.garbled", "scpi.chamber", {"probability": 0.5}),
        ("scpi.late", "scpi.supply", {"late_s": 1}),
    ]
    path = tmp_path / "faulty.snapshot"
    with bench(tmp_path, CHAMBER + "supply: {}\n" + UNITS) as b:
        for kind, point, values in faults:
            b.fault(kind, point, **values)
        listed = b.control.call("fault.list").result
        b.snapshot(path)
        with b.fork() as fork:
            assert fork.control.call("fault.list").result == listed
    with Bench.restore(path) as again:
        assert again.control.call("fault.list").result == listed
        with pytest.raises(TimeOut, match="head: 90 deg not reached"):
            again.head.turn(90.0)


@pytest.mark.parametrize(("sensor", "channel"), [("x", "x"), ("y", "y"), ("z", "z"), ("board", "case")])
def test_a_thermal_run_names_the_temperature_sensor_that_is_open(sensor: str, channel: str, tmp_path: Path) -> None:
    with bench(tmp_path, CHAMBER + UNITS) as b:
        wire = WireThermal(b.unit, b.head, b.chamber, 1000)
        wire.prepare()
        healthy = wire.record(0.5)
        with b.fault("sensor.open", f"a.temp.{sensor}"):
            b.run_for(0.1)
            words = f"sensor of channel {channel}: expected -90 to 130 degC, got 0 K: it is open"
            with pytest.raises(LinkError, match=words):
                wire.record(0.5)
        b.run_for(0.1)
        assert wire.record(0.5).temps_degc == pytest.approx(healthy.temps_degc, abs=0.02)


def test_a_sensor_that_the_profile_does_not_scan_cannot_open(tmp_path: Path) -> None:
    (tmp_path / "two.yaml").write_text("board: psa2\nname: two\ntemp_channels: 2\n", encoding="utf-8")
    with bench(tmp_path, f"units: [{{profile: {tmp_path / 'two.yaml'}}}]\n") as b:
        b.fault("sensor.open", "a.temp.y").clear()
        with pytest.raises(BenchError, match=r"a\.temp\.z: expected one of the 2 channels that the board scans"):
            b.fault("sensor.open", "a.temp.z")


@pytest.mark.parametrize(
    ("kind", "point", "values"),
    [
        ("chamber.overshoot", "chamber", {"overshoot_k": 5.0}),
        ("scpi.silent", "scpi.chamber", {}),
        ("scpi.garbled", "scpi.table", {}),
        ("head.stick", "table.1", {}),
        ("chamber.slow", "chamber", {"rate_part": 0.5}),
        ("chamber.readout", "chamber", {"readout_k": 5.0}),
        ("table.ripple", "table.1", {"ripple_dps": 1.0, "frequency_hz": 1.0}),
    ],
)
def test_what_the_bench_has_not_is_refused(kind: str, point: str, values: dict[str, float], tmp_path: Path) -> None:
    with bench(tmp_path, UNITS) as b, pytest.raises(BenchError, match=point):
        b.fault(kind, point, **values)
