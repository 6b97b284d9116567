"""The record of a board: what the rest of the package must know of it without asking the board.

Each board has one, BOARD in boards/<name>/board.py; `registry` has them all. Loads no library: the command line is read
with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from psabench.boards.session import Session

PARALLEL_BUS = ("CS", "RW", *(f"AB{k}" for k in range(4)), *(f"D{k}" for k in range(16)))


@dataclass(frozen=True, slots=True)
class Bits:
    """A field of a register: its mask, name, and the meanings of its values (none: a number)."""

    mask: int
    name: str
    meaning: Mapping[int, str]
    signed: bool = False

    @property
    def shift(self) -> int:
        return (self.mask & -self.mask).bit_length() - 1

    def of(self, register: int) -> int:
        raw, top = (register & self.mask) >> self.shift, (self.mask >> self.shift) + 1
        return raw - top if self.signed and raw >= top // 2 else raw


def bits(mask: int, name: str, *meaning: str) -> Bits:
    """A field whose values 0, 1, 2 ... mean these."""
    return Bits(mask, name, dict(enumerate(meaning)))


# By group and name of the register. Groups: converters "accel" and "temp"; of a parallel bus the board's name.
Fields = Mapping[tuple[str, str], tuple[Bits, ...]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Beat:
    """What a board does once a period: rows that give it (µs), the edge that shows it, the number that counts it."""

    rows: Mapping[str, str]  # requirement: limit
    line: str
    level: int
    message: str
    counter: str
    stamp: tuple[str, str] = ("", "")  # message and signal of the board's own time


@dataclass(frozen=True, slots=True, kw_only=True)
class Bus:
    """Registers of a parallel bus that a test may use at any time."""

    quiet: str  # its reading moves nothing
    harmless: str  # takes a write without effect on the rest
    harmless_word: int | None  # None: the word that it has


@dataclass(frozen=True, slots=True, kw_only=True)
class Setting:
    """An object that sets something of the board itself, none of communication, and a value that is not its default."""

    index: int
    sub: int
    value: bytes


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """A type of board. Profiles with another name on the plate (`aliases`) are the same board."""

    name: str  # as the EDS and the emulator call it: "psd1"
    device: str  # its class in boards/<name>/device.py
    aliases: tuple[str, ...] = ()
    profile: str = ""  # where none is named; "": the one of the board's name
    lines: tuple[str, ...]  # as psa-emu --vcd names them: docs/waveforms.md and the boards' pages
    port_lines: tuple[str, ...]  # lines of the line port, bit 0 first (docs/lineport.md)
    wires: tuple[str, ...] = ()  # of its differential pairs, as psa-emu --pairs names them
    bus: Bus | None = None  # parallel bus
    beat: Beat | None = None  # None: no regular period that is known
    setting: Setting | None = None  # None, and a bus: object 2051h, its strobe
    fields: Fields = field(default_factory=dict)  # of its registers
    # Frequencies of a profile that follow from the board's clocks: an error of its clocks scales them.
    clocks: tuple[str, ...] = ()
    clock_at_limit: bool = False  # the part's clock is at its limit: none of them may be fast
    crystal: str = ""  # figure of the profile: by how much a specimen's clock is off, drawn
    has_inputs: bool = True  # volts can be put on its inputs
    has_thermometer: bool = False  # its temperatures are compared with a chamber's
    on_table: bool = False  # it has gyros
    on_platform: bool = False  # it controls one, and reads its level from a PSA-2
    session: Session | None = None  # what PulseView and GTKWave show of its lines at first; None: no such files
    schedule_s: float = 1.0  # simulated time of a schedule of psabench explore
    overdrive_v_per_g: float = 0.0  # of the accelerometer X, which a dividing head turns beyond full scale

    @property
    def names(self) -> tuple[str, ...]:
        """All that a user may call it."""
        return self.name, *self.aliases
