"""Every kind of fault at every point of a bench: refused with the reason, or seen by a host that knows the protocol.

docs/faults.md has the matrix that this test goes through; what the host looks for is in fault_psa2.py.
"""

from __future__ import annotations

from pathlib import Path

import pytest
from fault_case import FAR_S, accepted, must_accept, near
from fault_host import SETTLE_S, fault_host
from fault_psa2 import ACCEPTED, DETECT, Case, recorded
from psabench.emulator import Emulator
from psabench.link.can_host import open_bus
from psabench.link.control import Control
from psabench.link.vcd import read_vcd
from rig import HERE, bus_spec

pytestmark = pytest.mark.host

SCENARIO = HERE / "faults.yaml"


def test_a_brownout_breaks_a_frame_off() -> None:
    """Int is low for 74 us in each frame but the last, in which the supply fails 30 us after its fall."""
    with fault_host(SCENARIO) as host:
        path = host.emulator.directory / "lines.vcd"
        host.call("vcd.start", path=str(path), unit="a")
        host.add("supply.brownout", "supply", drop_v=6, for_s=0.02, after="INT_FALL", count=3, delay_s=30e-6, unit="a")
        host.bus.advance(0.01)
        host.call("vcd.stop")
        line = read_vcd(path).wires["Int"]
        last_clk_ns = int(read_vcd(path).wires["CLK"].edges_ns(1)[-1])
    falls = line.edges_ns(0)
    assert len(falls) == 3
    near(last_clk_ns - float(falls[2]), 30e3, 500)


def test_a_healthy_board_breaks_no_rule() -> None:
    with fault_host(SCENARIO) as host:
        for unit in host.node:
            c = Case(host, "line.glitch", f"{unit}.line.Int")
            assert recorded(c, at_s=FAR_S, width_ns=100) == {}


def test_a_program_keeps_its_number_when_an_older_one_leaves() -> None:
    with Emulator(SCENARIO, pace="step") as emulator, Control(emulator.control_path or Path()) as control:
        older, younger = (open_bus(bus_spec(emulator.endpoints[0])) for _ in range(2))

        def programs() -> list[int]:
            return [c["came"] for c in control.call("frames").result["clients"]]

        assert programs() == [1, 2]
        assert control.call("fault.points", kind="link.stall").result["points"] == ["client.1", "client.2"]
        waits = control.call("fault.add", kind="link.drop", point="client.1", at_s=0.5).result["id"]
        older.shutdown()
        for _ in range(100):  # until the emulator has seen it go
            if control.call("run", for_s=0.001).rx.keys() == {2}:
                break
        assert programs() == [2]
        assert control.call("fault.points", kind="link.stall").result["points"] == ["client.2"]
        control.call("fault.add", kind="link.drop", point="client.2")
        control.call("run", for_s=1.0)
        states = {f["id"]: (f["point"], f["state"]) for f in control.call("fault.list").result["faults"]}
        assert states == {waits: ("client.1", "void"), waits + 1: ("client.2", "active")}
        younger.shutdown()


def kinds_told() -> list[str]:
    with fault_host(SCENARIO, settle=False) as host:
        return [k["kind"] for k in host.call("fault.kinds")["kinds"]]


ELSEWHERE = (
    *("controller.capacitor", "controller.stuck_reset", "controller.stuck_key"),  # test_faults_boards.py
    *("platform.torquer", "platform.drift_step", "platform.encoder_stuck"),  # test_gyro.py
    *("chamber.slow", "chamber.readout", "chamber.overshoot", "table.ripple"),  # test_faults_instruments.py
    *("receiver.outage", "receiver.spoof", "receiver.jump"),  # test_receiver.py
    *("receiver.frozen_time", "receiver.bad_checksum", "receiver.wrong_week"),
    *("gyro.stuck", "gyro.saturation", "gyro.bias", "gyro.scale", "gyro.lock_in"),  # test_bins_faults.c, test_bins.py
)
EVERYWHERE = ("head.stick", "head.slip", "scpi.silent", "scpi.late", "scpi.garbled")  # the same file


def test_no_kind_is_left_out() -> None:
    assert sorted(kinds_told()) == sorted([*DETECT, *ELSEWHERE, *EVERYWHERE])


@pytest.mark.parametrize("kind", ELSEWHERE)
def test_what_other_boards_have_is_refused(kind: str) -> None:
    with fault_host(SCENARIO, settle=False) as host:
        for point in host.call("fault.points")["points"]:
            assert not accepted(Case(host, kind, point)), f"{kind} at {point}"


@pytest.mark.parametrize("kind", DETECT)
def test_at_every_point_it_is_refused_or_seen(kind: str) -> None:
    seen = 0
    with fault_host(SCENARIO) as host:
        host.turn(30.0)  # every axis feels something
        host.bus.advance(SETTLE_S)
        for unit in host.node:
            assert host.watch(unit, 0.02).complaints() == []
        for point in host.call("fault.points")["points"]:
            c = Case(host, kind, point)
            assert accepted(c) == must_accept(ACCEPTED, kind, point), f"{kind} at {point}"
            if not must_accept(ACCEPTED, kind, point):
                continue
            DETECT[kind](c)
            seen += 1
            c.clear()
            if not kind.startswith(("sensor", "analog")):
                c.reset()
            assert c.settled(0.02).complaints() == [], f"{kind} at {point} is over"
    assert seen > 0
