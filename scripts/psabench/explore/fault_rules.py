"""Each kind of fault: with which values it is tried, and which requirements must hold while it is on.

A fault that was announced excuses what it breaks by its nature (docs/faults.md), and nothing else:

    VALUES    what is measured is wrong; all that is not about values at the inputs holds
    LINES     the fault lies between the board and who looks at its lines; the bus sees nothing of it
    READINGS  a converter or its controller is ill; the services of the bus hold
    NOTHING   the link or the supply fails; looks wait until it is over
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from random import Random
from typing import Any

VALUES, LINES, READINGS, NOTHING = "values", "lines", "readings", "nothing"
LEVELS = ("low", "high")
LEAK = {"probability": (0.05, 0.3, 1.0)}
FLIPS = {"register": tuple(range(11)), "mask": (1, 2, 0x10, 0x80)}
HOLD = {**LEAK, "hold_s": (0.0003, 0.002, 0.01)}


@dataclass(frozen=True, slots=True)
class Rule:
    """holds: what must hold while it is on. values: choices for each argument. not_at: endings of points left out.

    is_once: it is over at once, and has no duration. board: the only one that has it, where a point does not say so.
    """

    holds: str
    values: Mapping[str, tuple[Any, ...]]
    not_at: tuple[str, ...] = ()
    is_once: bool = False
    board: str | None = None


RULES: Mapping[str, Rule] = {
    "sensor.stuck": Rule(VALUES, {"out_v": (0.0, 0.5, -3.0)}),
    "sensor.bias": Rule(VALUES, {"bias_v": (0.1, -2.0)}),
    "sensor.drift": Rule(VALUES, {"drift_v_per_s": (1.0, -5.0)}),
    "sensor.noise": Rule(VALUES, {"rms_v": (0.01, 1.0)}),
    "sensor.open": Rule(VALUES, {}),
    "sensor.saturation": Rule(VALUES, {"low_v": (-0.5,), "high_v": (0.5,)}),
    "analog.reference": Rule(VALUES, {"reference_ppm": (10_000, -100_000)}),
    "analog.ripple": Rule(VALUES, {"amplitude_v": (0.1, 1.0), "frequency_hz": (20.0, 400.0)}),
    "chip.drdy_stuck": Rule(READINGS, {"level": LEVELS}),
    "chip.dout_dead": Rule(READINGS, {"level": LEVELS}),
    "chip.lost_sync": Rule(READINGS, {}),
    "chip.clock": Rule(READINGS, {"clock_ppm": (20_000, -20_000)}),
    "chip.flip": Rule(READINGS, FLIPS, not_at=(".rom",), is_once=True),  # no reset mends a read-only memory
    "controller.skip_sync_t": Rule(READINGS, {}),
    "controller.setup_order": Rule(READINGS, {}),
    "controller.frozen_words": Rule(READINGS, {}),
    "controller.capacitor": Rule(READINGS, {}),
    "controller.stuck_reset": Rule(READINGS, {}),
    "controller.stuck_key": Rule(READINGS, {}),
    "line.stuck": Rule(LINES, {"level": LEVELS}),
    "line.swapped": Rule(LINES, {}),
    "line.open": Rule(LINES, {}),
    "line.glitch": Rule(LINES, {"width_ns": (100, 10_000)}, is_once=True),
    "line.missing_pulse": Rule(LINES, {"pulse": (1, 40)}),
    "line.extra_pulse": Rule(LINES, {"pulse": (1, 40), "width_ns": (100,)}),
    "line.noise": Rule(LINES, {"rate_hz": (2000.0,), "width_ns": (100,)}),
    "link.drop": Rule(NOTHING, LEAK),
    "link.duplicate": Rule(NOTHING, LEAK),
    "link.reorder": Rule(NOTHING, LEAK),
    "link.delay": Rule(NOTHING, HOLD),
    "link.corrupt": Rule(NOTHING, LEAK),
    "link.error_frame": Rule(NOTHING, LEAK),
    "link.bus_off": Rule(NOTHING, {}, is_once=True),
    "supply.brownout": Rule(NOTHING, {"drop_v": (6.0, 12.0)}),
    "platform.torquer": Rule(READINGS, {}),
    "platform.drift_step": Rule(READINGS, {"drift_degph": (0.1, 100.0)}),
    "platform.encoder_stuck": Rule(READINGS, {}),
    "gyro.stuck": Rule(VALUES, {}, board="bins"),
    "gyro.saturation": Rule(VALUES, {"limit_dps": (0.001, 1.0)}, board="bins"),
    "gyro.bias": Rule(VALUES, {"drift_degph": (1.0, -1000.0)}, board="bins"),
    "gyro.scale": Rule(VALUES, {"scale_ppm": (100.0, -10_000.0)}, board="bins"),
    "gyro.lock_in": Rule(VALUES, {"lock_in_degph": (10.0, 1000.0)}, board="bins"),
    "receiver.outage": Rule(READINGS, {}, board="receiver"),
    "receiver.spoof": Rule(VALUES, {"ramp_mps": (0.5, 30.0)}, board="receiver"),
    "receiver.jump": Rule(VALUES, {"jump_m": (5.0, 1000.0)}, board="receiver"),
    "receiver.frozen_time": Rule(READINGS, {}, board="receiver"),
    "receiver.wrong_week": Rule(READINGS, {"weeks": (1, -1024)}, board="receiver"),
}

# Kinds that are not tried, and why.
LEFT_OUT: Mapping[str, str] = {
    "sensor.scale": "the bench's sensors feel no acceleration",
    "analog.load_open": "the bench's sensors give voltages",
    "analog.load_short": "the bench's sensors give voltages",
    "link.stall": "the host in process could not go on",
    "chamber.slow": "the chamber stays where it is",
    "chamber.readout": "no requirement is about the chamber's thermometer",
    "chamber.overshoot": "the chamber stays where it is",
    "table.ripple": "the bench's sensors feel no acceleration",
    "head.stick": "the bench's sensors feel no acceleration",
    "head.slip": "the bench's sensors feel no acceleration",
    "scpi.silent": "the host speaks to no instrument by SCPI",
    "scpi.late": "the host speaks to no instrument by SCPI",
    "scpi.garbled": "the host speaks to no instrument by SCPI",
    "receiver.bad_checksum": "no requirement is about the serial port",
}


def drawn_values(rng: Random, kind: str) -> dict[str, Any]:
    """Arguments of a fault of this kind."""
    return {name: rng.choice(choices) for name, choices in RULES[kind].values.items()}
