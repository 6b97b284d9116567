"""What both fault matrices share: a kind at a point, and whether the emulator takes it."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import ClassVar, TypeVar

from fault_host import SETUP_S, Host
from psabench.errors import ControlError

FAR_S = 1e5  # an instant that does not come

# Values with which a kind is tried at a point that will refuse it.
VALUES: dict[str, dict[str, object]] = {
    "sensor.bias": {"bias_v": 1},
    "sensor.drift": {"drift_v_per_s": 1},
    "sensor.scale": {"scale_ppm": 1},
    "sensor.noise": {"rms_v": 1},
    "sensor.saturation": {"low_v": 1},
    "analog.reference": {"reference_ppm": 1},
    "analog.ripple": {"amplitude_v": 1, "frequency_hz": 1},
    "chip.drdy_stuck": {"level": "low"},
    "chip.dout_dead": {"level": "low"},
    "chip.clock": {"clock_ppm": 1},
    "chip.flip": {"register": 1, "mask": 1},
    "line.stuck": {"level": "low"},
    "line.glitch": {"width_ns": 1},
    "line.missing_pulse": {"pulse": 1},
    "line.extra_pulse": {"pulse": 1, "width_ns": 1},
    "line.noise": {"rate_hz": 1, "width_ns": 1},
    "link.delay": {"hold_s": 1},
    "supply.brownout": {"drop_v": 12, "for_s": 1},
    "platform.drift_step": {"drift_degph": 1},
    "chamber.slow": {"rate_part": 0.5},
    "chamber.readout": {"readout_k": 1},
    "table.ripple": {"ripple_dps": 1, "frequency_hz": 1},
    "chamber.overshoot": {"overshoot_k": 1},
    "head.slip": {"slip_deg": 1},
    "scpi.late": {"late_s": 1},
    "receiver.spoof": {"ramp_mps": 1},
    "receiver.jump": {"jump_m": 1},
    "receiver.wrong_week": {"weeks": 1},
    "gyro.saturation": {"limit_dps": 1},
    "gyro.bias": {"drift_degph": 1},
    "gyro.scale": {"scale_ppm": 1},
    "gyro.lock_in": {"lock_in_degph": 1},
}


@dataclass
class FaultCase:
    """A kind at a point; each board's tests add how they look at it."""

    host: Host
    kind: str
    point: str
    ids: list[int] = field(default_factory=list)
    setup_s: ClassVar[float] = SETUP_S  # from Res to readings

    @property
    def unit(self) -> str:
        """Of the point; those of the whole bench are looked at through the first."""
        first = self.point.split(".")[0]
        return first if first in self.host.node else next(iter(self.host.node))

    @property
    def axis(self) -> int:
        return "xyz".index(self.point[-1])

    def add(self, **args: object) -> None:
        self.ids.append(self.host.add(self.kind, self.point, **args))

    def clear(self) -> None:
        for number in self.ids:
            self.host.clear(number)
        self.ids.clear()

    def reset(self) -> None:
        self.host.reset(self.unit)
        self.host.bus.advance(self.setup_s)


CaseT = TypeVar("CaseT", bound=FaultCase)


class Looks(dict[str, Callable[[CaseT], None]]):
    """How each kind of fault is seen: adds it to the case and asserts what is then on the wire."""

    def look(self, kind: str) -> Callable[[Callable[[CaseT], None]], Callable[[CaseT], None]]:
        """Decorator: the function is that of this kind."""
        assert kind not in self, kind

        def enter(see: Callable[[CaseT], None]) -> Callable[[CaseT], None]:
            self[kind] = see
            return see

        return enter


def near(got: float, want: float, tolerance: float) -> None:
    assert abs(got - want) <= tolerance, f"{got} is not {want} within {tolerance}"


def must_accept(rules: Mapping[str, str], kind: str, point: str) -> bool:
    """By the pattern of points of the kind, else of its layer."""
    pattern = rules.get(kind) or rules[kind.split(".")[0]]
    return re.fullmatch(pattern, point) is not None


def accepted(c: FaultCase, values: Mapping[str, Mapping[str, object]] = VALUES) -> bool:
    """Whether the emulator takes it, tried for an instant that does not come."""
    try:
        c.add(**values.get(c.kind, {}), at_s=FAR_S)
    except ControlError as e:
        why = e
    else:
        c.clear()
        return True
    assert why.code == "point", why
    assert len(str(why)) > 30, "a refusal gives the reason"
    assert not c.host.call("fault.list")["faults"], "and changes nothing"
    return False
