"""PSA-2's serial ports as a recording of all pins shows them: bursts of SClk, and the messages that they make up.

SClk is one wire for two ports. With CST low a burst is the temperature converter's, in SPI mode 1: a level holds at the
fall of SClk. With CST high it is the accelerometer converters', in mode 0: a level holds at the rise.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from psabench.conform.capture.log import LineLog
from psabench.conform.verdict import conclusive
from psabench.link.signals import Ints

PINS = ("SClk", "DIn", "DOutX", "DOutY", "DOutZ", "CST", "DInT", "DOutT", "DRD_A", "DRD_T", "SYNC_A", "SYNC_T", "Res")
AXES = ("DOutX", "DOutY", "DOutZ")
BYTE = 8
READ_BITS = 24  # a burst of at least so many is a read of conversion words: commands come byte by byte


@dataclass(frozen=True, slots=True)
class Burst:
    """SClk without a pause: its edges, and the levels that hold there."""

    rise_ns: Ints  # (n,)
    fall_ns: Ints  # (n,) or one fewer, where the recording ends
    temp: bool  # CST is low
    sent: str  # "0110...": DIn or DInT
    got: tuple[str, ...]  # DOutX, DOutY, DOutZ, or DOutT

    @property
    def bits(self) -> int:
        return len(self.rise_ns)

    @property
    def is_read(self) -> bool:
        return self.bits >= READ_BITS and not self.temp


@dataclass(frozen=True, slots=True)
class Message:
    """A command with all that belongs to it."""

    begin_ns: int  # first rise of SClk
    end_ns: int  # last edge of SClk
    temp: bool
    sent: bytes
    got: tuple[bytes, ...]  # as many bytes each
    bursts: tuple[Burst, ...]

    @property
    def name(self) -> str:
        """As pages write it: "41 00 56"."""
        return self.sent.hex(" ").upper()


def bursts(log: LineLog, period_ns: float) -> list[Burst]:
    """All of them in order. Raises Inconclusive where the recording lacks a pin, or SClk never moves."""
    for pin in PINS:
        conclusive(pin in log, f"the recording has no line {pin}")
    rise, fall = log.rises("SClk"), log.falls("SClk")
    conclusive(len(rise), "SClk never rises in the recording")
    fall = fall[np.searchsorted(fall, rise[0], "right") :]
    at_rise = {pin: log[pin].at(rise) for pin in ("DIn", *AXES, "CST")}
    at_fall = {pin: log[pin].at(fall) for pin in ("DInT", "DOutT")}
    cut = [0, *(np.flatnonzero(np.diff(rise) > 1.6 * period_ns) + 1).tolist(), len(rise)]
    found = []
    for a, b in itertools.pairwise(cut):
        temp = not at_rise["CST"][a]
        levels, pins = (at_fall, ("DInT", "DOutT")) if temp else (at_rise, ("DIn", *AXES))
        words = ["".join(map(str, levels[pin][a:b])) for pin in pins]
        found.append(Burst(rise[a:b], fall[a:b], temp, words[0], tuple(words[1:])))
    return found


def messages(found: Sequence[Burst], log: LineLog) -> list[Message]:
    """Commands of both ports in the order of their begin; reads of conversion words are none."""
    made = _accel([b for b in found if not b.temp and not b.is_read]) + _temp([b for b in found if b.temp], log)
    return sorted(made, key=lambda m: m.begin_ns)


def _accel(found: Sequence[Burst]) -> list[Message]:
    """A command byte says how many bytes belong to it (sources 1.3)."""
    made, k = [], 0
    while k < len(found):
        n = _length([int(b.sent or "0", 2) for b in found[k : k + 2]])
        made.append(_message(found[k : k + n]))
        k += n
    return made


def _length(first_two: Sequence[int]) -> int:
    register = 0x20 <= first_two[0] < 0x60
    return 1 if not register else 3 + first_two[1] if len(first_two) > 1 else 2


def _temp(found: Sequence[Burst], log: LineLog) -> list[Message]:
    """One low of CST holds one message, or several where samples do not show a short high between them."""
    selects = log.falls("CST")
    groups: dict[int, list[Burst]] = {}
    for b in found:
        groups.setdefault(int(np.searchsorted(selects, b.rise_ns[0], "right")), []).append(b)
    return [_message(part) for group in groups.values() for part in _temp_messages(group)]


def _temp_messages(group: Sequence[Burst]) -> list[list[Burst]]:
    """Bursts of one low of CST, cut where a command has all its bits (sources 2.5)."""
    made: list[list[Burst]] = [[]]
    for b in group:
        sent = "".join(x.sent for x in made[-1])
        if sent and len(sent) >= _temp_bits(_bytes(sent)):
            made.append([])
        made[-1].append(b)
    return made


def _temp_bits(sent: bytes) -> int:
    """Of a command to the temperature converter, all told: RDATA has 3 bytes more, RREG and WREG say how many."""
    if sent[:1] == b"\x01":
        return 4 * BYTE
    register = sent[:1] and sent[0] & 0xE0 in (0x00, 0x40) and sent[0] & 0x10
    return (3 + (sent[1] & 0x0F) if len(sent) > 1 else 2) * BYTE if register else len(sent) * BYTE + BYTE


def _message(parts: Sequence[Burst]) -> Message:
    last = parts[-1]
    end_ns = int(last.fall_ns[-1] if len(last.fall_ns) else last.rise_ns[-1])
    sent = b"".join(_bytes(b.sent) for b in parts)
    got = tuple(b"".join(_bytes(w) for w in words) for words in zip(*(b.got for b in parts), strict=True))
    return Message(int(parts[0].rise_ns[0]), end_ns, last.temp, sent, got, tuple(parts))


def _bytes(word: str) -> bytes:
    """Whole bytes of a word, most significant bit first; bits beyond them are left out."""
    return bytes(int(word[k : k + BYTE], 2) for k in range(0, len(word) - BYTE + 1, BYTE))


@dataclass(frozen=True, slots=True)
class Traffic:
    """All that passed on both ports."""

    bursts: tuple[Burst, ...]
    messages: tuple[Message, ...]

    @property
    def reads(self) -> list[Burst]:
        """Of conversion words of the accelerometer converters."""
        return [b for b in self.bursts if b.is_read]

    def of(self, *, temp: bool) -> list[Message]:
        """Messages of one port."""
        return [m for m in self.messages if m.temp == temp]


@lru_cache(maxsize=2)
def traffic(log: LineLog, sclk_hz: float) -> Traffic:
    """Both ports decoded, once a recording. Raises Inconclusive."""
    found = bursts(log, 1e9 / sclk_hz)
    return Traffic(tuple(found), tuple(messages(found, log)))
