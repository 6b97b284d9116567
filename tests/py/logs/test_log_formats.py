"""Logs of frames of every kind, read back by us and by the programs that they are for, and damaged ones."""

from __future__ import annotations

import json
import os
import random
import re
import shutil
import struct
import subprocess
import sys
from collections.abc import Sequence
from contextlib import nullcontext, suppress
from itertools import pairwise
from pathlib import Path
from typing import Any

import can
import pytest
from mcap.reader import make_reader
from psabench import cli
from psabench.conform.sources import mf4
from psabench.errors import BadInput
from psabench.link.log_file import LogFile
from psabench.link.protocol_files import database, message
from psabench.logs import mcap_log, records, wireshark
from psabench.logs.formats import read_frames
from rosbags.highlevel import AnyReader

T0_S = 1_700_000_000.25
X_CODES = (2_087_445, -1000, 8_388_607)
WITH_MF4 = pytest.mark.skipif(not mf4.asammdf_is_there(), reason="asammdf is not there: make setup")
WITH_TSHARK = pytest.mark.skipif(not shutil.which("tshark"), reason="tshark is not installed")
OURS = [".mcap", pytest.param(".mf4", marks=WITH_MF4), ".pcap"]
G0_MPS2 = 9.80665


def pair(n: int, code: int, node: int = 5) -> list[can.Message]:
    """A sample of a PSA-2."""
    lsb_v = 10 / 2**23
    xy = message("PSA2_XY").encode({"X": code * lsb_v, "Y": 0.0, "SEQ": n})
    flags = dict.fromkeys(("SETTLED", "CLIP", "OVERRUN", "T_NEW", "CHANNEL"), 0)
    zt = message("PSA2_ZT").encode({"Z": 1.0, "T": 250, "TSTAMP": n * 1e-3, **flags})
    both = ((0x180 + node, xy), (0x280 + node, zt))
    return [can.Message(arbitration_id=i, data=d, is_extended_id=False, timestamp=T0_S + n * 1e-3) for i, d in both]


def frames() -> list[can.Message]:
    """Samples, and one frame of each kind."""
    kinds = [
        can.Message(arbitration_id=0x1ABCDEF0, data=b"\x01\x02", timestamp=T0_S + 1.0),
        can.Message(arbitration_id=0x123, is_extended_id=False, is_remote_frame=True, dlc=4, timestamp=T0_S + 1.1),
        can.Message(
            arbitration_id=0x20, is_extended_id=False, is_error_frame=True, data=bytes(8), timestamp=T0_S + 1.2
        ),
        can.Message(
            arbitration_id=0x7F0, is_extended_id=False, is_fd=True, bitrate_switch=True, data=bytes(range(48)),
            timestamp=T0_S + 1.3,
        ),
        can.Message(
            arbitration_id=0x7F1, is_extended_id=False, is_fd=True, error_state_indicator=True, data=b"",
            timestamp=T0_S + 1.4,
        ),
        can.Message(arbitration_id=0x185, is_extended_id=False, data=b"\x01", timestamp=T0_S + 1.5),  # too short
    ]  # fmt: skip
    kinds.append(can.Message(arbitration_id=0, data=bytes(8), is_extended_id=False, timestamp=T0_S + 1.6))  # too long
    return [m for n, code in enumerate(X_CODES) for m in pair(n, code)] + kinds


def write(path: Path, messages: Sequence[can.Message]) -> Path:
    log = LogFile(path)
    for m in messages:
        assert log(m)
    assert (log.close(), log.error) == (len(messages), None)
    return path


@pytest.mark.parametrize("ending", OURS)
def test_frames_of_every_kind_come_back(tmp_path: Path, ending: str) -> None:
    sent = frames()
    got = list(read_frames(write(tmp_path / f"bus{ending}", sent)))
    assert len(got) == len(sent)
    for a, b in zip(sent, got, strict=True):
        if ending == ".mf4" and (a.is_remote_frame or a.is_error_frame):
            assert (b.is_remote_frame, b.is_error_frame) == (a.is_remote_frame, a.is_error_frame)
            continue  # its reader tells candump lines, which have no more of them
        assert a.equals(b, timestamp_delta=1e-6, check_channel=False), (a, b)


def test_mcap_keeps_direction_and_channel_and_every_digit_of_the_stamp(tmp_path: Path) -> None:
    sent = [
        can.Message(timestamp=0.1 + 1e-12, channel="can0", is_rx=False),
        can.Message(timestamp=-5.5, channel=3),
        can.Message(timestamp=1.7e9 + 1e-7),
    ]
    got = list(read_frames(write(tmp_path / "bus.mcap", sent)))
    assert [(m.timestamp, m.channel, m.is_rx) for m in got] == [(m.timestamp, m.channel, m.is_rx) for m in sent]


def test_the_mcap_reader_has_the_decoded_messages_with_units(tmp_path: Path) -> None:
    path = write(tmp_path / "bus.mcap", frames())
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        summary = reader.get_summary()
        found = [(s, c, m) for s, c, m in reader.iter_messages(topics=["/node5/PSA2_XY"])]
        raw = [json.loads(m.data) for _, _, m in reader.iter_messages(topics=["/can_raw"])]
    assert summary is not None
    assert summary.statistics is not None
    assert summary.statistics.message_count == len(frames()) + 2 * len(X_CODES) + 1  # and NMT
    assert len(raw) == len(frames())
    values = [json.loads(m.data)["X_V"] for _, _, m in found]
    assert values == pytest.approx([code * 10 / 2**23 for code in X_CODES], abs=1e-9)
    schema, channel, first = found[0]
    assert schema is not None
    assert first.log_time == 1_700_000_000_250_000_000
    assert channel.metadata == {"X_V": "V", "Y_V": "V", "SEQ": ""}
    properties = json.loads(schema.data)["properties"]
    assert properties["X_V"]["type"] == "number"
    assert "unit: V" in properties["X_V"]["description"]
    assert properties["SEQ"]["type"] == "integer"


READ_MF4 = """
import json, sys, asammdf
mdf = asammdf.MDF(sys.argv[1])
x = mdf.get("node5.PSA2_XY.X")
whole = mdf.extract_bus_logging({"CAN": [(sys.argv[2], 0)]}).get("X")
lists = x.samples.tolist(), x.timestamps.tolist(), whole.samples.tolist()
print(json.dumps([mdf.start_time.timestamp(), x.unit, *lists]))
"""


@WITH_MF4
def test_asammdf_has_channels_with_units_and_the_start_time(tmp_path: Path) -> None:
    path = write(tmp_path / "bus.mf4", frames()[:6])
    dbc = Path(__file__).resolve().parents[3] / "proto/psabench.dbc"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", READ_MF4, str(path), str(dbc)],
        env=os.environ | {"PYTHONPATH": str(mf4.FOLDER)},
        capture_output=True,
        text=True,
        check=True,
    )
    start_s, unit, samples, t_s, extracted = json.loads(done.stdout)
    assert start_s == 1_700_000_000.0
    assert unit == "V"
    assert samples == extracted == pytest.approx([code * 10 / 2**23 for code in X_CODES], abs=1e-9)
    assert t_s == pytest.approx([0.25, 0.251, 0.252], abs=1e-6)


@WITH_TSHARK
def test_tshark_reads_the_pcap(tmp_path: Path) -> None:
    path = write(tmp_path / "bus.pcap", frames())
    fields = "frame.time_epoch can.id can.flags.xtd can.flags.rtr can.flags.err can.len canfd.flags.brs".split()
    command = ["tshark", "-r", str(path), "-T", "fields", *(w for f in fields for w in ("-e", f))]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    rows = [line.split("\t") for line in done.stdout.splitlines()]
    assert len(rows) == len(frames())
    for row, m in zip(rows, frames(), strict=True):
        assert float(row[0]) == pytest.approx(m.timestamp, abs=1e-6)
        if not m.is_error_frame:  # whose identifier is shown as the kinds of error
            assert int(row[1]) == m.arbitration_id
        if not m.is_fd:
            bits = [b in ("1", "True") for b in row[2:5]]
            assert bits == [m.is_extended_id, m.is_remote_frame, m.is_error_frame]
        assert int(row[5]) == m.dlc


def test_rosbags_reads_accelerations(tmp_path: Path) -> None:
    log, bag = write(tmp_path / "bus.log", frames()), tmp_path / "imu.mcap"
    assert cli.main(["convert", str(log), str(bag), "--ros2-imu", "--v-per-g", "0.5"]) == 0
    with AnyReader([bag]) as reader:
        got: list[tuple[str, Any]] = [(c.topic, reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages()]
    assert [topic for topic, _ in got] == ["/node5/imu"] * len(X_CODES)
    for n, (code, (_, m)) in enumerate(zip(X_CODES, got, strict=True)):
        assert m.linear_acceleration.x == pytest.approx(code * 10 / 2**23 / 0.5 * G0_MPS2, abs=1e-9)
        assert m.header.stamp.sec == 1_700_000_000
        assert m.header.stamp.nanosec == pytest.approx(250_000_000 + n * 1_000_000, abs=1000)
        assert m.angular_velocity_covariance[0] == m.orientation_covariance[0] == -1.0


def test_a_log_goes_through_every_format_and_decodes_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write(tmp_path / "0.log", [m for n in range(50) for m in pair(n, n)])
    endings = [".log", ".mcap", ".pcap", ".blf", ".asc", *([".mf4"] if mf4.asammdf_is_there() else []), ".log"]
    tables = []
    for k, (before, after) in enumerate(pairwise(endings)):
        out = tmp_path / f"{k + 1}{after}"
        assert cli.main(["convert", str(tmp_path / f"{k}{before}"), str(out)]) == 0
        capsys.readouterr()
        assert cli.main(["decode", str(out)]) == 0
        rows = capsys.readouterr().out.splitlines()
        tables.append([",".join(row.split(",")[1:]) for row in rows])  # ASC has stamps from the first frame on
    assert len(tables[0]) == 51
    assert all(t == tables[0] for t in tables)


def test_another_node_has_its_own_topics(tmp_path: Path) -> None:
    path = tmp_path / "bus.mcap"
    log = LogFile(path, {9: "psa2"})
    for m in pair(0, 7, node=9):
        log(m)
    log.close()
    with path.open("rb") as file:
        topics = {c.topic for _, c, _ in make_reader(file).iter_messages()}
    assert topics == {"/can_raw", "/node9/PSA2_XY", "/node9/PSA2_ZT"}


@pytest.mark.parametrize("ending", [".mcap", ".pcap"])
def test_damaged_logs_end_in_bad_input_after_what_is_good(tmp_path: Path, ending: str) -> None:
    """Cut at every length, and 300 files with bytes changed: BadInput or fewer frames, nothing else."""
    path = write(tmp_path / f"bus{ending}", frames())
    data, chance = path.read_bytes(), random.Random(21)
    for cut in range(0, len(data) - 1, 7 if ending == ".mcap" else 1):
        assert_bounded(path, data[:cut])
    for _ in range(300):
        hurt = bytearray(data)
        for _ in range(chance.randrange(1, 6)):
            hurt[chance.randrange(len(hurt))] = chance.randrange(256)
        assert_bounded(path, bytes(hurt))


@pytest.mark.parametrize("ending", [".asc", ".csv", ".log", ".trc"])
def test_a_line_that_is_cut_is_no_frame(tmp_path: Path, ending: str) -> None:
    path = write(tmp_path / f"bus{ending}", [m for n in range(4) for m in pair(n, n)])
    data, whole = path.read_bytes(), [(m.arbitration_id, m.dlc, m.data) for m in read_frames(path)]
    assert len(whole) == 8
    for cut in range(data.rindex(b"\n", 0, len(data) // 2) + 2, len(data), 5):
        path.write_bytes(data[:cut])
        got = []
        with nullcontext() if data[cut - 1 : cut] in b"\r\n" else pytest.raises(BadInput, match=r"message \d"):
            for m in read_frames(path):
                got.append((m.arbitration_id, m.dlc, m.data))
        assert got == whole[: len(got)]


@pytest.mark.parametrize(
    ("ending", "was", "now"),
    [
        (".asc", " Rx ", " Qx "),
        (".asc", " d 8 ", " d 8z "),
        (".asc", " 00", ""),
        (".trc", " DT ", " QT "),
        (".trc", " 8 ", " z "),
        (".trc", " 00", ""),
        (".trc", " 185 ", " "),
        (".log", " vcan0 ", " "),
        (".log", "185#", "185"),
    ],
)
def test_a_damaged_line_is_named_after_the_frames_before_it(tmp_path: Path, ending: str, was: str, now: str) -> None:
    path = write(tmp_path / f"bus{ending}", [m for n in range(4) for m in pair(n, n)])
    whole = [(m.arbitration_id, bytes(m.data)) for m in read_frames(path)]
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    first = next(k for k, line in enumerate(lines) if re.search(r"\b0*[12]85\b|[12]85#", line))
    assert was in re.sub(r" 0*185 ", " 185 ", lines[first + 4])
    lines[first + 4] = re.sub(r" 0*185 ", " 185 ", lines[first + 4]).replace(was, now)
    path.write_text("".join(lines), encoding="utf-8")
    got: list[tuple[int, bytes]] = []
    with pytest.raises(BadInput, match=r"message 5: expected a whole message, got a damaged one .*the 4 before it are"):
        got.extend((m.arbitration_id, bytes(m.data)) for m in read_frames(path))
    assert got == whole[:4]


@pytest.mark.parametrize(
    ("ending", "line"),
    [
        (".asc", "// a comment"),
        (".asc", "   0.500000 Start of measurement"),
        (".asc", "   0.500000 1  Statistic: D 0 R 0 XD 0 XR 0 E 0 O 0 B 0.00%"),
        (".asc", "   0.500000 CAN 1 Status:chip status error active"),
        (".trc", ";   a comment"),
        (".trc", ""),
    ],
)
def test_lines_that_are_no_frames_are_passed_over(tmp_path: Path, ending: str, line: str) -> None:
    path = write(tmp_path / f"bus{ending}", [m for n in range(4) for m in pair(n, n)])
    lines = path.read_text(encoding="utf-8").splitlines(keepends=True)
    lines.insert(len(lines) - 3, f"{line}\n")
    path.write_text("".join(lines), encoding="utf-8")
    assert len(list(read_frames(path))) == 8


def assert_bounded(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    got: list[can.Message] = []
    with suppress(BadInput):
        for m in read_frames(path):
            got.append(m)
    assert len(got) <= len(frames())


def test_a_chunk_that_unpacks_without_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write(tmp_path / "bus.mcap", [can.Message(timestamp=float(n), data=bytes(8)) for n in range(5000)])
    monkeypatch.setattr(mcap_log, "MOST_CHUNK", 100_000)
    with pytest.raises(BadInput, match="chunks of 100000 bytes at most"):
        list(read_frames(path))


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"data": "zz"}, "hexadecimal"),
        ({"data": "00" * 65}, "up to 64 bytes"),
        ({"timestamp_s": float("nan")}, "timestamp_s"),
        ({"timestamp_s": 1e300}, "timestamp_s"),
        ({"id": 1.5}, "two integers"),
        ({"id": 1 << 29}, "arbitration"),
        ({"id": True}, "two integers"),
        ({"rx": 1}, "true or false"),
        ({"dlc": 70}, "DLC"),
    ],
)
def test_a_raw_record_is_checked(change: dict[str, object], why: str) -> None:
    record = records.raw_record(can.Message(timestamp=1.0, data=b"1"))
    assert records.frame_of(record).equals(can.Message(timestamp=1.0, data=b"1"))
    with pytest.raises(ValueError, match=why):
        records.frame_of({**record, **change})


def test_a_pcap_of_ethernet_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "net.pcap"
    path.write_bytes(struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1))
    with pytest.raises(BadInput, match=r"expected link type 227 \(SocketCAN\), got 1"):
        list(read_frames(path))


@pytest.mark.parametrize(
    ("line", "text"),
    [
        ("{log} {log}", "another file than the one that is read"),
        ("{log} out.xyz", "an ending of"),
        ("nothing.log {out}", "no such file"),
        ("{log} out.log --ros2-imu", "the ending .mcap"),
        ("{log} {out} --ros2-imu --board pik", "expected psa2"),
        ("{log} {out} --ros2-imu --node 9", "frames of node 9"),
    ],
)
def test_convert_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str], line: str, text: str) -> None:
    log = write(tmp_path / "bus.log", frames())
    words = line.format(log=log, out=tmp_path / "out.mcap").split()
    assert cli.main(["convert", *words]) == 2
    assert text in capsys.readouterr().err


LUA = Path(__file__).resolve().parents[3] / "share/wireshark/psabench.lua"


def test_the_dissector_is_that_of_the_dbc() -> None:
    assert LUA.read_text(encoding="utf-8") == wireshark.dissector_text(), "python -m psabench.logs.wireshark > " + str(
        LUA
    )


@WITH_TSHARK
def test_the_dissector_shows_every_signal_as_cantools_decodes_it(tmp_path: Path) -> None:
    """Each message of the DBC, full of random bits."""
    chance = random.Random(5)
    sent = [
        can.Message(
            arbitration_id=m.frame_id, data=chance.randbytes(m.length), is_extended_id=False, is_fd=m.length > 8
        )
        for m in database().messages
        for _ in range(4)
    ]
    path = write(tmp_path / "bus.pcap", sent)
    command = ["tshark", "-X", f"lua_script:{LUA}", "-r", str(path), "-T", "json", "-J", "psabench"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    shown = [packet["_source"]["layers"]["psabench"] for packet in json.loads(done.stdout)]
    assert len(shown) == len(sent)
    for m, layers in zip(sent, shown, strict=True):
        name = database().get_message_by_frame_id(m.arbitration_id).name
        values = message(name).decode(bytes(m.data), decode_choices=False)
        wanted = {f"psabench.{name}.{records.columns(name)[s]}".lower(): v for s, v in values.items()}
        assert {k: float(v) for k, v in layers.items()} == pytest.approx(wanted, rel=1e-12)


WITHOUT = (
    "import sys; sys.modules.update({'mcap': None, 'mcap_ros2': None, 'foxglove': None}); import psabench.cli as c; "
)


@pytest.mark.parametrize(
    "line", ["convert {log} {out}", "convert {out} new.pcap", "convert {log} {out} --ros2-imu", "view --can virtual:x"]
)
def test_a_package_that_is_missing_is_named(tmp_path: Path, line: str) -> None:
    log, out = write(tmp_path / "bus.log", frames()), write(tmp_path / "bus.mcap", frames())
    words = line.format(log=log, out=out).split()
    done = subprocess.run(
        [sys.executable, "-c", f"{WITHOUT} sys.exit(c.main({words}))"], capture_output=True, text=True
    )
    assert done.returncode == 2
    assert done.stderr.endswith("expected the extra 'logs', got none; pip install 'psabench[logs]'\n")
