#!/usr/bin/env python3
"""Draw docs/img/koi.svg of docs/procedures/koi.md: what a drawn flight shows of a unit, and when. Same bytes each time.

tools/plots/koi.py [docs/img]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))

from psabench.koi.fleet.grade import place_errors  # noqa: E402
from psabench.koi.fleet.season import MODES, Drawn, Season, draw_flight, fly_host, host_config  # noqa: E402
from psabench.koi.flight_data import FlightFound  # noqa: E402
from psabench.report import plots  # noqa: E402

ARCMIN = np.pi / 10_800
SEASON = Season(unit_class="bins", condition="clean", mode="none", flights=1, seed=1)
UNIT = 2
SENSORS = (("ν₁", "nu1_radps"), ("ν₃", "nu3_radps"), ("Δf₁", "df1_mps2"), ("Δf₃", "df3_mps2"))


def flown(d: Drawn) -> dict[str, FlightFound]:
    """The same flight without and with a correction at take-off."""
    cfg = host_config(SEASON.unit_class)
    return {name: fly_host(d, cfg, MODES[name], None, "unit", 0.0) for name in ("none", "dov")}


def draw(d: Drawn, found: dict[str, FlightFound]) -> Figure:
    """Attitude, sensors, place against time."""
    f = found["dov"]
    with plots.drawing(6.4, 3, 1, sharex=True) as (figure, (attitude, sensors, place)):
        minutes = f.sd_t_s / 60.0
        for (label, state), colour in zip((("heading", "beta3"), ("level", "alpha1")), plots.SERIES, strict=False):
            attitude.semilogy(minutes, f.sd[:, f.names.index(state)] / ARCMIN, color=colour, label=label)
        for (label, state), colour in zip(SENSORS, plots.SERIES, strict=True):
            sd = f.sd[:, f.names.index(state)]
            sensors.plot(minutes, sd / sd[0], color=colour, label=label)
        for (name, one), colour in zip(found.items(), plots.SERIES, strict=False):
            off_m = np.hypot(*place_errors(one, d.journey).T)
            title = "corrected at take-off" if name == "dov" else "not corrected"
            place.plot(one.t_s / 60.0, off_m, color=colour, label=f"autonomous, {title}")
        mark_events(f, (attitude, sensors, place))
        attitude.set_ylabel("standard deviation, ′")
        sensors.set_ylabel("of the prior's")
        place.set_ylabel("error of place, m")
        place.set_xlabel("time since power-on, min")
        for ax, where in ((attitude, "upper right"), (sensors, "upper right"), (place, "upper left")):
            ax.legend(loc=where)
    return figure


def mark_events(f: FlightFound, axes: tuple[object, ...]) -> None:
    """Stops as bands, take-off as a line."""
    still = [(a.t_s, b.t_s) for a, b in zip(f.events, f.events[1:], strict=False) if a.what == "stop"]
    for ax in axes:
        for begin_s, end_s in still:
            ax.axvspan(begin_s / 60.0, end_s / 60.0, color=plots.MUTED, alpha=0.2, lw=0)  # type: ignore[attr-defined]
        ax.axvline((f.take_off_s or 0.0) / 60.0, color=plots.MUTED, lw=0.9, ls=":")  # type: ignore[attr-defined]


if __name__ == "__main__":
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/img"
    drawn = draw_flight(SEASON, UNIT, 0)
    text = plots.standalone(plots.svg(draw(drawn, flown(drawn)), "koi"))
    (folder / "koi.svg").write_text(text, encoding="utf-8")
