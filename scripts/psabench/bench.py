"""A bench ready for use: boards, instruments, probe and faults of an emulator, or of a laboratory with a real one.

    from psabench import Bench

    with Bench.start("calibrate") as bench:     # an emulator of ours; its time moves only when we say so
        bench.head.turn(90.0)                   # over SCPI
        bench.unit.stream(100).axis("x")        # over CAN: volts at the load, shape (100,)
        bench.run_until("DRD_A", count=3)

`Bench.connect` takes what is there, by address: any bus of python-can, instruments at VISA addresses, or the control
socket where the bench is an emulator, which tells its addresses. Boards are reached over CAN and instruments over SCPI
alone, so a script that uses nothing else runs on a real bench. What only an emulator can do (step pace, faults,
snapshots, the truth) goes through its control socket and raises BenchError, saying so, where there is none.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from can.interfaces.slcan import slcanBus

from psabench.boards.devices import identify, of_board
from psabench.boards.psa2.device import Psa2
from psabench.boards.registry import DBC_NODE
from psabench.boards.unit import Unit
from psabench.emulator import Emulator, Forked
from psabench.errors import BadInput, BenchError, ControlError, TimeOut, expected
from psabench.faults import Fault, Faults
from psabench.instruments import KINDS, Chamber, Head, Instrument, Supply, Table, open_instrument
from psabench.link.can_host import QUANTUM_S, CanHost, StepClock, WallClock, open_bus
from psabench.link.control import Control
from psabench.link.endpoints import FIRST, emulator_buses, emulator_endpoints, opening_order, scpi_addresses
from psabench.link.probe import Probe
from psabench.report import provenance
from psabench.status import GrowingFile, Status

NS = 1_000_000_000
SLICE_NS = NS  # long runs go in slices of simulated time, so that Ctrl-C is heard
SERIAL_SLICE_NS = NS // 20  # with slcan: a full pseudo-terminal stops time, and no one reads it while a slice runs
UNTIL_SLICE_NS = NS // 10  # of a wait for an event, which may never come
AWAY_SLICE_NS = 60 * NS  # no one receives meanwhile: they are as short
NONE = "none"  # as the CAN specification: no bus

Kind = TypeVar("Kind", bound=Instrument)
Board = TypeVar("Board", bound=Unit)


class Bench(AbstractContextManager["Bench"]):
    """A bench, made with `start`, `connect`, `restore` or `fork`; leaving its context closes everything."""

    def __init__(
        self,
        *,
        cans: Mapping[str, str | None],
        control: Path | None = None,
        truth: Path | None = None,
        scpi: Mapping[str, str] | None = None,
        node: int | None = None,
        emulator: Emulator | Forked | None = None,
    ) -> None:
        """See `connect`; cans: by name of the bus. `emulator` is ended when the bench is closed."""
        self.emulator = emulator
        self.truth_path = truth
        self.addresses = dict(scpi or {})
        self.between: Callable[[], None] = lambda: None  # after each slice of a wait; what it raises ends the wait
        self._specs = dict(cans)
        self._open: dict[str, Instrument] = {}
        with ExitStack() as stack:
            if emulator is not None:
                stack.callback(emulator.stop)
            self._control = stack.enter_context(Control(control)) if control else None
            self.hosts = {n: stack.enter_context(CanHost(open_bus(c), WallClock())) for n, c in cans.items()}
            self._stack = stack.pop_all()
        try:
            self.pace = "real" if self._control is None else str(self._control.call("time").result["pace"])
            self._clock = self._set_clock()
            self.units: dict[str, Unit] = self._find_units(node)
            self.faults = Faults(self)
            self.probe = Probe(self)
        except BaseException:
            self.close()
            raise

    # ---- making one

    @classmethod
    def start(
        cls,
        scenario: str | Path = "calibrate",
        *,
        pace: str = "step",
        seed: int | None = None,
        can: str = "socketcand:0",
        node: int | None = None,
        extra: Sequence[str | Path] = (),
    ) -> Bench:
        """Start an emulator with a scenario (name or file) and connect to all that it has.

        pace: "step" (time moves when we wait, as fast as it can) or "wall" (real time). can: psa-emu's own --can.
        extra: further arguments of psa-emu. Raises BadInput or BenchError with the emulator's own words.
        """
        emulator = Emulator(scenario, cans=[can], pace=pace, seed=seed, truth=True, scpi=True, extra=extra)
        return cls._of(emulator.__enter__(), node)

    @classmethod
    def restore(cls, path: str | Path, *, pace: str = "step", can: str = "socketcand:0") -> Bench:
        """Start an emulator from a snapshot. Raises BadInput for a file that is damaged or of another version."""
        emulator = Emulator(cans=[can], pace=pace, truth=True, scpi=True, extra=["--restore", path])
        return cls._of(emulator.__enter__())

    @classmethod
    def _of(cls, emulator: Emulator | Forked, node: int | None = None) -> Bench:
        """Of an emulator that runs: it is ended with the bench, or when there is none to be had."""
        try:
            cans = emulator_buses(emulator.endpoints, emulator.control_path)
        except BaseException:
            emulator.stop()
            raise
        return cls(
            cans=cans,
            control=emulator.control_path,
            truth=emulator.truth_path,
            scpi=scpi_addresses(emulator.endpoints),
            node=node,
            emulator=emulator,
        )

    @classmethod
    def connect(
        cls,
        can: str | Mapping[str, str] | None = None,
        *,
        control: str | Path | None = None,
        truth: str | Path | None = None,
        scpi: Mapping[str, str] | None = None,
        node: int | None = None,
    ) -> Bench:
        """Connect to a bench that is there, real or emulated.

        can: bus of python-can (see `can_host.open_bus`), several by the names of the buses, {"can0": ..., "can1": ...},
        or "none"; None: what the emulator behind `control` tells, without one python-can's own configuration.
        control, truth: sockets of an emulator. scpi: VISA addresses by instrument, {"head": "TCPIP::...::SOCKET"};
        for the others the emulator's own, if it has any.
        node: CANopen node of the unit (5); with a control socket the emulator tells which units there are.
        """
        unknown = set(scpi or {}) - set(KINDS)
        if unknown:
            raise BadInput(expected(", ".join(KINDS), ", ".join(sorted(unknown)), "scpi"))
        told = emulator_endpoints(Path(control)) if control else []
        one: Mapping[str, str | None]
        if can is None and control:
            one = emulator_buses(sorted(told, key=opening_order), Path(control))
        else:
            one = {} if can == NONE else {FIRST: can} if can is None or isinstance(can, str) else can
        return cls(
            cans=one,
            control=Path(control) if control else None,
            truth=Path(truth) if truth else None,
            scpi=scpi_addresses(told) | dict(scpi or {}),
            node=node,
        )

    def fork(self, *, can: str = "socketcand:0", seed: int | None = None) -> Bench:
        """A second bench that goes on from this very instant: the emulator forks, the copy gets doors of its own.

        seed: of the copy's noise from here on. Its units and their state stay: one of a batch of runs of a warm bench.
        """
        return Bench._of(Forked(self.control, can=can, seed=seed))

    def exchange_sensors(self, serial: int, unit: str | None = None) -> None:
        """Other quartz sensors on the board of a unit (the first): those with this number of its batch, as warm.

        From here on they are to the bit what they would be in a unit of that number. Raises BenchError for a unit whose
        sensors are of no batch.
        """
        self.control.call("unit.sensors", unit=unit or next(iter(self.units)), serial=serial)

    def close(self) -> None:
        """Close all connections and end the emulator if it is ours."""
        for instrument in self._open.values():
            with suppress(Exception):  # one that has gone must not keep the others open
                instrument.close()
        self._open.clear()
        self._stack.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    # ---- what there is

    @property
    def control(self) -> Control:
        """The emulator's control socket. Raises BenchError on a bench without one."""
        if self._control is None:
            raise BenchError("bench: no control socket; start psa-emu with --control")
        return self._control

    @property
    def host(self) -> CanHost:
        """This program's end of the first bus; `hosts` has all by name."""
        for host in self.hosts.values():
            return host
        raise BenchError("bench: connected without a CAN bus")

    @property
    def unit(self) -> Psa2:
        """The first PSA-2; other boards: `board`, or `units` by name."""
        return self.board(Psa2)

    def board(self, kind: type[Board], name: str | None = None) -> Board:
        """The first unit with such a board, `bench.board(Psd1)`, or the one of that name if it has."""
        if not self.units:
            raise BenchError("bench: no unit on the connected buses")
        if name is not None and name not in self.units:
            raise BenchError(expected(", ".join(self.units), name, "unit"))
        for unit in self.units.values() if name is None else [self.units[name]]:
            if isinstance(unit, kind):
                return unit
        what = ", ".join(f"{n}: {u.title}" for n, u in self.units.items())
        raise BenchError(
            expected(f"a {kind.title}", what if name is None else f"{name}: {self.units[name].title}", "unit")
        )

    @property
    def head(self) -> Head:
        return self._instrument("head", Head)

    @property
    def table(self) -> Table:
        return self._instrument("table", Table)

    @property
    def chamber(self) -> Chamber:
        return self._instrument("chamber", Chamber)

    @property
    def supply(self) -> Supply:
        return self._instrument("supply", Supply)

    def _instrument(self, name: str, kind: type[Kind]) -> Kind:
        """Opened when first asked for. Raises BenchError that says why there is none."""
        if name not in self.addresses:
            raise BenchError(f"bench: no {name}: {self._why_absent(name)}")
        if name not in self._open:
            self._open[name] = open_instrument(name, self.addresses[name], kind, self.wait)
            if self.pace == "step":
                self._open[name].lasts = self._rest_in_s
        found = self._open[name]
        assert isinstance(found, kind)
        return found

    def _rest_in_s(self, command: str, **args: object) -> float | None:
        """How long a motion will last yet, by the control socket; None: it does not end, or is not the emulator's."""
        rest_in_s = self._maybe(command, **args).get("rest_in_s")
        return None if rest_in_s is None else float(rest_in_s)

    def _why_absent(self, name: str) -> str:
        if self.emulator is not None:
            return f"the scenario has no section {name}"
        if self._control is not None:
            return f"psa-emu was started without --scpi {name}, and no address was given"
        return f"no address was given for it, as in scpi={{{name!r}: 'TCPIP::192.0.2.7::5025::SOCKET'}}"

    def _set_clock(self) -> WallClock | StepClock:
        """The clock of the bench, which its hosts go by."""
        hosts = list(self.hosts.values())
        clock: WallClock | StepClock = WallClock(hosts if len(hosts) > 1 else ())
        if self._control is not None and self.pace == "step":
            clock = StepClock(self._control, hosts)
        clock.between = lambda: self.between()
        for host in hosts:
            host.clock = clock
        return clock

    def _find_units(self, node: int | None) -> dict[str, Unit]:
        """By name, as the emulator tells them, if their bus is connected; a real bench has one, "a", which says itself
        what it is."""
        if not self.hosts:
            return {}
        if self._control is None:
            at = DBC_NODE if node is None else node
            return {"a": identify(self.host, at)(self.host, at)}
        units = self._control.call("units").result["units"]
        if node is not None:
            board = next((u.get("board", "psa2") for u in units if int(u["node"]) == node), "psa2")
            return {"a": of_board(board)(self.host, node)}
        one_bus = len({u.get("bus") for u in units}) == 1
        hosts = {u["name"]: self.host if one_bus else self.hosts.get(u["bus"]) for u in units}
        return {
            u["name"]: of_board(u.get("board", "psa2"))(host, int(u["node"]))
            for u in units
            if (host := hosts[u["name"]])
        }

    # ---- time

    @property
    def time_s(self) -> float:
        """Time of the bench, s: simulated since power-on in step pace, else this machine's."""
        return self._clock.now_s()

    def wait(self, dwell_s: float) -> None:
        """Let the bench's time pass, receiving meanwhile: simulated time in step pace, else real time."""
        if isinstance(self._clock, StepClock):
            self.run_for(dwell_s)
        elif self.hosts:
            self.host.advance(dwell_s)
        else:
            time.sleep(max(0.0, dwell_s))

    def run_for(self, dwell_s: float) -> None:
        """Move simulated time; in wall pace it goes by itself and this waits for it."""
        if not isinstance(self._clock, StepClock):
            self.wait(dwell_s)
            return
        for slice_s in slices_s(dwell_s, SERIAL_SLICE_NS if self._serial else SLICE_NS):
            self._clock.command(None, "run", for_s=slice_s)

    @property
    def step_clock(self) -> StepClock | None:
        """Of a bench in step pace whose frames are counted: its time may be moved ahead (`StepClock.start_run`)."""
        return self._clock if isinstance(self._clock, StepClock) and self._clock.in_bulk else None

    @property
    def _serial(self) -> bool:
        """Whether frames come through a serial line, which holds few of them."""
        return any(isinstance(h.bus, slcanBus) for h in self.hosts.values())

    def wait_away(self, dwell_s: float) -> None:
        """`wait`, but in step pace the buses are left: what passes on them is not received, so hours are soon over.

        What was received before is lost to whoever has not taken it; real time is spent receiving, as ever.
        """
        if not isinstance(self._clock, StepClock):
            self.wait(dwell_s)
            return
        self._clock.command(None, "run", for_s=0)  # what we have sent has arrived
        for host in self.hosts.values():
            host.close()
        for slice_s in slices_s(dwell_s, AWAY_SLICE_NS):
            self.control.call("run", for_s=slice_s)
        for name, host in self.hosts.items():
            host.reopen(open_bus(self._specs[name]))
        self._clock = self._set_clock()

    def catch_up(self) -> None:
        """After a command of the control socket that moves time itself, as bus.read: receive what has come."""
        if isinstance(self._clock, StepClock):
            self._clock.command(None, "run", for_s=0)

    def resync(self) -> None:
        """After another program has used this emulator: its time is where that program has brought it."""
        if isinstance(self._clock, StepClock):
            self._clock.resync()

    def step(self, count: int = 1) -> float:
        """To the count-th next whole millisecond of simulated time: the beat of a control loop; returns time_s."""
        period_ns = round(QUANTUM_S * NS)
        now_ns = round(self.time_s * NS)
        self.run_for(((now_ns // period_ns + count) * period_ns - now_ns) / NS)
        return self.time_s

    def run_until(self, event: str, count: int = 1, *, unit: str | None = None, limit_s: float = 60.0) -> float:
        """To the very instant of the count-th such event of a unit (the first unit); returns time_s.

        In step pace time stands still there; in wall pace this returns soon after it. Events: "DRD_A", "INT_FALL", ...;
        see docs/program.md. Raises TimeOut when it has not come within limit_s of the bench's time.
        """
        if isinstance(self._clock, StepClock):
            seen = self._run_to(self._clock, event, count, unit, limit_s)
        else:
            seen = self._watch(event, count, unit, limit_s)
        if seen < count:
            raise TimeOut(expected(f"{count} within {limit_s:g} s", seen, str(event)))
        return self.time_s

    def _run_to(self, clock: StepClock, event: str, count: int, unit: str | None, limit_s: float) -> int:
        """How many came, in slices: the last ends at the instant of the count-th."""
        of_unit = {} if unit is None else {"unit": unit}
        seen = 0
        for slice_s in slices_s(limit_s, SERIAL_SLICE_NS if self._serial else UNTIL_SLICE_NS) if limit_s else [0.0]:
            reply = clock.command(None, "run.until", event=event, count=count - seen, limit_s=slice_s, **of_unit)
            seen += int(reply.result.get("seen", 0))
            if seen >= count:
                break
        return seen

    def _watch(self, event: str, count: int, unit: str | None, limit_s: float) -> int:
        """`run_until` where time moves by itself: events as they come, on a connection of their own."""
        seen = 0
        deadline_s = time.monotonic() + limit_s
        with Control(self.control.path) as watcher:
            watcher.call("subscribe", what="events")
            first = unit or next(iter(self.units), None)
            while seen < count and (left_s := deadline_s - time.monotonic()) > 0.0:
                self.wait(0.0)
                self.between()
                came = watcher.next_event(min(left_s, 0.01))
                seen += came is not None and came["event"] == event and came.get("unit", first) == first
        return seen

    # ---- looking

    @contextmanager
    def trace(self, path: str | Path, unit: str | None = None) -> Iterator[Path]:
        """Record the lines of a unit (the first) as VCD while the block runs; yields the path."""
        self.probe.start(path, unit)
        try:
            yield Path(path)
        finally:
            self.probe.stop()

    def status(self) -> Status:
        """How the bench is, for a status bar or a log."""
        table = self._maybe("table.read", axis=1)
        chamber = self._maybe("chamber.read")
        counters = self._maybe("counters")
        return Status(
            time_s=self.time_s,
            pace=self.pace,
            angle_deg=table.get("angle_deg"),
            rate_dps=table.get("rate_dps"),
            temp_degc=chamber.get("temp_degc"),
            frames=sum(h.received for h in self.hosts.values()),
            late=counters.get("pace", {}).get("late"),
            lost=sum(u.frames.counters.lost for u in self.units.values()),
            files=tuple(
                GrowingFile(
                    kind=f["kind"],
                    size_bytes=int(f["bytes"]),
                    max_bytes=int(f.get("max_bytes", 0)),
                    error=f.get("error", ""),
                )
                for f in counters.get("files", ())
            ),
        )

    def _maybe(self, command: str, **args: object) -> dict[str, Any]:
        """The result of a command; empty where the bench has no such thing."""
        if self._control is None:
            return {}
        with suppress(ControlError):
            return self._control.call(command, **args).result
        return {}

    # ---- what graders read

    def truth(self) -> dict[str, Any]:
        """The hidden parameters of the bench: for graders alone, after the estimate is made."""
        truth = self._ask_truth("truth")
        if self.emulator is None:  # of one that was started, more is known
            provenance.note_bench(str(truth["scenario"]), int(truth["seed"]))
        return truth

    def truth_state(self, unit: str | None = None) -> dict[str, Any]:
        """True angles, specific force, rate, temperatures and supply of this instant: for graders alone."""
        return self._ask_truth("truth.state", **({} if unit is None else {"unit": unit}))

    def _ask_truth(self, command: str, **args: object) -> dict[str, Any]:
        if self.truth_path is None:
            raise BenchError("bench: no truth port; start psa-emu with --truth")
        with Control(self.truth_path) as port:
            return port.call(command, **args).result

    # ---- faults, snapshots

    def fault(self, kind: str, point: str, **args: object) -> Fault:
        """Plan a fault: bench.fault("sensor.bias", "a.sensor.x", bias_v=0.1, at_s=0.5). See `Faults.add`."""
        return self.faults.add(kind, point, **args)

    def snapshot(self, path: str | Path) -> Path:
        """Save the whole bench at this instant; `restore` goes on from there. Raises ControlError."""
        self.control.call("snapshot", path=os.path.abspath(path))
        return Path(path)


def slices_s(dwell_s: float, slice_ns: int) -> Iterator[float]:
    """A time in slices of a length, to the nanosecond; the last is what is left."""
    dwell_ns = round(dwell_s * NS)
    for begun_ns in range(0, dwell_ns, slice_ns):
        yield min(slice_ns, dwell_ns - begun_ns) / NS
