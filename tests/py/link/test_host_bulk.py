"""Frames and waits of the host in bulk: the same as one frame, one quantum of time after the other."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from typing import Any

import can
import pytest
from psabench.bench import Bench
from psabench.link import can_host
from psabench.link.can_host import StepClock, WallClock, open_bus

LINES = (
    *(f"< frame {k:03X} {k}.00{k % 10} {bytes(range(k % 9)).hex().upper()} >" for k in range(1, 60)),
    "< frame 12345678 1.5 01 >",
    "< error 20000004 2.5 >",
    "< nonsense >",
    "junk< frame 7FF 3.5 FF >",
)


@contextmanager
def served(pieces: Sequence[bytes]) -> Iterator[tuple[str, threading.Event]]:
    """A socketcand server, its address, and what lets it send these pieces."""
    opened = threading.Event()
    with closing(socket.create_server(("127.0.0.1", 0))) as server:

        def serve() -> None:
            for greeting in (True, False):
                peer, _ = server.accept()
                with peer:
                    peer.sendall(b"< hi >")
                    if greeting:
                        continue
                    for _ in range(2):
                        peer.recv(64)
                        peer.sendall(b"< ok >")
                    opened.wait(10)
                    for piece in pieces:
                        peer.sendall(piece)

        thread = threading.Thread(target=serve)
        thread.start()
        yield f"127.0.0.1:{server.getsockname()[1]}", opened
        thread.join(10)


def _all_of(bus: can.BusABC, opened: threading.Event) -> list[tuple[Any, ...]]:
    opened.set()
    with closing(can_host.CanHost(bus, WallClock())) as host:
        found: list[can.Message] = []
        host.listeners.append(found.append)
        while len(found) < 62 and host.receive(5.0):
            host.receive_taken()
    return [(m.timestamp, m.arbitration_id, bytes(m.data), m.dlc, m.is_extended_id, m.is_error_frame) for m in found]


@pytest.mark.parametrize("size", [1, 7, 1000, 1 << 20])
def test_frames_in_bulk_are_those_of_python_can(size: int, monkeypatch: pytest.MonkeyPatch) -> None:
    text = "".join(LINES).encode()
    with served([text[k : k + size] for k in range(0, len(text), size)]) as (at, opened):
        monkeypatch.setattr(can_host, "_hung_up", lambda _: False)
        bulk = _all_of(open_bus(f"socketcand:{at}"), opened)
    with served([text]) as (at, opened):
        host, _, port = at.partition(":")
        socket.create_connection((host, int(port))).close()
        one = _all_of(can.Bus(interface="socketcand", channel="can0", host=host, port=int(port)), opened)
    assert len(bulk) == 62
    assert bulk == one


def test_a_wait_in_bulk_ends_where_quantum_after_quantum_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Readings, instants and counters of a stream, and of waits that nothing comes to end."""
    seen = []
    for bulk in (True, False):
        with Bench.start("calibrate", seed=3) as bench:
            unit, clock = bench.unit, bench.host.clock
            assert isinstance(clock, StepClock)
            assert clock.in_bulk
            clock.in_bulk = bulk
            calls: list[str] = []
            call = bench.control.call

            def counted(name: str, *, calls: list[str] = calls, call: Any = call, **args: object) -> Any:
                calls.append(name)
                return call(name, **args)

            monkeypatch.setattr(bench.control, "call", counted)
            unit.wait_ready()
            got = []
            for count in (1, 16, 3):
                frames = unit.stream(count)
                got += [frames.t_rx_s.tolist(), frames.axis("x").tolist(), bench.time_s]
            came = bench.host.pump_until(lambda: False, 0.0123)
            got += [came, bench.time_s, unit.frames.counters, bench.host.received]
            seen.append((got, len(calls)))
    assert seen[0][0] == seen[1][0]
    assert seen[0][1] * 2 < seen[1][1]


def test_a_step_ahead_gives_each_step_its_own_frames() -> None:
    """Where the emulator has made two steps, the frames of the first are received, and none of the second."""
    steps_s = (0.010, 0.0007, 0.2, 0.003, 0.05, 0.02)
    seen = []
    for ahead in (False, True):
        with Bench.start("stream", seed=3) as bench:
            clock, came, counts = bench.step_clock, list[can.Message](), list[int]()
            assert clock is not None
            bench.unit.start()
            with bench.host.listeners.only(came.append):
                for pair in zip(steps_s[::2], steps_s[1::2], strict=True):
                    due = []
                    for step_s in pair if ahead else ():
                        clock.start_run(step_s)
                        due += clock.finish_run()
                    for k, step_s in enumerate(pair):
                        if ahead:
                            bench.host.receive_up_to(due[k])
                        else:
                            bench.run_for(step_s)
                        counts.append(len(came))
            seen.append(([(m.timestamp, bytes(m.data)) for m in came], counts, bench.time_s))
    assert seen[0] == seen[1]
    assert seen[0][1][-1] > 100
