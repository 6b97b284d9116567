#!/usr/bin/env python3
"""Draw docs/img/flight.svg of docs/procedures/flight.md from emu/phys/flight itself. Same bytes each time.

tools/plots/flight.py [docs/img]
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from psabench.native.flight_model import Flight  # noqa: E402
from psabench.report import plots  # noqa: E402

RADIUS_KM = 6371.0


def flown() -> Flight:
    """The scenario `flight`, resolved."""
    dump = subprocess.run([ROOT / "build/psa-emu", "flight", "--dump"], capture_output=True, check=True, text=True)
    resolved = json.loads(dump.stdout)["flight"]
    return Flight(resolved["legs"], heading_deg=resolved["heading_deg"])


def draw(path: Flight) -> Figure:
    """The way over the ground, the airfield larger, and what changes with time."""
    t_ns = np.arange(0, path.end_ns, 250_000_000)
    s = path.states(t_ns)
    t_min = t_ns / 60e9
    east = (s.lon_rad - s.lon_rad[0]) * np.cos(s.lat_rad) * RADIUS_KM
    north = (s.lat_rad - s.lat_rad[0]) * RADIUS_KM
    speed = np.hypot(s.v_enu_mps[:, 0], s.v_enu_mps[:, 1])
    with plots.drawing(7.6, 4, 2, height_ratios=[2.2, 1, 1, 1]) as (figure, axes):
        grid = axes[0, 0].get_gridspec()
        for ax in axes[1:].ravel():
            ax.remove()
        way, field = axes[0]
        way.plot(east, north, color=plots.SERIES[0], lw=1.3)
        way.set_title("the way, km")
        ground = t_ns < path.leg_ns[14]
        field.plot(1e3 * east[ground], 1e3 * north[ground], color=plots.SERIES[0], lw=1.3)
        field.set_title("taxi and take-off run, m")
        for ax in (way, field):
            ax.set_aspect("equal", adjustable="datalim")
            ax.plot(0, 0, "o", color=plots.SERIES[1], ms=4)
        profiles = (
            ("height, km", s.h_m / 1e3),
            ("speed, m/s", speed),
            ("bank, deg", np.degrees(s.roll_rad)),
        )
        for row, (name, values) in enumerate(profiles, 1):
            ax = figure.add_subplot(grid[row, :])
            ax.plot(t_min, values, color=plots.SERIES[0], lw=1.2)
            ax.set_ylabel(name)
        ax.set_xlabel("time, min")
    return figure


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/img"
    text = plots.standalone(plots.svg(draw(flown()), "flight"))
    (folder / "flight.svg").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
