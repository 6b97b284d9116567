"""Numbers with units: `5ms` for an argument in seconds, `10deg/s`, `0.1rad`, `3.3e-3`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from fractions import Fraction

from psabench.errors import expected

_RAD = Fraction(180 / math.pi)  # degrees
# Unit: quantity and how many of the quantity's first unit it is. Exact, so that 63ms is the number 0.063.
_UNITS: Mapping[str, tuple[str, Fraction]] = {
    "s": ("time", Fraction(1)),
    "ms": ("time", Fraction(1, 10**3)),
    "us": ("time", Fraction(1, 10**6)),
    "ns": ("time", Fraction(1, 10**9)),
    "min": ("time", Fraction(60)),
    "h": ("time", Fraction(3600)),
    "deg": ("angle", Fraction(1)),
    "arcmin": ("angle", Fraction(1, 60)),
    "arcsec": ("angle", Fraction(1, 3600)),
    "rad": ("angle", _RAD),
    "mrad": ("angle", _RAD / 1000),
    "deg/s": ("rate", Fraction(1)),
    "dps": ("rate", Fraction(1)),
    "deg/h": ("rate", Fraction(1, 3600)),
    "rad/s": ("rate", _RAD),
    "deg/s^2": ("angular acceleration", Fraction(1)),
    "dps2": ("angular acceleration", Fraction(1)),
    "Hz": ("frequency", Fraction(1)),
    "mHz": ("frequency", Fraction(1, 1000)),
    "kHz": ("frequency", Fraction(1000)),
    "MHz": ("frequency", Fraction(10**6)),
    "V": ("voltage", Fraction(1)),
    "mV": ("voltage", Fraction(1, 1000)),
    "uV": ("voltage", Fraction(1, 10**6)),
    "degC": ("temperature", Fraction(1)),
    "K": ("difference of temperature", Fraction(1)),
    "K/min": ("rate of temperature", Fraction(1)),
    "K/s": ("rate of temperature", Fraction(60)),
    "m": ("length", Fraction(1)),
    "mm": ("length", Fraction(1, 1000)),
    "ppm": ("ratio", Fraction(1)),
    "m/s^2": ("acceleration", Fraction(1)),
}
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


def alike(unit: str) -> list[str]:
    """Units that may be written in place of `unit`, that one first."""
    if unit not in _UNITS:
        return [unit] if unit else []
    return [unit, *(u for u, (quantity, _) in _UNITS.items() if quantity == _UNITS[unit][0] and u != unit)]


def _ratio(given: str, wanted: str) -> Fraction:
    if given == wanted:
        return Fraction(1)
    if given not in alike(wanted):
        known = " ".join(alike(wanted))
        raise ValueError(expected(f"one of {known}" if known else "a bare number", repr(given), "unit"))
    return _UNITS[given][1] / _UNITS[wanted][1]
