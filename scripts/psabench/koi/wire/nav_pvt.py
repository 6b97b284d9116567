"""Solutions of a satellite receiver out of the bytes of its serial port: UBX-NAV-PVT among sentences of NMEA 0183.

The stream may begin anywhere and hold anything: what is no message is counted and passed over. Velocity in three
dimensions is in NAV-PVT alone; sentences are counted, so that a receiver that sends nothing else can be named.
"""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass, field, fields

from psabench.errors import expected

UBX, NMEA = b"\xb5\x62", b"$"
NAV_PVT, PVT_BYTES = b"\x01\x07", 92  # u-blox protocol specification, UBX-NAV-PVT
HEAD_BYTES, SUM_BYTES = 6, 2
LONGEST_PACKET, LONGEST_SENTENCE = 1024, 82  # NMEA 0183: 82 characters with "$" and CR LF
# iTOW; fixType, flags; lon, lat 1e-7 deg, height mm; velN, velE, velD mm/s
_FIELDS = struct.Struct("<I16xBB2xiii12xiii32x")
FIX_3D, FIX_OK = 3, 0x01
MM, DEG = 1e-3, math.pi / 180.0


@dataclass(frozen=True, slots=True)
class Solution:
    """Of one instant by the receiver's clock."""

    tow_s: float  # time of the GPS week
    lat_rad: float
    lon_rad: float
    h_m: float  # above the ellipsoid
    v_enu_mps: tuple[float, float, float]
    valid: bool  # a fix in three dimensions that the receiver calls good


@dataclass
class PortCounts:
    """What a port has brought."""

    solutions: int = 0
    sentences: int = 0  # of NMEA, whole
    others: int = 0  # whole packets of UBX that are no NAV-PVT
    bad_sums: int = 0  # messages with a wrong checksum
    garbage: int = 0  # bytes that belong to no message

    def words(self) -> list[str]:
        """What is wrong with them, one reason each."""
        said = []
        if self.bad_sums:
            said.append(expected("messages with their checksum", f"{self.bad_sums} with another", "receiver"))
        if self.garbage:
            said.append(expected("UBX and NMEA", f"{self.garbage} bytes of neither", "receiver"))
        if not self.solutions and (self.sentences or self.others):
            got = f"{self.sentences} sentences of NMEA and {self.others} other packets alone"
            said.append(expected("UBX-NAV-PVT, which has three velocities", got, "receiver"))
        return said

    def as_dict(self) -> dict[str, int]:
        return {f.name: getattr(self, f.name) for f in fields(self)}


@dataclass
class PvtStream:
    """Takes bytes as they come, in pieces of any size."""

    counts: PortCounts = field(default_factory=PortCounts)
    _rest: bytes = b""

    def take(self, data: bytes) -> list[Solution]:
        """The solutions that these bytes complete."""
        self._rest += data
        found, at = list[Solution](), 0
        while (end := self._message_end(at)) is not None:
            if end > 0:
                found += self._read_message(self._rest[at:end])
                at = end
            else:
                at += 1
                self.counts.garbage += 1
        self._rest = self._rest[at:]
        return found

    def _message_end(self, at: int) -> int | None:
        """Where the message that begins here ends; 0: none begins here; None: that shows with more bytes."""
        rest = self._rest
        if at >= len(rest):
            return None
        if rest.startswith(NMEA, at):
            return self._sentence_end(at)
        if not UBX.startswith(rest[at : at + 2]):
            return 0
        if len(rest) < at + HEAD_BYTES:
            return None
        size = HEAD_BYTES + int.from_bytes(rest[at + 4 : at + 6], "little") + SUM_BYTES
        if size > LONGEST_PACKET:
            return 0
        if len(rest) < at + size:
            return None
        whole = _ubx_sum(rest[at + 2 : at + size - SUM_BYTES]) == rest[at + size - SUM_BYTES : at + size]
        self.counts.bad_sums += not whole
        return at + size if whole else 0  # the length may be what is wrong: a message may begin within

    def _sentence_end(self, at: int) -> int | None:
        end = self._rest.find(b"\n", at, at + LONGEST_SENTENCE)
        if end >= 0:
            whole = _is_sentence(self._rest[at : end + 1])
            self.counts.bad_sums += not whole
            return end + 1 if whole else 0
        return 0 if len(self._rest) - at >= LONGEST_SENTENCE else None

    def _read_message(self, message: bytes) -> list[Solution]:
        if message.startswith(NMEA):
            self.counts.sentences += 1
            return []
        payload = message[HEAD_BYTES:-SUM_BYTES]
        if message[2:4] != NAV_PVT or len(payload) != PVT_BYTES:
            self.counts.others += 1
            return []
        self.counts.solutions += 1
        return [_solution_of(payload)]


def _solution_of(payload: bytes) -> Solution:
    tow_ms, fix, flags, lon, lat, h_mm, north, east, down = _FIELDS.unpack(payload)
    return Solution(
        tow_s=tow_ms * 1e-3,
        lat_rad=lat * 1e-7 * DEG,
        lon_rad=lon * 1e-7 * DEG,
        h_m=h_mm * MM,
        v_enu_mps=(east * MM, north * MM, -down * MM),
        valid=fix == FIX_3D and bool(flags & FIX_OK),
    )


def _ubx_sum(body: bytes) -> bytes:
    """Fletcher's of 8 bits, over class to payload."""
    a = b = 0
    for x in body:
        a = (a + x) & 0xFF
        b = (b + a) & 0xFF
    return bytes((a, b))


def _is_sentence(line: bytes) -> bool:
    """$...*hh CR LF with the exclusive or of what is between."""
    body, star, digits = line.rstrip(b"\r\n").partition(b"*")
    found = 0
    for x in body[1:]:
        found ^= x
    return bool(star) and digits.upper() == b"%02X" % found
