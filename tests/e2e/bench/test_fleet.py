"""A thousand units in one emulator: each on its bus with its node, saved and forked like any bench, and small."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest
from psabench.emulator import Emulator
from psabench.errors import BadInput
from psabench.link.can_host import CanHost, Message, StepClock, WallClock, open_bus
from psabench.link.control import Control
from rig import HOST, bus_spec

pytestmark = HOST

FLEET = "fleet1000"
UNITS, BUSES, ON_A_BUS = 1000, 8, 125
UNIT_KB = 128  # of memory, at most
BOOT_UP = 0x700


@contextmanager
def fleet(*cans: str, extra: tuple[str | Path, ...] = ()) -> Iterator[tuple[Emulator, Control]]:
    with Emulator(None if extra else FLEET, cans=cans or ("none",), extra=extra) as emulator:
        assert emulator.control_path is not None
        with Control(emulator.control_path) as control:
            yield emulator, control


def state_of(control: Control, path: Path) -> str:
    """Digest of the whole bench, as a snapshot has it."""
    control.call("snapshot", path=str(path))
    return str(json.loads(path.read_text(encoding="utf-8").splitlines()[-2])["state"])


def rss_kb(emulator: Emulator) -> int:
    found = re.search(r"VmRSS:\s+(\d+)", Path(f"/proc/{emulator.pid}/status").read_text(encoding="utf-8"))
    assert found
    return int(found[1])


def test_each_unit_boots_on_its_bus_under_its_node() -> None:
    with fleet(*(f"can{n}=socketcand:0" for n in range(BUSES))) as (emulator, control), ExitStack() as stack:
        ends = [e for e in emulator.endpoints if "can" in e]
        hosts = [stack.enter_context(CanHost(open_bus(bus_spec(e)), WallClock())) for e in ends]
        messages: list[list[Message]] = [[] for _ in hosts]
        clock = StepClock(control, hosts)
        for host, heard in zip(hosts, messages, strict=True):
            host.clock = clock
            host.listeners.append(heard.append)
        hosts[0].advance(0.03)
        for heard in messages:
            assert sorted(m.arbitration_id for m in heard) == [BOOT_UP + node for node in range(1, ON_A_BUS + 1)]
        units = control.call("units").result["units"]
        assert [(u["serial"], u["node"]) for u in units] == [(n + 1, n % ON_A_BUS + 1) for n in range(UNITS)]
        assert rss_kb(emulator) < UNITS * UNIT_KB


def test_a_fleet_is_saved_restored_and_forked(tmp_path: Path) -> None:
    """Parent, child and what was restored come to one state; a word to the last unit alone sets one apart."""
    first = tmp_path / "first"
    with fleet() as (_, control):
        control.call("run", for_s=0.003)
        state_of(control, first)
        control.call("fork", control=str(tmp_path / "child"))
        with Control(tmp_path / "child") as child:
            child.call("fault.add", kind="sensor.bias", point="h125.sensor.z", bias_v=0.1)
            child.call("run", for_s=0.002)
            apart = state_of(child, tmp_path / "apart")
            child.call("quit")
        control.call("run", for_s=0.002)
        together = state_of(control, tmp_path / "together")
    with fleet(extra=("--restore", first)) as (_, control):
        control.call("run", for_s=0.002)
        assert state_of(control, tmp_path / "again") == together
    assert apart != together


@pytest.mark.parametrize(
    ("units", "says"),
    [
        ("{name: u%u, count: 1001}", "units.u%u.count: expected 1 to 1000, got 1001"),
        (
            ", ".join(
                f"{{name: {'abcdefgh'[n]}%u, count: 126, node: 1, bus: c{n}, serial: {1 + 200 * n}}}" for n in range(8)
            ),
            "units.h%u.count: expected up to 1000 units in all, got more",
        ),
        ("{name: u%u, count: 127, node: 2}", "units.u%u.node: expected 1 to 127, got 128"),
        ("{name: u, bus: c8}", "units.u.bus: expected "),
    ],
)
def test_more_than_there_is_room_for_is_refused_by_name(units: str, says: str, tmp_path: Path) -> None:
    scenario = tmp_path / "many.yaml"
    buses = ", ".join(f"{{name: c{n}}}" for n in range(BUSES))
    scenario.write_text(f"buses: [{buses}]\nunits: [{units}]\n", encoding="utf-8")
    with pytest.raises(BadInput, match=re.escape(says)), Emulator(scenario, cans=("none",)):
        pass
