"""A temperature for a measurement: the chamber goes there, what is in it follows, and only then are the units on."""

from __future__ import annotations

from psabench.bench import Bench

SOAK_LIMIT_S = 24 * 3600.0


def soak_units(bench: Bench, temp_degc: float, soak_s: float, start_s: float) -> float:
    """Bring chamber and units to a temperature; returns what the chamber shows, degC.

    A supply, if the bench has one, is off on the way and on for start_s before this returns: the units set
    themselves up at the temperature. The case of a unit follows the air to a part of exp(-soak_s/tau).
    """
    powered = "supply" in bench.addresses
    if powered:
        bench.supply.output(False)
    bench.chamber.set(temp_degc, wait=True, limit_s=SOAK_LIMIT_S)
    bench.wait(soak_s)
    if powered:
        bench.supply.output(True)
    bench.wait(start_s)
    return bench.chamber.temp_degc
