"""Stimuli of the line port."""

from __future__ import annotations

import numpy as np

from psabench.boards.registry import BOARDS
from psabench.conform.capture.log import Capture
from psabench.conform.dut import Dut
from psabench.conform.plan import stimulus
from psabench.conform.sources.samples import line_log
from psabench.conform.verdict import Inconclusive
from psabench.link.lineport import SAMPLE_HZ

LOOK_S, TAIL_S = 0.06, 0.02


@stimulus("line_port", boards=BOARDS)
def line_port(s: Dut) -> Capture:
    """The line port, beside all pins where they are there. Facts: `bytes` of the port, its edges as `port`."""
    if s.line_port is None:
        raise Inconclusive("no line port")
    s.wait_ready()
    both = s.probe is not None and s.probe is not s.line_port
    with s.take(lines=both) as take:
        s.run_for(TAIL_S)
        s.line_port.start()
        try:
            s.run_for(LOOK_S)
        finally:
            s.line_port.stop()
        s.run_for(TAIL_S)
    data = s.line_port.data
    take.facts["bytes"] = np.frombuffer(data, np.uint8)
    take.facts["port"] = line_log(data, s.variant.family, SAMPLE_HZ)
    return s.capture("line_port", take)
