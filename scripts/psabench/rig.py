"""A bench ready for use: emulator (started, or one that is there), bus, control socket, unit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

from psabench.can_host import CanHost, Clock, StepClock, WallClock, open_bus
from psabench.control import Control
from psabench.device import Psa2
from psabench.emulator import Emulator
from psabench.errors import BadInput
from psabench.protocol_files import DBC_NODE


@dataclass(frozen=True, slots=True, kw_only=True)
class Rig:
    """What a procedure or a script works with."""

    host: CanHost
    unit: Psa2
    control: Control
    truth_path: Path | None  # the truth port, for graders
    emulator: Emulator | None  # None: somebody else's


@contextmanager
def open_rig(
    scenario: str | Path = "calibrate",
    *,
    pace: str = "step",
    seed: int | None = None,
    node: int = DBC_NODE,
    extra: Sequence[str | Path] = (),
) -> Iterator[Rig]:
    """Start an emulator of ours with a scenario (name or file) and connect to it over socketcand.

    pace: "step" (time moves when the host waits, as fast as it can), "wall" (real time). extra: further arguments of
    psa-emu. Raises BadInput or BenchError with the emulator's own words.
    """
    with Emulator(scenario, pace=pace, seed=seed, truth=True, extra=extra) as emulator:
        e = emulator.endpoint(can="socketcand")
        spec = f"socketcand:{e['host']}:{e['port']}"
        with connect(spec, emulator.control_path, emulator.truth_path, node, emulator) as rig:
            yield rig


@contextmanager
def connect(
    spec: str | None,
    control_path: Path | None,
    truth_path: Path | None = None,
    node: int = DBC_NODE,
    emulator: Emulator | None = None,
) -> Iterator[Rig]:
    """Connect to a bench that is there: python-can spec (see `open_bus`) and control socket."""
    if control_path is None:
        raise BadInput("--control is missing: the dividing head is turned through the control socket of the bench")
    with ExitStack() as stack:
        host = stack.enter_context(CanHost(open_bus(spec), WallClock()))
        control = stack.enter_context(Control(control_path))
        host.clock = _clock(control)
        yield Rig(host=host, unit=Psa2(host, node), control=control, truth_path=truth_path, emulator=emulator)


def _clock(control: Control) -> Clock:
    return StepClock(control) if control.call("time").result.get("pace") == "step" else WallClock()
