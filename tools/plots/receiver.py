#!/usr/bin/env python3
"""Draw docs/img/receiver.svg of docs/boards/receiver.md: an emulated receiver at rest under its faults. Same bytes.

tools/plots/receiver.py [docs/img]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from psabench.bench import Bench  # noqa: E402
from psabench.boards.receiver.device import Receiver, Solutions, solutions_of  # noqa: E402
from psabench.report import plots  # noqa: E402

SCENARIO = """seed: 4
start: true
site: {latitude_deg: 55.75, longitude_deg: 37.61, height_m: 150}
units:
  - name: gps
    board: receiver
    on: fixed
    profile_set:
      {rate_hz: 1, baud: 9600, messages: [GGA], white_m: 1, white_mps: 0.05, slow_m: 3, slow_mps: 0.05, slow_s: 60}
timeline:
"""
SECONDS = 500
FAULTS = (  # from, for, more
    ("outage", 120.5, 40.0, ""),
    ("jump", 240.5, 60.0, ", jump_m: 25, azimuth_deg: 90"),
    ("spoof", 360.5, 90.0, ", ramp_mps: 0.4, azimuth_deg: 0"),
)
FAULT = "  - {{at_s: {}, cmd: fault.add, args: {{point: gps.solver, kind: receiver.{}, for_s: {}{}}}}}\n"
LAT_RAD, LON_RAD = np.radians(55.75), np.radians(37.61)
M_PER_RAD = np.array([111_343.0, 62_806.0]) * 180.0 / np.pi  # north, east, there


def received() -> Solutions:
    """Over CAN, free pace."""
    faults = "".join(FAULT.format(at_s, kind, length_s, more) for kind, at_s, length_s, more in FAULTS)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "receiver.yaml"
        path.write_text(SCENARIO + faults, encoding="utf-8")
        with Bench.start(str(path)) as bench:
            receiver = bench.board(Receiver)
            receiver.wait_ready()
            return solutions_of(receiver.stream(SECONDS, timeout_s=SECONDS + 10))


def draw(s: Solutions) -> Figure:
    """Position and velocity less the truth."""
    t_s, gap = s.gps_s - s.gps_s[0], np.where(s.valid, 1.0, np.nan)
    north, east = (s.lat_rad - LAT_RAD) * M_PER_RAD[0], (s.lon_rad - LON_RAD) * M_PER_RAD[1]
    speeds = (s.v_enu_mps[:, 0], s.v_enu_mps[:, 1])
    with plots.drawing(4.2, 2, 1, sharex=True) as (figure, (top, bottom)):
        for ax, rows, unit in ((top, (east, north), "position error, m"), (bottom, speeds, "velocity error, m/s")):
            for name, values, colour in zip(("east", "north"), rows, plots.SERIES, strict=False):
                ax.plot(t_s, values * gap, color=colour, lw=0.9, label=name)
            for _, begin_s, length_s, _ in FAULTS:
                ax.axvspan(begin_s, begin_s + length_s, color=plots.MUTED, alpha=0.15, lw=0)
            ax.set_ylabel(unit)
        for kind, begin_s, *_ in FAULTS:
            top.text(begin_s, 0.98, f" {kind}", transform=top.get_xaxis_transform(), va="top", fontsize=8)
        top.legend(loc="lower left", ncols=2)
        bottom.set_xlabel("time, s")
    return figure


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/img"
    text = plots.standalone(plots.svg(draw(received()), "receiver"))
    (folder / "receiver.svg").write_text(text, encoding="utf-8")
