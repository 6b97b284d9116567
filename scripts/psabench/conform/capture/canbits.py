"""How long a classic CAN frame is on the bus, stuff bits counted (ISO 11898-1, 10.4 and 10.5), bit by bit."""

from __future__ import annotations

CRC15 = 0x4599
TAIL_BITS = 1 + 1 + 1 + 7  # CRC delimiter, acknowledge and its delimiter, end of frame
STUFF = 5  # equal bits that are followed by one of the other level


def frame_bits(can_id: int, data: bytes) -> int:
    """Bits of a data frame with an 11-bit identifier, without the interframe space."""
    covered = [*_bits(can_id, 12), 0, 0, 0, *_bits(len(data), 4)]  # SOF, identifier; RTR, IDE, r0; DLC
    for byte in data:
        covered += _bits(byte, 8)
    return _stuffed(covered + _bits(_crc15(covered), 15)) + TAIL_BITS


def _bits(value: int, count: int) -> list[int]:
    return [value >> k & 1 for k in reversed(range(count))]


def _crc15(bits: list[int]) -> int:
    crc = 0
    for bit in bits:
        crc = (crc << 1 ^ (CRC15 if bit ^ crc >> 14 else 0)) & 0x7FFF
    return crc


def _stuffed(bits: list[int]) -> int:
    """Their number with the stuff bits, which count for the next ones."""
    count, level, run = 0, -1, 0
    for bit in bits:
        run = run + 1 if bit == level else 1
        level, count = bit, count + 1
        if run == STUFF:
            level, run, count = 1 - bit, 1, count + 1
    return count
