"""How a bench is, in one look: for a status bar or a log."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class GrowingFile:
    """A file that the emulator is writing."""

    kind: str  # vcd, can log, truth log
    size_bytes: int
    max_bytes: int = 0  # at which it ends; 0: none
    error: str  # why it has ended early; "": it has not


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """How the bench is; None: the bench has no such instrument, or no control socket."""

    time_s: float
    pace: str  # wall, step, free; real: no emulator
    angle_deg: float | None  # of the table's outermost axis, as its readout shows it
    rate_dps: float | None
    temp_degc: float | None  # of the chamber's air
    frames: int  # CAN frames that this program has received
    late: int | None  # events that the emulator ran late
    lost: int  # samples missing between the frames received
    files: tuple[GrowingFile, ...]
