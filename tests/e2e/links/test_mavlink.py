"""`psa-emu --mavlink`: pymavlink and MAVSDK, unmodified, codes equal to CAN's; hostile and vanishing peers."""

from __future__ import annotations

import json
import math
import random
import socket
import struct
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from mavlink_client import TIMEOUT_S, command, free_port, parameters, receive, set_parameter, station
from psabench.emulator import Emulator
from psabench.link import signals
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.control import Control
from psabench.link.protocol_files import message
from psabench.mavlink.dialect import mavlink
from psabench.places import find_emulator
from pymavlink import mavutil
from rig import HERE, HOST, SEED, bus_spec, one_line, until

pytestmark = HOST
CLIENT = HERE / "mavsdk_client.py"


@contextmanager
def emulator(
    *links: str, pace: str = "wall", scenario: str = "stream", extra: tuple[str, ...] = ()
) -> Iterator[Emulator]:
    options = [x for link in links for x in ("--mavlink", link)]
    with Emulator(scenario, pace=pace, extra=[*options, *extra]) as emu:
        yield emu


def tcp(emu: Emulator) -> str:
    return f"tcp:127.0.0.1:{emu.endpoint(mavlink='tcp')['port']}"


def mavsdk(port: int, *words: str) -> dict[str, Any]:
    """What MAVSDK saw."""
    done = subprocess.run(
        [sys.executable, CLIENT, str(port), *words], capture_output=True, text=True, timeout=2 * TIMEOUT_S, check=True
    )
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    assert found["found"], done.stdout
    return found


def test_every_reading_has_the_codes_of_its_can_frames(tmp_path: Path) -> None:
    """In step pace, so that both observers see the same frames; the tlog of the client reads back the same."""
    tlog = tmp_path / "run.tlog"
    with ExitStack() as stack:
        emu = stack.enter_context(emulator("tcp:0,imu=1000", pace="step"))
        control = stack.enter_context(Control(emu.control_path))  # type: ignore[arg-type]
        host = stack.enter_context(CanHost(open_bus(bus_spec(emu.endpoint(can="socketcand"))), WallClock()))
        host.clock = StepClock(control, [host])
        frames: list[Any] = []
        host.listeners.append(frames.append)
        gcs = mavutil_connection(emu)
        stack.callback(gcs.close)
        gcs.setup_logfile(str(tlog))
        until(lambda: gcs.port is not None, "the connection")
        host.advance(0.3)
        exact = [receive(gcs, "PSABENCH_ACCEL") for _ in range(sum(m.arbitration_id == 0x285 for m in frames))]
        gcs.mav.command_long_send(1, 1, 512, 0, 105, 0, 0, 0, 0, 0, 0)
        imu = receive(gcs, "HIGHRES_IMU")
        gcs.logfile.close()
    xy = [bytes(m.data) for m in frames if m.arbitration_id == 0x185]
    zt = [bytes(m.data) for m in frames if m.arbitration_id == 0x285]
    columns = dict(_columns("PSA2_XY", xy)) | dict(_columns("PSA2_ZT", zt))
    assert len(exact) == len(zt) > 100
    assert [m.code for m in exact] == [list(row) for row in zip(*(columns[a] for a in "XYZ"), strict=True)]
    assert [m.temp_code for m in exact] == columns["T"]
    assert all(m.volts[0] == m.code[0] * 10 / 2**23 for m in exact)
    assert [m.seq for m in exact] == list(range(exact[0].seq, exact[0].seq + len(exact)))
    assert all(m.time_usec // 4 % 65536 == t for m, t in zip(exact, columns["TSTAMP"], strict=True))
    assert imu.xacc == pytest.approx(-(exact[-1].volts[0] - 2.5) * 9.80665, abs=1e-3)
    log = mavutil.mavlink_connection(str(tlog))
    again = []
    while (m := log.recv_match(type="PSABENCH_ACCEL")) is not None:
        again.append(m.code)
    assert again == [m.code for m in exact]


def _columns(name: str, data: list[bytes]) -> Iterator[tuple[str, list[int]]]:
    bits = signals.payload(data, int(message(name).length))
    for signal, at in dict(signals.layout(message(name))).items():
        yield signal, signals.raw(bits, at).tolist()


def mavutil_connection(emu: Emulator) -> Any:
    mavlink()
    mavutil.set_dialect("psabench")
    return mavutil.mavlink_connection(tcp(emu), autoreconnect=False)


def test_parameters_are_the_units_objects_and_commands_are_answered() -> None:
    with emulator("tcp:0") as emu, station(tcp(emu)) as gcs:
        found = parameters(gcs)
        assert found["X_CONFIG0"] == 0x56
        assert found["ID_PRODUCT_CODE"] == 0x50534132
        assert found["UNIT_NODE"] == 5
        assert len(found) > 90
        assert set_parameter(gcs, "SAMPLE_NTH", 3) == (3.0, [])
        assert set_parameter(gcs, "FRAME_FORM", 9) == (0.0, ["FRAME_FORM: expected an integer from 0 to 3"])
        assert set_parameter(gcs, "WORD_BITS", 16)[0] == 32.0
        assert set_parameter(gcs, "ZERO_V_X", 2.25)[0] == 2.25
        assert command(gcs, 511, 105, 20000.0) == 0
        assert command(gcs, 400, 1) == 3
        assert command(gcs, 241, 0, 0, 0, 0, 1) == 3
        assert gcs.messages["STATUSTEXT"].text == " this command"  # the second chunk: it came before the answer
        receive(gcs, "PSABENCH_LINK", where=lambda m: m.lost == 0 and m.peers == 1)
        assert gcs.packet_loss() == 0.0


@pytest.mark.parametrize("words", [("telemetry",), ("params", "SAMPLE_NTH", "2"), ("calibrate",)], ids=lambda w: w[0])
def test_mavsdk_reads_telemetry_and_parameters_and_is_told_who_calibrates(words: tuple[str, ...]) -> None:
    port = free_port()
    with emulator(f"udp:{port},autopilot=px4"):
        seen = mavsdk(port, *words)
    if words[0] == "telemetry":
        assert len(seen["imu"]) == 10
        assert seen["imu"][0][0] == pytest.approx(0.111, abs=0.01)
    elif words[0] == "params":
        assert seen["float"]["X_CONFIG0"] == 0x56
        assert seen["again"] == 2.0
        assert seen["int"]["ACCEL_UG_Y"] == pytest.approx(-2.5e6, abs=100)
    else:
        assert seen["error"].startswith("UNSUPPORTED")


HIL_SCENARIO = """
seed: 1
start: true
site: {latitude_deg: 55, longitude_deg: 37.5, height_m: 150}
units: [{name: a, node: 5, axes: {x: {sensor: mems, u0_v: 2.5, kx_v_per_g: 1}}}]
"""


def test_an_autopilot_in_the_loop_hears_the_place_and_the_turning_earth(tmp_path: Path) -> None:
    scenario = tmp_path / "hil.yaml"
    scenario.write_text(HIL_SCENARIO, encoding="utf-8")
    with emulator("tcp:0,hil=200", pace="step", scenario=str(scenario)) as emu, Control(emu.control_path) as control:  # type: ignore[arg-type]
        gcs = mavutil_connection(emu)
        until(lambda: gcs.port is not None, "the connection")
        control.call("run", for_s=0)  # the connection is accepted in the turn that takes this command
        control.call("run", for_s=1.0)
        heard = [receive(gcs, "HIL_SENSOR", "HIL_GPS") for _ in range(150)]
        gcs.close()
    sensor = [m for m in heard if m.get_type() == "HIL_SENSOR"]
    fixes = [m for m in heard if m.get_type() == "HIL_GPS"]
    assert {b.time_usec - a.time_usec for a, b in pairwise(sensor)} == {5000}
    assert {b.time_usec - a.time_usec for a, b in pairwise(fixes)} == {200000}
    fix, last = fixes[-1], sensor[-1]
    assert math.hypot(last.xgyro, last.ygyro, last.zgyro) == pytest.approx(7.292115e-5, rel=1e-6)  # WGS 84
    assert last.abs_pressure == pytest.approx(1013.25 * (1 - 0.0065 * 150 / 288.15) ** 5.25588, abs=0.01)  # ISO 2533
    assert (last.id, last.fields_updated, last.xmag) == (0, 0b1010_0011_1111, 0)
    assert (fix.lat, fix.lon, fix.alt) == (550000000, 375000000, 150000)
    assert (fix.fix_type, fix.vel, fix.cog) == (3, 0, 65535)


AIRCRAFT = """
flight:
  heading_deg: 130
  jerk_mps3: 40
  legs: [{takeoff_mps: 85, accel_mps2: 20}, {climb_m: 500, rate_mps: 3}, {land_mps: 70}, {stop_s: 1}]
"""


def test_an_autopilot_in_the_loop_flies_with_the_aircraft(tmp_path: Path) -> None:
    """Climbing at 3 m/s to the south-east: the place moves with the velocity."""
    scenario = tmp_path / "flight.yaml"
    scenario.write_text(HIL_SCENARIO.replace("node: 5,", "node: 5, on: flight,") + AIRCRAFT, encoding="utf-8")
    with emulator("tcp:0,hil=20", pace="step", scenario=str(scenario)) as emu, Control(emu.control_path) as control:  # type: ignore[arg-type]
        gcs = mavutil_connection(emu)
        until(lambda: gcs.port is not None, "the connection")
        control.call("run", for_s=0)
        control.call("run", for_s=16.0)
        fixes = [receive(gcs, "HIL_GPS") for _ in range(75)][-2:]
        gcs.close()
    before, fix = fixes
    assert (fix.vd, fix.vel, fix.cog) == (-300, 8500, 13000)
    assert (fix.vn, fix.ve) == (round(8500 * math.cos(math.radians(130))), round(8500 * math.sin(math.radians(130))))
    assert fix.alt - before.alt == pytest.approx(3 * 200, abs=2)  # mm in 200 ms
    assert math.radians((fix.lat - before.lat) * 1e-7) * 6.366e6 == pytest.approx(fix.vn * 0.002, abs=0.1)
    assert math.radians((fix.lon - before.lon) * 1e-7) * 6.392e6 * math.cos(math.radians(55)) == pytest.approx(
        fix.ve * 0.002, abs=0.1
    )


def test_a_pseudo_terminal_and_udp_clients_at_once(tmp_path: Path) -> None:
    link = tmp_path / "mav"
    with emulator(f"pty:{link},sysid=7", "udpin:0,sysid=9") as emu, ExitStack() as stack:
        mavlink()
        mavutil.set_dialect("psabench")
        serial = mavutil.mavlink_connection(str(link), baud=57600)
        stack.callback(serial.close)
        assert receive(serial, "HEARTBEAT").get_srcSystem() == 7
        receive(serial, "PSABENCH_ACCEL")
        peers = []
        for k in range(3):
            peer = mavutil.mavlink_connection(f"udpout:127.0.0.1:{emu.endpoint(mavlink='udpin')['port']}")
            stack.callback(peer.close)
            peer.mav.heartbeat_send(6, 8, 0, 0, 0)
            peers.append(peer)
            assert receive(peer, "HEARTBEAT").get_srcSystem() == 9
            receive(peer, "PSABENCH_LINK", where=lambda m, k=k: m.peers == k + 1)  # type: ignore[misc]
        for peer in peers:
            receive(peer, "PSABENCH_ACCEL")


# ---- bad peers


def test_hostile_bytes_are_counted_and_disturb_no_other_client() -> None:
    noise = random.Random(SEED)
    with emulator("tcp:0") as emu, station(tcp(emu)) as gcs:
        port = int(emu.endpoint(mavlink="tcp")["port"])
        for _ in range(3):
            with socket.create_connection(("127.0.0.1", port)) as s:
                s.sendall(b"\xfd\xff" + noise.randbytes(20000) + b"\xfd" * 300 + b"\xfe\xff" * 50)
                s.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # and resets
        receive(gcs, "PSABENCH_LINK", where=lambda m: m.malformed > 0 and m.peers == 1)
        assert set_parameter(gcs, "SAMPLE_NTH", 4)[0] == 4.0
        assert gcs.packet_loss() == 0.0


def test_a_client_that_does_not_read_loses_messages_that_are_counted() -> None:
    with emulator("tcp:0,imu=1000") as emu, station(tcp(emu)) as gcs, socket.socket() as lazy:
        lazy.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        lazy.connect(("127.0.0.1", int(emu.endpoint(mavlink="tcp")["port"])))
        for id_ in (30, 54101):  # as many messages as may be: its buffers fill within seconds
            assert command(gcs, 511, id_, 100.0) == 0
        receive(gcs, "PSABENCH_LINK", where=lambda m: m.lost > 0 and m.peers == 2)
        assert gcs.packet_loss() == 0.0


def test_clients_come_and_go_while_time_stands_still() -> None:
    with emulator("tcp:0", pace="step") as emu, Control(emu.control_path) as control:  # type: ignore[arg-type]
        port = int(emu.endpoint(mavlink="tcp")["port"])
        for _ in range(20):
            socket.create_connection(("127.0.0.1", port)).close()
        reply = control.call("run", for_s=0.1)
        assert reply.t_ns == 100_000_000


def test_the_same_run_with_and_without_a_link_has_the_same_frames(tmp_path: Path) -> None:
    logs = []
    for links in ((), ("tcp:0,imu=1000,hil=500", "udpin:0")):
        log = tmp_path / f"{len(links)}.log"
        options = [x for link in links for x in ("--mavlink", link)]
        with (
            Emulator("stream", pace="step", cans=[f"log:{log}"], extra=options) as emu,
            Control(emu.control_path) as control,  # type: ignore[arg-type]
        ):
            control.call("run", for_s=0.5)
        logs.append(log.read_bytes())
    assert logs[0] == logs[1]
    assert len(logs[0]) > 10000


@pytest.mark.parametrize(
    ("arg", "expected"),
    [
        ("tcp:0,unit=zz", 'expected a unit of the scenario, got "zz"'),
        ("usb", "--mavlink: expected udp[:PORT]"),
        ("tcp:0,hil=x", "--mavlink: expected hil=HZ"),
    ],
)
def test_a_wrong_option_is_one_line_and_status_2(arg: str, expected: str) -> None:
    done = subprocess.run(
        [find_emulator(), "stream", "--mavlink", arg, "--can", "none"],
        capture_output=True,
        text=True,
        timeout=TIMEOUT_S,
    )
    assert done.returncode == 2
    assert expected in one_line(done.stderr, "psa-emu")


def test_a_port_in_use_is_told() -> None:
    with emulator("tcp:0") as emu:
        port = emu.endpoint(mavlink="tcp")["port"]
        done = subprocess.run(
            [find_emulator(), "stream", "--mavlink", f"tcp:{port}", "--can", "none"],
            capture_output=True,
            text=True,
            timeout=TIMEOUT_S,
        )
    assert done.returncode == 3
    assert "expected a free port of 127.0.0.1" in one_line(done.stderr, "psa-emu")


def test_a_parameter_that_was_set_is_part_of_a_snapshot(tmp_path: Path) -> None:
    """What the link writes goes over the bus, in frames that a snapshot repeats."""
    with emulator("tcp:0", pace="step") as emu, Control(emu.control_path) as control:  # type: ignore[arg-type]
        gcs = mavutil_connection(emu)
        control.call("run", for_s=0.2)
        gcs.mav.param_set_send(1, 1, b"SAMPLE_NTH", 7.0, 9)
        gcs.mav.param_set_send(1, 1, b"ZERO_V_X", 2.25, 9)
        for _ in range(200):  # each an access of some frames; the requests come at their own pace
            control.call("run", for_s=0.005)
            values = _values(gcs)
            if values.get("ZERO_V_X") == 2.25:
                break
        assert values == {"SAMPLE_NTH": 7.0, "ZERO_V_X": 2.25}
        gcs.close()
        control.call("snapshot", path=str(tmp_path / "s"))
    restored = Emulator(pace="step", extra=["--restore", tmp_path / "s", "--mavlink", "tcp:0,imu=1000"])
    with restored as emu, Control(emu.control_path) as control:  # type: ignore[arg-type]
        gcs = mavutil_connection(emu)
        control.call("run", for_s=0.1)
        m = receive(gcs, "PSABENCH_ACCEL")
        gcs.close()
    assert m.accel_mps2[0] == pytest.approx((m.volts[0] - 2.25) * 9.80665)


def _values(gcs: Any) -> dict[str, float]:
    """Parameters that have come by now."""
    while gcs.recv_match(blocking=False) is not None:
        pass
    return {k: float(v) for k, v in gcs.params.items()}
