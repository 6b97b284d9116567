"""The device under test: a board at the end of its wires, whether we started an emulator for it or it was there.

What a stimulus may do: send and receive on CAN, look at the lines, run cycles on the bus port, switch the supply, press
Res, and let time pass. Nothing here reads the emulator's truth or plans a fault.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Any

from psabench.bench import Bench
from psabench.boards.devices import of_board
from psabench.boards.registry import BOARDS
from psabench.boards.unit import Unit
from psabench.conform.capture.log import CanFrame, CanLog, Capture, LineLog, apart
from psabench.conform.probes import LineProbe, PinProbe, PortProbe
from psabench.conform.profile import Variant
from psabench.errors import BadInput, LinkError, expected
from psabench.link.busport import BusPort, Cycle
from psabench.link.can_host import CanHost, Message
from psabench.link.lineport import SAMPLE_HZ
from psabench.link.protocol_files import dbc_node

UNIT = "a"
SLICE_S = 0.1
HOSTLESS_SETUP_S = 0.3  # of a board that is not read: nothing tells that it is set up
# At the inputs of an emulator of ours: none is another's, one is negative, none is a round code.
INPUTS_V: Mapping[str, float] = {"x": 2.0101, "y": -1.3007, "z": 0.7003}
# Links of python-can whose time stamps are this machine's: they say when it looked, not when the frame passed.
BY_THE_HOST_S_CLOCK = tuple(
    "slcanBus SocketcanBus UdpMulticastBus LocalUdpBus CannelloniBus VirtualBus SerialBus".split()
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Addresses:
    """Where the board's wires end. can None: an emulator is started in lockstep, and everything else with it."""

    can: str | None = None
    lines: Path | None = None
    line_hz: float = SAMPLE_HZ
    bus_port: Path | None = None
    scpi: Mapping[str, str] = field(default_factory=dict)
    control: Path | None = None  # of an emulator: time moves in lockstep through it
    node: int | None = None
    inputs_v: Mapping[str, float] = field(default_factory=lambda: dict(INPUTS_V))  # volts at the inputs, held still
    adapter: str = "socketcand:0"  # of an emulator that we start
    port_only: bool = False  # of an emulator that we start: its line port instead of all pins


@dataclass(slots=True)
class Take:
    """What a stimulus collects while it runs."""

    frames: list[CanFrame] = field(default_factory=list)
    cycles: list[Cycle] = field(default_factory=list)
    marks: dict[str, float] = field(default_factory=dict)
    facts: dict[str, object] = field(default_factory=dict)
    lines: LineLog | None = None
    rate: float = 1.0  # seconds of the recorder's clock in one of the bench

    def on_message(self, m: Message) -> None:
        """Listener of a CanHost."""
        self.frames.append(CanFrame.of(m, m.timestamp * self.rate, bool(m.bitrate_switch) if m.is_fd else None))


class Dut:
    """See the module. `bench`, `unit` and `port` are for stimuli and active tests."""

    def __init__(
        self,
        bench: Bench,
        variant: Variant,
        probe: LineProbe | None,
        port: BusPort | None,
        inputs_v: Mapping[str, float],
        line_port: PortProbe | None = None,
    ) -> None:
        """inputs_v: what lies at the inputs while it is tested, as far as the user knows.

        line_port: the line port itself, whether or not `probe` looks through it.
        """
        self.line_port = line_port
        self.bench, self.variant, self.probe, self.port, self.inputs_v = bench, variant, probe, port, inputs_v
        kind = of_board(variant.board)
        found = next((u for u in bench.units.values() if isinstance(u, kind)), None)
        if found is None:
            there = ", ".join(u.title for u in bench.units.values()) or "none"
            raise BadInput(expected(f"a {kind.title} on this bus", there, "--can"))
        self.unit: Unit = found
        self.node = found.node.node_id
        self.allowed_ppm = 100.0  # how far the board's clocks and the recorder's may lie apart: a run says it
        self.recorder_rate = 1.0  # seconds of its clock in one of the bench; an emulator's may be set off
        self._stack = ExitStack()
        self._never_ready = False

    @property
    def host(self) -> CanHost:
        return self.unit.host

    @property
    def lockstep(self) -> bool:
        """Whether time moves only when we say so."""
        return self.bench.pace == "step"

    @property
    def probes(self) -> frozenset[str]:
        """What can be seen: can, line (INT, DATA, CLK, or what the line port has), pins (all lines), wires (of
        differential pairs, too), bus, supply, port.

        exact: all probes tell the time that the board's own clock would, were it not off.
        Of the link to the bus: fd and rtr, frames that it carries; stamps, its times are the bus's.
        """
        seen = {"can"}
        if self.probe is not None:
            seen |= {"line", "pins", "wires"} if isinstance(self.probe, PinProbe) else {"line"}
        if self.line_port is not None:
            seen.add("port")
        if self.port is not None:
            seen.add("bus")
        seen |= {"supply", "chamber", "head", "table"} & set(self.bench.addresses)
        seen |= self._of_the_link()
        if self.variant.figures.get("host_strobe_ns") != 0:
            seen.add("stream")  # readings come by themselves
        if self.lockstep:
            seen |= {"lockstep"} if self.recorder_rate != 1.0 else {"lockstep", "exact"}
        if self.inputs_v:
            seen.add("inputs")
        return frozenset(seen)

    def _of_the_link(self) -> set[str]:
        """What this link to the bus can carry and tell: FD frames, remote frames, time stamps of the bus itself."""
        kind = type(self.host.bus).__name__
        seen = {"fd", "rtr"} if kind != "SocketcandBus" else set()
        return seen if kind in BY_THE_HOST_S_CLOCK else seen | {"stamps"}

    def wait_ready(self) -> None:
        """Until readings come, or would if a host read them.

        Raises LinkError where they do not, but once: afterwards the board is looked at as it is, after the time that a
        set-up takes, so that one which never becomes ready is checked by what it does show.
        """
        if "stream" not in self.probes or self._never_ready:
            self.run_for(HOSTLESS_SETUP_S)
            return
        try:
            self.unit.wait_ready()
        except LinkError:
            self._never_ready = True
            raise

    @contextmanager
    def take(self, *, lines: bool = True) -> Iterator[Take]:
        """Collect what is seen while the block runs; its lines are there when it has ended."""
        take = Take(rate=self.recorder_rate)
        while not self.lockstep and self.host.receive(0.0):
            pass  # what came before is no part of it
        self.host.listeners.append(take.on_message)
        looking = lines and self.probe is not None
        try:
            if looking and self.probe is not None:
                self.probe.start()
            yield take
        finally:
            self.host.listeners.remove(take.on_message)
            if looking and self.probe is not None:
                take.lines = self.probe.stop().by_clock(self.recorder_rate)

    def slack_s(self, interval_s: float) -> float:
        """How far an interval may seem off, by clocks that differ."""
        return apart(interval_s, self.allowed_ppm)

    def capture(self, stimulus: str, take: Take) -> Capture:
        """Of a take that has ended."""
        return Capture(
            variant=self.variant,
            node=self.node,
            stimulus=stimulus,
            can=CanLog(frames=tuple(take.frames)),
            lines=take.lines,
            cycles=tuple(take.cycles),
            marks=dict(take.marks),
            facts=dict(take.facts),
            inputs_v=self.inputs_v,
            clock_ppm=self.allowed_ppm,
        )

    def run_for(self, dwell_s: float) -> None:
        """Let the board's time pass, receiving meanwhile.

        In lockstep in slices: what comes over a pseudo-terminal within one has to fit into the kernel's buffer.
        """
        while self.lockstep and dwell_s > SLICE_S:
            self.bench.wait(SLICE_S)
            dwell_s -= SLICE_S
        self.bench.wait(dwell_s)

    def power_cycle(self, off_s: float) -> None:
        """Off for off_s and on again. Raises BenchError where there is no supply."""
        self.bench.supply.output(False)
        self.run_for(off_s)
        self.bench.supply.output(True)

    def reset(self) -> None:
        """A pulse on Res, by NMT (which presses it: docs/reference/protocol.md)."""
        self.unit.reset()

    def close(self) -> None:
        self._stack.close()
        self.bench.close()

    def __enter__(self) -> Dut:
        return self

    def __exit__(self, kind: type[BaseException] | None, err: BaseException | None, tb: TracebackType | None) -> None:
        self.close()

    # ---- making one

    @classmethod
    def open(
        cls, variant: Variant, at: Addresses, *, seed: int = 1, clock_ppm: float = 0.0, recorder_ppm: float = 0.0
    ) -> Dut:
        """At these addresses, or an emulator of ours. Raises BadInput, LinkError or BenchError.

        Of an emulator of ours: clock_ppm, by how much the board's clocks are fast; recorder_ppm, by how much that of
        the probes is. Where a profile cannot have such a clock, that of the probes is slow by as much: from outside
        no one can tell the two.
        """
        if at.can is not None:
            return cls._connect(variant, at)
        own = has_clock(variant, clock_ppm)
        found = cls._start(variant, at, seed, clock_ppm if own else 0.0, still=bool(clock_ppm or recorder_ppm))
        found.recorder_rate = (1.0 + recorder_ppm * PPM) / (1.0 if own else 1.0 + clock_ppm * PPM)
        return found

    @classmethod
    def _connect(cls, variant: Variant, at: Addresses) -> Dut:
        node = dbc_node(variant.family) if at.node is None else at.node
        bench = Bench.connect(at.can, control=at.control, scpi=at.scpi, node=node)
        with ExitStack() as stack:
            stack.callback(bench.close)
            probe = None if at.lines is None else PortProbe(at.lines, variant.family, at.line_hz)
            port = None if at.bus_port is None else stack.enter_context(BusPort(at.bus_port))
            dut = cls(bench, variant, probe, port, at.inputs_v, probe)
            if port is not None:
                dut._stack.callback(port.close)
            stack.pop_all()
        return dut

    @classmethod
    def _start(cls, variant: Variant, at: Addresses, seed: int, clock_ppm: float, *, still: bool) -> Dut:
        with ExitStack() as stack:
            folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="psabench-")))
            path = folder / "bench.yaml"
            made = scenario(variant, at.inputs_v, clock_ppm, still=still)
            path.write_text(json.dumps(made), encoding="utf-8")  # YAML, too
            line, bus = folder / "line", folder / "bus"
            extra: list[str | Path] = ["--vcd-unit", "1"]
            extra += ["--line", line]  # which samples nothing while no one has it open
            extra += ["--bus-port", f"{UNIT}:{bus}"] if BOARDS[variant.family].bus else []
            bench = Bench.start(path, seed=seed, can=at.adapter, extra=extra)
            stack.callback(bench.close)
            probe: LineProbe
            line_port = PortProbe(line, variant.family)
            if at.port_only:
                probe = line_port
            else:
                probe = pins = PinProbe(bench, UNIT)
                stack.callback(pins.close)
            port = stack.enter_context(BusPort(bus, advance=bench.wait)) if BOARDS[variant.family].bus else None
            inputs_v = at.inputs_v if BOARDS[variant.family].has_inputs else {}
            dut = cls(bench, variant, probe, port, inputs_v, line_port)
            dut._stack = stack.pop_all()
        return dut


SENSITIVITIES = ("kx_v_per_g", "ky_v_per_g", "kz_v_per_g", "kxy_v_per_g2", "drift_v_per_s", "reading_noise_v")
PPM = 1e-6
ASKEW_ARCSEC = [500, -1000, 0]  # of a board on a table: what its three gyros see of a turn differs
# What a gyro unit is on: the platform without errors, as it was left; the PSA-2 that measures its level.
PLATFORM: Mapping[str, Any] = {
    "site": {"latitude_deg": 50.0},
    "platform": {"alpha0_deg": -33.0, "beta0_deg": 0.5, "gm_sigma_degph": 0.0},  # 0.2 deg/h are 0.04 over a run
    "vehicle": {"heading_deg": 40.0},
}
LEVEL_SETUP = [  # 250 words a second, else as the article sets it up (proto/scenarios/gyrocompass.yaml)
    "DRD_A write_A 41 00 46",
    "DRD_T write_T 50 00 02",
    "DRD_T write_T 50 00 04",
    "DRD_T write_T 53 00 82",
    "DRD_T sync_T",
    "DRD_A sync_A",
]
LEVEL: Mapping[str, Any] = {
    "name": "level",
    "board": "psa2",
    "on": "platform",
    "adc_chain": "direct",
    "profile_set": {"setup": LEVEL_SETUP},
    "axes": {a: {"sensor": "quartz", "afe": {"input": "current", "load_ohm": 937.5}} for a in "xy"},
}


def has_clock(variant: Variant, clock_ppm: float) -> bool:
    """Whether a profile of this board can have clocks that are fast by as much."""
    board = BOARDS[variant.family]
    return bool(board.clocks) and not (clock_ppm > 0.0 and board.clock_at_limit)


def scenario(
    variant: Variant, inputs_v: Mapping[str, float], clock_ppm: float, *, still: bool = False
) -> dict[str, Any]:
    """A bench around one board: known volts at its inputs, a supply that can be switched.

    clock_ppm: by how much the board's clocks are fast; still: the specimen's crystal adds nothing to it. A gyro unit
    has no inputs: it has its platform, on a parked vehicle, and the PSA-2 on it that it reads the level from. A
    receiver has none, either: it is at the bench's site.
    """
    axes = {axis: {"sensor": "mems", "u0_v": v, **dict.fromkeys(SENSITIVITIES, 0.0)} for axis, v in inputs_v.items()}
    unit: dict[str, Any] = {"name": UNIT, "board": variant.family, "profile": variant.profile, "axes": axes}
    board = BOARDS[variant.family]
    clocks: dict[str, float] = {board.crystal: 0.0} if still and board.crystal else {}
    if clock_ppm:
        clocks |= {key: _off(key, variant[key], clock_ppm) for key in board.clocks}
    if clocks:
        unit["profile_set"] = clocks
    if not board.has_inputs:
        del unit["axes"]
    if board.on_platform:
        return {"supply": {}, "start": True, **PLATFORM, "units": [unit | {"level": LEVEL["name"]}, LEVEL]}
    around: dict[str, Any] = {"chamber": {}} if board.has_thermometer else {}
    if board.on_table:
        unit["on"], around["table"] = "table", {}
        unit["misalignment_arcsec"] = ASKEW_ARCSEC
    if board.overdrive_v_per_g and "x" in axes:  # nothing at 0 deg; beyond full scale at -90 deg
        axes["x"]["kx_v_per_g"], around["head"] = board.overdrive_v_per_g, {}
    return {"supply": {}, **around, "units": [unit]}


def _off(key: str, nominal: float, clock_ppm: float) -> int:
    """A whole number that is off by as much, not more; a time by an even number of ns, for it may be halved."""
    factor = 1.0 + clock_ppm * PPM
    if key.endswith("_ns"):
        return round(nominal) + 2 * int((nominal / factor - nominal) / 2)
    return round(nominal) + int(nominal * factor - nominal)
