"""BLF logs, made safe: every length is checked and each container unpacked within bounds before python-can reads it.

Format: as python-can writes and reads it (Vector's "binary logging format"; objects begin with LOBJ).
"""

from __future__ import annotations

import io
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path

from psabench.errors import expected

HEADER_BYTES = 144
BASE = struct.Struct("<4sHHLL")  # signature, header size and version, object size, type
CONTAINER = struct.Struct("<H6xL4x")  # method, unpacked size
LEAST_OBJECT = 32  # bytes of an object with its header
CONTAINER_TYPE, PLAIN, DEFLATE = 10, 0, 2
VERSIONS = (1, 2)
MOST_UNPACKED = 64 << 20  # bytes of a container's objects


def safe_blf(path: Path) -> Iterator[tuple[io.BytesIO, str]]:
    """The same log in pieces, each a log with one plain container, and where it is damaged from there on ("": nowhere).

    Raises ValueError for what is no BLF, OSError.
    """
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES)
        if len(header) < HEADER_BYTES or header[:4] != b"LOGG":
            raise ValueError(expected("a BLF header", repr(header[:4])))
        size = struct.unpack_from("<L", header, 4)[0]
        if not HEADER_BYTES <= size <= 1 << 16:
            raise ValueError(expected(f"a header of {HEADER_BYTES} to {1 << 16} bytes", size))
        file.seek(size)
        plain = header[:4] + struct.pack("<L", HEADER_BYTES) + header[8:]
        for objects, trouble in _whole_objects(file):
            yield io.BytesIO(plain + _container(objects)), trouble


def _whole_objects(file: io.BufferedReader) -> Iterator[tuple[bytes, str]]:
    """Objects of one container after the other; one that goes on in the next container comes with that.

    One that goes on in a container that is not there was never stored whole: so ends a recording on a full disk.
    """
    rest, before = b"", 0  # unpacked bytes before the rest
    for part, trouble in _unpacked(file):
        objects = rest + part
        end, odd = _sound(objects, before)
        yield objects[:end], odd or trouble
        if odd or trouble:
            return
        rest, before = objects[end:], before + end
        if len(rest) > MOST_UNPACKED:
            yield b"", f"an object of more than {MOST_UNPACKED} bytes at unpacked byte {before}"
            return


def _container(objects: bytes) -> bytes:
    size = BASE.size + CONTAINER.size + len(objects)
    head = BASE.pack(b"LOBJ", BASE.size, 1, size, CONTAINER_TYPE) + CONTAINER.pack(PLAIN, len(objects))
    return head + objects + b"\0" * (size % 4)


def _unpacked(file: io.BufferedReader) -> Iterator[tuple[bytes, str]]:
    """The objects of each container, and what is wrong with the file from there on."""
    while True:
        where = file.tell()
        base = file.read(BASE.size)
        if not base:
            return
        if len(base) < BASE.size or base[:4] != b"LOBJ":
            yield b"", f"no object at byte {where}"
            return
        size, kind = BASE.unpack(base)[3:]
        if size < BASE.size + CONTAINER.size or size > MOST_UNPACKED:
            yield b"", f"an object of {size} bytes at byte {where}"
            return
        data = file.read(size - BASE.size)
        file.read(size % 4)
        if kind == CONTAINER_TYPE:
            part, trouble = _container_data(data, MOST_UNPACKED)
            if trouble or len(data) < size - BASE.size:
                yield part, f"{trouble or 'the file ends'} in the container at byte {where}"
                return
            yield part, ""


def _container_data(data: bytes, most: int) -> tuple[bytes, str]:
    if len(data) < CONTAINER.size:
        return b"", "the file ends"
    method, packed = CONTAINER.unpack_from(data)[0], data[CONTAINER.size :]
    if method == PLAIN:
        return packed[:most], "" if len(packed) <= most else f"more than {MOST_UNPACKED} bytes"
    if method != DEFLATE:
        return b"", f"packing method {method}"
    unpack = zlib.decompressobj()
    try:
        found = unpack.decompress(packed, most + 1)
    except zlib.error as e:
        return b"", f"{e}: nothing of it is sure"
    if len(found) > most:
        return found[:most], f"more than {MOST_UNPACKED} bytes"
    return found, "" if unpack.eof else "packed data end"


def _sound(objects: bytes, before: int) -> tuple[int, str]:
    """How far the objects follow one another as they should and are whole, and what is wrong there.

    before: unpacked bytes before them. Padding is up to 4 bytes.
    """
    at = 0
    while at + BASE.size <= len(objects):
        found = objects.find(b"LOBJ", at, at + 8)
        if found < 0:
            return at, f"no object at unpacked byte {before + at}"
        if found + BASE.size > len(objects):
            break
        _, _, version, size, _ = BASE.unpack_from(objects, found)
        if size < LEAST_OBJECT or version not in VERSIONS:
            return at, f"an object of {size} bytes, version {version}, at unpacked byte {before + found}"
        if found + size > len(objects):
            break
        at = found + size
    return at, ""
