"""The receiver through its serial port: parsers that we did not write, the bit rate, faults, snapshots, beside CAN."""

from __future__ import annotations

import datetime
import io
from pathlib import Path
from typing import Any

import numpy as np
import pynmea2
import pytest
from psabench.bench import Bench
from psabench.boards.receiver.device import MESSAGES, Receiver, solutions_of
from psabench.link.control import Control
from psabench.link.protocol_files import message
from pynmeagps import NMEAReader
from pyubx2 import ERR_RAISE, NMEA_PROTOCOL, UBX_PROTOCOL, UBXReader
from rig import psa_emu
from serial_port import QUIET, SerialPort, receiver_scenario, serial_port

pytestmark = pytest.mark.host

LAT_DEG, LON_DEG, HEIGHT_M = 55.75, 37.61, 150.0
M_PER_DEG = np.array([111_343.0, 62_806.0])  # latitude, longitude there: WGS 84, M pi/180 and N cos(lat) pi/180
NMEA_ONLY = "messages: [GGA, GSA, RMC, VTG, ZDA]"
KINDS = ("GGA", "GSA", "RMC", "VTG", "ZDA")
MINUTE_DEG = 1e-5 / 60  # the last digit of a latitude in NMEA


def messages(data: bytes) -> list[Any]:
    """All messages, as pyubx2 parses them, which hands sentences to pynmeagps. Raises for any that is damaged."""
    reader = UBXReader(io.BytesIO(data), protfilter=NMEA_PROTOCOL | UBX_PROTOCOL, quitonerror=ERR_RAISE)
    return [parsed for _, parsed in reader]


def whole(data: bytes) -> bytes:
    """Without the burst that is under way at the end."""
    return data[: data.rindex(b"$GPGGA")]


def lines(data: bytes) -> list[str]:
    return data.decode("ascii").splitlines()


def sentences(data: bytes, kind: str) -> list[Any]:
    """Of NMEA alone, as pynmea2 parses them, checksums checked."""
    found = [pynmea2.parse(line, check=True) for line in lines(data)]
    return [s for s in found if s.sentence_type == kind]


def positions_deg(data: bytes) -> np.ndarray:
    """(n, 2) latitude and longitude of the GGA with a fix."""
    return np.array([(s.latitude, s.longitude) for s in sentences(data, "GGA") if s.gps_qual])


def north_m(data: bytes) -> np.ndarray:
    return np.asarray((positions_deg(data)[:, 0] - LAT_DEG) * M_PER_DEG[0])


# ---- parsers


def test_three_parsers_read_every_message_to_the_same_values(tmp_path: Path) -> None:
    """pyubx2 walks through sentences and packets mixed; pynmea2 and pynmeagps get each sentence by itself."""
    with serial_port(receiver_scenario(tmp_path)) as (port, _):
        data = port.run(10.08)
    all_of = messages(data)
    assert [m.identity for m in all_of] == [*(f"GP{kind}" for kind in KINDS), "NAV-PVT"] * 100
    for k in range(0, len(all_of), 6):
        gga, gsa, rmc, vtg, zda, pvt = all_of[k : k + 6]
        texts = [m.serialize().decode() for m in (gga, gsa, rmc, vtg, zda)]
        assert all(text.encode() in data for text in texts)
        two = [pynmea2.parse(text, check=True) for text in texts]
        at = datetime.timedelta(seconds=(k // 6 + 1) * 0.1)
        due = datetime.datetime(2026, 1, 5) + at
        assert gga.time == rmc.time == zda.time == due.time()
        assert rmc.date == due.date()
        assert two[2].datetime.replace(tzinfo=None) == due
        assert pvt.iTOW == 86_418_000 + round(at.total_seconds() * 1000)
        for lat, lon in ((gga.lat, gga.lon), (two[0].latitude, two[0].longitude), (rmc.lat, rmc.lon)):
            assert abs(lat - pvt.lat) < MINUTE_DEG
            assert abs(lon - pvt.lon) < MINUTE_DEG
        assert abs(gga.alt * 1000 - pvt.hMSL) <= 50
        assert gga.quality == 1
        assert gsa.navMode == 3
        assert rmc.status == "A"
        assert pvt.fixType == 3
        assert pvt.gnssFixOk
        assert gga.numSV == pvt.numSV == 8
        assert abs(float(vtg.sogk) - pvt.gSpeed * 3.6e-3) < 2e-3
        assert abs(rmc.spd - pvt.gSpeed / 514.444) < 1e-3


def test_pynmeagps_alone_reads_a_port_without_packets(tmp_path: Path) -> None:
    with serial_port(receiver_scenario(tmp_path, NMEA_ONLY)) as (port, _):
        data = port.run(2.05)
    parsed = [m for _, m in NMEAReader(io.BytesIO(data), quitonerror=ERR_RAISE)]
    assert [m.msgID for m in parsed] == list(KINDS) * 20
    assert max(len(line) + 2 for line in lines(data)) <= 82


def test_errors_are_of_the_size_of_the_profile(tmp_path: Path) -> None:
    """White noise of 2 m: the spread of 300 positions is known to 4 %, over 0.6 m less the last digit's 2 cm."""
    fields = f"{NMEA_ONLY}, white_m: 2, slow_m: 0, white_mps: 0.5, slow_mps: 0"
    with serial_port(receiver_scenario(tmp_path, fields)) as (port, _):
        off_m = (positions_deg(port.run(30.05)) - [LAT_DEG, LON_DEG]) * M_PER_DEG
    assert np.abs(off_m.std(axis=0) - 2.0).max() < 0.4
    assert np.abs(off_m.mean(axis=0)).max() < 0.6


# ---- beside CAN


def columns(readings: list[dict[str, int]]) -> dict[str, np.ndarray]:
    return {name: np.array([r[name] for r in readings], np.int64) for name in readings[0]}


def can_solutions(path: Path, node: int = 12) -> list[dict[str, int]]:
    """Raw signals of each reading, from a log of candump's format."""
    layouts = {0x80 * 2 * k + 0x80 + node: message(name) for k, name in enumerate(MESSAGES, 1)}
    found: list[dict[str, int]] = []
    for line in path.read_text().splitlines():
        can_id, _, payload = line.split()[2].partition("#")
        if layout := layouts.get(int(can_id, 16)):
            raw = layout.decode(bytes.fromhex(payload), decode_choices=False, scaling=False)
            found = [*found, raw] if layout.name == MESSAGES[0] else [*found[:-1], found[-1] | raw]
    return found


def test_can_and_the_serial_port_say_the_same(tmp_path: Path) -> None:
    """Of each solution, to the last bit of UBX."""
    log = tmp_path / "can.log"
    with serial_port(receiver_scenario(tmp_path, "messages: [PVT]"), can=f"log:{log}") as (port, _):
        packets = messages(port.run(3.05))
    readings = can_solutions(log)
    assert len(packets) == len(readings) == 30
    for p, r in zip(packets, readings, strict=True):
        assert (round(p.lat * 1e7), round(p.lon * 1e7), p.height) == (r["LAT"], r["LON"], r["H"])
        assert (p.velE, p.velN, -p.velD) == (r["VE"], r["VN"], r["VU"])
        assert (p.iTOW, p.fixType) == (r["TOW"], r["FIX"])


def test_the_device_class_has_solutions_in_si(tmp_path: Path) -> None:
    with Bench.start(receiver_scenario(tmp_path, QUIET)) as bench:
        receiver = bench.board(Receiver)
        receiver.wait_ready()
        got = solutions_of(receiver.stream(20))
    assert got.valid.all()
    assert (np.diff(got.seq) == 1).all()
    assert np.abs(got.lat_rad - np.radians(LAT_DEG)).max() < 1e-9
    assert np.abs(got.lon_rad - np.radians(LON_DEG)).max() < 1e-9
    assert np.abs(got.height_m - HEIGHT_M).max() < 1e-3
    assert np.abs(got.v_enu_mps).max() < 1e-3
    gps_epoch = datetime.datetime(1980, 1, 6)
    since_s = (datetime.datetime(2026, 1, 5) - gps_epoch).total_seconds() + 18
    late_s = got.t_rx_s - (got.gps_s - since_s)
    assert (late_s > 0.020).all()
    assert (late_s < 0.022).all()


# ---- in an aircraft

FLIGHT = """start: true
site: {latitude_deg: 55.7, longitude_deg: 37.5, height_m: 150}
flight:
  heading_deg: 50
  legs: [{park_s: 5}, {taxi_m: 60, speed_mps: 6}, {turn_deg: 90, radius_m: 20}, {takeoff_mps: 85}, {climb_m: 100},
         {turn_deg: 30}, {land_mps: 70}, {stop_s: 5}]
units:
"""
DT1_STEPS, DT2_STEPS = 3, 2  # latencies, in periods of 100 ms


def test_in_flight_it_follows_the_aircraft_with_its_latencies(tmp_path: Path) -> None:
    """Two receivers without noise: one reports what is, the other what was."""
    delays = ("position_delay_s: 0, velocity_delay_s: 0", "position_delay_s: 0.3, velocity_delay_s: 0.2")
    path, log = tmp_path / "flight.yaml", tmp_path / "can.log"
    units = [f"  - {{board: receiver, on: flight, profile_set: {{{QUIET}, {d}}}}}\n" for d in delays]
    path.write_text(FLIGHT + "".join(units))
    done = psa_emu(path, "--can", f"log:{log}", "--pace", "free", "--for", "100s", "--quiet")
    assert done.returncode == 0, done.stderr
    now, late = (columns(can_solutions(log, node)) for node in (12, 13))
    assert (late["LAT"][DT1_STEPS:] == now["LAT"][:-DT1_STEPS]).all()
    assert (late["LON"][DT1_STEPS:] == now["LON"][:-DT1_STEPS]).all()
    assert (late["VN"][DT1_STEPS + DT2_STEPS :] == now["VN"][: -DT1_STEPS - DT2_STEPS]).all()
    north_mps = np.diff(now["LAT"]) * 1e-7 * M_PER_DEG[0] * 10
    assert np.abs(north_mps - (now["VN"][1:] + now["VN"][:-1]) * 5e-4).max() < 0.15  # 1e-7 deg is 1 cm, in 0.1 s
    up_mps = np.diff(now["H"]) * 1e-2
    assert np.abs(up_mps - (now["VU"][1:] + now["VU"][:-1]) * 5e-4).max() < 0.05
    assert np.hypot(now["VE"], now["VN"]).max() > 80_000
    assert now["H"].max() > 240_000


# ---- bit rate


@pytest.mark.parametrize("baud", [4800, 9600, 38400, 115200])
def test_bytes_come_at_the_bit_rate(tmp_path: Path, baud: int) -> None:
    """A burst begins 20 ms after the second; so many bytes are there after each further 10 ms."""
    fields = f"rate_hz: 1, baud: {baud}, messages: [GGA, RMC]"
    with serial_port(receiver_scenario(tmp_path, fields)) as (port, _):
        counts, data = [], port.run(1.02)
        assert data == b""
        for _ in range(60):
            data += port.run(0.01)
            counts.append(len(data))
    assert len(data) > 120
    due = np.minimum(np.arange(1, 61) * 0.01 * baud / 10, len(data))
    assert np.abs(np.array(counts) - due).max() <= 1
    assert [s.sentence_type for s in sentences(data, "GGA") + sentences(data, "RMC")] == ["GGA", "RMC"]


def test_what_does_not_fit_is_named_at_the_start_and_lost_whole(tmp_path: Path) -> None:
    with serial_port(receiver_scenario(tmp_path, "baud: 9600, rate_hz: 4")) as (port, emulator):
        packets = messages(whole(port.run(20.05)))
        said = emulator.messages()
    assert "messages of gps that do not fit into the period at 9600 bit/s, and may be lost: RMC, VTG, ZDA, PVT" in said
    assert 200 < len(packets) < 400  # of 480; each is whole


def test_bytes_before_a_program_opens_the_port_are_gone(tmp_path: Path) -> None:
    with serial_port(receiver_scenario(tmp_path)) as (port, emulator):
        pty = emulator.endpoint(serial="8n1")["pty"]
        port.run(1.05)
        port.control.call("run", for_s=1.5)  # 7 kB that no one reads
        port.close()
        port.control.call("run", for_s=7.5)  # no one has it open: time does not wait
        later = SerialPort(port.control, pty)
        first = messages(whole(later.run(1.0)))[0]
        later.close()
        assert "too slow" not in emulator.messages()
    assert first.time == datetime.time(0, 0, 10, 100_000)


def test_in_wall_pace_rare_solutions_come_in_time(tmp_path: Path) -> None:
    """A bench whose next event is a second away: the sleep until then is no falling behind."""
    path = receiver_scenario(tmp_path, "rate_hz: 1, messages: [GGA]", site="start: false\n")
    path.write_text(path.read_text().replace("start: true\n", ""))
    done = psa_emu(path, "--can", "none", "--pace", "wall", "--for", "2.3s")
    assert "2.300000 s simulated in wall pace" in done.stderr
    assert "slips: 0" in done.stderr


# ---- faults


def with_fault(folder: Path, kind: str, fields: str = f"{QUIET}, {NMEA_ONLY}", **args: object) -> tuple[bytes, bytes]:
    """What the port sends in a second before the fault, and in the second of the fault."""
    with serial_port(receiver_scenario(folder, fields)) as (port, _):
        before = port.run(1.05)
        port.control.call("fault.add", kind=kind, point="gps.solver", **args)
        return before, port.run(1.0)


def test_an_outage_leaves_fields_empty(tmp_path: Path) -> None:
    before, during = with_fault(tmp_path, "receiver.outage")
    assert {s.status for s in sentences(before, "RMC")} == {"A"}
    rmc, gga, gsa = (sentences(during, kind) for kind in ("RMC", "GGA", "GSA"))
    assert {s.status for s in rmc} == {"V"}
    assert len(rmc) == 10
    assert {(s.gps_qual, s.lat, s.lon) for s in gga} == {(0, "", "")}
    assert {s.mode_fix_type for s in gsa} == {"1"}
    assert len({s.timestamp for s in rmc}) == 10  # time goes on


def test_a_spoofed_ramp_has_the_velocity_that_explains_it(tmp_path: Path) -> None:
    _, during = with_fault(tmp_path, "receiver.spoof", ramp_mps=20.0, azimuth_deg=180.0)
    assert np.abs(north_m(during) - -20.0 * (np.arange(1, 11) * 0.1 - 0.05)).max() < 0.05
    vtg = sentences(during, "VTG")
    assert np.allclose([float(s.spd_over_grnd_kmph) for s in vtg], 72.0)
    assert {s.true_track for s in vtg} == {180.0}


def test_faults_add_up_and_leave_one_another_alone(tmp_path: Path) -> None:
    """A ramp goes on over a jump that comes and goes, and ends where it is lifted."""
    with serial_port(receiver_scenario(tmp_path, f"{QUIET}, {NMEA_ONLY}")) as (port, _):
        port.run(1.05)
        ramp = port.control.call("fault.add", kind="receiver.spoof", point="gps.solver", ramp_mps=10.0).result["id"]
        port.run(1.0)
        port.control.call("fault.add", kind="receiver.jump", point="gps.solver", jump_m=100.0, for_s=1.0)
        during, after = port.run(1.0), port.run(1.0)
        port.control.call("fault.clear", id=ramp)
        port.run(0.1)
        rest = port.run(1.0)
    since_s = np.arange(1, 11) * 0.1 - 0.05
    assert np.abs(north_m(during) - (100.0 + 10.0 * (1.0 + since_s))).max() < 0.05
    assert np.abs(north_m(after) - 10.0 * (2.0 + since_s)).max() < 0.05
    assert np.abs(north_m(rest)).max() < 0.02


def test_a_jump_has_none(tmp_path: Path) -> None:
    before, during = with_fault(tmp_path, "receiver.jump", jump_m=-40.0, azimuth_deg=0.0)
    assert np.abs(north_m(before)).max() < 0.02
    assert np.abs(north_m(during) + 40.0).max() < 0.05
    assert {float(s.spd_over_grnd_kmph) for s in sentences(during, "VTG")} == {0.0}


def test_time_freezes(tmp_path: Path) -> None:
    before, during = with_fault(tmp_path, "receiver.frozen_time")
    assert {s.timestamp for s in sentences(during, "ZDA")} == {sentences(before, "ZDA")[-1].timestamp}


def test_the_week_rolls_over(tmp_path: Path) -> None:
    _, during = with_fault(tmp_path, "receiver.wrong_week", weeks=-1024)
    assert {s.datestamp for s in sentences(during, "RMC")} == {
        datetime.date(2026, 1, 5) - datetime.timedelta(weeks=1024)
    }


def test_parsers_reject_a_bad_checksum(tmp_path: Path) -> None:
    before, during = with_fault(tmp_path, "receiver.bad_checksum", fields=f"{NMEA_ONLY}", probability=0.5)
    assert len(sentences(before, "GGA")) == 10
    bad = 0
    for line in lines(during):
        try:
            pynmea2.parse(line, check=True)
        except pynmea2.ChecksumError:
            bad += 1
    assert 10 < bad < 40  # of 50
    _, packets = with_fault(tmp_path, "receiver.bad_checksum", fields="messages: [PVT]")
    reader = UBXReader(io.BytesIO(packets), protfilter=UBX_PROTOCOL, quitonerror=0)
    assert [m for _, m in reader if m is not None and not isinstance(m, str)] == []


def test_a_fault_of_a_receiver_is_rejected_elsewhere(tmp_path: Path) -> None:
    path = tmp_path / "two.yaml"
    path.write_text("units:\n  - {name: a, board: bins}\nfaults:\n  - {kind: receiver.outage, point: a.computer}\n")
    done = psa_emu(path, "--can", "none", "--pace", "free", "--for", "0s")
    assert done.returncode == 2
    assert "expected a satellite receiver, got a BINS" in done.stderr


# ---- the same again


def test_the_same_seed_gives_the_same_bytes(tmp_path: Path) -> None:
    fields = "outliers_per_h: 3600, jumps_per_h: 600, outages_per_h: 600, outage_s: 1"
    found = []
    for seed in ("1", "1", "2"):
        with serial_port(receiver_scenario(tmp_path, fields), "--seed", seed) as (port, _):
            found.append(port.run(5.0))
    assert found[0] == found[1] != found[2]


def test_a_snapshot_and_a_fork_go_on_as_the_original(tmp_path: Path) -> None:
    """From the middle of a burst, with a fault under way: the bytes that follow are the same."""
    snapshot = tmp_path / "snapshot"
    with serial_port(receiver_scenario(tmp_path, "outliers_per_h: 3600")) as (port, _):
        port.run(0.95)
        port.control.call("fault.add", kind="receiver.spoof", point="gps.solver", ramp_mps=3.0)
        port.run(0.28)  # 10 ms after the burst of 1.2 s began
        port.control.call("snapshot", path=str(snapshot))
        forked = port.control.call("fork", can="none", control=str(tmp_path / "fork"), truth=str(tmp_path / "truth"))
        ports = [e["pty"] for e in forked.result["endpoints"] if e.get("serial")]
        after = port.run(2.0)
        with Control(tmp_path / "fork") as control:
            control.call("quit")
        assert len(ports) == 1
    with serial_port(None, "--restore", snapshot) as (port, _):
        assert port.run(2.0) == after


# ---- what cannot be


@pytest.mark.parametrize(
    ("argument", "words"),
    [
        ("b:-", 'expected a unit of the scenario, got "b"'),
        ("a:-", "expected a unit with a serial port, got a, a PSD-1"),
        ("gps:", "expected [UNIT:]LINK, where LINK is a path or -, got"),
    ],
)
def test_a_serial_port_of_no_one_is_rejected(tmp_path: Path, argument: str, words: str) -> None:
    path = tmp_path / "two.yaml"
    path.write_text("units:\n  - {name: a, board: psd1}\n  - {name: gps, board: receiver}\n")
    done = psa_emu(path, "--can", "none", "--pace", "free", "--for", "0s", "--serial", argument)
    assert done.returncode == 2
    assert words in done.stderr


def test_a_second_port_of_a_unit_is_rejected(tmp_path: Path) -> None:
    done = psa_emu(
        receiver_scenario(tmp_path),
        "--can",
        "none",
        "--pace",
        "free",
        "--for",
        "0s",
        "--serial",
        "-",
        "--serial",
        "gps:-",
    )
    assert done.returncode == 2
    assert "expected one serial port per unit, got a second for gps" in done.stderr


@pytest.mark.parametrize(
    ("unit", "words"),
    [
        ("on: platform", "whose vehicle has no longitude"),
        ("on: flight", "expected a section flight"),
        ("on: fixed, lever_arm_m: [0, 0, 1]", "expected lever_arm_m of [0, 0, 0] for a receiver"),
    ],
)
def test_an_antenna_whose_place_is_not_known_is_rejected(tmp_path: Path, unit: str, words: str) -> None:
    path = tmp_path / "antenna.yaml"
    path.write_text(f"site: {{latitude_deg: 50}}\nplatform: {{}}\nunits:\n  - {{name: gps, board: receiver, {unit}}}\n")
    done = psa_emu(path, "--can", "none", "--pace", "free", "--for", "0s")
    assert done.returncode == 2
    assert words in done.stderr
