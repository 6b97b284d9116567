"""Faults of an emulated bench: what can break, where, and when. Through the control socket.

    bench.faults.add("sensor.drift", "a.sensor.x", drift_v_per_s=0.01, at_s=0.1, for_s=10.0)
    with bench.fault("sensor.bias", "a.sensor.x", bias_v=0.1, after="DRD_A", count=3, since="SYNC_A"):
        ...

docs/faults.md has every kind with its arguments, and which points support it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from psabench.link.control import HasControl


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault that was accepted. As a context manager it is cleared at the end of the block."""

    faults: Faults
    id: int
    kind: str
    point: str

    def clear(self) -> None:
        """Lift it if it is on, forget it if it has not come yet."""
        self.faults.clear(self.id)

    def state(self) -> dict[str, Any]:
        """Its row of `faults.list`; empty when it was cleared."""
        return next((row for row in self.faults.list() if row["id"] == self.id), {})

    def __enter__(self) -> Fault:
        return self

    def __exit__(self, *_: object) -> None:
        if self.state():
            self.clear()


class Faults:
    """Raises BenchError on a real bench; ControlError with the reason when the emulator rejects."""

    def __init__(self, bench: HasControl) -> None:
        self._bench = bench

    def kinds(self) -> list[dict[str, Any]]:
        """All kinds: "kind", "what" it does, how it is "seen", "points" that support it, "args" with unit and range."""
        return list(self._bench.control.call("fault.kinds").result["kinds"])

    def points(self, kind: str | None = None) -> list[str]:
        """All points of this bench; with a kind, those that support it."""
        args = {} if kind is None else {"kind": kind}
        return [str(p) for p in self._bench.control.call("fault.points", **args).result["points"]]

    def add(self, kind: str, point: str, **args: object) -> Fault:
        """Plan a fault at a point.

        at_s: instant, simulated seconds since power-on; or after: an event of the unit, the count-th since the event
        named by since; without either, now. for_s: how long, 0 until it is cleared. The kind's own arguments besides.
        """
        reply = self._bench.control.call("fault.add", kind=kind, point=point, **args)
        return Fault(self, int(reply.result["id"]), kind, point)

    def list(self) -> list[dict[str, Any]]:
        """The faults planned, on and over."""
        return list(self._bench.control.call("fault.list").result["faults"])

    def clear(self, number: int | None = None) -> None:
        """Lift and forget the fault with this id, or all of them."""
        self._bench.control.call("fault.clear", **({} if number is None else {"id": number}))
