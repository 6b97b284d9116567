"""A run over the wire as a recording, whatever the procedure: its frames in a CAN log, what the program did beside it.

`BenchRecorder` and `RecordedBench` are as much of a `Bench` as a procedure asks for that uses units and time alone.
Units send and receive through hosts that write down each request, each step of time, and how many frames had come by
then. On replay the same code makes the same requests, and gets the recorded frames at the same places. Instants are
rounded to a microsecond in both, and time moves with the calls, so that the results are the same to the last bit.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any, Protocol, TypeVar

import can

from psabench.bench import Bench
from psabench.boards.devices import of_board
from psabench.boards.unit import Unit
from psabench.errors import BadInput, BenchError, expected
from psabench.link.can_host import CanHost
from psabench.link.listeners import Listeners
from psabench.logs.call_log import END, SETUP, Calls, CallWriter, check_ending
from psabench.logs.formats import KEEPS, read_frames
from psabench.report.provenance import noted_scenarios

STAMP_DIGITS = 6  # of a second: what all formats keep that keep instants
Board = TypeVar("Board", bound=Unit)


class _Teller(Protocol):
    """Who writes calls down, or has them. bus: its number."""

    @property
    def time_s(self) -> float: ...
    def send_frame(
        self, bus: int, frame: str, host: CanHost | None, args: tuple[Any, ...], how: Mapping[str, Any]
    ) -> None: ...
    def receive_frame(self, bus: int, host: CanHost | None, timeout_s: float) -> bool: ...
    def advance_time(self, bus: int, host: CanHost | None, dwell_s: float) -> None: ...


class _Host(CanHost):
    """A program's end of a bus whose calls go through a recorder or a recording; inner: None on replay."""

    def __init__(self, teller: _Teller, bus: int, inner: CanHost | None) -> None:  # no link: the base's is not made
        self._teller, self._number, self._inner = teller, bus, inner
        self.clock = self  # type: ignore[assignment]
        self.listeners = Listeners()

    def now_s(self) -> float:
        """As of the last call."""
        return self._teller.time_s

    def send(self, can_id: int, data: bytes, *, fd: bool = False, remote: bool = False) -> None:
        how = {name: True for name, on in (("fd", fd), ("remote", remote)) if on}
        frame = " ".join([f"{can_id:03X}#{bytes(data).hex().upper()}", *how])
        self._teller.send_frame(self._number, frame, self._inner, (can_id, data), how)
        self.echo_nmt(can_id, data)

    def receive(self, timeout_s: float) -> bool:
        return self._teller.receive_frame(self._number, self._inner, timeout_s)

    def advance(self, dwell_s: float) -> None:
        self._teller.advance_time(self._number, self._inner, dwell_s)

    def pass_on(self, message: can.Message) -> None:
        """A frame has come."""
        self.listeners.hand_on(message)

    def close(self) -> None:
        """The bench closes its own."""


class _Units:
    """Units on hosts of ours, and how a procedure finds them."""

    units: dict[str, Unit]

    def board(self, kind: type[Board]) -> Board:
        """The first unit with such a board."""
        for unit in self.units.values():
            if isinstance(unit, kind):
                return unit
        raise BenchError(expected(f"a {kind.title}", ", ".join(u.title for u in self.units.values()), "unit"))


class BenchRecorder(_Units, AbstractContextManager["BenchRecorder"]):
    """A bench whose frames and calls are stored. The units of `bench` itself hear nothing meanwhile."""

    def __init__(self, bench: Bench, path: Path, setup: Mapping[str, Any]) -> None:
        """setup: `procedure`, `facts` and what else the replay needs. Raises BadInput, OutputError."""
        check_keeps(path, len(bench.hosts))
        self._bench = bench
        self._hosts = {inner: _Host(self, k, inner) for k, inner in enumerate(bench.hosts.values())}
        self.units = {name: of_board(u.board)(self._hosts[u.host], u.node.node_id) for name, u in bench.units.items()}
        self._calls = CallWriter(path)
        for k, (inner, host) in enumerate(self._hosts.items()):
            inner.listeners = Listeners()
            inner.listeners.append(_Keeper(self, k, host))
        buses = list(bench.hosts.values())
        units = [[n, u.board, u.node.node_id, buses.index(u.host)] for n, u in bench.units.items()]
        self._store_call(
            SETUP, json.dumps({**setup, "buses": len(buses), "units": units, "scenarios": noted_scenarios()})
        )

    def keep_frame(self, bus: int, host: _Host, message: can.Message) -> None:
        """A frame that has come, into the log and to the unit."""
        message.timestamp = round(message.timestamp, STAMP_DIGITS)
        message.channel = bus
        self._calls.keep_frame(message)
        host.pass_on(message)

    def _store_call(self, call: str, argument: str) -> None:
        self._calls.store_call(call, argument, "", self._bench.time_s)

    @property
    def time_s(self) -> float:
        """As of the last call: what the recording knows."""
        return self._calls.t_s

    def wait(self, dwell_s: float) -> None:
        self._bench.wait(dwell_s)
        self._store_call("wait", repr(float(dwell_s)))

    def wait_away(self, dwell_s: float) -> None:
        self._bench.wait_away(dwell_s)
        self._store_call("wait_away", repr(float(dwell_s)))

    def send_frame(
        self, bus: int, frame: str, host: CanHost | None, args: tuple[Any, ...], how: Mapping[str, Any]
    ) -> None:
        assert host is not None
        host.send(*args, **how)
        self._store_call("send", f"{bus} {frame}")

    def receive_frame(self, bus: int, host: CanHost | None, timeout_s: float) -> bool:
        assert host is not None
        came = host.receive(timeout_s)
        if came:
            self._store_call("receive", str(bus))
        return came

    def advance_time(self, bus: int, host: CanHost | None, dwell_s: float) -> None:
        assert host is not None
        host.advance(dwell_s)
        self._store_call("advance", f"{bus} {dwell_s!r}")

    def __exit__(self, kind: type[BaseException] | None, *rest: Any) -> None:
        for inner in self._hosts:
            inner.listeners = Listeners()
        self._calls.__exit__(kind, *rest)


class _Keeper:
    """Listener of a host of the bench."""

    def __init__(self, recorder: BenchRecorder, bus: int, host: _Host) -> None:
        self._recorder, self._bus, self._host = recorder, bus, host

    def __call__(self, message: can.Message) -> None:
        self._recorder.keep_frame(self._bus, self._host, message)


class RecordedBench(_Units):
    """A bench whose units answer as they did in a recording. Without a truth, faults or instruments."""

    pace = "real"
    truth_path = None

    def __init__(self, path: Path) -> None:
        """Raises BadInput for a log or calls that are missing, cut, damaged or do not belong together."""
        self._calls = Calls(path)
        self.setup = self._calls.setup
        self._buses, units = self._read_setup()
        check_keeps(path, self._buses)
        self._frames = [m for m in read_frames(path) if not m.is_error_frame]
        self._calls.check_frames(len(self._frames))
        self._given = 0
        self._hosts = [_Host(self, k, None) for k in range(self._buses)]
        self.units = {name: of_board(board)(self._hosts[bus], node) for name, board, node, bus in units}

    def _read_setup(self) -> tuple[int, list[tuple[str, str, int, int]]]:
        try:
            buses = int(self.setup["buses"])
            units = [(str(name), str(board), int(node), int(bus)) for name, board, node, bus in self.setup["units"]]
            for _, board, _, bus in units:
                of_board(board)
                _ = range(buses)[bus]
        except (ValueError, KeyError, TypeError, IndexError) as e:
            raise self._calls.no_setup() from e
        return buses, units

    @property
    def time_s(self) -> float:
        return self._calls.t_s

    def _make_call(self, call: str, argument: str) -> None:
        """The same call, and the frames that came meanwhile."""
        self._calls.next_call(call, argument)
        while self._given < self._calls.frames:
            message = self._frames[self._given]
            self._given += 1
            bus = can.util.channel2int(message.channel) or 0 if self._buses > 1 else 0
            if bus >= self._buses:
                raise BadInput(expected(f"frames of {self._buses} buses", message.channel, self._calls.where))
            self._hosts[bus].pass_on(message)

    def wait(self, dwell_s: float) -> None:
        self._make_call("wait", repr(float(dwell_s)))

    def wait_away(self, dwell_s: float) -> None:
        self._make_call("wait_away", repr(float(dwell_s)))

    def send_frame(
        self, bus: int, frame: str, host: CanHost | None, args: tuple[Any, ...], how: Mapping[str, Any]
    ) -> None:
        self._make_call("send", f"{bus} {frame}")

    def receive_frame(self, bus: int, host: CanHost | None, timeout_s: float) -> bool:
        if not self._calls.comes_next("receive", str(bus)):
            return False
        self._make_call("receive", str(bus))
        return True

    def advance_time(self, bus: int, host: CanHost | None, dwell_s: float) -> None:
        self._make_call("advance", f"{bus} {dwell_s!r}")

    def end_run(self) -> None:
        """The run ends where it ended. Raises BadInput."""
        self._make_call(END, "")


def check_keeps(path: Path, buses: int) -> None:
    """Results of such a run depend on instants, and on the bus. Raises BadInput with what the format does not keep."""
    check_ending(path)
    needed = ["time stamps", *(["channels"] if buses > 1 else [])]
    missing = [what for what in needed if what not in KEEPS[path.suffix.lower()]]
    if missing:
        good = " ".join(e for e, kept in KEEPS.items() if set(needed) <= set(kept))
        raise BadInput(expected(f"a format that keeps {' and '.join(missing)} ({good})", path.suffix, path))
