"""The LCM types of proto/lcm: their fingerprints, and messages to bytes and back.

Reads the part of LCM's type language that proto/lcm uses: structs of primitive types, strings and arrays of one
dimension. The bytes are those of the code that lcm-gen generates. Decoding is bounded by the message: no count is
believed before the bytes are there.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

from psabench.errors import BadInput, expected
from psabench.places import proto_file

_FORMATS = {"int8_t": "b", "int16_t": "h", "int32_t": "i", "int64_t": "q", "float": "f", "double": "d", "boolean": "b"}
_PRIMITIVES = {*_FORMATS, "byte", "string"}
_MASK = (1 << 64) - 1
_MEMBER = re.compile(r"(\w+)\s+(\w+)\s*(?:\[\s*(\w+)\s*\])?\s*;")
_STRUCT = re.compile(r"\s*package\s+(\w+)\s*;\s*struct\s+(\w+)\s*\{([^}]*)\}\s*")
_COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)


@dataclass(frozen=True, slots=True, kw_only=True)
class Member:
    """A field. size: of an array, a number or the name of an earlier field; "": it is none."""

    kind: str
    name: str
    size: str = ""


@dataclass(frozen=True, kw_only=True)
class LcmType:
    """A struct of LCM."""

    package: str
    name: str
    members: tuple[Member, ...]

    @cached_property
    def fingerprint(self) -> bytes:
        """The eight bytes that begin a message of this type, as lcm-gen computes them."""
        base = 0x12345678
        for m in self.members:
            for text in (m.name, m.kind):
                base = _hash_text(base, text)
            base = _hash_byte(base, 1 if m.size else 0)
            if m.size:
                base = _hash_text(_hash_byte(base, 0 if m.size.isdecimal() else 1), m.size)
        return struct.pack(">Q", (base << 1 & _MASK) + (base >> 63))

    def encode(self, values: Mapping[str, Any]) -> bytes:
        """A message. Raises ValueError for a value that is missing or that does not fit."""
        parts = [self.fingerprint]
        for m in self.members:
            try:
                parts.append(_pack_member(m, values[m.name], values))
            except (KeyError, struct.error, TypeError, AttributeError) as e:
                raise ValueError(expected(m.kind, repr(values.get(m.name)), f"{self.name}.{m.name}")) from e
        return b"".join(parts)

    def decode(self, data: bytes) -> dict[str, Any]:
        """The fields of a message. Raises ValueError for bytes that are no such message."""
        rest = _Rest(data, len(self.fingerprint), self.name)
        if data[: rest.at] != self.fingerprint:
            raise ValueError(expected(f"a message of the type {self.name}", data[: rest.at].hex() or "none"))
        values: dict[str, Any] = {}
        for m in self.members:
            values[m.name] = _unpack_member(m, rest, values)
        if rest.left:
            raise ValueError(expected(f"{rest.at} bytes", len(data), self.name))
        return values


def parse(text: str, where: object = "type") -> LcmType:
    """One struct of LCM's type language. Raises BadInput."""
    match = _STRUCT.fullmatch(_COMMENT.sub(" ", text))
    if match is None:
        raise BadInput(expected("a package and one struct", None, where))
    package, name, body = match.groups()
    if left := _MEMBER.sub("", body).strip():
        raise BadInput(expected("fields as `type name[size];`", repr(left), where))
    members: list[Member] = []
    for kind, field, size in _MEMBER.findall(body):
        if kind not in _PRIMITIVES:
            raise BadInput(expected(f"one of {', '.join(sorted(_PRIMITIVES))}", kind, f"{where}: {field}"))
        if size and not size.isdecimal() and size not in (m.name for m in members if m.kind.startswith("int")):
            raise BadInput(expected("a number or an earlier integer field", size, f"{where}: {field}"))
        members.append(Member(kind=kind, name=field, size=size))
    return LcmType(package=package, name=name, members=tuple(members))


@cache
def lcm_type(name: str) -> LcmType:
    """A type of proto/lcm by its name. Raises BadInput."""
    path = proto_file(f"lcm/{name}.lcm")
    return parse(path.read_text(encoding="utf-8"), path)


@cache
def type_names() -> tuple[str, ...]:
    """The types of proto/lcm."""
    return tuple(sorted(p.stem for p in proto_file("lcm/can_frame_t.lcm").parent.glob("*.lcm")))


@cache
def _by_fingerprint() -> Mapping[bytes, LcmType]:
    return {t.fingerprint: t for t in map(lcm_type, type_names())}


def type_of(data: bytes) -> LcmType | None:
    """The type of a message, by its first bytes; None: no type of proto/lcm."""
    return _by_fingerprint().get(bytes(data[:8]))


# ---- the hash of a struct, as lcm-gen's: of names, kinds and dimensions of the fields, not of the struct's name


def _hash_byte(v: int, c: int) -> int:
    signed = v - (1 << 64) if v >> 63 else v
    return ((v << 8) ^ (signed >> 55)) + c & _MASK


def _hash_text(v: int, text: str) -> int:
    v = _hash_byte(v, len(text))
    for c in text.encode("ascii"):
        v = _hash_byte(v, c)
    return v


# ---- values


def _array_size(m: Member, values: Mapping[str, Any]) -> int:
    return int(m.size) if m.size.isdecimal() else int(values[m.size])


def _pack_member(m: Member, value: Any, values: Mapping[str, Any]) -> bytes:
    if not m.size:
        return b"".join(_pack_each(m.kind, [value]))
    if len(value) != _array_size(m, values):
        raise ValueError(expected(f"{_array_size(m, values)} elements", len(value), m.name))
    return bytes(value) if m.kind == "byte" else b"".join(_pack_each(m.kind, value))


def _pack_each(kind: str, values: Any) -> Iterator[bytes]:
    for v in values:
        if kind == "string":
            text = v.encode("utf-8") + b"\0"
            yield struct.pack(">i", len(text)) + text
        else:
            yield struct.pack(">" + _FORMATS.get(kind, "B"), v)


class _Rest:
    """The bytes of a message from `at` on."""

    def __init__(self, data: bytes, at: int, name: str) -> None:
        self.data, self.at, self.name = data, at, name

    @property
    def left(self) -> int:
        return len(self.data) - self.at

    def take(self, size: int) -> bytes:
        if not 0 <= size <= self.left:
            raise ValueError(expected(f"at most {max(self.left, 0)} more bytes", size, self.name))
        self.at += size
        return self.data[self.at - size : self.at]


def _unpack_member(m: Member, rest: _Rest, values: Mapping[str, Any]) -> Any:
    if not m.size:
        return _unpack_one(m.kind, rest)
    count = _array_size(m, values)
    if m.kind == "byte":
        return rest.take(count)
    if m.kind == "string":
        if count < 0:
            raise ValueError(expected("0 texts or more", count, f"{rest.name}.{m.name}"))
        return tuple(_unpack_one(m.kind, rest) for _ in range(count))
    kind = _FORMATS[m.kind]
    data = rest.take(count * struct.calcsize(">" + kind))
    return struct.unpack(f">{count}{kind}", data)


def _unpack_one(kind: str, rest: _Rest) -> Any:
    if kind == "string":
        (size,) = struct.unpack(">i", rest.take(4))
        text = rest.take(size)
        if not text.endswith(b"\0"):
            raise ValueError(expected("a text with a NUL at its end", None, rest.name))
        return text[:-1].decode("utf-8", "replace")
    code = ">" + _FORMATS.get(kind, "B")
    (value,) = struct.unpack(code, rest.take(struct.calcsize(code)))
    return bool(value) if kind == "boolean" else value
