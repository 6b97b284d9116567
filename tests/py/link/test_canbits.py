"""Frame lengths of emu/base/can/bits.c against an independent model that writes the frame out as a string of bits.

The C file is compiled by itself and called through ctypes; the model below shares nothing with it.
"""

import ctypes
import itertools
import os
import random
import re
import subprocess
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

ROOT = Path(__file__).resolve().parents[3]
EXT, RTR, FD, BRS = 1, 2, 4, 8
FD_LENGTHS = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64]


class Msg(ctypes.Structure):
    _fields_ = (
        ("id", ctypes.c_uint32),
        ("flags", ctypes.c_uint8),
        ("len", ctypes.c_uint8),
        ("data", ctypes.c_uint8 * 64),
    )


class Bits(ctypes.Structure):
    _fields_ = (("nominal", ctypes.c_uint), ("data", ctypes.c_uint))


@pytest.fixture(scope="session")
def canbits(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    out = tmp_path_factory.mktemp("canbits") / "canbits.so"
    source = ROOT / "emu/base/can/bits.c"
    cc = os.environ.get("CC", "cc")
    subprocess.run([cc, "-std=c11", "-shared", "-fPIC", f"-I{ROOT / 'emu'}", "-o", str(out), str(source)], check=True)
    lib = ctypes.CDLL(str(out))
    lib.can_bits_exact.argtypes = [ctypes.POINTER(Msg)]
    lib.can_bits_exact.restype = Bits
    lib.can_bits_worst.argtypes = [ctypes.c_uint8, ctypes.c_uint8]
    lib.can_bits_worst.restype = Bits
    return lib


def crc15(bits: str) -> str:
    """CRC-15/CAN as a polynomial division over GF(2), written out."""
    poly = 0b1100010110011001
    value = int(bits + "0" * 15, 2)
    for shift in range(len(bits) - 1, -1, -1):
        if value >> (shift + 15) & 1:
            value ^= poly << shift
    return f"{value:015b}"


def stuffed(bits: str, *, at_end: bool) -> str:
    """A complementary bit after every five equal ones, stuff bits counting for the next five."""
    out = ""
    for i, bit in enumerate(bits):
        out += bit
        last = i == len(bits) - 1
        if re.search(r"(0{5}|1{5})$", out) and run_length(out) == 5 and (at_end or not last):
            out += "1" if bit == "0" else "0"
    return out


def run_length(bits: str) -> int:
    return len(next(iter(re.findall(r"(0+|1+)$", bits))))


def model(can_id: int, flags: int, data: bytes) -> tuple[int, int]:
    """(nominal, data) bits of the frame, interframe space of 3 bits included."""
    rtr = "1" if flags & RTR else "0"
    extended = f"0{can_id >> 18:011b}11{can_id & 0x3FFFF:018b}{rtr}"
    head = extended if flags & EXT else f"0{can_id & 0x7FF:011b}{rtr}0"
    dlc = f"{FD_LENGTHS.index(len(data)):04b}"
    body = "" if flags & RTR else "".join(f"{b:08b}" for b in data)
    tail = 1 + 1 + 1 + 7 + 3
    if not flags & FD:
        covered = head + ("00" if flags & EXT else "0") + dlc + body
        return len(stuffed(covered + crc15(covered), at_end=True)) + tail, 0
    head += "10" + ("1" if flags & BRS else "0")
    crc = 21 if len(data) > 16 else 17
    counted = 4 + crc
    fixed = len([i for i in range(counted) if i % 4 == 0])
    everything = stuffed(head + "0" + dlc + body, at_end=False)
    # A stuff bit that the bit before the switch makes due is sent after the switch: at the data rate.
    arbitration = len(stuffed(head, at_end=False))
    fast = len(everything) - arbitration + counted + fixed
    return (arbitration + tail, fast) if flags & BRS else (arbitration + tail + fast, 0)


def measured(lib: ctypes.CDLL, can_id: int, flags: int, data: bytes) -> tuple[int, int]:
    m = Msg(can_id, flags, len(data), (ctypes.c_uint8 * 64)(*data))
    bits: Bits = lib.can_bits_exact(ctypes.byref(m))
    return bits.nominal, bits.data


def test_crc15_of_the_check_string() -> None:
    """CRC-15/CAN of "123456789" is 059Eh (catalogue of parametrised CRC algorithms)."""
    assert int(crc15("".join(f"{b:08b}" for b in b"123456789")), 2) == 0x059E


@given(
    flags=st.sampled_from([0, EXT, RTR, RTR | EXT, FD, FD | EXT, FD | BRS, FD | BRS | EXT]),
    can_id=st.integers(0, 0x1FFFFFFF),
    length=st.sampled_from(FD_LENGTHS),
    fill=st.one_of(st.binary(min_size=64, max_size=64), st.sampled_from([b"\0" * 64, b"\xf0" * 64, b"\x0f" * 64])),
)
def test_exact_length_is_that_of_the_written_out_frame(
    canbits: ctypes.CDLL, flags: int, can_id: int, length: int, fill: bytes
) -> None:
    can_id &= 0x1FFFFFFF if flags & EXT else 0x7FF
    data = fill[: length if flags & FD else min(length, 8)]
    assert measured(canbits, can_id, flags, data) == model(can_id, flags, data)


def test_every_short_base_frame(canbits: ctypes.CDLL) -> None:
    """Brute force over all identifiers, with 0 and 1 byte: runs through every alignment of stuffing and CRC."""
    for can_id, data in itertools.product(range(0x800), (b"", b"\x00", b"\xff", b"\x78")):
        assert measured(canbits, can_id, 0, data) == model(can_id, 0, data)


def test_bounds_hold_and_are_approached(canbits: ctypes.CDLL) -> None:
    """No random frame leaves the bounds; hill climbing comes near the worst classic case.

    135 bits cannot be had with 8 bytes: RTR, IDE, r0 and DLC are 0001000 whatever the content.
    """
    rng = random.Random(int(os.environ.get("TEST_SEED", "1")))
    worst = canbits.can_bits_worst(0, 8)
    assert (worst.nominal, worst.data) == (135, 0)
    best, best_id, best_data = 0, 0x078, bytearray(b"\x3c" * 8)
    for _ in range(20000):
        data, can_id = bytearray(best_data), best_id
        for _ in range(rng.randint(1, 4)):
            bit = rng.randrange(75)
            if bit < 64:
                data[bit // 8] ^= 1 << bit % 8
            else:
                can_id ^= 1 << bit - 64
        got, _fast = measured(canbits, can_id, 0, bytes(data))
        assert got <= 135
        if got >= best:
            best, best_id, best_data = got, can_id, data
    assert best >= 130
