"""MCAP logs: each frame whole (/can_raw), and decoded by the DBC (/node5/PSA2_XY), as JSON with schemas.

Foxglove, Lichtblick and PlotJuggler open them; `read_mcap` gives back the same frames. A chunk is written whole or not
at all, and the file is closed properly behind each one: it can be read whatever ended the recording. Source:
mcap.dev/spec.
"""

from __future__ import annotations

import io
import json
import struct
import zlib
from collections.abc import Callable, Container, Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import can
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk
from mcap.writer import Writer

from psabench.errors import BadInput, expected
from psabench.link.log_file import Checked
from psabench.logs.records import (
    RAW_NAME,
    RAW_SCHEMA,
    RAW_TOPIC,
    Decoder,
    frame_of,
    raw_record,
    schema,
    stamp_ns,
    units,
)
from psabench.logs.segments import SegmentFile

Found = TypeVar("Found")

MAGIC = b"\x89MCAP0\r\n"
CHUNK = 1 << 18  # bytes before compression
MOST_CHUNK = 1 << 27  # bytes that a reader takes
MOST_CHANNEL = 1 << 20  # bytes of a channel, whose metadata become a dictionary
MOST_RECORD = 4096  # bytes of a frame as JSON
RECORD = struct.Struct("<BQ")  # opcode and length
MESSAGE_HEAD = 22  # bytes of a message before its data; the first two: its channel
WINDOW = 1 << 27  # of zstandard, bytes
PART = 1 << 18  # bytes unpacked together
CLOSING = struct.pack("<BQI", 0x0F, 4, 0) + struct.pack("<BQQQI", 0x02, 20, 0, 0, 0) + MAGIC  # no summary


class Segment:
    """Where mcap's writer writes: memory, at the place that it will have in the file."""

    def __init__(self) -> None:
        self.begin, self._data = 0, bytearray()

    def write(self, data: bytes) -> int:
        self._data += data
        return len(data)

    def tell(self) -> int:
        return self.begin + len(self._data)

    def flush(self) -> None:
        """The caller takes it."""

    def take(self) -> bytes:
        data = bytes(self._data)
        self.begin += len(data)
        self._data.clear()
        return data


class ChunkFile:
    """mcap's writer onto a file of whole chunks. `writer` takes schemas, channels and messages."""

    def __init__(self, path: Path, profile: str = "") -> None:
        """Raises OSError."""
        self._file, self._segment = SegmentFile(path, CLOSING), Segment()
        self.writer = Writer(self._segment, chunk_size=1 << 60)  # type: ignore[arg-type]  # chunks end where `commit` says
        self.writer.start(profile=profile, library="psabench")
        self._file.append(self._segment.take())

    def commit(self) -> None:
        """End the chunk and write it. Raises OSError: then it is not in the file, and nothing more can be added."""
        self.writer.flush()  # type: ignore[no-untyped-call]
        if data := self._segment.take():
            self._file.append(data)

    def finish(self) -> None:
        """Write the summary, for programs that jump in the file. Raises OSError."""
        self.writer.finish()  # type: ignore[no-untyped-call]
        self._file.append(self._segment.take(), tail=False)

    def close(self) -> None:
        self._file.close()


class Mcap(Checked):
    """boards: by node, where they differ from the DBC's."""

    def __init__(self, path: Path, boards: Mapping[int, str] | None = None) -> None:
        self._decoder = Decoder(boards)
        self._file = ChunkFile(path)
        self._channels: dict[str, int] = {}
        self._sizes = self._held = self._stored = 0
        self._broken = False

    def on_message_received(self, m: can.Message) -> None:
        ns = stamp_ns(m.timestamp)
        self._add(RAW_TOPIC, RAW_NAME, raw_record(m), ns)
        if decoded := self._decoder.decoded(m):
            self._add(*decoded, ns)
        self._held += 1
        if self._sizes >= CHUNK:
            self.check()

    def _add(self, topic: str, name: str, record: dict[str, Any], ns: int) -> None:
        data = json.dumps(record, separators=(",", ":")).encode()
        self._sizes += len(data)
        channel = self._channels.get(topic) or self._channel(topic, name)
        self._file.writer.add_message(channel, log_time=ns, publish_time=ns, data=data)

    def _channel(self, topic: str, name: str) -> int:
        raw = topic == RAW_TOPIC
        text = json.dumps(RAW_SCHEMA if raw else schema(name)).encode()
        schema_id = self._file.writer.register_schema(name, "jsonschema", text)
        self._channels[topic] = self._file.writer.register_channel(topic, "json", schema_id, {} if raw else units(name))
        return self._channels[topic]

    def check(self) -> None:
        if self._held and not self._broken:
            self._broken = True  # unless the chunk is in the file
            self._file.commit()
            self._broken = False
            self._stored += self._held
            self._held = self._sizes = 0

    def stop(self) -> None:
        try:
            self.check()
            if not self._broken:
                self._file.finish()
        finally:
            self._file.close()

    def stored(self, written: int) -> int:
        return self._stored


def read_mcap(path: Path) -> Iterator[can.Message]:
    """Frames of /can_raw, in the order of the file. Raises BadInput for a damaged file, after the frames before it."""
    yield from _messages(path, RAW_TOPIC, frame_of)


def json_messages(path: Path, topic: str) -> Iterator[object]:
    """Those of a topic, parsed, in the order of the file. Raises BadInput for a damaged file, after those before it."""
    yield from _messages(path, topic, lambda parsed: parsed)


def _messages(path: Path, topic: str, made: Callable[[Any], Found]) -> Iterator[Found]:
    channels = set[int]()
    n = 0
    with path.open("rb") as file:
        try:
            for opcode, data in _all_records(file):
                if opcode == Opcode.CHANNEL:
                    c = Channel.read(ReadDataStream(io.BytesIO(data)))
                    if c.topic == topic and c.message_encoding == "json":
                        channels.add(c.id)
                elif int.from_bytes(data[:2], "little") in channels:
                    n += 1
                    yield made(_parsed_json(data[MESSAGE_HEAD:]))
        except DAMAGE as e:
            said = " ".join(str(e).split())[:120] or type(e).__name__
            raise BadInput(expected("a whole log", f"damage behind message {n} ({said})", path)) from e


# What reading hostile bytes comes to; struct.error: a record that is too short; zstandard's own.
DAMAGE = (McapError, ValueError, struct.error, EOFError, IndexError, zstandard.ZstdError, MemoryError, OverflowError)


def _parsed_json(data: bytes) -> object:
    """Raises ValueError."""
    if len(data) > MOST_RECORD:  # no frame takes as much; JSON nested so deep would end the parser
        raise ValueError(expected(f"records of {MOST_RECORD} bytes at most", len(data)))
    try:
        return json.loads(data)
    except RecursionError as e:
        raise ValueError(expected("a frame as JSON", "JSON nested too deep")) from e


# mcap's StreamReader makes an object of every record, and a list of all in a chunk: a gigabyte for 128 MiB of
# messages without data, which compress to some kilobytes. Here a record that is not needed is passed over.


def _all_records(file: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """Channels and messages by their opcodes, those in chunks as well. Raises one of DAMAGE."""
    if file.read(len(MAGIC)) != MAGIC:
        raise ValueError(expected("MCAP0 at the beginning", "another file"))
    for opcode, data in _records_of(file, (Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.FOOTER)):
        if opcode == Opcode.CHUNK:
            unpacked = _decompressed_chunk(Chunk.read(ReadDataStream(io.BytesIO(data))))
            yield from _records_of(io.BytesIO(unpacked), (Opcode.CHANNEL, Opcode.MESSAGE))
        elif opcode == Opcode.FOOTER:
            if file.read(len(MAGIC)) != MAGIC:
                raise EOFError("the file ends")
            return
        else:
            yield opcode, data
    raise EOFError("the file ends without a footer")


def _records_of(file: BinaryIO, wanted: Container[int]) -> Iterator[tuple[int, bytes]]:
    """Raises ValueError, EOFError."""
    begin = file.tell()
    left = file.seek(0, io.SEEK_END) - begin
    file.seek(begin)
    while left > 0:
        head = file.read(RECORD.size)
        opcode, length = RECORD.unpack(head.ljust(RECORD.size, b"\xff"))
        left -= RECORD.size + length
        if left < 0:
            raise EOFError("a record is cut")
        if opcode not in wanted:
            file.seek(length, io.SEEK_CUR)
            continue
        most = MOST_CHANNEL if opcode == Opcode.CHANNEL else MOST_CHUNK
        if length > most:
            raise ValueError(expected(f"records of {most} bytes at most", length))
        yield opcode, file.read(length)


def _decompressed_chunk(chunk: Chunk) -> bytes:
    """Never more than MOST_CHUNK, whatever the chunk says. Raises ValueError."""
    if chunk.compression not in ("", "zstd"):
        raise ValueError(expected("compression zstd or none", repr(chunk.compression[:20])))
    data = chunk.data
    if chunk.compression:
        data = b"".join(_unpacked_parts(data))
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise ValueError(expected(f"a chunk with the checksum {chunk.uncompressed_crc:08x}", f"{zlib.crc32(data):08x}"))
    return data


def _unpacked_parts(data: bytes) -> Iterator[bytes]:
    """Raises ValueError beyond MOST_CHUNK bytes."""
    size = 0
    with zstandard.ZstdDecompressor(max_window_size=WINDOW).stream_reader(data) as stream:
        while part := stream.read(PART):
            size += len(part)
            if size > MOST_CHUNK:
                raise ValueError(expected(f"chunks of {MOST_CHUNK} bytes at most", "more"))
            yield part
