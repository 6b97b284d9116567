"""Numbers with units: `5ms` for an argument in seconds, `10deg/s`, `0.1rad`, `3.3e-3`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from fractions import Fraction

from psabench.errors import expected

_RAD = Fraction(180 / math.pi)  # degrees
_MILLI, _MICRO, _NANO = (Fraction(1, 10**k) for k in (3, 6, 9))
# The units of each quantity, and how many of its first unit they are. Exact, so that 63ms is the number 0.063.
_QUANTITIES: tuple[Mapping[str, Fraction | int], ...] = (
    {"s": 1, "ms": _MILLI, "us": _MICRO, "ns": _NANO, "min": 60, "h": 3600},
    {"deg": 1, "arcmin": Fraction(1, 60), "arcsec": Fraction(1, 3600), "rad": _RAD, "mrad": _RAD * _MILLI},
    {"deg/s": 1, "dps": 1, "deg/h": Fraction(1, 3600), "rad/s": _RAD},
    {"deg/s^2": 1, "dps2": 1},
    {"Hz": 1, "mHz": _MILLI, "kHz": 10**3, "MHz": 10**6},
    {"V": 1, "mV": _MILLI, "uV": _MICRO},
    {"degC": 1},
    {"K": 1},  # a difference of temperatures
    {"K/min": 1, "K/s": 60},
    {"m": 1, "mm": _MILLI},
    {"ppm": 1},
    {"m/s^2": 1},
)
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?")
_HEX = re.compile(r"0x([0-9A-Fa-f]+)|([0-9A-Fa-f]+)h")


def number(text: str, unit: str) -> float:
    """The number of `text` in `unit` ("": a bare number). Raises ValueError: what is wrong, what would be right."""
    if not unit and (m := _HEX.fullmatch(text)):
        return float(int(m[1] or m[2], 16))
    m = _NUMBER.match(text)
    if not m:
        raise ValueError(expected("a number", repr(text)))
    value, suffix = Fraction(m.group()), text[m.end() :]
    return float(value * _ratio(suffix, unit)) if suffix else float(m.group())


def _quantity(unit: str) -> Mapping[str, Fraction | int]:
    return next((q for q in _QUANTITIES if unit in q), {})


def alike(unit: str) -> list[str]:
    """Units that may be written in place of `unit`, that one first."""
    return [unit, *(u for u in _quantity(unit) if u != unit)] if unit else []


def _ratio(given: str, wanted: str) -> Fraction:
    if given == wanted:
        return Fraction(1)
    if given not in alike(wanted):
        known = " ".join(alike(wanted))
        raise ValueError(expected(f"one of {known}" if known else "a bare number", repr(given), "unit"))
    return Fraction(_quantity(wanted)[given]) / _quantity(wanted)[wanted]
