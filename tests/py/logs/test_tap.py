"""`psabench tap`: what goes over slcan, the bus port and the line port, read by tshark with our dissectors."""

from __future__ import annotations

import os
import random
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path

import can
import numpy as np
import pytest
from psabench import cli
from psabench.emulator import Emulator
from psabench.errors import BadInput, CycleRefused, OutputError
from psabench.link.busport import BusPort
from psabench.link.control import Control
from psabench.link.lineport import LineDecoder
from psabench.link.protocol_files import database
from psabench.link.vcd import read_vcd
from psabench.logs import tap
from psabench.places import CHECKOUT

NEEDS_TSHARK = pytest.mark.skipif(not shutil.which("tshark"), reason="tshark is not installed")
SCRIPTS = [CHECKOUT / "share/wireshark" / f"{name}.lua" for name in ("psabench", "psabench_ports")]
RATE_HZ = 8_000_000


def tshark(path: Path, *fields: str) -> list[list[str]]:
    """Fields of each packet."""
    words = ["tshark", *(w for s in SCRIPTS for w in ("-X", f"lua_script:{s}")), "-r", str(path), "-T", "fields"]
    words += [w for f in fields for w in ("-e", f)]
    done = subprocess.run(words, capture_output=True, text=True, check=True, timeout=60)
    assert "Lua" not in done.stderr + done.stdout
    return [line.split("\t") for line in done.stdout.splitlines()]


@contextmanager
def tapped(kind: str, port: Path, out: Path) -> Iterator[str]:
    """The port that a program opens in place of the board's. It ends with the board's."""
    command = [sys.executable, "-m", "psabench.cli", "tap", kind, str(port), str(out)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            ready = process.stdout.readline().split()
            assert ready[0] == "ready"
            yield ready[1].partition("=")[2] if len(ready) > 1 else ""
            assert process.wait(30) == 0
        finally:
            process.kill()


@NEEDS_TSHARK
def test_frames_on_slcan_are_can_frames_for_wireshark(tmp_path: Path) -> None:
    out, link = tmp_path / "run.pcap", tmp_path / "slcan"
    with Emulator("stream", cans=[f"slcan:{link}"], pace="step", extra=[]) as emu, tapped("slcan", link, out) as port:
        with (
            Control(emu.directory / "control") as control,
            can.Bus(interface="slcan", channel=port, sleep_after_open=0, bitrate=1_000_000) as bus,
        ):
            bus.send(can.Message(arbitration_id=0x605, data=bytes.fromhex("4000100000000000"), is_extended_id=False))
            bus.send(can.Message(arbitration_id=0x1ABCDEF, data=b"\x01\x02", is_extended_id=True))
            got: list[can.Message] = []
            while len(got) < 24:
                control.call("run", for_s=0.01)
                while m := bus.recv(0.02):
                    got.append(m)
        emu.stop()
    fields = "exported_pdu.p2p_dir can.id can.len psabench_slcan.kind psabench.psa2_xy.x_v can.flags.xtd".split()
    rows = tshark(out, *fields)
    frames = [row for row in rows if row[3] == "frame"]
    sent, received = ([row for row in frames if row[0] == way] for way in ("0", "1"))
    assert [(int(r[1]), int(r[2]), r[5] in ("1", "True")) for r in sent] == [(0x605, 8, False), (0x1ABCDEF, 2, True)]
    assert [(int(r[1]), int(r[2])) for r in received[: len(got)]] == [(m.arbitration_id, m.dlc) for m in got]
    xy = database().get_message_by_name("PSA2_XY")
    volts = [float(xy.decode(bytes(m.data))["X"]) for m in got if m.arbitration_id == xy.frame_id]
    assert [float(r[4]) for r in received if r[4]][: len(volts)] == pytest.approx(volts, rel=1e-12)
    assert len(volts) > 5
    # C is on its way when the board ends
    assert {row[3] for row in rows} - {"close"} == {
        "frame",
        "bit rate",
        "open",
        "empty",
        "done",
        "sent",
        "sent, extended",
    }


@NEEDS_TSHARK
def test_cycles_on_the_bus_port_are_those_of_the_host(tmp_path: Path) -> None:
    out, link, scenario = tmp_path / "run.pcap", tmp_path / "bus", tmp_path / "unit.yaml"
    scenario.write_text("units: [{name: a, board: psd1, profile: psd1_host}]")
    with (
        Emulator(scenario, cans=["none"], pace="step", extra=["--bus-port", link]) as emu,
        tapped("bus", link, out) as path,
    ):
        with (
            Control(emu.directory / "control") as control,
            BusPort(path, lambda s: control.call("run", for_s=s)) as port,
        ):
            control.call("run", for_s=0.02)
            who = port.who()
            status = port.read(3)
            port.write(15, 3, 2500)
            with pytest.raises(CycleRefused):
                port.read(2)
        emu.stop()
    names = "kind address data strobe_ns t_ns code board".split()
    rows = tshark(out, "exported_pdu.p2p_dir", *(f"psabench_bus.{name}" for name in names))
    assert [row[1] for row in rows] == "identify board read read write written read rejected".split()
    assert [row[0] for row in rows] == ["0", "1"] * 4
    assert rows[1][7] == who.board
    assert int(rows[3][2], 0) == 3
    assert int(rows[3][3], 0) == status.data
    assert float(rows[3][5]) * 1e-9 == pytest.approx(status.t_s, abs=1e-12)
    assert (int(rows[4][2], 0), int(rows[4][3], 0), rows[4][4]) == (15, 3, "2500")
    assert rows[7][6] == "not-ready"


def sampled(start_us: int = 189_000, end_us: int = 192_000) -> bytes:
    """A golden trace as the line port has it."""
    vcd = read_vcd(CHECKOUT / "tests/golden/first_frames.vcd")
    at_ns = np.arange(start_us * 1000, end_us * 1000, 10**9 // RATE_HZ)
    bits = [vcd.wires[name].at(at_ns) << n for n, name in enumerate(("Int", "Data", "CLK"))]
    return bytes(np.bitwise_or.reduce(bits).tolist())


@NEEDS_TSHARK
def test_frames_on_the_line_port_are_those_of_the_decoder(tmp_path: Path) -> None:
    raw, out = tmp_path / "capture.bin", tmp_path / "run.pcap"
    raw.write_bytes(samples := sampled())
    assert cli.main(["tap", "line", str(raw), str(out)]) == 0
    frames = LineDecoder().feed(samples)
    rows = tshark(out, "frame.time_epoch", *(f"psabench_line.{name}" for name in "x y z t channel status".split()))
    assert len(rows) == len(frames) > 1
    for row, fall, words in zip(rows, frames.fall.tolist(), frames.signed(32).tolist(), strict=True):
        assert float(row[0]) == pytest.approx((fall - 1) / RATE_HZ, abs=1e-9)
        assert [int(v, 0) for v in row[1:]] == [*words[:3], words[3] & 0xFFFF, words[3] >> 16 & 15, words[3] >> 20 & 15]


@NEEDS_TSHARK
def test_torn_frames_and_lost_samples_are_marked(tmp_path: Path) -> None:
    whole = sampled(189_900, 190_900).rstrip(b"\1")
    raw, out = tmp_path / "capture.bin", tmp_path / "run.pcap"
    lost = bytearray(whole)
    lost[len(lost) - 300] |= 0x80
    raw.write_bytes(whole + b"\1" + whole[:-200] + b"\1" + bytes(lost) + b"\1" + whole[-10:])
    assert cli.main(["tap", "line", str(raw), str(out)]) == 0
    rows = tshark(out, "psabench_line.torn", "psabench_line.lost", "psabench_line.x")
    assert [[bool(v) for v in row] for row in rows] == [[False, False, True], [True, False, False], [False, True, True]]


OUT, IN = tap.TO_BOARD, tap.FROM_BOARD
NINES = "9" * 400
SLCAN = (  # direction, line, kind, identifier, length, time stamp
    (OUT, "t1853102030\r", "frame", "389", "3", ""),
    (IN, "T1ABCDEF02AABB1234\r", "frame", "448585456", "2", "4660"),
    (IN, "r7FF8\r", "frame", "2047", "8", ""),
    (OUT, "b0019" + "11" * 12 + "\r", "frame", "1", "12", ""),
    (OUT, "d001F" + "11" * 64 + "\r", "frame", "1", "64", ""),
    (OUT, "t185310203\r", "unknown", "", "", ""),
    (OUT, "t18531020304\r", "unknown", "", "", ""),
    (OUT, "t0019" + "11" * 12 + "\r", "unknown", "", "", ""),
    (OUT, "t8001AA\r", "unknown", "", "", ""),
    (OUT, "T200000001AA\r", "unknown", "", "", ""),
    (OUT, "t1853102030\a", "unknown", "", "", ""),
    (OUT, "O\r", "open", "", "", ""),
    (IN, "O\r", "unknown", "", "", ""),
    (IN, "\a", "rejected", "", "", ""),
    (OUT, "\a", "unknown", "", "", ""),
    (IN, "F24\r", "status", "", "", ""),
)
BUS = (  # direction, line, kind, address, data, strobe, time
    (OUT, "r 0fH 200\r\n", "read", "0x0f", "", "200", ""),
    (OUT, "  W  3 12\n", "write", "0x03", "0x0012", "", ""),
    (OUT, f"R 3 {NINES}\n", "read", "0x03", "", str(2**32 - 1), ""),
    (IN, f"R 03h 8000 t={NINES}\n", "read", "0x03", "0x8000", "", str(2**53)),
    (IN, "E busy R 02h t=5000000000\n", "rejected", "0x02", "", "", "5000000000"),
    (IN, "E syntax - - t=7\n", "rejected", "", "", "", "7"),
    (IN, "I pik 00h=X 01h=Y t=8\n", "board", "", "", "", "8"),
    (IN, "R 3\n", "unknown", "", "", "", ""),
    (OUT, "R 03h 8000 t=5\n", "unknown", "", "", "", ""),
    (OUT, "W 3 12345\n", "unknown", "", "", "", ""),
)


@NEEDS_TSHARK
@pytest.mark.parametrize(
    ("kind", "lines", "fields"),
    [
        ("slcan", SLCAN, ("psabench_slcan.kind", "can.id", "can.len", "psabench_slcan.stamp_ms")),
        ("bus", BUS, tuple(f"psabench_bus.{name}" for name in ("kind", "address", "data", "strobe_ns", "t_ns"))),
    ],
)
def test_lines_right_and_wrong(
    kind: str, lines: Sequence[tuple[int | str, ...]], fields: Sequence[str], tmp_path: Path
) -> None:
    out = tmp_path / "run.pcap"
    with tap.tap_file(kind, out) as t:
        for way, text, *_ in lines:
            t.take_bytes(int(way), str(text).encode(), lambda at: at)
    assert t.cut == 0
    rows = tshark(out, "_ws.lua.error", *fields)
    assert [tuple(row[1:]) for row in rows] == [tuple(line[2:]) for line in lines]
    assert not any(row[0] for row in rows)


@NEEDS_TSHARK
def test_words_of_16_24_and_32_bits_on_the_line_port(tmp_path: Path) -> None:
    out, low, high, bits = tmp_path / "run.pcap", b"\0", b"\4", b"\2\6"
    words = {size: [1 << (size - 1), 5, (1 << size) - 2, 0x1234] for size in (16, 24, 32)}
    stream = b"".join(
        b"\1" + b"".join((bits if word >> k & 1 else low + high) for word in four for k in range(size)) + b"\0\5\1"
        for size, four in words.items()
    )
    with tap.tap_file("line", out) as t:
        t.take_bytes(IN, stream + b"\0" * 8 + b"\1", lambda at: at)
    rows = tshark(out, *(f"psabench_line.{name}" for name in "x y z t bits torn channel".split()))
    assert [[int(v, 0) for v in row[:5]] for row in rows[:3]] == [
        [-(1 << (size - 1)), 5, -2, 0x1234, 4 * size] for size in words
    ]
    assert [(row[4], bool(row[5]), bool(row[6])) for row in rows] == [
        ("64", False, False), ("96", False, True), ("128", False, True), ("0", True, False)
    ]  # fmt: skip


def test_the_file_is_that_of_wireshark(tmp_path: Path) -> None:
    """Header of link type 252 with stamps of 1 ns; tags padded to four bytes."""
    out = tmp_path / "run.pcap"
    with tap.tap_file("slcan", out) as t:
        t.take_bytes(IN, b"V1013\rz", lambda at: 5_000_000_007)
    assert out.read_bytes().hex(" ", -4) == (
        "4d3cb2a1 02000400 00000000 00000000 00040100 fc000000"
        " 05000000 07000000 26000000 26000000"
        " 000c0010 70736162 656e6368 5f736c63 616e0000 00230004 00000001 00000000 56313031 330d"
    )


def spelled(kind: str, draw: random.Random) -> bytes:
    """Something like a line of the port, or anything."""
    lines = {
        "slcan": [
            "t1853102030\r",
            "T1ABCDEF02AABB1234\r",
            "r7FF8\r",
            "d10F" + 128 * "1" + "\r",
            "F00\r",
            "z\r",
            "\a",
            "\r",
        ],
        "bus": [
            "R 0 200\n",
            "W 0F 1234\r\n",
            "?\n",
            "E busy R 02h t=99999999999\n",
            "R 00h 8000 t=5\n",
            "I psd1 00h=X t=1\n",
        ],
        "line": [],
    }[kind]
    text = bytearray(
        draw.choice(lines).encode() if lines and draw.random() < 0.9 else draw.randbytes(draw.randrange(1, 90))
    )
    for _ in range(draw.choice([0, 0, 1, 1, 3])):
        at = draw.randrange(len(text) + 1)
        text[at : at + draw.randrange(2)] = draw.choice([b"", b"9", b"F", b"\xff", b"\0", b" ", b"9" * 400])
    return bytes(text)


@NEEDS_TSHARK
@pytest.mark.parametrize("kind", tap.KINDS)
def test_arbitrary_bytes_are_shown_without_an_error_of_lua(kind: str, tmp_path: Path) -> None:
    draw = random.Random(11)
    out, field = tmp_path / "run.pcap", f"psabench_{kind}.{'samples' if kind == 'line' else 'kind'}"
    with tap.tap_file(kind, out) as t:
        for _ in range(1500):
            t.take_bytes(draw.randrange(2), spelled(kind, draw), lambda at: at)
    rows = tshark(out, "_ws.col.Protocol", field, "_ws.malformed", "_ws.lua.error")
    assert len(rows) == sum(t.packets) > 100
    assert all(row[1] for row in rows)
    assert not [row for row in rows if any(row[2:])]


@pytest.mark.parametrize("kind", tap.KINDS)
def test_packets_do_not_depend_on_how_the_bytes_come(kind: str) -> None:
    draw = random.Random(3)
    data = b"".join(spelled(kind, draw) for _ in range(400))
    if kind == "line":
        data = b"".join(bytes([draw.randrange(128) * 2 + (n % 2)]) * draw.randrange(1, 9) for n in range(3000))
    _, make = tap.KINDS[kind]
    whole = list(make().packets_of(data))
    cuts = sorted(draw.randrange(len(data)) for _ in range(300))
    cutter = make()
    pieces = [p for a, b in pairwise([0, *cuts, len(data)]) for p in cutter.packets_of(data[a:b])]
    assert pieces == whole
    assert len(whole) > 100
    assert all(data[at : at + len(packet)] == packet for at, packet in whole)


@pytest.mark.parametrize(
    ("kind", "byte", "most"), [("slcan", b"t", tap.MOST_LINE), ("line", b"\0", tap.MOST_FRAME + 2)]
)
def test_a_packet_without_end_is_cut(kind: str, byte: bytes, most: int) -> None:
    cutter = tap.KINDS[kind][1]()
    packets = [p for _ in range(40) for _, p in cutter.packets_of(byte * 5000)]
    assert max(len(p) for p in packets) <= most
    assert cutter.cut == len(packets) > 1


def test_a_relay_waits_for_a_reader_and_ends_with_the_port(tmp_path: Path) -> None:
    """What the board sends before a program comes is not lost, and what it sends is bounded."""
    master, slave = os.openpty()
    took: list[tuple[int, bytes]] = []
    with tap.Relay(Path(os.ttyname(slave))) as relay:
        os.close(slave)
        thread = threading.Thread(target=relay.pass_on, args=(lambda way, data: took.append((way, data)),))
        thread.start()
        os.write(master, b"hello\r")
        with open(relay.path, "r+b", buffering=0) as program:
            assert program.read(6) == b"hello\r"
            program.write(b"V\r")
            assert os.read(master, 10) == b"V\r"
        os.close(master)
        thread.join(10)
        assert not thread.is_alive()
    assert b"".join(data for way, data in took if way == tap.FROM_BOARD) == b"hello\r"
    assert b"".join(data for way, data in took if way == tap.TO_BOARD) == b"V\r"


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ("slcan nothing out.pcap", "nothing: expected a port or a file, got no such file"),
        ("bus {file} {file}", "OUT: expected another file than the one that is read"),
        ("morse {file} out.pcap", "expected slcan, bus, line, got 'morse'"),
        ("line {file} /proc/x.pcap", "/proc/x.pcap"),
        ("line . out.pcap", "."),
    ],
)
def test_tap_says_what_is_wrong(
    words: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_bytes(b"\0")
    assert cli.main(["tap", *words.format(file="file").split()]) in (2, 3)
    assert says in capsys.readouterr().err


def test_a_full_disk_is_told() -> None:
    with pytest.raises((OutputError, BadInput)), tap.tap_file("slcan", Path("/dev/full")) as t:
        t.take_bytes(tap.FROM_BOARD, b"V\r", lambda at: at)
