"""Wireshark's plugins where it looks for them; that of the MAVLink dialect on what the emulator sends, by tshark."""

from __future__ import annotations

import json
import os
import shutil
import socket
import struct
import subprocess
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import pytest
from psabench import cli
from psabench.emulator import Emulator
from psabench.link.control import Control
from psabench.mavlink.dialect import mavlink

pytestmark = pytest.mark.skipif(not shutil.which("tshark"), reason="tshark is not installed")

PORT = 14550
RAW_IP = 101  # link type


@pytest.fixture(scope="module")
def home(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A user with our plugins."""
    folder = tmp_path_factory.mktemp("home")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HOME", str(folder))
        for _ in range(2):  # the second time it replaces them
            assert cli.main(["waveform", "--wireshark"]) == 0
    return folder


def tshark(home: Path, *words: str) -> str:
    environment = {**os.environ, "HOME": str(home)}
    done = subprocess.run(["tshark", *words], capture_output=True, text=True, check=True, env=environment, timeout=60)
    assert "Lua" not in done.stderr
    return done.stdout


def udp(payload: bytes) -> bytes:
    """An IPv4 packet to PORT of this machine."""
    length = 28 + len(payload)
    local = bytes([127, 0, 0, 1])
    return struct.pack(">BBHIBBH", 0x45, 0, length, 0, 64, 17, 0) + 2 * local + struct.pack(
        ">HHHH", 40000, PORT, length - 20, 0
    ) + payload  # fmt: skip


def pcap(path: Path, packets: Iterable[bytes], linktype: int) -> Path:
    records = [struct.pack("<IIII", n, 0, len(p), len(p)) + p for n, p in enumerate(packets, 1)]
    path.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, linktype) + b"".join(records))
    return path


def test_wireshark_finds_the_plugins(home: Path) -> None:
    found = {line.split("\t")[2] for line in tshark(home, "-G", "protocols").splitlines()}
    assert {"psabench", "mavlink_proto"} <= found


def sent_by_the_emulator(count: int) -> list[Any]:
    """The first messages of a board."""
    parser, messages = mavlink().MAVLink(None), list[Any]()
    with (
        Emulator("stream", cans=["none"], pace="step", extra=["--mavlink", "tcp:0"]) as emu,
        Control(emu.directory / "control") as control,
    ):
        link = emu.endpoint(mavlink="tcp")
        with socket.create_connection((link["host"], int(link["port"])), timeout=30) as stream:
            while len(messages) < count:
                control.call("run", for_s=0.1)
                messages += parser.parse_buffer(stream.recv(1 << 16)) or []
    return messages[:count]


def test_every_field_of_the_messages_is_shown_as_pymavlink_reads_it(home: Path, tmp_path: Path) -> None:
    messages = sent_by_the_emulator(120)
    path = pcap(tmp_path / "mav.pcap", (udp(bytes(m.get_msgbuf())) for m in messages), RAW_IP)
    rows = json.loads(tshark(home, "-r", str(path), "-T", "json", "-J", "mavlink_proto", "--no-duplicate-keys"))
    kinds = Counter[str]()
    for m, row in zip(messages, rows, strict=True):
        name = m.get_type()
        shown = dict(flat(row["_source"]["layers"]["mavlink_proto"]))
        for field in m.get_fieldnames():
            value = getattr(m, field)
            if isinstance(value, list):
                for i, item in enumerate(value):
                    assert float(shown[f"mavlink_proto.{name}_{field}_{i}"]) == pytest.approx(item, rel=1e-5)
            elif isinstance(value, (int, float)):
                got = shown[f"mavlink_proto.{name}_{field}"]
                assert (int(got, 0) if isinstance(value, int) else float(got)) == pytest.approx(value, rel=1e-5)
        kinds[name] += 1
    assert kinds["PSABENCH_ACCEL"] > 10
    assert kinds["HIGHRES_IMU"] > 1


def flat(tree: dict[str, Any]) -> Iterable[tuple[str, str]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value)
        else:
            yield name, value
