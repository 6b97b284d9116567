"""Stimuli of the line port."""

from __future__ import annotations

import numpy as np

from psabench.boards.registry import BOARDS
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut
from psabench.conform.plan import stimulus
from psabench.conform.sources.samples import line_log
from psabench.conform.verdict import known
from psabench.link.lineport import SAMPLE_HZ

LOOK_S, TAIL_S = 0.06, 0.02


@stimulus("line_port", boards=BOARDS)
def line_port(s: Dut) -> Capture:
    """The line port, beside all pins where they are there. Facts: `bytes` of the port, its edges as `port`."""
    port = known(s.line_port, "no line port")
    s.wait_ready()
    both = s.probe is not None and s.probe is not port
    with s.take(lines=both) as take:
        s.run_for(TAIL_S)
        port.start()
        try:
            s.run_for(LOOK_S)
        finally:
            port.stop()
        s.run_for(TAIL_S)
    take.facts["bytes"] = np.frombuffer(port.data, np.uint8)
    take.facts["port"] = line_log(port.data, s.variant.family, SAMPLE_HZ)
    return s.capture("line_port", take)
