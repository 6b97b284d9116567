"""The probe: levels of a unit's lines now, and recordings of them as VCD. Through the control socket."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from psabench.link.control import HasControl


class Probe:
    """Of an emulated bench; a real one wants a logic analyser. Raises BenchError there, ControlError when rejected."""

    def __init__(self, bench: HasControl) -> None:
        self._bench = bench

    def lines(self, unit: str | None = None) -> dict[str, int]:
        """Level of each line of a unit (the first) at this instant."""
        levels = self._bench.control.call("lines", **_unit(unit)).result["lines"]
        return {str(name): int(level) for name, level in levels.items()}

    def start(
        self, path: str | Path, unit: str | None = None, limit_mb: float | None = None, *, pairs: bool = False
    ) -> None:
        """Record the lines of a unit (the first) into a VCD file from now on, up to limit_mb (1000).

        pairs: with the wires A and B of its differential lines.
        """
        more: dict[str, Any] = {} if limit_mb is None else {"limit_mb": limit_mb}
        if pairs:
            more["pairs"] = True
        self._bench.control.call("vcd.start", path=os.path.abspath(path), **_unit(unit), **more)

    def stop(self) -> None:
        """End the recording; the file gets its closing time. ControlError: it has ended before, and what it holds."""
        self._bench.control.call("vcd.stop")

    def flush(self) -> None:
        """Write what has been recorded so far, with a closing time; the recording goes on."""
        self._bench.control.call("vcd.flush")

    def arm(
        self,
        on: str,
        path: str | Path,
        *,
        unit: str | None = None,
        pre_s: float = 0.01,
        post_s: float = 0.01,
        files: int = 1,
        **more: float,
    ) -> None:
        """Capture the lines of a unit (the first) around a trigger into VCD files.

        on: fault[:KIND], event:NAME, line:NAME:rising|falling|edge|high|low. more: count, ring_mb, limit_mb of the
        command probe.arm.
        """
        times: dict[str, object] = {"pre_s": pre_s, "post_s": post_s, "files": files}
        self._bench.control.call("probe.arm", on=on, path=os.path.abspath(path), **_unit(unit), **times, **more)

    def disarm(self) -> None:
        """End the capture; a file that is being written ends."""
        self._bench.control.call("probe.disarm")

    def captures(self) -> dict[str, Any]:
        """State of the capture, and its latest files with the instants of trigger, begin and end in simulated ns."""
        return dict(self._bench.control.call("probe.captures").result)


def _unit(name: str | None) -> dict[str, object]:
    return {} if name is None else {"unit": name}
