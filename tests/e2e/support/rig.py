"""What the end-to-end tests stand on: an emulator, a host on its bus, and waiting for things instead of sleeping."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import pytest
from psabench.boards.psa2.device import Psa2
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost
from psabench.link.control import Control
from psabench.link.endpoints import bus_spec as bus_spec  # for the tests that take it from here
from psabench.link.endpoints import scpi_addresses
from psabench.places import find_emulator

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
DBC = ROOT / "proto" / "psabench.dbc"
EDS = ROOT / "proto" / "psa2.eds"
BENCH = HERE / "bench.yaml"  # the article's board and sensor without noise; what tests/uml/slc0 runs, too

PSABENCH = ROOT / ".venv/bin/psabench"
SEED = int(os.environ.get("TEST_SEED", "1"))  # of random input; a failure is replayed by giving it

TIMEOUT_S = 60.0  # for anything that takes milliseconds on an idle machine
ADAPTERS = {"socketcand": "socketcand:0", "slcan": "slcan", "vcan": "socketcan:vcan0"}  # transport: --can
SLC0 = "socketcan:slc0,receive_own_messages=false"  # the emulator runs outside the guest, without a control socket

HOST, VCAN, SLC = pytest.mark.host, pytest.mark.vcan, pytest.mark.slc0


def over(*transports: str) -> pytest.MarkDecorator:
    """Parametrizes `transport`, each with the mark of the place where it can run."""
    marks = {"vcan": VCAN, "slc0": SLC}
    return pytest.mark.parametrize(
        "transport", [pytest.param(t, marks=marks.get(t, HOST)) for t in transports], indirect=True
    )


class MakeRig(Protocol):
    def __call__(
        self,
        transport: str,
        scenario: str | Path = BENCH,
        *,
        pace: str = "step",
        seed: int | None = None,
        extra: Sequence[str | Path] = (),
    ) -> Rig: ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """A bench with a host on its bus. On slc0 the emulator is out of reach: no control socket, real time only."""

    spec: str  # of open_bus
    host: CanHost
    unit: Psa2
    running: Emulator | None = None
    port: Control | None = None

    @property
    def emulator(self) -> Emulator:
        assert self.running is not None
        return self.running

    @property
    def control(self) -> Control:
        assert self.port is not None
        return self.port

    def clients(self) -> list[dict[str, Any]]:
        """Counters of the programs on the bus, in the order of their coming: our own host is the first."""
        clients: list[dict[str, Any]] = self.control.call("frames").result["clients"]
        return clients


def addresses(emulator: Emulator) -> tuple[str, ...]:
    """Where an emulator's bus, head and control socket are, as options of `psabench run`."""
    can = bus_spec(emulator.endpoint(can="socketcand"))
    head = scpi_addresses(emulator.endpoints)["head"]
    return "--can", can, "--head", head, "--control", str(emulator.control_path)


def tool_env(spec: str) -> dict[str, str]:
    """The environment in which python-can's own tools take that bus without an argument."""
    interface, channel = spec.split(",")[0].split(":", 1)
    env = {**os.environ, "CAN_INTERFACE": interface, "CAN_CHANNEL": channel, "PYTHONUNBUFFERED": "1"}
    if interface == "socketcand":
        host, port = channel.rsplit(":", 1)
        env |= {
            "CAN_CHANNEL": "can0",
            "CAN_CONFIG": json.dumps({"host": host, "port": int(port), "tcp_tune": True}),
        }
    return env


def need(transport: str) -> None:
    """Skip, with its reason, where the transport cannot exist; fail where the runner promised it."""
    interface = {"vcan": "vcan0", "slc0": "slc0"}.get(transport)
    if interface is None or interface in (name for _, name in socket.if_nameindex()):
        return
    if "PSABENCH_GUEST" in os.environ:
        pytest.fail(f"no {interface} where the runner promised one")
    pytest.skip(f"no {interface} here; `make uml` runs this inside a kernel that has one")


def until(condition: Callable[[], object], what: str, timeout_s: float = TIMEOUT_S) -> None:
    """Wait for a condition that another process causes. Fails, naming it, when it does not come."""
    deadline_s = time.monotonic() + timeout_s
    while not condition():
        if time.monotonic() >= deadline_s:
            pytest.fail(f"waited {timeout_s:g} s in vain for {what}")
        time.sleep(0.002)  # between two looks: nothing depends on its length


def psa_emu(*args: str | Path, timeout_s: float = TIMEOUT_S) -> subprocess.CompletedProcess[str]:
    """Run the emulator to its end."""
    argv = [str(find_emulator()), *(str(a) for a in args)]
    return subprocess.run(argv, capture_output=True, text=True, timeout=timeout_s, check=False, cwd=ROOT)


def unread(port: int) -> int:
    """Bytes that the clients of a TCP port of this machine have not read yet (/proc/net/tcp: rem_address, rx_queue)."""
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    return sum(int(row[4].split(":")[1], 16) for row in rows if row[2].endswith(f":{port:04X}"))


def one_line(text: str, program: str) -> str:
    """The only line in text, which must come from that program."""
    lines = text.splitlines()
    assert len(lines) == 1, text
    assert lines[0].startswith(f"{program}: ")
    return lines[0]


def psabench(*args: str | Path) -> subprocess.Popen[str]:
    """Start the host's command; it starts the same emulator as the tests do."""
    return subprocess.Popen(
        [str(PSABENCH), *(str(a) for a in args)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "PSA_EMU": str(find_emulator())},
    )


@contextmanager
def talker(emulator: Emulator, words: Sequence[bytes] = (b"< open can0 >", b"< rawmode >")) -> Iterator[socket.socket]:
    """A raw connection after its handshake."""
    e = emulator.endpoint(can="socketcand")
    with closing(socket.create_connection((e["host"], int(e["port"])), TIMEOUT_S)) as s:
        assert s.recv(64) == b"< hi >"
        for word in words:
            s.sendall(word)
            assert s.recv(64) == b"< ok >"
        yield s
