"""A log of the bus as arrays, beside python-can's reader of the same file."""

from __future__ import annotations

import random
from pathlib import Path

import can
import numpy as np
import pytest
from psabench.errors import LinkError
from psabench.link import can_log
from psabench.link.signals import Signal


def log_of(seed: int, lines: int, channel: str = "can0") -> bytes:
    """Frames of all kinds, most of them with eight bytes."""
    draw = random.Random(seed)
    text, t_us = "", 0
    for _ in range(lines):
        t_us += draw.randrange(1, 5_000_000)
        data = draw.randbytes(draw.choice((8, 8, 8, 8, 0, 1, 7))).hex().upper()
        frame = draw.choice(
            (f"{draw.choice((0x189, 0x289, 0x700)):03X}#{data}",) * 6 + ("12345678#R4", "189##001020304050607")
        )
        text += f"({t_us // 1_000_000:010d}.{t_us % 1_000_000:06d}) {channel} {frame}\n"
    return text.encode()


@pytest.mark.parametrize("seed", range(5))
def test_frames_are_those_that_python_can_reads(seed: int, tmp_path: Path) -> None:
    text = log_of(seed, 600, "can0" if seed % 2 else "a")
    path = tmp_path / "bus.log"
    path.write_bytes(text)
    found = can_log.read(text, {0x189, 0x289})
    wanted = [
        m
        for m in can.LogReader(str(path))
        if m.arbitration_id in (0x189, 0x289) and m.dlc == 8 and not (m.is_extended_id or m.is_fd)
    ]
    assert len(found) == len(wanted) > 100
    assert found.can_id.tolist() == [m.arbitration_id for m in wanted]
    assert found.t_s.tolist() == [m.timestamp for m in wanted]
    assert [int(x).to_bytes(8, "little") for x in found.data] == [bytes(m.data) for m in wanted]


def test_signals_are_cut_out_with_their_signs() -> None:
    text = b"(0000000001.000001) can0 189#FFFFFF0102000080\n"
    frame = can_log.read(text, {0x189})

    def raw(start: int, bits: int, signed: bool) -> int:
        s = Signal(start_bit=start, bits=bits, signed=signed, scale=1.0, offset=0.0, unit="")
        return int(frame.raw(s)[0])

    assert (raw(0, 24, True), raw(0, 24, False), raw(24, 16, False)) == (-1, 0xFFFFFF, 0x0201)
    assert (raw(32, 32, True), raw(63, 1, False)) == (-(2**31) + 2, 1)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"(0000000001.000001) can0 189#00112233445566", "cut short"),
        (b"(0000000001.000001) can0 189#0011223344556z77\n", "expected hexadecimal digits"),
    ],
)
def test_a_damaged_log_is_refused(text: bytes, reason: str) -> None:
    with pytest.raises(LinkError, match=reason):
        can_log.read(text, {0x189})


def test_a_log_of_nothing_has_no_frames() -> None:
    assert len(can_log.read(b"", {0x189})) == 0
    assert np.array_equal(can_log.read(b"(0000000001.000001) can0 705#00\n", {0x705}).can_id, [])
