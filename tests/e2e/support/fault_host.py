"""A host that knows only the protocol: what it sees on CAN in a while of simulated time, per board."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from psabench.boards.devices import of_board
from psabench.boards.unit import Unit
from psabench.emulator import Emulator
from psabench.link.can_host import CanHost, Message, StepClock, open_bus
from psabench.link.control import Control
from rig import bus_spec

Floats = NDArray[np.float64]

VOLTS = 10.0 / 2**23  # a code, protocol page
STAMP_S, STAMPS = 4e-6, 1 << 16  # TSTAMP of PSA2_ZT
PERIOD_S = 1e-3
XY, ZT, EMCY, HEARTBEAT = 0x180, 0x280, 0x080, 0x700  # identifiers of node 0
ACCEL_PORT, TEMP_PORT = 0xFF01, 0xFF02  # EMCY codes
SETTLE_S = 0.08  # 63 data periods and some
SETUP_S = 0.26  # from Res to settled frames, four temperature channels included


def number(data: bytes) -> int:
    return int.from_bytes(data, "little")


def signed(data: bytes) -> int:
    return int.from_bytes(data, "little", signed=True)


@dataclass(frozen=True, slots=True)
class Seen:
    """What a node sent: halves of samples in order of arrival, emergencies, boot-ups; and error frames of the bus."""

    xy: list[tuple[float, int, int, int]]  # t_s, SEQ, X, Y
    zt: list[tuple[float, int, int, int, int]]  # t_s, Z, T, status and channel, TSTAMP
    emcy: list[int]
    boots: int
    errors: list[Message]
    repeated: int  # messages that are the one before them, byte for byte
    halves: str  # x for PSA2_XY, z for PSA2_ZT, in order of arrival

    def volts(self, axis: int) -> Floats:
        """Of the axis, sample by sample."""
        codes = [h[2 + axis] for h in self.xy] if axis < 2 else [h[1] for h in self.zt]
        return np.array(codes, float) * VOLTS

    def mean_v(self, axis: int, last: int = 20) -> float:
        assert len(self.xy) >= last, f"{len(self.xy)} samples came"
        return float(self.volts(axis)[-last:].mean())

    def seq(self) -> list[int]:
        return [h[1] for h in self.xy]

    def stamps_s(self) -> Floats:
        """Instants of the samples, s, unwrapped."""
        ticks = np.array([h[4] for h in self.zt])
        return np.concatenate([[0], np.cumsum(np.diff(ticks) % STAMPS)]) * STAMP_S

    def latency_s(self) -> Floats:
        """From the sample to the arrival of its second half."""
        return np.array([(h[0] - h[4] * STAMP_S) % (STAMPS * STAMP_S) for h in self.zt])

    def temperatures(self) -> dict[int, list[int]]:
        """New codes by channel."""
        found: dict[int, list[int]] = {}
        for _, _, code, status, _ in self.zt:
            if status & 8:
                found.setdefault(status >> 4, []).append(code)
        return found

    def temperature_period_s(self) -> float:
        """From one new temperature code to the next, on average."""
        new = [i for i, half in enumerate(self.zt) if half[3] & 8]
        return float(np.diff(self.stamps_s()[new]).mean())

    def clipped(self) -> bool:
        return any(h[3] & 2 for h in self.zt)

    def complaints(self) -> list[str]:
        """What the protocol does not allow in an undisturbed stream."""
        said = []
        seq = np.array(self.seq())
        if len(seq) < 5 or len(self.zt) < 5:
            return ["no stream"]
        steps = np.diff(seq) % (1 << 16)
        if (steps != 1).any():
            said.append("numbers")
        if "xx" in self.halves or "zz" in self.halves:
            said.append("halves")
        if (np.abs(np.diff(self.stamps_s()) - PERIOD_S) > 1.5 * STAMP_S).any():
            said.append("instants")
        if self.repeated:
            said.append("repeated")
        if self.errors:
            said.append("errors")
        for axis in range(3):
            v = self.volts(axis)
            if (np.abs(v - np.median(v)) > 0.05).any():
                said.append(f"codes of {'xyz'[axis]}")
        return said


class Host:
    """A bench in step pace whose boards stream, with everything that passes on the bus kept."""

    def __init__(self, emulator: Emulator, control: Control, bus: CanHost) -> None:
        self.emulator, self.control, self.bus = emulator, control, bus
        self.units: dict[str, Unit] = {}
        self.node: dict[str, int] = {}
        for unit in control.call("units").result["units"]:
            self.node[unit["name"]] = int(unit["node"])
            self.units[unit["name"]] = of_board(unit["board"])(bus, int(unit["node"]))
        self._kept: list[Message] = []
        bus.listeners.append(self._kept.append)
        self.start()

    def start(self) -> None:
        """NMT start for all."""
        self.bus.send(0x000, bytes((1, 0)))

    def reset(self, unit: str) -> None:
        """NMT reset node: a pulse on Res; then start."""
        self.bus.send(0x000, bytes((0x81, self.node[unit])))
        self.bus.advance(0.002)
        self.start()

    def watch(self, unit: str, dwell_s: float) -> Seen:
        """Let time pass; what came meanwhile."""
        self._kept.clear()
        self.bus.advance(dwell_s)
        return self.seen(unit)

    def seen(self, unit: str) -> Seen:
        """What has come since the last `watch` began."""
        node = self.node[unit]
        mine = [
            (m.timestamp, m.arbitration_id - node, bytes(m.data))
            for m in self._kept
            if not m.is_error_frame and m.arbitration_id & 0x7F == node
        ]
        return Seen(
            xy=[(t, number(d[6:8]), signed(d[0:3]), signed(d[3:6])) for t, i, d in mine if i == XY],
            zt=[(t, signed(d[0:3]), signed(d[3:5]), d[5], number(d[6:8])) for t, i, d in mine if i == ZT],
            emcy=[number(d[0:2]) for _, i, d in mine if i == EMCY],
            boots=sum(i == HEARTBEAT and d == b"\0" for _, i, d in mine),
            errors=[m for m in self._kept if m.is_error_frame],
            repeated=sum(a[1:] == b[1:] for a, b in pairwise(mine)),
            halves="".join({XY: "x", ZT: "z"}.get(i, "") for _, i, _ in mine),
        )

    def turn(self, angle_deg: float) -> None:
        self.control.call("head.turn", angle_deg=angle_deg)

    def add(self, kind: str, point: str, **args: object) -> int:
        return int(self.control.call("fault.add", kind=kind, point=point, **args).result["id"])

    def clear(self, number: int) -> None:
        self.control.call("fault.clear", id=number)

    def call(self, command: str, **args: object) -> Mapping[str, Any]:
        return self.control.call(command, **args).result


@contextmanager
def fault_host(scenario: Path, *extra: str | Path, settle: bool = True) -> Iterator[Host]:
    """An emulator with a host on its bus, set up and streaming."""
    with (
        Emulator(scenario, pace="step", extra=extra) as emulator,
        Control(emulator.control_path or Path()) as control,
        CanHost(open_bus(bus_spec(emulator.endpoints[0])), StepClock(control)) as bus,
    ):
        host = Host(emulator, control, bus)
        if settle:
            bus.advance(SETUP_S)
        yield host
