"""BLF logs, made safe: every length is checked and every container unpacked within bounds before python-can reads them.

Format: as python-can writes and reads it (Vector's "binary logging format"; objects begin with LOBJ).
"""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import Path

from psabench.errors import expected

HEADER_BYTES = 144
BASE = struct.Struct("<4sHHLL")  # signature, header size and version, object size, type
CONTAINER = struct.Struct("<H6xL4x")  # method, unpacked size
LEAST_OBJECT = 32  # bytes of an object with its header
CONTAINER_TYPE, PLAIN, DEFLATE = 10, 0, 2
VERSIONS = (1, 2)
MOST_UNPACKED = 256 << 20  # bytes of all objects of a file


def safe_blf(path: Path) -> tuple[io.BytesIO, str]:
    """The same log with one plain container, and where it is damaged ("": nowhere). Raises ValueError, OSError."""
    with path.open("rb") as file:
        header = file.read(HEADER_BYTES)
        if len(header) < HEADER_BYTES or header[:4] != b"LOGG":
            raise ValueError(expected("a BLF header", repr(header[:4])))
        size = struct.unpack_from("<L", header, 4)[0]
        if not HEADER_BYTES <= size <= 1 << 16:
            raise ValueError(expected(f"a header of {HEADER_BYTES} to {1 << 16} bytes", size))
        file.seek(size)
        objects, trouble = _unpacked(file)
    end, odd = _sound(objects)
    plain = header[:4] + struct.pack("<L", HEADER_BYTES) + header[8:] + _container(objects[:end])
    return io.BytesIO(plain), odd or trouble


def _container(objects: bytes) -> bytes:
    size = BASE.size + CONTAINER.size + len(objects)
    head = BASE.pack(b"LOBJ", BASE.size, 1, size, CONTAINER_TYPE) + CONTAINER.pack(PLAIN, len(objects))
    return head + objects + b"\0" * (size % 4)


def _unpacked(file: io.BufferedReader) -> tuple[bytes, str]:
    """The objects of all containers, and what is wrong with the file from there on."""
    parts: list[bytes] = []
    left = MOST_UNPACKED
    while True:
        where = file.tell()
        base = file.read(BASE.size)
        if not base:
            return b"".join(parts), ""
        if len(base) < BASE.size or base[:4] != b"LOBJ":
            return b"".join(parts), f"no object at byte {where}"
        size, kind = BASE.unpack(base)[3:]
        if size < BASE.size + CONTAINER.size or size > MOST_UNPACKED:
            return b"".join(parts), f"an object of {size} bytes at byte {where}"
        data = file.read(size - BASE.size)
        file.read(size % 4)
        if kind == CONTAINER_TYPE:
            part, trouble = _container_data(data, left)
            parts.append(part)
            left -= len(part)
            if trouble or len(data) < size - BASE.size:
                return b"".join(parts), f"{trouble or 'the file ends'} in the container at byte {where}"


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


def _sound(objects: bytes) -> tuple[int, str]:
    """How far the objects follow one another as they should, and what is wrong there. Padding is up to 4 bytes."""
    at = 0
    while at + BASE.size <= len(objects):
        found = objects.find(b"LOBJ", at, at + 8)
        if found < 0:
            return at, f"no object at unpacked byte {at}"
        if found + BASE.size > len(objects):
            break
        _, _, version, size, _ = BASE.unpack_from(objects, found)
        if size < LEAST_OBJECT or version not in VERSIONS:
            return at, f"an object of {size} bytes, version {version}, at unpacked byte {found}"
        if found + size > len(objects):
            return at, f"the last object, at unpacked byte {found}, is cut"
        at = found + size
    return at, ""
