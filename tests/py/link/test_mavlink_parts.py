"""Parts of `psabench mavlink` that need no bench: parameters, ports, rates, a station that any message may reach."""

from __future__ import annotations

import math
import random
import struct
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from psabench.boards.parameters import PARAMETERS
from psabench.boards.psa2.frames import Frames
from psabench.mavlink.dialect import mavlink
from psabench.mavlink.parameters import I32, R32, U32, Parameter, Parameters
from psabench.mavlink.ports import PortSpec, port_spec
from psabench.mavlink.samples import ACCEL, IMU, Rate, Samples, Scale
from psabench.mavlink.station import CalibrateJob, Identity, ReadJob, Requester, Station, WriteJob

# ---- parameters


@pytest.mark.parametrize(
    ("kind", "value"),
    [(R32, 0.5), (R32, 2.0**24 - 1), (R32, -(2.0**23)), (U32, 2.0**32 - 1), (I32, -(2.0**31)), (I32, -1.0), (U32, 0.0)],
)
def test_a_value_comes_back_as_it_was_sent(kind: int, value: float) -> None:
    p = Parameter(name="P", value=value, kind=kind, integer=kind != R32, write=lambda _: None)
    assert p.check(kind, p.wire()) == value


@pytest.mark.parametrize(
    ("kind", "wire", "expected"),
    [
        (R32, math.nan, "expected an integer from 0 to 3, got nan"),
        (R32, math.inf, "got inf"),
        (R32, 1.5, "got 1.5"),
        (R32, 4.0, "got 4"),
        (1, 1.0, "expected type REAL32, INT32 or UINT32, got 1"),
    ],
)
def test_what_is_no_value_is_refused_in_words(kind: int, wire: float, expected: str) -> None:
    p = Parameter(name="P", integer=True, low=0.0, high=3.0, write=lambda _: None)
    with pytest.raises(ValueError, match=expected):
        p.check(kind, wire)
    with pytest.raises(ValueError, match="got a read-only one"):
        Parameter(name="P").check(R32, 1.0)


def test_parameters_keep_their_index_when_they_are_replaced() -> None:
    every = Parameters()
    assert [every.add(Parameter(name=n)) for n in ("A", "B", "A")] == [0, 1, 0]
    assert len(every) == 2
    assert (every.find("B"), every.find("", 0), every.find("", 2), every.find("C")) == (1, 0, None, None)
    with pytest.raises(ValueError, match="1 to 16 characters"):
        every.add(Parameter(name="X" * 17))


def test_names_of_objects_fit_and_are_unique() -> None:
    for board, names in PARAMETERS.items():
        assert len(set(names.values())) == len(names), board
        assert all(0 < len(n) <= 16 and n.isascii() and n == n.upper() for n in names), board


# ---- ports and rates


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("udp", PortSpec("udp", 14550)),
        ("udp:1", PortSpec("udp", 1)),
        ("udpin:0", PortSpec("udpin", 0)),
        ("tcp:5760", PortSpec("tcp", 5760)),
    ],
)
def test_a_port_is_a_kind_and_a_number(text: str, expected: PortSpec) -> None:
    assert port_spec(text) == expected


@pytest.mark.parametrize("text", ["", "udp:", "udp:0", "tcp:65536", "tcp:-1", "pty:/dev/x", "tcp:1:2"])
def test_another_port_is_refused(text: str) -> None:
    with pytest.raises(ValueError, match="expected"):
        port_spec(text)


def test_a_rate_is_kept_on_average_and_after_a_pause() -> None:
    rate = Rate(0.01)
    assert sum(rate.due(k * 0.003) for k in range(1000)) in range(299, 302)  # 3 s of readings each 3 ms
    assert rate.due(100.0)
    assert rate.due(0.0)  # the board was reset, its time begins again
    assert not Rate(None).due(1.0)
    assert all(Rate(0.0).due(float(k)) for k in range(5))


def test_readings_become_messages_with_their_codes() -> None:
    codes = np.array([[2**23 - 1, -(2**23), 5], [0, 1, -1]])
    sent: list[Any] = []
    none = np.zeros(2, dtype=np.int64)
    frames = Frames(
        t_rx_s=np.array([1.0, 1.001]),
        t_sample_s=np.array([1.0, 1.001]),
        seq=none,
        u_v=codes * (10.0 / 2**23),
        temp_code=none - 5,
        temp_channel=none + 3,
        settled=none == 0,
        clipped=np.array([True, False]),
    )
    Samples(sent.append, Scale(g_mps2=10.0), imu_hz=1.0, codes_hz=None).take(frames)
    exact, imu, second = sent
    assert [exact.code, second.code] == codes.tolist()
    assert (exact.status, second.status, exact.temp_code, exact.time_usec) == (3, 1, -5, 1_000_000)
    assert exact.accel_mps2[2] == pytest.approx((5 * 10 / 2**23 - 2.5) * 10)
    assert imu.zacc == -exact.accel_mps2[2]  # specific force
    assert (exact.get_msgId(), imu.get_msgId()) == (ACCEL, IMU)


# ---- a station without a thread


@pytest.fixture
def sent(monkeypatch: pytest.MonkeyPatch) -> list[Any]:
    return []


@pytest.fixture
def station(sent: list[Any], monkeypatch: pytest.MonkeyPatch) -> Iterator[Station]:
    """One whose messages are kept; parameters A, which is its own, and B, which is the unit's."""
    every = Parameters()
    every.add(Parameter(name="A", value=1.0, low=0.0, high=9.0, write=lambda _: None))
    every.add(Parameter(name="B", value=2.0, read=lambda: 3.0, write=lambda _: None))
    s = Station(PortSpec("udpin", 0), Identity(sysid=4, compid=5), every, lambda: 77)
    monkeypatch.setattr(s, "send", sent.append)
    yield s
    s.close()


def incoming(name: str, *fields: Any) -> Any:
    """A message of a ground station, 255/190, through its bytes."""
    m = mavlink()
    packed = getattr(m, f"MAVLink_{name}_message")(*fields).pack(m.MAVLink(None, 255, 190))
    [got] = m.MAVLink(None).parse_buffer(packed)
    return got


def long(command: int, *p: float, confirmation: int = 0, system: int = 4) -> Any:
    return incoming("command_long", system, 5, command, confirmation, *p, *[0.0] * (7 - len(p)))


def results(sent: list[Any]) -> list[int]:
    return [m.result for m in sent if m.get_type() == "COMMAND_ACK"]


@pytest.mark.parametrize(
    ("command", "p", "expected"),
    [
        (512, (148.0,), 0),
        (512, (105.0,), 3),
        (512, (math.nan,), 2),
        (512, (math.inf,), 2),
        (511, (105.0, 1.0), 2),
        (400, (1.0,), 3),
        (241, (1.0,), 3),
        (241, (0.0, 0.0, 0.0, 0.0, 2.0), 3),
    ],
)
def test_each_command_is_answered(
    station: Station, sent: list[Any], command: int, p: tuple[float, ...], expected: int
) -> None:
    station.take(long(command, *p))
    assert results(sent) == [expected]
    station.take(long(command, *p, system=9))  # somebody else
    assert len(results(sent)) == 1


def test_a_calibration_is_acknowledged_repeated_rejected_and_cancelled(station: Station, sent: list[Any]) -> None:
    nan = math.nan
    start = (nan, nan, 0.0, 0.0, 1.0, nan, nan)  # as MAVSDK leaves what it does not use
    station.take(long(241, *start))
    assert station.jobs.get_nowait() == CalibrateJob(Requester(sysid=255, compid=190))
    station.take(long(241, *start, confirmation=1))
    station.take(long(241, *start))
    assert results(sent) == [5, 5, 1]
    station.calibration_progress(50)
    station.calibration_progress(50)
    assert [m.progress for m in sent if m.get_type() == "COMMAND_ACK"][3:] == [50]
    assert not station.cancelled()
    station.take(long(241))
    assert station.cancelled()
    station.calibration_over(6, "cancelled")
    assert results(sent)[-1] == 6
    station.take(long(241))  # nothing runs
    assert results(sent)[-1] == 0
    station.take(long(241, *start))
    assert not station.cancelled()
    texts = [m.text for m in sent if m.get_type() == "STATUSTEXT"]
    assert texts == [
        "[cal] calibration started: 2 accel",
        "[cal] progress <50>",
        "[cal] calibration cancelled",
        "[cal] calibration started: 2 accel",
    ]


def test_a_bench_without_a_head_denies_it(station: Station, sent: list[Any]) -> None:
    station.can_calibrate = False
    station.take(long(241, 0.0, 0.0, 0.0, 0.0, 1.0))
    assert results(sent) == [2]
    assert station.jobs.empty()


def test_parameters_are_read_where_they_are_but_not_while_a_calibration_runs(station: Station, sent: list[Any]) -> None:
    station.take(incoming("param_request_list", 4, 5))
    assert [m.param_id for m in sent] == ["A"]
    assert station.jobs.get_nowait() == ReadJob(1)
    station.take(incoming("param_set", 4, 5, b"B", 7.0, R32))
    assert station.jobs.get_nowait() == WriteJob(1, 7.0)
    station.take(incoming("param_set", 4, 5, b"A", 10.0, R32))
    assert sent[-1].param_id == "A"
    assert sent[-2].text == "A: expected a number from 0 to 9, got 10"
    station.take(long(241, 0.0, 0.0, 0.0, 0.0, 1.0))
    station.jobs.get_nowait()
    station.take(incoming("param_request_read", 4, 5, b"B", -1))
    assert (sent[-1].param_id, sent[-1].param_value) == ("B", 2.0)  # as it is known
    station.take(incoming("param_request_read", 4, 5, b"\x01\x02", -1))
    assert sent[-1].text == "??: expected a parameter of this system"


def test_files_are_refused_and_pings_answered(station: Station, sent: list[Any]) -> None:
    station.take(incoming("file_transfer_protocol", 0, 4, 5, [255, 255, 3, 4, *[0] * 247]))
    assert bytes(sent[-1].payload[:13]) == bytes([0, 0, 3, 129, 1, 4, 0, 0, 0, 0, 0, 0, 10])
    station.take(incoming("ping", 5, 6, 0, 0))
    assert (sent[-1].seq, sent[-1].target_system) == (6, 255)
    station.take(incoming("timesync", 0, 123))
    assert (sent[-1].tc1, sent[-1].ts1) == (77000, 123)
    count = len(sent)
    station.take(incoming("ping", 5, 6, 9, 9))
    station.take(incoming("timesync", 1, 123))
    assert len(sent) == count


def test_any_bytes_and_any_content_reach_no_exception(station: Station, sent: list[Any]) -> None:
    noise = random.Random(1)
    m = mavlink()
    parse: Callable[[bytes], list[Any]] = station._new_parser()
    for _ in range(300):
        for got in parse(noise.randbytes(noise.randrange(64)) + b"\xfd"):
            station.take(got)
    kinds = ("COMMAND_LONG", "COMMAND_INT", "PARAM_SET", "PARAM_REQUEST_READ", "FILE_TRANSFER_PROTOCOL", "PING")
    classes = [c for c in m.mavlink_map.values() if c.msgname in kinds]
    for _ in range(600):
        kind = noise.choice(classes)
        size = struct.calcsize(kind.unpacker.format)
        body = bytearray(noise.randbytes(size))
        message = m.MAVLink(None).decode(_framed(m, kind, bytes(body)))
        station.take(message)
        while not station.jobs.empty():
            station.jobs.get_nowait()
    assert station.malformed > 0


def _framed(m: Any, kind: Any, payload: bytes) -> bytearray:
    """A frame of this message with these bytes, its checksum right."""
    crc = m.x25crc()
    head = struct.pack("<BBBBBBBHB", 253, len(payload), 0, 0, 0, 255, 190, kind.id & 0xFFFF, kind.id >> 16)
    crc.accumulate(head[1:] + payload)
    crc.accumulate(bytes([kind.crc_extra]))
    return bytearray(head + payload + struct.pack("<H", crc.crc))


def test_a_thread_that_fails_is_noticed(station: Station, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(station, "_poll", lambda: 1 / 0)
    station.start()
    deadline_s = time.monotonic() + 10.0
    while station.failure is None and time.monotonic() < deadline_s:
        station._thread.join(0.01)
    assert isinstance(station.failure, ZeroDivisionError)
