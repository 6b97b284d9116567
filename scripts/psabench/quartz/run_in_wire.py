"""Units of a run-in on the bench: chamber, head and supply over SCPI, PSA-2 over CAN.

One bench is started and forked for each unit: the child has noise and head errors of a seed of its own, and on its
board the sensors of that serial number, to the bit as in a bench that was started with them.

The same serial numbers, course and starts as on the sensor model, with all that a bench adds: the converter with its
offset, noise and reference, the head's setting error. What a change from start to start may differ by:

- noise of the readings, type A, on either side; neighbouring samples of the converter are not independent, so the
  scatter is that of means of 50
- the head's setting error, 2" rms of the scenario at each turn: (I3 - I4)/2 has it over sqrt(2)

Offset and scale of the converter are constant from start to start: 128 starts of units without scatter show no more
than the noise (0.18 ug, 0.18 ppm; E3).

The unit is off during a cycle.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from psabench.bench import Bench
from psabench.campaign import builds
from psabench.errors import BenchError
from psabench.native.quartz_model import Readings
from psabench.places import find_emulator, proto_file
from psabench.quartz.batch import QUANTITIES
from psabench.quartz.draws import draw_source
from psabench.quartz.plate import Array
from psabench.quartz.run_in import Chain, RunIn, estimate_units

SCENARIO = "scenarios/quartz_chamber.yaml"
FILES = (SCENARIO, "psabench.dbc", "psa2.eds")
HEAD_DEG = (270.0, 90.0, 180.0, 0.0)  # g along +x, -x, +y, -y of the unit
SAMPLE_HZ = 1000.0
LOAD_OHM = 937.5  # of the scenario
FORK_SEEDS = 2**53  # that `fork` takes
SETTLE_S, OFF_S = 1.0, 1.0
LOOKS, NEAR_S = 20, 10.0  # at a chamber on its way; a way that is worth no look
HEAD_ARCSEC = 2.0  # setting error of the scenario's head, rms
BATCHES = 20  # of a reading, for its type A uncertainty


def make_scenario(what: RunIn, serial: int = 1) -> dict[str, Any]:
    """The shipped scenario with this unit, course and batch."""
    import yaml

    found: dict[str, Any] = yaml.safe_load(proto_file(SCENARIO).read_text(encoding="utf-8"))
    s = what.schedule
    found["site"] = {"g_mps2": s.g_mps2}
    found["chamber"] |= {"start_degc": s.read_degc, "ramp_k_per_min": s.ramp_k_per_min}
    found["spread"] = {"quartz": dict(what.batch)}
    unit = found["units"][0]
    unit["serial"] = serial
    for axis in unit["axes"].values():
        axis["quartz"] |= {"noise_a_rthz": s.noise_a_rthz, "play_k": s.play_k}
    return found


def measure_wire(what: RunIn, first_serial: int, units: int) -> tuple[Array, Array]:
    """As `measure_model`, through the wire; the uncertainties include the bench's. Raises BenchError."""
    with start_bench(make_scenario(what), what.seed) as warm:
        warm.unit.wait_ready()
        found = [_read_forked(warm, what, first_serial + k) for k in range(units)]
    values, noise = estimate_units(
        Readings(mean_a=np.stack([r.mean_a for r in found]), sd_a=np.stack([r.sd_a for r in found]))
    )
    bench = np.array([0.0, 0.0, HEAD_ARCSEC / np.sqrt(2.0)])
    return values, np.hypot(noise, bench)


@contextmanager
def start_bench(scenario: Mapping[str, Any], seed: int) -> Iterator[Bench]:
    """An emulator with this scenario."""
    import yaml

    with tempfile.TemporaryDirectory(prefix="psabench-") as folder:
        path = Path(folder) / "unit.yaml"
        path.write_text(yaml.dump(scenario, Dumper=yaml.SafeDumper), encoding="utf-8")
        with Bench.start(path, seed=seed) as bench:
            yield bench


def _read_forked(warm: Bench, what: RunIn, serial: int) -> Readings:
    """The same whichever units were measured before."""
    seed = int(draw_source(what.seed, f"run-in bench {serial}").integers(FORK_SEEDS))
    with warm.fork(seed=seed) as bench:
        bench.exchange_sensors(serial)
        return read_unit(bench, what)


def read_unit(bench: Bench, what: RunIn) -> Readings:
    """Every start of the unit on the bench, (starts, positions). Raises BenchError."""
    volts = np.array([_read_start(bench, what, n) for n in range(what.schedule.cycles + 1)])
    return Readings(mean_a=volts[..., 0] / LOAD_OHM, sd_a=volts[..., 1] / LOAD_OHM)


def _read_start(bench: Bench, what: RunIn, cycle: int) -> Sequence[tuple[float, float]]:
    """Mean and its standard deviation at each position, V; after a cycle, but for the first."""
    if cycle > 0:
        _run_cycle(bench, what)
    bench.unit.wait_ready()
    return [_read_position(bench, angle_deg, what.schedule.reading_s) for angle_deg in HEAD_DEG]


def _run_cycle(bench: Bench, what: RunIn) -> None:
    """Off, cold, hot, back, on."""
    s = what.schedule
    bench.supply.output(False)
    for degc, stay_min in ((s.cold_degc, s.soak_min), (s.hot_degc, s.soak_min), (s.read_degc, s.rest_min)):
        bring_chamber(bench, degc)
        bench.wait_away(60.0 * stay_min + OFF_S)
    bench.supply.output(True)


def bring_chamber(bench: Bench, degc: float) -> None:
    """Until the chamber calls its air stable. It is asked each second only when it should be there by its own ramp; one
    that is slower, as where its cooling is limited, is asked again after what is then left. Raises TimeOut."""
    bench.chamber.set(degc)
    for _ in range(LOOKS):
        left_s = 60.0 * abs(bench.chamber.temp_degc - degc) / bench.chamber.ramp_k_per_min
        if left_s < NEAR_S:
            break
        bench.wait_away(left_s)
    bench.chamber.wait_stable()


def _read_position(bench: Bench, angle_deg: float, reading_s: float) -> tuple[float, float]:
    bench.head.turn(angle_deg)
    bench.wait(SETTLE_S)
    many = BATCHES * max(1, round(SAMPLE_HZ * reading_s / BATCHES))
    volts = bench.unit.stream(many, timeout_s=reading_s + 5.0).axis("x")
    if not np.all(np.isfinite(volts)):
        raise BenchError("run-in: the unit sent samples that are no numbers")
    means = volts.reshape(BATCHES, -1).mean(axis=1)
    return float(means.mean()), float(means.std(ddof=1) / np.sqrt(BATCHES))


@cache
def wire_digest() -> str:
    """SHA-256 of psa-emu, the protocol's files, and the host's code that takes part."""
    return builds.digest([find_emulator(), *map(proto_file, FILES), *builds.sources("psabench.quartz.run_in_wire")])


WIRE = Chain(name="through the wire", part_units=10, unit_s=1.5, digest=wire_digest, measure=measure_wire)


# ---- beside the model


@dataclass(frozen=True, slots=True, kw_only=True)
class Agreement:
    """Of one quantity: changes from start to start through the wire less those of the model."""

    quantity: str
    count: int
    rms: float  # the quantity's unit
    u: float  # combined standard uncertainty of a difference
    z_rms: float
    within_2u: float


def compare_changes(wire: tuple[Array, Array], model: tuple[Array, Array]) -> list[Agreement]:
    """Values and uncertainties (units, starts, 3) of the same units. Offsets and scale of the converter drop out."""
    off = np.diff(wire[0], axis=1) - np.diff(model[0], axis=1)
    squares = wire[1] ** 2 + model[1] ** 2
    u = np.sqrt(squares[:, 1:] + squares[:, :-1])
    found = []
    for k, q in enumerate(QUANTITIES):
        z = off[..., k] / u[..., k]
        rms = [float(np.sqrt(np.mean(x**2))) for x in (off[..., k], u[..., k], z)]
        within = float((np.abs(z) <= 2.0).mean())
        found.append(Agreement(quantity=q, count=z.size, rms=rms[0], u=rms[1], z_rms=rms[2], within_2u=within))
    return found
