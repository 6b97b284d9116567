#!/usr/bin/env python3
"""Draw docs/img/thermal_zero.svg and thermal_scale.svg: both methods; print the tables of docs/procedures/thermal.md.

The unit of examples/thermal: a tenth of the usual lags, ten times the rate. Takes minutes; same seed, same bytes.

    tools/plots/thermal.py [docs/img]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

from psabench.progress import Bar
from psabench.report import plots, thermal_grading, thermal_page
from psabench.report.thermal_grading import ThermalReport
from psabench.thermal.run import ThermalOptions, run_thermal

ROOT = Path(__file__).resolve().parents[2]
SCHEDULE = """
degree: 6
record_s: 0.2
soak:
  temperatures_c: [-60, -45, -30, -15, 0, 15, 30, 45, 60, 75, 85]
  ramp_k_per_min: 40
  dwell_s: 300
sweep: {rates_k_per_min: [5], every_s: 6, rest_s: 300, ramp_k_per_min: 40}
"""
RATES = """
degree: 6
record_s: 0.2
sweep: {rates_k_per_min: [2.5, 5, 10], every_s: 6, rest_s: 200, ramp_k_per_min: 40}
"""


def report_of(text: str) -> ThermalReport:
    """A run of the small unit by this schedule."""
    with tempfile.TemporaryDirectory() as work:
        schedule = Path(work) / "schedule.yaml"
        schedule.write_text(text, encoding="utf-8")
        unit = ROOT / "examples/thermal/small_unit.yaml"
        options = ThermalOptions(out=Path(work), schedule=str(schedule), scenario=unit)
        with run_thermal(options, Bar()) as done:
            return thermal_grading.graded_report(done.result, None, {})


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/img"
    report = report_of(SCHEDULE)
    for table in (
        thermal_grading.difference_table(report, "sweep-1"),
        thermal_grading.rates_table(report_of(RATES)),
    ):
        print("\n".join("  ".join(row) for row in table))
    for kind in ("zero", "scale"):
        text = plots.standalone(plots.svg(thermal_page.curve_figure(report, kind), f"thermal_{kind}"))
        (folder / f"thermal_{kind}.svg").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
