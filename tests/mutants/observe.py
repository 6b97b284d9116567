"""What can be seen of an emulator on its wires, as one number: two that give the same are not told apart here.

A fixed row of runs: power, set-up, every object read and written, states, forms, SYNC, registers on the bus, inputs out
of range. The random mutants that change nothing of all this count as equivalent.

    python -m tests.mutants.observe psa2 psd1:psd1_host      prints a number for each
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Callable, Iterator
from contextlib import suppress

from psabench.conform.capture.log import LineLog
from psabench.conform.dut import Addresses, Dut, Take
from psabench.conform.profile import variant
from psabench.conform.raw_can import Talk, read, segment, talk, write
from psabench.conform.verdict import Failed, Inconclusive
from psabench.errors import BenchError, TimeOut

from tests.mutants.declared import Target

BEYOND_V = {"x": 10.0, "y": -10.0, "z": 9.99}
NMT = (0x01, 0x02, 0x03, 0x80, 0x01, 0x82, 0x01, 0x81)
MODE_OF_GYRO, SELF_TEST = 0x2100, 0x210B
SIZES = (b"\x01", b"\x00\x00", b"\x02\x00\x00", b"\x01\x00\x00\x00", b"\xff\xff\xff\xff", b"\x00" * 4)


class Sum:
    """Of all that was seen."""

    def __init__(self, *, stamps: bool = True) -> None:
        """stamps: the adapter tells the time of the bus; else that of this machine, which never comes again."""
        self._hash, self._stamps = hashlib.sha256(), stamps

    def add(self, *what: object) -> None:
        self._hash.update(repr(what).encode())

    def take(self, take: Take) -> None:
        """Frames, lines, cycles."""
        for f in take.frames:
            self.add(round(f.t_s * 1e9) if self._stamps else 0, f.can_id, f.data, f.fd, f.error)
        self.lines(take.lines)

    def lines(self, log: LineLog | None) -> None:
        if log is None:
            return
        for name in sorted(log.recording.wires):
            wire = log.recording.wires[name]
            self._hash.update(name.encode() + wire.t_ns.tobytes() + wire.level.tobytes())

    def hex(self) -> str:
        return self._hash.hexdigest()


def _entries(s: Dut) -> list[tuple[int, int]]:
    return [(d.index, d.sub) for d in s.unit.node.objects()]


def _requests(s: Dut) -> Iterator[bytes]:
    """Each object read, written in every size, read again; what is no object; transfers in segments."""
    for index, sub in [*_entries(s), (0x5FFF, 0), (0x1018, 9)]:
        yield read(index, sub)
        yield segment(0x00)
        yield segment(0x10)
        for data in SIZES:
            yield write(index, sub, data)
        yield read(index, sub)
    yield from (bytes([command]) + bytes(7) for command in (0x21, 0x00, 0x01, 0xA0, 0xE0, 0x80, 0x10))


def _talk(s: Dut, total: Sum) -> None:
    with talk(s) as t:
        for request in _requests(s):
            with suppress(Failed, Inconclusive):
                total.add(request, t.ask(request))
        total.add([f.data for f in t.heard])


def _states(s: Dut, total: Sum) -> None:
    with s.take() as take, talk(s) as t:
        for command in NMT:
            t.nmt(command)
            t.send(t.sync_id, b"")
            s.run_for(0.03)
            t.send(t.sync_id, b"\x05")
            s.run_for(0.01)
    total.take(take)


def _stream(s: Dut, total: Sum) -> None:
    """Each form (a PSA-2's), transmission type and way of sampling, with SYNCs between."""
    with talk(s) as t:
        t.nmt(0x01)
        s.run_for(0.2)
        for index, sub, value in [(0x1800, 2, 0), (0x1800, 2, 2), (0x1800, 2, 254), (0x1800, 3, 30), (0x1800, 3, 0)]:
            _set(t, total, index, sub, value, 1 if sub == 2 else 2)
            _look(s, t, total)
        for index, value in [(0x2020, 1), (0x2020, 2), (0x2020, 3), (0x2020, 0), (0x2022, 1), (0x2022, 2), (0x2022, 0)]:
            _set(t, total, index, 0, value, 1)
            _look(s, t, total)


def _set(t: Talk, total: Sum, index: int, sub: int, value: int, size: int) -> None:
    with suppress(Failed, Inconclusive):
        total.add(t.ask(write(index, sub, value.to_bytes(size, "little"))))


def _look(s: Dut, t: Talk, total: Sum) -> None:
    with s.take(lines=False) as take:
        for _ in range(4):
            t.send(t.sync_id, b"")
            s.run_for(0.012)
    total.take(take)


def _cycles(s: Dut, total: Sum) -> None:
    """Each register on the parallel bus: read, written, read."""
    if s.port is None:
        return
    with s.take() as take:
        for address in range(18):
            for line in (f"R {address:X}", f"W {address:X} 2", f"W {address:X} FFFF", f"R {address:X} 150"):
                s.port.ask(line)
                with suppress(TimeOut):
                    total.add(s.port.answered(0.01))
            s.run_for(0.003)
    total.take(take)


def _odd_frames(s: Dut, total: Sum) -> None:
    """SDO requests and network management of every length, of another node, and what is no service at all."""
    with s.take() as take, talk(s) as t:
        for length in range(8):
            t.send(t.sdo_rx, read(0x1018, 1)[:length])
            t.send(0x000, bytes([0x80, s.node, 0, 0, 0, 0, 0, 0])[:length])
        for can_id in (t.sdo_rx + 1, 0x77F, 0x080 + s.node, 0x7E5):
            t.send(can_id, read(0x1018, 4))
        t.nmt(0x01)
        s.run_for(0.05)
    total.take(take)


def _odd_lines(s: Dut, total: Sum) -> None:
    """The bus port: who is there, and lines that are none."""
    if s.port is None:
        return
    for line in ("?", "R", "X 1", "R 1 2 3", "R zz", "W 1", "W 1 10000", "R 1 -5", "r f", "R 1" + " " * 100, ""):
        s.port.ask(line)
        try:
            total.add(line, s.port.answered(0.01))
        except BenchError as e:
            total.add(line, type(e).__name__)


def _modes(s: Dut, total: Sum) -> None:
    """Each mode of a gyro unit: off, level, hold, a turn, a run, a calibration, navigation with its self test."""
    if s.variant.family != "gyro":
        return
    with s.take() as take, talk(s) as t:
        s.wait_ready()
        t.nmt(0x01)
        _set(t, total, MODE_OF_GYRO, 1, 2, 1)
        s.run_for(1.0)
        for mode, dwell_s in ((1, 1.0), (3, 25.0), (4, 40.0), (0, 0.5), (5, 15.0), (6, 2.0)):
            _set(t, total, MODE_OF_GYRO, 1, mode, 1)
            s.run_for(dwell_s)
        _set(t, total, SELF_TEST, 1, 1, 1)
        s.run_for(5.0)
    total.take(take)


def _power(s: Dut, total: Sum) -> None:
    with s.take() as take:
        s.power_cycle(0.003)
        s.run_for(0.35)
    total.take(take)
    with s.take() as take:
        s.reset()
        s.run_for(0.25)
    total.take(take)


def _beyond(s: Dut, total: Sum) -> None:
    with s.take() as take, talk(s) as t:
        s.power_cycle(0.003)
        s.run_for(0.3)
        t.nmt(0x01)
        s.run_for(0.1)
    total.take(take)


STEPS: tuple[Callable[[Dut, Sum], None], ...] = (_power, _states, _stream, _cycles, _talk, _power, _modes)


def seen(target: Target) -> str:
    """The number of one board."""
    total, v = Sum(stamps=not target.adapter), variant(target.board, target.profile)
    adapter = target.adapter or Addresses().adapter
    benches = [
        (STEPS, Addresses(adapter=adapter)),
        ((_beyond,), Addresses(adapter=adapter, inputs_v=BEYOND_V)),
        ((_power, _states, _odd_frames, _odd_lines), Addresses(adapter=adapter, port_only=True)),
    ]
    for steps, at in benches:
        with Dut.open(v, at) as s:
            for step in steps:
                try:
                    step(s, total)
                except (BenchError, Failed, Inconclusive) as e:
                    total.add(step.__name__, type(e).__name__)
    return total.hex()


def main() -> int:
    """Entry point."""
    for word in sys.argv[1:]:
        print(f"seen {word} {seen(Target.of(word))}", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
