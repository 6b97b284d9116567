"""The chips' registers beside register_facts.yaml, a table copied from the sources by hand, through the parts' ports.

Nothing is shared with the emulator's tables: every register is read, written with 00h, FFh, 55h, AAh and each single
bit, and read back with all its neighbours.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import canopen
import pytest
import yaml
from chip_bench import Ad7712, Ads1256, Ads1282, no_complaints

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[2]
PATTERNS = (0x00, 0xFF, 0x55, 0xAA, *(1 << b for b in range(8)))
STATUS, IO = 0x00, 0x04
DRDY_BIT, ORDER_BIT = 0x01, 0x08  # of the ADS1256's STATUS
RESET_OPCODE = {"ads1282": 0x06, "ads1281": 0x06, "ads1256": 0xFE}


@dataclass(frozen=True, slots=True)
class Fact:
    """A row of the table."""

    address: int
    name: str
    reset: int
    writable: int
    known: int = 0xFF

    def after(self, written: int, before: int) -> int:
        """What is to be read, from what was read at reset."""
        return written & self.writable | before & ~self.writable & 0xFF


@cache
def table() -> dict[str, list[dict[str, Any]]]:
    data: dict[str, list[dict[str, Any]]] = yaml.safe_load((HERE / "register_facts.yaml").read_text())
    return data


def facts(part: str) -> list[Fact]:
    rows = [Fact(**row) for row in table()[part]]
    assert [r.address for r in rows] == list(range(11))
    return rows


Ask = Callable[..., bytes]
Tell = Callable[..., int]


@contextmanager
def port(part: str) -> Iterator[tuple[Ask, Tell, Callable[[], None]]]:
    """Read registers, write registers, reset by opcode, of a part that is past its power-up, without noise."""
    if part.startswith("ads128"):
        with Ads1282(None, part, noise_scale=0) as s:
            s.adc.run_until_level("DRDY", 0)
            s.send(0x11)

            def reset() -> None:
                s.send(RESET_OPCODE[part])
                s.send(0x11)

            yield s.read, s.write, reset
    else:
        with Ads1256(None, part, noise_scale=0) as t:
            t.adc.run_until_level("DRDY", 0)

            def reset() -> None:
                t.send(RESET_OPCODE[part])
                t.adc.run_until_level("DRDY", 1)
                t.adc.run_until_level("DRDY", 0)

            yield t.read, t.write, reset


def in_order(part: str, status: int, found: bytes) -> bytes:
    """What an ADS1256 sends: with ORDER, the bits of each byte come the other way round."""
    if part == "ads1256" and status & ORDER_BIT:
        return bytes(int(f"{b:08b}"[::-1], 2) for b in found)
    return found


def mask(part: str, row: Fact, written: int | None = None) -> int:
    """Bits that can be compared: not the level of DRDY, nor, of the ADS1256's port, pins that are inputs."""
    if part == "ads1256" and row.address == STATUS:
        return 0xFF & ~DRDY_BIT
    if part == "ads1256" and row.address == IO and written is not None:
        return 0xF0 | ~(written >> 4) & 0x0F & ~0x01  # D0 shows the clock while ADCON says so
    return 0xFF


PARTS = ("ads1281", "ads1282", "ads1256")


@pytest.mark.parametrize("part", PARTS)
def test_registers_after_power_up_and_reset_are_those_of_the_table(part: str) -> None:
    with port(part) as (ask, tell, reset):
        for when in ("power-up", "RESET"):
            found = ask(0, 11)
            no_complaints(
                f"{part} {row.name} after {when}: {found[row.address]:02X}h, due {row.reset:02X}h"
                for row in facts(part)
                if (found[row.address] ^ row.reset) & row.known
            )
            if when == "power-up":
                tell(1, *(b ^ 0x01 for b in found[1:]))
                assert ask(1, 10) != found[1:]
                reset()


@pytest.mark.parametrize("part", PARTS)
def test_every_bit_is_kept_or_not_as_the_table_says_and_no_neighbour_changes(part: str) -> None:
    rows = facts(part)
    complaints = []
    with port(part) as (ask, tell, _):
        before = ask(0, 11)
        for row in rows:
            for value in PATTERNS:
                tell(row.address, value)
                status = value if row.address == STATUS else 0
                for other, found in zip(rows, in_order(part, status, ask(0, 11)), strict=True):
                    mine = other is row
                    due = other.after(value, before[row.address]) if mine else before[other.address]
                    compared = mask(part, other, value if mine else None if other.address != IO else before[IO])
                    if (found ^ due) & compared:
                        complaints.append(
                            f"{part}: {value:02X}h to {row.name}: {other.name} reads {found:02X}h, due {due:02X}h"
                        )
            tell(row.address, before[row.address])
    no_complaints(complaints)


@pytest.mark.parametrize("part", PARTS)
def test_a_row_of_registers_is_written_and_read_from_any_start(part: str) -> None:
    """ADS1256: past 0Ah it goes on at 00h. ADS128x: nothing is there, 00h is read."""
    rows = facts(part)
    with port(part) as (ask, tell, _):
        before = ask(0, 11)
        for first in range(11):
            for count in (1, 2, 11 - first):
                if first + count > 11:
                    continue
                values = [0x21 + 7 * k for k in range(count)]
                tell(first, *values)
                found = in_order(part, values[0] if first == STATUS else 0, ask(first, count))
                for k, row in enumerate(rows[first : first + count]):
                    due = row.after(values[k], before[row.address])
                    assert not (found[k] ^ due) & mask(part, row, values[k]), (part, first, count, row.name)
        whole = ask(0, 11)
        beyond = ask(9, 4)
        assert beyond[:2] == whole[9:]
        if part == "ads1256":
            assert (beyond[2] | DRDY_BIT, beyond[3]) == (whole[0] | DRDY_BIT, whole[1])
        else:
            assert beyond[2:] == bytes(2)
            tell(0x0B, 0x77)
            assert ask(0, 11) == whole


def test_the_control_word_of_the_ad7712_has_the_table_s_fields() -> None:
    with Ad7712(None, noise_scale=0) as s:
        s.adc.run_until_level("DRDY", 0)
        s.read(1, 16)
        word = s.read(0)
        fields = table()["ad7712"]
        for f in fields:
            assert word >> f["low"] & (1 << f["bits"]) - 1 in f["reset"], f["name"]
        assert sum(((1 << f["bits"]) - 1) << f["low"] for f in fields) == 0xFFFFFF & ~(1 << 14)  # b14: don't care
        base = 0x000100
        for f in fields:
            for value in f["write"]:
                field = ((1 << f["bits"]) - 1) << f["low"]
                due = base & ~field | value << f["low"]
                s.write(due)
                found = s.read(0)
                assert (found ^ due) & ~(1 << 14) == 0, f"{f['name']} {value}: {found:06X}h, due {due:06X}h"
        s.write(base)


@pytest.mark.parametrize("mode", [6, 7], ids=["zero scale", "full scale"])
def test_the_coefficients_of_the_ad7712_keep_every_bit(mode: int) -> None:
    with Ad7712(None, noise_scale=0) as s:
        s.adc.run_until_level("DRDY", 0)
        s.read(1, 16)
        s.write(mode << 21 | 0x100)
        for value in (0x000000, 0xFFFFFF, 0x555555, 0xAAAAAA, *(1 << b for b in range(24))):
            s.write(value, a0=1)
            assert s.read(1) == value
        other = mode ^ 1
        s.write(other << 21 | 0x100)
        s.write(0x123456, a0=1)
        s.write(mode << 21 | 0x100)
        assert s.read(1) == 1 << 23


@pytest.mark.parametrize(
    ("index", "part"), [(0x2000, "ads1282"), (0x2003, "ads1282"), (0x2004, "ads1282"), (0x2001, "ads1256")]
)
def test_the_object_dictionary_has_the_table_s_names_in_its_order(index: int, part: str) -> None:
    od: Any = canopen.import_od(str(ROOT / "proto/psa2.eds"))
    found = od[index]
    assert [found[row.address + 1].name for row in facts(part)] == [row.name for row in facts(part)]
