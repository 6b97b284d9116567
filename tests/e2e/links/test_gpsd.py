"""gpsd, as Debian has it, on the serial port of a receiver: what its clients get over loopback."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from psabench.emulator import Emulator
from psabench.link.control import Control
from serial_port import QUIET, receiver_scenario

GPSD = shutil.which("gpsd", path=f"{os.environ['PATH']}:/usr/sbin")

pytestmark = [
    pytest.mark.host,
    pytest.mark.skipif(GPSD is None, reason="gpsd is not installed: tools/setup test"),
]

TIMEOUT_S = 60.0
STEP_S = 0.1  # of simulated time between two looks at gpsd
LOOK_S = 0.02
MODE_3D, MODE_NO_FIX = 3, 1


def free_port() -> int:
    with socket.socket() as s:
        s.bind(("127.0.0.1", 0))
        return int(s.getsockname()[1])


class Gpsd:
    """A client of gpsd: reports as they come, while the emulator's time moves."""

    def __init__(self, control: Control, port: int, process: subprocess.Popen[bytes]) -> None:
        self._control, self._process, self._rest = control, process, b""
        self._reports: list[dict[str, Any]] = []  # not yet looked at
        self._socket = self._connected(port)
        self._socket.settimeout(LOOK_S)
        self._socket.sendall(b'?WATCH={"enable":true,"json":true}\n')
        self.until(lambda r: r["class"] == "WATCH", step_s=0.0)  # from here on nothing that it learns is missed

    def _connected(self, port: int) -> socket.socket:
        deadline = time.monotonic() + TIMEOUT_S
        while time.monotonic() < deadline:
            assert self._process.poll() is None, "gpsd has ended"
            try:
                return socket.create_connection(("127.0.0.1", port), timeout=TIMEOUT_S)
            except ConnectionRefusedError:
                self._process.poll()
        raise AssertionError(f"gpsd does not listen after {TIMEOUT_S:g} s")

    def until(self, found: Callable[[dict[str, Any]], bool], step_s: float = STEP_S) -> dict[str, Any]:
        """The first report that it is true for, while time moves by step_s from look to look."""
        deadline = time.monotonic() + TIMEOUT_S
        while time.monotonic() < deadline:
            if step_s:
                self._control.call("run", for_s=step_s)
            self._reports += self._received()
            while self._reports:
                if found(report := self._reports.pop(0)):
                    return report
        raise AssertionError(f"no such report after {TIMEOUT_S:g} s")

    def _received(self) -> list[dict[str, Any]]:
        try:
            self._rest += self._socket.recv(1 << 20)
        except TimeoutError:
            return []
        *whole, self._rest = self._rest.split(b"\n")
        return [json.loads(line) for line in whole if line.strip()]

    def close(self) -> None:
        self._socket.close()


@contextmanager
def gpsd_on(scenario: Path) -> Iterator[tuple[Gpsd, Control]]:
    """gpsd in the foreground (-N), reading at once (-n), with no other set-up."""
    port = free_port()
    with Emulator(scenario, cans=["none"], extra=["--serial", "-"]) as emulator:
        assert emulator.control_path is not None
        assert GPSD is not None
        pty = emulator.endpoint(serial="8n1")["pty"]
        with (
            Control(emulator.control_path) as control,
            subprocess.Popen([GPSD, "-N", "-n", "-S", str(port), pty], stderr=subprocess.DEVNULL) as process,
        ):
            try:
                client = Gpsd(control, port, process)
                yield client, control
                client.close()
            finally:
                process.terminate()


def has_fix(r: dict[str, Any]) -> bool:
    return r["class"] == "TPV" and r["mode"] == MODE_3D and {"time", "speed", "altHAE"} <= set(r)


@pytest.mark.parametrize(
    ("fields", "driver"),
    [
        ("messages: [GGA, GSA, RMC, VTG, ZDA]", "NMEA0183"),
        ("messages: [PVT]", "u-blox"),
        ("messages: [GGA, GSA, RMC, VTG, ZDA, PVT]", "u-blox"),
        ("rate_hz: 1, baud: 9600, messages: [GGA, GSA, RMC, VTG, ZDA]", "NMEA0183"),
    ],
    ids=["sentences", "packets", "both", "9600 baud"],
)
def test_gpsd_follows_the_receiver(tmp_path: Path, fields: str, driver: str) -> None:
    with gpsd_on(receiver_scenario(tmp_path, f"{QUIET}, {fields}")) as (gpsd, _):
        assert gpsd.until(lambda r: r["class"] == "DEVICE" and r.get("driver") == driver)
        first = gpsd.until(has_fix)
        later = gpsd.until(lambda r: has_fix(r) and r["time"] > first["time"])
    for tpv in (first, later):
        assert tpv["lat"] == pytest.approx(55.75, abs=1e-6)
        assert tpv["lon"] == pytest.approx(37.61, abs=1e-6)
        assert tpv["altHAE"] == pytest.approx(150.0, abs=0.06)
        assert tpv["speed"] == pytest.approx(0.0, abs=0.01)
        assert tpv["time"].startswith("2026-01-05T00:0")


def test_gpsd_loses_the_fix_in_an_outage_and_finds_it_again(tmp_path: Path) -> None:
    with gpsd_on(receiver_scenario(tmp_path, f"{QUIET}, messages: [GGA, GSA, RMC]")) as (gpsd, control):
        gpsd.until(has_fix)
        fault = control.call("fault.add", kind="receiver.outage", point="gps.solver").result["id"]
        gpsd.until(lambda r: r["class"] == "TPV" and r["mode"] == MODE_NO_FIX)
        control.call("fault.clear", id=fault)
        assert gpsd.until(has_fix)


def test_gpsd_takes_the_spoofed_position(tmp_path: Path) -> None:
    """It has no way to know: position, speed and track agree."""
    with gpsd_on(receiver_scenario(tmp_path, f"{QUIET}, messages: [GGA, GSA, RMC, VTG]")) as (gpsd, control):
        gpsd.until(has_fix)
        control.call("fault.add", kind="receiver.spoof", point="gps.solver", ramp_mps=50.0, azimuth_deg=90.0)
        tpv = gpsd.until(lambda r: has_fix(r) and r["lon"] > 37.62)
    assert tpv["speed"] == pytest.approx(50.0, abs=0.01)
    assert tpv["track"] == pytest.approx(90.0, abs=0.01)
    assert tpv["lat"] == pytest.approx(55.75, abs=1e-5)


def test_gpsd_drops_sentences_with_a_bad_checksum(tmp_path: Path) -> None:
    """Half of them: it still follows, by the others."""
    with gpsd_on(receiver_scenario(tmp_path, f"{QUIET}, messages: [GGA, GSA, RMC]")) as (gpsd, control):
        control.call("fault.add", kind="receiver.bad_checksum", point="gps.solver", probability=0.5)
        first = gpsd.until(has_fix)
        assert gpsd.until(lambda r: has_fix(r) and r["time"] > first["time"])
