"""The line port and who reads it: slowly, again, not at all (docs/lineport.md)."""

from __future__ import annotations

import threading

import numpy as np

from psabench.boards.psa2.conform.capture_line import transfers
from psabench.conform.dut import Dut
from psabench.conform.plan import active
from psabench.conform.probes import PortProbe
from psabench.conform.requirements import Requirement, requirements
from psabench.conform.sources.samples import line_log
from psabench.conform.verdict import Failed, expect, known, none_of
from psabench.link.lineport import SAMPLE_HZ, open_line

WORDS = 4
LOOK_S, PAUSE_S, MOST_S = 0.05, 0.6, 20.0
SLICE, SLOW_S = 1 << 14, 0.002  # bytes that a slow reader takes, and how long it rests after each


def _port(s: Dut) -> PortProbe:
    return known(s.line_port, "no line port")


def _look(s: Dut, dwell_s: float) -> bytes:
    _port(s).start()
    try:
        s.run_for(dwell_s)
    finally:
        _port(s).stop()
    return _port(s).data


@active("LINE-GAP-01", needs={"port"})
def lost_samples_are_marked(s: Dut, row: Requirement) -> str:
    """In real time leave the port unread for long; in lockstep, where nothing is lost, look for marks."""
    mask = int(row.limit("gap_mask"))
    s.wait_ready()
    if s.lockstep:
        x = np.frombuffer(_look(s, LOOK_S), np.uint8)
        if (x & mask).any():
            raise Failed(f"{int((x & mask).astype(bool).sum())} bytes with bit 7", "none: no sample was lost")
        return f"{len(x)} bytes without bit 7"
    with open_line(_port(s).path) as port:
        s.run_for(PAUSE_S)  # the emulator keeps 131 ms
        data = b""
        while len(data) < SAMPLE_HZ * PAUSE_S:
            data += port.read(1 << 16)
    marks = int((np.frombuffer(data, np.uint8) & mask).astype(bool).sum())
    expect(marks, f"no bit 7 in {len(data)} bytes after {PAUSE_S:g} s unread", "a mark after the hole")
    return f"{marks} marks in {len(data)} bytes"


@active("LINE-GAP-02", needs={"port", "lockstep"})
def a_slow_reader_loses_nothing(s: Dut) -> str:
    """Read slowly while time is to pass."""
    mask = int(requirements().rows["LINE-GAP-01"].limit("gap_mask"))
    s.wait_ready()
    data, enough = bytearray(), threading.Event()
    least = SAMPLE_HZ * LOOK_S * 0.9

    def read_slowly() -> None:
        with open_line(_port(s).path) as port:
            rest = threading.Event()
            ready.set()
            while len(data) < least:
                data.extend(port.read(SLICE))
                rest.wait(SLOW_S)
        enough.set()

    ready = threading.Event()
    reader = threading.Thread(target=read_slowly, daemon=True)
    reader.start()
    ready.wait(MOST_S)
    s.run_for(LOOK_S)
    expect(enough.wait(MOST_S), f"{len(data)} samples of {LOOK_S:g} s", f"{least:.0f} and more")
    lost = (np.frombuffer(bytes(data), np.uint8) & mask).astype(bool)
    expect(not lost.any(), f"{int(lost.sum())} holes", "none")
    return f"{len(data)} samples, no hole"


@active("LINE-OPEN-01", needs={"port"})
def the_port_opens_again(s: Dut) -> str:
    """Open, read, close; open again: frames from the second fall of Int on."""
    s.wait_ready()
    _look(s, LOOK_S)
    log = line_log(_look(s, LOOK_S), s.variant.family, SAMPLE_HZ)
    t = transfers(log)
    due = WORDS * int(s.variant["word_bits"])
    torn = [len(r) for r in t.rises[1:] if len(r) != due]
    none_of(torn, lambda bits: f"{len(torn)} frames of {len(t)} with {bits} bits", f"{due}")
    return f"{len(t)} whole frames after the second opening"
