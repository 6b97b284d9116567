"""Lines of a PSA-2 as a recording, with torn frames, and what CAN had of them."""

from __future__ import annotations

from pathlib import Path

from psabench.bench import Bench
from psabench.boards.psa2.frames import Frames

PULSE = 40  # that each frame lacks


def record_psa2(path: Path) -> Frames:
    """From 0.21 s on 100 ms, 30 ms of them with torn frames. Returns what was on CAN."""
    with Bench.start("stream", seed=1) as bench:
        bench.wait(0.21)
        bench.probe.start(path)
        bench.wait(0.03)
        fault = bench.fault("line.missing_pulse", "a.line.CLK", pulse=PULSE)
        bench.wait(0.03)
        fault.clear()
        bench.wait(0.04)
        bench.probe.stop()
        return bench.unit.frames.take()
