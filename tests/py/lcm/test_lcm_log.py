"""LCM event logs: written by LCM's own library and by us; damaged; as a format of python-can."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import can
import lcm
import pytest
from psabench.errors import BadInput
from psabench.lcm.can_io import LcmReader, LcmWriter
from psabench.lcm.event_log import put_event, read_events
from psabench.lcm.frames import read_frames, to_values
from psabench.lcm.types import lcm_type
from psabench.link.log_file import LogFile

ROOT = Path(__file__).resolve().parents[3]
FRAMES = (
    can.Message(timestamp=0.000055, arbitration_id=0x705, is_extended_id=False, data=b"\0"),
    can.Message(timestamp=1.5, arbitration_id=0x123, is_extended_id=False, data=bytes(8)),
    can.Message(timestamp=2.0, arbitration_id=0x12345678, data=bytes(range(64)), is_fd=True, bitrate_switch=True),
    can.Message(timestamp=3.0, arbitration_id=5, is_extended_id=False, is_remote_frame=True, dlc=4),
    can.Message(timestamp=4.0, arbitration_id=4, is_error_frame=True, data=bytes(8)),
    can.Message(timestamp=1.8e9 + 1e-6, arbitration_id=0x7FF, is_extended_id=False, data=b""),
)


def write_with_lcm(path: Path, frames: Sequence[can.Message] = FRAMES) -> Path:
    log = lcm.EventLog(str(path), "w", overwrite=True)
    log.write_event(0, "OTHER", b"not of ours")
    for m in frames:
        data = lcm_type("can_frame_t").encode(to_values(m, "can0"))
        log.write_event(round(m.timestamp * 1e6), "PSABENCH_CAN_can0", data)
    log.close()
    return path


def assert_same(got: Sequence[can.Message], want: Sequence[can.Message] = FRAMES) -> None:
    assert len(got) == len(want)
    for a, b in zip(got, want, strict=True):
        assert a.equals(b, timestamp_delta=1e-6, check_channel=False, check_direction=False), (a, b)


def test_frames_of_a_log_that_lcm_has_written(tmp_path: Path) -> None:
    path = write_with_lcm(tmp_path / "a.lcmlog")
    assert_same(list(read_frames(path)))
    assert {m.channel for m in read_frames(path)} == {"can0"}
    assert_same(list(read_frames(path, "can0")))
    assert list(read_frames(path, "can1")) == []


def test_events_are_the_same_to_lcm_and_to_us_both_ways(tmp_path: Path) -> None:
    theirs, ours = write_with_lcm(tmp_path / "a.lcmlog"), tmp_path / "b.lcmlog"
    events = list(read_events(theirs))
    ours.write_bytes(b"".join(put_event(e.number, e.t_us, e.channel, e.data) for e in events))
    assert ours.read_bytes() == theirs.read_bytes()
    log = lcm.EventLog(str(ours))
    assert [(e.eventnum, e.timestamp, e.channel, e.data) for e in log] == [
        (e.number, e.t_us, e.channel, e.data) for e in events
    ]
    assert events[0].type is None
    with pytest.raises(ValueError, match="OTHER: expected a type of proto/lcm"):
        _ = events[0].values
    assert events[1].values["id"] == 0x705


@pytest.mark.parametrize("writer", [LcmWriter, LogFile])
def test_python_can_s_messages_go_in_and_come_out(writer: type[LcmWriter] | type[LogFile], tmp_path: Path) -> None:
    path = tmp_path / "run.lcmlog"
    out = writer(path)
    for m in FRAMES:
        out(m)
    if isinstance(out, LogFile):
        assert out.close() == len(FRAMES)
    else:
        out.stop()
    with LcmReader(path) as messages:
        assert_same(list(messages))
    assert [e.eventnum for e in lcm.EventLog(str(path))] == list(range(len(FRAMES)))


@pytest.mark.parametrize("cut", [1, 27, 28, 29, 40, 100])
def test_a_log_that_is_cut_short_gives_what_is_whole_and_says_where(cut: int, tmp_path: Path) -> None:
    path = write_with_lcm(tmp_path / "a.lcmlog", FRAMES[:2])
    whole = path.read_bytes()
    begin = whole.rindex(struct.pack(">I", 0xEDA1DA01))
    path.write_bytes(whole[: begin + cut])
    frames = read_frames(path)
    assert_same([next(frames)], FRAMES[:1])
    with pytest.raises(
        BadInput,
        match=r"event 3: expected an event of an LCM log, got damaged bytes; the 2 events before",
    ):
        next(frames)


@pytest.mark.parametrize(
    ("offset", "data"),
    [
        (0, b"\0"),
        (20, struct.pack(">i", 0)),
        (20, struct.pack(">i", -1)),
        (20, struct.pack(">i", 64)),
        (24, struct.pack(">i", -1)),
        (24, struct.pack(">i", 1 << 30)),
    ],
)
def test_a_header_that_cannot_be_is_no_log(offset: int, data: bytes, tmp_path: Path) -> None:
    path = tmp_path / "a.lcmlog"
    event = put_event(0, 0, "CHANNEL", b"data")
    path.write_bytes(event[:offset] + data + event[offset + len(data) :])
    with pytest.raises(BadInput, match=r"a.lcmlog: event 1: expected an event of an LCM log, got other bytes"):
        list(read_events(path))


@pytest.mark.parametrize(
    "change", [{"length": 65, "size": 65, "data": bytes(65)}, {"length": 3}, {"length": 9, "size": 9, "data": bytes(9)}]
)
def test_a_frame_that_no_bus_carries_is_named(change: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "a.lcmlog"
    values = to_values(FRAMES[1], "can0") | change
    path.write_bytes(put_event(0, 0, "PSABENCH_CAN_can0", lcm_type("can_frame_t").encode(values)))
    with pytest.raises(BadInput, match=r"a.lcmlog: event 1: expected a CAN frame, got damaged bytes \("):
        list(read_frames(path))


def test_paths_that_cannot_be_read_are_the_user_s(tmp_path: Path) -> None:
    for path, words in (
        (tmp_path / "none", "expected an LCM log, got no such file"),
        (tmp_path, "expected an LCM log, got a folder"),
    ):
        with pytest.raises(BadInput, match=words):
            list(read_frames(path))
    (tmp_path / "empty").touch()
    assert list(read_frames(tmp_path / "empty")) == []


def test_a_name_that_lcm_has_no_room_for_is_refused() -> None:
    for name in ("", "x" * 64):
        with pytest.raises(ValueError, match="a channel name of 1 to 63 bytes"):
            put_event(0, 0, name, b"")


@pytest.mark.parametrize("there", [True, False])
def test_the_example_makes_the_same_table_with_and_without_pandas(there: bool, tmp_path: Path) -> None:
    said = "" if there else "NumPy: pandas is not installed\n"
    path = tmp_path / "without"
    path.mkdir()
    if not there:
        (path / "pandas.py").write_text("raise ImportError\n")
    kind = lcm_type("psa2_reading_t")
    zeros = {
        "epoch_ns": 0,
        "unit": "a",
        "form": 0,
        "sample": 0,
        "x_code": 1,
        "y_code": 2,
        "z_code": 3,
        "t_sample_s": 0.0,
    }
    zeros |= {"temp_channel": 1, "temp_new": False, "settled": True, "clipped": False, "overrun": False}
    data = b""
    for n in range(3):
        row = {**zeros, "t_ns": 1000 * n + 1, "x_v": n / 3, "y_v": -1e-7, "z_v": 0.0, "sequence": n, "temp_code": -n}
        data += put_event(2 * n, n, "PSABENCH_PSA2_a", kind.encode(row))
        data += put_event(2 * n + 1, n, "PSABENCH_PSA2_b", kind.encode({**row, "x_v": 5.0}))  # of another unit
    (tmp_path / "run.lcmlog").write_bytes(data)
    done = subprocess.run(
        [sys.executable, ROOT / "examples/lcm_to_pandas.py", "run.lcmlog"],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(path)}, capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert done.stdout == f"{said}run.csv: 3 readings, 0.000 s, mean of X 0.333333 V\n"
    assert (tmp_path / "run.csv").read_text().splitlines() == [
        "t_s,x_v,y_v,z_v,sequence,temp_code,settled",
        "1e-09,0.0,-1e-07,0.0,0,0,1",
        "1.001e-06,0.3333333333333333,-1e-07,0.0,1,-1,1",
        "2.001e-06,0.6666666666666666,-1e-07,0.0,2,-2,1",
    ]
