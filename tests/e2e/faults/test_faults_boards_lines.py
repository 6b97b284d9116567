"""Every fault of a line at every line of the other boards.

What lines show is compared with a recording of the same bench without the fault: a fault of a line changes that line
and nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from fault_boards import ACCEPTED, SCENARIO, SETUP_S
from fault_case import must_accept, near
from fault_host import Host, fault_host
from psabench.link.vcd import Vcd, read_vcd

pytestmark = pytest.mark.host

RECORD_S = 0.05


def record(host: Host, unit: str) -> Vcd:
    path = host.emulator.directory / "lines.vcd"
    host.call("vcd.start", path=str(path), unit=unit)
    host.bus.advance(RECORD_S)
    host.call("vcd.stop")
    return read_vcd(path)


@cache
def healthy(unit: str) -> Vcd:
    """The same bench with no fault, at the same instant: what a fault of a line is compared with."""
    with fault_host(SCENARIO) as host:
        host.bus.advance(SETUP_S)
        return record(host, unit)


def line_case(kind: str, unit: str, names: list[str], **args: object) -> tuple[Vcd, Vcd]:
    """Recordings of a unit without and with a fault of some lines; the others are the same."""
    with fault_host(SCENARIO) as host:
        host.bus.advance(SETUP_S)
        for name in names:
            host.add(kind, f"{unit}.line.{name}", **args)
        wrong = record(host, unit)
    right = healthy(unit)
    for other, wire in right.wires.items():
        if other not in names:
            assert np.array_equal(wire.t_ns, wrong.wires[other].t_ns), other
    return right, wrong


def differ(right: Vcd, wrong: Vcd, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Instants at which either recording of a line has an edge, and whether the two differ from there on."""
    at_ns = np.unique(np.concatenate([right.wires[name].t_ns, wrong.wires[name].t_ns]))
    return at_ns, right.wires[name].at(at_ns) != wrong.wires[name].at(at_ns)


def line_stuck(unit: str, names: list[str]) -> None:
    for level in (0, 1):
        _, wrong = line_case("line.stuck", unit, names, level=("low", "high")[level])
        at_ns = np.arange(wrong.start_ns, wrong.end_ns, 99_991)
        for name in names:
            assert (wrong.wires[name].at(at_ns) == level).all(), name


def line_swapped(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.swapped", unit, names)
    for name in names:
        assert differ(right, wrong, name)[1].all(), name


def line_open(unit: str, names: list[str]) -> None:
    raise AssertionError(f"{names} of {unit} are no differential pairs")


def line_glitch(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.glitch", unit, names, width_ns=150)
    for name in names:
        at_ns, other = differ(right, wrong, name)
        edges = np.flatnonzero(np.diff(other.astype(int), prepend=0))
        assert len(edges) == 2, name
        assert at_ns[edges[1]] - at_ns[edges[0]] == 150, name


def line_noise(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.noise", unit, names, rate_hz=2000, width_ns=100)
    for name in names:
        other = differ(right, wrong, name)[1]
        assert 40 < np.count_nonzero(np.diff(other.astype(int)) == 1) < 200, f"100 are due on {name}"


def pulses(v: Vcd, name: str) -> int:
    return len(v.wires[name].edges_ns(1))


FRAMES = {"d": "RFX", "m": "MUX1"}  # whose falls begin a frame


def line_missing_pulse(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.missing_pulse", unit, names, pulse=3)
    frames = len(right.wires[FRAMES[unit]].edges_ns(0))
    near(pulses(right, names[0]) - pulses(wrong, names[0]), frames, 1)


def line_extra_pulse(unit: str, names: list[str]) -> None:
    right, wrong = line_case("line.extra_pulse", unit, names, pulse=3, width_ns=100)
    frames = len(right.wires[FRAMES[unit]].edges_ns(0))
    near(pulses(wrong, names[0]) - pulses(right, names[0]), frames, 1)


DETECT_LINE: dict[str, Callable[[str, list[str]], None]] = {
    "line.stuck": line_stuck,
    "line.swapped": line_swapped,
    "line.open": line_open,
    "line.glitch": line_glitch,
    "line.noise": line_noise,
    "line.missing_pulse": line_missing_pulse,
    "line.extra_pulse": line_extra_pulse,
}


def test_each_kind_is_looked_for() -> None:
    with fault_host(SCENARIO, settle=False) as host:
        kinds = {k["kind"] for k in host.call("fault.kinds")["kinds"]}
    assert {k for k in kinds if k.startswith("line.")} == set(DETECT_LINE)


@cache
def lines(unit: str) -> list[str]:
    with fault_host(SCENARIO, settle=False) as host:
        points = host.call("fault.points")["points"]
    return [p.rpartition(".")[2] for p in points if p.startswith(f"{unit}.line.")]


@pytest.mark.parametrize("kind", DETECT_LINE)
@pytest.mark.parametrize("unit", "dmp")
def test_a_fault_of_a_line_is_in_the_recording_and_nowhere_else(unit: str, kind: str) -> None:
    names = [name for name in lines(unit) if must_accept(ACCEPTED, kind, f"{unit}.line.{name}")]
    for some in (names[::2], names[1::2]):  # the others stay as they are
        if some:
            DETECT_LINE[kind](unit, some)
