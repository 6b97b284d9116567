"""Hostile logs, every format that psabench reads: a typed error in one line, bounded memory, never a traceback.

The seed of the changed files is fixed, and is printed and part of every failure.
"""

from __future__ import annotations

import sqlite3
import struct
import tracemalloc
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import can
import numpy as np
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, Message
from psabench import cli
from psabench.conform.sources import blf, mf4
from psabench.errors import BadInput
from psabench.lcm.event_log import HEADER, SYNC
from psabench.link.log_file import LogFile
from psabench.logs import pcap
from psabench.logs.formats import READABLE, read_frames
from psabench.logs.mcap_log import MAGIC

from tests.conform.recording.test_conform_recording_files import mutated, near_the_head

SEED = 20261126
ROUNDS, ROUNDS_MF4 = 60, 2  # an MF4 starts a process
MOST_PEAK = 48e6  # bytes of Python's memory; good files of the tests take less than one
WITH_MF4 = pytest.mark.skipif(not mf4.asammdf_is_there(), reason="asammdf is not there: make setup")


def sent() -> list[can.Message]:
    return [
        can.Message(timestamp=1 + n * 1e-3, arbitration_id=0x185, is_extended_id=False, data=bytes([n]) * 8)
        for n in range(60)
    ]


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], bytes]:
    """A good file of a format, made once."""
    folder, made = tmp_path_factory.mktemp("good"), dict[str, bytes]()

    def of(ending: str) -> bytes:
        if ending not in made:
            log = LogFile(folder / f"good{ending}")
            assert all(log(m) for m in sent())
            assert log.close() == len(sent())
            made[ending] = (folder / f"good{ending}").read_bytes()
        return made[ending]

    return of


def read(path: Path, data: bytes, most_peak: float = MOST_PEAK) -> tuple[int, str]:
    """How many frames came, and the error behind them; within bounds of memory."""
    path.write_bytes(data)
    frames, error = 0, ""
    tracemalloc.start()
    try:
        for _ in read_frames(path):
            frames += 1
    except BadInput as e:
        error = str(e)
    finally:
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    assert peak < most_peak
    assert not error or (str(path) in error and "\n" not in error)
    return frames, error


@pytest.mark.parametrize("ending", [pytest.param(e, marks=[WITH_MF4] if e == ".mf4" else []) for e in READABLE])
def test_changed_files_end_in_frames_or_words(
    ending: str, good: Callable[[str], bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path, sound = tmp_path / f"x{ending}", good(ending)
    assert read(path, sound) == (len(sent()), "")
    refused = 0
    for n in range(ROUNDS_MF4 if ending == ".mf4" else ROUNDS):
        rng = np.random.default_rng([SEED, *ending.encode(), n])
        data = (near_the_head if n % 2 else mutated)(sound, rng)
        try:
            refused += bool(read(path, data)[1])
        except Exception as e:
            raise AssertionError(f"seed {SEED}, {ending}, round {n}") from e
    capsys.readouterr()
    print(f"seed {SEED}, {ending}: {refused} refused")
    path.write_bytes(b"\xff\xfe" * 9 + sound)
    assert cli.main(["decode", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.startswith("psabench: ")
    assert (said.count("\n"), str(path) in said) == (1, True)


# ---- MCAP


def mcap(*records: Channel | Chunk | Message) -> bytes:
    return MAGIC + packed(*records)


def packed(*records: Channel | Chunk | Message) -> bytes:
    builder = RecordBuilder()
    for r in records:
        r.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def raw_channel(metadata: dict[str, str] | None = None) -> Channel:
    return Channel(id=1, topic="/can_raw", message_encoding="json", metadata=metadata or {}, schema_id=0)


def message(data: bytes) -> Message:
    return Message(channel_id=1, log_time=0, data=data, publish_time=0, sequence=0)


def chunk(data: bytes) -> Chunk:
    return Chunk(
        compression="zstd",
        data=zstandard.compress(data),
        message_end_time=0,
        message_start_time=0,
        uncompressed_crc=0,
        uncompressed_size=len(data),
    )


def test_a_small_mcap_of_many_empty_messages_takes_little_memory(tmp_path: Path) -> None:
    """Were each an object: 20 MB here, more than a gigabyte for the largest chunk."""
    other = packed(Message(channel_id=7, log_time=0, data=b"", publish_time=0, sequence=0))
    data = mcap(raw_channel(), chunk(other * 50_000))
    assert len(data) < 10_000
    assert read(tmp_path / "x.mcap", data, 8e6)[1].endswith("(the file ends without a footer)")


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (mcap(raw_channel(), message(b"[" * 4000)), "JSON nested too deep"),
        (mcap(raw_channel(), message(b'{"x":' * 100_000)), "records of 4096 bytes at most"),
        (mcap(raw_channel({str(n): "" for n in range(120_000)})), "records of 1048576 bytes at most"),
        (MAGIC + struct.pack("<BQ", 6, 1 << 63), "a record is cut"),
        (MAGIC + struct.pack("<BQ", 0x99, (1 << 64) - 1), "a record is cut"),
        (MAGIC + struct.pack("<BQ", 5, 22), "a record is cut"),
        (mcap(raw_channel(), message(b'{"channel":[]}')), "damage behind message 1"),
        (mcap(chunk(b"\5" + b"\0" * 7)), "a record is cut"),
        (b"MCAP", "MCAP0 at the beginning"),
    ],
)
def test_hostile_mcap(data: bytes, why: str, tmp_path: Path) -> None:
    assert why in read(tmp_path / "x.mcap", data)[1]


def test_a_channel_of_another_kind_is_refused(good: Callable[[str], bytes], tmp_path: Path) -> None:
    record = b'{"timestamp_s":1,"id":1,"dlc":0,"data":"","extended":false,"remote":false,"error":false,"fd":false,'
    record += b'"brs":false,"esi":false,"rx":true,"channel":{"a":1}}'
    assert (
        "expected a channel, a name or a number" in read(tmp_path / "x.mcap", mcap(raw_channel(), message(record)))[1]
    )


# ---- the others


def test_lengths_of_a_pcap_and_of_an_lcm_log_are_not_believed(tmp_path: Path) -> None:
    packet = struct.pack("<IIII", 0, 0, 0xFFFFFFFF, 0)
    assert "a packet of 72 bytes at most" in read(tmp_path / "x.pcap", pcap.HEADER + packet)[1]
    assert "expected a whole record, got 9 bytes" in read(tmp_path / "x.pcap", pcap.HEADER + packet[:9])[1]
    event = HEADER.pack(SYNC, 0, 0, 5, 1 << 31)
    assert "expected an event of an LCM log" in read(tmp_path / "x.lcmlog", event + b"abcde")[1]


@pytest.mark.timeout(60)
def test_an_object_of_a_blf_without_a_length_does_not_hang(good: Callable[[str], bytes], tmp_path: Path) -> None:
    odd = struct.pack("<4sHHLL", b"LOBJ", 32, 7, 0, 1) + bytes(32)
    container = blf.CONTAINER.pack(0, len(odd)) + odd
    base = blf.BASE.pack(b"LOBJ", 16, 1, blf.BASE.size + len(container), 10)
    assert "an object of 0 bytes" in read(tmp_path / "x.blf", good(".blf")[:144] + base + container)[1]


def test_a_line_without_an_end_is_refused(tmp_path: Path) -> None:
    frames, error = read(tmp_path / "x.log", b"(1.0) can0 185#00\n" + b"x" * (20 << 20))
    assert (frames, "lines of 65536 characters at most" in error) == (1, True)


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i, i, 0, 0, 0, 0, x'' FROM n"
TABLE = "CREATE TABLE messages (ts REAL, arbitration_id INTEGER, extended, remote, error, dlc INTEGER, data BLOB)"


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (f"CREATE VIEW messages AS {ENDLESS}", "expected the table messages of python-can"),
        ("CREATE TABLE other (x)", "expected the table messages of python-can, got none"),
        ("CREATE TABLE messages (x)", "no such column"),
        (f"{TABLE}; INSERT INTO messages VALUES (1, 1, 0, 0, 0, 8, zeroblob(70000000))", "too big"),
        (f"{TABLE}; INSERT INTO messages VALUES ('x', 1, 0, 0, 0, 0, x'')", "could not convert"),
        (f"{TABLE}; INSERT INTO messages VALUES (1, 'x', 0, 0, 0, 0, x'')", "message 1: "),
        (f"{TABLE}; INSERT INTO messages VALUES (1, 1, 0, 0, 0, NULL, x'')", "message 1: "),
        (f"{TABLE}; INSERT INTO messages VALUES (1, 1, 0, 0, 0, 9000, x'')", "message 1: "),
    ],
)
def test_hostile_sqlite(words: str, why: str, tmp_path: Path) -> None:
    path = tmp_path / "made.db"
    with closing(sqlite3.connect(path)) as db:
        db.executescript(words)
    assert why in read(tmp_path / "x.db", path.read_bytes())[1]


def test_a_page_that_is_named_twice_ends_a_database(tmp_path: Path) -> None:
    """Many times at many levels it would be rows without end."""
    path = tmp_path / "made.db"
    with closing(sqlite3.connect(path)) as db:
        db.execute(TABLE)
        db.executemany(
            "INSERT INTO messages VALUES (?, 1, 0, 0, 0, 8, x'0011223344556677')", [(n,) for n in range(500)]
        )
        db.commit()
        root, size = db.execute("SELECT rootpage FROM sqlite_master").fetchone()[0], 4096
    data = bytearray(path.read_bytes())
    page = (root - 1) * size
    assert data[page] == 5  # an inner page: its cells begin with the number of a child
    first, second = struct.unpack_from(">HH", data, page + 12)
    data[page + second : page + second + 4] = data[page + first : page + first + 4]
    frames, error = read(tmp_path / "x.db", bytes(data))
    assert "expected a row behind" in error
    assert 0 < frames < 500
