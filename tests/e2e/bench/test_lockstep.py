"""In step pace a script that drives everything at once gets the same bytes each time, whatever else is going on."""

from __future__ import annotations

import hashlib
import os
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path

import can
import pytest
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost, StepClock, WallClock, open_bus
from psabench.link.control import Control
from rig import HERE, TIMEOUT_S, bus_spec

pytestmark = pytest.mark.host

MOVING = HERE / "moving.yaml"


@contextmanager
def load() -> Iterator[None]:
    """Processes that leave the emulator and its host little of the machine."""
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2 * (os.cpu_count() or 1))]
    try:
        yield
    finally:
        for p in busy:
            p.kill()
            p.wait()


class LineReader:
    """Takes what comes from the line port while a script runs; time waits for it."""

    ENOUGH = 800_000  # bytes, 0.1 s at 8 MHz

    def __init__(self, pty: str) -> None:
        self._fd = os.open(pty, os.O_RDONLY | os.O_NOCTTY)
        self._bytes = b""
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self) -> None:
        with suppress(OSError):  # EIO: the emulator has gone
            while chunk := os.read(self._fd, 65536):
                self._bytes += chunk if len(self._bytes) < self.ENOUGH else b""

    def take(self) -> bytes:
        """The first ENOUGH bytes, when the emulator has gone."""
        self._thread.join(TIMEOUT_S)
        os.close(self._fd)
        assert len(self._bytes) >= self.ENOUGH
        return self._bytes[: self.ENOUGH]


def ask(instrument: socket.socket, text: str) -> bytes:
    """One line to an instrument; every line here asks something, so that the next thing comes after it."""
    instrument.sendall(text.encode() + b"\n")
    answer = b""
    while not answer.endswith(b"\n"):
        answer += instrument.recv(4096)
    return answer


def script(folder: Path) -> str:
    """Three hosts on the bus, the line port, two instruments and commands; SHA-256 of all that came back."""
    heard: list[tuple[int, int, int, bytes]] = []
    said: list[bytes] = []
    vcd, truth = folder / "lines.vcd", folder / "truth"
    extra = ("--line", "-", "--vcd", vcd, "--truth-log", truth, "--scpi", "all")
    with Emulator(MOVING, cans=["socketcand:0", "slcan"], extra=extra) as emulator, ExitStack() as stack:
        assert emulator.control_path is not None
        control = stack.enter_context(Control(emulator.control_path))
        lines = LineReader(emulator.endpoint(line="sampled")["pty"])
        hosts = []
        for place, kind in enumerate(("socketcand", "socketcand", "slcan")):
            host = stack.enter_context(CanHost(open_bus(bus_spec(emulator.endpoint(can=kind))), WallClock()))

            def hear(m: can.Message, place: int = place, timed: bool = kind == "socketcand") -> None:
                heard.append((place, round(m.timestamp * 1e6) if timed else 0, m.arbitration_id, bytes(m.data)))

            host.listeners.append(hear)
            hosts.append(host)
        clock = StepClock(control, hosts)
        table, head = (
            stack.enter_context(closing(socket.create_connection((e["host"], int(e["port"])), TIMEOUT_S)))
            for e in (emulator.endpoint(scpi="table"), emulator.endpoint(scpi="head"))
        )
        for k in range(12):
            hosts[0].send(0x605, bytes([0x40, 0x18, 0x10, 1 + k % 4, 0, 0, 0, 0]))
            said.append(ask(table, f":AXIS1:POS {k};:AXIS1:POS?;:SYST:ERR?"))
            hosts[1].send(0x080, b"")
            hosts[2].send(0x606, bytes([0x40, 0x18, 0x10, 1 + k % 4, 0, 0, 0, 0]))
            said.append(ask(head, f":ANGL {k};:ANGL?;:SYST:ERR?"))
            if k == 6:
                control.call("unit.reset", unit="b")
            clock.command(None, "run", for_s=0.03 if k % 3 else 0.0)
        counters = control.call("counters").result["units"]
        control.call("quit")
        assert emulator.wait(TIMEOUT_S) == 0
        sampled = lines.take()
    heard.sort(key=lambda h: h[0])  # hosts one after the other, each in the order of its hearing
    assert {h[0] for h in heard} == {0, 1, 2}
    total = hashlib.sha256(repr((heard, said, counters)).encode() + sampled)
    total.update(vcd.read_bytes() + truth.read_bytes())
    return total.hexdigest()


@pytest.mark.parametrize("runs", [4, 20])
def test_a_script_that_drives_everything_gets_the_same_bytes_under_load(tmp_path: Path, runs: int) -> None:
    want = script(tmp_path)
    with load():
        for run in range(1, runs):
            assert script(tmp_path) == want, f"run {run}"


def test_a_run_that_comes_to_the_end_is_answered_and_ends_the_emulator() -> None:
    with Emulator("quiet", cans=["none"], extra=["--for", "100ms"]) as emulator:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            assert control.call("run", for_s=0.03).t_ns == 30_000_000
            assert control.call("run", for_s=5.0).t_ns == 100_000_000
            assert emulator.wait(TIMEOUT_S) == 0
