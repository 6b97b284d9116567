"""The decoder psd1cycle on lines written here edge by edge, right and wrong (sources 4.5)."""

from __future__ import annotations

import re
import shutil
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import psd1_bench
import pytest
from verilog_bench import seed_of_test

from tests.py.boards.test_sigrok import ROOT, Edge, sigrok, write

IDLE = {"A0": 0, "FL2": 0, "RFX": 1, "RFY": 1, "RFZ": 1, "SCLK": 0, "SDAT": 0, "CS": 1, "RW": 1}
IDLE |= {f"AB{i}": 0 for i in range(4)} | {f"D{i}": 0 for i in range(16)}
MUST = "psd1cycle:a0=A0:rfx=RFX:rfy=RFY:rfz=RFZ:sclk=SCLK:sdat=SDAT"
HOST = ":fl2=FL2:cs=CS:rw=RW" + "".join(f":ab{i}=AB{i}" for i in range(4)) + "".join(f":d{i}=D{i}" for i in range(16))

pytestmark = pytest.mark.skipif(not shutil.which("sigrok-cli"), reason="sigrok-cli is not installed")


def transfer(t_ns: int, axis: str, word: int, bits: int = 16, first_ns: int = 700, high_ns: int = 400) -> list[Edge]:
    """RFx low at t_ns, SCLK of 800 ns a period, RFx high on the next edge of the clock; bits before the rises."""
    edges: list[Edge] = [(t_ns, f"RF{axis}", 0)]
    for n in range(bits):
        rise = t_ns + first_ns + 800 * n
        edges.append((rise - 100, "SDAT", word >> (bits - 1 - n) & 1))
        edges += [(rise, "SCLK", 1), (rise + high_ns, "SCLK", 0)]
    end = t_ns + 800 * (bits + 1)
    return [*edges, (end, "SDAT", 0), (end, f"RF{axis}", 1)]


def strobe(t_ns: int, address: int, data: int, length_ns: int = 800, rw: int = 1) -> list[Edge]:
    on: list[Edge] = [(t_ns, "CS", 0), (t_ns, "RW", rw)]
    on += [(t_ns, f"AB{i}", 1) for i in range(4) if address >> i & 1]
    on += [(t_ns, f"D{i}", 1) for i in range(16) if data >> i & 1]
    return on + [(t_ns + length_ns, name, IDLE[name]) for _, name, _ in on]


def cycle(t_ns: int, words: Sequence[int]) -> list[Edge]:
    """A0 up at t_ns; each word is read 1 us after it is ready; A0 falls with the last FL2."""
    edges: list[Edge] = [(t_ns, "A0", 1)]
    at = t_ns + 400
    for i, word in enumerate(words):
        ready = at + 13600
        edges += [*transfer(at, "XYZ"[i], word), (ready, "FL2", 1), *strobe(ready + 1000, i, word)]
        at = ready + 2400
        edges.append((at, "FL2", 0))
    return [*edges, (at, "A0", 0)]


def test_the_three_words_of_each_cycle_and_who_read_them(tmp_path: Path) -> None:
    edges = cycle(1000, [0x8001, 0x0000, 0xFFFF]) + cycle(1_001_000, [0x7FFF, 0xA5C3, 0x8000])
    vcd = write(tmp_path / "c.vcd", IDLE, edges, 2_000_000)
    assert sigrok(vcd, MUST + HOST, "psd1cycle=word:read:cycle:warning") == [
        *("X=1", "Read 0: 8001h", "Y=-32768", "Read 1: 0000h", "Z=32767", "Read 2: FFFFh"),
        "Cycle 0: X=1 Y=-32768 Z=32767",
        *("X=-1", "Read 0: 7FFFh", "Y=9667", "Read 1: A5C3h", "Z=0", "Read 2: 8000h"),
        "Cycle 1: X=-1 Y=9667 Z=0",
    ]
    assert sigrok(vcd, MUST, "psd1cycle=bit")[:16] == ["1", *["0"] * 14, "1"]


def test_words_may_be_shown_as_they_are_sent_and_the_host_left_out(tmp_path: Path) -> None:
    vcd = write(tmp_path / "c.vcd", IDLE, cycle(1000, [0x8001, 0x0000, 0xFFFF]), 200_000)
    assert sigrok(vcd, f"{MUST}:format=hex", "psd1cycle=cycle:warning") == ["Cycle 0: X=8001h Y=0000h Z=FFFFh"]


def test_a_cycle_under_way_when_the_recording_begins_is_not_decoded(tmp_path: Path) -> None:
    edges: list[Edge] = [(90_000, "A0", 0), *cycle(100_000, [1, 2, 3])]
    vcd = write(tmp_path / "c.vcd", IDLE | {"A0": 1}, edges, 300_000)
    assert sigrok(vcd, MUST, "psd1cycle=cycle:warning") == ["Cycle 0: X=-32767 Y=-32766 Z=-32765"]


Case = tuple[list[Edge], str]


def cases() -> dict[str, Case]:
    """What is wrong, and the warning."""
    a0: list[Edge] = [(1000, "A0", 1)]
    down: list[Edge] = [(90_000, "A0", 0)]
    whole = a0 + transfer(1400, "X", 5)
    return {
        "pulses": (a0 + transfer(1400, "X", 5, bits=15) + down, "Torn word X: 15 bits, not 16"),
        "cut": (whole + down, "Cut cycle: 1 words, not 3"),
        "turn": (a0 + transfer(1400, "Y", 5) + down, "RFY out of turn"),
        "set-up": (a0 + transfer(1190, "X", 5) + down, "A0 to RFX: 190 ns, not 200"),
        "access": (a0 + transfer(1400, "X", 5, first_ns=390) + down, "RFS to SCLK: 390 ns, not 400"),
        "high": (a0 + transfer(1400, "X", 5, high_ns=190) + down, "SCLK high: 190 ns, not 200"),
        "low": (a0 + transfer(1400, "X", 5, high_ns=610) + down, "SCLK low: 190 ns, not 200"),
        "early": (a0 + transfer(1400, "X", 5) + strobe(14_900, 0, 0) + down, "Read before FL2"),
    }


@pytest.mark.parametrize("name", cases())
def test_what_breaks_a_limit_or_the_order_is_told(name: str, tmp_path: Path) -> None:
    edges, warning = cases()[name]
    vcd = write(tmp_path / "c.vcd", IDLE, edges, 200_000)
    assert warning in sigrok(vcd, MUST + HOST, "psd1cycle=warning")
    if not warning[0].isupper() or name in ("set-up", "access", "high", "low"):
        assert warning not in sigrok(vcd, f"{MUST}:limits=no", "psd1cycle=warning")


def test_a_control_word_of_24_bits_is_no_word_of_an_axis(tmp_path: Path) -> None:
    edges: list[Edge] = [(1000, "A0", 1), *transfer(1400, "X", 0x123456, bits=24)]
    edges += [*transfer(30_000, "Y", 0x123456, bits=24), (60_000, "A0", 0)]
    vcd = write(tmp_path / "c.vcd", IDLE, edges, 200_000)
    assert sigrok(vcd, MUST, "psd1cycle=word:cycle:warning") == []


def test_a_host_that_writes_is_told_as_such(tmp_path: Path) -> None:
    vcd = write(tmp_path / "c.vcd", IDLE, strobe(5000, 12, 0x1234, rw=0), 100_000)
    assert sigrok(vcd, MUST + HOST, "psd1cycle=read:warning") == ["Write 12: 1234h"]


def test_the_shipped_sessions_name_the_lines_of_the_board() -> None:
    pvs = (ROOT / "share/psd1.pvs").read_text()
    gtkw = re.findall(r"^psd1\.(\w+)$", (ROOT / "share/psd1.gtkw").read_text(), re.MULTILINE)
    assert sorted(gtkw) == sorted(psd1_bench.LINES)
    assert re.findall(r"id=(\w+)", pvs) == ["psd1cycle"]
    assert re.findall(r"assigned_signal_name=(\w+)", pvs) == [*list(IDLE)[:1], *list(IDLE)[2:7], "FL2", *list(IDLE)[7:]]
    assert re.findall(r"^(\w+)..?trace_height", pvs, re.MULTILINE) == list(psd1_bench.LINES)


def test_the_words_on_the_lines_are_those_that_the_host_reads(tmp_path: Path) -> None:
    rows = psd1_bench.random_strobes(np.random.default_rng(seed_of_test()), 20)
    vcd, words = psd1_bench.record(tmp_path, 1, rows, unit_ns=10)
    seen = sigrok(vcd, f"{MUST}{HOST}:format=hex", "psd1cycle=cycle:warning")
    seen = [text for text in seen if text != "Read before FL2"]  # the host's mistakes
    want = [f"Cycle {n}: X={x:04X}h Y={y:04X}h Z={z:04X}h" for n, (x, y, z) in enumerate(words)]
    assert seen == want
